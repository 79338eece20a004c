"""The `mujoco.MjSpec` of an arena, made from its configuration (host)."""

import dataclasses
import os
from collections.abc import Callable, Mapping, Sequence
from importlib import resources
from typing import Any

import mujoco
import numpy as np

from mjx_arenas import shapes
from mjx_arenas.build import resting, slots
from mjx_arenas.furniture import surfaces
from mjx_arenas.params.params import ArenaParams, named
from mjx_arenas.problem import problem
from mjx_arenas.problems import messages
from mjx_arenas.problems.messages import error
from mjx_arenas.sample import placement, sampling
from mjx_arenas.sample.fixed import Near
from mjx_arenas.sample.placement import Places
from mjx_arenas.sample.tops import Carrier
from mjx_arenas.spec import masses, objects, specs
from mjx_arenas.spec.objects import Measures, Object
from mjx_arenas.spec.of_scene import SceneObject
from mjx_arenas.spec.place import Place
from mjx_arenas.terms.parts import Parts, TableNames

COLLISION_RGBA = (0.5, 0.5, 0.0, 0.0)  # robosuite's colour, but not drawn: the visual geom has the same faces


def load_spec(xml: str | os.PathLike | None) -> mujoco.MjSpec:
    """The base arena: the MJCF file (or MJCF text) of the user, or our own."""
    if xml is None:
        return mujoco.MjSpec.from_string(resources.files("mjx_arenas").joinpath("assets/arena.xml").read_text())
    return specs.read(xml, "xml")


def add_tables(spec: mujoco.MjSpec, tables: Sequence[TableNames], priority: int, condim: int) -> None:
    """Adds the elements of the tables; those that the base MJCF has are made anew, and keep their material.

    The MJCF's `<default>`s do not reach them: a table is the same in every base arena.
    """
    floor = spec.geom("floor")
    if floor is not None and floor.parent.name == "world":
        floor.pos = (0, 0, 0)
    for names in tables:
        body = spec.body(names.body) or spec.worldbody.add_body(name=names.body)
        if body.parent.name != "world" or body.frame is not None or list(body.joints) or body.mocap:
            raise error([problem("xml", "table_moves", ("entry", names.body), name=names.body)])
        own = _remove(spec, body, names.collision, spec.geom(names.collision))
        slab = specs.add_geom(body, names.collision, mujoco.mjtGeom.mjGEOM_BOX)
        specs.assign(slab, mass=0, condim=condim, priority=priority, rgba=COLLISION_RGBA, group=0)
        dress_table(spec, body, names, own)


def dress_table(spec: mujoco.MjSpec, body: mujoco.MjsBody, names: TableNames, material: str = "") -> None:
    """Adds what a table has beside the slab that collides: the slab that is drawn, four legs, the site on top."""
    materials = {m.name for m in spec.materials}
    body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    specs.make_massless(body)
    for name in (names.visual, *names.legs):
        is_leg = name in names.legs
        own = _remove(spec, body, name, spec.geom(name)) or ("" if is_leg else material)
        geom = specs.add_geom(body, name, mujoco.mjtGeom.mjGEOM_CYLINDER if is_leg else mujoco.mjtGeom.mjGEOM_BOX)
        specs.assign(geom, mass=0, group=1, contype=0, conaffinity=0)
        default = "table_legs_metal" if is_leg else "table_ceramic"
        geom.material = own or (default if default in materials else "")
    _remove(spec, body, names.top, spec.site(names.top))
    top = body.add_site(name=names.top)
    top.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    sphere = mujoco.mjtGeom.mjGEOM_SPHERE
    specs.assign(top, type=sphere, quat=(1, 0, 0, 0), group=0, size=(0.001,) * 3, rgba=(0, 0, 0, 0))


def _remove(spec: mujoco.MjSpec, body: mujoco.MjsBody, name: str, element: Any) -> str:
    """Deletes a table's element that the base MJCF has; gives the name of its material."""
    if element is None:
        return ""
    if element.parent.name != body.name:
        raise error([problem("xml", "table_part", ("entry", name), name=name, body=body.name)])
    material = element.material
    spec.delete(element)
    return material


def with_objects(
    spec: mujoco.MjSpec,
    tables: Sequence[TableNames],
    table_params: Mapping[str, np.ndarray | None],
    objs: Sequence[Object],
    object_tables: Sequence[int | str],
    priority: int,
) -> tuple[Parts, ArenaParams]:
    """Adds the objects to a spec that has its tables, of a `priority`; gives its parts and nominal parameters."""
    parts = Parts(tuple(tables), (), (), (), nominal_places((), (), ()), priority=priority)
    nominal = ArenaParams(**table_params, **_of_objects((), (), parts.places.kind, ()))  # type: ignore[arg-type]
    return add_objects(spec, parts, nominal, objs, object_tables)


def add_objects(
    spec: mujoco.MjSpec, parts: Parts, nominal: ArenaParams, objs: Sequence[Object], object_tables: Sequence[int | str]
) -> tuple[Parts, ArenaParams]:
    """Adds more objects to a spec, on tables, on surfaces or (by names) on objects; gives its parts and nominal parameters with them."""
    if objs:
        masses.weigh_groups(spec)
    first = len(parts.objects)
    added = [
        o.measures if isinstance(o, SceneObject) else objects.measure((o.slots or (o,))[0], k)
        for k, o in enumerate(objs, first)
    ]
    for k, obj in enumerate(objs, first):
        if not isinstance(obj, SceneObject):
            objects.add(spec, obj, k)
    variants = slots.variants(spec, objs, first)
    objs, measures = (*parts.objects, *objs), (*parts.measures, *added)
    own = parts.places
    carriers = dict.fromkeys(
        [*(one.name for one in own.carriers), *(on for on in object_tables if isinstance(on, str))]
    )
    index = {name: i for i, name in enumerate(carriers, len(parts.tables) + surfaces.count(own.furniture))}
    on = [*nominal.object_tables.tolist(), *(index[t] if isinstance(t, str) else t for t in object_tables)]
    places = nominal_places(objs, on, measures)._replace(furniture=own.furniture, follows=own.follows)
    places = places._replace(carriers=tuple(_carrier(places, objs, name) for name in carriers))
    poses = resting.poses(objs[first:], first)
    places = places._replace(variants=(*own.variants, *variants), poses=(*own.poses, *poses))
    parts = dataclasses.replace(parts, objects=objs, measures=measures, places=places)
    nominal = parts.completed(nominal._replace(**_of_objects(objs, measures, places.kind, on)))
    for array in named(nominal).values():
        array.setflags(write=False)
    return parts, nominal


def _carrier(places: Places, objs: Sequence[Object], name: str) -> Carrier:
    """An object on which others stand."""
    k = [o.name for o in objs].index(name)
    (a, b), (x, y) = places.share[k].tolist(), places.pos[k].tolist()
    disc = all(one.kind == "cylinder" for one in objs[k].variants or (objs[k],))
    return Carrier(k, name, disc, (a, b), (x, y), float(places.rot[k]))


def _of_objects(
    objs: Sequence[Object], measures: Sequence[Measures], kinds: np.ndarray, on: Sequence[int]
) -> dict[str, np.ndarray]:
    """The nominal parameters of objects."""
    sizes = np.array([m.full_size for m in measures], float).reshape(-1, 3)
    round_ = np.isin(kinds, shapes.PRIMITIVES)[:, None]
    return {
        "object_full_sizes": np.where(round_, shapes.consistent(kinds, sizes), sizes),
        "object_masses": np.array([m.mass for m in measures], float),
        "object_frictions": np.array([m.friction for m in measures], float).reshape(-1, 3),
        "object_rgba": np.array([m.rgba for m in measures], float).reshape(-1, 4),
        "object_tables": np.array(on, int),
        "object_active": np.array([o.active for o in objs], bool),
    }


def raise_condim(spec: mujoco.MjSpec, parts: Parts) -> None:
    """Gives slabs and furniture the largest `condim` of the objects, where theirs is smaller."""
    geoms = [g for o in parts.objects for g in spec.body(o.name).find_all("geom") if g.contype or g.conaffinity]
    below = [*(t.collision for t in parts.tables), *(name for term in parts.furniture for name in term.geoms)]
    for slab in map(spec.geom, below):
        slab.condim = max([slab.condim, *(g.condim for g in geoms)])


def nominal_places(objs: Sequence[Object], object_tables: Sequence[int], measures: Sequence[Measures]) -> Places:
    """The nominal places of objects. Those without a `pos` spread over the cells of a square grid on their table."""
    share, pos = np.zeros((len(objs), 2)), np.zeros((len(objs), 2))
    for table in set(object_tables):
        spread = [
            k
            for k, t in enumerate(object_tables)
            if t == table and objs[k].pos is None and not (objs[k].place or Place()).drop
        ]
        side = int(np.ceil(np.sqrt(len(spread))))
        for cell, k in enumerate(spread):
            share[k] = (2 * np.array(divmod(cell, side)[::-1]) + 1) / side - 1
    for k, obj in enumerate(objs):
        if obj.pos is not None:
            pos[k] = obj.pos
    return Places(
        share,
        pos,
        rot=np.array([o.rot for o in objs], float),
        center=np.array([m.center for m in measures], float).reshape(-1, 3),
        tilt=np.array([o.tilt for o in objs], float).reshape(-1, 4),
        kind=np.array([o.kind for o in objs], str),
        tag=sampling.tags([o.name for o in objs]),
        region=np.array([(o.place or Place()).region for o in objs], float).reshape(-1, 2, 2),
        margin=np.array([(o.place or Place()).margin for o in objs], float),
        rots=np.array([(o.place or Place()).yaws for o in objs], float).reshape(-1, 2),
        drop=np.array([(o.place or Place()).drop for o in objs], bool),
        near=Near(np.full(len(objs), -1), np.zeros((len(objs), 2))),
        distance=np.tile([0.0, np.inf], (len(objs), 1)),
    )


def set_params(spec: mujoco.MjSpec, parts: Parts, params: ArenaParams) -> None:
    """Gives the elements of a spec of the nominal arena the numbers of one world (float64), as if all were there."""
    for term in parts.terms:
        term.edit(spec, params)


def place_in_keyframes(spec: mujoco.MjSpec, parts: Parts, params: ArenaParams, object_qpos: np.ndarray) -> None:
    """Puts the objects on their tables in all keyframes, as in data that starts in one; (K, 7) entries of `qpos`."""
    poses = np.concatenate(placement.nominal_poses(parts.places, params), axis=-1)
    for key in spec.keys:
        if len(key.qpos):
            qpos = np.array(key.qpos)
            qpos[object_qpos] = poses
            key.qpos = qpos


def warn_of_nominal_places(
    model: mujoco.MjModel, data: mujoco.MjData, parts: Parts, there: np.ndarray, crowded: Callable[[], Sequence[str]]
) -> None:
    """Warns of objects that are inside something at the start, at the arena's nominal places, of what is there.

    Args:
        model: of the nominal arena.
        data: at its start.
        parts: of the arena.
        there: (T + K + E + S,) bool, what is there.
        crowded: gives the names of the objects that find no free place nominally.
    """
    mujoco.mj_forward(model, data)
    names = {o.name for o in parts.objects}
    absent, geoms = parts.presence.gone(there)
    gone = {model.geom(name).id for name in geoms}
    for contact in (c for c in data.contact if gone.isdisjoint(c.geom.tolist())):
        roots = [model.body(model.body_rootid[model.geom_bodyid[g]]).name for g in contact.geom]
        if contact.dist < -1e-3 and not names.isdisjoint(roots) and not {*absent} & {*roots} and roots[0] != roots[1]:
            a, b = (
                repr(root) if root in names else specs.geom_name(model, g)
                for root, g in zip(roots, contact.geom, strict=True)
            )
            without = list(crowded())
            free = "`make_data` with keys draws free ones"
            if without:
                names = f"{', '.join(map(repr, without))} start{'s' * (len(without) == 1)} above the others"
                free = f"there is no free place, with keys, too: {names}, as `place(params, key).valid` says"
            messages.warn(problem("", "start_inside", first=a, second=b, depth=-contact.dist, free=free))
            return
