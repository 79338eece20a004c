"""Pictures of states, each of the arena that it has then (host)."""

import itertools
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import jax
import mujoco
import numpy as np
from mujoco_playground import State

from mjx_arenas.arena import Arena
from mjx_arenas.params.params import ArenaParams, named, on_host
from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import error
from mjx_arenas.twin import cpu
from mjx_arenas.viz import render

TOWARDS, AT_FRONTS = (140.0, -28.0), (60.0, -28.0)  # where the camera looks, and where there is furniture [deg]


def of(
    arena: Arena,
    states: Sequence[State],
    shape: tuple[int, int],
    camera: str | mujoco.MjvCamera | None,
    scene_option: mujoco.MjvOption | None,
    modify_scene_fns: Sequence[Callable[[mujoco.MjvScene], None]] | None,
) -> list[np.ndarray]:
    """(height, width, 3) of each of the states, which are of one world.

    By default all from where tables and furniture, and what moves near them, are seen in all of the states; from MuJoCo's free camera
    if there are none in one of them.

    Raises:
        ValueError: the states are of many worlds.
    """
    if any(state.data.qpos.ndim != 1 for state in states):
        told = {"of": "many", "instead": "mjx_arenas.take(state, 0) is the first"}
        raise error([problem("trajectory", "one_world", None, None, told)])
    pictures: list[np.ndarray] = []
    runs = list(_runs(arena, states))
    with render.Drawing(arena.mj_model, *shape[::-1]) as drawing:
        view = _view(arena, runs, shape[1] / shape[0]) if camera is None else camera
        for model, data in _twins(arena, runs):
            scene = drawing.update(model, data, view, scene_option)
            if modify_scene_fns is not None:
                modify_scene_fns[len(pictures)](scene)
            pictures.append(drawing.pixels())
    return pictures


class _Run(NamedTuple):
    """States, one after the other, in the same arena."""

    model: mujoco.MjModel
    data: mujoco.MjData
    there: np.ndarray
    states: list[State]


def _runs(arena: Arena, states: Sequence[State]) -> Iterator[_Run]:
    """The world in C MuJoCo, compiled once for each arena that it has."""
    for _, run in itertools.groupby(states, lambda state: [x.tobytes() for x in named(_numpy_params(state)).values()]):
        same = list(run)
        params = _numpy_params(same[0])
        yield _Run(*arena.c_world(params), arena.layout.presence.there(on_host(params)), same)


def _twins(arena: Arena, runs: Sequence[_Run]) -> Iterator[tuple[mujoco.MjModel, mujoco.MjData]]:
    """The same data in one state after the other, as copies would take more time and memory."""
    for model, data, there, states in runs:
        for state in states:
            cpu.set_state(data, state.data, arena.layout, there)
            yield model, data


def _view(arena: Arena, runs: Sequence[_Run], aspect: float) -> render.Camera:
    """One camera for all of the states."""
    tables, parts = arena.table_names, arena.record.part_names
    stand = {*tables, *parts}
    if not runs or not all(stand.intersection(run.model.body(b).name for b in range(run.model.nbody)) for run in runs):
        return -1
    towards = AT_FRONTS if parts else TOWARDS
    return render.overview(tables, _twins(arena, runs), aspect, parts, towards, legs=False)


def _numpy_params(state: State) -> ArenaParams:
    return jax.tree.map(np.asarray, state.info["episode"].params)
