"""`mja.evaluate(engine="c")`: scripts do in recompiled worlds what they do on Warp, with variants, furniture, and things absent."""

from contextlib import nullcontext

import jax
import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("mujoco_playground")

from sliding import SLIDE, Slide
from test_arms import SCRIPTS, straight

import mjx_arenas as mja
from mjx_arenas.envs import Lift, PickAndPlace, Reach
from mjx_arenas.envs.tasks import manipulation

pytestmark = pytest.mark.slow

WORLDS = 6


class Scripted:
    """A script as a policy, which remembers on the host where in the script each world is."""

    def __init__(self, env, script):
        self.env, self.script, self.memory = env, script, np.zeros((2, WORLDS), np.int32)

    def put(self, memory):
        self.memory = np.array(memory)

    def __call__(self, obs, key):
        of = jax.ShapeDtypeStruct((2, WORLDS), jnp.int32)
        phase, waited = jax.experimental.io_callback(lambda: self.memory, of, ordered=True)
        actions, done = jax.vmap(lambda *args: self.script(self.env, *args))(obs["state"], phase, waited)
        memory = jnp.stack([phase + done, jnp.where(done, 0, waited + 1)])
        jax.experimental.io_callback(self.put, None, memory, ordered=True)
        return actions, {}


def given(kind):
    """Arguments of a task: a table of any height with an object of two shapes, and for a goal a tray on it."""
    variants = [mja.Object("cube", full_size=0.045), mja.Object("can", "cylinder", (0.04, 0.04, 0.06))]
    place = mja.Place(region=((-0.1, 0.05), (0.3, 0.5)), near="arm_base", distance=(0.27, 0.42))
    arena = mja.TableArena((1.2, 1.2, 0.05), objects=[mja.Object("thing", variants=variants, place=place)])
    arena.add_part(mja.furniture.Bin("tray", on="table", pos=(0.05, -0.25, 0), inner_size=(0.3, 0.3, 0.04)))
    goals = {"goals": [name for name in arena.surfaces if name.startswith("tray")]} if kind is PickAndPlace else {}
    heights = mja.Uniform([0, 0, -0.1], [0, 0, 0.1], relative="add")
    ranges = mja.ArenaRanges(table_offsets=heights, terms={"thing.variant": mja.Choice([0, 1])})
    return {"arena": arena, "ranges": ranges, "on": 0, "pos": manipulation.MOUNT, **goals}


@pytest.mark.xslow
@pytest.mark.parametrize("kind", [Lift, PickAndPlace])
def test_scripts_in_c(kind):
    """They succeed in the same worlds on Warp and in C; who does nothing succeeds in none."""
    script, length = SCRIPTS[kind]
    with pytest.warns(UserWarning, match=r"^`arena\.spec\.option\.cone` is a pyramid"):
        env = kind(config_overrides={"impl": "warp", "episode_length": length}, **given(kind))
    found = [mja.evaluate(Scripted(env, script), env, WORLDS, seed=2, engine=engine) for engine in (None, "c")]
    for shares in found:
        shares.pop("solver_limits")  # of which C says nothing
    assert found[0] == found[1] == {**dict.fromkeys(found[0], 0.0), "success": 1.0, "success_ever": 1.0}
    idle = mja.evaluate(lambda obs, key: (jnp.zeros((WORLDS, 5)), {}), env, WORLDS, seed=2, engine="c")
    assert idle == dict.fromkeys(idle, 0.0)


class SeesAll(Reach):
    """Where all is that data tells of, before what `Reach` sees."""

    def observe(self, data, episode):
        names = (
            "qpos",
            "xpos",
            "xmat",
            "xipos",
            "xanchor",
            "geom_xpos",
            "geom_xmat",
            "site_xpos",
            "cam_xpos",
            "ctrl",
        )
        all_of_it = jnp.concatenate([getattr(data, name).reshape(-1) for name in names])
        return {name: jnp.concatenate([all_of_it, x]) for name, x in super().observe(data, episode).items()}


def coming_and_going(**more):
    objects = [mja.Object("cube", pos=(0.2, 0.2)), mja.Object("ball", "sphere", 0.05, on=1)]
    variants = [mja.Object("block", full_size=0.05), mja.Object("can", "cylinder", (0.04, 0.04, 0.06))]
    objects += [mja.Object("thing", variants=variants, pos=(0.2, -0.2))]
    arena = mja.MultiTableArena([[0, 0, 0.8], [0, 1.2, 0.8]], table_full_sizes=(0.9, 0.9, 0.05), objects=objects)
    for sensor in more.get("sensors", ()):
        arena.spec.add_sensor(**sensor)
    ranges = mja.ArenaRanges(
        table_active=mja.Bernoulli([1.0, 0.5]),
        object_active=mja.Bernoulli([0.5, 0.7, 1.0]),
        terms={"thing.variant": mja.Choice([0, 1])},
    )
    config = {"impl": "warp", "episode_length": 10}
    return SeesAll(config_overrides=config, arena=arena, ranges=ranges, on=0, pos=manipulation.MOUNT)


@pytest.mark.xslow
def test_absent_in_c():
    """What policies see in C, step by step, is what they see on Warp, in worlds that lack a table, objects and variants."""
    env = coming_and_going()
    seen = {None: [], "c": []}
    for engine, log in seen.items():

        def policy(obs, key, log=log):
            jax.debug.callback(lambda x: log.append(np.array(x)), obs["state"], ordered=True)
            return straight(obs, key)

        mja.evaluate(policy, env, WORLDS, seed=1, engine=engine)
        jax.effects_barrier()
    on_warp, in_c = np.array(seen[None]), np.array(seen["c"])
    keys = jax.random.split(jax.random.key(1), WORLDS)
    params = jax.jit(jax.vmap(env.reset))(keys).info["episode"].params
    there = np.column_stack([params.table_active, params.object_active, params.terms["thing.variant"]])
    assert (np.ptp(there.astype(int), axis=0)[[1, 2, 5]] == 1).all()
    np.testing.assert_allclose(in_c, on_warp, rtol=1e-5, atol=2e-3)


@pytest.mark.parametrize(("delay", "ended"), [(1, 1.0), (2, 0.0)])
def test_late_actions_that_are_no_numbers_in_c(delay, ended):
    """They end an episode when they arrive, and not before, as on MJX."""
    config = {"impl": "warp", "episode_length": 3, "action_delay": delay}
    env = Reach(config_overrides=config, ranges=mja.ArenaRanges())
    n = len(env.arm_joints)
    start = env.reset(jax.random.key(0)).obs["state"][:n]

    def policy(obs, key):
        moved = (obs["state"][:, :n] != start).any(axis=1, keepdims=True)  # after the first step
        return jnp.where(moved, jnp.nan, jnp.zeros((len(moved), env.action_size))), {}

    for engine in (None, "c"):
        told = (
            pytest.warns(UserWarning, match="that an action of the policy is not finite \\(2\\)")
            if ended
            else nullcontext()
        )
        with told:
            found = mja.evaluate(policy, env, 2, engine=engine)
        assert found["ended_early"] == found["reported"] == ended


class Exploding(Slide):
    """A motor that is far too strong, at which MuJoCo starts a world anew."""

    robot = SLIDE.replace("<velocity ", '<motor gear="1e12" ').replace('kv="1"', "")


class Blind(Slide):
    """Sees what is no number."""

    def observe(self, data, episode):
        return {name: jnp.log(x * 0 - 1) for name, x in super().observe(data, episode).items()}


@pytest.mark.xslow
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.* of the 2 worlds")
@pytest.mark.parametrize(
    ("kind", "action", "reported"), [(Slide, jnp.nan, 0), (Exploding, 1, 1), (Blind, 1, 1), (Slide, 1, 0)]
)
def test_what_breaks_in_c(kind, action, reported, tmp_path, monkeypatch):
    """Actions, states and observations that are not finite end an episode in C as they do on MJX."""
    monkeypatch.chdir(tmp_path)  # for MuJoCo's log
    env = kind()
    found = [
        mja.evaluate(lambda obs, key: (jnp.full((2, 1), float(action)), {}), env, 2, engine=engine)
        for engine in (None, "c")
    ]
    assert found[0] == found[1]
    assert found[1]["reported"] == reported
    assert found[1]["ended_early"] == (kind is not Slide or action != 1)


def test_sensors_of_what_is_absent():
    """Nothing says what they measure: the sentence names them."""
    import mujoco

    kind, body = mujoco.mjtSensor.mjSENS_FRAMEPOS, mujoco.mjtObj.mjOBJ_BODY
    env = coming_and_going(sensors=[{"type": kind, "objtype": body, "objname": "cube"}])
    with pytest.raises(
        ValueError, match=r"`env` must have the same `sensordata` in all worlds for `engine='c'`; in world \d it"
    ):
        mja.evaluate(straight, env, WORLDS, seed=1, engine="c")
