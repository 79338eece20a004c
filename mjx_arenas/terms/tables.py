"""Tables: where slabs, legs and tops stand, how large and how rough they are, and what robots' mounts do with them.

T tables, M mounts; robosuite's element names.
"""

import dataclasses
from typing import NamedTuple

import mujoco
import numpy as np

from mjx_arenas import geometry
from mjx_arenas.geometry import Array
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.quaternions import quat_mul, quat_rotate
from mjx_arenas.spec import specs
from mjx_arenas.terms.term import Boxes, Row, numbers, places, row

_SIZE = frozenset({"table_full_sizes"})
_POSE = frozenset({"table_offsets", "table_full_sizes"})
_LEGS = frozenset({"table_offsets", "table_full_sizes", "has_legs"})  # the height makes the legs long
_YAW = frozenset({"table_rots"})
_FRICTION = frozenset({"table_frictions"})
_SHOWN = frozenset({"has_legs"})
WZ = np.array([0, 3])  # of a quaternion: all turn about z alone


class Frame(NamedTuple):
    """The frame of the fixed body that a table's body hangs on."""

    pos: tuple[float, float, float] = (0.0, 0.0, 0.0)  # in the world [m]
    quat: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)

    def moved(self, shift: np.ndarray, turn: float) -> "Frame":
        """The same in a world that was turned by a yaw [rad], and moved."""
        yaw, pos, quat = (geometry.yaw_quat(np.float64(turn)), *map(np.asarray, self))
        pos, quat = quat_rotate(yaw, pos) + shift, quat_mul(yaw, quat)  # type: ignore[arg-type]
        return Frame(tuple(pos.tolist()), tuple(quat.tolist()))


WORLD = Frame()


@dataclasses.dataclass(frozen=True)
class TableNames:
    """Names of a table's elements (robosuite's)."""

    body: str
    collision: str
    visual: str
    top: str
    legs: tuple[str, str, str, str]
    adopted: bool = False
    """Whether the body stands in a scene, with what carries it."""
    frame: Frame = WORLD

    @classmethod
    def of(cls, body: str, first_leg: int, collision: str | None = None) -> "TableNames":
        """Names after the table's body; robosuite counts a single table's legs from 1, those of several from 0."""
        legs = tuple(f"{body}_leg{first_leg + k}_visual" for k in range(4))
        return cls(body, collision or f"{body}_collision", f"{body}_visual", f"{body}_top", legs)  # type: ignore[arg-type]

    @property
    def geoms(self) -> tuple[str, ...]:
        """Names of the geoms, in the order of `geometry.Table`."""
        return (self.collision, self.visual, *self.legs)

    def prefixed(self, prefix: str) -> "TableNames":
        """The same with a prefix."""
        legs = tuple(prefix + leg for leg in self.legs)
        names = (prefix + name for name in (self.body, self.collision, self.visual, self.top))
        return TableNames(*names, legs, self.adopted, self.frame)  # type: ignore[arg-type]


@dataclasses.dataclass(frozen=True)
class Mount:
    """What stands on a table without being an object: a robot's base."""

    body: str
    table: int
    height: float  # of its origin above the top, or the underside [m]
    under: bool = False  # at the slab's underside

    def z(self, half: Array) -> Array:
        """The height of its origin in the frame of the slab's middle; half of the slab is `half` thick [m]."""
        return half * (-1.0 if self.under else 1.0) + self.height


@dataclasses.dataclass(frozen=True)
class Tables:
    """The tables of an arena, with their legs and the mounts on them."""

    names: tuple[TableNames, ...]
    mounts: tuple[Mount, ...] = ()
    name = "tables"
    quantities = ("table_offsets", "table_rots", "table_full_sizes", "table_frictions", "has_legs")

    def edit(self, spec: mujoco.MjSpec, params: ArenaParams) -> None:
        """Gives the tables of a spec the numbers of one world."""
        table = _geometry(params)
        body_pos, body_quat = _body_poses(self.names, params, table)
        for t, names in enumerate(self.names):
            specs.assign(spec.body(names.body), pos=body_pos[t], quat=body_quat[t])
            spec.geom(names.collision).friction = params.table_frictions[t]
            spec.site(names.top).pos = table.top_pos[t]
            for name in names.geoms[geometry.SLABS]:
                spec.geom(name).size = table.half[t]
            for sign, name in zip(geometry.LEG_SIGNS, names.legs, strict=True):
                pos = table.leg_pos[t] * (*sign, 1)
                specs.assign(spec.geom(name), size=(*table.leg_size[t], 0), pos=pos, rgba=table.leg_rgba[t])
        for mount in self.mounts:
            body = spec.body(mount.body)
            body.pos = (*body.pos[:2], mount.z(table.top_pos[mount.table, 2]))

    def bind(self, model: mujoco.MjModel) -> "BoundTables":
        """The tables' ids."""
        return BoundTables(
            body=np.array([model.body(t.body).id for t in self.names], int),
            geom=np.array([[model.geom(name).id for name in t.geoms] for t in self.names], int).reshape(
                -1, geometry.PARTS
            ),
            top=np.array([model.site(t.top).id for t in self.names], int),
            mount_body=np.array([model.body(m.body).id for m in self.mounts], int),
            mount_table=np.array([m.table for m in self.mounts], int),
            mounts=self.mounts,
            names=self.names,
            shapes={"body": (model.nbody, 3), "quat": (model.nbody, 4), "geom": (model.ngeom, 3)}
            | {"rgba": (model.ngeom, 4), "site": (model.nsite, 3)},
        )


@dataclasses.dataclass(frozen=True)
class BoundTables:
    """The tables of a compiled model."""

    body: np.ndarray  # (T,)
    geom: np.ndarray  # (T, PARTS) collision, visual, four legs
    top: np.ndarray  # (T,) sites
    mount_body: np.ndarray  # (M,)
    mount_table: np.ndarray  # (M,)
    mounts: tuple[Mount, ...]
    names: tuple[TableNames, ...]
    shapes: dict[str, tuple[int, int]]

    def rows(self, params: ArenaParams) -> list[Row]:
        """Poses, sizes, friction and colours of the tables' elements."""
        if not len(self.body):
            return []
        xp, table = geometry.array_module(params.table_rots), _geometry(params)
        slab, legs = self.geom[:, geometry.SLABS], self.geom[:, geometry.LEGS]
        # Fields that take from two arrays are slower by a half on a GPU: sizes of slabs and legs share one, and so do the
        # legs' coordinates and their negatives. Sums of padded arrays need no kernels of their own, as concatenations do.
        size = xp.pad(table.half, ((0, 0), (0, 2))) + xp.pad(table.leg_size, ((0, 0), (3, 0)))  # (T, 5)
        leg = xp.pad(table.leg_pos, ((0, 0), (0, 2))) - xp.pad(table.leg_pos[:, :2], ((0, 0), (3, 0)))
        sizes, corner = numbers(size), numbers(leg)
        half, leg_size = sizes[:, :3], sizes[:, 3:]
        at = [
            np.stack([corner[:, 0 if x > 0 else 3], corner[:, 1 if y > 0 else 4], corner[:, 2]], -1)
            for x, y in geometry.LEG_SIGNS
        ]
        body_pos, body_quat = _body_poses(self.names, params, table)
        axes = WZ if body_quat is table.body_quat else np.arange(4)
        found = [
            row("body_pos", places(self.shapes["body"], self.body), body_pos, _POSE),
            row("body_quat", places(self.shapes["quat"], self.body, axes), body_quat[:, axes], _YAW),
            row("geom_size", places(self.shapes["geom"], slab), size, _SIZE, half[:, None]),
            row("geom_size", places(self.shapes["geom"], legs)[..., :2], size, _LEGS, leg_size[:, None]),
            row("geom_pos", places(self.shapes["geom"], legs), leg, _LEGS, np.stack(at, axis=1)),
            row("site_pos", places(self.shapes["site"], self.top)[:, 2], size, _SIZE, half[:, 2]),
            row("geom_friction", places(self.shapes["geom"], slab[:, 0]), params.table_frictions, _FRICTION),
            row(
                "geom_rgba", places(self.shapes["rgba"], legs), table.leg_rgba, _SHOWN, numbers(table.leg_rgba)[:, None]
            ),
        ]
        if len(self.mount_body):
            half = table.top_pos[:, 2][self.mount_table]
            height = xp.asarray(np.array([m.height for m in self.mounts]), half.dtype)
            z = half * xp.asarray(np.array([-1 if m.under else 1 for m in self.mounts]), half.dtype) + height
            found.append(row("body_pos", places(self.shapes["body"], self.mount_body)[:, 2], z, _SIZE))
        return found

    def boxes(self, params: ArenaParams) -> Boxes:
        """How far the tables reach."""
        table = _geometry(params)
        low, high = geometry.table_box(table)
        return Boxes(self.body, self.top, self.geom.reshape(-1), low, high, geometry.table_reach(table))


def _body_poses(names: tuple[TableNames, ...], params: ArenaParams, table: geometry.Table) -> tuple[Array, Array]:
    """Positions (T, 3) and orientations (T, 4) of the tables' bodies, each in the frame of what it hangs on."""
    if all(one.frame == WORLD for one in names):
        return table.body_pos, table.body_quat
    xp, dtype = geometry.array_module(params.table_rots), table.half.dtype
    pos, quat = (np.array([getattr(one.frame, field) for one in names]) for field in Frame._fields)
    # A table near what carries it may be far from the world's origin.
    from_there = geometry.less(params.table_offsets, pos) - table.half * xp.asarray((0, 0, 1), dtype)
    back = xp.asarray(quat * np.array([1, -1, -1, -1]), dtype)
    return quat_rotate(back, from_there), quat_mul(back, table.body_quat)


def _geometry(params: ArenaParams) -> geometry.Table:
    return geometry.table(params.table_offsets, params.table_rots, params.table_full_sizes, params.has_legs)
