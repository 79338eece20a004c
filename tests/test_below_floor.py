"""Tables whose top is below the floor: a warning of the nominal arena, a flag and a sentence of a world."""

import functools
import json
import warnings

import jax
import jax.numpy as jnp
import pytest

import mjx_arenas as mja
from mjx_arenas import dr

HALL = '<mujoco><worldbody>{}<body name="desk" pos="1 0 {}"><geom type="box" size=".3 .3 .02"/></body></worldbody></mujoco>'
FLOOR = '<geom name="ground" type="plane" size="0 0 .1" pos="0 0 {}"/>'


@functools.cache
def arena():
    return mja.MultiTableArena([[0, -0.6, 0.8], [0, 0.6, 0.8]], has_legs=False, objects=[mja.Object("cube")])


def at(one, *heights, **more):
    """Parameters of a world with tops at these heights."""
    params = one.nominal_params()
    return params._replace(table_offsets=params.table_offsets.at[:, 2].set(jnp.array(heights)), **more)


def told(one, params):
    """The problems of a world, of which the flag knows, too."""
    problems = one.problems(params)
    assert bool(jax.jit(one.valid)(params)) == (not problems)
    return problems


def test_worlds():
    """The ones that are there, each in a sentence; a top that is flush with the floor is right."""
    one = arena()
    assert told(one, at(one, 0.8, -0.2)) == ["The top of table 1 is 0.2 m below the floor."]
    assert told(one, at(one, -0.1, -0.2)) == [
        "The top of table 0 is 0.1 m below the floor.",
        "The top of table 1 is 0.2 m below the floor.",
    ]
    assert told(one, at(one, 0.8, -0.2, table_active=jnp.array([True, False]))) == []
    assert told(one, at(one, 0.8, 0.0)) == []  # a slab in the floor touches nothing with its underside
    assert one.compile(at(one, 0.8, -0.2)).body("table1").pos[2] < -0.2  # what is not valid is shown


SCENES = {
    "without a floor": ("", 0.5, -5.0, []),
    "above a floor": (FLOOR.format(0), 0.5, -0.2, ["The top of table 'desk' is 0.2 m below the floor."]),
    "above a floor that is low": (FLOOR.format(-2), 0.5, -0.2, []),
    "above a floor that is high": (FLOOR.format(1), 1.5, 0.7, ["The top of table 'desk' is 0.3 m below the floor."]),
    "below a floor by intent": (FLOOR.format(1), 0.5, 0.2, []),
    "above one that touches nothing": (FLOOR.format(0).replace("/>", ' contype="0" conaffinity="0"/>'), 0.5, -0.2, []),
}


@pytest.mark.parametrize("case", SCENES)
def test_scenes(case):
    """Planes elsewhere, without one, and tables that are below by intent; nothing is said of the scene, which stands as it is."""
    floor, nominal, height, problems = SCENES[case]
    one = mja.Arena.from_xml(HALL.format(floor, nominal - 0.02), ["desk"])
    assert told(one, one.nominal_params()) == []
    assert told(one, at(one, height)) == problems


def test_nominal():
    """One warning when it is made; from then on it is intended, and nothing is said of its worlds."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        one = mja.MultiTableArena([[0, -0.6, 0.8], [0, 0.6, -0.2]], has_legs=False)
    says = "The top of table 1 is 0.2 m below the floor: this is taken to be intended in every world."
    assert [str(one.message) for one in caught] == [says]
    assert told(one, at(one, 0.8, -0.3)) == []
    assert told(one, at(one, -0.1, -0.3)) == ["The top of table 0 is 0.1 m below the floor."]


def test_a_floor_that_rises():
    """Above a top, by a term."""
    one = mja.Arena.from_xml(HALL.format(FLOOR.format(0), 0.5), ["desk"])
    one.vary(level=dr.Term("geom.pos", "ground", "z"))
    params = one.nominal_params()
    assert told(one, params) == []
    higher = params._replace(terms={"level": jnp.array([[0, 0, 0.6]])})
    assert told(one, higher) == ["The top of table 'desk' is 0.08 m below the floor."]


@pytest.mark.slow
def test_drawn(tmp_path):
    """`randomize` says why no world is valid, `check` reports them, and bundles say it again without the arena, older ones nothing."""
    ranges = mja.ArenaRanges(table_offsets=mja.Uniform([0, 0, -1.2], [0, 0, -1.0], relative="add"))
    with pytest.warns(
        UserWarning, match=r"none of the 8 that were drawn is. World 0: The top of table 0 is 0\.\d+ m below"
    ):
        arena().randomize(arena().put_model("jax"), mja.world_keys(0, range(8)), ranges)
    report = mja.check(arena(), ranges, 1, n_steps=1, engine="c")
    assert "The top of table 0 is 0." in report.of(0)["invalid_arena"].what
    report.save_bundle(tmp_path / "bundle", 0)
    assert mja.replay(tmp_path / "bundle").found["invalid_arena"] == report.of(0)["invalid_arena"]
    path = tmp_path / "bundle" / "failure.json"
    older = json.loads(path.read_text())
    del older["rules"]["low"]
    path.write_text(json.dumps(older))
    assert "invalid_arena" not in mja.replay(tmp_path / "bundle").found
