"""A policy that knows what it was trained on, and refuses what is something else."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import jax
import jax.numpy as jnp

from mjx_arenas.problem import Told, problem
from mjx_arenas.problems.messages import error, kind_of


@dataclasses.dataclass(frozen=True, eq=False)
class TrainedPolicy:
    """`policy(observation, key)`, as in Brax; jit, vmap."""

    act: Callable[[Any, jax.Array], tuple[jax.Array, Mapping]]
    task: str
    sees: Mapping[str, tuple[int, ...]]
    """Shapes, for one world, of the observations that it takes, by name."""

    def __call__(self, observation: Any, key: jax.Array) -> tuple[jax.Array, Mapping]:
        self.check(observation, "observation")
        return self.act({name: observation[name] for name in self.sees}, key)

    def check(self, observation: Any, path: str) -> None:
        """Refuses observations (..., m) of other names or sizes than those of the training; `path` is the argument that gives them."""
        for name, wanted in self.sees.items():
            if not isinstance(observation, Mapping):
                got = kind_of(observation)
            elif name not in observation:
                got = ", ".join(map(repr, observation)) or "none"
            elif (shape := jnp.shape(observation[name])[-len(wanted) :]) != wanted:
                got = _numbers(shape)
            else:
                continue
            told = {"wanted": _numbers(wanted), "name": name, "task": self.task}
            raise error([problem(path, "policy_sees", None, Told(got), told)])


def _numbers(shape: tuple[int, ...]) -> str:
    return f"{shape[0]} numbers" if len(shape) == 1 else f"{shape} numbers" if shape else "one number"
