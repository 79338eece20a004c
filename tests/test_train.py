"""Training for real, at tiny size: Brax's PPO learns, and goes on after an interruption as if there had been none."""

import json
import shutil

import jax
import numpy as np
import pytest
from brax.training.agents.ppo import checkpoint
from brax.training.agents.ppo import networks as ppo_networks
from brax.training.agents.ppo import train as ppo
from mujoco_playground import wrapper
from test_envs import Slide

import mjx_arenas as mja
from mjx_arenas import brax_bridge, render, train
from mjx_arenas.envs import push


def test_ppo_learns():
    """With new arenas in every episode, Brax's PPO under Playground's wrapper brings the slide nearer to where it is to go."""
    env = Slide("jax", sim_dt=0.01)
    rewards = []
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
            num_evals=2,
            num_eval_envs=32,
            max_devices_per_host=1,
            wrap_env_fn=wrapper.wrap_for_brax_training,
            network_factory=lambda *args, **kwargs: ppo_networks.make_ppo_networks(
                *args, policy_hidden_layer_sizes=(16,), value_hidden_layer_sizes=(16,), policy_obs_key="state",
                value_obs_key="state", **kwargs,
            ),
            progress_fn=lambda _, metrics: rewards.append(float(metrics["eval/episode_reward"])),
        )  # fmt: skip
    before, after = rewards[0], rewards[-1]
    assert after > 0.6 * before  # rewards are negative: the distance has shrunk by 40 % at least


ARGUMENTS = ["--impl", "warp", "--num-envs", "4", "--num-timesteps", "100", "--num-evals", "2", "--eval-worlds", "2"]


@pytest.fixture
def tiny(monkeypatch):
    def default_config(original=push.default_config):
        config = original()
        config.ctrl_dt, config.episode_length = 0.005, 4
        return config

    def ranges():  # that trace fast: without masses to derive anything from
        return mja.ArenaRanges(table_rots=mja.Uniform(-0.5, 0.5))

    monkeypatch.setattr(push, "default_config", default_config)
    monkeypatch.setattr(push, "training_ranges", ranges)
    monkeypatch.setattr(push, "wider_ranges", ranges)
    monkeypatch.setitem(train.PPO, "unroll_length", 5)
    monkeypatch.setitem(train.PPO, "num_updates_per_batch", 1)
    monkeypatch.setattr(train, "MINIBATCHES", 2)
    monkeypatch.setattr(train, "HIDDEN", {"policy_hidden_layer_sizes": (8,), "value_hidden_layer_sizes": (8,)})
    monkeypatch.setattr(render, "choose_gl", lambda: None)  # pictures compile another step; see test_pictures
    monkeypatch.setattr(jax, "local_device_count", lambda: 1)
    monkeypatch.setattr(jax, "local_devices", lambda: jax.devices()[:1])


def test_resume(tiny, tmp_path, capsys):
    """Interrupted in its second stage, training ends with the policy, the log and the result of one that was not."""
    whole, halved = tmp_path / "whole", tmp_path / "halved"
    assert train.main([*ARGUMENTS, "--stages", "2", "--out", str(whole)]) == 0
    assert "success on 2 held out arenas" in capsys.readouterr().out
    (halved / "checkpoints" / "unfinished1" / "something").mkdir(parents=True)
    shutil.copytree(whole / "checkpoints" / "stage0", halved / "checkpoints" / "stage0")
    shutil.copy(whole / "config.json", halved)
    log = (whole / "progress.jsonl").read_text().splitlines()
    (halved / "progress.jsonl").write_text("\n".join(log[:3]) + "\n")  # both of stage 0, one of stage 1
    assert train.main([*ARGUMENTS, "--stages", "2", "--out", str(halved)]) == 0
    ours, theirs = (checkpoint.load(out / "checkpoints" / "stage1" / "params") for out in (whole, halved))
    jax.tree.map(np.testing.assert_array_equal, jax.tree.leaves(ours), jax.tree.leaves(theirs))
    first = checkpoint.load(whole / "checkpoints" / "stage0" / "params")
    changed = [
        not np.array_equal(a, b) for a, b in zip(jax.tree.leaves(first[1]), jax.tree.leaves(ours[1]), strict=True)
    ]
    assert any(changed)
    for file in ("result.json", "config.json"):
        assert (whole / file).read_text() == (halved / file).read_text()
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
    assert train.main([*ARGUMENTS, "--stages", "2", "--seed", "1", "--out", str(halved)]) == 2
    assert "config.json is of another training (seed 0 instead of 1): give another --out" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--stages", "0"], "--stages must be at least 1 and --num-evals at least 2, got 0 and 5."),
        (["--arenas", "some"], "argument --arenas: invalid choice: 'some'"),
    ],
)
def test_wrong_arguments(arguments, message, capsys):
    with pytest.raises(SystemExit) as error:
        train.main(arguments)
    assert error.value.code == 2
    assert message in capsys.readouterr().err


def test_nothing_to_train_with(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(train.importlib.util, "find_spec", lambda name: None if name == "brax" else True)
    assert train.main(["--out", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err == "Training needs brax: pip install 'mjx_arenas[train]', or make train.\n"
    assert not (tmp_path / "out").exists()


def test_unwritable_folder(tiny, tmp_path, capsys):
    (tmp_path / "file").touch()
    assert train.main(["--num-envs", "4", "--out", str(tmp_path / "file" / "out")]) == 2
    assert capsys.readouterr().err == f"--out {tmp_path}/file/out cannot be written: Not a directory.\n"


@pytest.mark.parametrize("option", ["--num-timesteps", "--eval-worlds"])
def test_numbers_below_one(option, tiny, tmp_path, capsys):
    assert train.main(["--num-envs", "4", option, "0", "--out", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err == f"{option} must be at least 1, got 0.\n"


def test_wrong_number_of_worlds(tiny, tmp_path, capsys):
    assert train.main(["--num-envs", "7", "--out", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err == "--num-envs must be a multiple of 2, got 7.\n"
    assert not (tmp_path / "out").exists()
