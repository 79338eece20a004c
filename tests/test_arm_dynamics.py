"""An arm of which each episode has other masses, gains and damping: in tasks of arms, in C MuJoCo, in the configuration of a training."""

import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("mujoco_playground")

import mjx_arenas as mja
from mjx_arenas import dr
from mjx_arenas.envs import Lift, Reach, arms, worlds_in_c
from mjx_arenas.envs.tasks import configured, reach

N = 4
LIMITS = {"turret_torque": dr.Term("actuator.forcerange", "arm_turret")}
WEAKER = mja.Uniform([-50, 40], [-40, 50])


@pytest.mark.xslow
@pytest.mark.slow
def test_each_episode_has_another_arm(monkeypatch):
    """Masses, gains, damping and a term of the user's own are the recompiled world's, on MJX and where policies are judged in C."""
    ranges = reach.training_ranges()
    ranges = ranges._replace(terms={**ranges.terms, "turret_torque": WEAKER})
    config = {"impl": "jax", "episode_length": 2}
    env = Reach(config_overrides=config, ranges=ranges, terms=LIMITS, robot_strength=1.0)
    keys = jax.random.split(jax.random.key(7), N)
    episode = jax.device_get(jax.jit(jax.vmap(env.reset))(keys).info["episode"])
    built, world = [], worlds_in_c.world
    monkeypatch.setattr(worlds_in_c, "world", lambda *given: built.append(world(*given)) or built[-1])
    mja.evaluate(lambda obs, key: (jnp.zeros((N, 5)), {}), env, N, seed=7, engine="c")
    nominal = env.mj_model
    moves = np.flatnonzero(nominal.body_mass * nominal.body_weldid)  # the base keeps its mass
    arm = [i for i in moves if nominal.body(i).name.startswith("arm_")]
    rows = {"body_mass": arm, "body_ipos": arm, "dof_armature": slice(5), "dof_damping": slice(7)}
    rows |= {"actuator_gainprm": slice(7), "actuator_biasprm": slice(7), "actuator_forcerange": [0]}
    for w in range(N):
        params = jax.tree.map(lambda x, w=w: x[w], episode.params)
        for model in (env.arena.compile(params), built[w].model):
            for name, some in rows.items():
                here, there = episode.fields[name][w][some], getattr(model, name)[some]
                np.testing.assert_allclose(here, there, rtol=2e-6, atol=1e-7, err_msg=name)
                drawn = np.any(np.isclose(there, getattr(nominal, name)[some]), axis=None if there.ndim == 1 else 0)
                assert not np.all(drawn), name
        assert built[w].model.actuator("arm_turret").gainprm[0] == pytest.approx(params.terms["arm_kp"][0], rel=1e-6)
    for name in rows:
        assert np.ptp(episode.fields[name], axis=0).max() > 0, name


def test_recompiled_worlds_start_at_time_0():
    """Whatever the time of the keyframe is, as on MJX: by it tasks know that an episode starts."""
    arm = arms.small()
    arm.spec.key("home").time = 1.0
    env = Reach(arm=arm, config_overrides={"impl": "jax"})
    params = jax.device_get(env.arena.sample_params(jax.random.key(0), env.ranges))
    start = env.mj_model.key("arm_home")
    assert start.time == 1
    assert worlds_in_c.world(env, params, start.qpos, [], 0).data.time == 0


def test_preset_in_every_task():
    """Ranges of the user's own come before the preset's, at all levels of a curriculum; by default nothing of the arm varies."""
    own = mja.Uniform(0.5, 2.0, relative="scale")
    given = mja.ArenaRanges(terms={"arm_kp": own})
    env = Lift(ranges=lambda level: given, robot_strength=0.5)
    terms = env.ranges(1.0).terms
    assert terms["arm_kp"] == own
    assert terms["arm_mass"] == mja.Uniform(0.95, 1.05, relative="scale")
    assert {*terms} == {"arm_kp", "arm_mass", "arm_com", "arm_armature", "arm_damping", "arm_kv"}
    for wrong in (2, -0.5, True, None, float("nan"), np.ones(2)):
        with pytest.raises(ValueError, match=r"`robot_strength` must be a number from 0 to 1, got "):
            Reach(robot_strength=wrong)
    with pytest.raises(TypeError, match=r"`terms` must be dr.Terms by their names, such as \{'kp': .*\}, got list\."):
        Reach(terms=[LIMITS["turret_torque"]])
    assert {*Reach().ranges.terms} == {"arm_start"}


def test_own_terms_replace_those_of_the_preset():
    """By their names, since two terms must not decide the same number; their ranges are the user's alone."""
    terms = {"arm_kp": dr.Term("actuator.kp", "arm_turret")}
    with pytest.warns(
        UserWarning, match=r"^`terms\['arm_kp'\]` varies nothing, as `ranges\.terms` has no range 'arm_kp'\.$"
    ):
        env = Reach(terms=terms, robot_strength=np.float32(1.0))
    assert env.arena.elements("arm_kp") == ("arm_turret",)
    assert "arm_kp" not in env.ranges.terms
    assert "arm_kv" in env.ranges.terms
    with pytest.raises(ValueError, match=r"Terms 'arm_kp' and 'stiff' both decide .*: leave it to one of them\."):
        Reach(terms={"stiff": terms["arm_kp"]}, robot_strength=1.0)


def test_in_a_training():
    """Its configuration names both, as plain data; ranges of a wrong term are answered in a sentence that says where."""
    weak = {"turret_torque": {"Uniform": {"low": [-50, 40], "high": [-40, 50]}}}
    env = {
        "robot_strength": 1.0,
        "terms": {"turret_torque": {"attribute": "actuator.forcerange", "elements": "arm_turret"}},
    }
    config = {"task": "reach", "impl": "jax", "sees": "numbers", "env": env, "ranges": {"terms": weak}}
    made = configured.environment(config)
    assert made is not None
    assert made.ranges.terms["turret_torque"] == WEAKER
    assert made.ranges.terms["arm_mass"] == mja.Uniform(0.9, 1.1, relative="scale")
    assert made.arena.elements("turret_torque") == ("arm_turret",)
    beyond = configured.environment(config, "out_of_range")
    assert beyond is not None
    assert beyond.ranges.terms["turret_torque"] == WEAKER  # what the task has no wider range of
    assert beyond.ranges.terms["arm_start"] == reach.wider_ranges().terms["arm_start"]
    assert beyond.ranges.table_rots == reach.wider_ranges().table_rots
    config["env"] = {"terms": {"turret_torque": {"attribut": "actuator.forcerange"}}}
    with pytest.raises(ValueError, match=r"`env.terms`: .*attribut"):
        configured.environment(config)
    config["env"] = {"terms": ["torque"]}
    says = "`env.terms` must be terms by name, such as {torque: {attribute: actuator.forcerange, elements: arm_turret}}, got ['torque']."
    with pytest.raises(ValueError, match=f"^{re.escape(says)}$"):
        configured.environment(config)
