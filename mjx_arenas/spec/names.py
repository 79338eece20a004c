"""Names of elements: what is none, and what messages call elements, also those without one (host)."""

from collections.abc import Callable, Container, Iterable

import mujoco

from mjx_arenas.problem import Problem, problem
from mjx_arenas.spec import specs

OF_TASKS = "arm_"
"""What the names of an arm begin with that a task attaches."""


def problems(path: str, name: object, taken: Container[str] = (), of: str = "") -> list[Problem]:
    """What is wrong with a name for a new element, or with a prefix. MuJoCo ends a name at NUL without a word.

    Args:
        path: of the argument.
        name: what is given.
        taken: names that others have.
        of: what these others are, in words.
    """
    if isinstance(name, str) and not name.isprintable():
        return [problem(path, "must", None, name, must="a string of characters that can be printed")]
    if isinstance(name, str) and name and name not in taken:
        return []
    if not of:
        return [problem(path, "text", None, name)]
    return [problem(path, "must", None, name, must=f"a text that no {of} of the arena has")]


def of_task(name: object, known: Iterable[str]) -> bool:
    """Whether an unknown name may be of an arm that a task attaches later: none that is known begins so."""
    return str(name).startswith(OF_TASKS) and not any(one.startswith(OF_TASKS) for one in known)


def element(model: mujoco.MjModel, kind: str, index: int) -> str:
    """An element, such as "joint 'hinge'" or "equality 0 (weld of body 'a' and body 'b')"; `kind` as `MjModel` has it."""
    if name := getattr(model, kind)(index).name:
        return f"{kind} {name!r}"
    if kind in ("geom", "body"):
        return specs.geom_name(model, index) if kind == "geom" else f"body {specs.body_name(model, index)}"
    described = _OF[kind](model, index) if kind in _OF else ""
    return f"{kind} {index}" + (f" ({described})" if described else "")


def _of_body(model: mujoco.MjModel, kind: str, index: int) -> str:
    return f"of {element(model, 'body', int(getattr(model, kind)(index).bodyid[0]))}"


def _joint(model: mujoco.MjModel, index: int) -> str:
    return f"{_word(mujoco.mjtJoint(model.jnt_type[index]))} {_of_body(model, 'joint', index)}"


def _equality(model: mujoco.MjModel, index: int) -> str:
    kind = mujoco.mjtEq(model.eq_type[index])
    of = {mujoco.mjtEq.mjEQ_JOINT: "joint", mujoco.mjtEq.mjEQ_TENDON: "tendon"}.get(kind)
    if kind in (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD):
        of = "site" if model.eq_objtype[index] == mujoco.mjtObj.mjOBJ_SITE else "body"
    ids = [int(i) for i in (model.eq_obj1id[index], model.eq_obj2id[index]) if i >= 0] if of else []
    ends = " and ".join(element(model, of, i) for i in ids) if of else ""
    return f"{_word(kind)} of {ends}" if ends else _word(kind)


def _tendon(model: mujoco.MjModel, index: int) -> str:
    first = model.tendon_adr[index]
    if model.wrap_type[first] == mujoco.mjtWrap.mjWRAP_JOINT:
        return f"fixed, of {element(model, 'joint', int(model.wrap_objid[first]))}"
    return f"spatial, from {element(model, 'site', int(model.wrap_objid[first]))}"


def _actuator(model: mujoco.MjModel, index: int) -> str:
    target = mujoco.mjtTrn(model.actuator_trntype[index])
    kind = {"jointinparent": "joint", "slidercrank": "site"}.get(_word(target), _word(target))
    known = kind in ("joint", "tendon", "site", "body")
    return f"of {element(model, kind, int(model.actuator_trnid[index, 0]))}" if known else ""


def _pair(model: mujoco.MjModel, index: int) -> str:
    ends = (int(model.pair_geom1[index]), int(model.pair_geom2[index]))
    return f"of {' and '.join(element(model, 'geom', g) for g in ends)}"


def _word(constant: object) -> str:
    """A constant of MuJoCo's as MJCF calls it: "weld" of mjEQ_WELD."""
    return constant.name.partition("_")[2].lower()  # type: ignore[attr-defined]


_OF: dict[str, Callable[[mujoco.MjModel, int], str]] = {
    "joint": _joint,
    "equality": _equality,
    "tendon": _tendon,
    "actuator": _actuator,
    "pair": _pair,
} | {kind: lambda model, i, kind=kind: _of_body(model, kind, i) for kind in ("site", "camera", "light")}
