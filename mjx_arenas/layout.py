"""Which rows of the model's arrays belong to which table and object: every name and id, looked up once (host)."""

import dataclasses
import functools
from typing import Literal

import mujoco
import numpy as np

from mjx_arenas.extents import extents
from mjx_arenas.parts import Parts
from mjx_arenas.placement import Places
from mjx_arenas.write.references import Heavy
from mjx_arenas.write.statistics import Rows

FLUSH = 1e-6  # what does not reach higher above a table's top is level with it [m]


@dataclasses.dataclass(frozen=True)
class Layout:
    """T tables, K objects, M mounts."""

    table_body: np.ndarray  # (T,)
    table_geom: np.ndarray  # (T, PARTS) collision, visual, four legs
    top: np.ndarray  # (T,) sites
    mount_body: np.ndarray  # (M,)
    mount_table: np.ndarray  # (M,)
    mount_height: np.ndarray  # (M,) above the top [m]
    object_names: tuple[str, ...]
    object_kind: np.ndarray  # (K,) of str
    object_body: np.ndarray  # (K,)
    object_qpos: np.ndarray  # (K, 7) entries of qpos
    places: Places
    object_mass: np.ndarray  # (K,) nominal [kg]
    primitive: np.ndarray  # (P,) indices of objects of one geom of variable size
    primitive_geom: np.ndarray  # (P,)
    owner: dict[
        str, np.ndarray
    ]  # of "body", "geom", "dof": (n,) what must be there: table t: t, object k: T + k, else -1
    nominal: mujoco.MjModel  # the compiled nominal arena
    varying: frozenset[str]  # fields that differ between worlds of this arena: not those that its MJCF pins
    cam_body: np.ndarray  # (ncam, 2) body, target body or -1
    light_body: np.ndarray  # (nlight, 2)

    @classmethod
    def of(cls, model: mujoco.MjModel, parts: Parts, varying: frozenset[str]) -> "Layout":
        """Looks every element up by its name."""
        tables, mounts, objects = parts.tables, parts.mounts, parts.objects
        first_qpos = np.array([model.joint(f"{o.name}_joint0").qposadr[0] for o in objects], int).reshape(-1, 1)
        table_body = np.array([model.body(t.body).id for t in tables])
        object_body = np.array([model.body(o.name).id for o in objects], int)
        owner = _owners(model, table_body, object_body)
        primitive = np.array([k for k, o in enumerate(objects) if o.is_primitive], int)
        return cls(
            table_body=table_body,
            table_geom=np.array([[model.geom(name).id for name in t.geoms] for t in tables]),
            top=np.array([model.site(t.top).id for t in tables]),
            mount_body=np.array([model.body(m.body).id for m in mounts], int),
            mount_table=np.array([m.table for m in mounts], int),
            mount_height=np.array([m.height for m in mounts], float),
            object_names=tuple(o.name for o in objects),
            object_kind=np.array([o.type for o in objects], str),
            object_body=object_body,
            object_qpos=first_qpos + np.arange(7),
            places=_with_bases(parts, model, owner["geom"]),
            object_mass=np.array([m.mass for m in parts.measures], float),
            primitive=primitive,
            primitive_geom=np.array([model.geom(f"{objects[k].name}_g0").id for k in primitive], int),
            owner=owner,
            nominal=model,
            varying=varying,
            cam_body=np.stack([model.cam_bodyid, model.cam_targetbodyid], axis=-1),
            light_body=np.stack([model.light_bodyid, model.light_targetbodyid], axis=-1),
        )

    @property
    def n_tables(self) -> int:
        """T."""
        return len(self.table_body)

    @functools.cached_property
    def moves(self) -> np.ndarray:
        """(nbody,) bool: may stand elsewhere in another world."""
        return self.owner["body"] >= 0

    @functools.cached_property
    def moving_body(self) -> np.ndarray:
        """Ids of the bodies that may stand elsewhere in another world."""
        return np.flatnonzero(self.moves)

    @functools.cached_property
    def heavy_fixtures(self) -> np.ndarray:
        """Ids of the bodies with mass that are fixed on tables."""
        model, owner = self.nominal, self.owner["body"]
        on_table = (owner >= 0) & (owner < self.n_tables)
        return np.flatnonzero(on_table & (model.body_weldid == 0) & (model.body_mass > 0))

    @functools.cached_property
    def still(self) -> Rows:
        """What does not move."""
        return Rows.of(self.nominal, ~self.moves)

    @functools.cached_property
    def ball_geom(self) -> np.ndarray:
        """Geoms of moving bodies whose centres, origins and centres of mass are one: most objects'."""
        model = self.nominal
        body = model.geom_bodyid
        centred = ~model.geom_pos.any(1) & ~model.body_ipos[body].any(1) & (model.geom_rbound > 0)
        alone = np.bincount(body, minlength=model.nbody)[body] == 1
        return np.flatnonzero(centred & alone & self.moves[body] & ~np.isin(body, self.table_body))

    @functools.cached_property
    def rest(self) -> Rows:
        """What moves, beside the tables' own elements and `ball_geom`."""
        rows = Rows.of(self.nominal, self.moves)
        known = np.concatenate([self.table_body, self.nominal.geom_bodyid[self.ball_geom]])
        return Rows(
            np.setdiff1d(rows.body, known),
            np.setdiff1d(rows.com, known),
            rows.joint,
            np.setdiff1d(rows.site, self.top),
            np.setdiff1d(rows.geom, np.concatenate([self.table_geom.reshape(-1), self.ball_geom])),
        )

    @functools.cached_property
    def heavy(self) -> Heavy:
        """The bodies that have mass."""
        ids = np.flatnonzero(self.nominal.body_mass)
        return Heavy(ids, not self.nominal.body_ipos[ids].any())

    @property
    def reflected_inertia(self) -> float:
        """What tendons with an armature add to `stat.meaninertia`, whose moments at `qpos0` no parameter changes."""
        model = self.nominal
        return float(model.stat.meaninertia - model.dof_M0.mean()) if model.tendon_armature.any() else 0.0

    def rows(
        self, of: Literal["body", "geom", "dof"], owned_by: Literal["object", "any"]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Ids of the bodies, geoms or dofs of objects, with the object's index; or of tables and objects, with `owner`."""
        first = self.n_tables if owned_by == "object" else 0
        ids = np.flatnonzero(self.owner[of] >= first)
        return ids, self.owner[of][ids] - first

    @functools.cached_property
    def equality_bodies(self) -> list[list[int]]:
        """(neq,) the bodies that each equality ties; none of one of flexes."""
        model, eq, obj = self.nominal, mujoco.mjtEq, mujoco.mjtObj
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
        """(ntendon,) the bodies that each tendon passes."""
        model = self.nominal
        joint, geom, site = model.jnt_bodyid, model.geom_bodyid, model.site_bodyid
        wraps = {mujoco.mjtWrap.mjWRAP_JOINT: joint, mujoco.mjtWrap.mjWRAP_SITE: site}
        wraps |= {mujoco.mjtWrap.mjWRAP_SPHERE: geom, mujoco.mjtWrap.mjWRAP_CYLINDER: geom}
        found = []
        for first, n in zip(model.tendon_adr, model.tendon_num, strict=True):
            path = range(first, first + n)
            steps = [(wraps.get(mujoco.mjtWrap(model.wrap_type[w])), model.wrap_objid[w]) for w in path]
            found.append([int(bodies[i]) for bodies, i in steps if bodies is not None])
        return found

    @functools.cached_property
    def actuator_bodies(self) -> list[list[int]]:
        """(nu,) the bodies that each actuator moves."""
        model, trn = self.nominal, mujoco.mjtTrn
        joint, site = model.jnt_bodyid, model.site_bodyid
        of = {trn.mjTRN_JOINT: joint, trn.mjTRN_JOINTINPARENT: joint, trn.mjTRN_SITE: site}
        of |= {trn.mjTRN_SLIDERCRANK: site, trn.mjTRN_BODY: np.arange(model.nbody)}
        found = []
        for kind, (target, _) in zip(model.actuator_trntype, model.actuator_trnid, strict=True):
            bodies = of.get(trn(kind))
            if kind == trn.mjTRN_TENDON:
                found.append(self.tendon_bodies[target])
            else:
                found.append([] if bodies is None else [int(bodies[target])])
        return found

    def held(self) -> dict[int, str]:
        """Which tables (t) and objects (T + k) an equality or a tendon ties to something else, and its name."""
        model = self.nominal
        ties = [(model.equality(e).name or f"equality {e}", b) for e, b in enumerate(self.equality_bodies)]
        ties += [(model.tendon(t).name or f"tendon {t}", b) for t, b in enumerate(self.tendon_bodies)]
        found = {}
        for name, bodies in ties:
            owners = {int(self.owner["body"][b]) for b in bodies}
            found |= {owner: name for owner in owners if owner >= 0 and len(owners) > 1}
        return found

    def state_rows(self, there: np.ndarray) -> dict[str, np.ndarray]:
        """Which rows of the state a model without what is absent has, by the names of `MjData`; `there` (T + K,) bool."""
        model = self.nominal
        body = np.append(there, True)[self.owner["body"]]
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


def _owners(model: mujoco.MjModel, table_body: np.ndarray, object_body: np.ndarray) -> dict[str, np.ndarray]:
    body = np.full(model.nbody, -1)
    for index, top in enumerate((*table_body, *object_body)):
        body[top] = index
    for b in range(1, model.nbody):  # parents come first
        if body[b] < 0:
            body[b] = body[model.body_parentid[b]]
    return {"body": body, "geom": body[model.geom_bodyid], "dof": body[model.dof_bodyid]}


def _with_bases(parts: Parts, model: mujoco.MjModel, owner: np.ndarray) -> Places:
    """The places, with a rectangle around each geom that is fixed: on a table and able to reach above its top, or to the world."""
    tables, mounts = parts.tables, {model.body(m.body).id for m in parts.mounts}
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    body, endless = model.geom_bodyid, [mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD]
    fixed = ((model.geom_contype | model.geom_conaffinity) != 0) & ~np.isin(model.geom_type, endless)
    fixed &= (model.body_weldid[body] == 0) & (model.body_mocapid[model.body_rootid[body]] == -1)
    fixed[[model.geom(names.collision).id for names in tables]] = False
    on, middles, poses, halves, heights = [], [], [], [], []
    for g in np.flatnonzero(fixed):
        hangs = owner[g] >= 0 and mounts.isdisjoint(_ancestors(model, body[g]))
        if owner[g] < 0:  # in a frame that stands on the floor and is turned like the geom
            axis = data.geom_xmat[g].reshape(3, 3)[:, 0]
            origin, yaw = np.zeros(3), float(np.arctan2(axis[1], axis[0]))
            turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
            axes = turn
        else:  # in the frame of the slab's middle, with which it moves, or, of a robot, of the table's top
            names = tables[owner[g]]
            origin, yaw, turn = data.body(names.body).xpos if hangs else data.site(names.top).xpos, 0.0, np.eye(3)
            axes = data.body(names.body).xmat.reshape(3, 3)
        low, high = extents(model, data, np.arange(model.ngeom) == g, origin, axes)
        if owner[g] < 0 or high[2] > FLUSH:
            on.append(owner[g])
            middles.append(hangs)
            poses.append([*(turn @ (low + high))[:2] / 2, yaw])
            halves.append((high - low)[:2] / 2)
            heights.append([low[2], high[2] - FLUSH])
    return parts.places._replace(
        base_table=np.array(on, int),
        base_hangs=np.array(middles, bool),
        base_pose=np.array(poses, float).reshape(-1, 3),
        base_half=np.array(halves, float).reshape(-1, 2),
        base_z=np.array(heights, float).reshape(-1, 2),
    )


def _ancestors(model: mujoco.MjModel, body: int) -> set[int]:
    """A body and all that it hangs on."""
    found = {int(body)}
    while body:
        body = model.body_parentid[body]
        found.add(int(body))
    return found
