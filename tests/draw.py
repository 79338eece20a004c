"""Draws the worlds of tests/test_pixels.py on this machine's device, which may have no OpenGL, for a machine that has it.

python tests/draw.py drawn.npz
MJX_ARENAS_DRAWN=drawn.npz python -m pytest tests/test_pixels.py -m slow -k "as_in_c and warp"
"""

import sys

import jax
import numpy as np
import test_pixels


def main(file: str) -> None:
    """Saves RGB, depth and segmentation of all worlds and cameras."""
    arena = test_pixels.made()
    drawing = test_pixels.renderer(arena)
    pictures = jax.device_get(jax.jit(drawing)(*test_pixels.worlds(arena, "warp", test_pixels.N)))
    np.savez_compressed(
        file, **{f"{c}.{kind}": x for c, seen in pictures.items() for kind, x in seen._asdict().items()}
    )
    print(f"{test_pixels.N} worlds of {len(pictures)} cameras on {jax.devices()[0].device_kind}, in {file}")


if __name__ == "__main__":
    main(sys.argv[1])
