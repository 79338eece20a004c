"""Delays and noise of actions and observations, as a plain loop has them."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("mujoco_playground")

from mujoco_playground import wrapper

from mjx_arenas.envs import Reach, flaws
from mjx_arenas.envs.base import Episode
from mjx_arenas.envs.tasks import manipulation
from mjx_arenas.sim.data import blank

BEGINS = [False] * 6 + [True] + [False] * 5
NEUTRAL = (0.0, 0.25, -0.5)
ACTIONS = jax.random.uniform(jax.random.key(1), (len(BEGINS), 3), minval=-1, maxval=1)


@functools.partial(jax.jit, static_argnums=0)
def played(given, keys):
    """Actions that come and observations that are seen (T, 3) in two episodes, of which the second begins with the seventh step."""
    seen = {"state": jnp.zeros(3), "privileged_state": jnp.zeros(3)}
    late = given.start(seen)
    log = []
    for t, begins in enumerate(BEGINS):
        own = Episode(None, {}, None, None, None, keys[int(t >= BEGINS.index(True))])
        late, came = given.act(late, ACTIONS[t], jnp.asarray(begins), own, t)
        obs = {"state": 10.0 * t + jnp.arange(3.0), "privileged_state": jnp.full(3, float(t))}
        late, obs = given.see(late, obs, jnp.asarray(begins or t == 0), own, t)
        log.append((came, obs["state"], obs["privileged_state"]))
    return tuple(jnp.stack(x) for x in zip(*log, strict=True))


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_delays(delay):
    """Exactly so many steps later, nothing of the episode before; the critic is told at once."""
    given = flaws.Flaws(NEUTRAL, action_delay=(delay, delay), observation_delay=(delay, delay))
    came, seen, told = played(given, jax.random.split(jax.random.key(0)))
    start = 0
    for t, begins in enumerate(BEGINS):
        start = t if begins else start
        of = t - delay
        known = of > start or (of == start and start == 0)  # in the first step of an episode no action is taken
        np.testing.assert_array_equal(came[t], ACTIONS[of] if known else NEUTRAL)
        np.testing.assert_array_equal(seen[t], 10.0 * max(of, start) + np.arange(3.0))
        np.testing.assert_array_equal(told[t], np.full(3, t))


def test_drawn_delays():
    """Each episode has its own, from the least to the most, all as likely, and the same in all its steps."""
    given = flaws.Flaws(NEUTRAL, action_delay=(1, 3))
    keys = jax.random.split(jax.random.key(5), (300, 2))
    came = np.asarray(jax.vmap(lambda k: played(given, k)[0])(keys))
    after = BEGINS.index(True)
    ways = [[ACTIONS[5 - d] for d in (1, 2, 3)], [ACTIONS[11 - d] for d in (1, 2, 3)]]
    drawn = [
        np.array([[np.array_equal(x, way) for way in w] for x in came[:, t]])
        for t, w in zip((5, 11), ways, strict=True)
    ]
    for found in drawn:
        assert (found.sum(1) == 1).all()
        assert (abs(found.mean(0) - 1 / 3) < 4 * np.sqrt(2 / 9 / 300)).all()
    assert (drawn[0] != drawn[1]).any(1).mean() > 0.5  # other ones in the second episode
    assert (came[:, after] == NEUTRAL).all()


def test_noise():
    """Of the stated spread, another one in every step and world; actions are cut, and the critic's numbers have none."""
    given = flaws.Flaws(NEUTRAL, action_noise=0.02, observation_noise=0.3)
    plain, noisy = flaws.Flaws(NEUTRAL), jax.vmap(functools.partial(played, given))
    keys = jax.random.split(jax.random.key(2), (400, 2))
    exact = played(plain, keys[0])
    for found, want, std in zip(noisy(keys), exact, (0.02, 0.3, 0.0), strict=True):
        error = np.asarray(found - want)
        assert abs(error.std() - std) <= 4 * std / np.sqrt(2 * error.size)
        assert abs(error.mean()) <= 4 * std / np.sqrt(error.size)
        if std:
            assert len(np.unique(error)) > 0.9 * error.size  # but for rounding no two alike


@pytest.mark.parametrize("action", ["cartesian", "joint"])
def test_an_arm_that_is_told_nothing_stays(action):
    """Its servos, also those of the grip, where the keyframe has them; so it starts while actions are late."""
    env = Reach(config_overrides={"impl": "warp", "action": action, "action_delay": 2})
    key = env.mj_model.key(env.keyframe)
    data = blank(env.mj_model).replace(qpos=jnp.asarray(key.qpos), ctrl=jnp.asarray(key.ctrl))
    np.testing.assert_allclose(env.drive(data, None, env.neutral_action), key.ctrl, atol=1e-6)
    assert np.ptp(key.ctrl[[env.mj_model.actuator("arm_" + name).id for name in env.arm.fingers]]) >= 0
    np.testing.assert_array_equal(env.flaws.neutral, env.neutral_action)
    assert env.neutral_action[-1] != 0


def test_off_by_default():
    assert flaws.of(manipulation.default_config(), NEUTRAL) is None


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("action_delay", (2, 1), "`config.action_delay` must be least and most steps, two whole numbers from 0 on"),
        ("observation_delay", (0, 1, 2), "`config.observation_delay` must be least and most steps"),
        (
            "action_noise",
            -0.1,
            "`config.action_noise` must be a standard deviation >= 0 and <= 1, as actions are within -1 and 1, got",
        ),
        (
            "action_noise",
            50.0,
            "`config.action_noise` must be a standard deviation >= 0 and <= 1, as actions are within -1 and 1, got",
        ),
        ("observation_noise", float("inf"), "`config.observation_noise` must be a standard deviation >= 0, got inf"),
    ],
)
def test_wrong(name, value, says):
    config = manipulation.default_config()
    config[name] = value
    with pytest.raises(ValueError, match="config") as raised:
        flaws.of(config, NEUTRAL)
    assert str(raised.value).startswith(says)


@pytest.mark.xslow
def test_under_playgrounds_wrapper():
    """A late arm moves as one that is told later; it sees what the other saw before; nothing comes from the episode before."""
    length, n, delay = 5, 3, 2
    common = {"impl": "warp", "action": "joint"}
    late = Reach(config_overrides={**common, "action_delay": (delay, delay), "observation_delay": (1, 1)})
    plain = Reach(config_overrides=common)
    envs = [wrapper.wrap_for_brax_training(env, episode_length=length) for env in (late, plain)]
    keys = jax.random.split(jax.random.PRNGKey(0), n)
    one, other = (jax.jit(env.reset)(keys) for env in envs)
    steps = [jax.jit(env.step) for env in envs]
    queue, fresh = [np.zeros((n, late.action_size))] * delay, True
    for action in jax.random.uniform(jax.random.key(3), (3 * length, n, late.action_size), minval=-1, maxval=1):
        begins = np.asarray(jax.vmap(plain.begins)(other))
        assert begins.all() == begins.any()
        before = other.obs["state"]
        queue = [np.zeros_like(action)] * (delay + 1) if begins.all() else [*queue, np.asarray(action)]
        one, other = steps[0](one, action), steps[1](other, queue.pop(0))
        np.testing.assert_allclose(one.data.qpos, other.data.qpos, rtol=0, atol=1e-6)
        if not (one.done.any() or fresh):
            np.testing.assert_allclose(
                one.obs["state"], other.obs["state"] if begins.all() else before, rtol=0, atol=1e-5
            )
        fresh = False
