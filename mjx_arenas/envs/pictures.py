"""Pictures of states, each of the arena that it has then (host)."""

import itertools
from collections.abc import Callable, Sequence

import jax
import mujoco
import numpy as np
from mujoco_playground import State

from mjx_arenas.arena import Arena
from mjx_arenas.params.params import ArenaParams, named, on_host
from mjx_arenas.twin import cpu
from mjx_arenas.viz import render


def of(
    arena: Arena,
    states: Sequence[State],
    shape: tuple[int, int],
    camera: str | mujoco.MjvCamera | None,
    scene_option: mujoco.MjvOption | None,
    modify_scene_fns: Sequence[Callable[[mujoco.MjvScene], None]] | None,
) -> list[np.ndarray]:
    """(height, width, 3) of each of the states, which are of one world."""
    pictures: list[np.ndarray] = []
    runs = itertools.groupby(states, lambda state: [x.tobytes() for x in named(_numpy_params(state)).values()])
    with render.Drawing(arena.mj_model, *shape[::-1]) as drawing:
        for run in (list(same) for _, same in runs):
            params = _numpy_params(run[0])
            model, data = arena.c_world(params)
            for state in run:
                cpu.set_state(data, state.data, arena.layout, arena.layout.presence.there(on_host(params)))
                scene = drawing.update(model, data, -1 if camera is None else camera, scene_option)
                if modify_scene_fns is not None:
                    modify_scene_fns[len(pictures)](scene)
                pictures.append(drawing.pixels())
    return pictures


def _numpy_params(state: State) -> ArenaParams:
    return jax.tree.map(np.asarray, state.info["episode"].params)
