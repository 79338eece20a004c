"""Draws the worlds of tests/views.py on this machine's device, which may have no OpenGL, for a machine that has it.

python tests/draw.py drawn.npz
MJX_ARENAS_DRAWN=drawn.npz python -m pytest tests/test_pixels.py -m slow -k "as_in_c and warp"
"""

import sys

import jax
import numpy as np
import views


def main(file: str) -> None:
    """Saves RGB, depth and segmentation of all worlds and cameras of all views."""
    saved = {}
    for name, view in views.VIEWS.items():
        pictures = jax.device_get(jax.jit(views.renderer(name))(*views.worlds(name, "warp", view.n)))
        saved |= {f"{name}.{c}.{kind}": x for c, seen in pictures.items() for kind, x in seen._asdict().items()}
        print(f"{name}: {view.n} worlds of {len(pictures)} cameras on {jax.devices()[0].device_kind}, in {file}")
    np.savez_compressed(file, **saved)


if __name__ == "__main__":
    main(sys.argv[1])
