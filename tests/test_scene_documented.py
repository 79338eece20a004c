"""docs/scene.md: its code runs as it stands, and its worlds are those that MuJoCo compiles."""

import pathlib
import re

import mujoco
import numpy as np
import pytest
from oracle import STRUCTURE_MAY_DIFFER, from_compiled

pytestmark = (
    pytest.mark.slow
)  # its terms and objects are held against compiled worlds in test_scene_objects, test_scene_tables and test_dr

ROOT = pathlib.Path(__file__).parent.parent
TEXT = (ROOT / "docs" / "scene.md").read_text()


@pytest.fixture(scope="module")
def office():
    """What the names of the code stand for."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(ROOT)
        names = {}
        exec(compile(re.search(r"```python\n(.*?)```", TEXT, flags=re.DOTALL)[1], "docs/scene.md", "exec"), names)
    return names


def test_oracle(office):
    """Each world is the compiled one."""
    arena, batch = office["arena"], office["batch"]
    assert batch.valid.all()
    model, apply = arena.put_model("warp"), arena.apply
    for i in range(3):
        params = batch.world(i)
        world = apply(model, params)
        there = params._replace(object_active=np.ones(4, bool))
        assert from_compiled(apply(model, there), arena.compile(there)) <= STRUCTURE_MAY_DIFFER.keys()
        assert bool(world.body_mass[arena.mj_model.body("mug").id] > 0) == bool(params.object_active[0])


def test_doors_and_objects_start(office):
    """The door starts as drawn; what is placed rests in C MuJoCo on its table, the bottle on its side."""
    arena, batch, data = (office[name] for name in ("arena", "batch", "data"))
    adr = arena.mj_model.joint("door_hinge").qposadr[0]
    np.testing.assert_allclose(data.qpos[:, adr], batch.params.terms["door"][:, 0], rtol=1e-6)
    params = batch.world(2)._replace(object_active=np.ones(4, bool))
    model, twin = arena.c_world(params, key=office["keys"][2])
    assert arena.place(params, office["keys"][2]).valid.all()
    assert twin.joint("door_hinge").qpos[0] == pytest.approx(float(params.terms["door"][0]), rel=1e-6)
    mujoco.mj_step(model, twin, 200)
    z = [twin.body(o.name).xpos[2] for o in arena.objects]
    np.testing.assert_allclose(z, arena.rest_heights(params), atol=1e-3)
    assert abs(twin.body("bottle").xmat.reshape(3, 3)[2, 2]) < 0.05


def test_words(office):
    """What is there is described by its names."""
    text = str(office["arena"].describe(office["batch"].world(0)))
    assert all(name in text for name in ("desk", "low", "high", "mug", "book", "bottle", "cube", "door_hinge"))
