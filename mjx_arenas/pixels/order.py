"""The order in which the ray caster draws the pixels of a picture."""

import dataclasses
import math
from collections.abc import Iterable
from typing import TypeVar

import jax
import numpy as np

from mjx_arenas.record.record import Record

_BLOCK = 8  # rays of 8 by 8 pixels stand beside each other: they meet the same things, which the GPU draws a fifth faster than rows

_Pixels = TypeVar("_Pixels", jax.Array, np.ndarray)


@dataclasses.dataclass(frozen=True)
class Order:
    """The order of the pixels of all pictures of a renderer."""

    lenses_vary: bool
    """Then rays are computed in each world, and pixels stand in rows; else rays are made once, and pixels stand in blocks."""

    @classmethod
    def of(cls, record: Record) -> "Order":
        """That of the pictures of an arena."""
        return cls(any(owned.field in ("cam_fovy", "cam_intrinsic") for owned in record.scene.owned))

    def drawn(self, sizes: Iterable[tuple[int, int]]) -> np.ndarray:
        """(n,) the pixels of pictures (width, height), numbered in rows, picture after picture, as they are drawn one after the other."""
        found, start = [], 0
        for width, height in sizes:
            pixels = start + np.arange(width * height).reshape(height, width)
            start += pixels.size
            if not self.lenses_vary:
                rows, columns = _block(width, height)
                pixels = pixels.reshape(height // rows, rows, width // columns, columns).swapaxes(1, 2)
            found.append(pixels.reshape(-1))
        return np.concatenate(found)

    def picture(self, width: int, height: int, pixels: _Pixels) -> _Pixels:
        """(height, width, ...) of the pixels (height * width, ...) of a picture as they are drawn."""
        rest = pixels.shape[1:]
        if self.lenses_vary:
            return pixels.reshape(height, width, *rest)
        rows, columns = _block(width, height)
        blocks = pixels.reshape(height // rows, width // columns, rows, columns, *rest)
        return blocks.swapaxes(1, 2).reshape(height, width, *rest)


def _block(width: int, height: int) -> tuple[int, int]:
    """Rows and columns of a block."""
    return math.gcd(height, _BLOCK), math.gcd(width, _BLOCK)
