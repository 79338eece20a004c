"""One world seen from above, with its numbers (host)."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from mjx_arenas.layout import Layout
from mjx_arenas.objects import PALETTE
from mjx_arenas.render import extra

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Circle = tuple[Sequence[float], float]  # centre (x, y) and radius [m]

_TABLE, _FIXED = "0.93", "0.72"  # greys
_HATCHES = ("", "//", "..", "xx", "\\\\", "++", "oo")
_ROUND = np.linspace(0, 2 * np.pi, 48, endpoint=False)
