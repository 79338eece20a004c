"""An arm as a chain of joints: where its tool is, how that moves with them, and which way they have to go, in plain JAX.

n joints. Everything is in the frame of the chain's base.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from mjx_arenas.geometry import Array
from mjx_arenas.rows import dot

_TURNS, _SLIDES = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)


class Chain(NamedTuple):
    """Hinges and slides from a base to a tool, one after the other."""

    joints: tuple[str, ...]
    """Names of the joints."""
    pos: np.ndarray
    """(n + 1, 3) of each joint's body, and of the tool, in the frame of the one before [m]."""
    mat: np.ndarray
    """(n + 1, 3, 3) how each is turned there."""
    axis: np.ndarray
    """(n, 3) unit vectors in the joints' bodies."""
    anchor: np.ndarray
    """(n, 3) in the joints' bodies [m]."""
    turns: np.ndarray
    """(n,) bool: a hinge."""
    zero: np.ndarray
    """(n,) `qpos0`, at which the bodies are as the MJCF has them."""


class Tool(NamedTuple):
    """The pose of a tool in the frame of its base, and how it moves."""

    pos: jax.Array
    """(3,) [m]"""
    mat: jax.Array
    """(3, 3) its axes, as columns."""
    jacobian: jax.Array
    """(6, n): velocity [m/s] and angular velocity [rad/s] for a velocity of each joint."""


def chain(model: mujoco.MjModel, base: str, site: str) -> Chain:
    """The joints between a body and a site, which hangs on it.

    Raises:
        ValueError: the site does not hang on the body, or a joint between them is a ball or free, or shares its body with another.
    """
    tool, root = model.site(site), model.body(base).id
    bodies, body = [], int(tool.bodyid[0])
    while body != root:
        if body == 0:
            raise ValueError(f"`tool` must be a site that hangs on body {base!r}, got {site!r}.")
        bodies.append(body)
        body = int(model.body_parentid[body])
    pos, mat, found = [np.zeros(3)], [np.eye(3)], []
    for body in reversed(bodies):
        pos[-1], mat[-1] = _after(pos[-1], mat[-1], model.body_pos[body], model.body_quat[body])
        if model.body_jntnum[body] > 1 or (model.body_jntnum[body] and _kind(model, body) not in (_TURNS, _SLIDES)):
            name = model.body(body).name
            raise ValueError(f"`tool` must hang on hinges and slides, one to a body, got others on body {name!r}.")
        if model.body_jntnum[body]:
            found.append(int(model.body_jntadr[body]))
            pos.append(np.zeros(3))
            mat.append(np.eye(3))
    pos[-1], mat[-1] = _after(pos[-1], mat[-1], tool.pos, tool.quat)
    if not found:
        raise ValueError(
            f"`tool` must hang on a hinge or slide of body {base!r} or one that hangs on it, got {site!r}."
        )
    names = tuple(model.joint(i).name for i in found)
    zero, turns = model.qpos0[model.jnt_qposadr[found]], model.jnt_type[found] == _TURNS
    return Chain(names, np.array(pos), np.array(mat), model.jnt_axis[found], model.jnt_pos[found], turns, zero)


def _kind(model: mujoco.MjModel, body: int) -> int:
    return int(model.jnt_type[model.body_jntadr[body]])


def _after(pos: np.ndarray, mat: np.ndarray, child: np.ndarray, quat: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A frame in another one, in the frame that this one is in."""
    turned = np.zeros(9)
    mujoco.mju_quat2Mat(turned, quat)
    return pos + mat @ child, mat @ turned.reshape(3, 3)


def tool(arm: Chain, q: jax.Array) -> Tool:
    """The pose of the tool for positions (n,) of the joints; jit, vmap.

    The formulas are those of MuJoCo's `mj_kinematics` and `mj_jacSite`; hinges turn by Rodrigues' formula.
    """
    moved, still, turns = q - arm.zero, arm.mat[:-1], arm.turns[:, None, None]
    x, y, z = arm.axis.T
    none = np.zeros_like(x)
    cross = np.where(turns, np.array([[none, -z, y], [z, none, -x], [-y, x, none]]).transpose(2, 0, 1), 0.0)
    # Each body in the frame of the one before, as it is at zero, and what the sine and the versine of its joint add.
    by_sine, by_versine = still @ cross, still @ cross @ cross
    sine, versine = jnp.sin(moved)[:, None], 1 - jnp.cos(moved)[:, None]
    mat = still + sine[..., None] * by_sine + versine[..., None] * by_versine
    slides = np.where(turns[..., 0], 0.0, _times(still, arm.axis))
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


def _product(one: jax.Array, other: jax.Array) -> jax.Array:
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
