"""The rows of the model's arrays that belong to each table and object: every name and id, looked up once (host)."""

import dataclasses
import functools
from collections.abc import Callable, Sequence
from typing import Any

import mujoco
import numpy as np

from mjx_arenas.params.params import ArenaParams
from mjx_arenas.problem import Item, problem
from mjx_arenas.problems import messages
from mjx_arenas.record.moves import Element, Frame, Moves
from mjx_arenas.sample.fixed import NOTHING, Fixed, Near
from mjx_arenas.sample.placement import FLUSH, Places
from mjx_arenas.spec import patterns, specs
from mjx_arenas.spec.extents import extents
from mjx_arenas.spec.hanging import hangs_on
from mjx_arenas.spec.names import element, of_task
from mjx_arenas.spec.place import STILL, Place
from mjx_arenas.terms.objects import Objects
from mjx_arenas.terms.parts import Parts, TableNames
from mjx_arenas.terms.presence import BoundPresence
from mjx_arenas.terms.tables import Tables
from mjx_arenas.write.trees import pulled, tendon_bodies

Wanted = Sequence[tuple[str, Item | None, Any]]
"""Names of bodies, or places, with what messages call each: its argument, and whose that is."""
LEVEL = 1e-9  # by which the cosine of a tilt may be off of what is upright


@dataclasses.dataclass(frozen=True)
class Layout:
    """Indices of the elements of T tables, K objects and M mounts in the compiled model."""

    table_body: np.ndarray  # (T,)
    table_geom: np.ndarray  # (T, PARTS) collision, visual, four legs
    top: np.ndarray  # (T,) sites
    mount_body: np.ndarray  # (M,)
    object_names: tuple[str, ...]
    object_kind: np.ndarray  # (K,) of str
    object_body: np.ndarray  # (K,)
    object_qpos: np.ndarray  # (K, 7) entries of qpos
    primitive_geom: np.ndarray  # (P,) of objects of one geom of variable size
    places: Places
    near: Callable[[Wanted], Near]  # what things stay near to, in all worlds
    presence: BoundPresence  # of tables, objects, others that come and go, and variants
    parts: Parts
    model: mujoco.MjModel  # the compiled nominal arena

    @classmethod
    def of(cls, model: mujoco.MjModel, parts: Parts, nominal: ArenaParams | None = None) -> "Layout":
        """Looks every element up by its name; without nominal parameters, `places` are those of the nominal arena alone."""
        tables = Tables(parts.tables, parts.mounts).bind(model)
        objects = Objects(parts.objects, parts.measures, parts.places).bind(model)
        presence = parts.presence.bind(model)
        owner = presence.groups.body
        comes = owner >= len(tables.body) + len(objects.body)
        standing, coming = np.where(comes, -1, owner)[model.geom_bodyid], np.where(comes, owner, -1)[model.geom_bodyid]
        moves = Moves.of(model, parts, nominal)
        fixed = fixed_geoms(parts, moves, standing, coming)._replace(presence=presence.there)
        near = functools.partial(_near, parts, moves, standing)
        return cls(
            table_body=tables.body,
            table_geom=tables.geom,
            top=tables.top,
            mount_body=tables.mount_body,
            object_names=tuple(o.name for o in parts.objects),
            object_kind=parts.places.kind,
            object_body=objects.body,
            object_qpos=objects.qpos,
            primitive_geom=objects.primitive_geom,
            places=_with_rings(parts, near, fixed),
            near=near,
            presence=presence,
            parts=parts,
            model=model,
        )

    @property
    def n_tables(self) -> int:
        """The number of tables, T."""
        return len(self.table_body)

    @property
    def owner(self) -> np.ndarray:
        """(nbody,) index of what must be there: table t is t, object k is T + k, another that comes and goes is T + K + e, otherwise -1."""
        return self.presence.groups.body

    @functools.cached_property
    def equality_bodies(self) -> list[list[int]]:
        """(neq,) bodies that each equality ties; none for an equality of flexes."""
        model, eq, obj = self.model, mujoco.mjtEq, mujoco.mjtObj
        of_body, of_site = [[b] for b in range(model.nbody)], [[int(b)] for b in model.site_bodyid]
        of = {(kind, obj.mjOBJ_BODY): of_body for kind in (eq.mjEQ_CONNECT, eq.mjEQ_WELD)}
        of |= {(kind, obj.mjOBJ_SITE): of_site for kind in (eq.mjEQ_CONNECT, eq.mjEQ_WELD)}
        coupled = {eq.mjEQ_JOINT: [[int(b)] for b in model.jnt_bodyid], eq.mjEQ_TENDON: self.tendon_bodies}
        found = []
        for e in range(model.neq):
            kind = eq(model.eq_type[e])
            bodies = coupled.get(kind) or of.get((kind, obj(model.eq_objtype[e])), [])
            ids = [i for i in (model.eq_obj1id[e], model.eq_obj2id[e]) if i >= 0]
            found.append([b for i in ids for b in bodies[i]] if bodies else [])
        return found

    @functools.cached_property
    def tendon_bodies(self) -> list[list[int]]:
        """(ntendon,) bodies that each tendon passes."""
        return tendon_bodies(self.model)

    @functools.cached_property
    def actuator_bodies(self) -> list[list[int]]:
        """(nu,) bodies that each actuator moves."""
        model, trn = self.model, mujoco.mjtTrn
        joint, site = model.jnt_bodyid, model.site_bodyid
        of = {trn.mjTRN_JOINT: joint, trn.mjTRN_JOINTINPARENT: joint, trn.mjTRN_SITE: site}
        of |= {trn.mjTRN_SLIDERCRANK: site, trn.mjTRN_BODY: np.arange(model.nbody)}
        found = []
        for kind, (target, other) in zip(model.actuator_trntype, model.actuator_trnid, strict=True):
            bodies = of.get(trn(kind))
            if kind == trn.mjTRN_TENDON:
                found.append(self.tendon_bodies[target])
            else:
                sites = [target, other] if bodies is site and other >= 0 else [target]  # with a refsite, a slidersite
                found.append([] if bodies is None else [int(bodies[i]) for i in sites])
        return found

    def held(self) -> dict[int, str]:
        """The tables (t) and objects (T + k) that an equality, tendon or actuator ties to something else, with what messages call that."""
        model = self.model
        ties = [(element(model, "equality", e), b) for e, b in enumerate(self.equality_bodies)]
        ties += [(element(model, "tendon", t), b) for t, b in enumerate(self.tendon_bodies)]
        ties += [(element(model, "actuator", a), b) for a, b in enumerate(self.actuator_bodies)]
        found = {}
        for name, bodies in ties:
            owners = {int(self.owner[b]) for b in bodies}
            found |= {owner: name for owner in owners if owner >= 0 and len(owners) > 1}
        return found

    def state_rows(self, there: np.ndarray) -> dict[str, np.ndarray]:
        """The rows of the state that a model without what is absent has, by the names of `MjData`; `there` (T + K + E,) bool."""
        model = self.model
        body = np.append(there, True)[self.owner]
        joint, dof = body[model.jnt_bodyid], body[model.dof_bodyid]
        actuator, equality = (
            np.array([body[bodies].all() for bodies in tied], bool)
            for tied in (self.actuator_bodies, self.equality_bodies)
        )
        width = np.where(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE, 7, 1)
        width = np.where(model.jnt_type == mujoco.mjtJoint.mjJNT_BALL, 4, width)
        rows = {"qpos": np.repeat(joint, width), "act": np.repeat(actuator, model.actuator_actnum)}
        rows |= dict.fromkeys(("qvel", "qacc_warmstart", "qfrc_applied"), dof)
        return rows | {"xfrc_applied": body, "ctrl": actuator, "eq_active": equality}


def fixed_of(model: mujoco.MjModel, parts: Parts) -> Fixed:
    """What is fixed in a compiled arena whose tables, parts and objects are told by their names."""
    tables = np.array([model.body(t.body).id for t in parts.tables], int)
    owner = hangs_on(model, tables)[model.geom_bodyid]
    return fixed_geoms(parts, Moves.of(model, parts, None), owner)


def fixed_geoms(parts: Parts, moves: Moves, owner: np.ndarray, coming: np.ndarray | None = None) -> Fixed:
    """A box around each geom that is fixed: on a table and able to reach above its top, or to the world; and the floor.

    Args:
        parts: of the arena.
        moves: what terms move in the compiled nominal arena.
        owner: (ngeom,) the table or object that each geom is of; -1: another.
        coming: (ngeom,) what else that comes and goes each geom is of; -1: nothing. None: nothing comes and goes.
    """
    model, tables = moves.model, parts.tables
    mounts = {model.body(m.body).id for m in parts.mounts}
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    moved, turned = moves.geoms(), moves.geoms(turned=True)
    body, (fixed, floor, planes) = model.geom_bodyid, _fixed_and_floor(parts, model, data, moved)
    driven, jointed = (
        set().union(*(_ancestors(model, b) for b in ids)) - {0} for ids in (pulled(model), model.jnt_bodyid)
    )
    rows: list[tuple] = []
    moving: list[tuple[int, Element, Frame]] = [(-1, ("geom", g), Frame(np.zeros(3), np.eye(3))) for g in planes]
    carried = _carried(parts, model, data)
    hung = [*parts.mounts, *(m for term in parts.furniture for m in term.mounts)]
    low_down = {model.body(m.body).id for m in hung if m.under}
    mounted = {model.body(m.body).id for m in hung}
    for g in np.flatnonzero(fixed).tolist():
        above = _ancestors(model, body[g])
        hangs = bool(owner[g] >= 0 and mounts.isdisjoint(above))
        under = bool(low_down & above)
        index, frame = int(owner[g]), Frame(np.zeros(3), np.eye(3))
        if carried.keys() & above:  # on furniture
            index, *own = next(carried[b] for b in sorted(above, reverse=True) if b in carried)
            frame = Frame(*own)
        elif owner[g] >= 0:
            frame = _on_table(tables[owner[g]], data, hangs, under)
        yaw = 0.0
        if owner[g] < 0 and index < 0:  # turned like the geom
            axis = data.geom_xmat[g].reshape(3, 3)[:, 0]
            yaw = float(np.arctan2(axis[1], axis[0]))
        turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
        low, high = extents(model, data, np.arange(model.ngeom) == g, frame.origin, frame.axes @ turn)
        if owner[g] < 0 or under or high[2] > FLUSH or moved[g]:
            if moved[g]:
                moving.append((len(rows), ("geom", g), frame))
            pose = [*(turn @ (low + high))[:2] / 2, yaw]
            half, heights = (high - low)[:2] / 2, [low[2], high[2] - FLUSH]
            robot = int(body[g]) in driven or (int(body[g]) in jointed and bool(mounted & above))
            round_, carries = _is_round(model, data, g, moved[g], turned[g]), robot and not hangs
            group = -1 if coming is None else int(coming[g])
            rows.append((index, hangs, pose, half, heights, round_, carries, under, group, specs.geom_name(model, g)))
    found = moves.moving(data, *zip(*moving, strict=True)) if moving else None
    if not rows:
        return NOTHING._replace(floor=floor, moving=found)
    *arrays, group, names = zip(*rows, strict=True)
    own = Fixed(*map(np.array, arrays), names=names, floor=floor, moving=found)
    return own._replace(group=np.array(group), gone=np.zeros(len(rows), bool))


def _on_table(names: TableNames, data: mujoco.MjData, hangs: bool, under: bool) -> Frame:
    """The frame of the slab's middle, with which what `hangs` moves; or, of a robot, of the table's top or its underside."""
    middle, top = data.body(names.body).xpos.copy(), data.site(names.top).xpos.copy()
    origin = middle if hangs else top
    return Frame(2 * middle - origin if under else origin, data.body(names.body).xmat.reshape(3, 3).copy())


def _fixed_and_floor(
    parts: Parts, model: mujoco.MjModel, data: mujoco.MjData, moved: np.ndarray
) -> tuple[np.ndarray, float | None, list[int]]:
    """What is fixed.

    Returns:
        (ngeom,) bool, geoms that collide and end, that no joints move, and that follow no table or part; the height [m] of the highest
        level plane that no term moves, or None; and the level planes that terms move.
    """
    body, endless = model.geom_bodyid, [mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD]
    fixed = ((model.geom_contype | model.geom_conaffinity) != 0) & (model.body_weldid[body] == 0)
    fixed &= model.body_mocapid[model.body_rootid[body]] == -1
    level = fixed & (model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE) & (data.geom_xmat[:, 8] > 1 - LEVEL)
    planes, level = np.flatnonzero(level & moved).tolist(), level & ~moved
    floor = float(data.geom_xpos[level, 2].max()) if level.any() else None
    fixed &= ~np.isin(model.geom_type, endless)
    vary = [*(names.collision for names in parts.tables), *(name for term in parts.furniture for name in term.geoms)]
    vary += [one.geom for one in parts.follows]
    fixed[[model.geom(name).id for name in vary]] = False
    return fixed, floor, planes


def _is_round(model: mujoco.MjModel, data: mujoco.MjData, g: int, moved: bool, turned: bool) -> bool:
    """Whether a geom is a disc, seen from above, in all worlds."""
    kind, size = mujoco.mjtGeom(model.geom_type[g]), model.geom_size[g]
    upright = abs(data.geom_xmat[g, 8]) > 1 - LEVEL
    round_ = kind in (mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_CAPSULE)
    round_ |= kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID and size[0] == size[1] and not moved
    return kind == mujoco.mjtGeom.mjGEOM_SPHERE or bool(round_ and upright and not turned)


def _with_rings(parts: Parts, near: Callable[[Wanted], Near], fixed: Fixed) -> Places:
    """The places, with what is fixed, and where that is which objects and parts of furniture stay near.

    Raises:
        ValueError: there is no such body, or it is elsewhere in other states.
    """
    places, stay = parts.places, [obj.place or Place() for obj in parts.objects]
    objects = [
        ("objects.place.near", ("object", obj.name), one.near) for obj, one in zip(parts.objects, stay, strict=True)
    ]
    of_parts = [(f"{p.name}.near", None, p.near) for p in places.furniture]
    distance = np.array([one.distance if one.near is not None else (0.0, np.inf) for one in stay], float).reshape(-1, 2)
    return places._replace(near=near(objects), distance=distance, fixed=fixed._replace(near=near(of_parts)))


def _near(parts: Parts, moves: Moves, owner: np.ndarray, wanted: Wanted) -> Near:
    """The places to which things stay near.

    Raises:
        ValueError: there is no such body, or it is elsewhere in other states.
    """
    model = moves.model
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    on, found = np.full(len(wanted), -1), np.zeros((len(wanted), 2))
    moved: list[tuple[int, Element, Frame]] = []
    carried, own = _carried(parts, model, data), dict(zip(model.geom_bodyid.tolist(), owner.tolist(), strict=True))
    for k, (path, item, near) in enumerate(wanted):
        if not isinstance(near, str):
            found[k] = (0.0, 0.0) if near is None else near
            continue
        body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, near)
        still = (model.body_weldid == 0) & (model.body_mocapid[model.body_rootid] < 0)
        if body < 0:
            known = [name for b in np.flatnonzero(still)[1:] if (name := model.body(b).name)]
            rule = "no_body_of_task" if of_task(near, known) else "no_body"
            raise messages.error([problem(path, rule, item, near, must=STILL, nearest=patterns.near(near, known))])
        if not still[body]:
            raise messages.error([problem(path, "must", item, near, must=STILL)])
        above = _ancestors(model, body)
        origin, axes = np.zeros(3), np.eye(3)
        if carried.keys() & above:
            on[k], origin, axes = next(carried[b] for b in sorted(above, reverse=True) if b in carried)
        elif (table := next((own[b] for b in above if own.get(b, -1) >= 0), -1)) >= 0:
            on[k], frame = table, data.body(parts.tables[table].body)
            origin, axes = frame.xpos, frame.xmat.reshape(3, 3)
        found[k] = (axes.T @ (data.xpos[body] - origin))[:2]
        if moves.bodies[list(above)].any():
            moved.append((k, ("body", body), Frame(np.array(origin), np.array(axes))))
    return Near(on, found, moves.moving(data, *zip(*moved, strict=True)) if moved else None)


def _carried(parts: Parts, model: mujoco.MjModel, data: mujoco.MjData) -> dict[int, tuple[int, np.ndarray, np.ndarray]]:
    """The frames (index, origin, axes) in which stands what hangs on these bodies: parts, and robots' mounts on their surfaces."""
    found, names = {}, parts.surfaces
    for p, term in enumerate(parts.furniture):
        frame = data.body(term.name)
        axes = frame.xmat.reshape(3, 3)
        found[frame.id] = len(names) + p, frame.xpos.copy(), axes
        for mount in term.mounts:
            if mount.surface is not None:
                index = names.index("_".join(filter(None, (term.name, mount.surface))))
                found[data.body(mount.body).id] = index, data.body(mount.body).xpos - axes @ mount.pos, axes
    return found


def _ancestors(model: mujoco.MjModel, body: int) -> set[int]:
    """A body and all that it hangs on."""
    found = {int(body)}
    while body:
        body = model.body_parentid[body]
        found.add(int(body))
    return found
