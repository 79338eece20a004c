"""Fixed geoms that terms move, turn and resize: objects are placed clear of them, and tables and parts in them are told, as in C."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas import dr, furniture
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.terms.parts import Parts
from mjx_arenas.terms.term import places, row

SCENE = """<mujoco><asset><mesh name="wedge" vertex="-.1 -.05 -.05 .1 -.05 -.05 .1 .05 -.05 -.1 .05 -.05 -.1 -.05 .1 -.1 .05 .1"/></asset>
<worldbody><geom name="floor" type="plane" size="0 0 .1"/>
  <body name="desk" pos="0 0 .7" euler="0 0 20"><geom name="top" type="box" size=".4 .4 .02"/>
    <body name="rack" pos=".1 -.1 .1" euler="0 0 15"><geom name="post" type="box" size=".05 .03 .08" pos=".05 0 0"/>
      <body pos="0 .1 0" euler="0 30 0"><geom name="rod" type="capsule" size=".02 .08"/></body></body>
    <geom name="cup" type="cylinder" size=".05 .06" pos="-.2 .2 .08"/>
    <geom name="low" type="box" size=".06 .06 .01" pos="-.1 -.25 0"/></body>
  <body name="stand" pos=".2 .2 .8"><geom name="wedge" type="mesh" mesh="wedge"/>
    <geom name="egg" type="ellipsoid" size=".06 .04 .08" pos="0 -.5 0"/></body>
  <geom name="ball" type="sphere" size=".07" pos="-.25 .0 .75"/></worldbody></mujoco>"""
FIXED = ("post", "rod", "cup", "low", "wedge", "egg", "ball")
TERMS = {
    "rack_at": ("body.pos", ["rack"], mja.Uniform([-0.2, -0.2, -0.05], [0.2, 0.2, 0.02], relative="add")),
    "rack_turn": ("body.rpy", ["rack"], mja.Uniform([-0.3, -0.3, -3], [0.3, 0.3, 3])),
    "stand_at": ("body.pos", ["stand"], mja.Uniform([-0.3, -0.2, -0.03], [0.3, 0.2, 0.03], relative="add")),
    "wedge_turn": ("geom.rpy", ["wedge"], mja.Uniform([-3, -3, -3], [3, 3, 3])),
    "sizes": ("geom.size", ["post", "cup", "egg", "ball", "rod"], mja.Uniform(0.5, 1.6, relative="scale")),
    "lifted": ("geom.pos", ["low"], mja.Uniform([-0.2, -0.2, 0], [0.2, 0.2, 0.06], relative="add")),
}


@functools.cache
def arena():
    objects = [mja.Object("box", full_size=(0.14, 0.1, 0.06)), mja.Object("ball_", "sphere", 0.1)]
    arena = mja.Arena.from_xml(SCENE, ["top"], objects=objects)
    arena.vary(**{name: dr.Term(attribute, names) for name, (attribute, names, _) in TERMS.items()})
    return arena


@pytest.mark.slow
def test_objects_keep_clear():
    """C finds no fixed geom in an object that has a place, in worlds in which all of them move; and free room is used up."""
    one = arena()
    ranges = mja.ArenaRanges(
        table_rots=mja.Uniform(-1, 1),
        table_full_sizes=mja.Uniform([0.7, 0.7, 0.01], [0.9, 0.9, 0.08]),
        terms={name: dist for name, (_, _, dist) in TERMS.items()},
    )
    keys = mja.world_keys(0, range(60))
    params = jax.vmap(lambda key: one.sample_params(key, ranges))(keys)
    found = jax.jit(jax.vmap(one.place))(params, keys)
    nearest = []
    for w in range(60):
        model, c = one.c_world(jax.tree.map(lambda x, w=w: np.asarray(x[w]), params))
        for obj, qpos, free in zip(one.objects, found.qpos[w], found.valid[w], strict=True):
            c.joint(obj.joint).qpos = qpos
            mujoco.mj_kinematics(model, c)
            ids = [model.geom(other).id for other in FIXED]
            away = [mujoco.mj_geomDistance(model, c, model.geom(f"{obj.name}_g0").id, g, 1.0, None) for g in ids]
            if free:
                nearest.append(min(away))
    assert len(nearest) > 90
    assert min(nearest) > -1e-5
    assert sum(x < 0.02 for x in nearest) > 8


HALL = """<mujoco><worldbody><geom name="floor" type="plane" size="0 0 .1"/>
  <body name="pillar" pos="1.2 .6 1"><geom name="shaft" type="cylinder" size=".15 1"/></body>
  <geom name="block" type="box" size=".2 .1 .3" pos="1.2 -.8 .3" euler="0 0 30"/></worldbody></mujoco>"""


@functools.cache
def hall():
    arena = mja.TableArena((0.7, 0.9, 0.04), xml=HALL)
    arena.add_part(furniture.Shelf("rack", pos=(2.5, 0, 0), size=(0.3, 0.5), heights=(0.3, 0.7, 1.1)))
    arena.vary(
        at=dr.Term("body.pos", "pillar"),
        turn=dr.Term("geom.rpy", "block", "yaw"),
        size=dr.Term("geom.size", "shaft"),
        level=dr.Term("geom.pos", "floor", "z"),
    )
    return arena


@pytest.mark.slow
def test_flags_are_as_in_c():
    """A table and a shelf are in a pillar or a block that moves, turns and grows where C says so."""
    one = hall()
    ranges = mja.ArenaRanges(
        terms={
            "at": mja.Uniform([-0.1, -0.5, 1], [2.7, 0.5, 1]),
            "turn": mja.Uniform([0, 0, -3], [0, 0, 3]),
            "size": mja.Uniform([0.05, 0.5, 0], [0.3, 1, 0]),
            "rack.pos": mja.Uniform([1.2, -0.8, 0], [2.5, 0.3, 0]),
        }
    )
    params = jax.vmap(lambda key: one.sample_params(key, ranges))(mja.world_keys(0, range(100)))
    flags, host = np.asarray(jax.jit(jax.vmap(one.valid))(params)), jax.tree.map(np.asarray, params)
    for w in range(100):
        world = jax.tree.map(lambda x, w=w: x[w], host)
        model, c = one.c_world(world)
        boxes = ["table_collision", *(n for g in range(model.ngeom) if (n := model.geom(g).name).startswith("rack_"))]
        pairs = [(model.geom(a).id, model.geom(b).id) for a in boxes for b in ("shaft", "block")]
        pairs += [(model.geom(a).id, model.geom("table_collision").id) for a in boxes[1:]]
        depth = -min(mujoco.mj_geomDistance(model, c, *pair, 0.01, None) for pair in pairs)
        assert flags[w] == (not one.problems(world))
        assert flags[w] == (depth < 0) or abs(depth) < 1e-4, (depth, one.problems(world))
    assert 15 < flags.sum() < 85


WRONG = {
    "a pillar in a shelf": ({"at": [[2.5, 0, 1]]}, "Part 'rack' ('rack_back') and 'shaft' overlap by 0.02 m."),
    "a floor above a shelf's foot": ({"level": [[0, 0, 0.05]]}, "Part 'rack' stands 0.05 m below the floor."),
}


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:`ranges.terms.level` lets 'block' sink up to 0.05 m into 'floor'")
@pytest.mark.parametrize("case", WRONG)
def test_told(case, tmp_path):
    """By `valid`, `problems` and `check`, whose bundle says it again without the arena."""
    change, says = WRONG[case]
    one, nominal = hall(), hall().nominal_params()
    terms = {name: jnp.asarray(x, jnp.float32) for name, x in change.items()}
    params = nominal._replace(terms={**nominal.terms, **terms})
    assert one.valid(nominal)
    assert not one.valid(params)
    assert says in one.problems(params)
    report = mja.check(
        one, mja.ArenaRanges(terms={n: mja.Fixed(x) for n, x in change.items()}), 1, n_steps=1, engine="c"
    )
    assert says in report.of(0)["invalid_arena"].what
    report.save_bundle(tmp_path / "bundle", 0)
    assert mja.replay(tmp_path / "bundle").found == report.of(0)


@dataclasses.dataclass(frozen=True)
class Bars:
    """A term of a user: a bar on a table that is half as long as the table."""

    name = "bars"
    quantities = ()

    def edit(self, spec, params):
        spec.geom("bar").size = [params.table_full_sizes[0, 0] / 4, 0.05, 0.05]

    def bind(self, model):
        return dataclasses.replace(BoundBars(), geom=model.geom("bar").id, shape=model.geom_size.shape)


@dataclasses.dataclass(frozen=True)
class BoundBars:
    geom: int = 0
    shape: tuple = ()

    def rows(self, params: ArenaParams):
        size = params.table_full_sizes[0, :1] / 4
        return [
            row(
                "geom_size",
                places(self.shape, np.array([self.geom]), [0]).reshape(-1),
                size,
                frozenset({"table_full_sizes"}),
            )
        ]


class WithBars(Parts):
    @property
    def terms(self):
        return (*super().terms, Bars())


def test_a_term_of_ones_own():
    """What it enlarges is kept clear, too."""
    xml = """<mujoco><worldbody><body name="table"><geom name="bar" type="box" size=".2 .05 .05" pos="0 0 .05"/>
      </body></worldbody></mujoco>"""
    plain = mja.TableArena(xml=xml, objects=[mja.Object("cube", full_size=0.05, pos=(0, 0.3))]).record
    one = mja.Arena(plain.spec.copy(), WithBars(**vars(plain.parts)), plain.nominal)
    params = one.nominal_params()
    params = params._replace(table_full_sizes=jnp.array([[1.6, 0.3, 0.04]]))
    found = jax.vmap(one.place, in_axes=(None, 0))(params, mja.world_keys(0, range(100)))
    x, y = np.abs(np.asarray(found.qpos)[np.asarray(found.valid[:, 0]), 0, :2]).T
    assert len(x) == 100
    assert (np.hypot(np.maximum(x - 0.4, 0), np.maximum(y - 0.05, 0)) > 0.025 - 1e-6).all()
    assert (x < 0.44).any()


COMING = """<mujoco><worldbody><geom name="floor" type="plane" size="0 0 .1"/>
  <body name="pillar" pos="1 0 1"><geom name="shaft" type="cylinder" size=".15 1"/></body>
  <body name="lamp" pos="0 0 1"><geom name="shade" type="box" size=".25 .2 .3"/></body></worldbody></mujoco>"""


@pytest.mark.slow
def test_what_comes_and_goes():
    """A pillar, and a lamp that hangs low above a table: tables and objects keep clear of them where they are there, as in C."""
    one = mja.TableArena(
        (0.8, 0.8, 0.04),
        table_offset=(0, 0, 0.66),
        xml=COMING,
        objects=[mja.Object("box", full_size=(0.1, 0.1, 0.06), pos=(-0.33, 0))],
    )
    one.vary(there=dr.Term("body.active", ["pillar", "lamp"]))
    ranges = mja.ArenaRanges(
        table_offsets=mja.Uniform([-0.2, -0.2, 0.65], [0.8, 0.2, 0.68]), terms={"there": mja.Bernoulli(0.5)}
    )
    keys = mja.world_keys(0, range(80))
    params = jax.vmap(lambda key: one.sample_params(key, ranges))(keys)
    found, flags = jax.jit(lambda p: (jax.vmap(one.place)(p, keys), jax.vmap(one.valid)(p)))(params)
    flags, qpos, free = (np.asarray(x) for x in (flags, found.qpos[:, 0], found.valid[:, 0]))
    seen, below = set(), 0
    for w in range(80):
        world = jax.tree.map(lambda x, w=w: np.asarray(x[w]), params)
        model, c = one.c_world(world)
        c.joint(one.objects[0].joint).qpos = qpos[w]
        mujoco.mj_kinematics(model, c)
        names = {model.geom(g).name for g in range(model.ngeom)}
        there = [name in names for name in ("shaft", "shade")]

        def away(a, b, names=names, model=model, c=c):
            return (
                mujoco.mj_geomDistance(model, c, model.geom(a).id, model.geom(b).id, 1.0, None) if b in names else 1.0
            )

        clear = away("table_collision", "shaft")
        assert flags[w] == (not one.problems(world))
        assert flags[w] == (clear >= 0) or abs(clear) < 1e-4
        assert not free[w] or min(away("box_g0", name) for name in ("shaft", "shade")) > -1e-5
        seen.add((there[0], flags[w]))
        below += not there[1] and np.abs(qpos[w, 0]) < 0.25 and np.abs(qpos[w, 1]) < 0.2
    assert seen == {(True, True), (True, False), (False, True)}
    assert below > 4
