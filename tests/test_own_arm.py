"""The arm of docs/how_to/own_arm.md: its page runs, it is trained from its file, and a script lifts boxes with it."""

import functools
import re
import sys

import jax
import jax.numpy as jnp
import pages
import pytest

pytest.importorskip("mujoco_playground")

import models
from test_arms import lifting

from mjx_arenas import settings
from mjx_arenas.envs import Lift
from mjx_arenas.envs.tasks import configured

pytestmark = pytest.mark.slow
PAGE = "docs/how_to/own_arm.md"
WORLDS = 4


@pytest.fixture(autouse=True)
def robots(monkeypatch):
    """The robots of packages are beside the tests, not in the environment."""
    if not models.ROBOTS.exists():
        pytest.skip("needs tests/robots.txt")
    monkeypatch.setattr(sys, "path", [*sys.path, str(models.ROBOTS)])


@functools.cache
def documented():
    """Names of the page after its code has run."""
    names = {}
    for code, _ in pages.blocks(PAGE):
        exec(compile(code, "docs", "exec"), names)
    return names


def test_page():
    """The report is the printed one, and the environment has what the page says."""
    names, text = documented(), pages.text(PAGE)
    assert names["report"].ok
    assert str(names["report"]) == re.search(r"```text\n(.*?)\n```", text, flags=re.DOTALL)[1]
    env = names["env"]
    assert {"arm_start", "arm_mass", "arm_damping", "arm_kp", "arm_kv"} <= {*env.ranges.terms}
    assert env.flaws is not None
    assert env.finger_joints == ("arm_2f85_split",)
    assert env.config.action_delay == (0, 2)


def test_file(tmp_path, monkeypatch):
    """The same environment, by the page's file and module."""
    (tmp_path / "ur5e.py").write_text(next(code for code, title in pages.blocks(PAGE) if title == "ur5e.py"))
    (tmp_path / "lift_ur5e.yaml").write_text(re.search(r"```yaml\n(.*?)```", pages.text(PAGE), flags=re.DOTALL)[1])
    monkeypatch.syspath_prepend(tmp_path)
    data = settings.read(settings.find(str(tmp_path / "lift_ur5e.yaml")))
    env = configured.environment(
        settings.configuration(settings.settled(data, gpu=False, pixels=False), "warp", pixels=False)
    )
    assert env is not None
    assert env.ranges == documented()["env"].ranges
    assert env.config == documented()["env"].config


@pytest.mark.xslow
def test_a_script_lifts():
    """In each of the random worlds, by 10 cm, and holds what it has lifted; without delays and noise."""
    env = Lift(config_overrides={"impl": "warp"}, arm=documented()["arm"](), robot_strength=1.0)

    def act(obs, phase, waited):
        chosen, done = lifting(env, obs, phase, waited)
        return chosen, phase + done, jnp.where(done, 0, waited + 1)

    @jax.jit
    def run(keys):
        def step(carry, _):
            state, phase, waited = carry
            actions, phase, waited = jax.vmap(act)(state.obs["state"], phase, waited)
            lifted = state.metrics["success"][:, None] > 0  # enough
            state = jax.vmap(env.step)(state, jnp.where(lifted, jnp.array([0.0, 0, 0, 0, -1]), actions))
            return (state, phase, waited), state.metrics["success"]

        zero = jnp.zeros(WORLDS, int)
        return jax.lax.scan(step, (jax.vmap(env.reset)(keys), zero, zero), length=100)[1]

    success = run(jax.random.split(jax.random.key(0), WORLDS))
    assert success[-1].tolist() == [1.0] * WORLDS
    assert not success[0].any()
