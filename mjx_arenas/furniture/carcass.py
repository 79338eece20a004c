"""What cupboards and drawer units stand in: a box that is open to the front."""

from mjx_arenas.furniture.part import Box
from mjx_arenas.geometry import Array


def carcass(depth: Array, width: Array, height: Array, thick: Array) -> list[Box]:
    """Bottom, top, back and two sides with these outer measures [m]; no two of them overlap."""
    x, y, z, t = depth / 2, width / 2, height / 2, thick / 2
    return [
        Box("right", (0.0, -y + t, z), (x, t, z)),
        Box("left", (0.0, y - t, z), (x, t, z)),
        Box("bottom", (0.0, 0.0, t), (x, y - 2 * t, t)),
        Box("top", (0.0, 0.0, height - t), (x, y - 2 * t, t)),
        Box("back", (x - t, 0.0, z), (t, y - 2 * t, z - 2 * t)),
    ]
