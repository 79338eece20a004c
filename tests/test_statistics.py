"""Statistics of unusual models, as MuJoCo's compiler has them."""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
import worlds
from mujoco import mjx
from oracle import STRUCTURE_MAY_DIFFER, from_compiled

import mjx_arenas as mja
from mjx_arenas.write.kinematics import kinematics
from mjx_arenas.write.set_const import set_const
from mjx_arenas.write.statistics import Rows, Statistic, bounds, combine, statistic

RTOL = 1e-6  # of each number, or of its vector: it is the sum of a dozen numbers

FLEX = """<mujoco><default><geom contype="0" conaffinity="0"/></default><worldbody>
  <body pos="0 0 1"><freejoint/><geom size=".1" pos=".1 0 0"/></body>
  <flexcomp name="cloth" type="grid" count="3 3 1" spacing=".1 .2 .1" radius=".01" mass="1" dim="2" pos="0 0 .1">
    <edge equality="true"/><contact selfcollide="none"/></flexcomp>
  <flexcomp name="block" type="grid" count="2 3 2" dof="trilinear" spacing=".1 .3 .1" radius=".01" mass="1" dim="3"
    pos="1 0 .1"><contact selfcollide="none"/><elasticity young="100" poisson=".2"/></flexcomp></worldbody></mujoco>"""


def compare(got, want):
    for name in Statistic._fields:
        have, number = np.asarray(getattr(got, name)), np.asarray(getattr(want, name))
        np.testing.assert_allclose(have, number, rtol=0, atol=RTOL * np.linalg.norm(number), err_msg=name)


FLOOR = '<worldbody><geom name="floor" type="plane" size="2 3 .1" contype="1" conaffinity="1"/>'
ON_FLOOR = FLEX.replace("<worldbody>", FLOOR).replace('pos="0 0 .1"', 'pos="0 0 .01"').replace("1 0 .1", "1 0 .06")


@pytest.mark.parametrize("xml", [FLEX, ON_FLOOR], ids=["in the air", "on a floor"])
def test_flexes(xml):
    """A flex makes its bodies as large as its edges, or as its nodes are apart, also where it lies on a plane of the world."""
    m = mujoco.MjModel.from_xml_string(xml)
    d = mujoco.MjData(m)
    mujoco.mj_forward(m, d)
    assert (d.ncon > 0) == (xml is ON_FLOOR)
    got = jax.jit(statistic)(mjx.put_model(m, impl="warp"))
    compare(got, m.stat)


WORLD_ONLY = {
    "nothing": "",
    "plane": '<geom type="plane" size="0 0 1"/>',
    "box": '<geom type="box" size="1 2 .05" pos="1 1 1"/><site pos="3 3 3"/>',
    "small ball": '<geom size=".001" pos="1 2 3"/>',
    "site": '<site pos="1 2 3"/>',
    "bodies in one plane": '<body pos="1 2 3" mocap="true"/><body pos="1 .5 3"/>',
}


@pytest.mark.parametrize("name", WORLD_ONLY)
def test_without_bodies_or_width(name, impl):
    """Where no body but the world is left, or no width, MuJoCo's defaults stay."""
    m = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{WORLD_ONLY[name]}</worldbody></mujoco>")
    stale = mjx.put_model(m, impl=impl).tree_replace({"stat.center": jnp.ones(3), "stat.extent": jnp.float32(7)})
    compare(jax.jit(lambda model: set_const(model).stat)(stale), m.stat)
    if m.nbody == 1:
        compare(jax.jit(_of_the_world)(stale), m.stat)


def _of_the_world(model):
    low, high = bounds(model, kinematics(model), Rows.of(model, np.ones(1, bool)))
    return combine(low, high, 0.0, 0.0, model.stat.meaninertia, some=False)


def test_all_tables_absent(impl):
    """The statistics of a world without tables are those of the world that is compiled without them."""
    arena = mja.TableArena()
    params = arena.nominal_params()._replace(table_active=jnp.zeros(1, bool))
    compare(arena.apply(arena.put_model(impl), params).stat, arena.compile(params).stat)


SPRUNG = """<mujoco><worldbody><body name="b"><geom type="box" size=".05 .04 .03"/><site name="s0" pos="0 .04 .02"/>
  <body pos=".05 .02 .04"><joint axis="0 1 1"/><geom type="capsule" size=".01" fromto="0 0 0 .1 0 .02"/><site name="s1" pos=".1 0 0"/>
  </body></body></worldbody><tendon><spatial name="t" armature=".1"><site site="s0"/><site site="s1"/></spatial></tendon></mujoco>"""


@pytest.mark.slow
def test_armature_of_what_is_absent():
    """What a tendon's armature adds to the inertia is not counted without the object that it is in."""
    spring = mja.Object("spring", "mjcf", file=mujoco.MjSpec.from_string(SPRUNG))
    arena = mja.TableArena(objects=[spring, mja.Object("cube", pos=(0.2, 0.2))])
    model, nominal = arena.put_model("jax"), arena.nominal_params()
    for there in ([True, True], [False, True], [True, False]):
        params = nominal._replace(object_active=jnp.array(there))
        want, got = arena.compile(params), arena.apply(model, params)
        total = float(got.stat.meaninertia) * model.nv
        assert total == pytest.approx(want.stat.meaninertia * want.nv, rel=RTOL)


NUMBERS = {"center": "1 2 3", "extent": "4", "meansize": ".3", "meanmass": ".7", "meaninertia": ".02"}


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:statistic attribute 'meaninertia' is deprecated")  # MJX's solver divides by it
@pytest.mark.parametrize("names", [["center"], ["extent", "meanmass"], ["meansize", "meaninertia"], list(NUMBERS)])
def test_what_the_mjcf_gives_stays(names):
    """It follows from nothing; all else does."""
    given = " ".join(f'{name}="{NUMBERS[name]}"' for name in names)
    arena = worlds.arena(2, xml=f"<mujoco><statistic {given}/></mujoco>")
    params = arena.sample_params(jax.random.key(1), worlds.RANGES)
    fields, want = arena.fields(arena.put_model("jax"), params), arena.compile(params)
    assert {name for name in NUMBERS if f"stat.{name}" not in fields} == set(names)
    got = arena.apply(arena.put_model("jax"), params)
    assert from_compiled(got, want) <= STRUCTURE_MAY_DIFFER.keys()


TREE = """<mujoco><worldbody><body name="a" pos="0 0 1"><joint axis="0 1 0"/><geom type="capsule" size=".03 .2"/><site pos=".1 0 0"/>
<body name="b" pos=".2 .1 .3"><joint name="k" axis="1 0 0" pos=".01 .02 .03"/><geom name="g" type="capsule" size=".02 .1"/></body></body>
</worldbody></mujoco>"""


@pytest.mark.parametrize("of", ["center", "extent", "meansize"])
@pytest.mark.slow
def test_gradients(of):
    """By places, turns and sizes: those of finite differences, where geoms are round, too."""
    arena = mja.Arena.from_xml(TREE)
    terms = {"pos": "body.pos", "rpy": "body.rpy", "anchor": "joint.pos", "size": "geom.size"}
    arena.vary(**{name: mja.dr.Term(attribute, "g" if name == "size" else None) for name, attribute in terms.items()})
    model, params = arena.put_model("jax"), arena.nominal_params()

    def value(given):
        return getattr(arena.apply(model, params._replace(terms=given)).stat, of).sum()

    terms = {name: jnp.asarray(x) for name, x in params.terms.items()}
    terms["rpy"] = terms["rpy"] + 0.1
    gradient = jax.grad(value)(terms)
    step = 1e-2
    for name, slope in gradient.items():
        for place in np.ndindex(slope.shape):
            ahead, behind = ({**terms, name: terms[name].at[place].add(s)} for s in (step, -step))
            want = (value(ahead) - value(behind)) / (2 * step)
            np.testing.assert_allclose(slope[place], want, atol=2e-2, err_msg=f"{name}{place}")


NESTED = """<mujoco><default><geom contype="0" conaffinity="0"/></default><worldbody>
<camera name="c" pos="1 1 1" mode="trackcom"/>
<body name="a" pos="0 0 1" euler="0 10 20"><joint name="ba" type="ball" pos=".1 0 .1"/>
<geom name="ga" type="box" size=".1 .2 .3" pos=".1 0 0"/>
<body name="b" pos=".3 0 .1" euler="10 0 0"><geom name="gb" size=".1"/>
<body name="d" pos=".1 .2 0"><joint name="hd" axis="0 1 1" pos=".1 .2 .1"/>
<geom name="gd" type="capsule" size=".05 .1"/>
<site name="sd" pos=".1 0 0"/></body></body></body>
<body name="f" pos="1 0 1"><freejoint name="ff"/>
<geom name="gf" type="box" size=".1 .1 .2" pos=".1 .1 0"/></body></worldbody>
<tendon><fixed name="t" springlength="0" armature=".1"><joint joint="hd" coef="2"/></fixed></tendon>
<actuator><motor joint="hd"/></actuator></mujoco>"""


@pytest.mark.slow
def test_gradients_are_numbers():
    """Of the scene's box, whatever XLA computes a second time: the derivative of its own reductions would not be."""
    arena = mja.Arena.from_xml(NESTED)
    arena.vary(pos=mja.dr.Term("body.pos"), rpy=mja.dr.Term("body.rpy"), anchor=mja.dr.Term("joint.pos"))
    model, params, rng = arena.put_model("jax"), arena.nominal_params(), np.random.default_rng(0)
    terms = {k: jnp.asarray(v + 0.05 * rng.normal(size=(32, *v.shape)), v.dtype) for k, v in params.terms.items()}

    def center(given):
        return arena.apply(model, params._replace(terms=given)).stat.center.sum()

    for name, slopes in jax.jit(jax.vmap(jax.grad(center)))(terms).items():
        assert np.isfinite(slopes).all(), name
