"""World poses of bodies and joints at `qpos0`: `mj_kinematics1` in MuJoCo's `engine_core_smooth.c`."""

from typing import NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas.quaternions import normalize, quat_mul, quat_rotate, quat_to_mat
from mjx_arenas.rows import replace_rows, take

Poses: TypeAlias = tuple[jax.Array, jax.Array]  # positions (n, 3) and orientations (n, 4)
FREE, BALL, SLIDE, HINGE = (int(mujoco.mjtJoint(kind)) for kind in range(4))


class Kinematics(NamedTuple):
    """World poses of bodies and joints."""

    pos: jax.Array  # (nbody, 3)
    quat: jax.Array  # (nbody, 4)
    anchor: jax.Array  # (njnt, 3)
    axis: jax.Array  # (njnt, 3) unit vectors; without meaning for free and ball joints

    def place(self, body: np.ndarray, local: jax.Array) -> jax.Array:
        """World positions (n, 3) of points (n, 3) in the frames of `body` (n,)."""
        return take(self.pos, body) + quat_rotate(take(self.quat, body), local)

    def frame(self, body: np.ndarray, local: jax.Array) -> jax.Array:
        """World orientations (n, 3, 3) of quaternions (n, 4) in the frames of `body` (n,)."""
        return quat_to_mat(quat_mul(take(self.quat, body), local))


class Alike(NamedTuple):
    """What several worlds have in common."""

    template: mjx.Model
    other: np.ndarray  # (nbody,) bool: the body may stand otherwise in its parent's frame than in the template


def kinematics(model: mjx.Model, compiled: bool = False, alike: Alike | None = None) -> Kinematics:
    """World poses at `qpos0`, where no hinge and no slide displaces its body.

    With `compiled`, free bodies start where `body_pos` and `body_quat` have them, as MuJoCo's compiler makes it. How bodies
    stand to each other in what is `alike` is computed once for all worlds.
    """
    kinds, joint_body, adr = (np.asarray(a) for a in (model.jnt_type, model.jnt_bodyid, model.jnt_qposadr))
    parent = np.asarray(model.body_parentid)
    free, ball = np.flatnonzero(kinds == FREE), np.flatnonzero(kinds == BALL)
    pos, quat = model.body_pos, model.body_quat  # in the frame of the body's parent
    if len(free) and not compiled:
        pose = take(model.qpos0, (adr[free][:, None] + np.arange(7)).reshape(-1)).reshape(-1, 7)
        pos = replace_rows(pos, joint_body[free], pose[:, :3])
        quat = replace_rows(quat, joint_body[free], normalize(pose[:, 3:]))
    straight = pos, quat  # as if no ball joint were turned
    if len(ball):
        body, arm = joint_body[ball], take(model.jnt_pos, ball)
        turned = quat_mul(take(quat, body), normalize(take(model.qpos0, adr[ball][:, None] + np.arange(4))))
        away = quat_rotate(take(quat, body), arm) - quat_rotate(turned, arm)
        pos, quat = replace_rows(pos, body, take(pos, body) + away), replace_rows(quat, body, turned)
    if alike is not None:
        alike = alike._replace(other=alike.other | np.isin(np.arange(model.nbody), joint_body[np.union1d(free, ball)]))
    pos, quat = _in_world(pos, quat, parent, alike)
    # From the body, not its parent: on a joint at its origin, what is at its origin then stands exactly.
    on = _of((pos, quat), joint_body)
    if len(ball):  # what stands before a ball joint does not turn with it
        turning = np.zeros(model.nbody, int)
        turning[joint_body[ball]] = ball
        before = _joined(_of((pos, quat), parent[joint_body]), _of(straight, joint_body))
        early = (np.arange(model.njnt) < turning[joint_body])[:, None]
        on = jnp.where(early, before[0], on[0]), jnp.where(early, before[1], on[1])
    return Kinematics(pos, quat, on[0] + quat_rotate(on[1], model.jnt_pos), quat_rotate(on[1], model.jnt_axis))


def _in_world(pos: jax.Array, quat: jax.Array, parent: np.ndarray, alike: Alike | None) -> Poses:
    """World poses (nbody, 3), (nbody, 4) of bodies from those in their parents' frames."""
    deep = parent > 0
    if alike is None or not deep.any():
        return _along((pos, quat), parent)
    other, n = np.union1d(0, np.flatnonzero(alike.other)), len(parent)
    carrier = np.zeros(n, int)  # the next such body on the way to the world, or the body itself
    for body in range(1, n):
        carrier[body] = body if alike.other[body] else carrier[parent[body]]
    here, carried = np.isin(np.arange(n), other), np.searchsorted(other, carrier)
    same_pos = jnp.where(here[:, None], np.zeros((n, 3)), alike.template.body_pos)
    same_quat = jnp.where(here[:, None], np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)), alike.template.body_quat)
    same = _along((same_pos, same_quat), np.where(here, 0, parent))  # in the frames of their carriers
    bases, base = _of((pos, quat), other), parent[other]
    if base.any():
        bases = _along(_joined(_of(same, base), bases), carried[base])
    hung, moved = np.flatnonzero(deep & ~here), np.flatnonzero(base)
    poses = _joined(_of(bases, carried[hung]), _of(same, hung))
    ids = np.concatenate([other[moved], hung])

    def placed(own: jax.Array, base: jax.Array, new: jax.Array) -> jax.Array:
        return replace_rows(own, ids, jnp.concatenate([take(base, moved), new]) if len(moved) else new)

    return placed(pos, bases[0], poses[0]), placed(quat, bases[1], poses[1])


def _along(poses: Poses, parent: np.ndarray) -> Poses:
    """Poses (n, 3), (n, 4) in the frame of row 0, from those in the frames of the rows `parent` (n,).

    Each round joins every row with the row that it now hangs on, so that there are as many as the depth has binary digits. Each offset
    is turned once, by its parent's orientation in the frame of row 0, and then they are added.
    """
    if not parent.any():
        return poses
    pos, quat = poses
    over = [parent]
    while over[-1].any():
        quat = quat_mul(take(quat, over[-1]), quat)
        over.append(over[-1][over[-1]])
    pos = quat_rotate(take(quat, parent), pos)
    for above in over[:-1]:
        pos = take(pos, above) + pos
    return pos, quat


def _joined(above: Poses, own: Poses) -> Poses:
    """Poses (n, 3), (n, 4) `own` in the frames `above`, in the frame in which these stand."""
    return above[0] + quat_rotate(above[1], own[0]), quat_mul(above[1], own[1])


def _of(poses: Poses, ids: np.ndarray) -> Poses:
    return take(poses[0], ids), take(poses[1], ids)


def static_poses(model: mjx.Model, ids: np.ndarray) -> Poses:
    """World positions (n, 3) and orientations (n, 4) of bodies `ids` (n,) that no joint moves, and none above them."""
    parent = np.asarray(model.body_parentid)
    needed = np.union1d(0, ids)  # with all that they hang on
    while not np.isin(parent[needed], needed).all():
        needed = np.union1d(needed, parent[needed])
    poses = _along(_of((model.body_pos, model.body_quat), needed), np.searchsorted(needed, parent[needed]))
    return _of(poses, np.searchsorted(needed, ids))
