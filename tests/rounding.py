"""How far a constant derived in float32 may be from the one that C derives in double: relative to the number itself.

k roundings of random sign add up to less than 4 sqrt(k) of one. A number from the end of a chain of bodies, summed over
all of them, has seen `OPERATIONS` of each body in the chain, and one of each body and degree of freedom in the sum:
`error`, relative to the number, or to the norm of the vector, quaternion or tensor that it is part of. What is left when
positions are subtracted is off by `error` times the positions: that of a lever by `error` times its body's `reach`.

The inertia matrix M of a tree is G'G. A column of G is off by `error` times its norm, the root of M's diagonal, and
by that of the levers times the root of the mass. Then x inv(M) x' is off by 2 (dG y)'(G y) + 2 dx y,
where y = inv(M) x' and x itself is off by dx. The length of y is off by u (dG'G + G'dG) y + u dx, where u = inv(M) y / |y|.
"""

import functools

import mujoco
import numpy as np

EPS = 2.0**-24  # relative rounding of one float32 operation
OPERATIONS = 20  # roundings on the way of a number through one body of a tree, at most


def norm(x):
    return np.linalg.norm(x, axis=-1)


class Rounding:
    """Tolerances of what C derived in `m`, with `d` at `qpos0`."""

    def __init__(self, m, d):
        self.m, self.d = m, d
        depth, above = np.zeros(m.nbody, int), m.body_parentid
        for b in range(1, m.nbody):
            depth[b] = depth[above[b]] + 1
        self.error = 4 * np.sqrt(OPERATIONS * (depth.max() + 1) + m.nbody + m.nv) * EPS
        self.chain = 4 * np.sqrt(OPERATIONS * (depth + 1)) * EPS  # of the pose of each body
        self.reach = np.maximum(norm(d.xpos), norm(d.xipos))
        points = ((m.geom_bodyid, d.geom_xpos), (m.site_bodyid, d.site_xpos), (m.jnt_bodyid, d.xanchor))
        for owner, place in (*points, (m.cam_bodyid, d.cam_xpos), (m.light_bodyid, d.light_xpos)):
            np.maximum.at(self.reach, owner, norm(place))
        for b in range(1, m.nbody):
            self.reach[b] = max(self.reach[b], self.reach[above[b]])
        kind, index = m.jnt_type[m.dof_jntid], np.arange(m.nv) - m.jnt_dofadr[m.dof_jntid]
        slides = (kind == mujoco.mjtJoint.mjJNT_SLIDE) | ((kind == mujoco.mjtJoint.mjJNT_FREE) & (index < 3))
        self.turns = ~slides
        self.far = np.array([self.reach[m.body_treeid == tree].max() for tree in m.dof_treeid])  # (nv,)

    @functools.cached_property
    def inverse(self):
        """Inverse of M."""
        inverse = np.zeros((self.m.nv, self.m.nv))
        mujoco.mj_solveM(self.m, self.d, inverse, np.eye(self.m.nv))
        return inverse

    @functools.cached_property
    def column(self):
        """(nv,) errors of the columns of G."""
        size = np.sqrt(np.linalg.inv(self.inverse).diagonal()) if self.m.nv else np.zeros(0)
        mass = np.sqrt(self.m.body_subtreemass[self.m.dof_bodyid])
        return self.error * (size + self.turns * self.far * mass)

    def in_metric(self, x, dx):
        """Errors (...) of x inv(M) x', x (..., nv)."""
        y = x @ self.inverse
        return 2 * np.sqrt((x * y).sum(-1)) * norm(self.column * y) + 2 * norm(y * dx)

    def solved(self, x, dx):
        """Errors (...) of the length of inv(M) x', x (..., nv)."""
        y = x @ self.inverse
        unit = y / np.maximum(norm(y), 1e-300)[..., None]
        u = unit @ self.inverse
        root_y, root_u = np.sqrt((x * y).sum(-1)), np.sqrt((unit * u).sum(-1))
        return norm(self.column * u) * root_y + root_u * norm(self.column * y) + norm(u * dx)

    def bends(self):
        """(ntendon,) reach of the ends of tendons over the shortest pieces: by so much more directions are off."""
        m, d = self.m, self.d
        bends, points, owner = np.zeros(m.ntendon), d.wrap_xpos.reshape(-1, 3), d.wrap_obj.reshape(-1)
        for tendon, (adr, num) in enumerate(zip(d.ten_wrapadr, d.ten_wrapnum, strict=True)):
            for i in range(adr, adr + num - 1):
                if owner[i] > -2 and owner[i + 1] > -2 and not owner[i] == owner[i + 1] >= 0:  # no pulley, no arc
                    far = norm(points[i]) + norm(points[i + 1])
                    bends[tendon] = max(bends[tendon], far / norm(points[i] - points[i + 1]))
        return bends

    def weights(self):
        """Tolerances of inertias and inverse weights."""
        m, d = self.m, self.d
        body = np.zeros((m.nbody, 2, 3, m.nv))
        for b in range(m.nbody):
            mujoco.mj_jacBodyCom(m, d, body[b, 0], body[b, 1], b)
        tendon, moment = np.zeros((m.ntendon, m.nv)), np.zeros((m.nu, m.nv))
        if m.ntendon:
            mujoco.mju_sparse2dense(tendon, d.ten_J.reshape(-1), m.ten_J_rownnz, m.ten_J_rowadr, m.ten_J_colind)
        if m.nu:
            mujoco.mju_sparse2dense(moment, d.actuator_moment, d.moment_rownnz, d.moment_rowadr, d.moment_colind)
        lever = self.error * np.where(self.turns, self.far, 1)
        of_tendon = self.error * (np.where(self.turns, self.far, 1) * (1 + self.bends()[:, None])) * (tendon != 0)
        gear = np.abs(m.actuator_gear).max(1, initial=0)[:, None]
        pull = gear * lever * (moment != 0)
        through = np.flatnonzero(m.actuator_trntype == mujoco.mjtTrn.mjTRN_TENDON)
        pull[through] = gear[through] * of_tendon[m.actuator_trnid[through, 0]]
        mass = m.body_subtreemass[m.dof_bodyid]
        inertia = self.error * (m.dof_M0 + 2 * self.turns * self.far * np.sqrt(mass * m.dof_M0))
        single = self.in_metric(np.eye(m.nv), np.zeros(m.nv))
        axes = 2 * m.dof_jntid + self.turns  # of one joint, translation or rotation
        reflected = 2 * (m.tendon_armature @ (np.abs(tendon) * of_tendon)).sum() / max(m.nv, 1)
        return {
            "body_subtreemass": self.error * m.body_subtreemass,
            "dof_M0": inertia,
            "stat.meaninertia": inertia.mean() + reflected if m.nv else 0.0,
            "dof_invweight0": np.array([single[axes == a].mean() for a in axes]),
            "body_invweight0": self.in_metric(body, np.stack([lever * self.turns, 0 * lever])[None, :, None]).mean(2),
            "tendon_invweight0": self.in_metric(tendon, of_tendon),
            "actuator_acc0": self.solved(moment, pull),
        }

    def places(self):
        """Tolerances of lengths, reference poses and bounds."""
        m, d, error, reach = self.m, self.d, self.error, self.reach
        target = [
            np.where(t >= 0, t, b)
            for t, b in ((m.cam_targetbodyid, m.cam_bodyid), (m.light_targetbodyid, m.light_bodyid))
        ]
        com = [
            self.chain[body] * norm(place) + error * norm(d.subtree_com[t])
            for body, place, t in zip((m.cam_bodyid, m.light_bodyid), (d.cam_xpos, d.light_xpos), target, strict=True)
        ]
        ends = np.zeros(m.ntendon)
        for tendon, (adr, num) in enumerate(zip(m.tendon_adr, m.tendon_num, strict=True)):
            for wrap in range(adr, adr + num):
                if m.wrap_type[wrap] == mujoco.mjtWrap.mjWRAP_JOINT:
                    ends[tendon] += abs(m.wrap_prm[wrap] * m.qpos0[m.jnt_qposadr[m.wrap_objid[wrap]]])
                elif m.wrap_type[wrap] == mujoco.mjtWrap.mjWRAP_SITE:
                    ends[tendon] += 2 * reach[m.site_bodyid[m.wrap_objid[wrap]]]
        pair = np.zeros(m.neq)
        bodies = np.flatnonzero(m.eq_objtype == mujoco.mjtObj.mjOBJ_BODY)
        pair[bodies] = reach[m.eq_obj1id[bodies]] + reach[m.eq_obj2id[bodies]]
        anchors = np.abs(m.eq_data) * error + (error * (pair + norm(m.eq_data[:, :3])))[:, None] * (
            np.arange(m.eq_data.shape[1]) < 6
        )
        anchors[:, 6:10] = error * norm(m.eq_data[:, 6:10])[:, None]
        bounds = np.abs(m.geom_aabb.reshape(-1, 2, 3))
        return {
            "tendon_length0": error * ends,
            "geom_rbound": error * m.geom_rbound,
            "geom_aabb": error * np.broadcast_to(norm(bounds)[..., None], bounds.shape),
            "eq_data": anchors,
            "cam_pos0": error * norm(m.cam_pos0)[:, None],
            "cam_poscom0": com[0][:, None],
            "cam_mat0": error * np.sqrt(3),
            "light_pos0": error * norm(m.light_pos0)[:, None],
            "light_poscom0": com[1][:, None],
            "light_dir0": error,
        }

    def statistics(self, stat):
        """Tolerances of statistics: of a mean, those of what it is taken over; of the box, those of its corners."""
        far = np.abs(stat.center).max() + stat.extent
        return {
            "stat.center": self.error * far,
            "stat.extent": self.error * far,
            "stat.meansize": self.error * (stat.meansize + self.reach[1:].mean()),
            "stat.meanmass": self.error * stat.meanmass,
        }
