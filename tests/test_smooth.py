"""A sliding friction below 1e-5 is refused on JAX and flagged where it varies: MuJoCo takes 1e-5, and MJX on JAX does not."""

import re

import jax
import mujoco
import numpy as np
import pytest
import test_left_out

import mjx_arenas as mja
from mjx_arenas import dr, furniture

pytestmark = [pytest.mark.filterwarnings("ignore:The arena. geoms are inside each other", "ignore:.*MJ_MINMU")]
pytestmark += [pytest.mark.filterwarnings("ignore:`ranges` gives few valid worlds")]
SAID = "with a sliding friction below 1e-5, which MuJoCo takes for 1e-5: give it 1e-5 and the model an elliptic cone, or use impl='warp'"
SMOOTH = 'friction="0"'


def scene(**given):
    xml = test_left_out.of(**given)
    return xml if "pair" in given else re.sub(r"<contact>.*</contact>", "", xml)


CASES = {
    "both": (scene(ball=SMOOTH, floor='friction="1e-6"'), "geom 'floor'"),
    "of priority": (scene(ball=f'{SMOOTH} priority="1"'), "geom 'ball'"),
    "condim of one": (scene(ball=f'{SMOOTH} condim="1"', floor=f'{SMOOTH} condim="4"'), "geom 'floor'"),
    "pair": (scene(pair=SMOOTH), "pair 'p'"),
    "one of two": (scene(ball=SMOOTH), ""),
    "no friction": (scene(ball=f'{SMOOTH} condim="1"', floor=f'{SMOOTH} condim="1"'), ""),
    "of priority, condim 1": (scene(ball=f'{SMOOTH} condim="1" priority="1"', floor=SMOOTH), ""),
    "pair without friction": (scene(pair=f'{SMOOTH} condim="1"'), ""),
    "no contacts": (scene(ball=SMOOTH, floor=SMOOTH, option='><flag contact="disable"/></option><option '), ""),
    "others of the contact": (scene(ball='condim="6" friction="1 0 0"', floor='friction="1 0 0"'), ""),
    "the least": (scene(ball='friction="1e-5"', floor=SMOOTH), ""),
}


@pytest.mark.parametrize("case", CASES)
def test_refused(case):
    xml, name = CASES[case]
    mja.Arena.from_xml(xml).put_model("warp")
    arena = mja.Arena.from_xml(xml)
    if not name:
        arena.put_model("jax")
        return
    with pytest.raises(ValueError, match=f"^impl='jax' of MJX has contacts of {name} {re.escape(SAID)}"):
        arena.put_model("jax")


def flagged(arena, ranges, n, least, name):
    """In which worlds the least friction is enough, as the flags and the sentences say."""
    batch = arena.randomize(arena.put_model("jax"), jax.random.split(jax.random.key(0), n), ranges)
    right = least(batch.model) >= np.float32(mujoco.mjMINMU)
    assert 0.2 * n < right.sum() < 0.8 * n
    np.testing.assert_array_equal(batch.valid, right)
    (said,) = arena.problems(batch.world(int(np.argmin(right))))
    assert said == (
        f"The sliding friction of {name} is below 1e-5: MuJoCo takes 1e-5 instead, and MJX on JAX does not. Give it 1e-5."
    )
    assert not arena.problems(batch.world(int(np.argmax(right))))
    arena.c_world(batch.world(int(np.argmin(right))))


FEW = mja.Choice([[0.0, 0.0, 0.0], [1e-6, 0.0, 0.0], [1e-5, 0.0, 0.0], [1.0, 0.0, 0.0]])


def test_terms():
    """Of geoms: the larger of two counts."""
    arena = mja.Arena.from_xml(scene(floor='friction="1"'))
    arena.vary(ball=dr.Term("geom.friction", "ball"), floor=dr.Term("geom.friction", "floor"))
    ranges = mja.ArenaRanges(terms={"ball": FEW, "floor": FEW})
    flagged(
        arena, ranges, 60, lambda m: np.asarray(m.geom_friction)[:, [0, -1], 0].max(1), "geom 'floor' and geom 'ball'"
    )


def test_terms_of_pairs():
    arena = mja.Arena.from_xml(scene(pair='friction="1"'))
    arena.vary(p=dr.Term("pair.friction", "p", axes="sliding"))
    ranges = mja.ArenaRanges(terms={"p": mja.Choice([0.0, 1e-6, 1e-5, 1.0])})
    flagged(arena, ranges, 40, lambda m: np.asarray(m.pair_friction)[:, 0, 0], "pair 'p'")


def test_other_axes():
    """Torsional and rolling friction may be 0, and are no reason to look at the contact."""
    arena = mja.Arena.from_xml(scene(ball='condim="6"'))
    arena.vary(x=dr.Term("geom.friction", "ball", axes="rolling"))
    assert arena.record.rules.sliding.names == ()


@pytest.mark.slow
def test_tables_and_parts():
    """Tables and parts have the priority here, so that no friction of an object helps; contacts of one friction are one."""
    arena = mja.TableArena(objects=[mja.Object("cube", condim=4)])
    arena.add_part(furniture.Shelf("shelf", pos=(2, 0, 0)))
    arena.add_object(mja.Object("toy", on="shelf_board1"))
    assert len(arena.record.rules.sliding.names) < 6
    table = lambda m: np.asarray(m.geom_friction)[:, arena.mj_model.geom("table_collision").id, 0]  # noqa: E731
    name = "geom 'table_collision' and geom 'cube_g0'"
    flagged(arena, mja.ArenaRanges(table_frictions=FEW), 40, table, name)


def test_without_names():
    """A geom without a name is called by its body, and by a number where its numbers vary."""
    xml = """<mujoco><worldbody><geom type="plane" size="5 5 .1" friction="0"/><body name="puck" pos="0 0 1"><freejoint/>
    <geom size=".1"/></body></worldbody></mujoco>"""
    arena = mja.Arena.from_xml(xml)
    arena.vary(x=dr.Term("geom.friction", bodies="puck"))
    name = "an unnamed geom of body 'world' and geom 'puck/geom0'"
    least = lambda m: np.asarray(m.geom_friction)[..., -1, 0]  # noqa: E731
    flagged(arena, mja.ArenaRanges(terms={"x": FEW}), 40, least, name)
