"""Which rows of the model's arrays belong to which table and object: every name and id, looked up once (host)."""

import dataclasses
from collections.abc import Sequence

import mujoco
import numpy as np

from mjx_arenas.objects import Object


@dataclasses.dataclass(frozen=True)
class TableNames:
    """Names of a table's elements (robosuite's)."""

    body: str
    collision: str
    visual: str
    top: str
    legs: tuple[str, str, str, str]

    @classmethod
    def of(cls, body: str, first_leg: int) -> "TableNames":
        """The names that go with a body's; robosuite numbers legs from 0 in one class and from 1 in the other."""
        legs = tuple(f"{body}_leg{first_leg + k}_visual" for k in range(4))
        return cls(body, f"{body}_collision", f"{body}_visual", f"{body}_top", legs)  # type: ignore[arg-type]


@dataclasses.dataclass(frozen=True)
class Layout:
    """T tables, K objects."""

    table_body: np.ndarray  # (T,)
    table_geom: np.ndarray  # (T, 6) collision, visual, four legs
    top: np.ndarray  # (T,) sites
    object_body: np.ndarray  # (K,)
    object_qpos: np.ndarray  # (K, 7) entries of qpos
    object_table: np.ndarray  # (K,) index of the table
    object_frac: np.ndarray  # (K, 2) nominal place, as a share of the table's half size ...
    object_pos: np.ndarray  # (K, 2) ... plus [m], in the frame of the table's top
    object_rot: np.ndarray  # (K,) nominal yaw relative to the table [rad]
    object_half_size: np.ndarray  # (K, 3) half extents [m]
    present: frozenset[str]  # fields that differ between worlds of this arena: not those that its MJCF pins
    cam_body: np.ndarray  # (ncam, 2) body, target body or -1
    light_body: np.ndarray  # (nlight, 2)

    @classmethod
    def of(
        cls,
        model: mujoco.MjModel,
        present: frozenset[str],
        tables: Sequence[TableNames],
        objects: Sequence[Object],
        object_tables: Sequence[int],
    ) -> "Layout":
        """Looks every element up by its name."""
        object_joint = [model.joint(f"{o.name}_joint0") for o in objects]
        first_qpos = np.array([j.qposadr[0] for j in object_joint], int).reshape(-1, 1)
        frac, pos = nominal_places(objects, object_tables)
        table_body = np.array([model.body(t.body).id for t in tables])
        object_body = np.array([model.body(o.name).id for o in objects], int)
        return cls(
            table_body=table_body,
            table_geom=np.array([[model.geom(name).id for name in (t.collision, t.visual, *t.legs)] for t in tables]),
            top=np.array([model.site(t.top).id for t in tables]),
            object_body=object_body,
            object_qpos=first_qpos + np.arange(7),
            object_table=np.array(object_tables, int),
            object_frac=frac,
            object_pos=pos,
            object_rot=np.array([o.rot for o in objects], float),
            object_half_size=np.array([o.half_size for o in objects], float).reshape(-1, 3),
            present=present,
            cam_body=np.stack([model.cam_bodyid, model.cam_targetbodyid], axis=-1),
            light_body=np.stack([model.light_bodyid, model.light_targetbodyid], axis=-1),
        )


def nominal_places(objects: Sequence[Object], tables: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
    """Where objects stand nominally, (K, 2) as a share of the half size and (K, 2) in [m].

    Those without a `pos` spread over the cells of a square grid on their table.
    """
    frac, pos = np.zeros((len(objects), 2)), np.zeros((len(objects), 2))
    for table in set(tables):
        spread = [k for k, t in enumerate(tables) if t == table and objects[k].pos is None]
        side = int(np.ceil(np.sqrt(len(spread))))
        for cell, k in enumerate(spread):
            frac[k] = (2 * np.array(divmod(cell, side)[::-1]) + 1) / side - 1
    for k, obj in enumerate(objects):
        if obj.pos is not None:
            pos[k] = obj.pos
    return frac, pos
