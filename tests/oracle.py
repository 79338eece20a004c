"""What all oracles of models share: how far a written number may be from the compiled one.

Every tolerance is relative to the number itself (`mjx_arenas.scales`: of a vector, a quaternion or an inertia tensor its norm; of
what is left when places are subtracted, these places), and as large as the float32 operations that made it can round. There is no
absolute floor: what is 0 must be 0, unless two places cancel.
"""

import mujoco
import numpy as np
import worlds
from mujoco import mjx

from mjx_arenas import scales

EPS = 2.0**-24  # relative rounding of one float32 operation

# Float32 operations in a row that make a number, at most; each rounds by EPS.
_EXACT = ("geom_friction", "geom_margin", "pair_margin", "geom_matid")  # written as they are
_DIRECT = ("body_pos", "body_quat", "geom_", "site_", "qpos", "body_mass", "body_inertia", "dof_armature")
DIRECT = 24  # a sine or cosine (4), a turn of a sum of two products, sums of what a table and an object measure
FOLLOWING = 96  # of those, through poses of a chain of bodies, or sums over all bodies
FACTORED = 400  # through the Cholesky factor of a tree's inertia matrix and its inverse

# Leaves that may differ from the recompiled model's, each with the reason why it cannot matter.
MAY_DIFFER = {}
# Arrays of the tree's structure that may: shared by all worlds, as a fixed topology demands.
STRUCTURE_MAY_DIFFER = {
    "body_margin": "a bound of C MuJoCo's broad phase; a NumPy array, which neither implementation of MJX reads",
    "geom_sameframe": "a shortcut of C MuJoCo's kinematics; neither implementation of MJX reads it",
    "body_sameframe": "the same",
    "site_sameframe": "the same",
    "key_mpos": "no step reads it; data that starts in a keyframe has it (test_keyframes_that_leave_places_out)",
    "key_mquat": "the same",
    "eq_active0": "no step reads it; data starts with it (test_data_begin_there)",
    "_sizes": "counts of MjModel, of which no step reads any",
    "_impl.geom_rbound_hfield": "read for height fields only, on which put_model refuses sizes that vary",
    "key_qpos": "no step reads it; what starts in a keyframe has the compiled world's positions (test_keyframes_of_random_worlds)",
    "_impl.dof_length": "read where bodies may sleep only, which put_model refuses (test_sleeping_is_refused)",
    "_impl.tree_sleep_policy": "the same",
}


def operations(name: str) -> int:
    """How many operations made a field's numbers."""
    if name in _EXACT:
        return 0
    if name in ("actuator_acc0", "actuator_biasprm", "tendon_invweight0", "dof_invweight0", "body_invweight0"):
        return FACTORED
    return DIRECT if name.startswith(_DIRECT) else FOLLOWING


def allowed(model: mujoco.MjModel, name: str, want: np.ndarray) -> np.ndarray:
    """How far each number of a field may be off for rounding; `model` is the compiled one."""
    if want.dtype.kind != "f":
        return np.zeros(np.atleast_1d(want).shape)
    return operations(name) * EPS * scales.scale(model, name, np.atleast_1d(want).astype(float))


def off(model: mujoco.MjModel, name: str, got: np.ndarray, want: np.ndarray) -> np.ndarray:
    """Where numbers of a field are farther off than rounding explains; `model` is the compiled one."""
    name = name.removeprefix("_impl.")
    if want.dtype.kind != "f":
        return np.atleast_1d(got != want)
    got, want = np.atleast_1d(got).astype(float), np.atleast_1d(want).astype(float)
    if name == "body_invweight0":  # C's 0 is the square of what double precision rounds
        want = np.where(want <= 2.0**-104 * want.max(-1, keepdims=True), 0.0, want)
    with np.errstate(invalid="ignore"):
        return ~((np.abs(got - want) <= allowed(model, name, want)) | (got == want) | (np.isnan(got) & np.isnan(want)))


def from_compiled(got: mjx.Model, compiled: mujoco.MjModel) -> set[str]:
    """Names of the arrays in which a model differs by more than rounding from a compiled one, put on the same implementation."""
    return differing(compiled, worlds.leaves(got), worlds.leaves(mjx.put_model(compiled, impl=got.impl.value)))


def differing(model: mujoco.MjModel, got: dict, expected: dict) -> set[str]:
    """Names of the arrays that differ by more than rounding; `model` is the compiled one."""
    assert got.keys() == expected.keys()
    found = set()
    for name, want in expected.items():
        assert got[name].shape == want.shape, name
        if off(model, name, got[name], want).any():
            found.add(name)
    return found


def of_what_is_left(got: mjx.Model, full: mujoco.MjModel, compiled: mujoco.MjModel) -> tuple[set[str], set[str]]:
    """Names of the fields compared, and of those that differ by more than rounding, of the elements that a world lacks not.

    Args:
        got: of the world, with all elements.
        full: the compiled nominal arena.
        compiled: the world's model, without what is absent.
    """
    kinds, compared, found = _kept(full, compiled), set(), set()
    for field, value in worlds.leaves(got).items():
        ids = kinds.get(field.partition("_")[0])
        if field.startswith("stat."):
            want = np.asarray(getattr(compiled.stat, field[5:]))
            if field == "stat.meaninertia":  # MJX multiplies it by the number of degrees of freedom
                if not compiled.nv:  # nothing moves
                    continue
                value = value * full.nv / compiled.nv
        elif ids is not None and isinstance(want := getattr(compiled, field, None), np.ndarray):
            if want.dtype.kind != "f" or field in STRUCTURE_MAY_DIFFER:
                continue
            value = value[ids].reshape(want.shape)
        else:
            continue
        compared.add(field)
        if off(compiled, field, value, want.astype(value.dtype)).any():
            found.add(field)
    return compared, found


def _kept(full: mujoco.MjModel, compiled: mujoco.MjModel) -> dict[str, list[int]]:
    """By kind: where in the whole model the elements are that are left."""
    kinds = {"body": "nbody", "geom": "ngeom", "site": "nsite", "jnt": "njnt", "actuator": "nu"}
    ids = {
        kind: [getattr(full, kind)(getattr(compiled, kind)(i).name).id for i in range(getattr(compiled, count))]
        for kind, count in kinds.items()
    }
    dofs = np.diff(np.append(full.jnt_dofadr, full.nv))
    ids["dof"] = [full.jnt_dofadr[j] + k for j in ids["jnt"] for k in range(dofs[j])]
    numbers = np.diff(np.append(full.jnt_qposadr, full.nq))
    ids["qpos"] = ids["qpos0"] = [full.jnt_qposadr[j] + k for j in ids["jnt"] for k in range(numbers[j])]
    return ids


MUTATION = 0.003  # of a number, which must be noticed


def mutants(model: mujoco.MjModel, name: str, value: np.ndarray) -> np.ndarray:
    """The field with each element scaled by 1.003; an index is the next, and what is true is false.

    An element of a vector so near 0 that this is within what rounding explains, twice, is moved by 1e-4 of the vector's
    size. What `off` allows of an element depends on the expected numbers alone, so that all are mutants at once.
    """
    if value.dtype.kind == "b":
        return ~value
    if value.dtype.kind in "iu":
        return value + 1
    array = np.atleast_1d(value).astype(float)
    size = scales.scale(model, name, array)
    small = MUTATION * np.abs(array) <= 2 * operations(name) * EPS * size
    step = np.where(small, 1e-4 * np.where(size > 0, size, 1.0), MUTATION * array)
    return (array + step).reshape(value.shape).astype(value.dtype)
