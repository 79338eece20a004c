"""Environments whose policies see pictures: those of the world that each state is in, as the renderer draws the recompiled one."""

import functools
import json
import os

import av
import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from brax.training.agents.ppo import checkpoint, networks_vision
from brax.training.agents.ppo import train as ppo
from mujoco_playground import wrapper
from sliding import LENGTH, SLIDE, N, keys

import mjx_arenas as mja
from mjx_arenas import cli, dr, envs, policies, settings, stages, train
from mjx_arenas.envs import ArenaEnv, Lift, Vision, env_config, evaluate
from mjx_arenas.envs.arms import wrist_camera
from mjx_arenas.envs.tasks import looks, push
from mjx_arenas.envs.vision import if_any

pytestmark = pytest.mark.slow

SIZE = {"agentview": (16, 12)}
RANGES = mja.ArenaRanges(
    table_offsets=mja.Uniform([-0.1, -0.1, -0.2], [0.1, 0.1, 0.2], relative="add"),
    table_rots=mja.Uniform(-0.5, 0.5),
    terms={"look": mja.Uniform([0, 0, 0, 1], 1.0)},
)


class See(ArenaEnv):
    """A table, a camera, and a robot far above them."""

    def __init__(self, vision=None, impl="warp", config_overrides=None, ranges=RANGES, **config):
        arena = mja.TableArena()
        arena.attach(mujoco.MjSpec.from_string(SLIDE))
        arena.vary(look=dr.Term("material.rgba", "table_ceramic"))
        arena.spec.option.iterations, arena.spec.option.ls_iterations = 1, 6
        given = {"impl": impl, **config, **(config_overrides or {})}
        seeing = given.pop("vision", True)
        super().__init__(
            arena, ranges, env_config(0.05, 0.025, LENGTH), given, vision=(vision or Vision(SIZE)) if seeing else None
        )
        self.slide = self.arena.mj_model.joint("robot_slide").qposadr[0]

    def draw_task(self, key, params, qpos):
        return {}

    def proprioception(self, data):
        return data.qvel[self.slide][None]

    def observe(self, data, episode):
        return {"state": data.qpos, "privileged_state": jnp.append(data.qpos, episode.params.table_offsets[0, 2])}

    def score(self, data, episode, action):
        return (
            -jnp.abs(data.qpos[self.slide]),
            jnp.zeros((), bool),
            {"success": jnp.zeros(()), "distance": jnp.ones(())},
        )


@functools.cache
def see(impl="warp", **vision):
    """An environment, and its compiled functions of all worlds."""
    env = See(Vision(SIZE, **vision), impl)
    return env, jax.jit(jax.vmap(env.reset)), jax.jit(jax.vmap(env.step))


def drawn(env, state, **kinds):
    """What the renderer draws of the worlds that the states are in, written anew from their parameters."""
    batch = env.arena.batch(env.mjx_model, state.info["episode"].params)
    return env.arena.renderer(SIZE, **kinds)(batch, state.data)["agentview"]


@pytest.mark.xslow_on("jax")
@pytest.mark.parametrize("impl", ["jax", "warp"])
def test_pictures_are_of_the_state_and_its_arena(impl):
    """After a reset, a step, and the first step of another episode, in the worlds where one begins and in the others."""
    env, reset, step = see(impl=impl)
    state, seen = reset(keys()), []
    for done in ([0, 0, 0, 0], [0, 1, 0, 1], [0, 0, 0, 0]):
        want = np.asarray(drawn(env, state).rgb) / 255
        np.testing.assert_allclose(state.obs["pixels/view_0"], want, rtol=0, atol=1.01 / 255)
        seen.append(np.asarray(state.obs["pixels/view_0"]))
        state = step(state.replace(done=jnp.asarray(done, jnp.float32)), jnp.zeros((N, 1)))
    changed = np.abs(seen[2] - seen[1]).max((1, 2, 3)) > 0.05
    assert changed.tolist() == [False, True, False, True]
    assert set(state.obs) == {"pixels/view_0", "state", "privileged_state"}
    np.testing.assert_array_equal(state.obs["state"], state.data.qvel[:, [env.slide]])
    assert env.observation_size["pixels/view_0"] == (12, 16, 3)


@pytest.mark.parametrize("kind", ["gray", "depth", "rgbd"])
def test_kinds(kind):
    env, reset, _ = see(kind=kind)
    state = reset(keys())
    picture = drawn(env, state, depth=True)
    rgb, depth = np.asarray(picture.rgb) / 255, np.asarray(picture.depth)[..., None]
    want = {"gray": rgb.mean(-1, keepdims=True), "depth": depth, "rgbd": np.concatenate([rgb, depth], -1)}[kind]
    np.testing.assert_allclose(state.obs["pixels/view_0"], want, rtol=1e-5, atol=1.01 / 255)
    assert np.ptp(want, axis=(0, 1, 2)).min() > 0.1


def marked(picture, episode, step):
    """A colour for each step."""
    return jnp.broadcast_to(jax.random.uniform(step, (3,)), picture.shape)


@pytest.mark.xslow
def test_frames():
    """The latest last; an episode begins with one picture in all places."""
    _, reset, step = see(frames=2, alter=marked)
    state = reset(keys())
    seen = [np.asarray(state.obs["pixels/view_0"])]
    assert seen[0].shape == (N, 12, 16, 6)
    np.testing.assert_array_equal(seen[0][..., :3], seen[0][..., 3:])
    for done in ([0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 0]):
        state = step(state.replace(done=jnp.asarray(done, jnp.float32)), jnp.ones((N, 1)))
        seen.append(np.asarray(state.obs["pixels/view_0"]))
        before = np.where(np.reshape(done, (N, 1, 1, 1)), seen[-1], seen[-2])[..., 3:]
        np.testing.assert_array_equal(seen[-1][..., :3], before)
    assert len({x[..., 3].tobytes() for pictures in seen for x in pictures}) == 4 * N


def test_every_other_step():
    """Between pictures the last one stays, and nothing is drawn; an episode that begins there is black until the next."""
    counts = []

    def alter(picture, episode, step):
        jax.debug.callback(lambda: counts.append(1))
        return jnp.maximum(picture, 0.01)

    _, reset, step = see(every=2, alter=alter)
    state = reset(keys())
    jax.effects_barrier()
    assert len(counts) == 1  # for all worlds together
    pictures = [np.asarray(state.obs["pixels/view_0"])]
    for done in ([0, 0, 0, 0], [0, 0, 0, 0], [1, 0, 0, 0], [0, 0, 0, 0]):
        state = step(state.replace(done=jnp.asarray(done, jnp.float32)), jnp.ones((N, 1)))
        pictures.append(np.asarray(state.obs["pixels/view_0"]))
    jax.effects_barrier()
    assert len(counts) == 3
    np.testing.assert_array_equal(pictures[1], pictures[0])
    np.testing.assert_array_equal(pictures[3][1:], pictures[2][1:])
    assert not pictures[3][0].any()
    assert pictures[4][0].min() >= 0.01
    np.testing.assert_array_equal(pictures[4][1:], pictures[2][1:])  # nothing there moves


def test_if_any():
    """One world that wants it is enough; without any nothing is computed."""
    calls = []

    def work(x):
        jax.debug.callback(lambda: calls.append(1))
        return x + 1

    def run(wanted, xs):
        out = jax.jit(jax.vmap(lambda w, x: if_any(w, work, lambda x: -x, x)))(jnp.asarray(wanted), xs)
        jax.effects_barrier()
        return out.tolist()

    xs = jnp.arange(3.0)
    assert run([False, False, False], xs) == [0, -1, -2]
    assert not calls
    assert run([False, True, False], xs) == [1, 2, 3]
    assert len(calls) == 1  # for all of them
    assert float(if_any(jnp.array(False), work, lambda x: -x, xs[1])) == -1


@pytest.mark.xslow
def test_alter():
    """One key for an episode, one for each step; the same for the same world."""

    def keys_seen(picture, episode, step):
        split = jnp.stack([jax.random.uniform(key) for key in jax.random.split(episode, 2)])
        clash = (split == jax.random.uniform(step)).any()  # `split` and `fold_in` give the same keys
        numbers = jnp.stack([jax.random.uniform(episode), jax.random.uniform(step) + clash, picture.mean()])
        return jnp.broadcast_to(numbers, picture.shape)

    env, reset, step = see(alter=keys_seen)
    state, seen = reset(keys()), []
    for done in ([0, 0, 0, 0], [0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 0]):
        seen.append(np.asarray(state.obs["pixels/view_0"])[:, 0, 0])
        state = step(state.replace(done=jnp.asarray(done, jnp.float32)), jnp.zeros((N, 1)))
    episode, each, mean = np.moveaxis(np.stack(seen), -1, 0)  # (steps, N)
    assert each.max() < 1
    assert len(set(episode[0])) == N
    np.testing.assert_array_equal(episode[:3], episode[[0, 0, 0]])
    assert (episode[3] != episode[2]).tolist() == [False, True, False, False]
    assert len({*each[:3].reshape(-1)}) == 3 * N
    np.testing.assert_allclose(mean[0], (np.asarray(drawn(env, reset(keys())).rgb) / 255).mean((1, 2, 3)), rtol=1e-4)
    again = reset(keys())
    np.testing.assert_array_equal(np.asarray(again.obs["pixels/view_0"])[:, 0, 0], seen[0])


@pytest.mark.xslow
def test_under_playgrounds_wrapper():
    """In batches of one device, as Brax resets; after the auto-reset an episode's first step shows its arena."""
    env, *_ = see()
    wrapped = wrapper.wrap_for_brax_training(env, episode_length=LENGTH)
    state, step = jax.jit(wrapped.reset)(keys()), jax.jit(wrapped.step)
    nested = jax.jit(jax.vmap(wrapped.reset))(keys()[None])
    np.testing.assert_array_equal(nested.obs["pixels/view_0"][0], state.obs["pixels/view_0"])
    for _ in range(LENGTH + 1):
        state = step(state, jnp.zeros((N, 1)))
    want = np.asarray(drawn(env, state).rgb) / 255
    np.testing.assert_allclose(state.obs["pixels/view_0"], want, rtol=0, atol=1.01 / 255)


def cornered(picture, episode, step):
    """A colour for each step in the first pixel."""
    return picture.at[0, 0].set(jax.random.uniform(step, (3,)))


@pytest.mark.xslow
def test_every_other_step_of_full_resets():
    """A reset's picture comes with `done`, whenever a world ends; after it every second step has a new one, of the world's arena."""
    env, *_ = see(every=2, alter=cornered)
    wrapped = wrapper.wrap_for_brax_training(env, episode_length=LENGTH, full_reset=True)
    state, step = jax.jit(wrapped.reset)(keys()), jax.jit(wrapped.step)
    steps, seen, ends = np.zeros(N, int), [np.asarray(state.obs["pixels/view_0"])], []
    for k in range(3 * LENGTH):
        state = step(state, jnp.zeros((N, 1)).at[1].set(jnp.nan if k == 0 else 0.0))  # which ends its episode
        ends.append(np.asarray(state.done, bool))
        steps = np.where(ends[-1], 0, steps + 1)
        before, now = seen[-1], np.asarray(state.obs["pixels/view_0"])
        changed = (now[:, 0, 0] != before[:, 0, 0]).all(-1)
        np.testing.assert_array_equal(changed, steps % 2 == 0)
        np.testing.assert_array_equal(now[~changed], before[~changed])
        want = np.asarray(drawn(env, state).rgb) / 255
        np.testing.assert_allclose(now[:, 1:], want[:, 1:], rtol=0, atol=1.01 / 255)
        seen.append(now)
    assert [list(np.flatnonzero(x)) for x in np.transpose(ends)] == [[2, 5, 8], [0, 3, 6], [2, 5, 8], [2, 5, 8]]
    other = [np.abs(seen[k + 1] - seen[k])[i, 1:].max() for k, end in enumerate(ends) for i in np.flatnonzero(end)]
    assert min(other) > 0.05  # each reset shows another arena


class Small(See):
    """In the place of `Push`, with its camera."""

    def __init__(self, config_overrides=None, ranges=RANGES, vision=None):
        super().__init__(vision or Vision({"agentview": (24, 16)}), "jax", config_overrides, ranges)


def check_films(folder):
    """From outside, and what the policy sees of the same arenas, in which a table's colour is that of its arena."""
    assert (folder / "film.mp4").stat().st_size > 1000
    with av.open(folder / "seen.mp4") as video:
        stream = video.streams.video[0]
        frames = [frame.to_ndarray(format="rgb24").astype(int) for frame in video.decode(stream)]
        assert float(stream.average_rate) == pytest.approx(1 / 0.05)
    assert len(frames) == LENGTH
    env = Small()
    first = jax.jit(jax.vmap(env.reset))(jax.random.split(jax.random.key(evaluate.HELD_OUT), 9))
    sheet = np.asarray(
        mja.picture_sheet(first.obs["pixels/view_0"], labels=[f"arena {i}" for i in range(9)], columns=3), int
    )
    assert abs(np.asarray(sheet.shape) - frames[0].shape).max() <= 1  # H.264 has even sizes
    height, width = (min(pair) for pair in zip(sheet.shape[:2], frames[0].shape[:2], strict=True))
    off = np.abs(frames[0][:height, :width] - sheet[:height, :width])
    assert (
        off.mean()
        < 6
        < np.abs(np.roll(sheet, sheet.shape[0] // 3, 0)[:height, :width] - frames[0][:height, :width]).mean()
    )


@pytest.mark.xslow
def test_training(tmp_path, monkeypatch, capsys):
    """A teacher learns, and what the policy sees with moves; its checkpoint is a policy again, which is judged and drawn."""
    assert envs.Push is push.Push  # found once and for all, and so before it is replaced
    monkeypatch.setattr(push, "Push", Small)
    monkeypatch.setattr(looks, "default_vision", lambda wrist=False: Vision({"agentview": (24, 16)}))
    for name in ("training_ranges", "wider_ranges"):
        monkeypatch.setattr(push, name, lambda: RANGES)
    monkeypatch.setattr(looks, "with_looks", lambda ranges, n_objects, wrist: ranges)
    monkeypatch.setattr(train, "apart", lambda function, *given: function(*given))  # else it would have its own `Push`
    monkeypatch.setattr(jax, "local_device_count", lambda: 1)
    monkeypatch.setattr(jax, "local_devices", lambda: jax.devices()[:1])
    numbers = ["--num-envs", "4", "--num-timesteps", "80", "--stages", "2", "--num-evals", "2", "--eval-worlds", "2"]
    numbers += ["--teacher-timesteps", "40"]
    teacher = ("num_envs=4", "unroll_length=5", "num_updates_per_batch=1", "num_minibatches=2")
    for setting in (*(f"ppo.{setting}" for setting in teacher), "dagger.num_minibatches=2"):
        numbers += ["--set", setting]
    assert cli.main(["train", "push", "--pixels", "--engine", "warp", "--film", *numbers, "--out", str(tmp_path)]) == 0
    first, last = (checkpoint.load(tmp_path / "checkpoints" / f"stage{i}" / "params") for i in range(2))
    sees = [key for key in last[1]["params"] if "CNN" in key]
    taught = checkpoint.load(tmp_path / "teacher" / "checkpoints" / "stage0" / "params")
    assert taught[1]["params"]["hidden_0"]["kernel"].shape[0] == 2  # it is told everything
    assert sees
    for one, other in zip(
        *(jax.tree.leaves([p[1]["params"][key] for key in sees]) for p in (first, last)), strict=True
    ):
        assert (np.asarray(one) != np.asarray(other)).any()
    assert json.loads((tmp_path / "config.json").read_text())["sees"] == "pictures"
    lines = [json.loads(line) for line in (tmp_path / "progress.jsonl").read_text().splitlines()]
    assert [line["steps"] for line in lines] == [0, 40, 40, 80]
    assert all(np.isfinite(line["eval/episode_reward"]) for line in lines)
    assert {"held_out", "out_of_range"} == set(json.loads((tmp_path / "result.json").read_text()))
    assert (tmp_path / "strip.png").stat().st_size > 1000
    assert {"Drawing strip.png.", "Drawing seen.mp4."} <= set(capsys.readouterr().out.splitlines())
    check_films(tmp_path)

    policy = policies.load_policy(tmp_path)
    obs = jax.jit(jax.vmap(Small().reset))(keys()).obs
    act = np.asarray(policy(obs, keys()[0])[0])
    assert act.shape == (N, 1)
    dark = {**obs, "pixels/view_0": 0 * obs["pixels/view_0"]}
    assert (act != np.asarray(policy(dark, keys()[0])[0])).any()  # it looks


@pytest.mark.xslow
def test_brax_learns_from_pictures():
    """Brax's PPO with its vision networks, as in docs/pixels.md: each layer that sees moves, and what it is given are pictures."""
    env = See(Vision({"agentview": (16, 16)}))
    networks = functools.partial(
        networks_vision.make_ppo_networks_vision,
        policy_obs_key="state",
        value_obs_key="privileged_state",
        cnn_global_pool="spatial_softmax",
        normalise_channels=True,
    )
    seen = []
    _, (_, policy, value), metrics = ppo.train(
        environment=env,
        network_factory=networks,
        wrap_env_fn=wrapper.wrap_for_brax_training,
        num_timesteps=24,
        num_envs=2,
        batch_size=2,
        num_minibatches=1,
        unroll_length=3,
        num_updates_per_batch=1,
        num_evals=2,
        num_eval_envs=2,
        episode_length=LENGTH,
        max_devices_per_host=1,
        policy_params_fn=lambda steps, make_policy, params: seen.append((steps, jax.device_get(params[1:]))),
    )
    assert np.isfinite(metrics["eval/episode_reward"])
    assert seen[-1][0] >= 24
    for one, other in zip(seen[0][1], seen[-1][1], strict=True):  # policy, value function
        assert any("CNN" in key for key in one["params"])
        moved = jax.tree.map(lambda a, b: bool((np.asarray(a) != np.asarray(b)).any()), one, other)
        assert all(jax.tree.leaves(moved)), moved
    assert jax.tree.structure(policy) == jax.tree.structure(seen[0][1][0])
    assert jax.tree.structure(value) == jax.tree.structure(seen[0][1][1])


def test_apart(tmp_path):
    """What runs apart has another process, and its errors come back."""
    train.apart(os.symlink, "/", tmp_path / "here")
    assert (tmp_path / "here").is_symlink()
    with pytest.raises(FileExistsError):
        train.apart(os.symlink, "/", tmp_path / "here")


def test_push_sees():
    """Its own camera, looks that vary, and nothing in its state that says where box and goal are."""
    env = push.Push(config_overrides={"vision": True, "impl": "warp"})
    assert env.observation_size == {"pixels/view_0": (64, 64, 3), "state": (6,), "privileged_state": (26,)}
    state = jax.jit(jax.vmap(env.reset))(keys())
    picture = np.asarray(state.obs["pixels/view_0"])
    assert np.ptp(picture, axis=0).mean() > 0.2
    without = push.Push(config_overrides={"impl": "jax"})
    assert without.observation_size == {"state": (15,), "privileged_state": (26,)}
    assert without.arena.mj_model.ncam == env.arena.mj_model.ncam - 1


@pytest.mark.xslow
def test_arms_see():
    """From their base and their hand, wherever they stand; what they lift has its own colour, and they are told nothing else of it."""
    env = Lift(config_overrides={"vision": True, "impl": "warp"})
    blind = Lift(config_overrides={"impl": "jax"})
    n = blind.observation_size["state"][0]
    assert env.observation_size == {
        "pixels/view_0": (64, 64, 3),
        "pixels/view_1": (64, 64, 3),
        "state": (n - 9,),  # without the way to the object, and how that is turned
        "privileged_state": blind.observation_size["privileged_state"],
    }
    state = jax.jit(jax.vmap(env.reset))(keys())
    for view in ("pixels/view_0", "pixels/view_1"):
        assert np.ptp(np.asarray(state.obs[view]), axis=0).mean() > 0.2
    rgb = np.asarray(state.info["episode"].params.object_rgba)[:, 0, :3]
    assert (rgb[:, 0] >= 0.5).all()
    assert np.ptp(rgb, axis=0).min() > 0


@pytest.mark.xslow
def test_an_arm_is_taught(tmp_path, monkeypatch):
    """A round of DAgger for `Lift`: from pictures of the cameras on its base and hand to its five numbers, all layers move."""
    taught = []

    def teacher(obs, key):
        taught.append({name: x.shape for name, x in obs.items()})
        loc = jnp.full((len(obs["privileged_state"]), 5), 0.5)
        return jnp.tanh(loc), {"loc": loc, "scale": jnp.ones_like(loc)}

    eyes = (looks.CAMERA, wrist_camera.NAME)
    monkeypatch.setattr(stages.policies, "load_policy", lambda folder: teacher)
    monkeypatch.setattr(looks, "default_vision", lambda wrist: Vision(dict.fromkeys(eyes, (16, 16))))
    monkeypatch.setattr(jax, "local_device_count", lambda: 1)
    monkeypatch.setattr(jax, "local_devices", lambda: jax.devices()[:1])
    tiny = {"eval_worlds": 2, "env": {"config": {"episode_length": 2, "sim_dt": 0.04}}}
    tiny["dagger"] = {"num_timesteps": 4, "num_evals": 2, "num_envs": 2, "demo_length": 2, "num_minibatches": 2}
    read = settings.settled(settings.read(settings.find("lift")), gpu=True, pixels=True)
    config = settings.configuration(settings.merged(read, tiny, "the test"), "warp", pixels=True)
    said = []
    stages.train(config, tmp_path, lambda steps, line: said.append(steps))
    assert said == [0, 4]
    views = ("pixels/view_0", "pixels/view_1")
    assert {shapes[view][1:] for shapes in taught for view in views} == {(16, 16, 3)}
    params = checkpoint.load(tmp_path / "checkpoints" / "stage0" / "params")[1]["params"]
    biases = [(str(path), x) for path, x in jax.tree_util.tree_leaves_with_path(params) if "bias" in str(path)]
    moved = {(path.split("'")[3], x.shape) for path, x in biases if np.abs(x).max() > 1e-5}  # they begin at 0
    assert {("hidden_0", (256,)), ("hidden_1", (256,)), ("hidden_2", (2 * 5,))} <= moved
    assert any(name.startswith("Conv") for name, _ in moved)


WRONG = {
    "no vision": ("policy", "`vision` must be mjx_arenas.envs.Vision(cameras, ...), got str."),
    "kind": (Vision(SIZE, kind="grey"), "`vision.kind` must be one of 'rgb', 'gray', 'depth', 'rgbd', got 'grey'."),
    "frames": (Vision(SIZE, frames=0), "`vision.frames` must be a whole number above 0, got 0."),
    "every": (Vision(SIZE, every=1.5), "`vision.every` must be a whole number above 0, got 1.5."),
    "alter": (
        Vision(SIZE, alter=jnp.sin),
        "`vision.alter` must be a function of a picture, a key of the episode and a key of the step, or None, got",
    ),
    "camera": (
        Vision(["wrist"]),
        "`cameras`: no camera of the arena is called 'wrist'; known are frontview, birdview, agentview, sideview.",
    ),
    "size": (
        Vision({"agentview": (0, 4)}),
        "`cameras['agentview']` must be (width, height), two whole numbers above 0, got (0, 4).",
    ),
    "two things": (Vision(SIZE, kind="x", frames=0), "2 problems in `vision`:"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_visions(case):
    vision, says = WRONG[case]
    with pytest.raises((ValueError, TypeError)) as raised:
        See(vision)
    assert str(raised.value).startswith(says)


ALTERS = {
    "small": (lambda p: p[:4], "a picture of the shape (12, 16, 3) that it gets, got (4, 16, 3)."),
    "bytes": (
        lambda p: (p * 255).astype(jnp.uint8),
        "floats, as it gets them (colours from 0 to 1), got uint8.",
    ),
    "nothing": (lambda p: None, "a picture, (12, 16, 3) floats, got NoneType."),
    "a dict": (lambda p: {"picture": p}, "a picture, (12, 16, 3) floats, got dict."),
    "a list": (lambda p: [p], "a picture, (12, 16, 3) floats, got list."),
}


@pytest.mark.parametrize("case", ALTERS)
def test_wrong_alters(case):
    alter, says = ALTERS[case]
    env = See(Vision(SIZE, alter=lambda picture, episode, step: alter(picture)))
    with pytest.raises(ValueError, match=r"`vision\.alter`") as raised:
        jax.eval_shape(env.reset, keys()[0])
    assert str(raised.value) == f"`vision.alter` must give {says}"


def test_wrong_tasks():
    class Blind(See):
        proprioception = ArenaEnv.proprioception

    with pytest.raises(NotImplementedError, match=r"^Blind must define `proprioception` for `vision`\.$"):
        Blind().reset(keys()[0])

    class Untold(See):
        def observe(self, data, episode):
            return {"state": data.qpos}

    says = r"^`Untold.observe` must give a dict with 'privileged_state' for `vision`, got 'state'\.$"
    with pytest.raises(ValueError, match=says):
        Untold().reset(keys()[0])
