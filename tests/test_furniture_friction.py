"""Furniture has the priority of its arena's tables: in C contacts on both follow one rule, and things slide as far in MJX as in C."""

import jax
import mujoco
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas import furniture

LOW, HIGH = 0.4, 0.8  # sliding friction of tables and furniture, and of objects
DESK = """<mujoco><worldbody><body name="desk" pos="0 0 .5"><geom type="box" size=".5 .5 .02" friction="0.4"/></body>
  </worldbody></mujoco>"""
EMPTY = "<mujoco><worldbody/></mujoco>"
SHELF = furniture.Shelf("rack", pos=(1.5, 0, 0), friction=(LOW, 0.005, 0.0001))
TRAY = furniture.Bin("tray", on="rack_board0", inner_size=(0.2, 0.2, 0.03), friction=(LOW, 0.005, 0.0001))


def sliding(friction):
    return friction, 0.005, 0.0001


def table(priority):
    return mja.TableArena(table_friction=sliding(LOW), table_priority=priority)


def scene(priority):
    return mja.Arena.from_xml(DESK, ["desk"], table_priority=priority)


def merged(priority):
    """The other arena's table keeps what it has."""
    return table(priority).merge(table(5), "far_", pos=(-3, 0, 0))


MADE = {
    "TableArena": (table, "table"),
    "MultiTableArena": (
        lambda p: mja.MultiTableArena([[0, 0, 0.8]], table_frictions=sliding(LOW), table_priority=p),
        "table0",
    ),
    "scene": (scene, "desk"),
    "no table": (lambda p: mja.Arena.from_xml(EMPTY, table_priority=p), None),
    "merged": (merged, "table"),
}


def furnished(made, raised, on):
    """With a shelf, a tray on it, a robot, and a cube of a priority on each of some surfaces."""
    made.add_part(SHELF)
    made.attach(
        "<mujoco><worldbody><body><joint/><geom size='.05' mass='1'/></body></worldbody></mujoco>", pos=(0, 3, 1)
    )
    made.add_part(TRAY)
    for name in on:
        made.add_object(mja.Object(f"on_{name}", full_size=0.06, on=name, friction=sliding(HIGH)))
        made.spec.geom(f"on_{name}_g0").priority = raised
    return made


def frictions(arena):
    """Sliding friction of the contacts of each object in C, after some steps."""
    model = arena.mj_model
    data, found = mujoco.MjData(model), {o.name: set() for o in arena.objects}
    mujoco.mj_step(model, data, nstep=20)
    for contact in data.contact:
        for name in found.keys() & {model.body(model.geom_bodyid[g]).name for g in contact.geom}:
            found[name].add(round(contact.friction[0], 6))
    return found


RULES = {(0, 0): HIGH, (1, 0): LOW, (2, 0): LOW, (0, 1): HIGH, (1, 1): HIGH, (2, 1): LOW}
"""Which friction counts, of each `table_priority` and `priority` of the object."""


@pytest.mark.slow
@pytest.mark.parametrize("kind", MADE)
def test_one_rule(kind):
    """On a table, on a board and in a tray that stands on another board an object has one friction, whatever the priorities."""
    make, desk = MADE[kind]
    on = [*([desk] if desk else []), "rack_board1", "tray_bottom"]
    for (priority, raised), expected in RULES.items():
        made = frictions(furnished(make(priority), raised, on))
        assert made == {f"on_{name}": {expected} for name in on}, (priority, raised)


def test_kept_in_files(tmp_path):
    """An arena that was saved and loaded has the same priorities."""
    for priority in (0, 2):
        arena = table(priority)
        arena.add_part(SHELF)
        arena.add_object(mja.Object("cube", full_size=0.06, on="rack_board1"))
        mja.save(tmp_path / "arena.yaml", arena)
        again, _ = mja.load(tmp_path / "arena.yaml")
        of = {geom.name: geom.priority for geom in again.spec.geoms if geom.name.startswith(("rack", "table_coll"))}
        assert len(of) == 1 + len(SHELF.nominal_boxes)
        assert set(of.values()) == {priority}
        assert again.record == arena.record


@pytest.mark.parametrize(("priority", "says"), [(1, "tables and furniture"), (0, None)])
def test_warned(recwarn, priority, says):
    """Ranges of objects' friction that nothing below them has are told, on tables and on furniture, unless a geom gets another priority."""
    ranges = mja.ArenaRanges(object_frictions=mja.Uniform(sliding(1.1), sliding(1.5)))
    for lowered in (False, True):
        made = furnished(table(priority), 0, ["table", "rack_board1"])
        if lowered:
            made.spec.geom("rack_board1").priority = 0
        made.check_ranges(ranges)
        told = [str(one.message) for one in recwarn.list if "has no effect on" in str(one.message)]
        said = f"`ranges.object_frictions` has no effect on {says}, whose own friction counts. With table_priority=0 the larger of the "
        said += "two would count. Between the fingers of a gripper that of objects with `priority=1` counts, if table_priority is 2."
        assert told == [said] * (says is not None and not lowered)
        recwarn.clear()


SPEED, STEPS = 1.0, 60


@pytest.mark.slow
@pytest.mark.xslow_on("warp")
@pytest.mark.parametrize("priority", [0, 1])
def test_slides(impl, priority):
    """A box that is pushed off on a worktop slides as far as in C, further where the friction that counts is less."""
    arena = mja.TableArena(table_priority=priority)
    arena.add_part(furniture.Counter("counter", pos=(2, 0, 0), widths=(2.0,), depth=0.6))
    arena.add_object(mja.Object("box", full_size=(0.1, 0.1, 0.04), on="counter_top0", friction=sliding(0.3)))
    ranges = mja.ArenaRanges(terms={"counter.friction": mja.Uniform(sliding(0.1), sliding(0.6))})
    keys = mja.world_keys(0, range(4))
    batch = arena.randomize(arena.put_model(impl), keys, ranges)
    counts = np.asarray(batch.params.terms["counter.friction"])[:, 0, 0]
    counts = np.maximum(counts, 0.3) if priority == 0 else counts
    dof = arena.mj_model.joint("box_joint0").dofadr[0] + 1
    data = mja.make_data(batch)
    start = data.replace(qvel=data.qvel.at[:, dof].set(SPEED))
    at = arena.layout.object_qpos[0, :3]
    end = np.asarray(mja.rollout(batch, start, STEPS).qpos, float)[:, at]
    moved = end[:, 1] - np.asarray(start.qpos)[:, at[1]]
    for w in range(len(keys)):
        model, c = arena.c_world(jax.tree.map(lambda x, w=w: np.asarray(x)[w], batch.params))
        c.qvel[dof] = SPEED
        mujoco.mj_step(model, c, nstep=STEPS)
        np.testing.assert_allclose(end[w], c.qpos[at], rtol=0, atol=5e-4)
    time = STEPS * arena.mj_model.opt.timestep
    np.testing.assert_allclose(moved, SPEED * time - 9.81 * counts * time**2 / 2, rtol=0.03)
    assert np.ptp(moved) > 0.01
