"""What `check` says of contacts, objects and their steps is true of them: as a plain loop in C MuJoCo sees it."""

import mujoco
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas.checks import causes, watch

STILL = mja.ArenaRanges(table_rots=mja.Uniform(-1, 1))
HALF = {"wall": 0.1, "buoy": 0.1, "plate": 0.02, "stone": 0.05}  # smallest half extents of the geoms [m]
N_STEPS = 150
BODIES = """
<mujoco>
  <worldbody>
    <geom name="wall" type="box" size="0.3 0.3 0.1" pos="0 3 0.1"/>
    <body pos="0 3 {height}">
      <joint type="slide" axis="0 0 1"/>
      <geom name="buoy" size="0.1" mass="1"/>
    </body>
    <geom name="plate" type="box" size="0.3 0.3 0.02" pos="2 3 0.1"/>
    <body pos="2 3 0.4">
      <joint type="slide" axis="0 0 1"/>
      <geom name="stone" size="0.05" mass="50"/>
    </body>
  </worldbody>
</mujoco>"""


def shares(arena):
    """Of the pairs of geoms of world 2, by the names of the bodies that move: the depth as a share, after each step (S,)."""
    key = mja.world_keys(0, [2])[0]
    model, c = arena.c_world(arena.sample_params(key, STILL), key=key)
    found = {name: np.zeros(N_STEPS) for name in ("buoy", "stone")}
    for step in range(N_STEPS):
        mujoco.mj_step(model, c)
        for contact in c.contact:
            names = {model.geom(int(g)).name for g in contact.geom}
            if names <= set(HALF):
                (moves,) = names & set(found)
                found[moves][step] = max(found[moves][step], -contact.dist / min(HALF[name] for name in names))
    return found


def judged(arena, engine):
    found = mja.check(arena, STILL, worlds=[2], n_steps=N_STEPS, engine=engine).of(2)
    assert list(found) == ["deep_penetration"]
    return found["deep_penetration"]


@pytest.mark.slow
@pytest.mark.xslow_on("jax")
@pytest.mark.parametrize("engine", ["c", *(pytest.param(name, marks=pytest.mark.slow) for name in ("jax", "warp"))])
def test_two_pairs(engine):
    """The buoy is deep in the first step; later the stone falls deeper into its plate."""
    with pytest.warns(UserWarning, match="'buoy' and 'wall' 0.040 m"):
        arena = mja.TableArena(xml=BODIES.format(height=0.26), objects=[mja.Object("cube")])
    pairs = shares(arena)
    buoy, stone = pairs["buoy"], pairs["stone"]
    assert np.argmax(buoy > 0.25) == 0 < np.argmax(stone > 0.25) < stone.argmax()
    assert 0.25 < buoy.max() < stone.max()

    deep = judged(arena, engine)
    assert deep.step == 1
    most = deep.number
    assert most == pytest.approx(stone.max(), rel=1e-6 if engine == "c" else 1e-2)
    assert deep.what == (
        f"wall and buoy too deep, first in step 1; at worst plate and stone {most * HALF['plate']:.3g} m deep, "
        f"{100 * most:.0f} % of the smaller half extent, in step {stone.argmax() + 1}"
    )


def test_one_pair():
    """Where no other pair is deep before it, the pair of the deepest contact is the only one that is named."""
    arena = mja.TableArena(xml=BODIES.format(height=0.5), objects=[mja.Object("cube")])
    pairs = shares(arena)
    assert pairs["buoy"].max() < 0.25
    first, most = int(np.argmax(pairs["stone"] > 0.25)) + 1, pairs["stone"].max()
    assert first < pairs["stone"].argmax() + 1
    deep = judged(arena, "c")
    assert deep.step == first
    share = f"{100 * most:.0f} % of the smaller half extent"
    assert deep.what == f"plate and stone up to {most * HALF['plate']:.3g} m deep, {share}, first in step {first}"


def test_two_objects():
    """The step is that of the object that is first wrong, the number that of the worst; steps before the first are counted."""
    seen = watch.nothing(1, 2)._replace(
        off=np.array([[3, 9]], np.int32), outside=np.array([[0.1, 0.25]]), not_finite=np.array([12], np.int32)
    )
    found = causes.steps(seen, 0, ((), ()), ["ball", "cube"], before=100)
    assert found["off_table"][1:] == (
        103,
        0.25,
        "cube up to 0.25 m outside the edges, first in step 109; ball already in step 103",
    )
    assert found["not_finite"][1:3] == (112, 112)
    assert found["not_finite"].what.endswith(", first in step 112")
    seen = seen._replace(outside=np.array([[0.3, 0.25]]))
    what = causes.steps(seen, 0, ((), ()), ["ball", "cube"])["off_table"].what
    assert what == "ball up to 0.3 m outside the edges, first in step 3"
