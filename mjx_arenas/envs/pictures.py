"""Pictures of states, each of the arena that it has then (host)."""

import itertools
from collections.abc import Callable, Iterator, Sequence

import jax
import mujoco
import numpy as np
from mujoco_playground import State

from mjx_arenas.arena import Arena
from mjx_arenas.params.params import ArenaParams, named, on_host
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
    """(height, width, 3) of each of the states, which are of one world; by default all from where everything is seen in all of them."""
    pictures: list[np.ndarray] = []
    with render.Drawing(arena.mj_model, *shape[::-1]) as drawing:
        if camera is None and states:
            parts, aspect = arena.record.part_names, shape[1] / shape[0]
            towards = AT_FRONTS if parts else TOWARDS
            camera = render.overview(arena.table_names, _twins(arena, states), aspect, parts, towards, legs=False)
        for model, data in _twins(arena, states):
            scene = drawing.update(model, data, camera, scene_option)
            if modify_scene_fns is not None:
                modify_scene_fns[len(pictures)](scene)
            pictures.append(drawing.pixels())
    return pictures


def _twins(arena: Arena, states: Sequence[State]) -> Iterator[tuple[mujoco.MjModel, mujoco.MjData]]:
    """The world in C MuJoCo, in one state after the other."""
    runs = itertools.groupby(states, lambda state: [x.tobytes() for x in named(_numpy_params(state)).values()])
    for run in (list(same) for _, same in runs):
        params = _numpy_params(run[0])
        model, data = arena.c_world(params)
        there = arena.layout.presence.there(on_host(params))
        for state in run:
            cpu.set_state(data, state.data, arena.layout, there)
            yield model, data


def _numpy_params(state: State) -> ArenaParams:
    return jax.tree.map(np.asarray, state.info["episode"].params)
