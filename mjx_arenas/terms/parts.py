"""What varies in a spec: its tables, its objects, and the elements of `arena.vary`, beside their numbers (host)."""

import dataclasses
import inspect
from typing import cast

import mujoco
import numpy as np

from mjx_arenas.furniture import standing
from mjx_arenas.furniture.part import Part
from mjx_arenas.geometry import Array, array_module
from mjx_arenas.params.params import QUANTITIES, ArenaParams, Quantity, Selected
from mjx_arenas.problem import Problem, problem
from mjx_arenas.sample import tops, variants
from mjx_arenas.sample.placement import Places
from mjx_arenas.sample.sampling import Drawn, Nominal, tags
from mjx_arenas.spec import specs
from mjx_arenas.spec.follow import Follower
from mjx_arenas.spec.objects import Measures, Object
from mjx_arenas.terms.elements import Elements
from mjx_arenas.terms.following import Following
from mjx_arenas.terms.furniture import Furniture
from mjx_arenas.terms.objects import VARIANT, Objects
from mjx_arenas.terms.presence import Presence
from mjx_arenas.terms.tables import Mount, TableNames, Tables
from mjx_arenas.terms.term import Numbered, Term, TermQuantity

__all__ = ["Mount", "Parts", "TableNames"]


@dataclasses.dataclass(frozen=True)
class Parts:
    """What varies in a spec, beside the numbers."""

    tables: tuple[TableNames, ...]
    mounts: tuple[Mount, ...]
    objects: tuple[Object, ...]
    measures: tuple[Measures, ...]
    places: Places
    varied: tuple[Elements, ...] = ()
    """What `arena.vary` made."""
    furniture: tuple[Furniture, ...] = ()
    """What `arena.add_part` made."""
    follows: tuple[Follower, ...] = ()
    """Geoms of a scene that follow its tables."""
    priority: int = 1
    """`priority` of what tables and furniture collide with."""

    @property
    def more(self) -> tuple[TermQuantity, ...]:
        """All quantities beside those of tables and objects, which the terms say."""
        # `isinstance` would take a term whose `numbers` raises an AttributeError for one without, on Python 3.11.
        numbered = (term for term in self.terms if inspect.getattr_static(term, "numbers", None) is not None)
        return tuple(one for term in numbered for one in cast(Numbered, term).numbers)

    @property
    def chosen(self) -> list[TermQuantity]:
        """The quantities that say which variants of objects are there."""
        return [one for one in self.more if one.attribute == VARIANT]

    @property
    def carriers(self) -> list[str]:
        """Names of the bodies on which robots stand."""
        return [t.body for t in self.tables] + [part.name for part in self.furniture]

    @property
    def slots(self) -> list[tuple[str, ...]]:
        """(S,) names of the geoms of each variant of each object."""
        return [names for one in self.places.variants for names in one.geoms]

    @property
    def geoms_of_variants(self) -> dict[str, tuple[str, ...]]:
        """Names of the geoms of objects with variants, by the objects' names."""
        return {self.objects[one.object].name: one.all_geoms for one in self.places.variants}

    @property
    def terms(self) -> tuple[Term, ...]:
        """What decides elements of the model: a new family of them is one more here."""
        own = Tables(self.tables, self.mounts), Objects(self.objects, self.measures, self.places)
        return *own, Following(self.follows), *self.furniture, *self.varied

    @property
    def quantities(self) -> dict[str, Quantity]:
        """Every quantity of the arena, in the order of its parameters."""
        return QUANTITIES | {one.name: one.selected.quantity for one in self.more}

    @property
    def selected(self) -> dict[str, Selected]:
        """What there is to know of the quantities beside those of tables and objects."""
        return {one.name: one.selected for one in self.more}

    def completed(self, nominal: ArenaParams) -> ArenaParams:
        """The nominal parameters with those that they lack of the quantities beside those of tables and objects."""
        lacking = {one.name: one.nominal for one in self.more if one.name not in nominal.terms}
        return nominal._replace(terms={**nominal.terms, **lacking})

    @property
    def coming(self) -> tuple[TermQuantity, ...]:
        """The quantities by which bodies come and go that are neither tables nor objects."""
        return tuple(one for one in self.more if one.attribute == "body.active")

    @property
    def presence(self) -> Presence:
        """What decides which of all that is there: of tables, objects, others that come and go, and variants of objects."""
        n_tables, n_objects = len(self.tables), len(self.objects)
        others = [name for term in self.coming for name in term.elements]
        return Presence(
            (*(t.body for t in self.tables), *(o.name for o in self.objects), *others),
            (*[False] * n_tables, *[True] * n_objects, *[False] * len(others)),
            (*[False] * n_tables, *[True] * n_objects, *[True] * len(others)),
            tuple(self.slots),
            ("table_active", "object_active", *(one.name for one in (*self.chosen, *self.coming))),
            self.wanted,
        )

    @property
    def surfaces(self) -> list[str]:
        """(S,) names of the tables' bodies and of the surfaces of furniture, as `object_tables` counts them."""
        return tops.names([t.body for t in self.tables], self.places.ground)

    def part_of(self, on: str) -> Part:
        """The part of a name, or that has the surface of a name."""
        furniture = self.places.furniture
        own = (part for part in furniture if part.name == on)
        return next(own, None) or furniture[standing.carrier(on, furniture)[0]]

    @property
    def robots(self) -> list[str]:
        """Names of the bodies on which robots are mounted."""
        return [m.body for m in (*self.mounts, *(m for term in self.furniture for m in term.mounts))]

    def types(self, params: ArenaParams) -> list[str]:
        """(K,) types of the objects in one world, with the names of the variants that are there (host)."""
        found = [o.kind for o in self.objects]
        for one in self.places.variants:
            v = int(variants.which(one, params.terms))
            found[one.object] = f"{one.kind[v]} ({one.names[v]})"
        return found

    def wanted(self, params: ArenaParams) -> Array:
        """(T + K + E + S,) bool: the bodies, and the variants of objects, that are to be there; NumPy or JAX."""
        furniture = self.places.furniture
        frames = zip(self.furniture, standing.frames(furniture, params), strict=True)
        carried = {one.name: frame.carried for term, frame in frames for one in term.numbers}
        more = (params.terms[term.name] & carried.get(term.name, True) for term in self.coming)
        there = *tops.present(params, self.places.ground), *more, *variants.there(self.places.variants, params.terms)
        return array_module(*there).concatenate(there)

    def drawing(self, nominal: ArenaParams) -> Nominal:
        """What draws start from."""
        densities = np.array([m.density for m in self.measures], float)
        terms = tuple(Drawn(t.name, t.attribute, tags(t.elements), t.selected.mask) for t in self.more)
        names = tuple(o.name for o in self.objects)
        places = self.places
        return Nominal(
            nominal,
            names,
            places.kind,
            densities,
            terms,
            places.furniture,
            places.variants,
            places.poses,
            places.carriers,
        )

    def problems(self, spec: mujoco.MjSpec) -> list[Problem]:
        """Tables, objects and elements that a spec has not all any more, deleted or renamed, and tables that can move."""
        parts = [[("body", t.body), ("site", t.top), *(("geom", name) for name in t.geoms)] for t in self.tables]
        parts += [*([("body", name)] for name in self.robots), *([("geom", f.geom)] for f in self.follows)]
        for obj in self.objects:
            own = [] if obj.kind == "mjcf" else self.geoms_of_variants.get(obj.name, [obj.geom])
            parts.append([("body", obj.name), ("joint", obj.joint), *(("geom", name) for name in own)])
        lost = [[f"{kind} {name!r}" for kind, name in one if getattr(spec, kind)(name) is None] for one in parts]
        found = [problem("arena.spec", "lost", names=names[:1]) for names in lost if names]
        for term in self.furniture:
            lost = [f"body {term.name!r}"] if spec.body(term.name) is None else []
            lost += [f"geom {name!r}" for name in term.geoms if spec.geom(name) is None]
            lost += [f"joint {name!r}" for name in term.joints if spec.joint(name) is None]
            found += [problem("arena.spec", "lost", names=lost[:1])] if lost else []
        varied = [(t, name) for t in self.varied if t.kind != "option" for name in t.elements]
        for t, name in [(t, name) for t, name in varied if getattr(spec, t.kind)(name) is None][:1]:
            found.append(problem("arena.spec", "lost_varied", names=[f"{t.kind} {name!r}"], name=t.name))
        bodies = [body for t in self.tables if (body := spec.body(t.body)) is not None]
        moving = [body.name for body in bodies if any(len(b.joints) or b.mocap for b in specs.ancestors(body))]
        return found + [problem("arena.spec", "table_moves", ("entry", name), name=name) for name in moving]

    def contacts(self, spec: mujoco.MjSpec) -> tuple[int, str, list[str]]:
        """The smallest `condim` of the slabs, what decides about friction on all that carries, and the tables' names if all were adopted.

        Objects of a higher priority than usual are meant to decide about that elsewhere, and do not count.
        """
        slabs = [spec.geom(t.collision) for t in self.tables]
        priority = max((g.priority for o in self.objects for g in spec.body(o.name).find_all("geom")), default=0)
        adopted = [t.body for t in self.tables] if all(t.adopted for t in self.tables) else []
        below = {"tables": slabs, "furniture": [spec.geom(name) for term in self.furniture for name in term.geoms]}
        over = priority <= 0 and all(geom.priority > priority for geoms in below.values() for geom in geoms)
        decide = " and ".join(name for name, geoms in below.items() if over and geoms)
        return min((slab.condim for slab in slabs), default=3), decide, adopted

    def carrying(self, spec: mujoco.MjSpec) -> dict[int, str]:
        """The tables that cannot be absent for what moves on them, a robot or a body with joints, with the reason."""
        joints = [spec.body(t.body).find_all("joint") for t in self.tables]
        moving = {t: found[0].parent.name or found[0].name or "a joint" for t, found in enumerate(joints) if found}
        moving |= {m.table: m.body for m in self.mounts}
        moving |= {part.on: part.name for part in self.places.furniture if part.stays and isinstance(part.on, int)}
        return {t: f"{name!r} is fixed on it" for t, name in moving.items()}
