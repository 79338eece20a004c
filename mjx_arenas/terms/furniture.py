"""Furniture: the boxes of a part, which follow from its numbers, and where it stands."""

import dataclasses
import functools
from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

from mjx_arenas import geometry
from mjx_arenas.furniture import surfaces
from mjx_arenas.furniture.part import Joint, Parameter, Part, named, stacked
from mjx_arenas.furniture.standing import Frame, carrier, frames, names, numbers_of, surface_names
from mjx_arenas.geometry import Array, array_module
from mjx_arenas.params.params import ArenaParams, Quantity
from mjx_arenas.spec import specs
from mjx_arenas.terms.attributes import ATTRIBUTES
from mjx_arenas.terms.tables import WZ
from mjx_arenas.terms.term import Depends, Row, TermQuantity, numbers, places, row

_OF_JOINTS = (
    ("axis", "jnt_axis"),
    ("pos", "jnt_pos"),
    ("range", "jnt_range"),
    ("damping", "dof_damping"),
    ("frictionloss", "dof_frictionloss"),
)
_WY = np.array([0, 2])  # of a quaternion: boxes tilt about y alone


@dataclasses.dataclass(frozen=True)
class Mounted:
    """A robot's base on a part."""

    body: str
    surface: str | None
    """The surface on which it stands; None: it stands in the part's frame."""
    pos: tuple[float, float, float]
    """Its place there [m]."""
    under: bool = False
    """It hangs at the underside of the box whose upper side the surface is."""

    def local(self, part: Part, own: Mapping[str, Array]) -> list[Array]:
        """(3,) where it is in the part's frame."""
        if self.surface is None:
            return list(self.pos)
        (origin,) = (one.pos for one in part.surfaces(own) if one.name == self.surface)
        if self.under:
            (box,) = named(part.boxes(own), self.surface)
            origin = (origin[0], origin[1], box.pos[2] - box.half[2])
        return [x + along for x, along in zip(origin, self.pos, strict=True)]


@dataclasses.dataclass(frozen=True)
class Furniture:
    """A part, whose names begin with its own."""

    part: Part
    others: tuple[Part, ...] = ()
    """The parts on which it stands, or which it abuts, directly or not."""
    mounts: tuple[Mounted, ...] = ()
    """What stands on it without being an object."""

    @property
    def name(self) -> str:
        """The part's name."""
        return self.part.name

    @property
    def quantities(self) -> tuple[str, ...]:
        """Names of all that varies."""
        return tuple(one.name for one in self.numbers)

    @functools.cached_property
    def numbers(self) -> tuple[TermQuantity, ...]:
        """All that varies, what is there at last."""
        kind = type(self.part).__name__.lower()
        found = [self._quantity(f"{kind}.{name}", name, one) for name, one in self.part.parameters.items()]
        there = Quantity("body", (), bool)
        if not self.part.stays:
            name, active = f"{self.name}.active", np.array([self.part.active])
            found.append(TermQuantity.of(name, "body.active", [self.name], there, active, self.name))
        pieces = tuple(f"{self.name}_{piece}" for piece in self.part.coming)
        if pieces:
            name, every = f"{self.name}.pieces_active", np.ones(len(pieces), bool)
            found.append(TermQuantity.of(name, "body.active", pieces, there, every, self.name))
        for one in found:
            one.nominal.setflags(write=False)
        return tuple(found)

    def _quantity(self, attribute: str, name: str, one: Parameter) -> TermQuantity:
        elements = tuple(f"{self.name} {item}".rstrip() for item in one.items)
        if one.starts:
            attribute, elements = "joint.qpos", self.joints
        return TermQuantity.of(f"{self.name}.{name}", attribute, elements, one.quantity, one.nominal, self.name)

    @functools.cached_property
    def geoms(self) -> tuple[str, ...]:
        """(n,) names."""
        return tuple(names([self.part]))

    @property
    def joints(self) -> tuple[str, ...]:
        """Names, in the order of the pieces that move."""
        return tuple(f"{self.name}_{piece}" for piece in self.part.moving)

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names: the part's own, and those of its pieces that come and go, or move."""
        return (self.name, *(f"{self.name}_{piece}" for piece in dict.fromkeys((*self.part.pieces, *self.part.moving))))

    @property
    def moving_geoms(self) -> tuple[str, ...]:
        """Names of the geoms of the pieces that move."""
        boxes = self.part.nominal_boxes
        return tuple(name for name, box in zip(self.geoms, boxes, strict=True) if box.piece in self.part.moving)

    def edit(self, spec: mujoco.MjSpec, params: ArenaParams) -> None:
        """Gives the part in a spec the numbers of one world."""
        own, frame = numbers_of(self.part, params), self.frame(params)
        specs.assign(spec.body(self.name), pos=frame.pos, quat=geometry.yaw_quat(frame.rot))
        for name, box in zip(self.geoms, self.part.boxes(own), strict=True):
            geom = spec.geom(name)
            specs.assign(geom, pos=box.pos, size=box.half, friction=own["friction"], rgba=own["rgba"])
            if not box.is_upright:
                geom.quat = _tilted(np.float64(box.tilt))
        for mount in self.mounts:
            specs.assign(spec.body(mount.body), pos=mount.local(self.part, own))
        for name, joint in zip(self.joints, self.part.joints(own), strict=True):
            _edit_joint(spec, spec.joint(name), joint)

    def carrying(self, body: str, on: str, pos: Sequence[float], under: bool = False) -> "Furniture":
        """The same with a robot's base on it, or on its surface of this name, or under that."""
        surface = None if on == self.name and on not in surface_names([self.part]) else carrier(on, [self.part])[1]
        x, y, z = map(float, pos)
        return dataclasses.replace(self, mounts=(*self.mounts, Mounted(body, surface, (x, y, z), under)))

    def frame(self, params: ArenaParams) -> Frame:
        """The frame of the part in one world."""
        return frames((*self.others, self.part), params)[-1]

    def bind(self, model: mujoco.MjModel) -> "BoundFurniture":
        """The part's ids."""
        geoms = np.array([model.geom(name).id for name in self.geoms], int)
        boxes = self.part.nominal_boxes
        tilted = np.array([i for i, box in enumerate(boxes) if not box.is_upright], int)
        joints = np.array([model.joint(name).id for name in self.joints], int)
        fields = ("body_pos", "body_quat", "geom_pos", "geom_rgba", *(field for _, field in _OF_JOINTS))
        shapes = {name: getattr(model, name).shape for name in fields}
        return BoundFurniture(
            self,
            model.body(self.name).id,
            geoms,
            tilted,
            joints,
            model.jnt_dofadr[joints],
            model.jnt_qposadr[joints],
            np.array([model.body(m.body).id for m in self.mounts], int),
            shapes,
        )


@dataclasses.dataclass(frozen=True)
class BoundFurniture:
    """A part of a compiled model."""

    term: Furniture
    body: int
    geom: np.ndarray  # (n,)
    tilted: np.ndarray  # indices of boxes that are not upright
    joint: np.ndarray  # (m,)
    dof: np.ndarray  # (m,)
    qpos: np.ndarray  # (m,)
    mount: np.ndarray  # bodies
    shapes: Mapping[str, tuple[int, ...]]

    @property
    def name(self) -> str:
        """The part's name."""
        return self.term.name

    def rows(self, params: ArenaParams) -> list[Row]:
        """The part's pose, its boxes, their friction and colour."""
        own, frame = numbers_of(self.term.part, params), self.term.frame(params)
        body, every = np.array([self.body]), self.shapes
        below = surfaces.below(self.term.part, self.term.others)
        pos, rot = (self._follows(name) | below for name in ("pos", "rot"))
        found = [
            row("body_pos", places(every["body_pos"], body)[0], frame.pos, pos),
            row("body_quat", places(every["body_quat"], body, WZ)[0], self._turn(frame.rot), rot),
        ]
        if len(self.mount):
            spots = stacked([m.local(self.term.part, own) for m in self.term.mounts], frame.pos)
            found.append(row("body_pos", places(every["body_pos"], self.mount), spots, self._sizes))
        found += self._boxes(own) if len(self.geom) else []
        return [*found, *(self._joints(own) if len(self.joint) else [])]

    def _boxes(self, own: Mapping[str, Array]) -> list[Row]:
        boxes, n, every = self.term.part.boxes(own), len(self.geom), self.shapes
        wide, colour = places(every["geom_pos"], self.geom), places(every["geom_rgba"], self.geom)
        friction, rgba = (np.tile(numbers(own[name]), (n, 1)) for name in ("friction", "rgba"))
        found = [
            row("geom_pos", wide, stacked([box.pos for box in boxes], own["pos"]), self._sizes),
            row("geom_size", wide, stacked([box.half for box in boxes], own["pos"]), self._sizes),
            row("geom_friction", wide, own["friction"], self._follows("friction"), friction),
            row("geom_rgba", colour, own["rgba"], self._follows("rgba"), rgba),
        ]
        if len(self.tilted):
            xp = array_module(own["pos"])
            quats = xp.stack([_tilted(xp.asarray(boxes[i].tilt, own["pos"].dtype)) for i in self.tilted])
            at = places((every["geom_pos"][0], 4), self.geom[self.tilted], _WY)
            found.append(row("geom_quat", at, quats[:, ::2], self._sizes))
        return found

    def _joints(self, own: Mapping[str, Array]) -> list[Row]:
        joints, found = self.term.part.joints(own), []
        for attribute, field in _OF_JOINTS:
            ids = self.dof if field.startswith("dof_") else self.joint
            given = [getattr(joint, attribute) for joint in joints]
            wide = isinstance(given[0], Sequence)
            values = stacked(given if wide else [[x] for x in given], own["pos"])
            at = places(self.shapes[field], ids)
            found.append(row(field, at, values if wide else values[:, 0], self._sizes))
        (name,) = (name for name, one in self.term.part.parameters.items() if one.starts)
        start = own[name] if own[name].ndim else own[name][None]
        return [*found, row("data.qpos", self.qpos, start, self._follows(name))]

    def _turn(self, yaw: Any) -> Array:
        return geometry.yaw_quat(yaw)[::3]

    def _follows(self, *names: str) -> Depends:
        return frozenset(f"{self.term.name}.{name}" for name in names)

    @property
    def _sizes(self) -> Depends:
        return self._follows(*(name for name, one in self.term.part.own.items() if not one.starts))


def _edit_joint(spec: mujoco.MjSpec, element: mujoco.MjsJoint, joint: Joint) -> None:
    specs.assign(element, pos=joint.pos, axis=joint.axis)
    in_degrees = joint.turns and element.compiler.degree
    element.range = np.rad2deg(joint.range) if in_degrees else joint.range
    for name in ("damping", "frictionloss"):
        ATTRIBUTES[f"joint.{name}"].edit(element, np.asarray(getattr(joint, name)), spec, 0)  # type: ignore[arg-type]


def _tilted(angle: Array) -> Array:
    """(4,) of a rotation about y."""
    xp = array_module(angle)
    zero = xp.zeros_like(angle)
    return xp.stack([xp.cos(angle / 2), zero, xp.sin(angle / 2), zero])
