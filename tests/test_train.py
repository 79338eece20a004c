"""Training for real, at tiny size: Brax's PPO learns, and goes on after an interruption as if there had been none."""

import functools
import json
import pathlib
import re
import shutil
import types
from typing import NamedTuple

import av
import documented
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from brax.training.acme import running_statistics
from brax.training.agents.ppo import checkpoint
from brax.training.agents.ppo import networks as ppo_networks
from brax.training.agents.ppo import train as ppo
from command import train_main
from matplotlib.figure import Figure
from mujoco_playground import State, wrapper
from mujoco_playground._src import mjx_env
from PIL import Image
from sliding import LENGTH, Slide

import mjx_arenas as mja
from mjx_arenas import brax_bridge, checkpoints, envs, judged, policies, settings, stages, train
from mjx_arenas import trained as trained_
from mjx_arenas.envs import evaluate
from mjx_arenas.envs.tasks import lift, open_drawer, pick_and_place, push, reach
from mjx_arenas.viz import render

pytestmark = pytest.mark.slow

# What traces and compiles fast: without objects to place, and masses to derive anything from.
MOVED = mja.ArenaRanges(
    table_offsets=mja.Uniform([-0.1, -0.1, -0.2], [0.1, 0.1, 0.2], relative="add"), table_rots=mja.Uniform(-0.5, 0.5)
)


@pytest.mark.xslow
@pytest.mark.slow
def test_ppo_learns():
    """With new arenas in every episode, Brax's PPO under Playground's wrapper brings the slide nearer to where it is to go.

    It compiles its resets, its training and its evaluation once.
    """
    env = Slide("jax", MOVED, objects=(), sim_dt=0.01)
    rewards, compiled = [], []

    programs = ("jit(_fun)", "jit(reset)", "jit(generate_eval_unroll)")  # `pmap` calls resets and trainings `_fun`

    def note(event, _, fun_name="", **__):
        lowered = event == "/jax/core/compile/jaxpr_to_mlir_module_duration" and fun_name in programs
        if lowered and len(rewards) < 4:  # after the last evaluation Brax only compares its devices
            compiled.append((len(rewards), fun_name))

    jax.monitoring.register_event_duration_secs_listener(note)
    with brax_bridge.device_put_replicated():
        ppo.train(
            environment=env,
            num_timesteps=30_000,
            num_envs=64,
            episode_length=20,
            unroll_length=10,
            batch_size=32,
            num_minibatches=4,
            num_updates_per_batch=4,
            learning_rate=3e-3,
            num_evals=4,
            num_eval_envs=32,
            max_devices_per_host=1,
            wrap_env_fn=wrapper.wrap_for_brax_training,
            network_factory=lambda *args, **kwargs: ppo_networks.make_ppo_networks(
                *args, policy_hidden_layer_sizes=(16,), value_hidden_layer_sizes=(16,), policy_obs_key="state",
                value_obs_key="state", **kwargs,
            ),
            progress_fn=lambda _, metrics: rewards.append(float(metrics["eval/episode_reward"])),
        )  # fmt: skip
    jax.monitoring.unregister_event_duration_listener(note)
    assert compiled == [*((0, name) for name in programs), (1, "jit(_fun)")]
    before, after = rewards[0], rewards[-1]
    assert after > 0.6 * before  # rewards are negative: the distance has shrunk by 40 % at least


@pytest.mark.xslow
def test_documented_brax(monkeypatch):
    """The code of docs/training.md on Brax as it stands, but for the numbers: the critic sees its own observations, and `BraxEnv` wraps."""

    class Told(Slide):
        def observe(self, data, episode):
            given = super().observe(data, episode)
            return given | {"privileged_state": jnp.append(given["state"], episode.params.table_rots)}

    own = documented.blocks("In your own Brax or Playground training")
    names = {"functools": functools, "brax_bridge": brax_bridge, "ppo": ppo, "wrapper": wrapper}
    names["env"] = Told("jax", MOVED, objects=(), sim_dt=0.05)
    documented.run(own[2], names)
    tiny = {"num_timesteps": 8, "num_envs": 4, "episode_length": 2, "unroll_length": 2, "batch_size": 4}
    tiny |= {
        "num_minibatches": 1,
        "num_updates_per_batch": 1,
        "num_eval_envs": 2,
        "num_evals": 2,
        "max_devices_per_host": 1,
    }
    assert (
        names["ppo_params"]["batch_size"] * names["ppo_params"]["num_minibatches"] % names["ppo_params"]["num_envs"]
        == 0
    )
    names["ppo_params"] |= tiny
    trains, wraps = documented.blocks("Brax on such environments")
    documented.run(trains, names)
    inputs = [jax.tree.leaves(tree)[1].shape[0] for tree in (names["params"][1], names["params"][2])]
    assert inputs == [2, 3]  # of policy and critic
    assert np.isfinite(names["metrics"]["eval/episode_reward"])
    documented.run(wraps, names)
    raw = jax.random.split(jax.random.PRNGKey(0), 4)
    state = jax.eval_shape(names["train_env"].reset, raw)
    assert state.pipeline_state.qpos.shape == (4, 1)
    with pytest.raises(AttributeError, match="pipeline_state"):  # why BraxEnv is there
        jax.eval_shape(names["training"].wrap(names["env"], episode_length=2).reset, raw)


SIZES = {"policy_hidden_layer_sizes": (8,), "value_hidden_layer_sizes": (8,)}
ARGUMENTS = ["--engine", "jax", "--num-envs", "4", "--num-timesteps", "100", "--num-evals", "2", "--eval-worlds", "2"]
for setting in (
    "unroll_length=5",
    "num_updates_per_batch=1",
    "num_minibatches=2",
    *(f"network_factory.{name}=[8]" for name in SIZES),
):
    ARGUMENTS += ["--set", f"ppo.{setting}"]


class Small(mjx_env.MjxEnv):
    """In the place of Push: a point that is to go where its arena's table is, without a simulation to trace and compile."""

    observation_size, action_size, dt = {"state": (2,), "privileged_state": (2,)}, 1, 0.005
    xml_path = mj_model = mjx_model = pool = None

    def __init__(self, config_overrides, ranges=MOVED, arm=None):
        self.arena, self.ranges = mja.TableArena(), ranges
        self._config = types.SimpleNamespace(episode_length=3, **config_overrides)

    def reset(self, rng):
        drawn, start = jax.random.split(rng)
        goal = self.arena.sample_params(drawn, self.ranges).table_offsets[0, 0]
        return self._state(0.1 * jax.random.normal(start), goal, jnp.zeros(()), {"goal": goal}, {})

    def step(self, state, action):
        info, goal = dict(state.info), state.info["goal"]
        return self._state(state.data + self.dt * action[0], goal, jnp.zeros(()), info, state.metrics)

    def _state(self, at, goal, done, info, metrics):
        off, seen = jnp.abs(at - goal), jnp.stack([at, goal - at])
        own = dict.fromkeys(
            ("nan_state", "invalid_arena", "dropped_contacts", "solver_limits", "success_at_end"), jnp.zeros(())
        )
        own |= {"success": (off < 0.05).astype(jnp.float32), "distance": off}
        return State(at, {"state": seen, "privileged_state": seen}, -off, done, {**metrics, **own}, info)


@pytest.fixture
def tiny(monkeypatch):
    assert envs.Push is push.Push  # found once and for all, and so before it is replaced
    monkeypatch.setattr(push, "Push", Small)
    monkeypatch.setattr(push, "training_ranges", lambda: MOVED)
    monkeypatch.setattr(push, "wider_ranges", lambda: MOVED)
    monkeypatch.setattr(render, "choose_gl", lambda: None)  # pictures compile another step; see test_pictures
    monkeypatch.setattr(jax, "local_device_count", lambda: 1)
    monkeypatch.setattr(jax, "local_devices", lambda: jax.devices()[:1])


def test_what_the_same_command_does_is_said(tmp_path):
    """It goes on where something of it, or of its teacher, is saved."""
    (tmp_path / "checkpoints" / "unfinished0").mkdir(parents=True)
    assert train.again(tmp_path) == "the same command begins again, as no policy has been evaluated yet"
    for folder, steps, says in ((tmp_path / "teacher", 2000, " of the teacher"), (tmp_path, 100, "")):
        (folder / "checkpoints" / "stage0").mkdir(parents=True)
        (folder / "progress.jsonl").write_text(json.dumps({"stage": 0, "steps": steps}))
        assert train.again(tmp_path) == f"the same command goes on from {steps:,} steps{says}"


def test_resume(tiny, tmp_path, monkeypatch, capsys):
    """Interrupted in its second stage, training ends with the policy, the log and the result of one that was not."""
    whole, halved = tmp_path / "whole", tmp_path / "halved"
    assert train_main(*ARGUMENTS, "--stages", "2", "--out", str(whole)) == 0
    said = capsys.readouterr().out
    assert "The policy is judged on 2 arenas that it has not seen" in said
    assert len(set(re.findall(r" of (at least [\d,]+) steps: ", said))) == 1
    assert "success on 2 held out arenas" in said
    (halved / "checkpoints" / "unfinished1" / "something").mkdir(parents=True)
    shutil.copytree(whole / "checkpoints" / "stage0", halved / "checkpoints" / "stage0")
    shutil.copy(whole / "config.json", halved)
    log = (whole / "progress.jsonl").read_text().splitlines()
    (halved / "progress.jsonl").write_text("\n".join(log[:3]) + "\n")  # both of stage 0, one of stage 1
    assert train_main(*ARGUMENTS, "--stages", "2", "--out", str(halved)) == 0
    ours, theirs = (checkpoint.load(out / "checkpoints" / "stage1" / "params") for out in (whole, halved))
    jax.tree.map(np.testing.assert_array_equal, jax.tree.leaves(ours), jax.tree.leaves(theirs))
    first = checkpoint.load(whole / "checkpoints" / "stage0" / "params")
    changed = [
        not np.array_equal(a, b) for a, b in zip(jax.tree.leaves(first[1]), jax.tree.leaves(ours[1]), strict=True)
    ]
    assert any(changed)
    for file in ("result.json", "config.json"):
        assert (whole / file).read_text() == (halved / file).read_text()
    documented_terms(json.loads((whole / "result.json").read_text()))
    names = ("stage", "steps", "eval/episode_reward", "eval/episode_distance")
    logs = [
        [[line[name] for name in names] for line in map(json.loads, (out / "progress.jsonl").read_text().splitlines())]
        for out in (whole, halved)
    ]
    assert logs[0] == logs[1]
    assert len(logs[0]) == 4
    assert (halved / "curve.png").stat().st_size > 1000
    assert not list(halved.glob("**/*unfinished*"))

    # Another training does not go on in the same folder.
    assert train_main(*ARGUMENTS, "--stages", "2", "--seed", "1", "--out", str(halved)) == 2
    assert "config.json is of another training (seed 0 instead of 1): give another --out" in capsys.readouterr().err
    # The same one is not done again.
    monkeypatch.setattr(judged, "evaluate", None)
    assert train_main(*ARGUMENTS, "--stages", "2", "--out", str(halved)) == 0
    said = capsys.readouterr().out
    assert f"The training in {halved} is finished; --stages 3 goes on with it." in said
    assert "success on 2 held out arenas" in said

    # Its policy, as documented, is what Brax's networks give with the checkpoint's parameters.
    (tmp_path / "out").mkdir()
    whole.rename(tmp_path / "out" / "train")
    monkeypatch.chdir(tmp_path)
    keys = jax.random.split(jax.random.key(0), 4)
    names = {}
    block, judges = documented.blocks("Use the policy")
    monkeypatch.setattr(envs, "Push", Seen)
    documented.run(block, names)
    observation = names["state"].obs
    network = ppo_networks.make_ppo_networks(
        {name: x.shape[1:] for name, x in observation.items()}, 1, running_statistics.normalize,
        policy_obs_key="state", value_obs_key="privileged_state", **SIZES,
    )  # fmt: skip
    expected = ppo_networks.make_inference_fn(network)(ours, deterministic=True)(observation, keys[0])[0]
    np.testing.assert_array_equal(names["actions"], expected)

    # It is judged as documented; Small is no environment that C MuJoCo can step (test_own_training.py has one that is).
    documented.run(judges.replace('256, engine="c"', "2"), names)
    result = json.loads(pathlib.Path("out/train/result.json").read_text())
    assert names["shares"] | {"worlds": 2} == result["held_out"]
    assert np.ptp(expected, axis=0).all()


@pytest.mark.parametrize("normalize", ["true", "false"])
def test_a_loaded_policy_is_that_of_brax(normalize, tiny, tmp_path, monkeypatch):
    """It does what the policy does that Brax's `train` returns, with observations that are normalized and that are not."""
    returned, brax = [], ppo.train
    monkeypatch.setattr(ppo, "train", functools.wraps(brax)(lambda **given: returned.append(brax(**given))))
    monkeypatch.setattr(judged, "evaluate", lambda config, policy: {})
    arguments = ("--num-evals", "1", "--stages", "1", "--set", f"ppo.normalize_observations={normalize}")
    assert train_main(*ARGUMENTS, *arguments, "--out", tmp_path) == 0
    ((make, params, _),) = returned
    seen = jnp.array([[0.2, 0.5], [-1.0, 0.1], [0.5, -2.0]])
    observation, key = {"state": seen, "privileged_state": seen}, jax.random.key(0)
    expected = make(params, deterministic=True)(observation, key)[0]
    np.testing.assert_array_equal(policies.load_policy(tmp_path)(observation, key)[0], expected)


class Seen:
    """In the place of Push: what policy and critic of Small see, without a simulation."""

    class State(NamedTuple):
        obs: dict

    def __init__(self, config_overrides):
        assert config_overrides == {"impl": "jax"}

    def reset(self, key):
        return self.State({"state": jax.random.normal(key, (2,)), "privileged_state": jax.random.normal(key, (2,))})


def documented_terms(result):
    """All terms of a result are in docs/policies.md."""
    text = documented.section("What a training writes")
    for where, numbers in result.items():
        for term in (where, *numbers):
            assert f"`{term}`" in text, term


def test_best(tmp_path, monkeypatch):
    """A stage keeps the policy with the most successes in training, the later of two alike, or the one that it started from."""
    shares, restored = [[0.0, 0.2, 0.9, 0.9, 0.5], [0.9, 0.2, 0.3, 0.8, 0.9], [0.9, 0.2, 0.8, 0.8, 0.8]], []

    def learn(env, config, report, left, seed, save_checkpoint_path, restore_checkpoint_path):
        restored.append(restore_checkpoint_path and (pathlib.Path(restore_checkpoint_path) / "at").read_text())
        stage = [stages.seed_of(0, number, 0) for number in range(3)].index(seed)
        for step, share in enumerate(shares[stage]):
            if step:  # PPO's first policy is judged, and not saved
                folder = pathlib.Path(save_checkpoint_path) / f"{step:012d}"
                folder.mkdir(parents=True)
                (folder / "at").write_text(f"{stage} {step}")
            report(step, {"eval/episode_reward": 1.0, "eval/episode_success_at_end": share})

    monkeypatch.setattr(stages, "ppo", learn)
    monkeypatch.setattr(checkpoints, "_unreadable", lambda folder: "")
    monkeypatch.setattr("mjx_arenas.envs.tasks.configured.environment", lambda config, overrides: None)
    monkeypatch.setattr("mjx_arenas.envs.tasks.configured.check_worlds", lambda env: None)
    config = {"arenas": "fixed", "stages": 3, "seed": 0, "sees": "numbers"}
    config["ppo"] = {"num_timesteps": 12, "num_evals": 5}
    stages.train(config, tmp_path, lambda steps, line: None)
    assert restored == [None, "0 3", "1 4"]
    assert (tmp_path / "checkpoints" / "stage2" / "params" / "at").read_text() == "1 4"
    log = [json.loads(line) for line in (tmp_path / "progress.jsonl").read_text().splitlines()]
    assert [(line["stage"], line["steps"]) for line in log if line.get("kept")] == [(0, 3), (1, 8), (2, 8)]
    assert [path.name for path in tmp_path.glob("checkpoints/*/*")] == 3 * ["params"]


def test_longer(tiny, tmp_path, monkeypatch, capsys):
    """More stages of the same length go on with a training; its result is of the policy then. Others are refused."""
    monkeypatch.setattr(
        judged, "evaluate", lambda config, policy: {"held_out": {"worlds": config["stages"], "success": 1}}
    )
    monkeypatch.setattr(train, "load_policy", lambda folder: None)
    trained = []
    monkeypatch.setattr(train, "train", lambda config, out, say: trained.append(train.steps_of_stage(config)))
    out = ["--out", str(tmp_path)]
    assert train_main(*ARGUMENTS, "--stages", "2", *out) == 0
    assert train_main(*ARGUMENTS, "--stages", "3", *out) == 2
    assert capsys.readouterr().err == (
        f"error: {tmp_path}/config.json is of a training whose stages have 50 steps: for 3 of them give --num-timesteps 150.\n"
    )
    assert json.loads((tmp_path / "result.json").read_text())["held_out"]["worlds"] == 2
    assert train_main(*ARGUMENTS, "--num-timesteps", "150", "--stages", "3", *out) == 0
    without = [x for x in ARGUMENTS if x not in ("--num-timesteps", "100")]
    assert train_main(*without, "--stages", "4", *out) == 0
    assert trained == [50, 50, 50]
    assert json.loads((tmp_path / "config.json").read_text())["ppo"]["num_timesteps"] == 200
    assert json.loads((tmp_path / "result.json").read_text())["held_out"]["worlds"] == 4
    assert train_main(*without, "--stages", "3", *out) == 2
    assert "stages 4 instead of 3" in capsys.readouterr().err
    assert len(trained) == 3
    capsys.readouterr()
    for steps in ("ppo.num_timesteps=900", "ppo={num_timesteps: 900}"):  # given in other words
        assert train_main(*without, "--set", steps, "--stages", "5", *out) == 2
        told = capsys.readouterr()
        assert "whose stages have 50 steps: for 5 of them give --num-timesteps 250.\n" in told.err
        assert "Without a GPU" not in told.out
    assert train_main(*without, "--set", "ppo.num_timesteps=250", "--stages", "5", *out) == 0
    assert train_main(*without, "--stages", "6", *out) == 0
    assert trained == 5 * [50]
    assert "Without a GPU" not in capsys.readouterr().out
    (tmp_path / "own.yaml").write_text("task: push\nppo: {num_timesteps: 100}")
    for task, by_default in (("push", True), (str(tmp_path / "own.yaml"), False)):
        assert train_main(*without, "--out", str(tmp_path / pathlib.Path(task).stem), task=task) == 0
        assert ("Without a GPU" in capsys.readouterr().out) is (by_default and jax.default_backend() == "cpu")


@pytest.mark.parametrize("name", ["progress.jsonl", "curve.png", "strip.png", "film.mp4"])
def test_half_a_file(name, tmp_path, monkeypatch):
    """Where the disk is full, what was there stays, and nothing else comes."""

    def half(path, *_, **__):
        path.write_bytes(b"half")
        raise OSError("the disk is full")

    (tmp_path / name).write_text("")
    monkeypatch.setattr(pathlib.Path, "write_text", half)
    monkeypatch.setattr(Figure, "savefig", lambda _, path, **__: half(path))
    monkeypatch.setattr(Image.Image, "save", lambda _, path: half(path))
    monkeypatch.setattr(av, "open", lambda path, *_: half(pathlib.Path(path)))
    env = types.SimpleNamespace(_config=types.SimpleNamespace(episode_length=1), dt=0.04, pool=None)
    monkeypatch.setattr(push, "Push", lambda **_: env)
    monkeypatch.setattr(evaluate, "episode", lambda *_: (None, ([], [], None)))
    monkeypatch.setattr(render, "grid", lambda *_, **__: Image.new("RGB", (8, 8)))
    config = {"task": "push", "impl": "jax", "sees": "numbers"}
    write = {
        "progress.jsonl": lambda path: train.write(path, "all"),
        "curve.png": lambda path: trained_.curve(tmp_path / "no log", path),
        "strip.png": lambda path: judged.strip(config, None, path, n_worlds=0),
        "film.mp4": lambda path: judged.film(config, None, path, n_worlds=0),
    }
    with pytest.raises(OSError, match="the disk is full"):
        write[name](tmp_path / name)
    assert (tmp_path / name).read_bytes() == b""
    assert [file.name for file in tmp_path.iterdir()] == [name]


class Tries(NamedTuple):
    """What a task draws."""

    possible: jax.Array


class Plays(NamedTuple):
    """As much of an episode as tells whether the task is possible."""

    task: Tries | None


def test_success():
    """Shares of four worlds in an episode of three steps: what comes after an early end does not count, what ends it does."""
    at_goal = jnp.array([[0, 1, 1], [1, 0, 0], [1, 1, 1], [0, 0, 1]])
    done = jnp.array([[0, 0, 0], [0, 0, 0], [0, 1, 0], [0, 0, 1]])
    nan = jnp.array([[0, 0, 0], [0, 0, 0], [0, 0, 1], [0, 0, 1]])
    limited = jnp.array([[1, 1, 1], [0, 0, 1], [0, 0, 1], [0, 0, 0]])
    also, possible = {}, None

    def tried(world):
        return Plays(None if possible is None else Tries(possible[world]))

    class Told:
        _config = types.SimpleNamespace(episode_length=3)

        def reset(self, key):
            names = ("success", "nan_state", "nan_action", "invalid_arena", "dropped_contacts", "solver_limits")
            metrics = dict.fromkeys(names, 0.0)
            return State(None, jnp.zeros(()), jnp.zeros(()), jnp.zeros(()), metrics, {"t": 0, "episode": tried(0)})

        def step(self, state, world):
            t = state.info["t"]
            metrics = state.metrics | {"success": 1.0 * at_goal[world, t], "nan_state": 1.0 * nan[world, t]}
            metrics |= {"solver_limits": 1.0 * limited[world, t]} | {name: x[world] for name, x in also.items()}
            info = {"t": t + 1, "episode": tried(world)}
            return state.replace(done=1.0 * done[world, t], metrics=metrics, info=info)

    def judged(n, why, do):
        told = f"Something is reported of {n} of the 4 worlds, most often that {why}. "
        told += f"The shares therefore say little about the policy; {do}."
        with pytest.warns(UserWarning, match=f"^{re.escape(told)}$"):
            return mja.evaluate(lambda obs, key: (jnp.arange(4), {}), Told(), 4, seed=0)

    check = "mjx_arenas.check(arena, ranges) looks for causes that do not depend on the policy"
    shares = {"success": 0.25, "ended_early": 0.5, "success_ever": 0.75, "solver_limits": 0.5}
    assert judged(1, "a number is not finite (1)", check) == {**shares, "reported": 0.25}
    also["invalid_arena"] = jnp.array([1.0, 0, 1, 1])
    assert judged(3, "the arena is not valid (3)", check) == {**shares, "reported": 0.75}
    possible = jnp.array([False, True, False, True])
    arms = 'docs/arms.md has, under "What is possible", what arms and grippers cannot do'
    assert judged(3, "the task is not possible (2)", arms) == {**shares, "reported": 0.75}
    possible = jnp.array([True, True, True, False])
    assert judged(3, "the arena is not valid (2)", check) == {**shares, "reported": 0.75}
    also["dropped_contacts"] = jnp.ones(4)
    room = "`config.max_contacts` makes more room"
    assert judged(4, "contacts are dropped (4)", room) == {**shares, "reported": 1.0}
    nan, also, possible = jnp.zeros_like(nan), {}, None
    assert mja.evaluate(lambda obs, key: (jnp.arange(4), {}), Told(), 4, seed=0) == {**shares, "reported": 0.0}


@pytest.mark.xslow
def test_push_on_warp():
    """The real task is judged on its own ranges: a robot that stands still brings no box to its goal, and nothing is amiss."""
    env = push.Push(config_overrides={"impl": "warp"}, ranges=push.training_ranges())
    env._config.episode_length = 4
    result = mja.evaluate(lambda obs, key: (jnp.zeros((*obs["state"].shape[:-1], 3)), {}), env, 4, seed=0)
    assert env.observation_size == {"state": (15,), "privileged_state": (26,)}
    nothing = ("success", "ended_early", "success_ever", "reported", "solver_limits")
    assert result == dict.fromkeys(nothing, 0.0)
    with pytest.raises(
        ValueError, match=r"`policy` must return actions \(4, n\), a row for each world, got shape \(3,\)\."
    ):
        mja.evaluate(lambda obs, key: (jnp.zeros(3), {}), env, 4)
    for engine in (None, "c"):
        with pytest.raises(
            ValueError,
            match=r"`policy` must return a tuple of actions and extra information, got float32 of shape \(4, 3\)\.",
        ):
            mja.evaluate(lambda obs, key: jnp.zeros((4, 3)), env, 4, engine=engine)


def test_no_policy(tmp_path):
    with pytest.raises(ValueError, match="`folder` must be") as error:
        train.load_policy(tmp_path / "nowhere")
    assert str(error.value) == (
        "`folder` must be a folder in which `mjx-arenas train TASK -o FOLDER` has finished a stage, got "
        f"'{tmp_path}/nowhere'."
    )
    with pytest.raises(TypeError, match=r"^`folder` must be a path, got NoneType\.$"):
        train.load_policy(None)
    stage = tmp_path / "reach" / "checkpoints" / "stage0"
    stage.mkdir(parents=True)
    (tmp_path / "reach" / "config.json").write_text("{}")
    for load in (policies.load_policy, policies.load_env):
        for folder, where in ((stage, "which is in the"), (tmp_path, "in which there is the")):
            with pytest.raises(ValueError, match="`folder` must be") as error:
                load(folder)
            assert str(error.value).endswith(f"got '{folder}', {where} folder of a training, '{tmp_path}/reach'.")


def test_tasks(tiny, tmp_path, monkeypatch, capsys):
    """Each task is trained and judged; a policy is of one task alone."""
    made = {"reach": reach, "lift": lift, "pick_and_place": pick_and_place, "open_drawer": open_drawer}
    for module, name in zip(made.values(), ("Reach", "Lift", "PickAndPlace", "OpenDrawer"), strict=True):
        monkeypatch.setattr(module, name, Small)
        monkeypatch.setattr(module, "training_ranges", lambda: MOVED)
        monkeypatch.setattr(module, "wider_ranges", lambda: MOVED._replace(table_rots=mja.Uniform(0.5, 0.6)))
    assert {*made, "push"} == {*settings.tasks()}
    for task in made:
        assert train_main(*ARGUMENTS, "--stages", "1", "--out", tmp_path / task, task=task) == 0
        assert json.loads((tmp_path / task / "config.json").read_text())["task"] == task
        assert set(json.loads((tmp_path / task / "result.json").read_text())) == {"held_out", "out_of_range"}
    capsys.readouterr()
    assert train_main(*ARGUMENTS, "--stages", "1", "--out", tmp_path / "lift") == 2
    assert "task lift instead of push" in capsys.readouterr().err


@pytest.mark.parametrize("rounded", [1.0, 0.8])
def test_success_at_the_end(rounded):
    """It is told in the last step of a whole episode alone, whatever rounding makes of times, as it does of long episodes."""

    class Slow(Slide):
        def score(self, data, episode, action):
            return jnp.zeros(()), jnp.zeros((), bool), {"success": jnp.float32(data.qpos[self.slide] < 0.02)}

    env = Slow("jax", MOVED, objects=(), sim_dt=0.01)
    state, step = jax.jit(jax.vmap(env.reset))(jax.random.split(jax.random.key(0), 2)), jax.jit(jax.vmap(env.step))
    told = []
    for _ in range(LENGTH):
        state = step(state, jnp.array([[0.0], [1.0]]))
        told.append([state.metrics[name].tolist() for name in ("success", "success_at_end")])
        state = state.replace(data=state.data.replace(time=rounded * state.data.time))
    assert told == [[[1, 1], [0, 0]], [[1, 0], [0, 0]], [[1, 0], [1, 0]]]
