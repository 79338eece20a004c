"""Pictures on their way from the camera: each function against its formula in double precision, under jit and vmap."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from PIL import Image, ImageEnhance
from scipy import ndimage

import mjx_arenas as mja

SHAPE = (23, 31, 3)
RADIUS = 6
KINDS = ["uint8", "float32", "bfloat16"]
EPS = 2e-6
"""Of single precision, of numbers up to 1 in sums of a dozen terms."""


def picture(kind, seed=0, shape=SHAPE):
    """Random numbers over the whole range, both ends among them."""
    found = np.random.default_rng(seed).random(shape)
    found[0, 0], found[-1, -1] = 0, 1
    return np.round(255 * found).astype(np.uint8) if kind == "uint8" else np.asarray(jnp.asarray(found, kind))


def full(image):
    return 255.0 if image.dtype == np.uint8 else 1.0


def brightness(image, factor):
    return np.asarray(image, float) * factor


def contrast(image, factor):
    numbers = np.asarray(image, float)
    grey = (numbers @ [0.299, 0.587, 0.114] if numbers.shape[2] == 3 else numbers).mean()
    return (numbers - grey) * factor + grey


def blur(image, sigma):
    """SciPy's, cut off where ours is."""
    numbers = np.asarray(image, float)
    if not sigma:
        return numbers
    return ndimage.gaussian_filter(numbers, (sigma, sigma, 0), mode="nearest", truncate=(RADIUS + 1e-9) / sigma)


CASES = {
    "brightness": (mja.images.brightness, brightness, (0.0, 0.4, 1.0, 1.7)),
    "contrast": (mja.images.contrast, contrast, (0.0, 0.6, 1.0, 1.9)),
    "blur": (mja.images.blur, blur, (0.0, 0.4, 1.3, 2.9)),
}
WAYS = {
    "eager": lambda f: f,
    "jit": jax.jit,
    "vmap": lambda f: _second_of_two(jax.jit(jax.vmap(f))),
}


def _second_of_two(f):
    return lambda image, x: np.asarray(f(np.stack([image] * 2), np.stack([x] * 2)))[1]


def off(got, want, image):
    """How far a picture is from its numbers in double precision, in steps of bytes, or as a share of what the precision explains."""
    assert got.dtype == image.dtype
    assert got.shape == image.shape
    want = np.clip(want, 0, full(image))
    error = np.abs(np.asarray(got, float) - want).max()
    if image.dtype == np.uint8:
        return error / 0.501  # to the nearest, but for ties that single precision cannot tell
    return error / (EPS if image.dtype == np.float32 else 2.0**-8)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", CASES)
def test_formulas(name, kind, way):
    ours, oracle, numbers = CASES[name]
    image, compute = picture(kind), WAYS[way](ours)
    for x in numbers:
        got = np.asarray(compute(jnp.asarray(image), jnp.float32(x)))
        assert off(got, oracle(image, float(np.float32(x))), image) <= 1, x


@pytest.mark.parametrize("kind", ["uint8", "float32"])
@pytest.mark.parametrize("name", CASES)
def test_a_mutant_is_noticed(name, kind):
    """A factor that is 0.3 % off, or a standard deviation."""
    ours, oracle, numbers = CASES[name]
    image = picture(kind)
    assert max(off(ours(jnp.asarray(image), 1.003 * x), oracle(image, x), image) for x in numbers) > 1


@pytest.mark.parametrize("channels", [1, 2, 4])
def test_other_channels(channels):
    image = picture("float32", shape=(9, 5, channels))
    for ours, oracle, numbers in CASES.values():
        for x in numbers:
            assert off(np.asarray(jax.jit(ours)(jnp.asarray(image), x)), oracle(image, x), image) <= 1


def test_contrast_is_pillows():
    """Whose grey is a whole number, up to half a step beside ours, which the factor leaves (1 - factor) of."""
    image = picture("uint8", shape=(120, 160, 3))
    for factor in (0.3, 0.8, 1.5):
        want = np.asarray(ImageEnhance.Contrast(Image.fromarray(image)).enhance(factor), int)
        got = np.asarray(mja.images.contrast(jnp.asarray(image), factor), int)
        assert np.abs(got - want).max() <= 0.5 * abs(1 - factor) + 1 + 0.5  # it rounds grey, and cuts digits off


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_to_do(kind):
    """Factors 1, no noise and no blur leave every number as it is, traced or not."""
    image, key = jnp.asarray(picture(kind)), jax.random.key(0)
    for f in (lambda x: x, jax.jit):
        same = {
            "brightness": f(mja.images.brightness)(image, 1.0),
            "noise": f(mja.images.noise)(key, image, 0.0),
            "blur": f(mja.images.blur)(image, 0.0),
            "nearly no blur": f(mja.images.blur)(image, 1e-30),
        }
        for name, got in same.items():
            np.testing.assert_array_equal(np.asarray(got), np.asarray(image), name)


@pytest.mark.parametrize("size", [(1, 1, 3), (1, 9, 3), (4, 2, 1), (64, 3, 3)])
def test_blur_of_small_pictures(size):
    """The Gaussian reaches over the whole picture, and on over its edges."""
    image = picture("float32", shape=size)
    assert off(np.asarray(jax.jit(mja.images.blur)(jnp.asarray(image), 2.5)), blur(image, 2.5), image) <= 1


@pytest.mark.parametrize("radius", [0, 1, 3, 9])
def test_radius(radius):
    image, sigma = picture("float32"), radius / 2.5
    got = np.asarray(jax.jit(mja.images.blur, static_argnames="radius")(jnp.asarray(image), sigma, radius=radius))
    want = ndimage.gaussian_filter(image.astype(float), (sigma, sigma, 0), mode="nearest", radius=radius)
    assert off(got, want, image) <= 1


def test_noise():
    """Mean and deviation within five standard errors, no correlation between neighbours, another picture for each key."""
    grey = jnp.full((200, 150, 3), 0.5)
    std, n = 0.05, grey.size  # ten deviations from either end: nothing is cut
    got = np.asarray(mja.images.noise(jax.random.key(3), grey, std), float) - 0.5
    assert abs(got.mean()) < 5 * std / np.sqrt(n)
    assert abs(got.std() / std - 1) < 5 / np.sqrt(2 * n)
    assert abs(((got / std) ** 4).mean() - 3) < 5 * np.sqrt(96 / n)  # a Gaussian's, whose eighth moment is 105
    for axis in range(3):
        a, b = np.moveaxis(got, axis, 0)[:-1], np.moveaxis(got, axis, 0)[1:]
        assert abs((a * b).mean()) < 5 * std**2 / np.sqrt(a.size)
    again = mja.images.noise(jax.random.key(3), grey, std)
    np.testing.assert_array_equal(np.asarray(again, float) - 0.5, got)
    other = np.asarray(mja.images.noise(jax.random.key(4), grey, std), float) - 0.5
    assert abs((other * got).mean()) < 5 * std**2 / np.sqrt(n)


def test_noise_of_bytes():
    """The same draws in steps of 255, rounded; a deviation that is 0.3 % off is noticed."""
    image, key, std = picture("uint8"), jax.random.key(1), 0.1
    draws = np.asarray(jax.random.normal(key, SHAPE), float)
    want = image + draws * std * 255
    assert off(np.asarray(mja.images.noise(key, jnp.asarray(image), std)), want, image) <= 1
    assert off(np.asarray(mja.images.noise(key, jnp.asarray(image), 1.003 * std)), want, image) > 1
    level = np.full((200, 150, 3), 128, np.uint8)
    found = np.asarray(mja.images.noise(key, jnp.asarray(level), 0.02), float) - 128
    spread = np.hypot(0.02 * 255, np.sqrt(1 / 12))  # rounding adds its own
    assert abs(found.std() / spread - 1) < 5 / np.sqrt(2 * level.size)


def test_noise_in_batches():
    """The picture of a key does not depend on the others."""
    images, keys = jnp.asarray([picture("float32", i) for i in range(3)]), jax.random.split(jax.random.key(0), 3)
    got = jax.jit(jax.vmap(mja.images.noise))(keys, images, jnp.array([0.0, 0.1, 0.2]))
    np.testing.assert_array_equal(got[0], images[0])
    np.testing.assert_allclose(got[2], mja.images.noise(keys[2], images[2], 0.2), atol=EPS)


BEHIND = {
    "a colour": ((0.2, 0.5, 1.0), (0.2, 0.5, 1.0)),
    "bytes": (np.array([51, 102, 255], np.uint8), (0.2, 0.4, 1.0)),
    "a picture": (picture("float32", 5), picture("float32", 5)),
    "a picture of bytes": (picture("uint8", 5), picture("uint8", 5) / 255),
}


@pytest.mark.parametrize("way", ["eager", "jit", "vmap"])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("case", BEHIND)
def test_background(case, kind, way):
    """It is where depth is 0, and nowhere else; what is there stays to the last bit."""
    given, share = BEHIND[case]
    image, depth = picture(kind), np.random.default_rng(1).random(SHAPE[:2]).astype(np.float32) + 1e-30
    nothing = np.random.default_rng(2).random(SHAPE[:2]) < 0.3
    depth[nothing] = 0
    ours = mja.images.background
    if way == "vmap":
        pair = jnp.stack([depth, np.ones_like(depth)])
        both = jax.jit(jax.vmap(ours, in_axes=(None, 0, None)))
        got, untouched = both(jnp.asarray(image), pair, jnp.asarray(given))
        np.testing.assert_array_equal(np.asarray(untouched), image)
    else:
        given = jnp.asarray(given) if way == "jit" else given
        got = WAYS[way](ours)(jnp.asarray(image), jnp.asarray(depth), given)
    want = np.broadcast_to(np.asarray(share, float) * full(image), SHAPE)
    np.testing.assert_array_equal(np.asarray(got)[~nothing], image[~nothing])
    assert off(np.asarray(got), np.where(nothing[..., None], want, np.asarray(image, float)), image) <= 1


def test_without_nan():
    """Pictures and gradients, at sigma 0 and far from the range, too."""
    image = jnp.asarray(picture("float32"))
    for f in (mja.images.brightness, mja.images.contrast, mja.images.blur):
        both = jax.jit(jax.value_and_grad(lambda x, f=f: f(image, x).sum()))
        for x in (0.0, 1e-3, 1.0, 1e30):
            value, slope = both(jnp.float32(x))
            assert np.isfinite(value), (f, x)
            assert np.isfinite(slope), (f, x)
        assert np.isfinite(jax.jit(jax.grad(lambda image, f=f: f(image, 0.0).sum()))(image)).all()
    slope = jax.jit(jax.grad(lambda x: mja.images.noise(jax.random.key(0), image, x).sum()))(0.0)
    assert np.isfinite(slope)


def test_in_double_precision():
    """With JAX_ENABLE_X64, pictures of doubles keep their digits, and the noise of a key is the same."""
    image = picture("float32").astype(float)
    before = np.asarray(mja.images.noise(jax.random.key(0), jnp.asarray(image, jnp.float32), 0.05))
    with jax.enable_x64(True):
        for ours, oracle, numbers in CASES.values():
            for x in numbers:
                got = np.asarray(jax.jit(ours)(jnp.asarray(image), jnp.float64(x)))
                assert got.dtype == float
                np.testing.assert_allclose(got, np.clip(oracle(image, x), 0, 1), atol=1e-14)
        after = np.asarray(mja.images.noise(jax.random.key(0), jnp.asarray(image), 0.05))
    np.testing.assert_allclose(after, before, atol=EPS)


def test_in_strict_modes():
    """Neither promotions of ranks nor transfers of numbers that are ours."""
    image, key, depth = jnp.asarray(picture("uint8")), jax.random.key(0), jnp.zeros(SHAPE[:2])
    with jax.numpy_rank_promotion("raise"), jax.transfer_guard_host_to_device("disallow"):
        jax.block_until_ready(
            [
                mja.images.brightness(image, 0.5),
                mja.images.contrast(image, 0.5),
                mja.images.noise(key, image, 0.5),
                mja.images.blur(image, 0.5),
                mja.images.background(image, depth, (0.1, 0.2, 0.3)),
            ]
        )


IMAGE, DEPTH, KEY = jnp.zeros((4, 5, 3)), jnp.zeros((4, 5)), jax.random.key(0)
PICTURE = "`image` must be one picture, (height, width, channels) of uint8 or floats, got "
BAD = {
    "a batch": (
        lambda: mja.images.brightness(jnp.zeros((2, 4, 5, 3)), 1.0),
        PICTURE + "float32 of shape (2, 4, 5, 3): jax.vmap adds batches.",
    ),
    "no channels": (lambda: mja.images.contrast(jnp.zeros((4, 5)), 1.0), PICTURE + "float32 of shape (4, 5)."),
    "empty": (lambda: mja.images.contrast(jnp.zeros((4, 0, 3)), 1.0), PICTURE + "float32 of shape (4, 0, 3)."),
    "integers": (
        lambda: mja.images.blur(jnp.zeros((4, 5, 3), jnp.int32), 1.0),
        PICTURE + "int32 of shape (4, 5, 3).",
    ),
    "a list": (lambda: mja.images.blur([[[0.1]]], 1.0), PICTURE + "list."),
    "factor": (lambda: mja.images.brightness(IMAGE, -0.5), "`factor` must be >= 0, got -0.5."),
    "nan": (lambda: mja.images.contrast(IMAGE, np.nan), "`factor` must be a finite number, got nan."),
    "a factor for each": (
        lambda: jax.jit(mja.images.brightness)(IMAGE, jnp.ones(3)),
        "`factor` must be one number >= 0, got float32 of shape (3,).",
    ),
    "std": (lambda: mja.images.noise(KEY, IMAGE, "a"), "`std` must be a finite number, got 'a'."),
    "key": (
        lambda: mja.images.noise(0, IMAGE, 0.1),
        "`key` must be a key such as jax.random.key(0), got 0.",
    ),
    "keys": (
        lambda: mja.images.noise(jax.random.split(KEY, 2), IMAGE, 0.1),
        "`key` must be one key, of one world, got shape (2,): use jax.vmap, or randomize.",
    ),
    "radius": (
        lambda: mja.images.blur(IMAGE, 1.0, -1),
        "`radius` must be a whole number from 0 to 64, which is not traced, got -1.",
    ),
    "a radius that takes minutes": (
        lambda: mja.images.blur(IMAGE, 1.0, 2000),
        "`radius` must be a whole number from 0 to 64, which is not traced, got 2000.",
    ),
    "a radius that is too small": (
        lambda: mja.images.blur(IMAGE, 4.0),
        "`radius` must be at least 2 times `sigma`, 4, or most of the Gaussian is cut off, got 6.",
    ),
    "depth": (
        lambda: mja.images.background(IMAGE, IMAGE, (0, 0, 0)),
        "`depth` must be floats of the picture's shape (4, 5) [m], got float32 of shape (4, 5, 3).",
    ),
    "four channels": (
        lambda: mja.images.background(jnp.zeros((4, 5, 4)), DEPTH, (0, 0, 0)),
        "`image` must be one picture, (height, width, 3) of uint8 or floats, got float32 of shape (4, 5, 4).",
    ),
    "rgb": (
        lambda: mja.images.background(IMAGE, DEPTH, (255, 0, 0)),
        "`rgb` must be between 0 and 1, or of uint8, got (255, 0, 0).",
    ),
    "whole numbers": (
        lambda: mja.images.background(IMAGE, DEPTH, np.array([255, 0, 0])),
        "`rgb` must be (3,) or a picture (4, 5, 3), of floats from 0 to 1 or of uint8, got int64 of shape (3,).",
    ),
    "colours of an array": (
        lambda: mja.images.background(IMAGE, DEPTH, jnp.array([0.5, 2.0, 0.0])),
        "`rgb` must be between 0 and 1, or of uint8, got [0.5, 2.0, 0.0].",
    ),
    "bytes as floats behind": (
        lambda: mja.images.background(IMAGE, DEPTH, jnp.full((4, 5, 3), 128.0)),
        "`rgb` must be between 0 and 1, or of uint8, got a picture with numbers from 128 to 128.",
    ),
    "rgba": (
        lambda: mja.images.background(IMAGE, DEPTH, (1, 0, 0, 1)),
        "`rgb` must be 3 finite numbers, got (1, 0, 0, 1).",
    ),
    "another size": (
        lambda: jax.jit(mja.images.background)(IMAGE, DEPTH, jnp.zeros((5, 4, 3))),
        "`rgb` must be (3,) or a picture (4, 5, 3), of floats from 0 to 1 or of uint8, got float32 of shape (5, 4, 3).",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_wrong_uses(case):
    """One sentence each."""
    call, says = BAD[case]
    with pytest.raises(ValueError, match="must be") as raised:
        call()
    assert str(raised.value) == says


def test_all_at_once():
    with pytest.raises(ValueError, match=r"^3 problems in `blur`:\n- `image` .*\n- `sigma` .*\n- `radius` "):
        mja.images.blur(jnp.zeros(3), -1.0, 0.5)
