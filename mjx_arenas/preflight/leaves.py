"""A randomized model as NumPy arrays by field, beside its template (host).

W worlds. Leaves of models go by their names in `mjx.Model`, with dots (`opt.gravity`).
"""

import collections
import dataclasses
import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import numpy as np
from mujoco import mjx

from mjx_arenas.preflight import elements


class Variation(NamedTuple):
    """How one field varies over the worlds: how many of its numbers do, and the one of them that does most."""

    shape: tuple[int, ...]
    """The field's shape in one world."""
    n_numbers: int
    """How many of the numbers of that shape are not the same in all worlds."""
    number: str
    """The one with the largest difference, any where none differs: of which element, and where in its row."""
    low: float
    """The number's smallest value."""
    high: float
    """The number's largest value."""


@dataclasses.dataclass(frozen=True)
class Leaves:
    """The leaves of the template and of all worlds, by name."""

    n: int
    template: dict[str, np.ndarray]
    batched: dict[str, np.ndarray]  # (W, ...)
    shared: dict[str, np.ndarray]  # that all worlds have in common, in the template's shape

    @classmethod
    def of(cls, model: mjx.Model, model_v: mjx.Model) -> tuple["Leaves", list[str]]:
        """Sorts the leaves; those that have the shape of neither one world nor of W are left out, with a sentence."""
        template, given = named_leaves(model), named_leaves(model_v)
        shared = {n: v for n, v in given.items() if n in template and v.shape == template[n].shape}
        batched = {n: v for n, v in given.items() if n in template and v.ndim and v.shape[1:] == template[n].shape}
        batched = {name: value for name, value in batched.items() if name not in shared}
        problems = []
        if others := [name for name in given if name in template and name not in shared and name not in batched]:
            first, got = template[others[0]].shape, given[others[0]].shape
            one = f"must have shape {first}, or (W, ...) with that, got {got}."
            many = f"must have the template's shapes, or (W, ...) with them, got {got} of the first instead of {first}."
            problems.append(about(others, one, many))
        sizes = collections.Counter(len(value) for value in batched.values())
        n = sizes.most_common(1)[0][0] if sizes else 0
        for other in sizes.keys() - {n}:
            rest = f"of {count(other)}, but others are of {n}."
            problems.append(about([m for m, v in batched.items() if len(v) == other], f"is {rest}", f"are {rest}"))
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
        return np.asarray((value != template) & ~both_nan)

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

    def varies(self, model: mjx.Model) -> dict[str, Variation]:
        """`RandomizationReport.varies`; `model` has the names."""
        found = {}
        for name, value in self.batched.items():
            if not value.size:
                continue
            low, high, differs = value.min(0), value.max(0), (value != value[:1]).any(0)
            apart = np.where(differs, np.nan_to_num(high - low, nan=np.inf), -1.0)
            most = tuple(map(int, np.unravel_index(apart.argmax(), apart.shape)))
            of = elements.number(model, name, most)
            found[name] = Variation(value.shape[1:], int(differs.sum()), of, float(low[most]), float(high[most]))
        return found


def about(names: Sequence[str], one: str, many: str) -> str:
    """One sentence about fields that have something in common, with its end for one field and for more."""
    return f"{listed([f'`{name}`' for name in names])} {one if len(names) == 1 else many}"


def listed(names: Sequence[str], most: int = 4) -> str:
    """The first names, and how many more there are."""
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


def count(n: int) -> str:
    """A number of worlds in words."""
    return f"{n} world{'s' * (n != 1)}"


def path_name(path: Any) -> str:
    """The name of the leaf at a path of JAX's."""
    return jax.tree_util.keystr(path).removeprefix(".")


def named_leaves(model: mjx.Model) -> dict[str, np.ndarray]:
    """The leaves of a model by name, on the host."""
    return {path_name(path): np.asarray(leaf) for path, leaf in jax.tree_util.tree_leaves_with_path(model)}
