"""Bodies of whole models come and go while everything else varies: worlds are those that the compiler makes without them."""

import re

import numpy as np
import oracle
import pytest
from whole import elsewhere, everything, with_everything

from mjx_arenas import dr

GOING = {
    "acrobot": ("upper_arm",),
    "cartpole": ("cart",),
    "finger": ("proximal", "spinner"),
    "hopper": ("torso",),
    "pendulum": ("pole",),
    "point_mass": ("pointmass",),
    "reacher": ("arm",),
    "swimmer": ("head",),
    "walker": ("torso",),
    "panda": ("link0", "link1"),
    "yam": ("arm", "link_1"),
    "2f85": ("base_mount", "base"),
    "ur5e": ("base", "shoulder_link"),
    "shadow_hand": ("rh_forearm", "rh_wrist"),
    "force_clamp": ("world/body0",),
    "arm21": ("world/body0",),
}
"""Bodies of each model that hang on what is fixed, are not free, and that no tendon, actuator or equality ties to others."""


def coming(bodies):
    """Terms of all that varies, and of which of these bodies are there."""
    return lambda spec, model: (
        everything(spec, model) | {"body.active": dr.Term("body.active", list(map(re.escape, bodies)))}
    )


@pytest.mark.filterwarnings(
    "ignore:.arena.spec.. sensor .* reads the place where", "ignore:Mesh .* has a coplanar face"
)
@pytest.mark.slow
@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.xslow] * (name != "finger")) for name in GOING])
def test_what_is_left_is_compiled(name, impl):
    """Each element that is left, in a world without one of the bodies, or without any."""
    bodies = GOING[name]
    arena = with_everything(name, impl, coming(bodies))
    assert arena.elements("body_active") == bodies
    model = arena.put_model(impl)
    params = elsewhere(arena, 0.5)
    for there in {*map(tuple, ~np.eye(len(bodies), dtype=bool)), (False,) * len(bodies)}:
        world = params._replace(terms={**params.terms, "body_active": np.array(there)})
        compiled = arena.compile(world)
        assert compiled.nbody < arena.mj_model.nbody
        compared, off = oracle.of_what_is_left(arena.apply(model, world), arena.mj_model, compiled)
        assert off == set(), (name, there)
        assert len(compared) > 50
