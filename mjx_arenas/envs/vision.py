"""What a policy sees: pictures of its world as observations, on MuJoCo Playground's conventions."""

import dataclasses
import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from mujoco import mjx

from mjx_arenas.arena import Arena
from mjx_arenas.keywords import WithKnownArguments
from mjx_arenas.params.distribution import DRAWN
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.pixels import images
from mjx_arenas.pixels.renderer import Picture, Renderer
from mjx_arenas.problem import Told, problem
from mjx_arenas.rules import validation

KINDS = {"rgb": 3, "gray": 1, "depth": 1, "rgbd": 4}
"""What pictures are made of, and their channels."""

Alter = Callable[[jax.Array, jax.Array, jax.Array], jax.Array]


@dataclasses.dataclass(frozen=True)
class Vision(WithKnownArguments):
    """The pictures that an `ArenaEnv` adds to its observations.

    `pixels/view_0` is the picture of the first camera, (height, width, channels * frames) float32, the latest frame last. Colours are from
    0 to 1. Greys are the mean of the colours. Distances are in [m]. An episode begins with its first picture in all frames.

    Args:
        cameras: names of cameras, or (width, height) [pixels] by name, as for `arena.renderer`.
        kind: "rgb", "gray", "depth" or "rgbd".
        frames: number of pictures in an observation, each of another step.
        every: pictures are drawn in every n-th step, in all worlds at once. In between, observations repeat the last picture. An episode
            that begins in between is black until the next one.
        shadows: as for `arena.renderer`.
        textures: as for `arena.renderer`.
        groups: as for `arena.renderer`.
        background: as for `arena.renderer`.
        alter: function that returns the picture as the policy gets it, such as a darker or noisy one. It takes a picture (height, width,
            channels), a key that is the same for a whole episode, and a key of the step. The functions of `mjx_arenas.images` are for
            colours: they clip at 1.
    """

    cameras: Sequence[str] | Mapping[str, tuple[int, int]]
    kind: str = "rgb"
    frames: int = 1
    every: int = 1
    shadows: bool = False
    textures: bool = True
    groups: Sequence[int] = (0, 1, 2)
    background: Sequence[float] = (0.0, 0.0, 0.0)
    alter: Alter | None = None


def altered(picture: jax.Array, episode: jax.Array, step: jax.Array) -> jax.Array:
    """Picture of colours with a brightness and a contrast of the episode, and with noise of the step."""
    one, other = jax.random.split(episode)
    picture = images.brightness(picture, jax.random.uniform(one, (), DRAWN, 0.8, 1.2))
    picture = images.contrast(picture, jax.random.uniform(other, (), DRAWN, 0.8, 1.2))
    return images.noise(step, picture, 0.02)


class Eyes:
    """Draws the observations of an environment; pure functions of one world."""

    def __init__(self, arena: Arena, vision: Vision, length: float) -> None:
        _check(vision, length)
        self._vision = vision
        given = {name: getattr(vision, name) for name in ("shadows", "textures", "groups", "background")}
        rgb, depth = vision.kind != "depth", vision.kind in ("depth", "rgbd")
        self._renderer: Renderer = arena.renderer(vision.cameras, rgb=rgb, depth=depth, **given)

    def first(self, now: "Now") -> dict[str, jax.Array]:
        """The observations at the start of a world."""
        return {name: jnp.tile(x, (1, 1, self._vision.frames)) for name, x in self._see(now).items()}

    def next(self, now: "Now", before: Any, begins: jax.Array, due: jax.Array) -> dict[str, jax.Array]:
        """The observations after a step.

        Args:
            now: what there is to see.
            before: the observations before the step.
            begins: () whether an episode began with it.
            due: () whether a picture is to be drawn, in most loops in all worlds at once.
        """
        args = now, {name: before[name] for name in self.names}, begins
        if self.every == 1:
            return self._drawn(*args)
        new, old = if_any(due, self._drawn, _kept, *args), _kept(*args)
        return jax.tree.map(lambda new, old: jnp.where(due, new, old), new, old)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the observations."""
        return tuple(f"pixels/view_{i}" for i in range(len(self._renderer.cameras)))

    @property
    def every(self) -> int:
        """Steps from a picture to the next."""
        return self._vision.every

    def _drawn(self, now: "Now", before: Mapping[str, jax.Array], begins: jax.Array) -> dict[str, jax.Array]:
        alike = self.first(now)
        if self._vision.frames == 1:
            return alike
        n = KINDS[self._vision.kind]
        return {
            name: jnp.where(begins, x, jnp.concatenate([before[name][..., n:], x[..., -n:]], axis=-1))
            for name, x in alike.items()
        }

    def _see(self, now: "Now") -> dict[str, jax.Array]:
        pictures = self._renderer.of_world(now.model, now.params, now.data)
        seen = {}
        for i, (name, camera) in enumerate(zip(self.names, self._renderer.cameras, strict=True)):
            pixels = _pixels(self._vision.kind, pictures[camera.name])
            if self._vision.alter is not None:
                keys = jax.random.fold_in(now.episode, i), jax.random.fold_in(now.step, i)  # of this camera
                given = self._vision.alter(pixels, *keys)
                _check_altered(given, pixels.shape)
                pixels = jnp.asarray(given, jnp.float32)
            seen[name] = pixels
        return seen


class Now(NamedTuple):
    """A world at a time."""

    model: mjx.Model
    params: ArenaParams
    data: mjx.Data
    episode: jax.Array
    """A key, the same for a whole episode."""
    step: jax.Array
    """A key of its own."""


def _kept(now: Now, before: Mapping[str, jax.Array], begins: jax.Array) -> dict[str, jax.Array]:
    """The pictures of before; of an episode that begins, black ones."""
    del now
    return {name: jnp.where(begins, 0.0, x) for name, x in before.items()}


def if_any(wanted: jax.Array, function: Callable[..., Any], otherwise: Callable[..., Any], *args: Any) -> Any:
    """`function(*args)`, or `otherwise(*args)` where no world that `jax.vmap` runs this for wants it.

    Neither may close over arrays that `jax.vmap` batches. What is not chosen is not computed.
    """
    leaves, tree = jax.tree.flatten(args)
    both = [lambda *leaves, f=f: f(*tree.unflatten(leaves)) for f in (function, otherwise)]

    @jax.custom_batching.custom_vmap
    def one(wanted: jax.Array, *leaves: jax.Array) -> Any:
        return jax.lax.cond(wanted, *both, *leaves)

    @one.def_vmap
    def many(size: int, is_batched: Any, wanted: jax.Array, *leaves: jax.Array) -> tuple[Any, Any]:
        axes = [0 if batched else None for batched in is_batched[1:]]
        all_worlds = [jax.vmap(f, in_axes=axes, axis_size=size) for f in both]
        out = jax.lax.cond(wanted.any(), *all_worlds, *leaves)
        return out, jax.tree.map(lambda _: True, out)

    return one(wanted, *leaves)


def _pixels(kind: str, picture: Picture) -> jax.Array:
    """(height, width, channels) of a picture."""
    depth = None if picture.depth is None else picture.depth[..., None]
    if picture.rgb is None:
        return depth  # type: ignore[return-value]
    rgb = picture.rgb.astype(jnp.float32) / 255
    if kind == "gray":  # the mean of the channels, as in Playground
        return rgb.mean(-1, keepdims=True)
    return rgb if depth is None else jnp.concatenate([rgb, depth], axis=-1)


def _check(vision: Any, length: float) -> None:
    validation.check_type("vision", vision, Vision, "mjx_arenas.envs.Vision(cameras, ...)")
    found = []
    if not isinstance(vision.kind, str) or vision.kind not in KINDS:
        found.append(problem("vision.kind", "must", None, vision.kind, must=f"one of {', '.join(map(repr, KINDS))}"))
    for name in ("frames", "every"):
        value = getattr(vision, name)
        if not validation.is_whole(value, 1):
            found.append(problem(f"vision.{name}", "must", None, value, must="a whole number above 0"))
        elif value > length:
            must = f"at most {length}, the steps of an episode (`config.episode_length`)"
            found.append(problem(f"vision.{name}", "must", None, value, must=must))
    if vision.alter is altered and vision.kind in ("depth", "rgbd"):
        must = f"None, or a function of your own, for kind {vision.kind!r}, as the default one clips distances at 1 m"
        found.append(problem("vision.alter", "must", None, vision.alter, must=must))
    if vision.alter is not None and not _takes_three(vision.alter):
        must = "a function of a picture, a key of the episode and a key of the step, or None"
        found.append(problem("vision.alter", "must", None, vision.alter, must=must))
    validation.raise_all(found, "`vision`")


def _check_altered(given: Any, shape: tuple[int, ...]) -> None:
    """Refuses what is no picture like the one that `alter` was given."""
    if not isinstance(given, (jax.Array, np.ndarray)):
        raise validation.error(
            [problem("vision.alter", "gives", None, Told(type(given).__name__), must=f"a picture, {shape} floats")]
        )
    if given.shape != shape:
        raise validation.error(
            [problem("vision.alter", "gives", None, given.shape, must=f"a picture of the shape {shape} that it gets")]
        )
    if not jnp.issubdtype(given.dtype, jnp.floating):
        must = "floats, as it gets them (colours from 0 to 1)"
        raise validation.error([problem("vision.alter", "gives", None, Told(given.dtype), must=must)])


def _takes_three(function: Any) -> bool:
    try:
        inspect.signature(function).bind(1, 2, 3)
    except (TypeError, ValueError):
        return False
    return True
