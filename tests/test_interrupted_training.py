"""A training that was interrupted goes on from what it has saved, and says what is broken."""

import functools
import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import types

import pytest

pytest.importorskip("brax")

import jax
import jax.numpy as jnp
import numpy as np
from brax.training import checkpoint
from brax.training.acme import running_statistics
from brax.training.agents.bc import train as bc
from brax.training.agents.ppo import networks
from command import train_main
from mujoco_playground import wrapper
from test_train import ARGUMENTS, Small, tiny

from mjx_arenas import checkpoints, judged, policies, settings, stages, train, trained
from mjx_arenas.envs import evaluate

assert tiny  # a fixture
CONFIG = {"arenas": "fixed", "stages": 2, "seed": 0, "sees": "numbers", "ppo": {"num_timesteps": 80, "num_evals": 5}}
SHARES = {0: [0.0, 0.2, 0.9, 0.5, 0.6], 1: [0.9, 0.3, 0.4, 0.5, 0.6]}


class Killed(Exception):
    pass


STAGES = {stages.seed_of(0, stage, rounds): stage for stage in range(3) for rounds in range(20)}
"""The stage of a seed."""


@pytest.fixture
def brax(monkeypatch):
    """In the place of Brax's PPO: saves after every ten steps, and is killed where it is told to be."""
    calls, at = [], {}

    def learn(env, config, report, left, seed, save_checkpoint_path, restore_checkpoint_path):
        steps, evals = left
        stage, first = STAGES[seed], 5 - evals
        path = restore_checkpoint_path and pathlib.Path(restore_checkpoint_path)
        calls.append((stage, steps, evals, path and (path / "at").read_text()))
        for i in range(evals):
            if i:
                saved = pathlib.Path(save_checkpoint_path) / f"{10 * i:012d}"
                saved.mkdir(parents=True)
                (saved / "at").write_text(f"{stage} {first + i}")
            if at.get("saved") == (stage, first + i):
                raise Killed
            share = SHARES[stage][first + i] if i or not path or not first else 1.0  # judged again, it may be better
            report(10 * i, {"eval/episode_reward": 1.0, "eval/episode_success_at_end": share})
            if at.get("evaluated") == (stage, first + i):
                raise Killed

    monkeypatch.setattr(stages, "ppo", learn)
    monkeypatch.setattr(stages, "curve", lambda log, picture: None)
    monkeypatch.setattr(checkpoints, "_unreadable", lambda folder: "" if (folder / "at").exists() else "no `at`")
    monkeypatch.setattr("mjx_arenas.envs.tasks.configured.environment", lambda config, overrides: None)
    monkeypatch.setattr("mjx_arenas.envs.tasks.configured.check_worlds", lambda env: None)
    return types.SimpleNamespace(calls=calls, at=at)


def policy(out, stage, k):
    return out / "checkpoints" / f"unfinished{stage}" / f"round{k}" / "params"


def killed(out):
    with pytest.raises(Killed):
        stages.train(CONFIG, out, lambda *_: None)


def finished(out, said):
    """Trains to the end; the log must be that of a training that nothing has stopped."""
    stages.train(CONFIG, out, lambda *_: None, said.append)
    log = [json.loads(line) for line in (out / "progress.jsonl").read_text().splitlines()]
    expected = [(i, 40 * i + 10 * k, SHARES[i][k]) for i in range(2) for k in range(5)]
    assert [(line["stage"], line["steps"], line["eval/episode_success_at_end"]) for line in log] == expected
    assert [(line["stage"], line["steps"]) for line in log if line.get("kept")] == [(0, 20), (1, 40)]
    assert sorted(str(path.relative_to(out)) for path in out.glob("checkpoints/*/*")) == [
        "checkpoints/stage0/params",
        "checkpoints/stage1/params",
    ]
    assert [(out / f"checkpoints/stage{i}/params/at").read_text() for i in range(2)] == ["0 2", "0 2"]


@pytest.mark.parametrize("when", ["saved", "evaluated"])
@pytest.mark.parametrize("stage", [0, 1])
def test_goes_on_within_a_stage(stage, when, brax, tmp_path):
    """From the last policy that was evaluated, with what is left of the stage; the best one so far is still the best."""
    brax.at[when] = (stage, 3)
    killed(tmp_path)
    of_stage = 30 if when == "evaluated" else 20
    assert checkpoints.saved_steps(tmp_path) == 40 * stage + of_stage
    assert train.again(tmp_path) == f"the same command goes on from {40 * stage + of_stage} steps"
    brax.at.clear()
    brax.calls.clear()
    finished(tmp_path, said := [])
    assert said == [f"The training goes on from {40 * stage + of_stage} steps."]
    assert brax.calls[0] == (stage, 40 - of_stage, 5 - of_stage // 10, f"{stage} {of_stage // 10}")


@pytest.mark.parametrize("k", [1, 3])
def test_between_a_line_and_its_checkpoint(k, brax, tmp_path, monkeypatch):
    """A line whose checkpoint has not its name yet is written again; nothing is refused, as of the first line of all."""
    rename = pathlib.Path.rename

    def stopped(path, target):
        if pathlib.Path(target).name == f"round{k}":
            raise Killed
        return rename(path, target)

    with monkeypatch.context() as patched:
        patched.setattr(pathlib.Path, "rename", stopped)
        killed(tmp_path)
    if k == 1:  # as with one evaluation alone
        log = tmp_path / "progress.jsonl"
        log.write_text("".join(line + "\n" for line in log.read_text().splitlines() if json.loads(line)["round"]))
    brax.calls.clear()
    finished(tmp_path, []) if k > 1 else stages.train(CONFIG, tmp_path, lambda *_: None)
    assert brax.calls[0] == ((0, 20, 3, "0 2") if k == 3 else (0, 40, 5, None))


def test_twice(brax, tmp_path):
    """Interrupted again, it goes on again; in the first round, the stage begins again."""
    for at in ((0, 1), (0, 3), (1, 1)):
        brax.at.clear()
        brax.at["saved" if at[0] else "evaluated"] = at
        killed(tmp_path)
    brax.at.clear()
    finished(tmp_path, said := [])
    assert said == ["The training goes on from 40 steps."]
    assert brax.calls == [(0, 40, 5, None), (0, 30, 4, "0 1"), (0, 10, 2, "0 3"), (1, 40, 5, "0 2"), (1, 40, 5, "0 2")]


@pytest.mark.parametrize(
    ("stage", "broken", "goes_on"), [(0, [3], "20 steps"), (1, [3, 2, 1], "40 steps, the start of the stage")]
)
def test_broken_checkpoints(stage, broken, goes_on, brax, tmp_path):
    """It goes on from the one before, and says so; until training has passed them they stay where they are, and may be mended."""
    brax.at["evaluated"] = (stage, 3)
    killed(tmp_path)
    files = {k: policy(tmp_path, stage, k) / "at" for k in broken}
    for file in files.values():
        file.rename(file.with_name("mended"))
    brax.at["evaluated"] = (stage, 0)
    says = [
        f"The checkpoint of {40 * stage + 10 * k} steps cannot be read (no `at`); the training goes on from {goes_on}."
        for k in broken
    ]
    brax.calls.clear()
    if stage:
        with pytest.raises(Killed):
            stages.train(CONFIG, tmp_path, lambda *_: None, (said := []).append)
        assert said == says
        for file in files.values():
            file.with_name("mended").rename(file)
        said, says, call = [], ["The training goes on from 70 steps."], (1, 10, 2, "1 3")
    else:
        said, call = [], (0, 20, 3, "0 2")
    brax.at.clear()
    brax.calls.clear()
    finished(tmp_path, said)
    assert said == says
    assert brax.calls[0] == call


def test_what_is_kept_can_be_read(brax, tmp_path):
    """Not the best policy, where its checkpoint is broken; where all are, the stage has to begin again."""
    brax.at["evaluated"] = (0, 4)
    killed(tmp_path)
    for k in range(1, 5):
        (policy(tmp_path, 0, k) / "at").unlink()
    stage = checkpoints.Stage(tmp_path, 0)
    with pytest.raises(ValueError, match="No checkpoint") as error:
        stage.finish()
    again = "the same `mjx-arenas train` command begins the stage again"
    assert str(error.value) == f"No checkpoint in {tmp_path}/checkpoints/unfinished0 can be read: {again}."
    (policy(tmp_path, 0, 4) / "at").write_text("0 4")
    assert stage.finish() == ["The checkpoint of 20 steps cannot be read (no `at`)"]
    assert (stage.finished / "params" / "at").read_text() == "0 4"
    assert [line["steps"] for line in trained.read_log(stage.log) if line.get("kept")] == [40]


def test_a_line_that_was_deleted(brax, tmp_path):
    """Changes nothing of what is left, nor where a stage starts."""
    brax.at["evaluated"] = (1, 3)
    killed(tmp_path)
    log = tmp_path / "progress.jsonl"
    for gone in (4, 4, 4):  # the last of stage 0, and the first two of stage 1
        lines = log.read_text().splitlines()
        log.write_text("\n".join(lines[:gone] + lines[gone + 1 :]))
    stage = checkpoints.Stage(tmp_path, 1)
    assert (stage.steps, stage.left(40, 5), stage.newest) == (70, (10, 2), policy(tmp_path, 1, 3))
    stage = checkpoints.Stage(tmp_path, 0)
    assert (stage.steps, stage.newest) == (0, None)


def test_older_trainings(brax, tmp_path):
    """Their logs have no rounds: a stage that is not finished begins again."""
    brax.at["evaluated"] = (1, 3)
    killed(tmp_path)
    log = tmp_path / "progress.jsonl"
    lines = trained.read_log(log)
    trained.write(
        log,
        "\n".join(
            json.dumps({name: x for name, x in line.items() if name not in ("round", "start")}) for line in lines
        ),
    )
    for k in (1, 2, 3):
        policy(tmp_path, 1, k).parent.rename(tmp_path / "checkpoints" / "unfinished1" / f"{10 * k:012d}")
    brax.at.clear()
    brax.calls.clear()
    finished(tmp_path, said := [])
    assert said == ["The training goes on from 40 steps."]
    assert brax.calls == [(1, 40, 5, "0 2")]


@pytest.mark.parametrize("stage", [0, 1])
@pytest.mark.parametrize("when", ["evaluated", "keeping", "kept"])
def test_all_steps_are_there(when, stage, brax, tmp_path, monkeypatch):
    """Only what is missing is done: no step is learned again; stage 0 keeps a policy of its own, stage 1 that of stage 0."""
    brax.at["evaluated"] = (stage, 4) if when == "evaluated" else None
    function, owner = ("sync", checkpoints) if when == "keeping" else ("clear", checkpoints.Stage)
    called, run = [], getattr(owner, function)

    def kill(*args):
        called.append(args)
        if len(called) == (3 if stage and when == "keeping" else 1 + stage):  # after two for stage 0
            raise Killed
        run(*args)

    with monkeypatch.context() as patched:
        if when != "evaluated":
            patched.setattr(owner, function, kill)
        killed(tmp_path)
    (tmp_path / "checkpoints" / f".stage{stage}.abc").mkdir()  # of an older version that was killed
    assert checkpoints.saved_steps(tmp_path) == 40 + 40 * stage
    brax.at.clear()
    brax.calls.clear()
    finished(tmp_path, [])
    assert brax.calls == ([] if stage else [(1, 40, 5, "0 2")])
    assert sorted(path.name for path in (tmp_path / "checkpoints").iterdir()) == ["stage0", "stage1"]


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # of orbax, about what is broken
def test_what_is_whole(tmp_path):
    """A checkpoint of which each file is as it was; not one that a power cut left without a file, or with an empty one."""
    factory = functools.partial(networks.make_ppo_networks, policy_hidden_layer_sizes=(4,))
    made = factory(2, 1)
    normal = running_statistics.init_state(jax.ShapeDtypeStruct((2,), "float32"))
    params = (normal, made.policy_network.init(jax.random.PRNGKey(0)), {})
    checkpoint.save(
        tmp_path / "saved", 10, params, checkpoint.network_config(2, 1, True, factory), "ppo_network_config.json"
    )
    saved = tmp_path / "saved" / f"{10:012d}"
    assert not checkpoints._unreadable(saved)
    for folder in (tmp_path, tmp_path / "none"):
        assert checkpoints._unreadable(folder)
    for name in ("manifest.ocdbt", "_METADATA", "d/*", "ppo_network_config.json"):
        for change in (pathlib.Path.unlink, lambda path: path.write_bytes(b"")):
            copy = shutil.copytree(saved, tmp_path / "copy")
            for path in copy.glob(name):
                change(path)
            why = checkpoints._unreadable(copy)
            assert why, (name, change)
            assert "\n" not in why
            shutil.rmtree(copy)


def test_nothing_is_saved(brax, tmp_path):
    assert checkpoints.saved_steps(tmp_path) is None
    brax.at["saved"] = (0, 1)
    killed(tmp_path)
    assert train.again(tmp_path) == "the same command begins again, as no policy has been evaluated yet"


WORK = """import os, pathlib, time
from mjx_arenas.files import output

with output.whole(pathlib.Path("a.csv")) as unfinished:
    unfinished.write_text("half")
    print(os.getpid(), flush=True)
    time.sleep(600)
"""


@pytest.mark.slow
def test_what_is_apart_ends_with_its_parent(tmp_path):
    """Also where that is killed: it would hold the GPU, and write where the same command begins to write again."""
    call = f"from mjx_arenas import train; train.apart(exec, {WORK!r})"
    with subprocess.Popen([sys.executable, "-c", call], stdout=subprocess.PIPE, cwd=tmp_path) as parent:
        worker = int(parent.stdout.readline())
        assert len(list(tmp_path.iterdir())) == 1
        parent.kill()
        try:
            parent.communicate(timeout=60)  # until neither has the output open
        except subprocess.TimeoutExpired:
            os.kill(worker, signal.SIGKILL)
            raise
    assert not list(tmp_path.iterdir())


def test_seeds_of_stages():
    """Others for each training, stage, and round after which it goes on."""
    numbers = [
        (seed, stage, n) for seed in (0, 1, 5, 1000, 5 + 2**29, 2**32 - 1) for stage in (0, 1) for n in (0, 1, 7)
    ]
    assert len({stages.seed_of(*one) for one in numbers}) == len(numbers)


def test_dagger_goes_on(monkeypatch):
    """With the rounds that are left, and with the learning rate that it had."""
    monkeypatch.setattr(evaluate, "episode_length", lambda env: 3)
    monkeypatch.setattr(wrapper, "wrap_for_brax_training", lambda env, episode_length: env)
    monkeypatch.setattr(policies, "networks", lambda config: None)
    told = []
    monkeypatch.setattr(bc, "train", lambda **given: told.append(given))
    dagger = {"num_timesteps": 100, "num_evals": 5, "num_envs": 2, "demo_length": 5, "num_minibatches": 2, "epochs": 3}
    config = {"stages": 1, "sees": "pictures", "eval_worlds": 2}
    config["dagger"] = dagger | {"learning_rate": 1.0, "network_factory": {}}
    for left in ((100, 5), (60, 3)):
        stages._dagger(print, None, config, print, left)
    whole, rest = told
    assert [(given["dagger_steps"], given["num_evals"]) for given in told] == [(12, 5), (6, 3)]
    np.testing.assert_allclose(rest["learning_rate"](np.arange(36)), whole["learning_rate"](np.arange(36, 72)))
    assert whole["learning_rate"](0) == 1.0


@pytest.mark.parametrize(("number", "broken"), [(1, "\0" * 9), (1, '{"st\n...'), (5, '...{"st')])
def test_a_broken_line(number, broken, brax, tmp_path):
    """Zeros after a power cut, in a log of an older version, or of somebody's own hand: it is named, and what is there stays."""
    brax.at["evaluated"] = (0, 3)
    killed(tmp_path)
    log = tmp_path / "progress.jsonl"
    text = log.read_text()
    log.write_text(broken.replace("...", text))
    with pytest.raises(ValueError, match="is broken") as error:
        stages.train(CONFIG, tmp_path, lambda *_: None)
    assert str(error.value) == f"{log} is broken in line {number}: delete that line."
    log.write_text(text)
    brax.at.clear()
    finished(tmp_path, said := [])
    assert said == ["The training goes on from 30 steps."]


@pytest.mark.parametrize("does", ["brings it back", "deletes the folder"])
@pytest.mark.parametrize("lost", [pathlib.Path.unlink, lambda log: log.write_text("")])
def test_a_lost_log(lost, does, brax, tmp_path):
    """It takes no checkpoint with it: its reader decides."""
    brax.at["evaluated"] = (0, 3)
    killed(tmp_path)
    log, folder = tmp_path / "progress.jsonl", tmp_path / "checkpoints" / "unfinished0"
    text = log.read_text()
    lost(log)
    with pytest.raises(ValueError, match="says nothing") as error:
        stages.train(CONFIG, tmp_path, lambda *_: None)
    assert str(error.value) == (
        f"{folder} has checkpoints of which {log} says nothing: bring its lines back, or delete that folder, and the "
        "same `mjx-arenas train` command begins the stage again."
    )
    assert [(policy(tmp_path, 0, k) / "at").read_text() for k in (1, 2, 3)] == ["0 1", "0 2", "0 3"]
    if does == "brings it back":
        log.write_text(text)
    else:
        shutil.rmtree(folder)
    brax.at.clear()
    finished(tmp_path, said := [])
    assert said == (["The training goes on from 30 steps."] if does == "brings it back" else [])


def test_a_log_is_on_the_disk(tmp_path, monkeypatch):
    """Before it takes the place of the one before; a power cut could leave neither."""
    log, done, replace = tmp_path / "progress.jsonl", [], os.replace
    monkeypatch.setattr(os, "fsync", lambda opened: done.append(pathlib.Path(f"/proc/self/fd/{opened}").read_text()))
    monkeypatch.setattr(os, "replace", lambda *paths: (done.append("replaced"), replace(*paths)))
    trained.write(log, "all")
    assert done == ["all\n", "replaced"]
    assert log.read_text() == "all\n"


def test_a_refused_training_changes_nothing(tmp_path):
    """Not the folder of a finished one, which may be judged and drawn without what more stages need; a new one writes nothing."""
    data = settings.settled(settings.read(settings.find("reach")), gpu=False, pixels=False)
    data["env"] = {"arena": str(tmp_path / "gone.yaml")}
    config = settings.configuration(data, "jax", pixels=False)
    out = tmp_path / "out"
    out.mkdir()
    with pytest.raises(OSError, match=r"gone\.yaml"):
        train.run(config, out)
    assert not list(out.iterdir())
    texts = dict.fromkeys(("result.json", "strip.png", "film.mp4", "seen.mp4"), "{}")
    texts["config.json"] = json.dumps(config, indent=1) + "\n"
    for name, text in texts.items():
        (out / name).write_text(text)
    learner = config["ppo"] | {"num_timesteps": 2 * config["ppo"]["num_timesteps"]}
    with pytest.raises(OSError, match=r"gone\.yaml"):
        train.run(config | {"stages": 2, "ppo": learner}, out)
    train.run(config, out, (said := []).append)
    assert said == [f"The training in {out} is finished; --stages 2 goes on with it."]
    assert {path.name: path.read_text() for path in out.iterdir()} == texts


@pytest.mark.parametrize("text", ['{"stage": "a', "", "3"])
def test_broken_files(text, tmp_path, monkeypatch, capsys):
    """Are named, also by `load_policy` and `load_env`; without them the same command goes on."""
    monkeypatch.setattr(train, "check", lambda config: None)
    monkeypatch.setattr(
        train,
        "train",
        lambda config, out, say: (out / "checkpoints" / "stage0" / "params").mkdir(parents=True, exist_ok=True),
    )
    monkeypatch.setattr(train, "draw", lambda *_: None)
    monkeypatch.setattr(train, "load_policy", lambda folder: None)
    monkeypatch.setattr(judged, "evaluate", lambda config, policy: {"held_out": {"worlds": 2, "success": 1.0}})
    monkeypatch.setattr(jax, "local_device_count", lambda: 1)
    command = (*ARGUMENTS, "--stages", "1", "--out", tmp_path)
    assert train_main(*command) == 0
    for name in ("config.json", "result.json"):
        whole = (tmp_path / name).read_text()
        (tmp_path / name).write_text(text)
        capsys.readouterr()
        assert train_main(*command) == 2
        told = f"{tmp_path / name} is broken: delete it, and the same `mjx-arenas train` command writes it again."
        assert capsys.readouterr().err == f"error: {told}\n"
        for load in (policies.load_policy, policies.load_env) if name == "config.json" else ():
            with pytest.raises(ValueError, match="is broken") as error:
                load(tmp_path)
            assert str(error.value) == told
        (tmp_path / name).unlink()
        assert train_main(*command) == 0
        assert (tmp_path / name).read_text() == whole
    of_network = tmp_path / "checkpoints" / "stage0" / "params" / "ppo_network_config.json"
    of_network.write_text(text)
    with pytest.raises(ValueError, match="is broken") as error:
        policies.load_policy(tmp_path)
    assert str(error.value) == f"{of_network} is broken: the policy beside it cannot be loaded."


@pytest.mark.slow
def test_brax_goes_on(tiny, tmp_path, monkeypatch, capsys):
    """Brax itself, killed in the second of three rounds: what it begins with is what it had learned, and nothing is counted twice."""
    command = (*ARGUMENTS, "--num-timesteps", "120", "--num-evals", "4", "--stages", "1", "--out", tmp_path)

    def kill(log, picture):
        if len(trained.read_log(log)) == 3:
            raise ValueError("killed")

    with monkeypatch.context() as patched:
        patched.setattr(stages, "curve", kill)
        assert train_main(*command) == 2
    before = trained.read_log(tmp_path / "progress.jsonl")
    assert [line["steps"] for line in before] == [0, 40, 80]
    saved = policy(tmp_path, 0, 2)
    loaded, load = [], checkpoint.load
    monkeypatch.setattr("brax.training.agents.ppo.checkpoint.load", lambda path: loaded.append(path) or load(path))
    assert train_main(*command) == 0
    said = capsys.readouterr().out
    assert "The training goes on from 80 steps." in said
    assert "120 of at least 120 steps" in said
    assert loaded[0] == str(saved)
    lines = trained.read_log(tmp_path / "progress.jsonl")
    assert [line["steps"] for line in lines] == [0, 40, 80, 120]
    assert [{**line, "kept": 0} for line in lines[:3]] == [{**line, "kept": 0} for line in before]
    assert not list(tmp_path.glob("**/*unfinished*"))
    assert policies.load_policy(tmp_path)
    assert json.loads((tmp_path / "result.json").read_text())["held_out"]["worlds"] == 2


@pytest.mark.slow
def test_one_evaluation(tiny, tmp_path):
    """At the end of each stage alone."""
    command = (*ARGUMENTS, "--num-evals", "1", "--stages", "2", "--out", tmp_path)
    assert train_main(*command) == 0
    lines = trained.read_log(tmp_path / "progress.jsonl")
    assert [(line["stage"], line["steps"], line["kept"]) for line in lines] == [(0, 60, True), (1, 120, True)]
    assert policies.load_policy(tmp_path)


class Seeing(Small):
    """It gives pictures, too."""

    def _state(self, at, *rest):
        state = super()._state(at, *rest)
        return state.replace(obs=state.obs | {"pixels/view_0": jnp.full((16, 16, 3), at)})


@pytest.mark.slow
def test_brax_goes_on_with_pictures(tiny, tmp_path, monkeypatch):
    """Brax's DAgger, killed after the first of its two rounds."""

    def teacher(obs, key):
        loc = 0.5 + 0 * obs["privileged_state"][..., :1]
        return jnp.tanh(loc), {"loc": loc, "scale": jnp.ones_like(loc)}

    monkeypatch.setattr("mjx_arenas.envs.tasks.configured.environment", lambda config, overrides: Seeing({}))
    monkeypatch.setattr("mjx_arenas.envs.tasks.configured.check_worlds", lambda env: None)
    monkeypatch.setattr(stages.policies, "load_policy", lambda folder: teacher)
    read = settings.settled(settings.read(settings.find("push")), gpu=True, pixels=True)
    own = {"num_timesteps": 8, "num_evals": 3, "num_envs": 2, "demo_length": 2, "num_minibatches": 2}
    changed = settings.merged(read, {"eval_worlds": 2, "stages": 1, "dagger": own}, "the test")
    config = settings.configuration(changed, "jax", pixels=True)
    with monkeypatch.context() as patched:
        patched.setattr(stages, "curve", lambda log, picture: 1 / (2 - len(trained.read_log(log))))
        with pytest.raises(ZeroDivisionError):
            stages.train(config, tmp_path, lambda *_: None)
    assert checkpoints.saved_steps(tmp_path) == 4
    before = checkpoint.load(policy(tmp_path, 0, 1))
    stages.train(config, tmp_path, lambda *_: None, (said := []).append)
    assert said == ["The training goes on from 4 steps."]
    lines = trained.read_log(tmp_path / "progress.jsonl")
    assert [line["steps"] for line in lines] == [0, 4, 8]
    assert [path.name for path in tmp_path.glob("checkpoints/*/*")] == ["params"]
    after = checkpoint.load(tmp_path / "checkpoints" / "stage0" / "params")
    counts = [int(params[0].count.lo) for params in (before, after)]
    assert counts[0] > 0
    assert lines[2].get("kept", False) is (counts[1] == 2 * counts[0])
