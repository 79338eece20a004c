"""Parts of furniture, and objects in the nominal arena, are as near to a robot as they must be, and have room there."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mjx_arenas import geometry
from mjx_arenas.furniture import standing
from mjx_arenas.geometry import Array
from mjx_arenas.params.params import LARGEST, ArenaParams
from mjx_arenas.problem import Problem, numbered, problem
from mjx_arenas.problems.messages import by
from mjx_arenas.rules.rule import Rule, Rules
from mjx_arenas.sample import fixed, placement, tops
from mjx_arenas.sample.placement import Places
from mjx_arenas.spec.objects import Object


def _held(p: ArenaParams, r: Rules) -> Array:
    """() bool: each part that is there is within its distances."""
    if len(r.fixed.near.on) != len(r.furniture) or not any(part.near is not None for part in r.furniture):
        return np.True_
    return ~_wrong(p, r)[0].any()


def _wrong(p: ArenaParams, r: Rules) -> tuple[Array, Array]:
    """(P,) whether a part is too close or too far, and how far its nearest point is [m]."""
    xp = geometry.array_module(p.table_rots)
    center = fixed.points(r.fixed.near, r.ground, p)
    boxes, tops = standing.standing(r.furniture, p), standing.surfaces(r.furniture, p)  # zones have no boxes
    tops = tops._replace(full_size=xp.pad(tops.full_size[:, :2], ((0, 0), (0, 1))))
    every = standing.Standing(*map(xp.concatenate, zip(boxes, tops, strict=True)))
    of = np.array([*standing.owners(r.furniture), *standing.surface_owners(r.furniture)], int)
    beyond = xp.maximum(geometry.beyond(every.top, every.rot, every.full_size, center[of]), 0.0)
    found = xp.where(every.there, xp.hypot(beyond[:, 0], beyond[:, 1]), xp.inf)
    parts = np.arange(len(r.furniture))
    nearest = xp.where(of[None] == parts[:, None], found[None], xp.inf).min(-1)
    least, most = np.array([one.distance for one in r.furniture]).T
    of_least, of_most = (geometry.TOUCHING * (abs(center).sum(-1) + bound + 1.0) for bound in (least, most))  # rounding
    stays = np.array([one.near is not None for one in r.furniture]) & xp.isfinite(nearest)
    return stays & ((nearest < least - of_least) | (nearest > most + of_most)), nearest


def _told(p: ArenaParams, r: Rules, _: Any) -> Mapping[str, Any]:
    """What the message says about the first part."""
    return _parts_told(p, r)[0]


def _parts_told(p: ArenaParams, r: Rules) -> list[dict[str, Any]]:
    """What the message says about each part."""
    wrong, nearest = _wrong(p, r)
    parts = [(r.furniture[i], nearest[i]) for i in np.flatnonzero(wrong).tolist()]
    return [{"name": part.name, "away": away, **_wanted(part.near, part.distance)} for part, away in parts]


def _wanted(near: Any, distance: Sequence[float]) -> dict[str, str]:
    """What sentences call what something is near to, and the distances that are allowed."""
    least, most = distance
    called = repr(near) if isinstance(near, str) else "({:g}, {:g})".format(*(near or ()))
    return {"near": called, "allowed": f"at least {least:g}" if most == LARGEST else f"{least:g} to {most:g}"}


def nominal_problems(
    params: ArenaParams, rules: Rules, places: Places, objects: Sequence[Object], tables: Sequence[str]
) -> list[Problem]:
    """Parts and objects that are there in the nominal arena (`params`), but not within their distances, or without room (host)."""
    found = [] if _held(params, rules) else _parts_told(params, rules)
    problems = [problem("", "part_away", None, None, what) for what in found]
    problems += _without_room(params, places, objects, tables)
    if all(obj.place is None or obj.place.near is None for obj in objects):
        return problems
    reach, there = placement.reach(places, params), tops.present(params, places.ground)[1]
    for k, obj in enumerate(objects):
        if obj.place is None or obj.place.near is None or not there[k]:
            continue
        what, (least, most) = {"name": obj.name, **_wanted(obj.place.near, obj.place.distance)}, obj.place.distance
        least, most = least - reach.rounding[k], most + reach.rounding[k]
        if reach.nearest[k] > most or reach.farthest[k] < least:
            below = tops.label(int(params.object_tables[k]), numbered(tables), places.ground)
            what |= {"below": below, "closest": reach.nearest[k], "farthest": reach.farthest[k]}
            problems.append(problem("", "object_unreached", ("object", obj.name), None, what))
        elif obj.pos is not None and not least <= reach.nominal[k] <= most:
            problems.append(problem("", "object_away", ("object", obj.name), None, what | {"away": reach.nominal[k]}))
    return problems


def _without_room(
    params: ArenaParams, places: Places, objects: Sequence[Object], tables: Sequence[str]
) -> list[Problem]:
    """Objects that are there and do not fit into what their `region` and `margin` leave, at their one `rot` (host)."""
    one = places.rots[:, 0] == places.rots[:, 1]
    whole = (places.region == np.array([[-1.0, -1.0], [1.0, 1.0]])).all((-2, -1)) & (places.margin == 0) & ~one
    if whole.all():  # what is larger than its table or surface makes the world invalid
        return []
    room, there = placement.room(places, params), tops.present(params, places.ground)[1]
    problems = []
    for k in np.flatnonzero(~room.enough & ~whole & there).tolist():
        left = f"a disc of {room.size[k, 0]:.3g} m" if room.round[k] else f"{by(room.size[k])} m"
        below = tops.label(int(params.object_tables[k]), numbered(tables), places.ground)
        turned = f", turned by its `rot` of {places.rots[k, 0]:.3g}" if one[k] else ""
        what = {"name": objects[k].name, "left": left, "below": below, "size": room.outline[k], "turned": turned}
        problems.append(problem("", "object_without_room", ("object", objects[k].name), None, what))
    return problems


REACH = Rule("out_of_reach", "params", "world", (), _held, _told, shown=True)
