"""Specs that compile fast: MuJoCo makes the pixels of a sky anew in each compile, for 0.1 s."""

import mujoco


def unpainted(spec: mujoco.MjSpec) -> mujoco.MjSpec:
    """A copy with the smallest textures that still show their colours; those of files are of one colour."""
    spec = spec.copy()
    for texture in spec.textures:
        if texture.builtin == mujoco.mjtBuiltin.mjBUILTIN_NONE:
            texture.builtin = mujoco.mjtBuiltin.mjBUILTIN_FLAT
        texture.width = texture.height = 3
        texture.file, texture.data = "", b""
        texture.cubefiles = ["" for _ in texture.cubefiles]
    return spec
