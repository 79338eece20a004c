"""Robots whose MJCF has a <compiler> of its own: what of it goes on to hold for their bodies, also where these vary."""

import re

import jax
import mujoco
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas import Uniform, dr

FLOOR = '<mujoco><worldbody><geom name="floor" type="plane" size="1 1 .1"/></worldbody></mujoco>'
ROBOT = """<mujoco><compiler {}/><worldbody><body name="base"><geom size=".05"/><body name="link" pos="0 0 .1"><joint axis="1 2 0"/>
  <geom name="g" type="box" size=".05 .03 .02" pos=".1 0 0"/><geom name="shell" size=".06" pos="0 .1 0" group="2"/>
  <body name="own" pos="0 0 .2"><joint/><inertial pos="0 0 0" mass="1" diaginertia=".01 .01 .01"/><geom name="cover" size=".1"/></body>
  </body></body></worldbody></mujoco>"""
GROUPS = 'inertiagrouprange="0 1"'


def with_robot(compiler, base=FLOOR, **terms):
    arena = mja.Arena.from_xml(base)
    arena.attach(mujoco.MjSpec.from_string(ROBOT.format(compiler)), prefix="r_")
    arena.vary(**terms)
    return arena


def largest_difference(arena, ranges):
    """Of three worlds from the compiled ones, relative to the numbers."""
    batch = arena.randomize(arena.put_model("jax"), mja.world_keys(0, range(3)), ranges)
    assert np.all(batch.valid)
    found = mja.differences(batch.model, {i: arena.compile(batch.world(i)) for i in range(3)})
    return max(found.values(), default=0.0)


@pytest.mark.parametrize("rule", ["boundmass", "boundinertia"])
@pytest.mark.parametrize(
    "term", [dr.Term("body.mass", "r_link"), dr.Term("geom.density", "r_g"), dr.Term("geom.size", "r_g")]
)
def test_bounds_of_what_varies_are_refused(rule, term):
    """They hold for each body by the MJCF that it comes from, and were taken for the arena's."""
    arena = with_robot(f'{rule}="0.5"', m=term)
    told = f"`arena.vary(m=...)`: body 'r_link' has {rule}=0.5 from the <compiler> of its MJCF"
    with pytest.raises(ValueError, match=rf"^{re.escape(told)}.* set it to 0 there\.$"):
        arena.mj_model  # noqa: B018 (compiles)


@pytest.mark.parametrize("rule", ["boundmass", "boundinertia"])
def test_bounds_of_what_stays_hold(rule):
    """Where no mass of the robot's varies, bodies are what its compiler makes of them, and nothing is told."""
    arena = with_robot(f'{rule}="20"', d=dr.Term("joint.damping", ".*"), s=dr.Term("geom.size", "r_cover"))
    ranges = mja.ArenaRanges(terms={"d": Uniform(0.5, 1.5), "s": Uniform(0.08, 0.12)})
    assert largest_difference(arena, ranges) < 1e-6
    assert getattr(arena.mj_model.body("r_link"), rule.removeprefix("bound")).min() == 20


def test_groups_are_those_of_the_robot():
    """Geoms outside its own `inertiagrouprange` weigh nothing, and cannot be given a density."""
    arena = with_robot(GROUPS, d=dr.Term("geom.density", "r_g"), s=dr.Term("geom.size", "r_g"))
    ranges = mja.ArenaRanges(terms={"d": Uniform(500.0, 2000.0), "s": Uniform(0.8, 1.2, relative="scale")})
    assert largest_difference(arena, ranges) < 1e-5
    with pytest.raises(ValueError, match=r"'r_shell'.*its group is outside `inertiagrouprange`"):
        with_robot(GROUPS).vary(d=dr.Term("geom.density", "r_shell"))


def test_groups_are_not_those_of_the_arena():
    """A robot's geoms weigh what they do, whatever groups the arena leaves out."""
    base = FLOOR.replace("<worldbody>", f"<compiler {GROUPS}/><worldbody>")
    arena = with_robot('inertiagrouprange="0 5"', base, d=dr.Term("geom.density", "r_shell"))
    ranges = mja.ArenaRanges(terms={"d": Uniform(500.0, 2000.0)})
    assert largest_difference(arena, ranges) < 1e-5
    batch = arena.randomize(arena.put_model("jax"), jax.random.split(jax.random.key(0), 3), ranges)
    assert np.ptp(batch.model.body_mass[:, arena.mj_model.body("r_link").id]) > 0.1


def test_total_mass_is_lost():
    """MuJoCo leaves out this one rule of a robot's compiler, which a warning says."""
    with pytest.warns() as told:
        with_robot('settotalmass="7"')
    assert any("settotalmass=7 of its compiler (arena: none)" in str(one.message) for one in told)
