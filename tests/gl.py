"""Whether tests can draw with OpenGL, and pictures of many worlds by C MuJoCo."""

import os

import mujoco
import numpy as np
import pytest

needs_gl = pytest.mark.skipif(os.environ.get("MUJOCO_GL") == "disable", reason="no GL")

# What OpenGL holds of a model for all pictures.
HELD = ("tex_data", "mesh_vert", "hfield_data")
# The same, in arrays of the context that can be written.
TOLD = tuple(f"mat_{name}" for name in ("texid", "texrepeat", "texuniform"))


class Drawing(mujoco.Renderer):
    """MuJoCo's renderer for one world after the other, whose context takes longer to make than their pictures."""

    def of(self, model):
        """Draws this world from now on, which has the same textures and meshes as the first."""
        for name in HELD:
            np.testing.assert_array_equal(getattr(model, name), getattr(self.model, name))
        for name in TOLD:
            value = np.ravel(getattr(model, name))
            getattr(self._mjr_context, name)[: value.size] = value
        self._model = model
        assert self.model is model
