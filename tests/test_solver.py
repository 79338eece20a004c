"""Worlds in which the solver gives up are found, and no others."""

import warnings

import mujoco
import numpy as np
import pytest
from test_overlaps import TURNTABLE

import mjx_arenas as mja
from mjx_arenas.checks import watch, watch_c

TURNED = mja.ArenaRanges(table_rots=mja.Uniform(-1, 1))
CLUB = """<mujoco><worldbody><body name="club"><geom type="box" size=".02 .02 .1"/>
  <geom type="box" size=".03 .05 .04" pos=".05 .02 .1" density="5000"/>
  <body pos="0 0 -.1" euler="20 30 0"><geom size=".03" pos="0 .02 0"/></body></body></worldbody></mujoco>"""


def with_turntable():
    arena = mja.TableArena(
        objects=[mja.Object("cube"), mja.Object("club", "mjcf", file=mujoco.MjSpec.from_string(CLUB))]
    )
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "`robot`: geoms are inside each other")
        arena.attach(TURNTABLE, "r_")
    return arena


@pytest.mark.xslow_on("jax")
@pytest.mark.slow
@pytest.mark.parametrize("engine", ["jax", "warp"])
def test_link_in_its_base(engine):
    """Beside a link in its fixed base MJX's solver gives up in each world, where C's does not; without that contact none does."""
    arena = with_turntable()
    report = mja.check(arena, TURNED, 2, n_steps=40, engine=engine)
    found = report.failures["solver_gave_up"]
    assert [f.world for f in sorted(found)] == [0, 1]
    assert all(f.number > watch.LOST for f in found)
    assert "m/s apart from its forces, first in step" in found[0].what
    assert " moves up to " in found[0].what
    assert set(mja.check(arena, TURNED, 2, n_steps=40, engine="c").failures) == {"deep_penetration"}
    apart = with_turntable()
    apart.spec.add_exclude(bodyname1="world", bodyname2="r_link")
    assert mja.check(apart, TURNED, 2, n_steps=40, engine=engine).ok


def heap(iterations):
    """Data of clubs that fall onto each other and a table, after each of 300 steps."""
    objects = [mja.Object(f"club{k}", "mjcf", file=mujoco.MjSpec.from_string(CLUB), pos=(0, 0)) for k in range(4)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # they start inside each other
        model = mja.TableArena(objects=objects).mj_model
    model.opt.iterations = iterations
    c, numbers = mujoco.MjData(model), np.random.default_rng(0)
    for k in range(4):
        pose = np.array([0, 0, 1 + 0.3 * k, *numbers.normal(size=4)])
        c.joint(f"club{k}_joint0").qpos = pose
    bodies = np.array([model.body(f"club{k}").id for k in range(4)])
    for _ in range(300):
        mujoco.mj_step(model, c)
        yield c, bodies


@pytest.mark.slow
def test_what_the_solver_leaves_open(monkeypatch):
    """Where it comes to its end, bodies with their mass off their origin move as their forces say, to a millionth."""
    monkeypatch.setattr(watch, "OPEN", 1e-6)
    monkeypatch.setattr(watch, "LEAST", 1e-6)
    touching = 0
    for c, bodies in heap(100):
        model, dof = c.model, c.model.body_dofadr[bodies][:, None] + np.arange(6)
        of = c.xquat[bodies], (c.subtree_com - c.xpos)[bodies], model.body_subtreemass[bodies]
        gained, force = (c.qacc - c.qacc_smooth)[dof], c.qfrc_constraint[dof[:, :3]]
        assert not watch.lost_velocity(*of, gained, force, 1.0).any()
        # Without what constraints add, all of their force is open.
        want = np.linalg.norm(force, axis=1) / model.body_subtreemass[bodies]
        got = watch.lost_velocity(*of, 0 * gained, force, 0.002)
        np.testing.assert_allclose(got, np.where(want > 1e-6, 0.002 * want, 0), rtol=1e-12)
        touching += (want > 1).sum()
    assert touching > 300


@pytest.mark.slow
@pytest.mark.parametrize(("iterations", "gives_up"), [(100, False), (10, False), (1, True)])
def test_few_iterations(iterations, gives_up):
    """In C, one iteration is not enough for a heap; ten are."""
    seen = watch.nothing(1, 4)
    there = np.ones((1, 4), bool)
    zero, one = np.zeros(1), np.ones(1, bool)
    for c, bodies in heap(iterations):
        lost = watch_c._lost_velocity(c, bodies)[None]
        outside = np.full((1, 4), -1.0)
        now = watch.Now(one, ~one, np.int32(0), zero, zero, np.zeros((1, 2), int), outside, outside, lost)
        seen, _ = watch.update(seen, now, there)
    assert bool((seen.unsolved != watch.NEVER).any()) == gives_up


def test_steps_in_a_row():
    """What is lost counts in steps in a row, of what is there, from the step in which it adds up."""
    seen, there = watch.nothing(1, 4), np.array([[True, True, True, False]])
    zero, one, inside = np.zeros(1), np.ones(1, bool), np.full((1, 4), -1.0)
    goods = []
    for lost in ([0.15, 0.15, 0.3, 9], [0.15, 0.0, 0.1, 9], [0.0, 0.15, 0.0, 9]):
        now = watch.Now(one, ~one, np.int32(0), zero, zero, np.zeros((1, 2), int), inside, inside, np.array([lost]))
        seen, good = watch.update(seen, now, there)
        goods.append(bool(good[0]))
    assert seen.unsolved.tolist() == [[2, watch.NEVER, 1, watch.NEVER]]
    np.testing.assert_allclose(seen.most_lost, [[0.3, 0.15, 0.4, 0]])
    assert goods == [False, False, False]
