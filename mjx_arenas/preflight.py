"""What is wrong with a randomized model, by field, before `jax.vmap` fails over it or MJX simulates something else (host).

W worlds. Leaves of models go by their names in `mjx.Model`, with dots (`opt.gravity`).
"""

import collections
import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import jax
import mujoco
import numpy as np
from mujoco import mjx
from mujoco.mjx._src import collision_driver
from mujoco.mjx._src.types import Impl

from mjx_arenas.data import static_geoms
from mjx_arenas.setconst import set_const

# What `mjx.step` never reads on an implementation, though it decides what happens in C.
UNREAD = {
    Impl.JAX: (
        "geom_gap",
        "pair_gap",
        "jnt_stiffnesspoly",
        "dof_dampingpoly",
        "tendon_stiffnesspoly",
        "tendon_dampingpoly",
    ),
    Impl.WARP: ("opt.impratio",),  # it reads opt._impl.impratio_invsqrt, which put_model derives
}

_TYPE = mujoco.mjtGeom
_CENTRED = [_TYPE.mjGEOM_SPHERE, _TYPE.mjGEOM_CAPSULE, _TYPE.mjGEOM_ELLIPSOID, _TYPE.mjGEOM_CYLINDER, _TYPE.mjGEOM_BOX]
_ROUNDING = 1e-4  # relative; of float32 and what is derived in it


@dataclasses.dataclass(frozen=True)
class RandomizationReport:
    """What `check_randomization` found; `print` it."""

    n_worlds: int
    """W; 0 where nothing is batched."""
    varies: Mapping[str, tuple[tuple[int, ...], float, float]]
    """Of each batched field its shape in one world, and the smallest and largest of the numbers that vary over the
    worlds, or, where none does, of all."""
    problems: tuple[str, ...]
    """What is wrong, a sentence each."""
    notes: tuple[str, ...]
    """What is right only under a condition that the model does not show, and what may not be meant."""

    @property
    def ok(self) -> bool:
        """There are no problems."""
        return not self.problems

    def __str__(self) -> str:
        lines = [f"{self.n_worlds} worlds, {len(self.problems) or 'no'} problem{'s' * (len(self.problems) != 1)}"]
        if self.varies:
            rows = [("field", "shape", "from", "to")]
            rows += [(n, str(shape), f"{low:.6g}", f"{high:.6g}") for n, (shape, low, high) in self.varies.items()]
            widths = [max(len(row[i]) for row in rows) for i in range(4)]
            lines += [
                "  ".join(cell.ljust(width) for cell, width in zip(r, widths, strict=True)).rstrip() for r in rows
            ]
        for title, sentences in (("problems", self.problems), ("notes", self.notes)):
            if sentences:
                lines += [f"{title}:", *(f"- {sentence}" for sentence in sentences)]
        return "\n".join(lines)


def check_randomization(model: mjx.Model, model_v: mjx.Model, in_axes: Any) -> RandomizationReport:
    """Looks a randomizer's output over, this library's or another one's.

    Copies the batched leaves to the host: give it some hundred worlds, not a million.

    Args:
        model: the template, one world, that the randomizer was given.
        model_v: the model that it returned.
        in_axes: the tree that it returned.

    Raises:
        TypeError: a model is not an `mjx.Model`. A bad randomizer is a report, no error.
        ValueError: `model` is batched itself.
    """
    for name, given in (("model", model), ("model_v", model_v)):
        if not isinstance(given, mjx.Model):
            raise TypeError(f"`{name}` must be an mjx.Model, got {type(given).__name__}.")
    if model.body_pos.ndim != 2:
        raise ValueError(f"`model` must be of one world, got `body_pos` of shape {model.body_pos.shape}.")
    problems = _static_problems(model, model_v)
    worlds, more = _Worlds.of(model, model_v)
    problems += more + _axes_problems(model_v, in_axes, worlds)
    if not worlds.n:
        problems.append("Nothing is batched: all worlds are the model that was given.")
        return RandomizationReport(0, {}, tuple(problems), ())
    notes = []
    varying = [name for name in worlds.batched if (worlds.batched[name] != worlds.batched[name][:1]).any()]
    if not any(worlds.changed(name).any() for name in worlds.batched):
        problems.append(f"Nothing has changed: all {worlds.n} worlds are equal to `model`.")
    elif worlds.n > 1 and not varying:
        problems.append(f"All {worlds.n} worlds are identical.")
    elif (distinct := worlds.distinct(varying)) < worlds.n:
        notes.append(f"Of the {worlds.n} worlds {distinct} are distinct.")
    problems += [
        f"`{name}` has numbers that are not finite in {_of_worlds(~np.isfinite(values[:, finite]))}."
        for name, values in worlds.batched.items()
        if values.dtype.kind == "f"
        for finite in [np.isfinite(worlds.template[name])]
        if not np.isfinite(values[:, finite]).all()
    ]
    for check in (_bounds, _masses, _weights, _unread, _static_on_warp, _idle_friction):
        for is_problem, sentence in check(model, worlds):
            (problems if is_problem else notes).append(sentence)
    return RandomizationReport(worlds.n, worlds.varies(), tuple(problems), tuple(notes))


# Structure.


@dataclasses.dataclass(frozen=True)
class _Worlds:
    """The leaves of the template and of all worlds, by name."""

    n: int
    template: dict[str, np.ndarray]
    batched: dict[str, np.ndarray]  # (W, ...)
    shared: dict[str, np.ndarray]  # that all worlds have in common, in the template's shape

    @classmethod
    def of(cls, model: mjx.Model, model_v: mjx.Model) -> tuple["_Worlds", list[str]]:
        """Sorts the leaves; those that have the shape of neither one world nor of W are left out, with a sentence."""
        template, given = _leaves(model), _leaves(model_v)
        shared = {n: v for n, v in given.items() if n in template and v.shape == template[n].shape}
        batched = {n: v for n, v in given.items() if n in template and v.ndim and v.shape[1:] == template[n].shape}
        batched = {name: value for name, value in batched.items() if name not in shared}
        problems = [
            f"`{name}` must have shape {template[name].shape}, or (W, ...) with that, got {given[name].shape}."
            for name in given
            if name in template and name not in shared and name not in batched
        ]
        sizes = collections.Counter(len(value) for value in batched.values())
        n = sizes.most_common(1)[0][0] if sizes else 0
        problems += [f"`{m}` is of {len(v)} worlds, but others are of {n}." for m, v in batched.items() if len(v) != n]
        return cls(n, template, {m: v for m, v in batched.items() if len(v) == n}, shared), problems

    def __getitem__(self, name: str) -> np.ndarray:
        """(W, ...), of leaves that are not batched, too."""
        if name in self.batched:
            return self.batched[name]
        value = self.shared.get(name, self.template[name])
        return np.broadcast_to(value, (self.n, *value.shape))

    def changed(self, name: str) -> np.ndarray:
        """(W, ...) bool: where it is not as in the template."""
        value, template = self[name], self.template[name]
        both_nan = (value != value) & (template != template)
        return (value != template) & ~both_nan

    def model(self, model: mjx.Model, world: int) -> mjx.Model:
        """`model` as it is in one world."""
        named = [(_name(path), leaf) for path, leaf in jax.tree_util.tree_leaves_with_path(model)]
        leaves = [jax.numpy.asarray(self[name][world], leaf.dtype) for name, leaf in named]
        return jax.tree.unflatten(jax.tree.structure(model), leaves)

    def distinct(self, names: Sequence[str]) -> int:
        """How many worlds differ from one another in some of these fields."""
        rows = [np.ascontiguousarray(self.batched[name]).reshape(self.n, -1) for name in names]
        return len({b"".join(row[w].tobytes() for row in rows) for w in range(self.n)})

    def varies(self) -> dict[str, tuple[tuple[int, ...], float, float]]:
        """`RandomizationReport.varies`."""
        found = {}
        for name, value in self.batched.items():
            entries = (value != value[:1]).any(0)
            numbers = value[:, entries] if entries.any() else value
            if numbers.size:
                found[name] = value.shape[1:], float(numbers.min()), float(numbers.max())
        return found


def _name(path: Any) -> str:
    return jax.tree_util.keystr(path).removeprefix(".")


def _leaves(model: mjx.Model) -> dict[str, np.ndarray]:
    return {_name(path): np.asarray(leaf) for path, leaf in jax.tree_util.tree_leaves_with_path(model)}


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
    return [
        f"`{name}` differs from the template's, but is static in MJX: all worlds share it; change the model before put_model."
        for name in _differing(model, model_v)
    ]


def _axes_problems(model_v: mjx.Model, in_axes: Any, worlds: _Worlds) -> list[str]:
    """Where `in_axes` does not say what is batched."""
    axes: dict[str, Any] = {}

    def note(path: Any, axis: Any, part: Any) -> None:
        axes.update({_name(path) + jax.tree_util.keystr(p) if path else _name(p): axis for p, _ in _paths(part)})

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
    for name, axis in axes.items():
        if axis is None and name in worlds.batched:
            problems.append(f"`{name}` is batched, but `in_axes` has None for it.")
        elif axis is not None and axis != 0:
            problems.append(f"`in_axes` has {axis!r} for `{name}`: worlds must be the first axis, 0.")
    alone = [name for name, axis in axes.items() if axis == 0 and name in worlds.shared]
    if alone and not isinstance(in_axes, mjx.Model):
        problems.append(f"`in_axes` is 0 for all, but {len(alone)} fields are not batched, such as `{alone[0]}`.")
    else:
        problems += [f"`{name}` is not batched, but `in_axes` has 0 for it." for name in alone]
    return problems


def _paths(tree: Any) -> list[tuple[Any, Any]]:
    return jax.tree_util.tree_leaves_with_path(tree)


def _short(value: Any) -> str:
    if isinstance(value, dict):
        return f"a dict of {', '.join(map(repr, value))}"
    return repr(value) if isinstance(value, (int, float, str, bool)) else f"an object of type {type(value).__name__}"


# Content: each check yields sentences, with whether it is a problem or a note.

_Found = Iterator[tuple[bool, str]]


def _bounds(model: mjx.Model, worlds: _Worlds) -> _Found:
    """Bounds of geoms whose size has changed."""
    types = np.asarray(model.geom_type)
    ids = np.flatnonzero(np.isin(types, _CENTRED))
    size = worlds["geom_size"][:, ids]
    half = _half_extents(types[ids], size)
    round_ = np.isin(types[ids], [_TYPE.mjGEOM_SPHERE, _TYPE.mjGEOM_CAPSULE, _TYPE.mjGEOM_ELLIPSOID])
    across = np.where((types[ids] == _TYPE.mjGEOM_CYLINDER)[:, None], half * np.array([0.0, 1.0, 1.0]), half)
    radius = np.where(round_, half.max(-1), np.sqrt((across**2).sum(-1)))
    # (ngeom, 6) on JAX, (ngeom, 2, 3) on Warp.
    box = np.concatenate([np.zeros_like(half), half], axis=-1)
    got = {"geom_rbound": worlds["geom_rbound"][:, ids, None]}
    got["geom_aabb"] = worlds["geom_aabb"].reshape(worlds.n, -1, 6)[:, ids]
    resized = worlds.changed("geom_size")[:, ids].any(-1)
    for name, want in (("geom_rbound", radius[..., None]), ("geom_aabb", box)):
        changed = resized | worlds.changed(name)[:, ids].reshape(worlds.n, len(ids), -1).any(-1)
        off = abs(got[name] - want).max(-1)
        wrong = changed & (off > _ROUNDING * radius + 1e-6)
        if wrong.any():
            w, g = np.unravel_index(np.argmax(np.where(wrong, off, -1)), off.shape)
            last = got[name][w, g, -1], want[w, g, -1]
            of = f"{_geom(model, ids[g])} in world {w}: it ends in {last[0]:.6g}, but its size asks for {last[1]:.6g}"
            if name == "geom_rbound":
                of = f"{_geom(model, ids[g])} in world {w}: {last[0]:.6g}, but its size asks for {last[1]:.6g}"
            reads = _reads_bounds(model, name)
            effect = "contacts are lost where it is too small" if reads else "impl='jax' does not read it here"
            yield reads, f"`{name}` does not belong to `geom_size` in {_of_worlds(wrong)} ({of}): {effect}."


def _half_extents(types: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Half extents (W, n, 3) of geoms, in their frames, by MuJoCo's `geom_size` (W, n, 3)."""
    x, y, z = (size[..., i] for i in range(3))
    sphere, capsule, cylinder = (types == t for t in (_TYPE.mjGEOM_SPHERE, _TYPE.mjGEOM_CAPSULE, _TYPE.mjGEOM_CYLINDER))
    second = np.where(sphere | capsule | cylinder, x, y)
    third = np.select([sphere, capsule, cylinder], [x, x + y, y], z)
    return np.stack([x, second, third], axis=-1)


def _reads_bounds(model: mjx.Model, name: str) -> bool:
    """Whether collisions depend on a bound."""
    return model.impl == Impl.WARP or (
        name == "geom_rbound" and collision_driver._numeric(model, "max_geom_pairs") > -1
    )


def _masses(model: mjx.Model, worlds: _Worlds) -> _Found:
    """The masses of subtrees, from which MJX takes their centres of mass."""
    mass, template = (np.array(m, float) for m in (worlds["body_mass"], worlds.template["body_mass"][None]))
    parent = np.asarray(model.body_parentid)
    for body in range(model.nbody - 1, 0, -1):
        mass[:, parent[body]] += mass[:, body]
        template[:, parent[body]] += template[:, body]
    off = abs((worlds["body_subtreemass"] - worlds.template["body_subtreemass"]) - (mass - template))
    wrong = off > _ROUNDING * np.maximum(mass, template) + 1e-9
    if wrong.any():
        yield (
            True,
            (
                f"`body_subtreemass` does not add up to `body_mass` in {_of_worlds(wrong)}: centres of mass of subtrees are wrong; "
                "mjx_arenas.set_const derives it."
            ),
        )


def _weights(model: mjx.Model, worlds: _Worlds) -> _Found:
    """Inverse weights of bodies whose mass or inertia has changed: contacts are as soft as they say."""
    moving = np.asarray(model.body_weldid) != 0
    mass, inertia = (
        abs(worlds[name] - worlds.template[name]) > _ROUNDING * worlds.template[name]
        for name in ("body_mass", "body_inertia")
    )
    heavier = (mass | inertia.any(-1)) & moving
    fields = {
        "body_invweight0": ~worlds.changed("body_invweight0").any(-1) & heavier,
        "dof_invweight0": ~worlds.changed("dof_invweight0") & heavier[:, np.asarray(model.dof_bodyid)],
    }
    suspects = [np.flatnonzero(stale.any(-1)) for stale in fields.values() if stale.any()]
    if not suspects:
        return
    world = int(suspects[0][0])
    try:
        # They may well not depend on this mass, such as that of a wheel that only turns: what would be right decides.
        right = _leaves(jax.jit(set_const)(worlds.model(model, world)))
    except (NotImplementedError, ValueError):
        right = {}
    for name, stale in fields.items():
        if not stale[world].any():
            continue
        got = worlds[name][world][stale[world]]
        want = right[name][stale[world]] if right else np.full_like(got, np.inf)
        if (abs(want - got) > 1e-3 * abs(want)).any():
            changed = "`body_mass` or `body_inertia`"
            yield (
                True,
                (
                    f"`{name}` is the template's in {_of_worlds(stale)} in which {changed} differ: contacts and limits are too soft or "
                    "too stiff; mjx_arenas.set_const derives it."
                ),
            )


def _unread(model: mjx.Model, worlds: _Worlds) -> _Found:
    """Writes that the implementation does not read."""
    impl = model.impl.value
    for name in UNREAD.get(model.impl, ()):
        if name in worlds.template and worlds.changed(name).any():
            instead = ": it reads `opt._impl.impratio_invsqrt`" if name == "opt.impratio" else ""
            yield True, f"`{name}` differs from the template's, but has no effect on impl={impl!r}{instead}."
    if model.impl == Impl.JAX:
        for kind in ("dof", "tendon"):
            name = f"{kind}_frictionloss"
            without = ~np.asarray(getattr(model._impl, f"{kind}_hasfrictionloss"), bool)
            if (worlds[name] > 0)[:, without].any():
                yield (
                    True,
                    (
                        f"`{name}` has no effect on impl='jax' where the template has 0: give the template one that is larger, "
                        "however small."
                    ),
                )
        gravcomp = getattr(model, "flg_gravcomp", model.ngravcomp)
        if not gravcomp and worlds["body_gravcomp"].any():
            yield True, "`body_gravcomp` has no effect on impl='jax' if the template has none: give a body of it some."
    fluid = model.opt._impl.has_fluid_params if model.impl == Impl.JAX else model._impl.has_fluid
    for name in ("opt.density", "opt.viscosity", "opt.wind"):
        if not fluid and worlds.changed(name).any():
            yield (
                True,
                f"`{name}` has no effect, as the template has no fluid: give it some density, viscosity or wind.",
            )


def _static_on_warp(model: mjx.Model, worlds: _Worlds) -> _Found:
    """Poses of geoms that Warp places once."""
    if model.impl != Impl.WARP:
        return
    geoms = static_geoms(model)
    bodies = np.asarray(model.geom_bodyid)[geoms]
    ancestors = {0, *bodies.tolist()}
    for body in range(model.nbody - 1, 0, -1):
        if body in ancestors:
            ancestors.add(int(model.body_parentid[body]))
    rows = dict.fromkeys(("body_pos", "body_quat"), sorted(ancestors)) | dict.fromkeys(("geom_pos", "geom_quat"), geoms)
    moved = [f"`{name}`" for name, ids in rows.items() if worlds.changed(name)[:, ids].any()]
    if moved:
        verb = "moves" if len(moved) == 1 else "move"
        yield (
            False,
            (
                f"{' and '.join([', '.join(moved[:-1]), moved[-1]] if len(moved) > 1 else moved)} {verb} geoms that are fixed to "
                "the world, which Warp places once, where the template has them: put data through mjx_arenas.place_static "
                "(environments: mjx_arenas.envs.static_geoms.StaticGeoms)."
            ),
        )


def _idle_friction(model: mjx.Model, worlds: _Worlds) -> _Found:
    """Sliding friction of geoms that never is the one that counts."""
    friction, priority = worlds["geom_friction"][..., 0], np.asarray(model.geom_priority)
    varies = (friction != friction[:1]).any(0)
    if not varies.any():
        return
    touches: dict[int, bool] = {}  # whether its friction ever counts
    for a, b, pair in collision_driver.geom_pairs(model):
        for g, other in ((a, b), (b, a)) if pair == -1 else ():
            if varies[g]:
                equal = priority[g] == priority[other]
                counts = (friction[:, g] > friction[:, other]).any() if equal else priority[g] > priority[other]
                touches[g] = touches.get(g, False) or bool(counts)
    idle = [_geom(model, g) for g, counts in touches.items() if not counts]
    if idle:
        yield (
            False,
            (
                f"`geom_friction` of {_listed(idle)} varies without effect: whatever touches it has a higher priority, or the same and more "
                "sliding friction, of which the larger counts."
            ),
        )


def _of_worlds(wrong: np.ndarray) -> str:
    """Which worlds, by an array (W, ...) that is true for them."""
    which = np.flatnonzero(wrong.reshape(len(wrong), -1).any(-1))
    return f"world {which[0]}" if len(which) == 1 else f"{len(which)} of {len(wrong)} worlds"


def _geom(model: mjx.Model, index: int) -> str:
    start = int(np.asarray(model.name_geomadr)[index])
    return (
        repr(model.names[start : model.names.index(b"\0", start)].decode()) if model.names[start] else f"geom {index}"
    )


def _listed(names: Sequence[str], most: int = 3) -> str:
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more
