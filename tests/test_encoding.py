"""Parameters as points of the unit cube, and their log density: against SciPy, and there and back."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.stats
import worlds

import mjx_arenas as mja
from mjx_arenas import dr
from mjx_arenas.params.params import named

RANGES = mja.ArenaRanges(
    table_offsets=mja.Uniform([-0.1, -0.1, 0.0], [0.1, 0.1, 0.3], relative="add", tied=(False, False, True)),
    table_rots=mja.Normal(0.0, 0.2, -0.3, 0.3, relative="add"),
    table_full_sizes=mja.LogUniform(0.8, 1.25, relative="scale", tied="axes"),
    table_frictions=mja.Choice([[0.5, 0.005, 1e-4], [1.0, 0.01, 2e-4]], p=[0.25, 0.75]),
    has_legs=mja.Bernoulli(0.3),
    object_full_sizes=mja.Uniform(0.9, 1.1, relative="scale"),
    object_densities=mja.LogUniform(0.5, 2.0, relative="scale"),
    object_rgba=mja.Fixed([0.1, 0.2, 0.3, 1.0]),
    object_tables=mja.Choice([0, 1, 2], p=[0.5, 0.25, 0.25]),
    object_active=mja.Bernoulli(0.6),
)
KEYS = jax.random.split(jax.random.key(5), 64)


@pytest.fixture(scope="module")
def arena():
    return worlds.arena(3, table_condim=6)


def drawn(arena, ranges, keys=KEYS):
    return jax.vmap(lambda key: arena.sample_params(key, ranges))(keys)


def same(got, want):
    for name, a in named(got).items():
        np.testing.assert_allclose(np.asarray(a), np.asarray(named(want)[name]), rtol=1e-5, atol=1e-6, err_msg=name)


@pytest.mark.slow
def test_there_and_back(arena):
    """The worlds that keys draw, as points, and the points as worlds; all of them have a density."""
    params = drawn(arena, RANGES)
    points = jax.jit(jax.vmap(lambda p: arena.encode(p, RANGES)))(params)
    assert points.shape == (64, 2 * 3 + 1 + 3 + 3 + 3 + 3 + 3 * 3 + 1 + 4 + 4 + 4)  # three boxes and a sphere
    assert ((points >= 0) & (points <= 1)).all()
    same(jax.vmap(lambda u: arena.decode(u, RANGES))(points), params)
    again = jax.vmap(lambda u: arena.encode(arena.decode(u, RANGES), RANGES))(points)
    np.testing.assert_allclose(again, points, atol=2e-4)
    assert jnp.isfinite(jax.vmap(lambda p: arena.log_prob(p, RANGES))(params)).all()


@pytest.mark.slow
def test_points_are_worlds(arena):
    """Uniform points give what keys draw: means and spreads of both agree."""
    n = 4000
    d = len(arena.encode(arena.nominal_params(), RANGES))
    points = jax.random.uniform(jax.random.key(1), (n, d))
    a = jax.jit(jax.vmap(lambda u: arena.decode(u, RANGES)))(points)
    b = drawn(arena, RANGES, jax.random.split(jax.random.key(2), n))
    for name, x in named(a).items():
        x, y = (np.asarray(v, float).reshape(n, -1) for v in (x, named(b)[name]))
        spread = np.sqrt((x.var(0) + y.var(0)) / n)
        assert (np.abs(x.mean(0) - y.mean(0)) <= 4.5 * spread + 1e-6).all(), name
        assert (np.abs(x.std(0) - y.std(0)) <= 0.12 * y.std(0) + 1e-6).all(), name


@pytest.mark.slow
@pytest.mark.parametrize(
    ("dist", "want"),
    [
        (mja.Uniform(0.2, 0.7), lambda x: scipy.stats.uniform(0.2, 0.5).logpdf(x).sum()),
        (mja.Uniform(-0.2, 0.3, relative="add"), lambda x: scipy.stats.uniform(-0.2, 0.5).logpdf(x).sum()),
        (mja.LogUniform(0.1, 1.0), lambda x: scipy.stats.loguniform(0.1, 1.0).logpdf(x).sum()),
        (mja.Normal(0.1, 0.2, -3.0, 3.0), lambda x: scipy.stats.norm(0.1, 0.2).logpdf(x).sum()),
        (mja.Uniform(0.2, 0.7, tied=True), lambda x: scipy.stats.uniform(0.2, 0.5).logpdf(x[0])),
        (mja.Choice([0.25, 0.5, 0.5], p=[0.5, 0.2, 0.3]), lambda x: np.log([0.5] * 3).sum()),
        (mja.Fixed(0.3), lambda x: 0.0),
    ],
    ids=["uniform", "add", "loguniform", "normal", "tied", "choice", "fixed"],
)
def test_densities(arena, dist, want):
    """Of the yaw of three tables, as SciPy has them."""
    ranges = mja.ArenaRanges(table_rots=dist)
    params = drawn(arena, ranges)
    got = jax.vmap(lambda p: arena.log_prob(p, ranges))(params)
    for i, x in enumerate(np.asarray(params.table_rots, float)):
        assert float(got[i]) == pytest.approx(want(x), rel=2e-5, abs=2e-5)


def test_relative_and_absolute_agree(arena):
    """One range said in three ways has one density."""
    nominal = arena.nominal_params()
    mass = np.asarray(nominal.object_masses)
    ways = [
        mja.ArenaRanges(object_masses=mja.Uniform(0.5, 2.0, relative="scale")),
        mja.ArenaRanges(object_masses=mja.Uniform(0.5 * mass, 2 * mass)),
        mja.ArenaRanges(object_densities=mja.Uniform(0.5, 2.0, relative="scale")),
    ]
    params = arena.sample_params(KEYS[0], ways[0])
    want = -np.log(1.5 * mass.astype(float)).sum()
    for ranges in ways:
        assert float(arena.log_prob(params, ranges)) == pytest.approx(want, rel=1e-5)


def test_clipped(arena):
    """The bounds of a clipped normal have a probability, and what lies between a density."""
    ranges = mja.ArenaRanges(table_rots=mja.Normal(0.0, 0.2, -0.1, 0.3))
    params = arena.nominal_params()._replace(table_rots=jnp.array([-0.1, 0.3, 0.05]))
    n = scipy.stats.norm(0, 0.2)
    want = n.logcdf(-0.1) + n.logsf(0.3) + n.logpdf(0.05)
    assert float(arena.log_prob(params, ranges)) == pytest.approx(want, rel=1e-5)


def test_counts(arena):
    """Each number of tables has one probability, and each choice of so many the same share of it."""
    ranges = mja.ArenaRanges(has_legs=mja.Count(1, 3))
    for legs, ways in (([True, False, False], 3), ([True, True, False], 3), ([True, True, True], 1)):
        params = arena.nominal_params()._replace(has_legs=jnp.array(legs))
        assert float(arena.log_prob(params, ranges)) == pytest.approx(-np.log(3 * ways), rel=1e-5)
        same(arena.decode(arena.encode(params, ranges), ranges), params)
        first = mja.ArenaRanges(has_legs=mja.Count(1, 3, first=True))
        assert float(arena.log_prob(params, first)) == pytest.approx(-np.log(3), rel=1e-5)
        assert arena.encode(params, first).shape == (1,)
        same(arena.decode(arena.encode(params, first), first), params)
    other = arena.nominal_params()._replace(has_legs=jnp.array([False, True, True]))
    assert float(arena.log_prob(other, first)) == -np.inf
    assert float(arena.log_prob(other, ranges)) > -np.inf
    none = arena.nominal_params()._replace(has_legs=jnp.zeros(3, bool))
    assert float(arena.log_prob(none, ranges)) == -np.inf


def test_counts_of_objects(arena):
    """As of tables: each of the six pairs of four objects is the third part of a sixth."""
    ranges = mja.ArenaRanges(object_active=mja.Count(1, 3))
    params = arena.nominal_params()._replace(object_active=jnp.array([True, False, False, True]))
    assert float(arena.log_prob(params, ranges)) == pytest.approx(-np.log(3 * 6), rel=1e-5)
    same(arena.decode(arena.encode(params, ranges), ranges), params)


@pytest.mark.slow
@pytest.mark.parametrize(
    "change",
    [
        {"table_rots": jnp.array([0.31, 0.0, 0.0])},
        {"table_frictions": jnp.full((3, 3), 0.7)},
        {"object_rgba": jnp.full((4, 4), 0.5)},
        {"object_frictions": jnp.full((4, 3), 0.77)},
        {"table_offsets": jnp.zeros((3, 3)) + jnp.arange(3.0)[:, None]},
    ],
    ids=["beyond", "no_choice", "not_fixed", "not_drawn", "not_tied"],
)
def test_impossible(arena, change):
    """What the ranges do not give has no density."""
    params = arena.sample_params(KEYS[0], RANGES)
    assert jnp.isfinite(arena.log_prob(params, RANGES))
    assert float(arena.log_prob(params._replace(**change), RANGES)) == -np.inf


@pytest.mark.slow
def test_density_adds_up_to_one(arena):
    """Importance: of draws under a wide range, the mean of exp(log ratio) to a narrow one is 1."""
    wide = mja.ArenaRanges(
        table_rots=mja.Uniform(-1.0, 1.0), object_densities=mja.LogUniform(0.5, 2.0, relative="scale")
    )
    narrow = mja.ArenaRanges(
        table_rots=mja.Normal(0.0, 0.2, -1.0, 1.0), object_masses=mja.Uniform(0.8, 1.2, relative="scale")
    )
    params = drawn(arena, wide, jax.random.split(jax.random.key(3), 60_000))
    ratio = jax.jit(jax.vmap(lambda p: arena.log_prob(p, narrow) - arena.log_prob(p, wide)))(params)
    weights = np.exp(np.asarray(ratio, float))
    assert weights.mean() == pytest.approx(1.0, abs=4 * weights.std() / np.sqrt(len(weights)))


SCENE = """<mujoco><worldbody><light name="lamp" pos="0 0 2"/><body name="a"><freejoint/><geom name="g" size=".1 .1 .1" type="box"/></body>
<body name="b" pos="1 0 0"><joint name="h"/><geom name="k" size=".1"/></body></worldbody></mujoco>"""


def test_terms():
    """Quantities of `arena.vary`: only the axes that vary count."""
    arena = mja.Arena.from_xml(SCENE)
    arena.vary(size=dr.Term("geom.size"), slide=dr.Term("geom.friction", axes="sliding"), on=dr.Term("light.active"))
    ranges = mja.ArenaRanges(
        terms={
            "size": mja.Uniform(0.8, 1.2, relative="scale"),
            "slide": mja.Choice([0.5, 0.8]),
            "on": mja.Bernoulli(0.25),
        }
    )
    params = drawn(arena, ranges)
    points = jax.vmap(lambda p: arena.encode(p, ranges))(params)
    assert points.shape == (64, 3 + 1 + 2 + 1)
    same(jax.vmap(lambda u: arena.decode(u, ranges))(points), params)
    lit = np.asarray(params.terms["on"])[:, 0]
    want = -4 * np.log(0.04) + 2 * np.log(0.5) + np.where(lit, np.log(0.25), np.log(0.75))
    np.testing.assert_allclose(jax.vmap(lambda p: arena.log_prob(p, ranges))(params), want, rtol=1e-5)


def test_gradients(arena):
    """Of decoded numbers by the point, and of the density by the numbers."""
    ranges = mja.ArenaRanges(table_rots=mja.Uniform(-0.5, 1.5), table_frictions=mja.Normal(1.0, 0.2, 0.0, 9.0))
    jacobian = jax.jacobian(lambda u: arena.decode(u, ranges).table_rots)(jnp.full(12, 0.3))
    np.testing.assert_allclose(jacobian, np.eye(3, 12) * 2.0, atol=1e-6)
    params = arena.sample_params(KEYS[1], ranges)
    grad = jax.grad(lambda p: arena.log_prob(p, ranges), allow_int=True)(params).table_frictions
    np.testing.assert_allclose(grad, -(params.table_frictions - 1.0) / 0.04, rtol=1e-4)


def test_traced_ranges(arena):
    """Ranges that are being traced, as a search over them has it."""
    params = arena.nominal_params()._replace(table_rots=jnp.array([0.1, 0.2, 0.3]))

    def density(high):
        return arena.log_prob(params, mja.ArenaRanges(table_rots=mja.Uniform(0.0, high)))

    assert float(jax.jit(jax.grad(density))(0.5)) == pytest.approx(-3 / 0.5)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda a: a.decode(np.zeros(3), RANGES),
            r"`vector` must be \(41,\) numbers, one for each that `ranges` draws, got \(3,\)",
        ),
        (lambda a: a.decode(np.full(41, 1.5), RANGES), r"`vector\[0\]` must be between 0 and 1, got 1.5"),
        (lambda a: a.decode(np.full(41, np.nan), RANGES), r"`vector\[0\]` must be between 0 and 1, got nan"),
        (
            lambda a: a.encode(a.nominal_params(), mja.ArenaRanges(workspace=mja.Workspace([-2, -2], [2, 2]))),
            "cannot be encoded, as it draws places",
        ),
        (
            lambda a: a.log_prob(
                a.nominal_params(), mja.ArenaRanges(object_active=mja.Count(1, 2), table_active=mja.Bernoulli(0.5))
            ),
            "use Bernoulli",
        ),
    ],
    ids=["shape", "range", "nan", "workspace", "count"],
)
def test_refused(arena, call, message):
    """A sentence each."""
    with pytest.raises(ValueError, match=message):
        call(arena)


TIED = {
    "uniform": (mja.Uniform(-0.5, 0.5, tied=True), [0.1, 0.1, 0.1], 0.0),
    "apart": (mja.Uniform(-0.5, 0.5, tied=True), [0.1, 0.3, 0.1], -np.inf),
    "loguniform": (mja.LogUniform(0.1, 1.0, tied=True), [0.1, 0.3, 0.1], -np.inf),
    "normal": (mja.Normal(0.0, 0.2, -0.5, 0.5, tied=True), [0.1, 0.3, 0.1], -np.inf),
    "choice": (mja.Choice([0.1, 0.3], tied=True), [0.1, 0.3, 0.1], -np.inf),
    "one_choice": (mja.Choice([0.1, 0.3, 0.3], p=[0.2, 0.3, 0.5], tied=True), [0.3, 0.3, 0.3], np.log(0.8)),
    "own_ranges": (mja.Uniform([0.0, 0.1, 0.2], [1.0, 0.2, 0.6], tied=True), [0.5, 0.15, 0.4], 0.0),
    "own_ranges_apart": (mja.Uniform([0.0, 0.1, 0.2], [1.0, 0.2, 0.6], tied=True), [0.5, 0.15, 0.401], -np.inf),
    "first_is_coarse": (
        mja.Uniform([3.0, 0.0, 0.0], [3.00001, 1.0, 2.0], tied=True),
        [3.000005, 0.51, 1.02],
        np.log(1e5),
    ),
    "first_is_certain": (mja.Uniform([0.3, 0.0, 0.0], [0.3, 0.5, 1.0], tied=True), [0.3, 0.1, 0.2], np.log(2)),
    "all_at_a_bound": (
        mja.Normal(0.0, 0.2, [-0.2, -0.4, -3.0], 3.0, tied=True),
        [-0.2, -0.4, -0.5],
        scipy.stats.norm(0, 0.2).logpdf(-0.5),
    ),
    "two_bounds": (
        mja.Normal(0.0, 0.2, [-0.2, -0.4, -0.3], 3.0, tied=True),
        [-0.2, -0.4, -0.3],
        scipy.stats.norm.logcdf(-2),
    ),
    "not_below_the_bound": (mja.Normal(0.0, 0.2, [-0.2, -0.4, -0.3], 3.0, tied=True), [-0.2, -0.4, -0.31], -np.inf),
}


@pytest.mark.parametrize(("dist", "rots", "want"), TIED.values(), ids=TIED)
def test_tied(arena, dist, rots, want):
    """Tied numbers have the density of their one draw, and none where no draw gives them all."""
    ranges = mja.ArenaRanges(table_rots=dist)
    params = arena.nominal_params()._replace(table_rots=jnp.array(rots))
    assert float(arena.log_prob(params, ranges)) == pytest.approx(want, rel=2e-4, abs=1e-5)
    if np.isfinite(want):
        assert arena.encode(params, ranges).shape == (1,)
        same(arena.decode(arena.encode(params, ranges), ranges), params)


@pytest.mark.parametrize(
    ("legs", "want"),
    [([True, True, True], 0.2), ([True, False, True], 0.1), ([False, False, True], 0.4), ([False, True, True], 0.0)],
)
def test_tied_presence(arena, legs, want):
    """One draw decides which are there: each probability is what is common to those of all."""
    ranges = mja.ArenaRanges(has_legs=mja.Bernoulli([0.3, 0.2, 0.7], tied=True))
    params = arena.nominal_params()._replace(has_legs=jnp.array(legs))
    assert np.exp(float(arena.log_prob(params, ranges))) == pytest.approx(want, rel=1e-5)
    if want:
        same(arena.decode(arena.encode(params, ranges), ranges), params)


@pytest.mark.parametrize("size", [[1.0, 0.2, 0.15], [1.0, 0.19, 0.15], [1.0, 0.2, 0.16]])
def test_tied_axes(size):
    """Of axes with one draw, one of them certain."""
    arena = mja.Arena.from_xml(SCENE)
    arena.vary(size=dr.Term("geom.size", "g"))
    dist = mja.Uniform([1.0, 0.1, 0.1], [1.0, 0.3, 0.2], tied="axes")
    ranges = mja.ArenaRanges(terms={"size": dist})
    params = arena.nominal_params()
    params = params._replace(terms={"size": jnp.array([size])})
    want = np.log(5) if size == [1.0, 0.2, 0.15] else -np.inf
    assert float(arena.log_prob(params, ranges)) == pytest.approx(want, rel=1e-4)


@pytest.mark.parametrize(
    ("tables", "active", "want"),
    [
        ([True, False], [True, False, False], np.log(0.25 * 0.6)),
        ([True, False], [False, False, False], np.log(0.25 * 0.4)),
        ([False, False], [False, False, False], np.log(0.25)),
        ([True, True], [True, False, True], -np.inf),
    ],
)
def test_tied_on_absent_tables(tables, active, want):
    """An object on an absent table is absent whatever the draw of all is."""
    arena = worlds.arena(2, objects=[mja.Object(name, on=on) for name, on in (("a", 0), ("b", 1), ("c", 1))])
    ranges = mja.ArenaRanges(table_active=mja.Bernoulli(0.5), object_active=mja.Bernoulli(0.6, tied=True))
    params = arena.nominal_params()._replace(table_active=jnp.array(tables), object_active=jnp.array(active))
    assert float(arena.log_prob(params, ranges)) == pytest.approx(want, rel=1e-5)
    if np.isfinite(want):
        point = np.asarray(arena.encode(params, ranges))
        assert point[-1] == pytest.approx(0.3 if active[0] else 0.8)
        same(arena.decode(jnp.array(point), ranges), params)


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize(
    ("dist", "want", "point"),
    [
        (mja.Uniform(0.5, 2.0, relative="scale", tied=True), -np.log(1.5), 1.0),
        (mja.Choice([0.5, 2.0], p=[0.25, 0.75], relative="scale", tied=True), np.log(0.75), 0.625),
    ],
)
def test_tied_multiples_of_zero(order, dist, want, point):
    """A factor of 0 gives 0 whatever it is; the other number decides, in whatever order they come."""
    damping = np.array([1.0, 0.0])[::order]
    xml = f"""<mujoco><worldbody><body><joint name="a" damping="{damping[0]}"/><geom size=".1"/><body>
    <joint name="b" damping="{damping[1]}"/><geom size=".1"/></body></body></worldbody></mujoco>"""
    arena = mja.Arena.from_xml(xml)
    arena.vary(damping=dr.Term("joint.damping"))
    ranges = mja.ArenaRanges(terms={"damping": dist})
    params = arena.nominal_params()._replace(terms={"damping": jnp.asarray(2.0 * damping, jnp.float32)[:, None]})
    params = params._replace(
        terms={"damping": params.terms["damping"].reshape(arena.nominal_params().terms["damping"].shape)}
    )
    assert float(arena.log_prob(params, ranges)) == pytest.approx(want, rel=1e-5)
    assert arena.encode(params, ranges) == pytest.approx(point, abs=1e-5)
    same(arena.decode(arena.encode(params, ranges), ranges), params)
