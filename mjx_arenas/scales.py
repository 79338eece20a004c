"""How large the number is that an element of a model belongs to: what a relative error is relative to (host).

A quaternion, a vector and the moments of an inertia tensor are one number each, whose elements share its norm: rounding turns
a vector, it does not know the axes. What is left when places are subtracted is relative to these places. Everything else is a
number of its own.
"""

from typing import NamedTuple

import mujoco
import numpy as np

_VECTORS = frozenset(
    (
        *("body_pos", "body_quat", "body_ipos", "body_iquat", "body_inertia", "geom_pos", "geom_quat", "geom_size"),
        *(
            "site_pos",
            "site_quat",
            "cam_pos",
            "cam_quat",
            "cam_pos0",
            "light_pos",
            "light_dir",
            "light_pos0",
            "light_dir0",
        ),
        *("jnt_pos", "jnt_axis", "eq_data", "flex_size"),
    )
)


def scale(model: mujoco.MjModel, field: str, values: np.ndarray) -> np.ndarray:
    """The size of the number that each element belongs to, in the shape of `values`.

    Args:
        model: compiled; says what the entries of `qpos0` are, and where everything is there.
        field: of `mjx.Model`, `stat.` before the name of a statistic.
        values: of that field, in MuJoCo's own shape.
    """
    values = np.abs(np.asarray(values, float))
    if field in ("qpos0", "qpos_spring"):
        return _of_positions(model, values)
    if field in ("cam_poscom0", "light_poscom0"):
        return np.broadcast_to(_seen(model, field.partition("_")[0])[:, None], values.shape)
    if field == "stat.center":
        middle, size = _middle(model)
        made = (np.abs(model.stat.center - middle) <= _DOUBLE * size).all()
        return size if made else _norms(values)  # the MJCF may give another
    if field == "geom_aabb":
        boxes = values.reshape(-1, 2, 3)
        return np.broadcast_to(_norms(boxes).max(1, keepdims=True), boxes.shape).reshape(values.shape)
    if field in ("cam_mat0", "flex_vert0"):  # shares of the extents of a flex
        return np.ones_like(values)
    return _norms(values) if field in _VECTORS else values


def nothing(model: mujoco.MjModel, field: str, rounding: float) -> np.ndarray:
    """The most that rounding leaves of numbers of a field that are 0, in its shape: inverse weights of tendons that no joint makes longer.

    Of a tendon between places it is the square of what is left when these are subtracted, by the largest inverse inertia of the joints
    that move them. Fixed tendons have their coefficients, and nothing is left of others.

    Args:
        model: compiled.
        field: of `mjx.Model`.
        rounding: of a number, relative to itself.
    """
    if field != "tendon_invweight0":
        return np.zeros(())
    moves = np.zeros(model.nbody)
    for body in range(1, model.nbody):
        first, n = model.body_dofadr[body], model.body_dofnum[body]
        own = model.dof_invweight0[first : first + n].max(initial=0.0) if n else 0.0
        moves[body] = max(moves[model.body_parentid[body]], own)
    found = np.zeros(model.ntendon)
    for tendon, (first, n) in enumerate(zip(model.tendon_adr, model.tendon_num, strict=True)):
        kinds, ids = model.wrap_type[first : first + n], model.wrap_objid[first : first + n]
        sites, geoms = ids[kinds == _WRAP.mjWRAP_SITE], ids[np.isin(kinds, _ROUND)]
        found[tendon] = moves[np.append(model.site_bodyid[sites], model.geom_bodyid[geoms])].max(initial=0.0)
    return rounding**2 * (1 + model.stat.extent**2) * found


_WRAP = mujoco.mjtWrap
_ROUND = (int(_WRAP.mjWRAP_SPHERE), int(_WRAP.mjWRAP_CYLINDER))
_DOUBLE = 1e-9  # of rounding in double precision, far more than there is


class _Places(NamedTuple):
    """Where bodies are at `qpos0`, and how large the numbers are that say so: the places of all that they hang on."""

    data: mujoco.MjData
    far: np.ndarray  # (nbody,) [m]

    @classmethod
    def of(cls, model: mujoco.MjModel) -> "_Places":
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        far = np.linalg.norm(data.xpos, axis=1)
        for body in range(1, model.nbody):
            far[body] = max(far[body], far[model.body_parentid[body]])
        return cls(data, far)

    def on(self, body: np.ndarray, local: np.ndarray) -> np.ndarray:
        """(n,) of places (n, 3) in the frames of bodies (n,)."""
        return self.far[body] + np.linalg.norm(local, axis=1)


def _seen(model: mujoco.MjModel, kind: str) -> np.ndarray:
    """(n,) how large the two places are between which cameras or lights measure: their own, and a centre of mass."""
    places = _Places.of(model)
    body, target, local = (getattr(model, f"{kind}_{name}") for name in ("bodyid", "targetbodyid", "pos"))
    mass = model.body_mass.copy()
    moment = mass * places.on(np.arange(model.nbody), model.body_ipos)
    for i in range(model.nbody - 1, 0, -1):
        for x in (mass, moment):
            x[model.body_parentid[i]] += x[i]
    com = np.divide(moment, mass, out=places.far.copy(), where=mass > 0)  # without mass it is at the body
    return places.on(body, local) + com[np.where(target >= 0, target, body)]


def _middle(model: mujoco.MjModel) -> tuple[np.ndarray, np.ndarray]:
    """(3,) the middle of the box around everything, and how large the numbers are of which its corners are made."""
    places = _Places.of(model)
    data, body, turning = places.data, np.arange(1, model.nbody), model.jnt_type != mujoco.mjtJoint.mjJNT_FREE
    joint = model.jnt_bodyid[turning]
    reach, flat = model.geom_rbound.copy(), model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
    wide = model.geom_size[flat, :2].max(1, initial=0.0)
    reach[flat] = np.where(wide > 0, 0.1 * wide, 0.01)  # as it is drawn
    spheres = (
        (data.xpos[1:], places.far[1:], 0.0),
        (data.xipos[1:], places.on(body, model.body_ipos[1:]), 0.0),
        (data.xanchor[turning], places.on(joint, model.jnt_pos[turning]), 0.0),
        (data.site_xpos, places.on(model.site_bodyid, model.site_pos), 0.0),
        (data.geom_xpos, places.on(model.geom_bodyid, model.geom_pos) + reach, reach),
    )
    middle, far = (np.concatenate([one[i] for one in spheres]) for i in (0, 1))
    radius = np.concatenate([np.broadcast_to(one[2], len(one[0])) for one in spheres])[:, None]
    if not len(middle):
        return np.zeros(3), np.zeros(3)
    low, high = middle - radius, middle + radius
    ends = [np.where(x == x_end, far[:, None], 0.0).max(0) for x, x_end in ((low, low.min(0)), (high, high.max(0)))]
    return (low.min(0) + high.max(0)) / 2, (ends[0] + ends[1]) / 2


def _norms(values: np.ndarray) -> np.ndarray:
    return np.broadcast_to(np.linalg.norm(values, axis=-1, keepdims=True), values.shape)


def _of_positions(model: mujoco.MjModel, values: np.ndarray) -> np.ndarray:
    """The scales of entries of `qpos`: of places and turns of free joints, of turns of ball joints, and of each hinge and slide alone."""
    found = values.copy()
    for kind, adr in zip(model.jnt_type, model.jnt_qposadr, strict=True):
        if kind == mujoco.mjtJoint.mjJNT_FREE:
            found[adr : adr + 3] = np.linalg.norm(values[adr : adr + 3])
            found[adr + 3 : adr + 7] = np.linalg.norm(values[adr + 3 : adr + 7])
        elif kind == mujoco.mjtJoint.mjJNT_BALL:
            found[adr : adr + 4] = np.linalg.norm(values[adr : adr + 4])
    return found
