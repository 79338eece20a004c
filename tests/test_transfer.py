"""Carrying a box between tables can be done, by a script, in random worlds."""

import functools
import os

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

pytest.importorskip("mujoco_playground")

from mujoco_playground import manipulation, registry
from mujoco_playground._src import mjx_env

import mjx_arenas as mja
from mjx_arenas import envs, furniture
from mjx_arenas.envs.tasks import robots
from mjx_arenas.furniture import surfaces

pytestmark = pytest.mark.slow

SCRIPTED, IDLE = 8, 1  # worlds
LENGTH = 170  # steps, of an episode's 200: the script takes 151 at most
ABOVE, DOWN, CLOSE, LIFT, CARRY, LOWER, OPEN, AWAY = range(8)
CRUISE = 1.08  # [m] height of the tip, above all tables


def script(memory, obs, cruise=CRUISE):
    """Action (5,) for what a policy sees (19,); `memory` is the phase, and how many steps it has lasted."""
    phase, steps = memory
    height, turned, to_box, box_to_goal = obs[2], obs[8:10], obs[10:13], obs[16:19]
    yaw = jnp.arctan2(turned[0], turned[1]) / 4
    still, up = jnp.zeros(3), jnp.array([0, 0, cruise - height])
    ways = {
        ABOVE: to_box + jnp.array([0, 0, 0.12]),
        DOWN: to_box,
        CLOSE: still,
        LIFT: up,
        CARRY: up.at[:2].set(box_to_goal[:2]),
        LOWER: box_to_goal + jnp.array([0, 0, 0.024]),  # the middle of a box on the table is at most 2.5 cm above it
        OPEN: still,
        AWAY: jnp.array([0, 0, (box_to_goal + to_box)[2] + 0.2]),
    }
    way = jnp.stack([ways[i] for i in range(8)])[phase]
    near = jnp.abs(way) < jnp.array([0.008, 0.008, 0.02])
    waited = steps > 8
    done = {
        ABOVE: near.all() & (jnp.abs(yaw) < 0.05),
        DOWN: jnp.abs(way[2]) < 0.006,
        CLOSE: waited,
        LIFT: near[2],
        CARRY: near.all(),
        LOWER: way[2] > -0.004,
        OPEN: waited,
        AWAY: jnp.zeros((), bool),
    }
    done = jnp.stack([done[i] for i in range(8)])[phase]
    rate = jnp.where(phase <= DOWN, yaw, 0.0)
    grip = jnp.where((phase >= CLOSE) & (phase < OPEN), -1.0, 1.0)
    action = jnp.append(6 * jnp.append(way / robots.SPEED, rate / robots.TURN), grip)
    return (phase + done, jnp.where(done, 0, steps + 1)), jnp.clip(action, -1, 1)


@functools.cache
def rollout():
    """An episode of scripted worlds and then idle ones: the environment, first states, metrics and so on (steps, worlds)."""
    env = envs.Transfer(config_overrides={"impl": "warp"})
    idle = jnp.arange(SCRIPTED + IDLE) >= SCRIPTED

    @jax.jit
    def run(keys):
        def step(carry, _):
            state, memory = carry
            memory, actions = jax.vmap(script)(memory, state.obs["state"])
            state = jax.vmap(env.step)(state, jnp.where(idle[:, None], 0.0, actions))
            return (state, memory), {"phase": memory[0], "reward": state.reward, "done": state.done, **state.metrics}

        zero = jnp.zeros(len(idle), int)
        first = jax.vmap(env.reset)(keys)
        return first, jax.lax.scan(step, (first, (zero, zero)), length=LENGTH)[1]

    return env, *jax.device_get(run(jax.random.split(jax.random.PRNGKey(5), len(idle))))


@pytest.mark.xslow
def test_a_script_succeeds():
    _, _, log = rollout()
    assert np.isin(log["success"], (0, 1)).all()
    scripted = log["success"][-1, :SCRIPTED]
    assert scripted.mean() >= 0.9, scripted
    assert not log["success"][:, SCRIPTED:].any()
    assert not log["success"][log["phase"] < LOWER].any()  # a box on the way is at no goal
    assert not log["done"].any()
    for report in ("nan_action", "nan_state", "invalid_arena", "dropped_contacts"):
        assert not log[report].any(), report


def test_reward_leads_there():
    """It grows from one phase of the script to the next."""
    _, _, log = rollout()
    phase, reward = log["phase"][:, :SCRIPTED], log["reward"][:, :SCRIPTED]
    means = [reward[phase == i].mean() for i in (ABOVE, DOWN, CLOSE, LIFT, CARRY, LOWER, OPEN)]
    assert (np.diff(means) > 0).all(), means


def test_on_jax():
    """MJX has a collision function for each pair of its geoms."""
    assert envs.Transfer(config_overrides={"impl": "jax"}).mjx_model.impl.value == "jax"


def test_interface():
    env, first, _ = rollout()
    assert env.action_size == 5
    assert first.obs["state"].shape == (SCRIPTED + IDLE, 19)
    assert first.obs["privileged_state"].shape == (SCRIPTED + IDLE, 38)
    for grip, place in ((1, 0.0), (-1, -robots.STROKE)):
        control = env.control(jnp.array([0.0, 0.0, 1.0, -1.0, grip]))
        np.testing.assert_allclose(control, [0, 0, robots.SPEED, -robots.TURN, place, place], atol=1e-6)


def test_success_and_end():
    """At rest on the goal is success; below both tops is the end."""
    env, first, _ = rollout()
    state = mja.take(first, 0)
    episode, rows = state.info["episode"], env.arena.layout.object_qpos[0, :3]
    goal, tops = episode.task.pos, episode.params.table_offsets[:, 2]
    rest = goal + np.array([0, 0, episode.params.object_full_sizes[0, 2] / 2])
    cases = [
        ((0.04, 0, 0), 1, False),
        ((0.06, 0, 0), 0, False),
        ((0, 0, 0.015), 0, False),  # held above it
        ((0, 0, tops.min() - rest[2] - 0.01), 0, True),
    ]

    @jax.jit
    @jax.vmap
    def score(shift):
        data = state.data.replace(qpos=jnp.asarray(state.data.qpos).at[rows].set(rest + shift))
        return env.score(data, episode, jnp.zeros(5))

    _, ends, metrics = score(jnp.array([shift for shift, _, _ in cases]))
    assert metrics["success"].tolist() == [success for _, success, _ in cases]
    assert ends.tolist() == [end for _, _, end in cases]


@pytest.mark.skipif(os.environ.get("MUJOCO_GL") == "disable", reason="no GL")
def test_picture():
    """Tables, box, goal and gripper are seen, of the world as it is."""
    env, first, _ = rollout()
    picture = env.render(mja.take(first, 1), 240, 320).astype(int)
    red, green, blue = picture[..., 0], picture[..., 1], picture[..., 2]
    assert ((green > 2 * red) & (green > 1.2 * blue)).sum() > 50  # the goal
    assert ((blue > 2 * red) & (blue > 1.2 * green)).sum() > 25  # the box
    assert ((red > 2 * green) & (red > 2 * blue)).sum() > 25  # the fingers
    wood = (red > blue + 10) & (green > blue + 5) & (red > 120)
    assert wood[:, :160].sum() > 2000
    assert wood[:, 160:].sum() > 2000


def test_registered_with_playground(monkeypatch, tmp_path):
    monkeypatch.setattr(mjx_env, "MENAGERIE_PATH", tmp_path)  # `load` would download it
    envs.register()
    push = manipulation.load("ArenaPush", config_overrides={"sim_dt": 0.01})
    assert isinstance(push, envs.Push)
    assert push.sim_dt == 0.01
    assert isinstance(registry.load("ArenaTransfer"), envs.Transfer)
    assert registry.get_default_config("ArenaTransfer").episode_length == 200
    assert {"ArenaPush", "ArenaTransfer"} <= set(manipulation.ALL_ENVS)


def kitchen():
    arena = mja.TableArena(
        (0.6, 0.8, 0.04), objects=[mja.Object("box", full_size=0.045), mja.Object("can", "capsule", (0.1, 0.06, 0.06))]
    )
    arena.add_part(furniture.Counter("bench", pos=(1.2, -0.6, 0), widths=(0.5, 0.5)))
    arena.add_part(furniture.Bin("crate", inner_size=(0.2, 0.2, 0.08), on="bench_top1"))
    terms = {
        "bench.widths": mja.Uniform(0.45, 0.6),
        "bench.height": mja.Uniform(0.7, 0.95),
        "crate.active": mja.Bernoulli(0.7),
    }
    starts = [arena.surfaces.index(name) for name in ("table", "bench_top0", "crate_bottom")]
    return arena, mja.ArenaRanges(
        object_tables=mja.Choice(starts), table_offsets=mja.Uniform(-0.05, 0.05, relative="add"), terms=terms
    )


@pytest.mark.xslow
def test_a_script_succeeds_in_kitchens():
    """From table and worktops to others, and some out of a crate or into it, whose walls the script does not know."""
    arena, ranges = kitchen()
    goals, worlds, steps = ("table", "bench_top0", "crate_bottom"), 24, 250
    config = {"impl": "warp", "episode_length": steps + 10}
    env = envs.Transfer(arena=arena, ranges=ranges, goals=goals, reach=1.8, config_overrides=config)

    @jax.jit
    def run(keys):
        def step(carry, _):
            state, memory = carry
            memory, actions = jax.vmap(functools.partial(script, cruise=1.2))(memory, state.obs["state"])
            state = jax.vmap(env.step)(state, actions)
            return (state, memory), state.metrics

        zero = jnp.zeros(worlds, int)
        first = jax.vmap(env.reset)(keys)
        return first, jax.lax.scan(step, (first, (zero, zero)), length=steps)[1]

    first, log = jax.device_get(run(jax.random.split(jax.random.PRNGKey(5), worlds)))
    assert not log["nan_state"].any()
    assert not log["dropped_contacts"].any()
    assert not log["invalid_arena"].any()
    episode, crate = first.info["episode"], arena.surfaces.index("crate_bottom")
    middle = jax.vmap(lambda p: surfaces.surfaces(p, env.arena.layout.places.furniture))(episode.params).top[:, crate]
    into = np.abs(episode.task.pos - middle)[:, :2].max(1) < 0.12
    walls, done = into | (episode.params.object_tables[:, 0] == crate), log["success"][-1] > 0
    assert done[~walls].mean() >= 0.9, done
    assert done[walls].any()


def test_what_is_dropped():
    """Episodes start while it falls: a warning says so."""
    arena, _ = kitchen()
    for i in range(2):
        drop = mja.Place(drop=True)
        arena.add_object(mja.Object(f"plate{i}", full_size=(0.15, 0.15, 0.01), on="crate_bottom", place=drop))
    says = (
        r"^`arena`: episodes start before what is dropped \(`place.drop`\) has come to rest: 'plate0', 'plate1'\. With "
    )
    with pytest.warns(UserWarning, match=says):
        envs.Transfer(arena=arena, goals=["table", "bench_top0"], reach=1.8)


@pytest.mark.xslow
def test_between_surfaces_of_a_kitchen():
    """Each episode is another kitchen: the goal is on a surface that is there and does not carry the box, and both are seen."""
    arena, ranges = kitchen()
    goals = ("table", "bench_top0", "crate_bottom")
    env = envs.Transfer(config_overrides={"impl": "jax"}, arena=arena, ranges=ranges, goals=goals, reach=1.8)
    index = np.array([env.arena.surfaces.index(name) for name in goals])
    keys = jax.vmap(jax.random.key)(jnp.arange(24))
    first = jax.jit(jax.vmap(env.reset))(keys)
    episode = first.info["episode"]
    parts = env.arena.layout.places.furniture
    found = jax.vmap(lambda p: surfaces.surfaces(p, parts))(episode.params)
    start, seen = np.asarray(episode.params.object_tables[:, 0]), set()
    for w in range(24):
        goal = np.asarray(episode.task.pos[w])
        local = goal - np.asarray(found.top[w])
        cos, sin = np.cos(found.rot[w]), np.sin(found.rot[w])
        x, y = cos * local[:, 0] + sin * local[:, 1], cos * local[:, 1] - sin * local[:, 0]
        on = (
            (np.abs(local[:, 2]) < 1e-5) & (np.abs(x) < found.size[w, :, 0] / 2) & (np.abs(y) < found.size[w, :, 1] / 2)
        )
        on &= np.isin(np.arange(len(on)), index)
        (which,) = np.flatnonzero(on)
        assert found.there[w, which]
        assert which != start[w]
        seen.add((int(start[w]), int(which)))
        np.testing.assert_allclose(first.obs["privileged_state"][w, 26:29], found.top[w, which], atol=1e-6)
        np.testing.assert_allclose(first.data.mocap_pos[w, 0], goal, atol=1e-6)
        assert np.asarray(first.data.qpos[w, env.arena.layout.object_qpos[0, 2]]) > goal[2] - 1
    assert len(seen) >= 5  # of six ways
    step = jax.jit(jax.vmap(env.step))
    state = step(first, jnp.zeros((24, 5)))
    assert np.isfinite(state.reward).all()
    assert not state.done.any()


@pytest.mark.slow
def test_goals_that_cannot_be_are_told():
    """Where the goal's table is absent, or the goal beyond the gripper's reach, the episode is invalid."""
    offsets = mja.Uniform([[0, 0, 0], [0, 0, 0]], [[0, 0, 0], [0, 0.8, 0]], relative="add")
    ranges = mja.ArenaRanges(table_offsets=offsets, table_active=mja.Bernoulli([1.0, 0.7]))
    env = envs.Transfer(config_overrides={"impl": "jax"}, ranges=ranges)
    episode = jax.jit(jax.vmap(env.reset))(jax.random.split(jax.random.key(0), 64)).info["episode"]
    there, away = np.asarray(episode.params.table_active[:, 1]), np.abs(episode.task.pos[:, 1])
    np.testing.assert_array_equal(episode.valid, there & (away <= 1.0))
    assert min((there & (away > 1)).sum(), (~there & (away < 1)).sum(), (there & (away < 1)).sum()) > 4


def test_wrong_goals():
    arena, ranges = kitchen()
    with pytest.raises(ValueError, match="goals") as raised:
        envs.Transfer(arena=arena, ranges=ranges, goals=["table", "sink"])
    assert str(raised.value).startswith("`goals` must be one or more of 'table', 'bench_top0', ")
    assert str(raised.value).endswith(", got ['sink'].")
    arena.add_object(mja.Object("tray", full_size=(0.2, 0.2, 0.02)))
    arena.add_object(mja.Object("cup", full_size=0.03, on="tray"))
    with pytest.raises(ValueError, match="`goals` must be one or more of") as raised:
        envs.Transfer(arena=arena, ranges=ranges, goals=["table", "tray"])  # which stands where keys place it
    assert str(raised.value).endswith(", got ['tray'].")
    xml = '<body name="b"><joint name="j"/><geom size=".1"/></body></worldbody><actuator><motor name="m" joint="j"/></actuator>'
    moving = mja.TableArena(xml=f"<mujoco><worldbody>{xml}</mujoco>", objects=[mja.Object("box", full_size=0.045)])
    with pytest.raises(
        ValueError, match=r"^`arena` must have no actuators of its own, beside the robot's: it has 'm'\.$"
    ):
        envs.Transfer(arena=moving, goals=["table"])
    with pytest.raises(ValueError, match="`arena` must have 'box' as its first object"):
        envs.Transfer(arena=mja.TableArena(objects=[mja.Object("cube")]), goals=["table"])


def test_friction():
    """On a table the box has the friction of that, which varies; in the grip that of the fingers, which does not."""
    env = envs.Transfer(config_overrides={"impl": "jax"})
    first = jax.device_get(jax.jit(jax.vmap(env.reset))(jax.random.split(jax.random.key(0), 3)))
    seen = []
    for w in range(3):
        params = jax.tree.map(lambda x, w=w: x[w], first.info["episode"].params)
        model, data = env.arena.c_world(params)
        data.qpos[:] = first.data.qpos[w]
        data.joint("box_joint0").qpos[2] -= 0.002
        mujoco.mj_forward(model, data)
        of = {frozenset(model.geom(g).name for g in c.geom): c.friction[0] for c in data.contact}
        table = of[frozenset({"box_g0", "table0_collision"})]
        data.joint("box_joint0").qpos[:3] = data.geom("robot_left").xpos
        mujoco.mj_forward(model, data)
        of = {frozenset(model.geom(g).name for g in c.geom): c.friction[0] for c in data.contact}
        seen.append((table, of[frozenset({"box_g0", "robot_left"})]))
        np.testing.assert_allclose(table, params.table_frictions[0, 0], rtol=1e-6)
    tables, grips = np.array(seen).T
    assert np.ptp(tables) > 0.1
    assert set(grips) == {1.5}
