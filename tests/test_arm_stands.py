"""Where the base of an arm is in each world of a task, and how high, which decides what it reaches there."""

import jax
import numpy as np
import pytest

pytest.importorskip("mujoco_playground")

from worlds import elliptic

import mjx_arenas as mja
from mjx_arenas import dr, furniture
from mjx_arenas.envs import PickAndPlace, arms

N = 3
TURNED = mja.Uniform(-3.0, 3.0)
MOVED = {"foot": mja.Uniform(-0.1, 0.1, relative="add")}
THICK = mja.Uniform([0.8, 0.8, 0.03], [1.0, 1.0, 0.08])
SHIFTED = mja.Uniform(-0.2, 0.2, relative="add")
PLACES = {
    "table": ("table", {"table_rots": TURNED, "table_offsets": SHIFTED, "table_full_sizes": THICK}),
    "part as a whole": (
        "unit",
        {"terms": {"unit.rot": TURNED, "unit.pos": mja.Uniform([-0.2] * 3, [0.2] * 3, relative="add")}},
    ),
    "surface": ("unit_top", {"terms": {"unit.rot": TURNED, "unit.heights": mja.Uniform(0.9, 1.1, relative="scale")}}),
    "world": (None, {}),
}


@pytest.mark.slow
@pytest.mark.filterwarnings(
    "ignore:`(arena|goals)`. .* is on (table 0|'unit_top')"
)  # which is far from the unit, and from the world's origin
@pytest.mark.parametrize("case", PLACES)
def test_base(case):
    """It is that of the recompiled world, also where the MJCF has it beside its origin, and where a term moves it."""
    on, given = PLACES[case]
    arm = arms.small()
    arm.spec.body("base").pos = (0.1, 0.05, 0.0)
    arena = elliptic(mja.TableArena(objects=[mja.Object("cube", full_size=0.04)]))
    arena.add_part(furniture.Drawers("unit", pos=(1.5, 0.5, 0.0), stays=True))
    ranges = mja.ArenaRanges(**given | {"terms": MOVED | given.get("terms", {})})
    terms = {"foot": dr.Term("body.pos", "arm_base")}
    env = PickAndPlace(
        arena=arena,
        arm=arm,
        on=on,
        pos=(0.05, -0.02, 0.0 if on == "table" else 1.0),
        goals="unit_top",
        ranges=ranges,
        terms=terms,
    )
    for key in jax.random.split(jax.random.key(3), N):
        params = jax.device_get(env.arena.sample_params(key, ranges))
        _, data = env.arena.c_world(params)
        there = data.body("arm_base").xpos
        np.testing.assert_allclose(env.foot.at(params), there, rtol=2e-6, atol=2e-6)
