"""The compiled arena as one frozen record, equal to every other of the same content: what batches and compiled functions hold (host)."""

import copy
import dataclasses
import functools
from typing import NoReturn

import mujoco
import numpy as np

from mjx_arenas.content import ByContent
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.problem import Problem, numbered, problem
from mjx_arenas.record import refusals
from mjx_arenas.record.layout import Layout
from mjx_arenas.record.limits import limits
from mjx_arenas.record.room import Room, at_once, room_for
from mjx_arenas.record.sliding import sliding
from mjx_arenas.rules import furniture_rules, validation, validation_worlds
from mjx_arenas.sample.sampling import Nominal
from mjx_arenas.spec import specs
from mjx_arenas.terms.parts import Parts
from mjx_arenas.write.scene import Given, Scene


@dataclasses.dataclass(frozen=True, eq=False)
class Record(ByContent):
    """A compiled arena. Two are equal, and share what is compiled for them, if all that was compiled is."""

    mj_model: mujoco.MjModel
    """The nominal arena, with all tables and objects: the record's own copy."""
    spec: mujoco.MjSpec
    """The arena's MJCF: the record's own copy."""
    parts: Parts
    nominal: ArenaParams
    given: Given
    """Names of the fields that the MJCF gives, and that follow from nothing."""

    @classmethod
    def of(
        cls, model: mujoco.MjModel, spec: mujoco.MjSpec, parts: Parts, nominal: ArenaParams, given: Given
    ) -> "Record":
        """The record of a model that was compiled from a spec; both are copied."""
        return cls(copy.copy(model), spec.copy(), parts, nominal, given)

    def with_options(self, option: mujoco.MjOption) -> "Record":
        """The same arena with other options."""
        model, spec = copy.copy(self.mj_model), self.spec.copy()
        for target in (model.opt, spec.option):
            specs.set_options(target, option)
        return dataclasses.replace(self, mj_model=model, spec=spec)

    def __copy__(self) -> "Record":
        return self  # frozen

    def __deepcopy__(self, memo: object) -> "Record":
        return self

    def __reduce__(self) -> NoReturn:
        raise validation.error([problem("arena", "record_pickled")], kind=TypeError)

    @functools.cached_property
    def layout(self) -> Layout:
        """Ids of the tables' and objects' elements."""
        return Layout.of(self.mj_model, self.parts, self.nominal)

    @functools.cached_property
    def scene(self) -> Scene:
        """What the writer knows."""
        return Scene.of(self.mj_model, self.parts.terms, self.layout.presence, self.nominal, self.given)

    @property
    def varied(self) -> list[tuple[str, np.ndarray]]:
        """Fields in which worlds may differ, with the places, in the flattened field, of the numbers that terms decide."""
        return [(owned.field, owned.elements) for owned in self.scene.owned]

    @functools.cached_property
    def unseen_on_jax(self) -> list[Problem]:
        """What varies, and MJX on JAX would not see."""
        found = [problem for term in self.parts.varied for problem in term.unseen_on_jax(self.mj_model)]
        found += refusals.of_parts_on_jax(self.scene, frozenset(term.name for term in self.parts.varied))
        found += refusals.of_fields_on_jax(self.scene)
        return found + refusals.of_variants_on_jax(self.mj_model, self.parts)

    @functools.cached_property
    def everything(self) -> frozenset[str]:
        """Names of all quantities."""
        return frozenset(self.parts.quantities)

    @property
    def table_names(self) -> list[str]:
        """(T,) names of the tables' bodies."""
        return [t.body for t in self.parts.tables]

    @property
    def part_names(self) -> list[str]:
        """Names of the parts of furniture, and of their bodies."""
        return [term.name for term in self.parts.furniture]

    @property
    def object_names(self) -> tuple[str, ...]:
        """(K,) names."""
        return tuple(o.name for o in self.parts.objects)

    @functools.cached_property
    def drawing(self) -> Nominal:
        """What draws start from."""
        return self.parts.drawing(self.nominal)

    @functools.cached_property
    def labels(self) -> validation.Labels:
        """What messages call the tables and the objects."""
        return validation.labels(self.table_names, self.object_names, self.parts.selected, self.parts.surfaces)

    @functools.cached_property
    def rules(self) -> validation_worlds.Rules:
        """What decides whether a world can be."""
        held = {i: f"{name} ties it" for i, name in self.layout.held().items()} | self.parts.carrying(self.spec)
        n_tables, kinds, sizes = len(self.parts.tables), self.parts.places.kind, self.nominal.object_full_sizes
        overlapping = validation_worlds.overlapping(self.nominal)
        furniture = self.parts.places.furniture
        touching = furniture_rules.overlapping(self.nominal, furniture)
        rules = validation_worlds.Rules(n_tables, self.object_names, kinds, sizes, held, overlapping=overlapping)
        rules = rules._replace(terms=self.parts.selected, furniture=furniture, touching=touching)
        meeting = limits(self.mj_model, self.parts.varied, self.parts.furniture)
        rules = rules._replace(tables=numbered(self.table_names), limits=meeting)
        rules = rules._replace(sliding=sliding(self.spec, self.parts, self.nominal))
        places = self.parts.places
        rules = rules._replace(variants=places.variants, poses=places.poses, carriers=places.carriers)
        return validation_worlds.with_fixed(rules, self.layout.places.fixed, self.parts.follows, self.nominal)

    def timesteps(self, params: ArenaParams) -> np.ndarray:
        """() or (W,) [s] how long a step is in one world, or in each of many (host)."""
        for term in self.parts.varied:
            if term.attribute == "option.timestep":
                return np.asarray(params.terms[term.name], float)[..., 0]
        return np.full(np.shape(params.table_rots)[:-1], self.mj_model.opt.timestep)

    def room(self, max_contacts: int | None) -> Room:
        """Contacts of one world that data has room for on Warp; None: as many as can touch at once."""
        if max_contacts is None:
            return self._default_room
        room = validation.whole("max_contacts", max_contacts, 1, must="None or a whole number >= 1")
        return room_for(self.mj_model, room)

    @functools.cached_property
    def _default_room(self) -> Room:
        pieces = [self.mj_model.geom(name).id for term in self.parts.furniture for name in term.geoms]
        slabs, variants = self.layout.table_geom[:, 0], self.layout.presence.groups.geom
        return at_once(self.mj_model, slabs, np.array(pieces, int), variants)
