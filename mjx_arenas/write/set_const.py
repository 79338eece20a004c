"""`mj_setConst` for `mjx.Model`: the fields that follow from masses, sizes and poses at `qpos0`, traced and batched.

The formulas are those of `setFixed` and `set0` in MuJoCo's `engine_setconst.c`, and of what they call in
`engine_core_smooth.c`.
"""

import functools
from typing import cast

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas.bounds import geom_bounds
from mjx_arenas.keywords import with_known_arguments
from mjx_arenas.problem import Told, problem
from mjx_arenas.problems.messages import error
from mjx_arenas.rows import joined
from mjx_arenas.rules.validation import check_type
from mjx_arenas.terms.attributes.joints import JOINT_TRN
from mjx_arenas.write.actuators import moments
from mjx_arenas.write.equalities import eq_data
from mjx_arenas.write.inertia import inertia_of, reflected
from mjx_arenas.write.kinematics import kinematics
from mjx_arenas.write.references import reference_fields, subtree_mass
from mjx_arenas.write.statistics import statistic
from mjx_arenas.write.trees import GEOM_WRAP, SITE_TRN
from mjx_arenas.write.weights import weights_of

_TRN, _WRAP = mujoco.mjtTrn, mujoco.mjtWrap
_KNOWN = {
    "actuator_trntype": (_TRN, (*JOINT_TRN, *SITE_TRN, int(_TRN.mjTRN_TENDON), int(_TRN.mjTRN_BODY))),
    "wrap_type": (
        _WRAP,
        (*GEOM_WRAP, *(int(k) for k in (_WRAP.mjWRAP_JOINT, _WRAP.mjWRAP_SITE, _WRAP.mjWRAP_PULLEY))),
    ),
}


@with_known_arguments
def set_const(model: mjx.Model) -> mjx.Model:
    """Returns `model` with the fields that `mj_setConst` derives, as if it had been compiled with its other values.

    Call it after changes of `qpos0` or of masses, inertias, armatures, sizes, positions or orientations. It also works inside `jit` and
    `vmap`. It writes what C's `mj_setConst` writes: masses of subtrees, the inverse weights and inertias at `qpos0`, reference lengths and
    poses of tendons, cameras, lights and equalities, accelerations of actuators, and bounds of primitive geoms. As in MuJoCo 3, it also
    computes the statistics, which overwrite those that the MJCF gives.

    It does not replace the compiler. What only the compiler makes of an MJCF stays as it is:

    - Damping from a `dampratio`. The compiler reads a positive `dampratio` in `actuator_biasprm[2]`. It replaces it by the negative damping
      that the ratio means for the inertia at `qpos0`. The ratio is then gone: neither C's `mj_setConst` nor this function computes the
      damping again when masses change. Neither reads a ratio that is written there (C before MuJoCo 4.0 did).
    - Masses and inertias of geoms and meshes, frames of meshes, and lengths of springs and ranges of actuators.

    It does not change integers and the structure of the tree, which MJX shares between worlds. Nor does it change the fields of lights on
    `impl="jax"`, which neither reads them nor knows their bodies, or `actuator_armature`, which MJX does not simulate.

    As in C, a singular inertia matrix counts as one that resists with `mjMINVAL`: weights are 1e15, not infinite. In float32,
    anything below about 1e-12 of an inertia counts as zero.

    Gradients work, except through tendons that wrap around geoms. There they are NaN, as in MJX's own `support.wrap`.

    Raises:
        ValueError: the model is of many worlds, outside `jax.vmap`.
        NotImplementedError: for a model with flexes or, on Warp, ellipsoids in fluids; of an implementation other
            than "jax" and "warp"; or with a transmission or a tendon that MJX does not simulate.
    """
    _check(model)
    kin = kinematics(model)
    inertia = inertia_of(model, kin, None)
    tendon, factors = inertia.tendon, inertia.factors
    values = {
        "body_subtreemass": subtree_mass(model),
        **weights_of(model, kin, inertia)._asdict(),
        **geom_bounds(model),
        **reference_fields(model, kin),
    }
    if model.ntendon:
        values["tendon_length0"] = tendon.length
        values["tendon_invweight0"] = (joined([f.half_solve(tendon.moment) for f in factors], model.ntendon) ** 2).sum(
            1
        )
    if len(model.actuator_trntype):
        moment = moments(inertia.model, inertia.state, tendon)
        values["actuator_acc0"] = _lengths(joined([f.solve(moment) for f in factors], len(moment)))
    if model.neq:
        values["eq_data"] = eq_data(model, kin)

    stat = statistic(_replace(model, values))
    stat = stat._replace(meaninertia=stat.meaninertia + reflected(inertia).sum() / max(model.nv, 1))
    return _replace(model, values | {f"stat.{name}": value for name, value in stat._asdict().items()})


def _lengths(rows: jax.Array) -> jax.Array:
    """Lengths (n,) of rows (n, k), whose squares may be beyond float32."""
    scale = jax.lax.stop_gradient(jnp.abs(rows).max(1, initial=0.0))
    scale = jnp.where(scale > 0, scale, 1.0)
    square = ((rows / scale[:, None]) ** 2).sum(1)
    return jnp.where(square == 0, 0.0, jnp.sqrt(jnp.where(square == 0, 1.0, square))) * scale


def _check(model: mjx.Model) -> None:
    """Refuses what cannot be derived."""
    check_type("model", model, mjx.Model, "an mjx.Model (of an MjModel: mujoco.mj_setConst)")
    if model.impl.value not in ("jax", "warp"):
        raise error([problem("model.impl", "set_const_impl", None, model.impl.value)], kind=NotImplementedError)
    if many := _batched(model):
        raise error([problem("model", "set_const_one", None, Told(many))])
    if model.nflex:
        raise error([problem("model.nflex", "set_const_flexes", None, model.nflex)], kind=NotImplementedError)
    if model.impl.value == "warp" and np.asarray(model.geom_fluid).reshape(model.ngeom, mujoco.mjNFLUID)[:, :1].any():
        raise error([problem("model.geom_fluid", "set_const_fluid")], kind=NotImplementedError)
    for name, (enum, known) in _KNOWN.items():
        for kind in set(np.asarray(getattr(model, name)).tolist()) - set(known):
            raise error(
                [problem(f"model.{name}", "set_const_kind", None, Told(enum(kind).name), field=name)],
                kind=NotImplementedError,
            )


@functools.cache
def _axes() -> dict[str, int]:
    """How many axes each field of numbers has in the model of one world, but those to which MJX gives others."""
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    others = ("cam_mat0", "geom_aabb", "key_mpos", "key_mquat")
    fields = {name: getattr(model, name) for name in dir(model) if not name.startswith("_") and name not in others}
    return {name: x.ndim for name, x in fields.items() if isinstance(x, np.ndarray) and x.dtype.kind == "f"}


def _batched(model: mjx.Model) -> str:
    """The first field that has an axis of worlds, or ""."""
    own, axes = vars(model), _axes()
    return next((f"`{name}`" for name in sorted(own) if name in axes and np.ndim(own[name]) > axes[name]), "")


def _replace(model: mjx.Model, values: dict[str, jax.Array]) -> mjx.Model:
    """`model` with these fields, in its own shapes and dtypes."""

    def like(name: str, value: jax.Array) -> jax.Array:
        old = getattr(model.stat, name[5:]) if name.startswith("stat.") else getattr(model, name)
        return value.reshape(old.shape).astype(old.dtype)

    return cast(mjx.Model, model.tree_replace({name: like(name, value) for name, value in values.items()}))
