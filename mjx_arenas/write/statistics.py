"""The statistics of a model at `qpos0`: `setStat` in MuJoCo's `engine_setconst.c`."""

import functools
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas.quaternions import norm
from mjx_arenas.rows import take
from mjx_arenas.write.kinematics import FREE, Kinematics, kinematics

FAR = 1e10  # [m] where `setStat` starts its bounding box
EXTENT, MEANSIZE, MEANMASS = 2.0, 0.2, 1.0  # `mj_defaultStatistic`


class Statistic(NamedTuple):
    """The fields of `mjx.Statistic`."""

    center: jax.Array  # (3,) [m] of the box around everything
    extent: jax.Array  # () [m] its longest side
    meansize: jax.Array  # () [m] of bodies
    meanmass: jax.Array  # () [kg] of bodies
    meaninertia: jax.Array  # () of degrees of freedom


def statistic(model: mjx.Model) -> Statistic:
    """Statistics at `qpos0`; of derived fields, `geom_rbound` and `dof_M0` are read."""
    kin, rows = kinematics(model), Rows.of(model, np.ones(model.nbody, bool))
    bodies = np.arange(1, model.nbody)
    reach = sizes(model, kin, rows, bodies)
    old = model.stat
    meaninertia = model.dof_M0.mean() if model.nv else old.meaninertia
    meansize, meanmass = old.meansize, old.meanmass
    if len(bodies):
        meansize, meanmass = reach.mean(), model.body_mass[1:].mean()
    return combine(*bounds(model, kin, rows), meansize, meanmass, meaninertia)


def combine(
    low: jax.Array,
    high: jax.Array,
    meansize: jax.Array,
    meanmass: jax.Array,
    meaninertia: jax.Array,
    some: jax.Array | bool = True,
) -> Statistic:
    """Statistics of what is within two corners (3,); `some`: there is a body beside the world.

    As in C, what no body and no width decides keeps MuJoCo's default.
    """
    meanmass, meansize = jnp.where(some, meanmass, MEANMASS), jnp.where(some, meansize, MEANSIZE)
    longest = jnp.where(high[0] > low[0], jnp.maximum((high - low).max(), 1e-5), EXTENT)
    return Statistic((low + high) / 2, jnp.maximum(longest, 2 * meansize), meansize, meanmass, meaninertia)


class Rows(NamedTuple):
    """Ids of elements, static."""

    body: np.ndarray  # by their origins
    com: np.ndarray  # bodies by their centres of mass
    joint: np.ndarray
    site: np.ndarray
    geom: np.ndarray

    @classmethod
    def of(cls, model: mjx.Model | mujoco.MjModel, bodies: np.ndarray) -> "Rows":
        """Everything on some `bodies` (nbody,) bool; free joints are where their bodies are."""
        body = np.flatnonzero(bodies[1:]) + 1
        joint = np.flatnonzero(bodies[model.jnt_bodyid] & (np.asarray(model.jnt_type) != FREE))
        site, geom = np.flatnonzero(bodies[model.site_bodyid]), np.flatnonzero(bodies[model.geom_bodyid])
        return cls(body, body, joint, site, geom)


def bounds(
    model: mjx.Model,
    kin: Kinematics,
    rows: Rows,
    present: jax.Array | None = None,
    shown: jax.Array | None = None,
) -> tuple[jax.Array, jax.Array]:
    """Lowest and highest corner (3,) of the box around points and the spheres around geoms.

    Args:
        model: of the world.
        kin: where its bodies are.
        rows: what counts.
        present: (nbody,) bool, the bodies that are there; None: all.
        shown: (ngeom,) bool, which of their geoms are; None: all.
    """
    joint_body, site_body, geom_body = (np.asarray(x) for x in (model.jnt_bodyid, model.site_bodyid, model.geom_bodyid))
    site, geom = site_body[rows.site], geom_body[rows.geom]
    points = [
        (rows.body, take(kin.pos, rows.body), 0.0),
        (rows.com, kin.place(rows.com, take(model.body_ipos, rows.com)), 0.0),
        (joint_body[rows.joint], take(kin.anchor, rows.joint), 0.0),
        (site, kin.place(site, take(model.site_pos, rows.site)), 0.0),
        (geom, kin.place(geom, take(model.geom_pos, rows.geom)), _drawn_radius(model, rows.geom)[:, None]),
    ]
    lows, highs = [jnp.full(3, FAR)], [jnp.full(3, -FAR)]
    of_geoms = None if shown is None else take(shown, rows.geom)
    counted = (None, None, None, None, of_geoms)
    for (body, point, radius), own in ((p, o) for p, o in zip(points, counted, strict=True) if len(p[0])):
        low, high = jnp.subtract(point, radius), jnp.add(point, radius)
        masks = [*([] if present is None else [take(present, body)]), *([] if own is None else [own])]
        if masks:
            there = functools.reduce(jnp.logical_and, masks)[:, None]
            low, high = jnp.where(there, low, FAR), jnp.where(there, high, -FAR)
        lows.append(outermost(low, jnp.minimum))
        highs.append(outermost(high, jnp.maximum))
    return functools.reduce(jnp.minimum, lows), functools.reduce(jnp.maximum, highs)


def outermost(points: jax.Array, pick: Callable[[jax.Array, jax.Array], jax.Array]) -> jax.Array:
    """(3,) the smallest or largest of the coordinates of some points (n, 3), n > 0.

    By halves, in n's binary digits: the derivative of a reduction looks for its result among what XLA may have computed a second
    time, with other roundings, and is NaN where it finds none.
    """
    while len(points) > 1:
        half = (len(points) + 1) // 2
        points = pick(points[:half], points[len(points) - half :])
    return points[0]


def sizes(
    model: mjx.Model,
    kin: Kinematics,
    rows: Rows,
    bodies: np.ndarray,
    present: jax.Array | None = None,
    shown: jax.Array | None = None,
) -> jax.Array:
    """(n,) how far `bodies` (n,) reach from their centres of mass: to their geoms, and their and their children's joints.

    Of the `rows`, those that are on the bodies count; `present` and `shown` are as in `bounds`.
    """
    geom_body, joint_body = np.asarray(model.geom_bodyid), np.asarray(model.jnt_bodyid)
    joint_base = np.asarray(model.body_parentid)[joint_body]
    solid = np.asarray(model.geom_type) != mujoco.mjtGeom.mjGEOM_PLANE

    reach = jnp.full(len(bodies), 1e-5)
    geom = rows.geom[solid[rows.geom] & np.isin(geom_body[rows.geom], bodies)]
    if len(geom):
        rbound = take(model.geom_rbound, geom)
        off_centre = norm(take(model.geom_pos, geom) - take(model.body_ipos, geom_body[geom]))
        counts = rbound > 0 if shown is None else (rbound > 0) & take(shown, geom)
        reach = jnp.maximum(reach, _segment_max(jnp.where(counts, rbound + off_centre, 0.0), geom_body[geom], bodies))
    free = np.flatnonzero(np.isin(joint_body, np.intersect1d(rows.com, bodies)) & (np.asarray(model.jnt_type) == FREE))
    if len(free):
        off_centre = norm(take(model.body_ipos, joint_body[free]))
        reach = jnp.maximum(reach, _segment_max(off_centre, joint_body[free], bodies))
    for end in (joint_body, joint_base):
        joint = rows.joint[np.isin(end[rows.joint], bodies)]
        if len(joint):
            joint = joint[np.argsort(end[joint], kind="stable")]
            body = end[joint]
            com = kin.place(body, take(model.body_ipos, body))
            length = norm(com - take(kin.anchor, joint))
            if present is not None:
                length = jnp.where(take(present, joint_body[joint]), length, 0.0)
            reach = jnp.maximum(reach, _segment_max(length, body, bodies))
    return jnp.maximum(reach, _flex_sizes(model, kin, bodies)) if model.nflex else reach


def _flex_sizes(model: mjx.Model, kin: Kinematics, bodies: np.ndarray) -> jax.Array:
    """(n,) the longest edge of flexes at each of `bodies` (n,), where a flex has nodes the way to its farthest node."""
    edge, longest = model._impl, np.zeros(model.nbody)
    nodes = []
    for flex in range(model.nflex):
        if model.flex_interp[flex]:
            nodes.append(model.flex_nodebodyid[model.flex_nodeadr[flex] :][: model.flex_nodenum[flex]])
            continue
        edges = slice(edge.flex_edgeadr[flex], edge.flex_edgeadr[flex] + edge.flex_edgenum[flex])
        ends = edge.flex_vertbodyid[model.flex_vertadr[flex] + edge.flex_edge[edges]]
        np.maximum.at(longest, ends, np.asarray(edge.flexedge_length0)[edges, None])
    size = jnp.asarray(longest)
    for body in nodes:
        way = norm(kin.pos[body][:, None] - kin.pos[body][None])
        size = size.at[body].max(way.max(1))
    return size[bodies]


def _drawn_radius(model: mjx.Model, geom: np.ndarray) -> jax.Array:
    """`geom_rbound` of some geoms (n,), or what stands for it where a geom has no bound."""
    radius, plane = take(model.geom_rbound, geom), np.asarray(model.geom_type)[geom] == mujoco.mjtGeom.mjGEOM_PLANE
    if not plane.any():
        return radius
    size = jnp.maximum(model.geom_size[geom, 0], model.geom_size[geom, 1])
    return jnp.where(plane, jnp.where(size > 0, 0.1 * size, 0.01), radius)


def _segment_max(values: jax.Array, owner: np.ndarray, ids: np.ndarray) -> jax.Array:
    """(n,) the largest of each owner's values (>= 0), 0 where it has none; `owner` is sorted and static."""
    counts = np.array([np.count_nonzero(owner == i) for i in ids], int)
    out, begin = [], 0
    for run in np.split(counts, np.flatnonzero(np.diff(counts)) + 1):
        if len(run):
            rows = values[begin : begin + run.sum()].reshape(len(run), run[0])
            columns = [rows[:, i] for i in range(run[0])]
            out.append(functools.reduce(jnp.maximum, columns) if columns else jnp.zeros(len(run), values.dtype))
            begin += run.sum()
    return jnp.concatenate(out) if out else jnp.zeros(0, values.dtype)
