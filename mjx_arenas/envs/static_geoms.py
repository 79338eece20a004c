"""Other people's environments on `impl="warp"`: tables that collide where each world has them."""

from typing import Any

import jax
from mujoco import mjx

from mjx_arenas.problem import Told, problem
from mjx_arenas.problems.messages import error
from mjx_arenas.sim.data import place_static


class StaticGeoms:
    """Wraps a Playground-style environment so that geoms that are fixed to the world are placed as each world has them.

    MJX on Warp places such geoms once, when `mjx.Data` is made, and as the template has them. If an environment makes its own data with a
    model that `arena.randomization_fn` randomizes, all worlds would therefore collide with the template's tables. This wrapper passes all
    data that comes out of `reset` through `mja.place_static`, with the model that the environment has while it resets. On `impl="jax"`,
    which places geoms in every step, that changes nothing.

    Put it directly around the environment, or inside other wrappers, and before `wrap_for_brax_training`:

        env = wrap_for_brax_training(StaticGeoms(env), ..., randomization_fn=...)

    Anything that reset derives from contacts or from `geom_xpos` of tables before it returns (observations, steps to settle) is still the
    template's. Such an environment must call `mja.place_static` itself, right after it made its data. So must one that makes new data in
    `step`.
    """

    def __init__(self, env: Any) -> None:
        if not hasattr(env, "_mjx_model"):
            raise error([problem("env", "env_of_playground", None, Told(type(env).__name__))], kind=TypeError)
        self.env = env

    def reset(self, rng: jax.Array) -> Any:
        """The environment's first state, of the same type, with its data placed."""
        state = self.env.reset(rng)
        return jax.tree.map(self._placed, state, is_leaf=lambda x: isinstance(x, mjx.Data))

    def step(self, state: Any, action: jax.Array) -> Any:
        """The environment's step: MJX keeps static geoms where they are."""
        return self.env.step(state, action)

    # Playground swaps `env.unwrapped._mjx_model` for each world's model and calls `reset` of what it swapped it on: that
    # must be this wrapper, and the environment must see the model.

    @property
    def unwrapped(self) -> "StaticGeoms":
        """Returns this environment, so that wrappers which unwrap do not skip it."""
        return self

    @property
    def _mjx_model(self) -> mjx.Model:
        return self.env.unwrapped._mjx_model

    @_mjx_model.setter
    def _mjx_model(self, model: mjx.Model) -> None:
        self.env.unwrapped._mjx_model = model

    def __getattr__(self, name: str) -> Any:
        if name == "env" or name.startswith("__"):  # while it is copied or unpickled there is no `env` yet
            raise AttributeError(name)
        return getattr(self.env, name)

    def _placed(self, leaf: Any) -> Any:
        return place_static(self._mjx_model, leaf) if isinstance(leaf, mjx.Data) else leaf
