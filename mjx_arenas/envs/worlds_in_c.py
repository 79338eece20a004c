"""The worlds of an environment in C MuJoCo, whose data has the rows of the whole arena, also of what is absent in a world (host)."""

import dataclasses
from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas.envs.base import ArenaEnv
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import error
from mjx_arenas.record.layout import Layout

_KINDS = {
    "geom_": "geom",
    "site_": "site",
    "cam_": "cam",
    "qfrc_": "dof",
    "qacc": "dof",
    "cdof": "dof",
    "actuator_": "ctrl",
}
_KINDS |= {"xanchor": "joint", "xaxis": "joint", "act": "act", "x": "body", "cvel": "body", "subtree_": "body"}
"""What the rows of an array of `MjData` are of, by how its name begins: the first that fits."""

_BROKEN = mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC


class World(NamedTuple):
    """A recompiled world at the start of its episode, and where its rows are among those of the arena."""

    model: mujoco.MjModel
    data: mujoco.MjData
    rows: Mapping[str, np.ndarray]
    """(n,) bool, by names of arrays, of which rows are absent."""

    def move(self, given: Mapping[str, np.ndarray], n_steps: int) -> None:
        """Steps with arrays of the whole arena, by name: the control and mocap poses."""
        for name, value in given.items():
            getattr(self.data, name)[:] = value[self.rows[name]] if name in self.rows else value
        mujoco.mj_step(self.model, self.data, n_steps)

    @property
    def broken(self) -> bool:
        """Whether positions, velocities or accelerations were not finite, or too large, at which MuJoCo starts the world anew by itself."""
        states = np.concatenate([self.data.qpos, self.data.qvel])
        return any(self.data.warning[kind].number for kind in _BROKEN) or not (np.abs(states) <= mujoco.mjMAXVAL).all()

    def read(self, name: str, start: np.ndarray) -> np.ndarray:
        """An array of the data as the arena has it; what is absent is as at the start."""
        value = getattr(self.data, name)
        if name not in self.rows:
            return np.reshape(value, start.shape)
        whole = start.copy()
        whole[self.rows[name]] = np.reshape(value, (-1, *start.shape[1:]))
        return whole


def shared(data: mjx.Data, c: mujoco.MjData) -> list[str]:
    """Names of the arrays that both kinds of data have, alike."""
    fields: Any = dataclasses.fields(data)  # type: ignore[arg-type]
    names = [field.name for field in fields if isinstance(getattr(data, field.name), jax.Array)]
    return [name for name in names if np.size(getattr(c, name, ())) == getattr(data, name).size]


def world(env: ArenaEnv, params: ArenaParams, qpos: np.ndarray, names: list[str], index: int) -> World:
    """One recompiled world.

    Args:
        env: of the world.
        params: of the world, on the host.
        qpos: (nq,) of the whole arena at the start.
        names: arrays that are to be read.
        index: of the world, for messages.

    Raises:
        ValueError: arrays, such as `sensordata`, lack numbers of what is absent, of which nothing says where these were.
    """
    layout = env.arena.layout
    model, data = env.arena.c_world(params, keyframe=env.keyframe)
    kinds = _rows(layout, layout.presence.there(params))
    whole = mujoco.MjData(env.mj_model)
    rows = {}
    for name in (name for name in names if np.size(getattr(data, name)) != np.size(getattr(whole, name))):
        kind = name if name in kinds else next((of for begins, of in _KINDS.items() if name.startswith(begins)), "")
        if kind not in kinds:
            raise error([problem("env", "same_in_c", None, None, name=name, index=index)])
        rows[name] = kinds[kind]
    data.qpos[:] = qpos[rows["qpos"]] if "qpos" in rows else qpos
    data.time = 0.0  # whatever the keyframe's is
    mujoco.mj_forward(model, data)
    return World(model, data, rows)


def _rows(layout: Layout, there: np.ndarray) -> dict[str, np.ndarray]:
    """(n,) bool of each kind of element: which are in a world; `there` as `BoundPresence.there` says it."""
    model, groups, state = layout.model, layout.presence.groups, layout.state_rows(there)
    among = np.append(there, True)  # -1 is always there
    body = among[groups.body]
    rows = {"body": body, "dof": state["qvel"], "geom": body[model.geom_bodyid] & among[groups.geom]}
    rows |= {"joint": body[model.jnt_bodyid], "site": body[model.site_bodyid], "cam": body[model.cam_bodyid]}
    return state | rows
