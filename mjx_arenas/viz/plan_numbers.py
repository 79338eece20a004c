"""The numbers beside a plan, and what is above that on which it stands (host). K objects."""

from collections.abc import Mapping

import mujoco
import numpy as np

from mjx_arenas.params.params import ArenaParams, on_host
from mjx_arenas.record.record import Record
from mjx_arenas.sample import tops
from mjx_arenas.sample.placement import LIFTED
from mjx_arenas.spec.extents import extents
from mjx_arenas.viz.describe import World
from mjx_arenas.viz.table import columns

DASHED = "dashed: above its table or surface, as objects start\nthat have no free place, or are dropped"


def lifted(record: Record, params: ArenaParams, model: mujoco.MjModel, data: mujoco.MjData) -> dict[str, float]:
    """Objects of a world that are above their tables or surfaces, such as those that start without a free place: how far [m]."""
    params, ground = on_host(params), record.parts.places.ground
    top, found = tops.surfaces(params, ground).of(params.object_tables).top[:, 2], {}
    for k in np.flatnonzero(tops.present(params, ground)[1]).tolist():
        name = record.object_names[k]
        own = model.body_rootid[model.geom_bodyid] == model.body(name).id
        above = extents(model, data, own, np.zeros(3), np.eye(3))[0][2] - float(top[k])
        if above > LIFTED:
            found[name] = float(above)
    return found


def label(name: str, lifted: Mapping[str, float]) -> str:
    """What the plan calls an object."""
    return f"{name}, {lifted[name]:.2g} m above" if name in lifted else name


def listed(world: World, data: mujoco.MjData, centres: Mapping[str, np.ndarray], lifted: Mapping[str, float]) -> str:
    """Tables of tables, parts and objects."""
    blocks = [_tables(world), _parts(world), _objects(world, data, centres, lifted), DASHED if lifted else ""]
    return "\n\n".join(filter(None, blocks))


def _tables(world: World) -> str:
    head = ("table", "size [m]", "yaw [deg]", "top at z [m]", "")
    rows = [
        (t.name, f"{t.size[0]:.3f} x {t.size[1]:.3f}", f"{t.yaw:.1f}", f"{t.position[2]:.3f}", "legs" if t.legs else "")
        if t.present
        else (t.name, "absent", "", "", "")
        for t in world.tables
    ]
    return columns([head, *rows]) if rows else ""


def _parts(world: World) -> str:
    head = ("part", "kind", "size [m]", "yaw [deg]", "from z [m]", "without")
    rows = [
        (
            p.name,
            p.kind,
            " x ".join(f"{x:.3f}" for x in p.size),
            f"{p.yaw:.1f}",
            f"{p.position[2]:.3f}",
            ", ".join(p.without),
        )
        if p.present
        else (p.name, "absent", "", "", "", "")
        for p in world.parts
    ]
    return columns([head, *rows]) if rows else ""


def _objects(world: World, data: mujoco.MjData, centres: Mapping[str, np.ndarray], lifted: Mapping[str, float]) -> str:
    head = ["object", "on", "size [m]", f"from {next(iter(centres)) if len(centres) == 1 else 'nearest +'} [m]"]
    rows = []
    for o in world.objects:
        if o.present:
            away = min(np.linalg.norm(data.body(o.name).xpos[:2] - centre) for centre in centres.values())
            above = f"above {o.table}" if o.name in lifted else o.table
            rows.append((o.name, above, " x ".join(f"{x:.3f}" for x in o.size), f"{away:.3f}"))
        else:
            rows.append((o.name, "absent", "", ""))
    return columns([head, *rows]) if rows else ""
