"""The frames of bodies' inertias are the compiler's, in the sense and order of their axes, and so is what sensors read in them."""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas import dr, solids

READ = """<mujoco><option gravity="0 0 0"/><worldbody><body name="a" pos="0 0 1"><freejoint/>
<geom type="box" size=".1 .06 .08" euler="50 40 70" contype="0" conaffinity="0"/>
<geom name="g" type="box" size=".05 .02 .08" pos=".05 .05 .06" euler="20 70 10" contype="0" conaffinity="0"/></body>
<body name="b" pos="1 0 1"><freejoint/><geom size=".1" contype="0" conaffinity="0"/></body></worldbody><sensor>
<framepos objtype="body" objname="b" reftype="body" refname="a"/><framequat objtype="body" objname="a"/></sensor></mujoco>"""
PLAIN = """<mujoco><worldbody><body name="a"><freejoint/>
<geom name="g" type="box" size=".1 .06 .08" {first}/><geom name="h" type="box" size=".05 .02 .08" {second}/></body></worldbody></mujoco>"""


def boxes(rng, n, number):
    """(n, 3, 3) tensors of bodies of a number of boxes, some of which are not turned."""
    half, place = np.exp(rng.uniform(np.log(0.01), np.log(0.3), (n, number, 3))), rng.uniform(-0.3, 0.3, (n, number, 3))
    mass = 8000 * half.prod(-1)
    own = mass[..., None] / 3 * ((half**2).sum(-1, keepdims=True) - half**2)
    quat = np.where(rng.random((n, number, 1)) < 0.3, np.eye(4)[0], rng.normal(size=(n, number, 4)))
    arm = place - (mass[..., None] * place).sum(1, keepdims=True) / mass.sum(1)[:, None, None]
    tensor = solids.tensors(quat / np.linalg.norm(quat, axis=-1, keepdims=True), own)
    tensor += mass[..., None, None] * (
        (arm**2).sum(-1)[..., None, None] * np.eye(3) - arm[..., None] * arm[..., None, :]
    )
    return (tensor.sum(1) + tensor.sum(1).swapaxes(1, 2)) / 2


def by_mujoco(tensors):
    """Quaternions (n, 4) and moments (n, 3) by MuJoCo, and the most rotations that one took."""
    quats, moments, axes = np.zeros((len(tensors), 4)), np.zeros((len(tensors), 3)), np.zeros(9)
    turns = [mujoco.mju_eig3(m, axes, q, t.ravel()) for m, q, t in zip(moments, quats, tensors, strict=True)]
    return quats, moments, max(turns)


def apart(a, b):
    """(n,) by how much unit quaternions differ, whichever of two signs they have."""
    return np.minimum(np.abs(a - b).max(-1), np.abs(a + b).max(-1))


@pytest.mark.parametrize("number", [1, 2, 4])
@pytest.mark.parametrize("heavy", [1.0, 1e-9])
def test_principal_axes(number, heavy):
    """Of many bodies whose moments differ by more than 1 %, large and tiny, in double and in single precision."""
    tensors = heavy * boxes(np.random.default_rng(number), 2000, number)
    quats, moments, turns = by_mujoco(tensors)
    clear = (moments[:, :2] - moments[:, 1:]).min(1) > 0.01 * moments[:, 0]
    assert clear.sum() > 1000
    assert turns < solids._ROTATIONS
    for dtype, tolerance in ((np.float64, 1e-11), (np.float32, 1e-4)):
        got = (
            solids.principal(tensors) if dtype is np.float64 else jax.jit(solids.principal)(jnp.asarray(tensors, dtype))
        )
        quat, moment = (np.asarray(x, float) for x in got)
        assert apart(quat, quats)[clear].max() < tolerance
        size = np.linalg.norm(moments, axis=1)[:, None, None]
        assert (np.abs(solids.tensors(quat, moment) - tensors) / size).max() < 20 * np.finfo(dtype).eps


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_axes_of_symmetric_bodies(dtype):
    """What is equal by symmetry counts as equal: products of inertia, moments, and those that a turn of 45 degrees parts."""
    square = np.array([[2, 0.3, 0], [0.3, 2, 0], [0, 0, 1]])
    found = [
        np.eye(3), np.diag([1.0, 2, 2]), np.diag([1.0, 1, 2]), np.diag([1.0, 2, 3]), np.diag([2.0, 1, 3]), square, 0 * square,
        *(square[np.ix_(order, order)] for order in ([1, 2, 0], [0, 2, 1], [2, 0, 1])), 3 * np.eye(3) + 0.4, 3.5 * np.eye(3) - 0.4,
    ]  # fmt: skip
    rounding = np.random.default_rng(0).uniform(-0.5, 0.5, (len(found), 3, 3)) * np.finfo(dtype).eps
    tensors = np.array(found)
    rounding = rounding * tensors.max((1, 2), keepdims=True)
    quats, moments, _ = by_mujoco(tensors)
    for off in (0, rounding + rounding.swapaxes(1, 2)):
        xp = np if dtype is np.float64 else jnp
        quat, moment = solids.principal(xp.asarray(tensors + off, dtype))
        np.testing.assert_allclose(moment, moments, atol=1e-6)
        assert apart(np.asarray(quat), quats).max() < 1e-6


@pytest.mark.slow
@pytest.mark.slow_on("warp")
def test_sensors_in_the_frame_of_an_inertia(impl):
    """A position in it, and how it is turned, are C MuJoCo's in worlds of other densities."""
    arena = mja.Arena.from_xml(READ)
    arena.vary(density=dr.Term("geom.density", "g"))
    ranges = mja.ArenaRanges(terms={"density": mja.LogUniform(300.0, 3000.0)})
    batch = arena.randomize(arena.put_model(impl), mja.world_keys(0, range(8)), ranges)
    data = mja.step(batch, mja.make_data(batch))
    for i in range(8):
        model = arena.compile(batch.world(i))
        twin = mujoco.MjData(model)
        mujoco.mj_step(model, twin)
        np.testing.assert_allclose(data.sensordata[i], twin.sensordata, atol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("", ""),
        ('euler="40 50 60"', 'mass="0"'),
        ('mass="0"', 'euler="40 50 60"'),
        ('pos=".1 .1 .1"', 'euler="0 0 45"'),
    ],
)
def test_axes_of_worlds(first, second):
    """Of bodies of two geoms, of which one may weigh nothing: the compiler takes the other's axes as they are."""
    arena = mja.Arena.from_xml(PLAIN.format(first=first, second=second))
    arena.vary(size=dr.Term("geom.size", ["g", "h"]), place=dr.Term("geom.pos", ["g", "h"]))
    far = mja.Uniform(0.8, 1.2, relative="scale")
    ranges = mja.ArenaRanges(terms={"size": far, "place": mja.Uniform(-0.05, 0.05, relative="add")})
    batch = arena.randomize(arena.put_model("jax"), mja.world_keys(0, range(6)), ranges)
    want = [arena.compile(batch.world(i)) for i in range(6)]
    np.testing.assert_allclose(
        solids.rotation(np.asarray(batch.model.body_iquat[:, 1])),
        solids.rotation(np.array([m.body_iquat[1] for m in want])),
        atol=1e-4,
    )
    np.testing.assert_allclose(batch.model.body_inertia[:, 1], [m.body_inertia[1] for m in want], rtol=1e-4)
