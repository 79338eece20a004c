"""Whether tests can draw with OpenGL."""

import os

import pytest

needs_gl = pytest.mark.skipif(os.environ.get("MUJOCO_GL") == "disable", reason="no GL")
