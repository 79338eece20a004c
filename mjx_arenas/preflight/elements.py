"""What the rows of a model's fields are of: a body, a joint, an actuator, by name (host)."""

import numpy as np
from mujoco import mjx

from mjx_arenas.spec import automatic

# The elements that fields with these first words have a row for, by `mjx.Model`'s table of their names.
_TABLES = {
    kind: f"name_{kind}adr" for kind in ("body", "jnt", "geom", "site", "cam", "pair", "eq", "tendon", "actuator")
}

_WORDS = {"cam": "camera", "eq": "equality", "jnt": "joint"}


def body(model: mjx.Model, index: int) -> str:
    """A body."""
    return _name(model, "name_bodyadr", index)


def geom(model: mjx.Model, index: int) -> str:
    """A geom."""
    return _name(model, "name_geomadr", index) or f"geom {index}"


def names(model: mjx.Model, kind: str) -> list[str]:
    """The names of all elements of a kind ("body", "jnt", "geom", ...), "" of those that have none."""
    starts = np.asarray(getattr(model, _TABLES[kind])).tolist()
    return [model.names[start : model.names.index(b"\0", start)].decode() for start in starts]


def called(model: mjx.Model, kind: str, index: int) -> str:
    """What messages call an element: geom 'table', or geom 3; bodies without a name as `automatic` would name them."""
    return f"{_WORDS.get(kind, kind)} {_name(model, _TABLES[kind], index) or index}"


def number(model: mjx.Model, field: str, index: tuple[int, ...]) -> str:
    """One number of a field, such as 'table'[2]; of those of degrees of freedom and positions, by their joint."""
    kind, row, rest = field.removeprefix("_impl.").partition("_")[0], index[:1], index[1:]
    if field in ("qpos0", "qpos_spring") or kind == "dof":
        begin = np.asarray(model.jnt_dofadr if kind == "dof" else model.jnt_qposadr)
        joint = int(np.searchsorted(begin, index[0], "right")) - 1
        end = begin[joint + 1] if joint + 1 < len(begin) else (model.nv if kind == "dof" else model.nq)
        kind, row = "jnt", (joint,)
        rest = (index[0] - int(begin[joint]), *rest) if end - begin[joint] > 1 else rest
    name = _name(model, _TABLES[kind], row[0]) if kind in _TABLES and row else ""
    if not name and kind == "jnt" and row:
        name = f"a joint of {body(model, int(model.jnt_bodyid[row[0]]))} "
    elif not name and kind in _TABLES and row:
        name = f"{_WORDS.get(kind, kind)} {row[0]} "
    shown = [int(i) for i in (rest if name else index)]
    return f"{name}{shown or ''}".strip()


def _name(model: mjx.Model, table: str, index: int) -> str:
    start = int(np.asarray(getattr(model, table))[index])
    name = model.names[start : model.names.index(b"\0", start)].decode()
    if table == _TABLES["body"]:
        return automatic.body(names(model, "body"), np.asarray(model.body_parentid).tolist(), index)
    return repr(name) if name else ""
