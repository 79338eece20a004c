"""Parts of furniture are as near to a robot as they must be."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from mjx_arenas import geometry
from mjx_arenas.furniture import standing
from mjx_arenas.geometry import Array
from mjx_arenas.params.params import LARGEST, ArenaParams
from mjx_arenas.rules.rule import Rule, Rules
from mjx_arenas.sample import fixed


def _held(p: ArenaParams, r: Rules) -> Array:
    """() bool: each part that is there is within its distances."""
    if len(r.fixed.near_on) != len(r.furniture) or not any(part.near is not None for part in r.furniture):
        return np.True_
    return ~_wrong(p, r)[0].any()


def _wrong(p: ArenaParams, r: Rules) -> tuple[Array, Array]:
    """(P,) whether a part is too close or too far, and how far its nearest point is [m]."""
    xp = geometry.array_module(p.table_rots)
    origin, yaw, _ = (x[np.asarray(r.fixed.near_on)] for x in fixed.frames(r.ground, p))
    center = origin[:, :2] + geometry.rotate_yaw(yaw, xp.asarray(r.fixed.near, origin.dtype))
    boxes, tops = standing.standing(r.furniture, p), standing.surfaces(r.furniture, p)  # zones have no boxes
    tops = tops._replace(full_size=xp.pad(tops.full_size[:, :2], ((0, 0), (0, 1))))
    every = standing.Standing(*map(xp.concatenate, zip(boxes, tops, strict=True)))
    of = np.array([*standing.owners(r.furniture), *standing.surface_owners(r.furniture)], int)
    away = center[of] - every.top[:, :2]
    beyond = xp.maximum(abs(geometry.rotate_yaw(-every.rot, away)) - every.full_size[:, :2] / 2, 0.0)
    found = xp.where(every.there, xp.hypot(beyond[:, 0], beyond[:, 1]), xp.inf)
    parts = np.arange(len(r.furniture))
    nearest = xp.where(of[None] == parts[:, None], found[None], xp.inf).min(-1)
    least, most = np.array([one.distance for one in r.furniture]).T
    of_least, of_most = (geometry.TOUCHING * (abs(center).sum(-1) + bound + 1.0) for bound in (least, most))  # rounding
    stays = np.array([one.near is not None for one in r.furniture]) & xp.isfinite(nearest)
    return stays & ((nearest < least - of_least) | (nearest > most + of_most)), nearest


def _told(p: ArenaParams, r: Rules, _: Any) -> Mapping[str, Any]:
    """Of the first one."""
    wrong, nearest = _wrong(p, r)
    i = int(np.flatnonzero(wrong)[0])
    part, (least, most) = r.furniture[i], r.furniture[i].distance
    near = repr(part.near) if isinstance(part.near, str) else "({:g}, {:g})".format(*(part.near or ()))
    allowed = f"at least {least:g}" if most == LARGEST else f"{least:g} to {most:g}"
    return {"name": part.name, "near": near, "away": nearest[i], "allowed": allowed}


REACH = Rule("out_of_reach", "params", "world", (), _held, _told, shown=True)
