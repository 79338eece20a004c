"""A randomized model as NumPy arrays by field, beside its template (host).

W worlds. Leaves of models go by their names in `mjx.Model`, with dots (`opt.gravity`).
"""

import collections
import dataclasses
import functools
from typing import Any

import jax
import numpy as np
from mujoco import mjx


@dataclasses.dataclass(frozen=True)
class Worlds:
    """The leaves of the template and of all worlds, by name."""

    n: int
    template: dict[str, np.ndarray]
    batched: dict[str, np.ndarray]  # (W, ...)
    shared: dict[str, np.ndarray]  # that all worlds have in common, in the template's shape

    @classmethod
    def of(cls, model: mjx.Model, model_v: mjx.Model) -> tuple["Worlds", list[str]]:
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
        named = [(path_name(path), leaf) for path, leaf in jax.tree_util.tree_leaves_with_path(model)]
        leaves = [jax.numpy.asarray(self[name][world], leaf.dtype) for name, leaf in named]
        return jax.tree.unflatten(jax.tree.structure(model), leaves)

    @functools.cached_property
    def n_distinct(self) -> int:
        """How many worlds differ from one another."""
        rows = [np.ascontiguousarray(value).reshape(self.n, -1) for value in self.batched.values()]
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


def path_name(path: Any) -> str:
    """The name of the leaf at a path of JAX's."""
    return jax.tree_util.keystr(path).removeprefix(".")


def _leaves(model: mjx.Model) -> dict[str, np.ndarray]:
    return {path_name(path): np.asarray(leaf) for path, leaf in jax.tree_util.tree_leaves_with_path(model)}
