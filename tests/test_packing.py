"""Packing of rounded rectangles: inside, apart, dense, honest about what has no place, and the same in any batch.

What it promises is checked in float64 by distances between vertices and sides, which share nothing with its octagons.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mjx_arenas.sample import packing
from mjx_arenas.sample.packing import Region, Solids, pack

EPS = float(np.finfo(np.float32).eps)


def solids(half, radius=0.0, pose=(0.0, 0.0, 0.0), bottom=0.0, top=0.1, present=True):
    """Solids from what broadcasts to them."""
    n = len(half)
    full = [(pose, (n, 3)), (half, (n, 2)), (radius, (n,)), (bottom, (n,)), (top, (n,))]
    arrays = (jnp.broadcast_to(jnp.asarray(a, jnp.float32), shape) for a, shape in full)
    return Solids(*arrays, jnp.broadcast_to(jnp.asarray(present), (n,)))


def regions(n, half=0.4, pose=(0.0, 0.0, 0.0)):
    return Region(*(jnp.broadcast_to(jnp.asarray(a, jnp.float32), (n, k)) for a, k in ((pose, 3), (half, 2))))


NOTHING = solids(np.zeros((0, 2)))


def draw(key, shapes, areas, obstacles=NOTHING, ignore=None, **options):
    """One world from one key."""
    if ignore is None:
        ignore = jnp.zeros((len(shapes.radius), len(obstacles.radius)), bool)
    return pack(jax.random.split(key, len(shapes.radius)), shapes, areas, obstacles, ignore, **options)


@functools.partial(jax.jit, static_argnames="worlds")
def draws(worlds, *args, seed=0, **options):
    """Worlds that differ in their keys."""
    return jax.vmap(lambda key: draw(key, *args, **options))(jax.random.split(jax.random.key(seed), worlds))


# The independent check -------------------------------------------------------------------------------------------


def turned(yaw, xy):
    c, s = np.cos(yaw), np.sin(yaw)
    return np.stack([c * xy[..., 0] - s * xy[..., 1], s * xy[..., 0] + c * xy[..., 1]], axis=-1)


def corners(pose, half):
    """Corners (..., 4, 2) of rectangles, in order."""
    pose, half = np.asarray(pose, float), np.asarray(half, float)
    signs = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    return pose[..., None, :2] + turned(pose[..., None, 2], signs * half[..., None, :])


def cross(a, b):
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def distance(a, b):
    """Distances (...) between rectangles of corners (..., 4, 2): 0 where sides cross or one holds the other's corner."""

    def corner_to_side(points, shape):
        start, side = shape[..., None, :, :], (np.roll(shape, -1, axis=-2) - shape)[..., None, :, :]
        rel = points[..., :, None, :] - start
        along = (rel * side).sum(-1) / np.maximum((side * side).sum(-1), 1e-300)
        away = np.linalg.norm(rel - np.clip(along, 0, 1)[..., None] * side, axis=-1)
        return away.min((-1, -2)), (cross(side, rel) > 0).all(-1).any(-1)

    def sides_cross():
        p, q = a[..., :, None, :], b[..., None, :, :]
        r, s = np.roll(a, -1, axis=-2)[..., :, None, :] - p, np.roll(b, -1, axis=-2)[..., None, :, :] - q
        on_both_sides = cross(r, q - p) * cross(r, q + s - p) < 0
        return (on_both_sides & (cross(s, p - q) * cross(s, p + r - q) < 0)).any((-1, -2))

    (to_b, in_b), (to_a, in_a) = corner_to_side(a, b), corner_to_side(b, a)
    return np.where(in_a | in_b | sides_cross(), 0.0, np.minimum(to_a, to_b))


def check(pose, found, shapes, areas, obstacles=NOTHING, ignore=None, gap=0.0, margin=0.0):
    """Asserts what `pack` promises of worlds (W, n): all in float64, from the float32 poses as they are."""
    pose, found = np.asarray(pose, float), np.asarray(found)
    (half, radius, bottom, top), n = (np.asarray(a, float) for a in shapes[1:5]), len(shapes.radius)
    assert np.isfinite(pose).all()
    assert found[:, ~np.asarray(shapes.present)].all()
    there = found & np.asarray(shapes.present)
    shape = corners(pose, half)

    area, area_half = np.asarray(areas.pose, float), np.asarray(areas.half, float)
    local = turned(-area[:, None, 2], shape - area[:, None, :2])
    over = (np.abs(local).max(-2) + radius[:, None] + margin - area_half).max(-1)
    assert (np.where(there, over, -1.0) <= 8 * EPS * (np.abs(area[:, :2]) + area_half).sum(-1)).all()

    for i in range(n):
        for j in range(i):
            if bottom[i] < top[j] and bottom[j] < top[i]:
                both = there[:, i] & there[:, j]
                apart = distance(shape[both, i], shape[both, j]) - radius[i] - radius[j]
                assert (apart >= gap).all()
        for j in np.flatnonzero(np.asarray(obstacles.present)):
            o = Solids(*(np.asarray(a[j], float) for a in obstacles))
            if (ignore is None or not ignore[i, j]) and bottom[i] < o.top and o.bottom < top[i]:
                apart = distance(shape[there[:, i], i], corners(o.pose, o.half)) - radius[i] - o.radius
                assert (apart >= gap).all()


# Tests -------------------------------------------------------------------------------------------------------------

BOX, LONG, DISC, CAPSULE = ((0.05, 0.05), 0.0), ((0.12, 0.02), 0.0), ((0.0, 0.0), 0.06), ((0.08, 0.0), 0.03)
KINDS = {"boxes": [BOX], "long": [LONG], "discs": [DISC], "capsules": [CAPSULE], "mixed": [BOX, LONG, DISC, CAPSULE]}


def kinds(name, n):
    half, radius = zip(*(KINDS[name][i % len(KINDS[name])] for i in range(n)), strict=True)
    return np.array(half), np.array(radius)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_inside_and_apart(kind):
    """Crowded worlds far from the origin: with a gap and a margin, past obstacles, on three levels."""
    n = 14
    half, radius = kinds(kind, n)
    level = np.where(np.arange(n) < 10, 0.0, np.where(np.arange(n) < 13, 0.1, 0.05))  # touching; across both
    shapes = solids(half, radius, bottom=level, top=level + 0.1, present=np.arange(n) != 4)
    areas = regions(n, (0.4, 0.25), (2.0, -3.0, 0.7))
    around = [[2.1, -3.0, 0.3], [1.8, -3.1, -1.0], [2.0, -2.9, 2.0], [2.0, -3.0, 0.0]]
    obstacles = solids(
        [[0.05, 0.03], [0, 0], [0.1, 0], [1, 1]], [0, 0.07, 0.02, 0], around, [0, 0.12, 0, -1], [0.2, 0.3, 0.1, 0.05]
    )
    ignore = np.zeros((n, 4), bool)
    ignore[:, 3] = ignore[7, 0] = True
    options = {"gap": 0.01, "margin": 0.02}
    pose, found = draws(400, shapes, areas, obstacles, jnp.asarray(ignore), **options)
    assert 0.6 < found.mean() < 1.0
    check(pose, found, shapes, areas, obstacles, ignore, **options)
    # What does not count is overlapped: the last level stands over the first, number 7 on its obstacle.
    for i, rest in ((10, corners(pose[:, 0], half[0])), (7, corners(around[0], [0.05, 0.03]))):
        assert (distance(corners(pose[:, i], half[i]), rest)[found[:, i]] <= radius[i]).any()


def test_distance():
    """Exact to rounding in all positions, shapes without area and parallel ones among them."""
    rng = np.random.default_rng(0)
    n = 20000
    poses = rng.uniform([-0.15, -0.15, -np.pi], [0.15, 0.15, np.pi], (2, n, 3)).astype(np.float32)
    poses[:, ::3, 2] = np.pi / 2 * rng.integers(-2, 3, (2, len(poses[0, ::3])))
    poses[1, ::5, 2] = poses[0, ::5, 2]
    halves = (rng.uniform(0, 0.15, (2, n, 2)) * (rng.random((2, n, 2)) < 0.7)).astype(np.float32)
    true = distance(corners(poses[0], halves[0]), corners(poses[1], halves[1]))
    rounding = 16 * EPS * (halves.sum((0, 2)) + true)

    @jax.jit
    @jax.vmap
    def clear(pose, half, need):
        one, other = (packing._frames(p) for p in pose)
        return packing._clear(one, half[0], other, half[1], need)

    def at(need):
        return np.asarray(clear(poses.swapaxes(0, 1), halves.swapaxes(0, 1), need.astype(np.float32)))

    assert 0.1 < (true == 0).mean() < 0.9
    assert not at(true + rounding).any()
    assert at(true - rounding)[true > rounding].all()


@pytest.mark.slow
def test_crowds():
    """How many of 120 worlds hold all of 5, 10, ... 30 squares, at 8, 16, ... 47 % of the area."""
    areas = regions(30)
    shapes = jax.vmap(lambda n: solids(np.full((30, 2), 0.05), present=jnp.arange(30) < n))(jnp.arange(5, 31, 5))
    keys = jax.random.split(jax.random.key(5), 120)
    pose, found = jax.jit(lambda s: jax.lax.map(lambda s: jax.vmap(lambda key: draw(key, s, areas))(keys), s))(shapes)
    full = np.asarray(found).all(-1).mean(-1)
    assert (full[:3] == 1.0).all()
    assert (full[3:] >= [0.99, 0.97, 0.25]).all(), full
    assert found[5].mean() > 0.95
    for i in (4, 5):
        check(pose[i], found[i], jax.tree.map(lambda a, i=i: a[i], shapes), areas)


@pytest.mark.parametrize("half", [(0.05, 0.05), (0.1, 0.02)])
def test_uniform(half):
    """Alone, a rectangle has any yaw and any place that the yaw leaves, equally often."""
    worlds, areas = 40000, regions(1, (0.4, 0.2), (1.0, 2.0, 0.5))
    pose, found = draws(worlds, solids([half]), areas)
    assert found.all()
    pose = np.asarray(pose, float)[:, 0]
    yaw = pose[:, 2] - 0.5
    c, s = np.abs(np.cos(yaw)), np.abs(np.sin(yaw))
    room = np.array([0.4, 0.2]) - np.stack([c * half[0] + s * half[1], s * half[0] + c * half[1]], axis=-1)
    uniform = np.column_stack([turned(-0.5, pose[:, :2] - [1.0, 2.0]) / room / 2 + 0.5, (yaw / (2 * np.pi)) % 1])
    counts, _ = np.histogramdd(uniform, bins=(6, 6, 6), range=[(0, 1)] * 3)
    assert counts.sum() >= worlds - 10  # rounding puts a few on the edge
    expected, dof = worlds / 216, 215
    assert ((counts - expected) ** 2 / expected).sum() < dof + 4 * np.sqrt(2 * dof)


def test_uniform_beside_an_obstacle():
    """What an obstacle leaves is as likely everywhere."""
    areas, obstacles = regions(1, 0.2), solids([[0.05, 0.1]], pose=(-0.15, 0.0, 0.0))
    pose, found = draws(40000, solids([[0, 0]], 0.02), areas, obstacles)
    assert found.all()
    counts, _, _ = np.histogram2d(*np.asarray(pose)[:, 0, :2].T, bins=6, range=[(-0.18, 0.18)] * 2)
    free = counts[2:].ravel()  # right of the obstacle
    assert ((free - free.mean()) ** 2 / free.mean()).sum() < 23 + 4 * np.sqrt(2 * 23)
    left = 0.36**2 - (0.08 * 0.24 + 0.02 * 0.2 + np.pi / 2 * 0.02**2)
    share, p = free.sum() / 40000, 0.24 * 0.36 / left
    assert abs(share - p) < 4 * np.sqrt(p * (1 - p) / 40000)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["boxes", "capsules"])
def test_flag_against_brute_force(kind):
    """Among random obstacles: no place where a grid shows none, a place wherever it shows room."""
    rng = np.random.default_rng(1)
    worlds, m, half, radius = 70, 9, *kinds(kind, 1)
    present = np.arange(m) < np.where(np.arange(worlds) % 2, 5, m)[:, None]
    poses = rng.uniform([-0.2, -0.2, -3], [0.2, 0.2, 3], (worlds, m, 3)).astype(np.float32)
    sizes = rng.uniform(0.03, 0.1, (worlds, m, 2)).astype(np.float32)
    yaws = rng.uniform(-np.pi, np.pi, (worlds, 1)).astype(np.float32)
    shapes, areas = solids(half, radius), regions(1, 0.2)

    def one(key, pose, size, there, yaw):
        return draw(key, shapes, areas, solids(size, 0.02, pose, present=there), rots=jnp.tile(yaw[:, None], 2))

    keys = jax.random.split(jax.random.key(0), worlds)
    pose, found = jax.jit(jax.vmap(one))(keys, poses, sizes, present, yaws)
    pose, found = np.asarray(pose)[:, 0], np.asarray(found)[:, 0]
    np.testing.assert_array_equal(pose[:, 2], yaws[:, 0])

    steps, step = np.linspace(-0.17, 0.17, 19), 0.34 / 18
    grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    room = np.empty((worlds, len(grid)))  # clearance at each point of the grid
    for i in range(worlds):
        place = np.column_stack([grid, np.full(len(grid), yaws[i, 0])])
        rim = corners(place, half[0])
        room[i] = 0.2 - radius[0] - np.abs(rim).max((1, 2))
        for p, size in zip(poses[i, present[i]], sizes[i, present[i]], strict=True):
            room[i] = np.minimum(room[i], distance(rim, corners(p, size)) - radius[0] - 0.02)
    # Moving by half a cell's diagonal changes a clearance by that at most.
    never = room.max(1) < -step / np.sqrt(2)
    ample = (room > 0).sum(1) >= 4
    assert never.sum() > 10
    assert ample.sum() > 10
    assert not found[never].any()
    assert found[ample].all()
    rim = corners(pose, half[0])
    apart = np.where(present, distance(rim[:, None], corners(poses, sizes)), np.inf).min(1) - radius[0] - 0.02
    assert (apart[found] > 0).all()


def test_true_footprints():
    """A disc and a capsule fit where only they do, not the boxes around them."""
    # Inside a corner between two discs, the gap of bounding boxes is negative.
    disc = solids([[0, 0]], 0.05)
    spot = regions(1, 0.0501, (0.072, 0.072, 0.0))
    assert draws(8, disc, spot, disc)[1].all()
    assert not draws(8, solids([[0.05, 0.05]]), spot, disc)[1].any()
    # The rounded end of a capsule beside a disc.
    capsule = solids([[0.1, 0.0]], 0.05)
    spot = regions(1, (0.1501, 0.0501), (0.172, 0.072, 0.0))
    assert draws(8, capsule, spot, disc, rots=jnp.zeros((1, 2)))[1].all()
    assert not draws(8, solids([[0.15, 0.05]]), spot, disc, rots=jnp.zeros((1, 2)))[1].any()


def test_without_a_place():
    """One without a place says so, and is no obstacle to the next."""
    shapes = solids([[0.1, 0.1]] * 3)
    obstacle = solids([[0.05, 0.05]])
    ignore = jnp.array([[False], [True], [True]])
    pose, found = draws(16, shapes, regions(3, 0.15), obstacle, ignore)
    np.testing.assert_array_equal(found, [[False, True, False]] * 16)
    check(pose, found, shapes, regions(3, 0.15), obstacle, np.asarray(ignore))
    assert np.isfinite(pose).all()


@pytest.mark.parametrize("room", [(0.1, 0.02), (0.085, 0.085), (0.09, 0.08), (0.07, 0.07), (0.3, 0.019), (0.099, 0.05)])
def test_fits(room):
    """A rectangle fits into a region where a yaw lets it, exactly as wide or along the diagonal."""
    half = np.array([0.1, 0.02])
    yaw = np.linspace(0, np.pi, 2001)
    c, s = np.abs(np.cos(yaw))[:, None], np.abs(np.sin(yaw))[:, None]
    fits = (c * half + s * half[::-1] <= np.array(room) + 1e-9).all(-1).any()
    for a, b in ((room, half), (room[::-1], half[::-1])):
        assert packing._fits(jnp.asarray(b), jnp.asarray(a, jnp.float32) + 1e-6) == fits
    _, found = draws(4, solids([half]), regions(1, room))
    assert not found.any() or fits


def test_exactly_as_wide():
    """What is as wide as its region has its place there, wherever in the world."""
    areas = regions(2, (0.1, 0.04), [[3.0, -4.0, 0.3], [0.1, 0.7, -2.5]])
    pose, found = draws(100, solids([[0.1, 0.04], [0.09, 0.03]], [0.0, 0.01]), areas, rots=jnp.zeros((2, 2)))
    assert found.all()
    np.testing.assert_allclose(pose, np.broadcast_to(areas.pose, pose.shape), atol=4 * EPS * 7.2)


@pytest.mark.slow
def test_yaws_within():
    """Of what may turn a little, in the frame of its region, also in a crowd; what may have any yaw is where it was."""
    half, radius = [[0.055, 0.03], [0.06, 0.04], [0.07, 0.02], [0.06, 0.05], [0.05, 0.02]], 0.01
    areas = regions(5, (0.2, 0.13), [[1.0, 2.0, 0.7]] * 5)
    least_most = jnp.array([[-np.pi, np.pi], [-0.2, 0.3], [1.4, 1.6], [-0.1, -0.1], [0.0, 2 * np.pi]])
    pose, found = draws(500, solids(half, radius), areas, rots=least_most)
    check(pose, found, solids(half, radius), areas)
    assert 0.2 < found.all(1).mean() < 0.95  # a crowd
    yaw = np.remainder(np.asarray(pose)[..., 2] - 0.7 + np.pi, 2 * np.pi) - np.pi
    for k in (1, 2, 3):
        low, high = least_most[k]
        own = yaw[np.asarray(found)[:, k], k]
        assert low - 1e-6 <= own.min() < low + 0.01
        assert high - 0.01 < own.max() <= high + 1e-6
    one = draws(500, solids(half, radius), areas)
    np.testing.assert_array_equal(np.asarray(one[0])[:, 0], np.asarray(pose)[:, 0])
    assert np.ptp(yaw[:, 4]) > 6.2


@pytest.mark.parametrize("least_most", [(-0.3, 0.3), (-0.3, 0.0), (0.0, 0.2), (1.2, 1.6), (0.0, 0.0)])
def test_exactly_as_wide_within_yaws(least_most):
    """What fits at a yaw that it may have, and hardly at another, has its place."""
    half = [[0.15, 0.05]] if least_most[1] < 1 else [[0.05, 0.15]]
    areas = regions(1, (0.15, 0.15), (0.4, -0.2, 0.6))
    pose, found = draws(200, solids(half), areas, rots=jnp.array([least_most]))
    check(pose, found, solids(half), areas)
    assert found.all()


def test_a_round_for_the_hopeless(monkeypatch):
    """What fits nowhere, or is absent, costs one round."""
    rounds = []
    fold_in = jax.random.fold_in
    monkeypatch.setattr(
        jax.random, "fold_in", lambda key, i: (jax.debug.callback(rounds.append, i), fold_in(key, i))[1]
    )
    shapes = solids([[0.3, 0.1], [0.3, 0.3]], present=jnp.array([True, False]))
    _, found = draw(jax.random.key(0), shapes, regions(2, 0.25))
    jax.effects_barrier()
    np.testing.assert_array_equal(found, [False, True])
    assert len(rounds) == 2


@pytest.mark.slow
def test_the_same_in_any_batch():
    """A world is the same alone, in a batch of any size or depth, and in a scan, bit by bit."""
    half, radius = kinds("mixed", 9)
    shapes, areas = solids(half, radius), regions(9, 0.2, (1.0, -2.0, 0.4))
    keys = jax.random.split(jax.random.key(2), 24)

    def one(key):
        return draw(key, shapes, areas, gap=0.005)

    pose, found = jax.jit(jax.vmap(one))(keys)
    assert 0 < (~found).sum() < found.size / 2
    nested = jax.jit(jax.vmap(jax.vmap(one)))(keys.reshape(4, 6))
    alone = [jax.jit(one)(key) for key in keys[:8]]
    scanned = jax.jit(lambda keys: jax.lax.scan(lambda _, key: (None, one(key)), None, keys)[1])(keys)
    for other in (
        [nested[0].reshape(pose.shape), nested[1].reshape(found.shape)],
        [jnp.stack(a) for a in zip(*alone, strict=True)],
        scanned,
        jax.jit(jax.vmap(one))(keys[:7]),
    ):
        np.testing.assert_array_equal(other[0], pose[: len(other[0])])
        np.testing.assert_array_equal(other[1], found[: len(other[1])])


def test_others_keep_their_place():
    """One more at the end moves none, nor does one that is absent."""
    keys = jax.random.split(jax.random.key(0), 6)
    shapes, none = solids(np.full((6, 2), 0.06)), jnp.zeros((6, 0), bool)

    def placed(order, present=True):
        order = np.array(order)
        some = jax.tree.map(lambda a: a[order], shapes)._replace(present=jnp.broadcast_to(present, order.shape))
        pose, found = jax.jit(pack)(keys[order], some, regions(len(order), 0.25), NOTHING, none[order])
        assert found.all()
        return np.asarray(pose)

    pose = placed([0, 1, 2, 3])
    np.testing.assert_array_equal(placed([0, 1, 2, 3, 4])[:4], pose)
    absent = placed([0, 4, 1, 2, 3], np.array([True, False, True, True, True]))
    np.testing.assert_array_equal(absent[[0, 2, 3, 4]], pose)


def test_empty():
    """No solids; no obstacles is what most tests here have."""
    pose, found = draws(3, NOTHING, regions(0), solids([[0.1, 0.1]]))
    assert pose.shape == (3, 0, 3)
    assert found.shape == (3, 0)


def test_gradients_pass_by():
    """Reverse mode over a caller works, and what is drawn counts as given."""

    def height(size):
        pose, found = draw(
            jax.random.key(0), solids([[0.05, 0.05]] * 3)._replace(top=size), regions(3), gap=size[0] / 99
        )
        return (jnp.where(found, size, 0.0) + pose[:, 0]).sum()

    grad = jax.jit(jax.vmap(jax.grad(height)))(jnp.full((2, 3), 0.1))
    np.testing.assert_array_equal(grad, np.ones((2, 3)))
