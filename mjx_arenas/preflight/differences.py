"""How far the worlds of a model are from those that MuJoCo compiled (host)."""

from collections.abc import Mapping

import jax
import mujoco
import numpy as np
from mujoco import mjx
from mujoco.mjx._src.types import Impl

from mjx_arenas import scales
from mjx_arenas.keywords import with_known_arguments
from mjx_arenas.preflight.kept import Kept
from mjx_arenas.preflight.leaves import count, named_leaves, path_name
from mjx_arenas.problem import Told, problem
from mjx_arenas.rules import validation
from mjx_arenas.spec.comparing import NOT_READ

_NOT_READ = NOT_READ | {"_sizes", "names", "paths", "text_data", "ngravcomp"}  # the first: counts of `MjModel`
_SINGLE = 2.0**-20  # a few roundings of a number in single precision
_ROUNDED = 2.0**-52  # of a row's largest number: what double precision leaves of a difference that is 0


@with_known_arguments
def differences(model: mjx.Model, compiled: mujoco.MjModel | Mapping[int, mujoco.MjModel]) -> dict[str, float]:
    """Relative differences between the fields of a model and those that MuJoCo compiled.

    `mja.differences(batch.model, {i: arena.compile(batch.world(i)) for i in range(8)})` compares eight worlds of a batch with the compiler.
    Rounding in float32 gives differences of about 1e-7, and up to 2e-5 in inverse weights, because a matrix is factorized.

    A compiled model lacks what is absent in its world, including variants that are not chosen. The rest is compared by name: everything
    that describes an element, but not its position among the others. Lights, sensors and keyframes are compared only if none is missing.

    Args:
        model: model of one world, or of W worlds, with leaves (W, ...) where they vary.
        compiled: compiled model of the one world, or a dict of compiled models by the numbers of their worlds.

    Returns:
        For each field the largest difference of one of its numbers, largest first. Differences are relative to the number, or to the norm
            of a vector, a quaternion or an inertia tensor. `inf` means that an integer, an option, or a number that has to be 0 differs.
            Fields without a difference are left out, and so are fields that no step of MJX reads.

    Raises:
        TypeError: `model` is not an `mjx.Model`, or `compiled` not an `MjModel`.
        ValueError: a compiled model is of another arena or lacks what is there, or a world's number is out of range.
    """
    validation.check_type("model", model, mjx.Model, "an mjx.Model")
    twins = {0: compiled} if isinstance(compiled, mujoco.MjModel) else compiled
    many = "a mujoco.MjModel, or a dict of them by the numbers of worlds"
    validation.check_type("compiled", twins, Mapping, many)
    for world, twin in twins.items():
        validation.check_type(f"compiled[{world!r}]", twin, mujoco.MjModel, "a mujoco.MjModel")
    if not twins:
        raise validation.error([problem("compiled", "has", None, Told("an empty dict"), must="a model at least")])
    found: dict[str, float] = {}
    static, all_leaves = static_fields(model), named_leaves(model)
    for world, twin in twins.items():
        if isinstance(world, bool) or not isinstance(world, int | np.integer):
            raise validation.error([problem("compiled", "must", None, world, must="by the numbers of worlds")])
        put, of = mjx.put_model(twin, impl=model.impl.value), f": world {world}" if twins is compiled else ""
        wanted = {name: x for name, x in named_leaves(put).items() if name not in _NOT_READ}
        batched = [name for name, x in wanted.items() if all_leaves[name].ndim > x.ndim]
        _check_world(int(world), len(all_leaves[batched[0]]) if batched else 0, twins is compiled)
        got = {name: all_leaves[name][world] if name in batched else all_leaves[name] for name in wanted}
        pairs = {name: (got[name], x) for name, x in wanted.items()}
        constants = {name: (static[name], x) for name, x in static_fields(put).items()}
        if any(np.shape(x) != np.shape(y) for x, y in (*pairs.values(), *constants.values())):
            kept = Kept.of(model, put, got["geom_margin"], of)
            pairs, constants = kept.of_both(pairs), kept.of_both(constants)
        if model.impl == Impl.WARP or model.flg_gravcomp:  # which lets JAX read `body_gravcomp`, as Warp always does
            constants.pop("flg_gravcomp", None)
        found |= {name: np.inf for name, both in constants.items() if not np.array_equal(*both)}
        for name, both in pairs.items():
            off = _off(twin, name, *both)
            if off > 0:
                found[name] = max(found.get(name, 0.0), off)
    return dict(sorted(found.items(), key=lambda item: -item[1]))


def static_fields(model: mjx.Model) -> dict[str, np.ndarray]:
    """Arrays and options that are part of a model's structure, which all worlds share, and that steps read."""
    found = {}
    for prefix, node in (("", model), ("opt.", model.opt)):
        leaves = {path_name(path) for path, _ in jax.tree_util.tree_leaves_with_path(node)}
        for field in node.fields():
            value = getattr(node, field.name)
            plain = isinstance(value, np.ndarray | np.generic | int | float)
            if plain and field.name not in leaves and field.name not in _NOT_READ:
                found[prefix + field.name] = np.asarray(value)
    return found


def _check_world(world: int, n: int, by_number: bool) -> None:
    if by_number and n and world not in range(n):
        raise validation.error([problem("compiled", "no_such_world", None, world, count=count(n), most=n - 1)])
    if not by_number and n:
        raise validation.error([problem("compiled", "compiled_by_number", None, Told("one model"), n=n)])


def _off(twin: mujoco.MjModel, field: str, got: np.ndarray, want: np.ndarray) -> float:
    """The largest difference of a number, relative to the number that it belongs to."""
    if want.dtype.kind != "f":
        return np.inf if (got != want).any() else 0.0
    got, want = np.atleast_1d(got).astype(float), np.atleast_1d(want).astype(float)
    size = scales.scale(twin, field.removeprefix("_impl."), want)
    size = np.maximum(size, _ROUNDED * np.abs(want).max(-1, initial=0.0, keepdims=True))
    none = scales.nothing(twin, field.removeprefix("_impl."), _SINGLE)
    none = none if none.shape == want.shape else none.max(initial=0.0)  # of what is in both worlds
    same = (got == want) | (np.isnan(got) & np.isnan(want)) | (np.maximum(np.abs(got), np.abs(want)) <= none)
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(
            np.where(same, 0.0, np.nan_to_num(np.abs(got - want) / size, nan=np.inf, posinf=np.inf)).max(initial=0.0)
        )
