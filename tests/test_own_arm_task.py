"""The task of docs/how_to/own_arm_task.md: it goes by the middle of the box, in the arm's frame, and is trained from its file."""

import importlib.util

import jax
import jax.numpy as jnp
import models
import mujoco
import numpy as np
import pages
import pytest

pytest.importorskip("mujoco_playground")

import mjx_arenas as mja
from mjx_arenas import settings
from mjx_arenas.envs import ArmTask
from mjx_arenas.envs.base import Episode
from mjx_arenas.envs.tasks import configured, manipulation
from mjx_arenas.envs.tasks.defaults import Defaults
from mjx_arenas.sim.data import blank

PAGE = "docs/how_to/own_arm_task.md"


@pytest.fixture
def push_aside(tmp_path, monkeypatch):
    """The module of the page."""
    (tmp_path / "push_aside.py").write_text(pages.blocks(PAGE)[0][0])
    monkeypatch.syspath_prepend(tmp_path)
    return configured.environment({"task": "push_aside:PushAside", "impl": "warp", "sees": "numbers"})


@pytest.mark.slow
def test_the_task_of_the_page(push_aside):
    env = push_aside
    params, model = env.arena.nominal_params(), env.mj_model
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key(env.keyframe).id)
    at = env.arena.layout.object_qpos[0]
    data.qpos[at[:3]] = [0.1, 0.05, 0.83]
    mujoco.mj_forward(model, data)
    qpos = jnp.asarray(data.qpos, jnp.float32)
    tasks = jax.vmap(lambda key: env.draw_task(key, params, qpos))(jax.random.split(jax.random.key(0), 200))
    away = np.asarray(tasks.pos) - data.qpos[at[:3]]
    assert tasks.possible.all()
    assert not env.draw_task(jax.random.key(0), params, qpos.at[at[0]].set(0.44)).possible  # out of reach
    np.testing.assert_allclose(away[:, [0, 2]], 0, atol=1e-6)
    assert ((np.abs(away[:, 1]) >= 0.1 - 1e-6) & (np.abs(away[:, 1]) <= 0.15 + 1e-6)).all()
    assert 60 < (away[:, 1] > 0).sum() < 140
    seen = blank(model).replace(
        qpos=qpos,
        qvel=jnp.zeros(model.nv),
        ctrl=jnp.asarray(data.ctrl),
        xpos=jnp.asarray(data.xpos, jnp.float32),
        xmat=jnp.asarray(data.xmat, jnp.float32).reshape(-1, 3, 3),
    )
    task = jax.tree.map(lambda x: x[0], tasks)
    base, tool = data.body("arm_base"), data.site("arm_tool").xpos
    box = base.xmat.reshape(3, 3).T @ (data.qpos[at[:3]] - base.xpos)
    for shift, success, ends in ((away[0], True, False), ([0, 0, 0], False, False), ([0, 0, -0.2], False, True)):
        moved = seen.replace(qpos=qpos.at[at[:3]].add(jnp.asarray(shift)))
        episode = Episode(params, {}, qpos, task, jnp.ones((), bool), jax.random.key(0))
        reward, fallen, metrics = env.score(moved, episode, jnp.zeros(5))
        distance, reach = (np.linalg.norm(x) for x in (shift - away[0], tool - data.qpos[at[:3]] - shift))
        assert (bool(metrics["success"]), bool(fallen)) == (success, ends)
        np.testing.assert_allclose(metrics["distance"], distance, atol=2e-6)
        want = 0.3 * (1 - np.tanh(6 * reach)) + 1 - np.tanh(8 * distance) + success
        np.testing.assert_allclose(reward, want, atol=1e-5)
    state = env.observe(seen, episode)["state"]
    np.testing.assert_allclose(state[-3:], base.xmat.reshape(3, 3).T @ away[0], atol=1e-6)
    np.testing.assert_allclose(state[-6:-3], box - base.xmat.reshape(3, 3).T @ (tool - base.xpos), atol=1e-5)


@pytest.mark.slow
def test_it_is_trained_from_its_file(push_aside):
    """As the command of the page does."""
    data = settings.settled(settings.read(settings.find("push_aside:PushAside")), gpu=False, pixels=False)
    assert settings.problem(settings.configuration(data, "warp", False), 1) is None
    state = jax.eval_shape(
        jax.vmap(push_aside.step),
        *jax.eval_shape(
            lambda keys: (jax.vmap(push_aside.reset)(keys), jnp.zeros((2, push_aside.action_size))),
            jax.random.split(jax.random.key(0)),
        ),
    )
    assert state.reward.shape == (2,)


@pytest.mark.slow
def test_other_arms(tmp_path, monkeypatch):
    """Each has a base of its own name."""
    monkeypatch.syspath_prepend(models.ROBOTS)  # where the tests have robots' packages
    if importlib.util.find_spec("mjlab") is None:
        pytest.skip("needs mjlab")
    (tmp_path / "push_aside.py").write_text(pages.blocks(PAGE)[0][0])
    monkeypatch.syspath_prepend(tmp_path)
    config = {
        "task": "push_aside:PushAside",
        "impl": "warp",
        "sees": "numbers",
        "env": {"arm": "yam", "robot_strength": 1.0},
    }
    assert configured.environment(config).arm.base == "arm"


class Still(ArmTask):
    """Does nothing with what it is given."""

    own = Defaults(lambda arm: mja.TableArena((0.9, 0.9, 0.05)), mja.ArenaRanges, pos=(-0.3, 0, 0))

    def __init__(self, defaults=None):
        super().__init__(defaults or self.own, manipulation.default_config(), {"impl": "warp"})

    def draw_task(self, key, params, qpos):
        return {}

    def observe(self, data, episode):
        return {"state": self.proprioception(data, episode)}

    def score(self, data, episode, action):
        return jnp.zeros(()), jnp.zeros((), bool), {"success": 0.0}


class Takes(Still):
    def draw_task(self, key, params, qpos):
        return {"possible": self.takes(params, qpos)}


class Middles(Still):
    def draw_task(self, key, params, qpos):
        return {"place": self.middle(params, qpos)}


class Few(Still):
    action_size = 3


class Possible(Still):
    def draw_task(self, key, params, qpos):
        return {"possible": jnp.zeros((), bool)}


class Sees(Still):
    sees: object = None

    def observe(self, data, episode):
        return {"state": self.sees}


def changed(**given):
    return lambda: Still(Still.own._replace(**given))


def of(kind, **attributes):
    """Traces a start and a step of a task."""

    def trace():
        env = type(kind.__name__, (kind,), attributes)()
        state = jax.eval_shape(env.reset, jax.random.key(0))
        jax.eval_shape(env.step, state, jnp.zeros(env.action_size))

    return trace


NUMBERS = "`Sees.observe` must give numbers (n,) as 'state', got "
WRONG = {
    "an arena": (
        changed(arena=mja.TableArena()),
        "`defaults.arena` must be a function of (arm), got TableArena.",
    ),
    "no argument": (changed(arena=lambda: None), "`defaults.arena` must be a function of (arm), got one of ()."),
    "ranges": (changed(ranges=mja.ArenaRanges()), "`defaults.ranges` must be a function of (), got ArenaRanges."),
    "no marks": (changed(marks=None), "`defaults.marks` must be a function of (spec), got NoneType."),
    "no verb": (changed(does=None), '`defaults.does` must be a verb such as "lift", or "", got NoneType.'),
    "a word": (changed(grips="no"), "`defaults.grips` must be True or False, got str."),
    "no defaults": (
        lambda: Still({"on": 0}),
        "`defaults` must be Defaults(...), what the task has of its own, got dict.",
    ),
    "takes": (
        of(Takes),
        "`Takes.middle` is about the arena's first object: say what the task does to it, `Defaults(does=...)`.",
    ),
    "middle": (of(Middles), "`Middles.middle` is about the arena's first object: say what the task does to it, "),
    "other actions": (
        of(Few),
        "`Few.drive` must be defined where `action_size` is: it makes controls of these actions.",
    ),
    "possible in a dict": (
        of(Possible),
        "`Possible.draw_task` must give `possible` as an attribute, such as a field of a NamedTuple, got a dict with it.",
    ),
    "a tuple": (of(Sees, sees=(jnp.zeros(3), jnp.zeros(3))), NUMBERS + "tuple."),
    "one number": (of(Sees, sees=jnp.zeros(())), NUMBERS + "float32."),
    "no number": (of(Sees, sees=jnp.zeros(0)), NUMBERS + "float32 of shape (0,)."),
    "whole numbers": (of(Sees, sees=jnp.zeros(3, int)), NUMBERS + "int32 of shape (3,)."),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong(case):
    make, says = WRONG[case]
    with pytest.raises((ValueError, TypeError)) as raised:
        make()
    assert str(raised.value).startswith(says), raised.value
