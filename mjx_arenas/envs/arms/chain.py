"""An arm as a chain of joints: where its tool is, how that moves with them, and which way they have to go, in plain JAX.

n joints. Everything is in the frame of the chain's base.
"""

import itertools
from collections.abc import Mapping
from typing import NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from mjx_arenas import quaternions
from mjx_arenas.geometry import Array, array_module
from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import error
from mjx_arenas.rows import dot
from mjx_arenas.write.touched import Touched

_TURNS, _SLIDES = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)


class Chain(NamedTuple):
    """Hinges and slides from a base to a tool, one after the other; numbers of NumPy or JAX."""

    joints: tuple[str, ...]
    """Names of the joints."""
    pos: Array
    """(n + 1, 3) of each joint's body, and of the tool, in the frame of the one before [m]."""
    mat: Array
    """(n + 1, 3, 3) how each is turned there."""
    axis: Array
    """(n, 3) unit vectors in the joints' bodies."""
    anchor: Array
    """(n, 3) in the joints' bodies [m]."""
    turns: np.ndarray
    """(n,) bool: a hinge."""
    zero: Array
    """(n,) `qpos0`, at which the bodies are as the MJCF has them."""


class Tool(NamedTuple):
    """The pose of a tool in the frame of its base, and how it moves."""

    pos: jax.Array
    """(3,) [m]"""
    mat: jax.Array
    """(3, 3) its axes, as columns."""
    jacobian: jax.Array
    """(6, n): velocity [m/s] and angular velocity [rad/s] for a velocity of each joint."""


class Links(NamedTuple):
    """Where the numbers of a chain are in a model (host)."""

    model: mujoco.MjModel
    bodies: list[list[int]]
    """(n + 1) ids of the bodies up to that of each joint, from that of the joint before, and up to that of the tool."""
    joints: list[int]
    """(n,) ids."""
    site: int
    """Id of the tool."""

    @property
    def zeros(self) -> np.ndarray:
        """(n,) where the joints' positions are in `qpos0`."""
        return self.model.jnt_qposadr[self.joints]

    def vary(self, touched: Touched) -> bool:
        """Whether the tool is elsewhere in some world although the joints are as in others."""
        bodies, rows = [*itertools.chain(*self.bodies)], {"qpos0": self.zeros}
        rows |= dict.fromkeys(("body_pos", "body_quat"), bodies) | dict.fromkeys(("jnt_pos", "jnt_axis"), self.joints)
        rows |= dict.fromkeys(("site_pos", "site_quat"), self.site)
        return any(touched.rows(name)[ids].any() for name, ids in rows.items())

    def chain(self, fields: Mapping[str, Array]) -> Chain:
        """The chain in a world with these fields of its model, by MuJoCo's names; nominal in what they lack."""

        def of(name: str) -> Array:
            return fields.get(name, getattr(self.model, name))

        pos, mat = [], []
        for bodies in self.bodies:
            frame = np.zeros(3), np.eye(3)
            for body in bodies:
                frame = _after(*frame, of("body_pos")[body], of("body_quat")[body])
            pos.append(frame[0])
            mat.append(frame[1])
        pos[-1], mat[-1] = _after(pos[-1], mat[-1], of("site_pos")[self.site], of("site_quat")[self.site])
        xp, names = array_module(*pos, *mat), tuple(self.model.joint(i).name for i in self.joints)
        ids, turns = np.array(self.joints), self.model.jnt_type[self.joints] == _TURNS
        axis, anchor, zero = of("jnt_axis")[ids], of("jnt_pos")[ids], of("qpos0")[self.zeros]
        return Chain(names, xp.stack(pos), xp.stack(mat), axis, anchor, turns, zero)


def chain(model: mujoco.MjModel, base: str, site: str) -> Chain:
    """The joints between a body and a site, which hangs on it, as for `links`."""
    return links(model, base, site).chain({})


def varied(model: mujoco.MjModel, base: str, site: str, touched: Touched) -> Links | None:
    """Where the numbers of a chain are which differs between worlds; None if it does not."""
    found = links(model, base, site)
    return found if found.vary(touched) else None


def links(model: mujoco.MjModel, base: str, site: str) -> Links:
    """The joints between a body and a site, which hangs on it.

    Raises:
        ValueError: the site does not hang on the body, or a joint between them is a ball or free, or shares its body with another.
    """
    tool, root = model.site(site), model.body(base).id
    bodies, body = [], int(tool.bodyid[0])
    while body != root:
        if body == 0:
            raise error([problem("tool", "tool_below", None, site, base=base)])
        bodies.append(body)
        body = int(model.body_parentid[body])
    between, joints = [[]], []
    for body in reversed(bodies):
        between[-1].append(body)
        if model.body_jntnum[body] > 1 or (model.body_jntnum[body] and _kind(model, body) not in (_TURNS, _SLIDES)):
            name = model.body(body).name
            raise error([problem("tool", "tool_joints", None, name)])
        if model.body_jntnum[body]:
            joints.append(int(model.body_jntadr[body]))
            between.append([])
    if not joints:
        raise error([problem("tool", "tool_moves", None, site, base=base)])
    return Links(model, between, joints, tool.id)


def length(links: Chain, limits: np.ndarray) -> float:
    """A distance from its base beyond which no tool goes, infinite with a slide that has no limits [m].

    Args:
        links: in NumPy.
        limits: (2, n) lowest and highest positions.
    """
    bodies, anchors = (np.linalg.norm(x, axis=-1).sum() for x in (links.pos, links.anchor))
    slides = np.abs(limits - links.zero).max(0)[~links.turns].sum()
    return float(bodies + 2 * anchors + slides)


def _kind(model: mujoco.MjModel, body: int) -> int:
    return int(model.jnt_type[model.body_jntadr[body]])


def _after(pos: Array, mat: Array, child: Array, quat: Array) -> tuple[Array, Array]:
    """A frame in another one, in the frame that this one is in."""
    return pos + _times(mat[None], child[None])[0], _product(mat[None], quaternions.quat_to_mat(quat)[None])[0]


def tool(arm: Chain, q: jax.Array) -> Tool:
    """The pose of the tool for positions (n,) of the joints; jit, vmap.

    The formulas are those of MuJoCo's `mj_kinematics` and `mj_jacSite`; hinges turn by Rodrigues' formula.
    """
    moved, still, turns = q - arm.zero, arm.mat[:-1], arm.turns[:, None, None]
    x, y, z = arm.axis.T
    xp = array_module(still, x)
    none = xp.zeros_like(x)
    cross = xp.where(turns, xp.array([[none, -z, y], [z, none, -x], [-y, x, none]]).transpose(2, 0, 1), 0.0)
    # Each body in the frame of the one before, as it is at zero, and what the sine and the versine of its joint add.
    by_sine = _product(still, cross)
    by_versine = _product(by_sine, cross)
    sine, versine = jnp.sin(moved)[:, None], 1 - jnp.cos(moved)[:, None]
    mat = still + sine[..., None] * by_sine + versine[..., None] * by_versine
    slides = xp.where(turns[..., 0], 0.0, _times(still, arm.axis))
    pos = moved[:, None] * slides - sine * _times(by_sine, arm.anchor) - versine * _times(by_versine, arm.anchor)
    mat, pos = jnp.append(mat, arm.mat[None, -1], axis=0), jnp.append(pos, np.zeros((1, 3)), axis=0) + arm.pos
    step = 1
    while step < len(mat):  # twice as many are joined in each round
        mat, step = jnp.concatenate([mat[:step], _product(mat[:-step], mat[step:])]), 2 * step
    pos = jnp.cumsum(jnp.concatenate([pos[:1], _times(mat[:-1], pos[1:])]), axis=0)
    axis, anchor = _times(mat[:-1], arm.axis), pos[:-1] + _times(mat[:-1], arm.anchor)
    along = jnp.where(turns[..., 0], jnp.cross(axis, pos[-1] - anchor), axis)
    return Tool(pos[-1], mat[-1], jnp.concatenate([along.T, jnp.where(turns[..., 0], axis, 0.0).T]))


def _times(mat: Array, vector: Array) -> Array:
    """(n, 3) products of matrices (n, 3, 3) with vectors (n, 3), in full precision on a GPU, too; NumPy or JAX."""
    return (mat * vector[:, None]).sum(-1)


def _product(one: Array, other: Array) -> Array:
    """(n, 3, 3) products of matrices, likewise."""
    return (one[..., None] * other[:, None]).sum(-2)


def off(tool: Tool, pos: jax.Array, yaw: jax.Array | float) -> jax.Array:
    """(6,) [m] and [rad] from a tool to a place, pointing down, with a heading that looks the same from both sides."""
    up = jnp.array([0.0, 0.0, 1.0])
    heading = jnp.arctan2(tool.mat[1, 0], tool.mat[0, 0])
    turned = jnp.mod(yaw - heading + jnp.pi / 2, jnp.pi) - jnp.pi / 2
    return jnp.concatenate([pos - tool.pos, jnp.cross(tool.mat[:, 2], -up) + up * turned])


def errors(arm: Chain, start: jax.Array, limits: jax.Array, pos: jax.Array, yaw: jax.Array | float) -> jax.Array:
    """(2,) [m] and [rad] by which a tool that is to point down misses a place, along an axis; jit, vmap.

    Args:
        arm: n joints.
        start: (n,) positions from which 120 steps of inverse kinematics go.
        limits: (2, n) lowest and highest positions.
        pos: (3,) the place.
        yaw: () heading of the tool there.
    """

    def one(q: jax.Array, _: None) -> tuple[jax.Array, None]:
        at = tool(arm, q)
        change = steps(at.jacobian, jnp.clip(off(at, pos, yaw), -0.1, 0.1), 0.03)
        return jnp.clip(q + change, limits[0], limits[1]), None

    at = tool(arm, jax.lax.scan(one, start, length=120)[0])
    error = jnp.abs(off(at, pos, yaw))
    turned = jnp.where(at.mat[2, 2] < 0, error[3:].max(), jnp.pi)  # upside down, its axes look right, too
    return jnp.stack([error[:3].max(), turned])


def steps(jacobian: jax.Array, twist: jax.Array, damping: float = 0.05) -> jax.Array:
    """(n,) changes of the joints for a small change (m,) of the tool, by damped least squares.

    They are J^T (J J^T + damping^2 I)^-1 twist (Wampler, 1986; Buss, 2004): near a singular pose they stay small, and fall short.

    Args:
        jacobian: (m, n), of the rows that matter.
        twist: (m,) [m] and [rad].
        damping: [m] and [rad] for one of a joint.
    """
    square = dot("in,jn->ij", jacobian, jacobian) + damping**2 * jnp.eye(len(twist))
    return dot("in,i->n", jacobian, jax.scipy.linalg.solve(square, twist, assume_a="pos"))
