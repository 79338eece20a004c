"""Many worlds in one model of C MuJoCo, and its viewer (host)."""

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas.build import attach
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.problem import Problem, problem
from mjx_arenas.record.record import Record
from mjx_arenas.rules import validation
from mjx_arenas.spec import specs
from mjx_arenas.spec.extents import extents
from mjx_arenas.twin import twin
from mjx_arenas.viz import render

GAP = 1.0  # between worlds [m]
_PLANE, _SUN = mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtLightType.mjLIGHT_DIRECTIONAL


class Tiles(NamedTuple):
    """Worlds side by side."""

    spec: mujoco.MjSpec
    model: mujoco.MjModel
    data: mujoco.MjData
    """The data with all worlds' states, after `mj_forward`."""
    offsets: np.ndarray
    """(W, 3) where the origin of each world stands [m]."""


def tile(worlds: Sequence[tuple[mujoco.MjSpec, mujoco.MjModel, mujoco.MjData]]) -> Tiles:
    """Worlds in a square.

    Args:
        worlds: the spec of each (it is used up), its model and its data.
    """
    first, model, _ = worlds[0]
    validation.raise_all(_problems(first, model), "tile")
    offsets = _offsets([model for _, model, _ in worlds])
    spec = mujoco.MjSpec()
    for shared in ("option", "visual", "stat"):
        specs.copy_settings(getattr(first, shared), getattr(spec, shared))
    for i, ((child, _, _), offset) in enumerate(zip(worlds, offsets, strict=True)):
        for key in list(child.keys):
            child.delete(key)
        child.nkey = 0
        _share(child, i == 0)
        specs.attach(spec, child, f"world{i}_", spec.worldbody.add_frame(pos=offset), f"worlds[{i}]")
    model = spec.compile()
    data = mujoco.MjData(model)
    for name in ("qpos", "qvel", "act", "ctrl", "qacc_warmstart", "eq_active", "mocap_pos", "mocap_quat"):
        setattr(data, name, np.concatenate([getattr(c, name) for _, _, c in worlds]))
    start = 0
    for (_, one, _), offset in zip(worlds, offsets, strict=True):
        for adr in one.jnt_qposadr[one.jnt_type == mujoco.mjtJoint.mjJNT_FREE]:
            data.qpos[start + adr : start + adr + 3] += offset
        start += one.nq
    data.mocap_pos += np.concatenate([np.tile(o, (m.nmocap, 1)) for (_, m, _), o in zip(worlds, offsets, strict=True)])
    data.time = worlds[0][2].time
    mujoco.mj_forward(model, data)
    return Tiles(spec, model, data, offsets)


def of(
    record: Record, params: ArenaParams, data: mjx.Data | Sequence[mujoco.MjData] | None, keyframe: str | None
) -> Tiles:
    """Many worlds of an arena side by side; see `Arena.tile`."""
    held = dict(record.spec.assets)
    twins = twin.worlds(record, params, data)
    return tile(
        [
            (
                mujoco.MjSpec.from_string(twin.to_xml(record, p), assets=held),
                *twin.c_world(record, p, d, keyframe=keyframe),
            )
            for p, d in twins
        ]
    )


def _offsets(models: Sequence[mujoco.MjModel]) -> np.ndarray:
    """(W, 3) places in rows, each as large as the largest world at `qpos0`."""
    lows, highs = [], []
    for model in models:
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        solid = ~np.isin(model.geom_type, [_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD])
        if solid.any():
            low, high = extents(model, data, solid, np.zeros(3), np.eye(3))
            lows.append(low)
            highs.append(high)
    pitch = np.max(highs, axis=0) - np.min(lows, axis=0) + GAP if lows else np.full(3, GAP)
    row, column = np.divmod(np.arange(len(models)), int(np.ceil(np.sqrt(len(models)))))
    return np.stack([column * pitch[0], row * pitch[1], np.zeros(len(models))], axis=1)


def _problems(spec: mujoco.MjSpec, model: mujoco.MjModel) -> list[Problem]:
    """What cannot be shared between tiles."""
    data, problems = mujoco.MjData(model), []
    mujoco.mj_kinematics(model, data)
    for geom in np.flatnonzero(model.geom_type == _PLANE):
        name = model.geom(geom).name
        if data.geom_xmat[geom, 8] < 1 - 1e-6:
            problems.append(problem("arena.spec", "tilted_plane", ("entry", name), name=name))
        if model.geom_bodyid[geom] == 0 and name:
            who = attach.referring(spec, "geoms", name)
            problems += [problem("arena.spec", "shared_plane", ("entry", name), who=one, name=name) for one in who]
    return problems


def _share(spec: mujoco.MjSpec, is_first: bool) -> None:
    """Leaves the floors and the world's lights to the first of the worlds, and makes them as wide as all are."""
    for plane in [g for g in spec.worldbody.geoms if g.type == _PLANE]:
        if is_first:
            plane.size = (0, 0, plane.size[2])  # drawn without an end
        else:
            spec.delete(plane)
    for light in list(spec.worldbody.lights):
        if not is_first:
            spec.delete(light)
        elif light.type != _SUN:
            light.type, light.diffuse = _SUN, 0.6 * light.diffuse  # which does not fade


def view(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """MuJoCo's viewer, until it is closed.

    Raises:
        RuntimeError: there is no screen here.
    """
    render.check_screen()
    from mujoco import viewer

    # With a title, for which MuJoCo has a path: without one the viewer does not turn its camera to the model.
    viewer.launch(loader=lambda: (model, data, "mjx_arenas"))  # type: ignore[arg-type]
