"""What geoms weigh, each alone: of bodies whose inertials the compiler makes of their geoms (host)."""

from collections.abc import Sequence

import mujoco
import numpy as np

from mjx_arenas import solids
from mjx_arenas.primitives import PRIMITIVES
from mjx_arenas.solids import Solids
from mjx_arenas.spec import masses, specs

_ALONE = "mjx_arenas_alone"
_SHAPE = ("type", "size", "mass", "density", "typeinertia", "meshname", "hfieldname", "group")


def of(spec: mujoco.MjSpec, names: Sequence[str]) -> Solids:
    """The geoms of all bodies that have one of the geoms of these names, and no inertial of their own."""
    if not names:
        return solids.NONE
    own, probe = spec.copy(), spec.copy()
    plain = mujoco.MjSpec().compiler
    specs.assign(probe.compiler, inertiagrouprange=plain.inertiagrouprange, inertiafromgeom=plain.inertiafromgeom)
    model = specs.compiled(own, "arena.spec")
    bodies = set(model.geom_bodyid[[model.geom(name).id for name in names]].tolist()) - {0}
    weighing = [body for body in own.bodies if body.id in bodies and masses.inferred(body)]
    geoms = [geom for body in weighing for geom in body.geoms if masses.weighs(geom)]
    if not geoms:
        return solids.NONE
    for geom in geoms:
        alone = probe.worldbody.add_body(name=_ALONE + str(geom.id)).add_geom(contype=0, conaffinity=0)
        for attribute in _SHAPE:
            setattr(alone, attribute, getattr(geom, attribute))
        alone.size = model.geom_size[geom.id] if geom.type in PRIMITIVES else geom.size
    weighed = specs.compiled(probe, "arena.spec")
    rows = {geom.id: weighed.body(_ALONE + str(geom.id)).id for geom in geoms}
    heavy = {geom.parent.id for geom in geoms if weighed.body_mass[rows[geom.id]] > 0}
    geoms = [geom for geom in geoms if geom.parent.id in heavy]
    ids, rows = np.array([g.id for g in geoms], int), [rows[g.id] for g in geoms]
    full = mujoco.mjtGeomInertia.mjINERTIA_VOLUME
    solid = np.array([g.type in PRIMITIVES and g.typeinertia == full for g in geoms], bool)
    dense = solid & np.array([np.isnan(g.mass) for g in geoms], bool)
    mass, inertia = weighed.body_mass[rows], weighed.body_inertia[rows]
    return Solids(ids, model.geom_bodyid[ids], mass, inertia, dense, solid)
