"""Arenas merged into each other, at several levels."""

import functools

import mujoco
import numpy as np
import pytest

import mjx_arenas as mja

MOVES = ((2.0, 0.3, 0.1), 0.7), ((0.4, 5.0, -0.2), -1.1), ((-3.0, 1.0, 0.3), 2.3)
BOX = mujoco.mjtGeom.mjGEOM_BOX


def one(post):
    """A table that is turned, with an object, and a post beside it."""
    arena = mja.MultiTableArena([[0.1, -0.2, 0.8]], [0.4], objects=[mja.Object("cube", pos=(0.2, 0.1), rot=0.3)])
    arena.spec.worldbody.add_geom(name=post, type=BOX, size=(0.1, 0.1, 0.5), pos=(0.9, 0, 0.5))
    return arena


@functools.cache
def nested(levels):
    """An arena beside one that is beside one ..., each moved and turned in the next."""
    return one("post0") if levels == 0 else one(f"post{levels}").merge(nested(levels - 1), "b_", *MOVES[levels - 1])


def expected(name, levels):
    """Position and yaw of a table's top, or of a post, `levels` deep, from the moves alone."""
    pos, yaw = (np.array([0.1, -0.2, 0.8]), 0.4) if name == "table0" else (np.array([0.9, 0, 0.5]), 0.0)
    for shift, turn in MOVES[-levels:] if levels else ():
        cos, sin = np.cos(turn), np.sin(turn)
        pos, yaw = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]]) @ pos + shift, yaw + turn
    return pos, yaw


def test_options_of_compiled_arenas():
    """What is set on `mj_model.opt` of either is the merged arena's."""
    first, second = mja.TableArena(), mja.TableArena()
    first.mj_model.opt.timestep = 0.001
    second.mj_model.opt.gravity[:] = 0, 0, -3
    with pytest.warns(UserWarning, match="changes options of the whole arena.*gravity"):
        merged = first.merge(second, "b_", (3, 0, 0))
    assert merged.mj_model.opt.timestep == 0.001
    assert merged.mj_model.opt.gravity.tolist() == [0, 0, -3]


@pytest.mark.parametrize("said_by", ["mj_model", "compile", "to_xml"])
def test_merged_merged_arenas(said_by):
    """Three levels deep, tables, objects and posts stand where the moves put them, whoever is asked."""
    arena = nested(3)
    assert arena.table_names == ["table0", "b_table0", "b_b_table0", "b_b_b_table0"]
    params = arena._nominal  # of `nominal_params`, in double precision
    makers = {"mj_model": lambda: arena.mj_model, "compile": lambda: arena.compile(params)}
    makers["to_xml"] = lambda: mujoco.MjModel.from_xml_string(arena.to_xml(params))
    data = mujoco.MjData(makers[said_by]())
    tolerance = {"rtol": 0, "atol": 1e-9}
    mujoco.mj_kinematics(data.model, data)
    for level in range(4):
        prefix = "b_" * level
        pos, yaw = expected("table0", level)
        np.testing.assert_allclose(params.table_offsets[level], pos, rtol=0, atol=1e-9)
        np.testing.assert_allclose(params.table_rots[level], yaw, rtol=0, atol=1e-9)
        np.testing.assert_allclose(data.site(f"{prefix}table0_top").xpos, pos, **tolerance)
        turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
        np.testing.assert_allclose(data.body(f"{prefix}table0").xmat.reshape(3, 3), turn, **tolerance)
        middle = pos + turn @ [0.2, 0.1, 0.025]
        np.testing.assert_allclose(data.body(f"{prefix}cube").xpos, middle, **tolerance)
        post = data.geom(f"{prefix}post{3 - level}").xpos
        np.testing.assert_allclose(post, expected("post", level)[0], **tolerance)
