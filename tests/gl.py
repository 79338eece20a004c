"""Whether tests can draw with OpenGL, and pictures of many worlds by C MuJoCo."""

import os

import mujoco
import numpy as np
import pytest

needs_gl = pytest.mark.skipif(os.environ.get("MUJOCO_GL") == "disable", reason="no GL")

# What OpenGL holds of a model for all pictures.
HELD = [f"mat_{name}" for name in ("texid", "texrepeat", "texuniform")] + ["tex_data", "mesh_vert", "hfield_data"]


class Drawing(mujoco.Renderer):
    """MuJoCo's renderer for one world after the other, whose context takes longer to make than their pictures."""

    def of(self, model):
        """Draws this world from now on, which looks for the same materials, textures and meshes as the first."""
        for name in HELD:
            np.testing.assert_array_equal(getattr(model, name), getattr(self.model, name))
        self._model = model
        assert self.model is model
