"""What the errors of differences of places are relative to: the places, however large the scene is, and wherever it stands."""

import mujoco
import numpy as np
import pytest
from oracle import MUTATION, off

FIELDS = ["cam_poscom0", "light_poscom0", "stat.center"]


def scene(at, beside=0.0):
    """A body with a camera and a light, and another one beside it, lower and lighter than nothing."""
    x, y = at
    return mujoco.MjSpec.from_string(
        f"""<mujoco><worldbody>
          <body pos="{x} {y} .03"><freejoint/><geom type="box" size=".01 .02 .01" mass=".1"/>
            <geom size=".005" pos="0 0 .02" mass=".01"/><camera pos=".02 .01 .03"/><light pos="-.01 0 .04"/></body>
          <body pos="{x + beside} {y} .03"><geom size=".001"/></body></worldbody></mujoco>"""
    ).compile()


def value(model, field):
    return model.stat.center if field == "stat.center" else getattr(model, field)


@pytest.mark.parametrize("field", FIELDS)
def test_the_size_of_the_scene_excuses_nothing(field):
    """In a scene of 200 m, what is made of places of centimetres is held as exactly as without it."""
    model = scene((0.01, 0.02), beside=200.0)
    want = value(model, field)
    wrong = off(model, field, (1 + MUTATION) * want, want)
    assert wrong.any()
    assert wrong[..., 2].all()  # up: no end of the box is 200 m away
    assert not off(model, field, want.astype(np.float32), want).any()


@pytest.mark.parametrize("field", FIELDS)
def test_rounding_far_from_the_origin(field):
    """A kilometre off, places round by 3e-5 m, and so do their differences: this is allowed, and no more than it."""
    near, far = scene((0.0, 0.0)), scene((1000.3, 700.7))
    want = value(far, field)
    d = mujoco.MjData(far)
    mujoco.mj_forward(far, d)
    ends = {
        "cam_poscom0": (d.cam_xpos, -d.subtree_com[[1]]),
        "light_poscom0": (d.light_xpos, -d.subtree_com[[1]]),
        "stat.center": (want + 0.1, want - 0.1),
    }[field]
    got = sum(end.astype(np.float32) for end in ends) / (2 if field == "stat.center" else 1)
    assert np.abs(got - want).max() > 1e-6
    assert not off(far, field, got, want).any()
    assert off(near, field, value(near, field) + (got - want), value(near, field)).any()
