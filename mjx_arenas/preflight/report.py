"""What is wrong with a randomized model, by field, before `jax.vmap` fails over it or MJX simulates something else (host).

W worlds. Leaves of models go by their names in `mjx.Model`, with dots (`opt.gravity`).
"""

import dataclasses
import functools
import operator
from collections.abc import Iterator, Mapping
from typing import Any

import jax
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas.keywords import with_known_arguments
from mjx_arenas.preflight.leaves import Leaves, Variation, about, count, listed, path_name
from mjx_arenas.preflight.rules import NOTES, PROBLEMS
from mjx_arenas.problem import Told, problem
from mjx_arenas.rules import validation
from mjx_arenas.viz.table import columns


@dataclasses.dataclass(frozen=True)
class RandomizationReport:
    """Report of `check_randomization`; `print` it."""

    n_worlds: int
    """Number of worlds W; 0 if nothing is batched."""
    varies: Mapping[str, Variation]
    """The variation of each batched field: how many numbers vary over the worlds, and which one varies most, between which values."""
    problems: tuple[str, ...]
    """Problems, one sentence each."""
    notes: tuple[str, ...]
    """Notes on what is right only under a condition that the model does not show, and on what may not be intended."""

    @property
    def ok(self) -> bool:
        """Whether there are no problems."""
        return not self.problems

    def __str__(self) -> str:
        lines = [f"{count(self.n_worlds)}, {len(self.problems) or 'no'} problem{'s' * (len(self.problems) != 1)}"]
        if self.varies:
            rows = [("field", "shape", "vary", "most", "from", "to")]
            rows += [
                (n, str(v.shape), str(v.n_numbers), v.number, f"{v.low:.6g}", f"{v.high:.6g}")
                for n, v in self.varies.items()
            ]
            lines.append(columns(rows))
        for title, sentences in (("problems", self.problems), ("notes", self.notes)):
            if sentences:
                lines += [f"{title}:", *(f"- {sentence}" for sentence in sentences)]
        return "\n".join(lines)


@with_known_arguments
def check_randomization(model: mjx.Model, model_v: mjx.Model, in_axes: Any, env: Any = None) -> RandomizationReport:
    """Checks the output of a randomizer, of this library or of any other.

    It copies the batched leaves to the host: give it some hundred worlds, not a million. A bad randomizer gives a report; it does not
    raise.

    Args:
        model: template, the model of one world that the randomizer was given.
        model_v: model that it returned.
        in_axes: tree that it returned.
        env: environment whose attributes are searched for copies of fields that vary, which would stay the template's. For an `ArenaEnv`,
            fields that the environment writes itself, whatever the randomizer returns there, are reported as well.

    Raises:
        TypeError: a model is not an `mjx.Model`, or is the tree of axes.
        ValueError: `model` is batched itself.
    """
    for name, given in (("model", model), ("model_v", model_v)):
        validation.check_type(name, given, mjx.Model, "an mjx.Model")
    if not hasattr(model_v.body_pos, "shape"):
        raise validation.error([problem("model_v", "model_swapped", None, Told("the tree of axes"))], kind=TypeError)
    if model.body_pos.ndim != 2:
        told = {
            "of": f"`body_pos` of shape {model.body_pos.shape}",
            "instead": "give the model before it was randomized",
        }
        raise validation.error([problem("model", "one_world", None, None, told)])
    problems = _static_problems(model, model_v)
    worlds, more = Leaves.of(model, model_v)
    problems += more + _axes_problems(model_v, in_axes, worlds)
    if not worlds.n:
        problems.append("Nothing is batched: all worlds are the model that was given.")
        return RandomizationReport(0, {}, tuple(problems), ())
    problems += [sentence for check in PROBLEMS for sentence in check(model, worlds)]
    notes = [sentence for check in NOTES for sentence in check(model, worlds)]
    if env is not None:
        while "env" in vars(env):  # a wrapper
            env = env.env
        overruled, in_part = _overruled(env, model, worlds)
        problems += overruled
        notes += in_part + _cached(env, model, worlds)
    return RandomizationReport(worlds.n, worlds.varies(model), tuple(problems), tuple(notes))


def _overruled(env: Any, model: mjx.Model, worlds: Leaves) -> tuple[list[str], list[str]]:
    """What an environment with arenas of its own writes over: all that varies in a field (a problem), or some (a note)."""
    if not hasattr(env, "arena_fields"):
        return [], []
    write = jax.jit(env.arena_fields)
    written = functools.cache(lambda world: write(worlds.model(model, world)))
    lost, partly = [], []
    for name, nominal in write(model).items():
        changed = worlds.changed(name).reshape(worlds.n, -1)
        if changed.any():
            world = int(changed.sum(1).argmax())
            kept = (np.asarray(written(world)[name]) != np.asarray(nominal)).reshape(-1)[changed[world]]
            if not kept.all():
                (partly if kept.any() else lost).append(name)
    own = "`env` draws arenas of its own and writes"
    problem = [about(lost, f"has no effect: {own} it itself.", f"have no effect: {own} them itself.")]
    rest = f"effect in part: {own} the rest itself."
    note = [about(partly, f"has an {rest}", f"have an {rest}")]
    return problem if lost else [], note if partly else []


def _cached(env: Any, model: mjx.Model, worlds: Leaves) -> list[str]:
    """Arrays that an environment keeps, equal to a field of the template that varies, or to a row of it."""
    fields = {name: np.asarray(operator.attrgetter(name)(model)) for name in worlds.batched}
    found = []
    for attribute, value in vars(env).items():
        if isinstance(value, (mjx.Model, mujoco.MjModel)):
            continue
        for leaf in jax.tree.leaves(value):
            if not isinstance(leaf, (np.ndarray, jax.Array)) or leaf.size < 2 or leaf.dtype.kind != "f":
                continue
            name = next((name for name, field in fields.items() if _holds(field, np.asarray(leaf))), None)
            if name is not None:
                found.append(
                    f"`env.{attribute}` holds numbers of the template's `{name}`, which varies: if `reset` or `step` use them, they "
                    f"must read `self._mjx_model.{name}` there instead."
                )
    return list(dict.fromkeys(found))


def _holds(field: np.ndarray, array: np.ndarray) -> bool:
    """Whether an array is a field, or a row of it, and not just zeros."""
    rows = field[None] if array.shape == field.shape else field
    if rows.shape[1:] != array.shape or not np.any(array):
        return False
    return bool((array.astype(rows.dtype) == rows).all(axis=tuple(range(1, rows.ndim))).any())


def _statics(node: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """What is part of the structure of a model, by name, and not a leaf."""
    traced = {path[0].name for path, _ in jax.tree_util.tree_leaves_with_path(node) if hasattr(path[0], "name")}
    for field in dataclasses.fields(node):
        value = getattr(node, field.name)
        if dataclasses.is_dataclass(value) and hasattr(value, "tree_replace"):
            yield from _statics(value, f"{prefix}{field.name}.")
        elif field.name not in traced:
            yield prefix + field.name, value


def _differing(a: mjx.Model, b: mjx.Model) -> list[str]:
    """Names of the static fields in which two models differ."""
    other = dict(_statics(b))
    return [name for name, value in _statics(a) if name not in other or not _equal(value, other[name])]


def _equal(a: Any, b: Any) -> bool:
    if isinstance(a, tuple) and isinstance(b, tuple):
        return len(a) == len(b) and all(_equal(x, y) for x, y in zip(a, b, strict=True))
    if hasattr(a, "shape") or hasattr(b, "shape"):
        a, b = np.asarray(a), np.asarray(b)
        return a.shape == b.shape and np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
    return bool(a == b)


def _static_problems(model: mjx.Model, model_v: mjx.Model) -> list[str]:
    """Fields that MJX shares between worlds, and that the randomizer has changed."""
    if model.impl != model_v.impl:
        return [f"`model_v` is of impl {model_v.impl.value!r}, `model` of {model.impl.value!r}."]
    static = "static in MJX: all worlds share"
    one = f"differs from the template's, but is {static} it; change the model before put_model."
    many = f"differ from the template's, but are {static} them; change the model before put_model."
    names = _differing(model, model_v)
    return [about(names, one, many)] if names else []


def _axes_problems(model_v: mjx.Model, in_axes: Any, worlds: Leaves) -> list[str]:
    """Problems of `in_axes` that does not say what is batched."""
    axes: dict[str, Any] = {}

    def note(path: Any, axis: Any, part: Any) -> None:
        axes.update(
            {path_name(path) + jax.tree_util.keystr(p) if path else path_name(p): axis for p, _ in _paths(part)}
        )

    try:
        jax.tree_util.tree_map_with_path(note, in_axes, model_v, is_leaf=lambda x: x is None)
    except (ValueError, TypeError, AttributeError):
        must = "must be an mjx.Model that is 0 where leaves are batched and None elsewhere"
        if isinstance(in_axes, mjx.Model):
            names = ", ".join(f"`{name}`" for name in _differing(model_v, in_axes)) or "the structure"
            return [f"`in_axes` {must}, with the static fields of `model_v`, but {names} of it differ."]
        how = "jax.tree.map(lambda _: None, model).tree_replace({'body_mass': 0})"
        return [f"`in_axes` {must}, such as {how}, got {_short(in_axes)}."]
    problems = []
    if forgotten := [name for name, axis in axes.items() if axis is None and name in worlds.batched]:
        rest = "batched, but `in_axes` has None for"
        problems.append(about(forgotten, f"is {rest} it.", f"are {rest} them."))
    for other in dict.fromkeys(axis for axis in axes.values() if axis is not None and axis != 0):
        has = f"`in_axes` has {other!r} for"
        names = [name for name, axis in axes.items() if axis == other]
        problems.append(f"{has} {listed([f'`{name}`' for name in names])}: worlds must be the first axis, 0.")
    alone = [name for name, axis in axes.items() if axis == 0 and name in worlds.shared]
    if alone and not isinstance(in_axes, mjx.Model):
        problems.append(f"`in_axes` is 0 for all, but {len(alone)} fields are not batched, such as `{alone[0]}`.")
    elif alone:
        rest = "not batched, but `in_axes` has 0 for"
        problems.append(about(alone, f"is {rest} it.", f"are {rest} them."))
    return problems


def _paths(tree: Any) -> list[tuple[Any, Any]]:
    return jax.tree_util.tree_leaves_with_path(tree)


def _short(value: Any) -> str:
    if isinstance(value, dict):
        return f"a dict of {', '.join(map(repr, value))}"
    return repr(value) if isinstance(value, (int, float, str, bool)) else f"an object of type {type(value).__name__}"
