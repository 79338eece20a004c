"""What the tables and objects of a spec are, beside the numbers that vary (host)."""

import dataclasses

import mujoco
import numpy as np

from mjx_arenas.params.params import ArenaParams
from mjx_arenas.sample.placement import Places
from mjx_arenas.sample.sampling import Nominal
from mjx_arenas.spec.objects import Measures, Object
from mjx_arenas.terms.objects import Objects
from mjx_arenas.terms.tables import Mount, TableNames, Tables
from mjx_arenas.terms.term import Term

__all__ = ["Mount", "Parts", "TableNames"]


@dataclasses.dataclass(frozen=True)
class Parts:
    """What the tables and objects of a spec are, beside the numbers that vary."""

    tables: tuple[TableNames, ...]
    mounts: tuple[Mount, ...]
    objects: tuple[Object, ...]
    measures: tuple[Measures, ...]
    places: Places

    @property
    def terms(self) -> tuple[Term, ...]:
        """What decides elements of the model: a new family of them is one more here."""
        return Tables(self.tables, self.mounts), Objects(self.objects, self.measures, self.places)

    def drawing(self, nominal: ArenaParams) -> Nominal:
        """What draws start from."""
        densities = np.array([m.density for m in self.measures], float)
        return Nominal(nominal, tuple(o.name for o in self.objects), self.places.kind, densities)

    def contacts(self, spec: mujoco.MjSpec) -> tuple[int, bool, list[str]]:
        """The smallest `condim` of the slabs, whether tables decide about friction on them, and their names if all were adopted."""
        slabs = [spec.geom(t.collision) for t in self.tables]
        priority = max((g.priority for o in self.objects for g in spec.body(o.name).find_all("geom")), default=0)
        adopted = [t.body for t in self.tables] if all(t.adopted for t in self.tables) else []
        return min(slab.condim for slab in slabs), all(slab.priority > priority for slab in slabs), adopted

    def carrying(self, spec: mujoco.MjSpec) -> dict[int, str]:
        """The tables that cannot be absent for what moves on them, a robot or a body with joints, with the reason."""
        joints = [spec.body(t.body).find_all("joint") for t in self.tables]
        moving = {t: found[0].parent.name or found[0].name or "a joint" for t, found in enumerate(joints) if found}
        moving |= {m.table: m.body for m in self.mounts}
        return {t: f"{name!r} is fixed on it" for t, name in moving.items()}
