"""Draws: their distributions, their keys, and what does not recompile."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import worlds

import mjx_arenas as mja
from mjx_arenas import dr
from mjx_arenas.envs.curriculum import widening
from mjx_arenas.params.params import QUANTITIES, named

N = 4000


def samples(ranges, n_tables=2, n=N):
    """(N, T, ...) parameters of many worlds."""
    arena = worlds.arena(n_tables, table_condim=6)
    params = jax.jit(jax.vmap(lambda key: arena.sample_params(key, ranges)))(jax.random.split(jax.random.key(2), n))
    return jax.tree.map(np.asarray, params)


def test_uniform():
    """Uniform per axis and table, absolute."""
    low, high = np.array([[0.5, 0.6, 0.01], [0.3, 0.3, 0.02]]), np.array([[0.7, 0.6, 0.05], [0.4, 1.0, 0.03]])
    x = samples(mja.ArenaRanges(table_full_sizes=mja.Uniform(low, high))).table_full_sizes
    assert (x >= low - 1e-7).all()
    assert (x <= high + 1e-7).all()
    spread = high > low
    u = ((x - low) / np.where(spread, high - low, 1))[:, spread]
    for column in u.T:
        assert np.abs(np.sort(column) - (np.arange(N) + 0.5) / N).max() < 1.95 / np.sqrt(N)  # Kolmogorov, p = 0.001
    assert np.abs(np.corrcoef(u.T) - np.eye(spread.sum())).max() < 4 / np.sqrt(N)


def test_log_uniform():
    """Uniform in the logarithm."""
    x = samples(mja.ArenaRanges(table_frictions=mja.LogUniform(0.01, 1.0))).table_frictions
    u = np.sort(np.log(x / 0.01).ravel() / np.log(100))
    assert u[0] >= -1e-6
    assert u[-1] <= 1 + 1e-6
    assert np.abs(u - (np.arange(u.size) + 0.5) / u.size).max() < 1.95 / np.sqrt(u.size)


def test_normal():
    """Normal with its tails clipped to the bounds."""
    x = samples(mja.ArenaRanges(table_rots=mja.Normal(0.1, 0.2, -0.3, 0.3))).table_rots
    assert x.min() == np.float32(-0.3)
    assert x.max() == np.float32(0.3)
    assert np.median(x) == pytest.approx(0.1, abs=0.2 * 1.2533 * 4 / np.sqrt(x.size))
    assert (x == np.float32(0.3)).mean() == pytest.approx(0.1587, abs=4 * np.sqrt(0.1587 / x.size))


def test_choice():
    """Whole rows, with their probabilities, each table its own."""
    rows = np.array([[0.5, 0.5, 0.05], [0.8, 0.4, 0.03], [0.3, 0.3, 0.02]], np.float32)
    x = samples(mja.ArenaRanges(table_full_sizes=mja.Choice(rows, p=[0.5, 0.0, 0.5]))).table_full_sizes
    which = (x[:, :, None] == rows).all(-1)
    assert which.any(-1).all()
    np.testing.assert_allclose(which.mean((0, 1)), [0.5, 0, 0.5], atol=0.03)
    assert not (which[:, 0] == which[:, 1]).all()
    uniform = samples(mja.ArenaRanges(table_rots=mja.Choice([0.0, 1.0, 2.0, 3.0]))).table_rots
    np.testing.assert_allclose([(uniform == i).mean() for i in range(4)], 0.25, atol=0.03)


def test_bernoulli_and_fixed():
    """True with its probability, per table; a fixed value in every world."""
    x = samples(mja.ArenaRanges(has_legs=mja.Bernoulli([0.2, 1.0]), table_rots=mja.Fixed([0.5, -0.5])))
    np.testing.assert_allclose(x.has_legs.mean(0), [0.2, 1.0], atol=0.03)
    assert x.has_legs.dtype == bool
    np.testing.assert_array_equal(x.table_rots, np.broadcast_to(np.float32([0.5, -0.5]), (N, 2)))


def test_relative():
    """Added to the nominal value, or multiplied with it."""
    nominal = worlds.arena(2).nominal_params()
    added = samples(mja.ArenaRanges(table_offsets=mja.Uniform([0, 0, -0.1], [0, 0, 0.2], relative="add"))).table_offsets
    np.testing.assert_array_equal(added[..., :2], np.broadcast_to(nominal.table_offsets[:, :2], (N, 2, 2)))
    assert added[..., 2].min() < 0.71
    assert added[..., 2].max() > 0.99
    scaled = samples(mja.ArenaRanges(table_full_sizes=mja.Uniform(0.5, 1.5, relative="scale"))).table_full_sizes
    ratio = scaled / nominal.table_full_sizes
    assert 0.5 <= ratio.min() < 0.51
    assert 1.49 < ratio.max() <= 1.5 + 1e-6


def test_tied():
    """One height for all tables, each its own place."""
    ranges = mja.ArenaRanges(table_offsets=mja.Uniform(-0.1, 0.1, relative="add", tied=(False, False, True)))
    moved = samples(ranges).table_offsets - np.asarray(worlds.arena(2).nominal_params().table_offsets)
    np.testing.assert_allclose(moved[:, 0, 2], moved[:, 1, 2], atol=1e-6)
    assert (np.abs(moved[:, 0, :2] - moved[:, 1, :2]) > 1e-5).mean() > 0.99
    for dist in (mja.Choice([0.0, 1.0, 2.0], tied=True), mja.Normal(0, 1, -6, 6, tied=True)):
        x = samples(mja.ArenaRanges(table_rots=dist)).table_rots
        np.testing.assert_array_equal(x[:, 0], x[:, 1])


def test_left_out_stays_nominal():
    """Quantities without a range are the nominal ones, to the bit."""
    x, nominal = samples(mja.ArenaRanges(table_rots=mja.Uniform(-1, 1)), n=3), worlds.arena(2).nominal_params()
    for name in set(QUANTITIES) - {"table_rots"}:
        np.testing.assert_array_equal(getattr(x, name), np.broadcast_to(getattr(nominal, name), getattr(x, name).shape))


def test_terms_without_a_distribution_stay_nominal():
    """None for one means the same as leaving it out, as for the quantities of tables: what a preset ranges can be taken away."""
    arena = mja.Arena.from_xml(
        '<mujoco><worldbody><body><joint/><geom name="g" size=".1"/></body></worldbody></mujoco>'
    )
    arena.vary(mass=dr.Term("geom.mass"), friction=dr.Term("geom.friction"))
    friction = mja.Uniform(0.5, 0.6)
    drawn = [
        arena.sample_params(jax.random.key(0), mja.ArenaRanges(terms=t))
        for t in ({"friction": friction}, {"mass": None, "friction": friction})
    ]
    jax.tree.map(np.testing.assert_array_equal, *drawn)
    np.testing.assert_array_equal(drawn[1].terms["mass"], arena.nominal_params().terms["mass"])
    assert widening(arena, mja.ArenaRanges(terms={"mass": None}))(0.5).terms == {}
    relative = mja.ArenaRanges(terms={"mass": None, "friction": mja.Uniform(0.9, 1.1, relative="scale")})
    batch = arena.randomize(arena.put_model("jax"), mja.world_keys(0, range(2)), relative)
    np.testing.assert_array_equal(batch.params.terms["mass"], [arena.nominal_params().terms["mass"]] * 2)


@pytest.mark.slow
def test_world_does_not_depend_on_batch(arena):
    """World i is the same in a batch of 3, of 8, and alone."""
    keys = jax.random.split(jax.random.key(1), 8)
    model = arena.put_model("jax")
    eight, three = (arena.randomize(model, k, worlds.RANGES) for k in (keys, keys[:3]))
    alone = jax.jit(arena.sample_params)(keys[1], worlds.RANGES)
    for a, b, c in zip(*(named(p).values() for p in (eight.params, three.params, alone)), strict=True):
        np.testing.assert_allclose(a[:3], b, rtol=2e-7)  # fused differently: the last bit of a product
        np.testing.assert_allclose(a[1], c, rtol=2e-7)  # fused differently: the last bit of a product


def test_world_does_not_depend_on_devices(arena):
    """World i is the same when the worlds are spread over two devices."""
    keys = jax.random.split(jax.random.key(1), 8)
    mesh = jax.sharding.Mesh(jax.devices()[:2], "worlds")
    spread = jax.device_put(keys, jax.sharding.NamedSharding(mesh, jax.sharding.PartitionSpec("worlds")))
    draw = jax.jit(jax.vmap(lambda key: arena.sample_params(key, worlds.RANGES)))
    two = draw(spread)
    assert len(two.table_offsets.sharding.device_set) == 2
    for a, b in zip(named(two).values(), named(draw(keys)).values(), strict=True):
        np.testing.assert_array_equal(a, b)


def test_one_more_range_shifts_nothing():
    """A range for one more quantity, or one more table, leaves the other draws as they were."""
    one = mja.ArenaRanges(table_rots=mja.Uniform(-1, 1))
    more = worlds.RANGES._replace(table_rots=one.table_rots)
    np.testing.assert_array_equal(samples(one, n=5).table_rots, samples(more, n=5).table_rots)
    np.testing.assert_array_equal(samples(more, 2, n=5).table_rots, samples(more, 3, n=5).table_rots[:, :2])
    rots, frictions = samples(mja.ArenaRanges(table_rots=mja.Uniform(0, 1), table_frictions=mja.Uniform(0, 1)), n=5)[
        1:4:2
    ]
    assert (rots != frictions[..., 0]).all()


def test_ranges_are_traced(arena):
    """Other numbers, from a curriculum say, compile nothing anew; a batch of ranges is vmapped."""
    traces = 0

    @jax.jit
    def draw(key, ranges):
        nonlocal traces
        traces += 1
        return arena.sample_params(key, ranges)

    def ranges(width):
        return mja.ArenaRanges(
            table_offsets=mja.Uniform([-width, 0, 0], [width, 0, 0], relative="add"),
            table_rots=mja.Normal(0.0, width, -6.0, 6.0),
            table_full_sizes=mja.Choice([[0.5, 0.5, 0.05], [0.5, width, 0.05]]),
            has_legs=mja.Bernoulli(width),
        )

    draw(jax.random.key(0), ranges(0.1))
    draw(jax.random.key(1), ranges(0.3))
    assert traces == 1
    widths = jnp.linspace(0.0, 1.0, 5)
    x = jax.vmap(lambda w: arena.sample_params(jax.random.key(0), ranges(w)))(widths).table_rots
    np.testing.assert_allclose(x[1:], x[-1:] * widths[1:, None], rtol=1e-5)


def test_device_flags_impossible_worlds(arena):
    """Ranges traced past what can be compiled raise nothing, and flag their worlds."""
    model, keys = arena.put_model("jax"), jax.random.split(jax.random.key(0), 64)

    @jax.jit
    def randomize(low):
        return arena.randomize(model, keys, mja.ArenaRanges(table_full_sizes=mja.Uniform(low, 0.5))).valid

    assert randomize(0.1).all()
    valid = np.asarray(randomize(-0.05))
    assert 0 < valid.sum() < len(valid)

    @jax.jit
    def reversed_range(low):
        return arena.randomize(model, keys, mja.ArenaRanges(table_rots=mja.Uniform(low, 0.5))).valid

    assert reversed_range(0.5).all()
    assert not reversed_range(0.6).any()
    bad = arena.nominal_params()
    for wrong in (
        bad._replace(table_offsets=bad.table_offsets.at[1, 2].set(0.01)),
        bad._replace(table_offsets=bad.table_offsets.at[1, 0].set(jnp.nan)),
        bad._replace(table_frictions=-bad.table_frictions),
    ):
        assert not arena.valid(wrong)
    assert arena.valid(bad)


def test_one_more_table_shifts_nothing():
    """A table's numbers depend on its index, not on how many tables there are, whichever way JAX is set to number draws."""
    ranges = mja.ArenaRanges(
        table_rots=mja.Uniform(-1, 1),
        table_full_sizes=mja.Uniform(0.4, 0.8),
        table_offsets=mja.Normal(0, 0.1, -0.2, 0.2, relative="add"),
    )
    key, drawn = jax.random.key(5), []
    for n_tables, numbered in ((2, True), (5, True), (2, False), (5, False)):
        arena = mja.MultiTableArena([[1.5 * i, 0, 0.9] for i in range(n_tables)])
        with jax.threefry_partitionable(numbered):
            drawn.append(arena.sample_params(key, ranges))
    for name in ("table_rots", "table_full_sizes", "table_offsets"):
        for params in drawn[1:]:
            np.testing.assert_array_equal(getattr(params, name)[:2], getattr(drawn[0], name)[:2], err_msg=name)


@pytest.mark.slow
def test_double_precision_draws_the_same_worlds():
    """With JAX_ENABLE_X64 a key draws the same worlds and places, to single precision."""
    objects = [mja.Object(f"box{k}", on=k % 2) for k in range(4)]
    ranges = mja.ArenaRanges(
        table_offsets=mja.Normal((0, 0, 0), 0.1, (-0.2, -0.2, -0.2), (0.2, 0.2, 0.2), relative="add"),
        table_rots=mja.Uniform(-3, 3),
        table_frictions=mja.LogUniform([0.01, 0.005, 0.0001], [1, 0.005, 0.0001]),
        table_active=mja.Bernoulli([1.0, 0.5]),
        workspace=mja.Workspace((-2, -2), (2, 2), 0.1),
        object_active=mja.Count(1, 4),
        object_tables=mja.Choice([0, 1], p=[0.3, 0.7]),
        object_full_sizes=mja.Choice([0.03, 0.04, 0.05, 0.06]),
    )

    def drawn():
        arena = mja.MultiTableArena([[0, 0, 0.8], [1.5, 0, 0.8]], objects=objects)
        keys = mja.world_keys(3, range(64))
        params = jax.jit(jax.vmap(lambda key: arena.sample_params(key, ranges)))(keys)
        return params, jax.jit(jax.vmap(arena.place))(params, keys)

    single = drawn()
    with jax.enable_x64(True):
        double = drawn()
        assert double[0].table_rots.dtype == np.float64
    for a, b in zip(jax.tree.leaves(single), jax.tree.leaves(double), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-5, atol=1e-5)
