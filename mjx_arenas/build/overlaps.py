"""Geoms that start inside each other, robots in themselves and in the arena, and robots that start far from their table (host)."""

from collections.abc import Collection, Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from mjx_arenas.problem import problem
from mjx_arenas.problems import messages
from mjx_arenas.spec import specs
from mjx_arenas.terms.tables import TableNames

LEAST = 1e-3  # depth that is told [m]; MuJoCo's soft contacts rest at a tenth of it
FAR = 0.3  # [m] from the table on which a robot stands
SHOWN = 3  # pairs that are told
# What a contact may cost in the solution of C's solver [kg m^2/s^4]. MJX minimizes the sum of all costs in single precision,
# which beside this one loses a hundredth of what decides whether 0.1 kg is supported (0.1 kg x g^2 / 2).
LARGEST_COST = 0.01 * (0.1 * 9.81**2 / 2) / float(np.finfo(np.float32).epsneg)


class Overlap(NamedTuple):
    """Two bodies that are inside each other."""

    bodies: tuple[str, str]  # names, "" where a body has none
    geoms: tuple[str, str]  # as messages call them, of the deepest contact
    depth: float  # of that [m]
    cost: float  # largest of a contact, which is left in the solution: hardly any where joints can part them
    states: tuple[str, ...]  # in which they are, in words
    within: bool  # they belong to one robot, in which contacts hold nothing and may be left out

    @property
    def stuck(self) -> bool:
        """No joint parts them, and MJX loses other contacts beside theirs."""
        return self.cost > LARGEST_COST


def overlaps(
    model: mujoco.MjModel,
    prefix: str,
    but: Collection[str],
    keyframe: str | None = None,
    carriers: Collection[str] = (),
) -> list[Overlap]:
    """Pairs of bodies that are inside each other at `qpos0` or in a keyframe, the deepest first.

    Args:
        model: of an arena.
        prefix: of the names of what at least one of a pair belongs to; what has no name may belong to it.
        but: names of bodies on the world, which are left out with all that hangs on them.
        keyframe: the only one that counts; None: all, and `qpos0`.
        carriers: names of the bodies of tables and parts, which belong to no robot that stands on them.
    """
    found: dict[tuple[int, int], Overlap] = {}
    data = mujoco.MjData(model)
    for k in range(-1, model.nkey) if keyframe is None else [model.key(keyframe).id]:
        mujoco.mj_resetData(model, data)
        if k >= 0:
            mujoco.mj_resetDataKeyframe(model, data, k)
        state = "at qpos0" if k < 0 else f"in keyframe {model.key(k).name!r}"
        mujoco.mj_forward(model, data)
        for i, contact in enumerate(data.contact):
            if contact.dist > -LEAST or min(contact.geom) < 0:  # of a flex
                continue
            one, other = int(contact.geom[0]), int(contact.geom[1])
            first, second = sorted((int(model.geom_bodyid[one]), int(model.geom_bodyid[other])))
            roots = {model.body(model.body_rootid[b]).name for b in (first, second)}
            if not (_is_of(model, one, prefix) or _is_of(model, other, prefix)) or not roots.isdisjoint(but):
                continue
            geoms = specs.geom_name(model, one), specs.geom_name(model, other)
            new = Overlap(
                (model.body(first).name, model.body(second).name),
                geoms,
                depth=0.0,
                cost=0.0,
                states=(),
                within=_are_of_one(model, one, other, prefix, carriers),
            )
            before = found.get((first, second), new)
            deeper = before if before.depth > -contact.dist else before._replace(geoms=geoms, depth=-contact.dist)
            cost, states = max(before.cost, _cost(data, i)), tuple(dict.fromkeys((*before.states, state)))
            found[first, second] = deeper._replace(cost=cost, states=states)
    return sorted(found.values(), key=lambda overlap: (-overlap.stuck, -overlap.depth))


def _cost(data: mujoco.MjData, contact: int) -> float:
    of_contacts = data.efc_type >= int(mujoco.mjtConstraint.mjCNSTR_CONTACT_FRICTIONLESS)
    rows = np.flatnonzero(of_contacts & (data.efc_id == contact))
    return float((data.efc_force[rows] ** 2 / (2 * data.efc_D[rows])).sum())


def _is_of(model: mujoco.MjModel, geom: int, prefix: str) -> bool:
    body = int(model.geom_bodyid[geom])
    names = [model.geom(geom).name, *([model.body(body).name] if body else [])]
    return any(name.startswith(prefix) for name in names) or not any(names)


def _are_of_one(model: mujoco.MjModel, one: int, other: int, prefix: str, carriers: Collection[str]) -> bool:
    """Whether geoms belong to the robot of a prefix; without one, whether they hang on one body of the world, or of a carrier."""
    bodies = model.geom_bodyid[[one, other]].tolist()
    if prefix:  # which all bodies of the robot have, and its geoms on the world
        names = (model.body(b).name if b else model.geom(g).name for g, b in zip((one, other), bodies, strict=True))
        return all(name.startswith(prefix) for name in names)
    ends = {0, *(model.body(name).id for name in carriers)}
    roots = {_below(model, body, ends) for body in bodies}
    return len(roots) == 1 and roots.isdisjoint(ends)


def _below(model: mujoco.MjModel, body: int, ends: Collection[int]) -> int:
    """The last body before one of `ends` on the way from a body to the world; the body itself where it is one of them."""
    while body not in ends and int(model.body_parentid[body]) not in ends:
        body = int(model.body_parentid[body])
    return body


def warn(found: list[Overlap], where: str, unnamed: bool = False) -> None:
    """Warns of what is inside each other, with what to do: once of what may stay so, and once of what may not.

    `unnamed`: `attach` could be told a keyframe, and was not.
    """
    _warn([o for o in found if o.within], where, "geoms_inside", unnamed)
    _warn([o for o in found if not o.within], where, "geoms_in_others", unnamed)


def _warn(found: list[Overlap], where: str, rule: str, unnamed: bool) -> None:
    if not found:
        return
    stuck = ", from which no joint parts them"
    told = [f"{' and '.join(o.geoms)} {o.depth:.3f} m {_listed(o.states)}{stuck * o.stuck}" for o in found[:SHOWN]]
    lost = (
        " Beside such contacts MJX diverges, or loses friction and support of all else in the world."
        if found[0].stuck
        else ""
    )
    more = f", and {len(found) - SHOWN} more pairs" if len(found) > SHOWN else ""
    first = next((o.bodies for o in found if all(o.bodies)), ("...", "..."))
    or_else = ", or name the `keyframe` in which the robot starts, if they are apart in it" * unnamed
    numbers = {
        "or_else": or_else,
        "where": where,
        "told": "; ".join(told) + more,
        "lost": lost,
        "first": first[0],
        "second": first[1],
    }
    messages.warn(problem("", rule, None, None, numbers))


def warn_of_gap(model: mujoco.MjModel, prefix: str, pos: Sequence[float], table: TableNames | None) -> None:
    """Warns where neither the origin of a robot nor, at `qpos0`, any of its geoms is near the table on which it was put.

    Args:
        model: of an arena.
        prefix: of the names of the robot.
        pos: (3,) its origin in the frame of the top.
        table: its names; None: it stands elsewhere.
    """
    if table is None:
        return
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    top = model.geom(table.collision).id
    half = model.geom_size[top]
    if np.linalg.norm(np.maximum(np.abs(np.asarray(pos, float) + np.array([0, 0, half[2]])) - half, 0)) <= FAR:
        return
    named = [model.body(int(body)).name for body in model.geom_bodyid]
    robot = [g for g in range(model.ngeom) if model.geom_bodyid[g] and named[g].startswith(prefix)]
    gaps = (mujoco.mj_geomDistance(model, data, top, g, 2 * FAR, None) for g in robot)
    least = min(gaps, default=0.0)
    if least > FAR:
        at_least = "at least " if least >= 2 * FAR else ""
        messages.warn(
            problem(
                "pos", "far_from_table", None, None, {"gap": f"{at_least}{least:.1f}", "table": f"table {table.body!r}"}
            )
        )


def _listed(words: tuple[str, ...]) -> str:
    few = words if len(words) <= SHOWN else (*words[:SHOWN], f"{len(words) - SHOWN} more keyframes")
    return few[0] if len(few) == 1 else f"{', '.join(few[:-1])} and {few[-1]}"
