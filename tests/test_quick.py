"""Specs that compile fast: what they are is what decides a model."""

import mujoco
import numpy as np
import pytest

from mjx_arenas.spec.quick import boxed

MESHES = """<mujoco><asset>
<mesh name="hull" vertex="0 0 0 .3 0 0 0 .2 0 0 0 .1 .3 .2 .1 .1 .1 .2" scale="1 2 1" refpos=".1 0 0"/>
<mesh name="seen" vertex="1 0 0 1.3 0 0 1 .2 0 1 0 .1 1.2 .1 .3"/>
<mesh name="heavy" vertex="0 0 0 .1 0 0 0 .1 0 0 0 .1"/>
<mesh name="fitted" vertex="0 0 0 .1 0 0 0 .1 0 0 0 .1 .1 .1 .1"/></asset><worldbody>
<body name="link" pos="0 0 1"><inertial pos="0 0 0" mass="2" diaginertia=".1 .1 .1"/><joint/>
<geom name="hull" type="mesh" mesh="hull" pos=".1 .2 .3" euler="10 20 30"/><geom name="hull_too" type="mesh" mesh="hull"/>
<geom name="seen" type="mesh" mesh="seen" contype="0" conaffinity="0" group="2"/></body>
<body name="stone" pos="2 0 1"><freejoint/><geom name="stone" type="mesh" mesh="heavy"/></body>
<body name="block" pos="3 0 1"><inertial pos="0 0 0" mass="2" diaginertia=".1 .1 .1"/><joint/>
<geom name="block" type="box" mesh="fitted"/></body>
</worldbody></mujoco>"""


@pytest.mark.parametrize("before", [False, True], ids=["fresh", "compiled before"])
def test_boxes_for_meshes(before):
    """A mesh is a box with its bounds, unless a body weighs what it weighs or a geom has its size."""
    spec = mujoco.MjSpec.from_string(MESHES)
    model = spec.copy().compile()
    if before:
        spec.compile()
    quick = boxed(spec, model).compile()
    points = {quick.mesh(i).name: int(quick.mesh_vertnum[i]) for i in range(quick.nmesh)}
    assert points == {"hull": 8, "seen": 8, "heavy": 4, "fitted": 5}
    kept = boxed(spec, model, ["hull_too"]).compile()
    assert [int(kept.mesh(name).vertnum[0]) for name in ("hull", "seen")] == [6, 8]
    assert [quick.geom(i).name for i in range(quick.ngeom)] == [model.geom(i).name for i in range(model.ngeom)]
    for field in ("body_mass", "body_inertia", "body_ipos", "body_iquat", "geom_contype", "geom_type", "qpos0"):
        np.testing.assert_array_equal(getattr(quick, field), getattr(model, field), err_msg=field)
    for name in ("hull", "hull_too", "seen"):
        points, axes = _points(model, name)
        np.testing.assert_allclose(_extent(_points(quick, name)[0] @ axes), _extent(points @ axes), atol=1e-6)
    for name in ("stone", "block"):
        for field in ("geom_pos", "geom_size", "geom_aabb"):
            np.testing.assert_array_equal(
                getattr(quick, field)[quick.geom(name).id], getattr(model, field)[model.geom(name).id]
            )


def _points(model, name):
    """The points of a geom's mesh in the world, and the geom's axes."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    geom, mesh = model.geom(name).id, model.geom(name).dataid[0]
    axes = data.geom_xmat[geom].reshape(3, 3)
    points = model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]]
    return data.geom_xpos[geom] + points @ axes.T, axes


def _extent(points):
    return np.stack([points.min(0), points.max(0)])
