"""Tasks of arms say which of their surfaces have something so low above them that a tool that points down does not get there."""

import warnings

import pytest

pytest.importorskip("mujoco_playground")

from test_reach import arm_of
from worlds import elliptic

import mjx_arenas as mja
from mjx_arenas import furniture
from mjx_arenas.envs import Lift, PickAndPlace, arms


def said(make):
    """Warnings about what is above surfaces."""
    with warnings.catch_warnings(record=True) as given:
        warnings.simplefilter("always")
        make()
    return [str(w.message) for w in given if "hardly fits there" in str(w.message)]


def shelf(on, gap, turned=0.0):
    arena = elliptic(mja.TableArena((0.8, 0.8, 0.05)))
    arena.add_part(furniture.Shelf("rack", pos=(0.6, 0.0, 0.0), rot=turned, heights=(0.9, 0.9 + gap, 0.9 + 3 * gap)))
    arena.add_object(mja.Object("cube", full_size=0.04, on=on))
    return arena


@pytest.mark.parametrize("turned", [0.0, 0.7])
def test_goals_under_boards(turned):
    """The board above counts, not the one on top, also if the shelf is turned."""
    goals = ["rack_board0", "rack_board1", "rack_board2"]
    (only,) = said(lambda: PickAndPlace(arena=shelf("table", 0.3, turned), arm=arms.small(), on="table", goals=goals))
    assert only == (
        "`goals`: the goal may be on 'rack_board0' (0.28 m below 'rack_board1'). The hand of an arm whose tool points down hardly "
        "fits there, and `invalid_arena` does not count such episodes."
    )
    assert not said(lambda: PickAndPlace(arena=shelf("table", 0.45, turned), arm=arms.small(), on="table", goals=goals))


def test_objects_under_boards():
    (only,) = said(lambda: Lift(arena=shelf("rack_board0", 0.3), arm=arms.small(), on="table"))
    assert only.startswith("`arena`: object 'cube' may be on 'rack_board0' (0.28 m below 'rack_board1').")


@pytest.mark.slow
def test_the_arm_itself_does_not_count():
    """The Panda's base collides, and stands in the middle of the table that carries the cube."""
    assert not said(lambda: Lift(arena=shelf("table", 0.3), arm=arm_of("panda"), on="table"))


def test_tasks_of_our_own_have_room():
    assert not said(lambda: PickAndPlace(arm=arms.small()))
