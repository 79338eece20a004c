"""Textures that are computed: what `arena.add_material` puts on tables, objects and floors (host).

`mja.textures.Wood(seed=1)` is always the same picture; a seed for each of many materials makes a collection to draw from.
"""

import abc
import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from mjx_arenas.keywords import WithKnownArguments
from mjx_arenas.problem import Problem, problem
from mjx_arenas.rules import validation
from mjx_arenas.spec import calls

__all__ = ["Checker", "Flat", "Gradient", "Noise", "Texture", "Wood"]

LARGEST = 4096
"""Most pixels along a side of a texture."""
_OCTAVES = 6


@dataclasses.dataclass(frozen=True, kw_only=True)
class Texture(WithKnownArguments, abc.ABC):
    """Base class of textures.

    Args:
        size: number of pixels along each side.
    """

    size: int = 256

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if field.name.startswith("rgb") and isinstance(numbers := calls.plain(value), list):
                object.__setattr__(self, field.name, tuple(numbers))

    def problems(self) -> list[Problem]:
        """What is wrong with its numbers; empty if nothing is."""
        found = [] if validation.is_whole(self.size, 1, LARGEST) else [_whole("size", self.size, LARGEST)]
        for name in [field.name for field in dataclasses.fields(self) if field.name.startswith("rgb")]:
            color = getattr(self, name)
            wrong = validation.vector_problems(name, color, 3, "from 0 to 1")
            if not wrong and not all(0 <= x <= 1 for x in color):
                wrong = [problem(name, "limits", None, color, between="between 0 and 1")]
            found += wrong
        return found

    def pixels(self) -> np.ndarray:
        """(size, size, 3) uint8, red, green and blue.

        Raises:
            ValueError: all that is wrong with its numbers, or the colours of a class of your own are none.
        """
        validation.raise_all(self.problems(), f"`{type(self).__name__}`")
        colors = self._colors()
        validation.raise_all(_colors_problems(f"{type(self).__name__}._colors()", colors, self.size), "the texture")
        return np.round(255 * np.asarray(colors, float)).astype(np.uint8)

    @abc.abstractmethod
    def _colors(self) -> np.ndarray:
        """(size, size, 3) from 0 to 1."""


@dataclasses.dataclass(frozen=True)
class Flat(Texture):
    """A texture of one colour.

    Args:
        rgb: (3,) colour from 0 to 1.
    """

    rgb: Sequence[float]

    def _colors(self) -> np.ndarray:
        return np.broadcast_to(np.asarray(self.rgb, float), (self.size, self.size, 3))


@dataclasses.dataclass(frozen=True)
class Checker(Texture):
    """A checkerboard. With an even `n` it tiles without a seam.

    Args:
        rgb1: (3,) colour of the square in the corner, from 0 to 1.
        rgb2: (3,) colour of its neighbours.
        n: number of squares along each side.
    """

    rgb1: Sequence[float] = (0.85, 0.85, 0.82)
    rgb2: Sequence[float] = (0.25, 0.28, 0.32)
    n: int = 8

    def problems(self) -> list[Problem]:
        return super().problems() + _count_problems("n", self.n, self.size)

    def _colors(self) -> np.ndarray:
        square = np.arange(self.size) * self.n // self.size
        return _mixed(self.rgb1, self.rgb2, (square[:, None] + square) % 2)


@dataclasses.dataclass(frozen=True)
class Gradient(Texture):
    """A gradient from one colour in the first row to another in the last.

    Args:
        rgb1: (3,) colour of the first row, from 0 to 1.
        rgb2: (3,) colour of the last row.
    """

    rgb1: Sequence[float] = (0.9, 0.9, 0.88)
    rgb2: Sequence[float] = (0.45, 0.52, 0.6)

    def _colors(self) -> np.ndarray:
        share = np.arange(self.size) / max(self.size - 1, 1)
        return _mixed(self.rgb1, self.rgb2, np.broadcast_to(share[:, None], (self.size, self.size)))


@dataclasses.dataclass(frozen=True)
class Noise(Texture):
    """Smooth noise in octaves, like stone or plaster. It tiles without a seam in both directions.

    Args:
        rgb1: (3,) colour of the lowest numbers, from 0 to 1.
        rgb2: (3,) colour of the highest numbers.
        scale: number of spots of the coarsest octave along each side; each further octave has twice as many.
        seed: seed of the noise.
    """

    rgb1: Sequence[float] = (0.56, 0.54, 0.51)
    rgb2: Sequence[float] = (0.88, 0.86, 0.82)
    scale: int = 8
    seed: int = 0

    def problems(self) -> list[Problem]:
        return super().problems() + _count_problems("scale", self.scale, self.size) + _seed_problems(self.seed)

    def _colors(self) -> np.ndarray:
        height = _octaves(np.random.default_rng(self.seed), self.size, (self.scale, self.scale), 0.85)
        return _mixed(self.rgb1, self.rgb2, _spread(height))


@dataclasses.dataclass(frozen=True)
class Wood(Texture):
    """A board: the rings of a trunk, which is not quite straight, cut lengthwise, with fibres and pores.

    The grain runs along the rows, and tiles without a seam in that direction. Across the grain the texture has the edges of a board.

    Args:
        rgb1: (3,) colour of the wood that grows in spring, from 0 to 1.
        rgb2: (3,) colour of the dark lines that end the rings.
        rings: number of rings across the width of the board, > 0.
        seed: seed of the trunk.
    """

    rgb1: Sequence[float] = (0.8, 0.62, 0.42)
    rgb2: Sequence[float] = (0.5, 0.32, 0.18)
    rings: float = 18.0
    seed: int = 0

    def problems(self) -> list[Problem]:
        found = validation.vector_problems("rings", self.rings, 0, "")
        most = self.size if validation.is_whole(self.size, 1) else LARGEST  # of another size its own problem is told
        if not found and not 0 < self.rings <= most:
            found = [problem("rings", "must", None, self.rings, must=f"> 0 and at most {most}, its `size`")]
        return super().problems() + found + _seed_problems(self.seed)

    def _colors(self) -> np.ndarray:
        """Rings are where the distance from the pith, bent by noise, is a whole number of their widths.

        The pith is `deep` below the board, which it leaves and approaches along the grain: there rings close into arches.
        """
        rng, n = np.random.default_rng(self.seed), self.size
        across = (np.arange(n)[:, None] + 0.5) / n - rng.uniform(-0.1, 1.1)
        deep = 0.12 + 0.2 * _spread(_octaves(rng, n, (1, 2), 0.35, 2))[:1]  # (1, n): along the grain alone
        bent = 0.07 * (_spread(_octaves(rng, n, (3, 1), 0.45, 4)) - 0.5)
        ends = np.cumsum(rng.uniform(0.4, 1.6, 3 * math.ceil(self.rings) + 3))  # of rings, in their mean width
        age = np.interp(self.rings * np.hypot(across + bent, deep), [0, *ends], np.arange(len(ends) + 1))
        ring = age % 1
        late = ring**3 * np.clip((1 - ring) / 0.1, 0, 1)  # darker with the season, then light again at once
        fibres = _spread(_octaves(rng, n, (64, 2), 0.9, 3))
        pores = np.clip(_spread(_octaves(rng, n, (128, 6), 0.6, 2)) / 0.2 - 4, 0, 1)
        broad = _spread(_octaves(rng, n, (3, 1), 0.6, 3))
        share = 0.6 * late + 0.28 * fibres + 0.3 * pores + 0.22 * broad - 0.1
        return _mixed(self.rgb1, self.rgb2, np.clip(share, 0, 1))


def _mixed(rgb1: Sequence[float], rgb2: Sequence[float], share: np.ndarray) -> np.ndarray:
    """(..., 3) from the first colour to the second, by the share (...) that the second has."""
    first, second = np.asarray(rgb1, float), np.asarray(rgb2, float)
    return first + (second - first) * share[..., None]


def _octaves(
    rng: np.random.Generator, size: int, cells: tuple[int, int], lasting: float, octaves: int = _OCTAVES
) -> np.ndarray:
    """(size, size) smooth noise from 0 to 1 that repeats: random numbers on ever finer lattices, each with less weight.

    Args:
        rng: of the numbers.
        size: pixels along each side.
        cells: of the coarsest lattice, down and along the rows; each octave has twice as many, while they are not below a pixel.
        lasting: weight of each octave, of the one before.
        octaves: at most so many.
    """
    total, weight = np.zeros((size, size)), 0.0
    for octave in range(octaves):
        shape = tuple(n << octave for n in cells)
        if max(shape) > size and octave:
            break
        lattice = rng.random(shape)
        total += lasting**octave * _smooth(_smooth(lattice, size).T, size).T
        weight += lasting**octave
    return total / weight


def _smooth(lattice: np.ndarray, size: int) -> np.ndarray:
    """(size, M) of a lattice (N, M), down the columns: its uniform cubic B-spline, which repeats."""
    n = len(lattice)
    at, t = np.divmod(np.arange(size) * (n / size), 1)
    weights = ((1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3)
    near = (lattice[(at.astype(int) + k - 1) % n] for k in range(4))
    return sum(weight[:, None] / 6 * values for weight, values in zip(weights, near, strict=True))  # type: ignore[return-value]


def _spread(values: np.ndarray) -> np.ndarray:
    """The same from 0 to 1, whatever its range was, about as many near each number."""
    scale = values.std()
    return 0.5 + 0.5 * np.tanh(0.6 * (values - values.mean()) / scale) if scale else np.full_like(values, 0.5)


def _colors_problems(name: str, colors: object, size: int) -> list[Problem]:
    """What are no colours of a texture, each channel of which rounds to a byte."""
    try:
        numbers = np.asarray(colors)
    except ValueError:  # lists of different lengths
        numbers = np.array(None)
    if numbers.dtype.kind not in "fiu":
        got = type(colors).__name__ if numbers.dtype == object else f"{numbers.dtype} of shape {numbers.shape}"
    elif numbers.shape != (size, size, 3):
        got = f"{numbers.dtype} of shape {numbers.shape}"
    elif not ((shades := np.round(255 * numbers.astype(float))) >= 0).all() or not (shades <= 255).all():
        got = f"numbers from {numbers.min():g} to {numbers.max():g}"
    else:
        return []
    return [problem(name, "must", None, None, {"must": f"({size}, {size}, 3) numbers from 0 to 1", "got": got})]


def _whole(name: str, value: object, most: int) -> Problem:
    return problem(name, "must", None, value, must=f"a whole number from 1 to {most}")


def _count_problems(name: str, value: object, size: object) -> list[Problem]:
    """What are not as many of something along a side as it has pixels, at most."""
    most = int(size) if validation.is_whole(size, 1, LARGEST) else LARGEST  # type: ignore[call-overload]
    return [] if validation.is_whole(value, 1, most) else [_whole(name, value, most)]


def _seed_problems(seed: object) -> list[Problem]:
    return [] if validation.is_whole(seed, 0, 2**32 - 1) else [problem("seed", "seed", None, seed)]
