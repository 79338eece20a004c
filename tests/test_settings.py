"""What a training is, by files and the command line: what makes no sense is answered before anything is trained."""

import importlib.util
import json
import re
import shlex
import sys

import jax
import jax.numpy as jnp
import models
import numpy as np
import pages
import pytest
from command import train_main

pytest.importorskip("brax")

from brax.training.acme import running_statistics
from brax.training.agents.ppo import checkpoint

import mjx_arenas as mja
from mjx_arenas import brax_bridge, cli, envs, policies, settings, train
from mjx_arenas.envs.tasks import configured
from mjx_arenas.files import paths
from mjx_arenas.problems import messages
from mjx_arenas.viz import render

ARGUMENTS = ["--engine", "jax", "--num-envs", "4", "--set", "ppo.num_minibatches=2"]


WRONG = {
    "no evaluations": (["--num-evals", "0"], "Invalid value for '--num-evals': '0' is not a whole number from 1 to"),
    "one of pictures": (
        ["--pixels", "--num-evals", "1"],
        "`dagger.num_evals` must be at least 2, as Brax's DAgger always begins with one, got 1.",
    ),
    "arenas": (["--arenas", "some"], "Invalid value for '--arenas': 'some' is not one of"),
    "arenas of the environment": (  # which would judge the policy, too
        ["--set", "env.config.arenas=nominal"],
        "`env.config.arenas` must be left out, as `arenas` of the training decides it (--arenas on the command line), got 'nominal'.",
    ),
    "an engine of the environment": (
        ["--set", "env.config.impl=jax"],
        "`env.config.impl` must be left out, as `impl` of the training decides it (--engine on the command line), got 'jax'.",
    ),
    "no worlds to judge on": (
        ["--eval-worlds", "0"],
        "Invalid value for '--eval-worlds': '0' is not a whole number from 1",
    ),
    "worlds": (["--num-envs", "7"], "`ppo.num_envs` must be a multiple of `ppo.num_minibatches`, 2, got 7."),
    "batch": (
        ["--set", "ppo.batch_size=3"],
        "`ppo.batch_size` times `ppo.num_minibatches` must be a multiple of 4 worlds, got 6.",
    ),
    "pictures": (
        ["--pixels", "--num-envs", "4", "--set", "dagger.num_minibatches=80"],
        "`dagger.num_envs` times `dagger.demo_length` must be a multiple of `dagger.num_minibatches`, 80, got 40.",
    ),
    "no number": (["--set", "ppo.learning_rate=fast"], "--set: `ppo.learning_rate` must be like 0.001, got 'fast'."),
    "learning at once": (["--set", "ppo.learning_rate=.inf"], "`ppo.learning_rate` must be a number > 0, got inf."),
    "a layer that is true": (
        ["--set", "ppo.network_factory.policy_hidden_layer_sizes=[true, 8]"],
        "`ppo.network_factory.policy_hidden_layer_sizes` must be whole numbers >= 1, got [True, 8].",
    ),
    "learning backwards": (["--set", "ppo.learning_rate=-1"], "`ppo.learning_rate` must be a number > 0, got -1."),
    "not a number": (["--set", "ppo.entropy_cost=.nan"], "`ppo.entropy_cost` must be a number >= 0, got nan."),
    "more than all": (["--set", "ppo.discounting=2"], "`ppo.discounting` must be a number >= 0 and <= 1, got 2."),
    "no steps": (["--set", "ppo.unroll_length=0"], "`ppo.unroll_length` must be a whole number >= 1, got 0."),
    "no batch": (["--set", "ppo.batch_size=null", "--num-envs", "7"], "`ppo.num_envs` must be a multiple of"),
    "fewer than no worlds": (
        ["--set", "ppo.num_eval_envs=-3"],
        "`ppo.num_eval_envs` must be a whole number >= 1, got -3.",
    ),
    "words for worlds": (["--set", "ppo.num_eval_envs=x"], "`ppo.num_eval_envs` must be a whole number >= 1, got 'x'."),
    "fewer than no resets": (
        ["--set", "ppo.num_resets_per_eval=-1"],
        "`ppo.num_resets_per_eval` must be a whole number >= 0, got -1.",
    ),
    "words for a length": (["--set", "ppo.demo_length=x"], "`ppo.demo_length` must be a whole number >= 1, got 'x'."),
    "a part of files": (
        ["--set", "cpu.ppo.num_env=3"],
        "--set: `cpu.ppo.num_env` is a part of files alone: set `ppo.num_env` itself.",
    ),
    "no seed": (["--set", "seed=-5"], "`seed` must be a whole number from 0 to 2^32 - 1, got -5."),
    "no names in env": (["--set", "env=3"], "--set: `env` must have names and values, got 3."),
    "no names in config": (["--set", "env.config=x"], "--set: `env.config` must have names and values, got 'x'."),
    "no such observation": (
        ["--set", "ppo.network_factory.value_obs_key=nothing"],
        "`ppo.network_factory.value_obs_key` must be one of the observations 'privileged_state', 'state', got 'nothing'.",
    ),
    "a list of observations": (
        ["--set", "ppo.network_factory.value_obs_key=[state, foo]"],
        "`ppo.network_factory.value_obs_key` must be the name of an observation, got ['state', 'foo'].",
    ),
    "half a world": (["--set", "ppo.batch_size=2.5"], "`ppo.batch_size` must be a whole number >= 1, got 2.5."),
    "no neurons": (
        ["--set", "ppo.network_factory.policy_hidden_layer_sizes=[32, 0]"],
        "`ppo.network_factory.policy_hidden_layer_sizes` must be whole numbers >= 1, got [32, 0].",
    ),
    "no value": (["--set", "seed"], "Invalid value for '--set': 'seed' is not a name and a value, such as"),
    "no such name": (["--set", "wind.seed=1"], "--set: `wind` is not known: here are arenas, cpu, dagger, env,"),
    "a name of a part": (
        ["--set", "learning_rate=1e-3"],
        "--set: `learning_rate` is not known: did you mean `ppo.learning_rate`?",
    ),
    "a near name": (["--set", "pop.seed=1"], "--set: `pop` is not known: did you mean `ppo`?"),
    "a near argument of PPO": (
        ["--set", "ppo.learning_rat=1"],
        "`ppo` must have arguments of Brax's PPO, got learning_rat: did you mean `ppo.learning_rate`?",
    ),
    "of nothing": (["--set", "seed.x=1"], "--set: `seed` must be like 0, got {'x': 1}."),
    "no arm": (["--arm", "small"], "`env` of the task push may have config, got arm."),
    "not of PPO": (["--set", "ppo.momentum=1"], "`ppo` must have arguments of Brax's PPO, got momentum."),
    "not kept": (
        ["--set", "ppo.normalize_observations_mode=ema"],
        "`ppo` must not have normalize_observations_mode, which a training decides by itself.",
    ),
    "not of the networks": (
        ["--set", "ppo.network_factory.policy_hidden_sizes=[8]"],
        "`ppo.network_factory` must have arguments of Brax's make_ppo_networks, got policy_hidden_sizes: did you mean "
        "`ppo.network_factory.policy_hidden_layer_sizes`?",
    ),
    "not to be given to networks": (
        ["--set", "ppo.network_factory.action_size=3"],
        "`ppo.network_factory` must not have action_size, which a training decides by itself.",
    ),
    "not of the teacher's networks": (
        ["--pixels", "--num-envs", "4", "--set", "ppo.network_factory.cnn_stride=[1]"],
        "`ppo.network_factory` must have arguments of Brax's make_ppo_networks, got cnn_stride.",
    ),
    "not of networks that see": (
        ["--pixels", "--num-envs", "4", "--set", "dagger.network_factory.cnn_strides=[1]"],
        "`dagger.network_factory` must have arguments of Brax's make_ppo_networks_vision, got cnn_strides: did you mean "
        "`dagger.network_factory.cnn_stride`?",
    ),
    "half a device": (
        ["--set", "ppo.max_devices_per_host=0.5"],
        "`ppo.max_devices_per_host` must be a whole number >= 1, got 0.5.",
    ),
    "not to be given": (
        ["--set", "ppo.seed=1", "--set", "ppo.log_training_metrics=true", "--set", "ppo.action_repeat=2"],
        "`ppo` must not have seed, log_training_metrics, action_repeat, which a training decides by itself.",
    ),
    "not of DAgger": (
        ["--pixels", "--num-envs", "4", "--set", "dagger.momentum=1"],
        "`dagger` must have arguments of Brax's DAgger, got momentum.",
    ),
    "not to be given to DAgger": (
        ["--pixels", "--num-envs", "4", "--set", "dagger.batch_size=8", "--set", "dagger.tanh_squash=false"],
        "`dagger` must not have batch_size, tanh_squash, which a training decides by itself.",
    ),
    "not of the environment": (
        ["--set", "env.config.speed=1"],
        "`config_overrides` has 'speed', which the configuration",
    ),
    "no range": (
        ["--set", "ranges.table_rots={Uniform: [a, 1]}"],
        "`ranges.table_rots` (Uniform): `low` must be numbers, got 'a'.",
    ),
    "no wider range": (  # which would be met when the policy is judged
        ["--set", "wider_ranges={terms: {lamp: {Uniform: [0, 1]}}}"],
        "`ranges.terms`: the arena has no quantity 'lamp'; it has no quantities at all: ",
    ),
    "no such arm": (
        ["--set", "task=lift", "--arm", "foo"],
        "`env.arm`: no arm is called 'foo'; known are small, yam, panda, or give `module:function`.",
    ),
    "a near arm": (
        ["--set", "task=lift", "--arm", "pandaa"],
        "`env.arm`: no arm is called 'pandaa': did you mean `panda`?",
    ),
    "a near argument of the environment": (
        ["--set", "task=lift", "--set", "env.robot_strenght=1"],
        "`env` of the task lift may have arm, arena, on, pos, terms, robot_strength, config, got robot_strenght: did you mean "
        "`robot_strength`?",
    ),
    "vision": (
        ["--set", "task=lift", "--set", "env.config.vision=true"],
        "`env.config.vision` must be left out, as `--pixels` says whether the policy sees pictures, got True.",
    ),
    "gains without a strength": (
        ["--set", "task=lift", "--set", "ranges={terms: {arm_kp: {Uniform: [0.5, 1.5]}}}"],
        "`ranges.terms` has 'arm_kp', a quantity of `robot_strength`, which must be > 0 for it, got 0.",
    ),
    "no teacher": (["--teacher-timesteps", "5"], "--teacher-timesteps needs --pixels: only then is there a teacher."),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong(case, monkeypatch, tmp_path, capsys):
    """One sentence, before anything is trained; the same where a training is only shown."""
    arguments, says = WRONG[case]
    monkeypatch.setattr(render, "choose_gl", lambda: None)
    monkeypatch.setattr(jax, "local_device_count", lambda: 1)
    for only in ((), ("--show",)):
        assert train_main(*ARGUMENTS, *arguments, *only, "--out", tmp_path / "out") == 2
        out, err = capsys.readouterr()
        assert err.startswith(f"error: {says}"), err
        assert "ppo" not in out
    assert not (tmp_path / "out" / "checkpoints").exists()


def test_without_brax(monkeypatch, tmp_path):
    """What needs it says which extra brings it."""
    monkeypatch.setitem(sys.modules, "brax", None)
    says = r"^This needs brax: pip install 'mjx_arenas\[train\]'\.$"
    with pytest.raises(ImportError, match=says):
        policies.load_policy(tmp_path)
    with pytest.raises(ImportError, match=says), brax_bridge.device_put_replicated():
        pass


def test_pictures_on_several_devices(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(render, "choose_gl", lambda: None)
    monkeypatch.setattr(jax, "local_device_count", lambda: 2)
    assert train_main(*ARGUMENTS, "--pixels", "--show", "--out", tmp_path / "out") == 2
    says = "error: Policies that see are trained on one device, and here are 2: set CUDA_VISIBLE_DEVICES=0.\n"
    assert capsys.readouterr().err == says


SHARED = {
    (3, 3): "`ppo.num_envs` must be a multiple of `ppo.num_minibatches` times the number of devices, 6, got 3.",
    (4, 4): "`ppo.num_envs` must be a multiple of `ppo.num_minibatches` times the number of devices, 8, got 4.",
    (4, 2): None,
    (3, 2, 3): "`ppo.num_envs` must be a multiple of the number of devices, 2, got 3.",
    (2, 2, 3): "`ppo.batch_size` must be a multiple of the number of devices, 2, got 3.",
    (4, 2, 2): None,
}
"""By `num_envs`, `num_minibatches` and `batch_size`."""


@pytest.mark.parametrize("numbers", SHARED)
def test_what_two_devices_share(numbers):
    """Equally: Brax fails in an assertion where there are worlds left over, and in JAX where a minibatch has some."""
    given = dict(zip(("num_envs", "num_minibatches", "batch_size"), numbers, strict=False))
    data = settings.merged(settings.read(settings.find("push")), {"ppo": given}, "here")
    config, says = settings.configuration(data, "jax", pixels=False), SHARED[numbers]
    found = settings.problem(config, 2)
    assert (found and messages.sentence(found)) == says
    config["ppo"]["max_devices_per_host"] = 1
    assert settings.problem(config, 2) is None


def test_a_refused_training_leaves_its_folder_free(monkeypatch, tmp_path, capsys):
    """Another one is answered for itself, and not as one that does not go on with it."""
    for case in ("not of PPO", "no arm"):
        test_wrong(case, monkeypatch, tmp_path, capsys)


def test_nothing_to_train_with(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(train.importlib.util, "find_spec", lambda name: None if name == "brax" else True)
    assert train_main("--out", tmp_path / "out") == 2
    says = "error: Training needs brax: pip install 'mjx_arenas[train]', or make train.\n"
    assert capsys.readouterr().err == says
    assert not (tmp_path / "out").exists()


OWN = """
task: lift
env: {arena: table.yaml, on: table, pos: [-0.3, 0, 0], config: {action_delay: [0, 2]}}
ranges: {table_rots: {Uniform: [-0.1, 0.1]}}
ppo: {learning_rate: 0.0003}
cpu: {ppo: {num_envs: 32}}
"""
TABLE = """
arena: {type: TableArena, objects: [cube], options: {cone: 1, impratio: 10}}
ranges: {table_rots: {Uniform: [-1, 1]}, object_masses: {Uniform: [0.1, 0.2]}}
"""


def test_a_file_of_ones_own(tmp_path, capsys):
    """It says what differs; an arena file stands beside it and has ranges, over which those of the file lie."""
    (tmp_path / "own.yaml").write_text(OWN)
    (tmp_path / "table.yaml").write_text(TABLE)
    data = settings.read(tmp_path / "own.yaml")
    plain = settings.read(settings.find("lift"))
    assert data["ppo"] == plain["ppo"] | {"learning_rate": 0.0003}
    on_cpu, on_gpu = (settings.settled(data, gpu=gpu, pixels=False) for gpu in (False, True))
    assert [x["ppo"]["num_envs"] for x in (on_cpu, on_gpu)] == [32, 8192]
    config = settings.configuration(on_cpu, "jax", pixels=False)
    env = configured.environment(config)
    assert env.arena.objects[0].name == "cube"
    assert env.ranges.table_rots == mja.Uniform(-0.1, 0.1)
    assert env.ranges.object_masses == mja.Uniform(0.1, 0.2)
    assert env._config.action_delay == (0, 2)
    assert configured.environment(config, "out_of_range") is None

    for text, numbers in {  # what a file says counts without a GPU, too; else the library's numbers for it do
        "ppo: {num_envs: 16, num_timesteps: 3000}": (16, 3000, 64),
        "ppo: {num_envs: 16}\neval_worlds: 8": (16, 400_000, 8),
        "ppo: {num_envs: 16}\ncpu: {ppo: {num_envs: 32}}": (32, 400_000, 64),
    }.items():
        (tmp_path / "few.yaml").write_text(f"task: lift\n{text}")
        few = settings.settled(settings.read(tmp_path / "few.yaml"), gpu=False, pixels=False)
        assert (few["ppo"]["num_envs"], few["ppo"]["num_timesteps"], few["eval_worlds"]) == numbers

    sees = settings.configuration(settings.settled(data, gpu=False, pixels=True), "warp", pixels=True)
    assert (sees["sees"], sees["teacher"]["sees"], "ppo" in sees) == ("pictures", "everything", False)
    assert sees["dagger"]["num_envs"] == 64
    few = data | {"env": data["env"] | {"config": {"num_arenas": 4, "drawn_seed": 1}}}
    sees = settings.configuration(settings.settled(few, gpu=False, pixels=True), "warp", pixels=True)
    assert sees["env"]["config"] == {"num_arenas": 4, "drawn_seed": 1}
    assert sees["teacher"]["env"] == data["env"] | {"config": {"drawn_seed": 1}}  # its arenas are always new
    for text, says in {
        "task: lift\nppo: 3": "`ppo` must have names and values, got 3.",
        "task: fly": "`task` must be one of lift, open_drawer, pick_and_place, push, reach, or module:function, got 'fly'.",
        "task: lift\ntask: push": "`task` is given twice.",
        "- 3": "a training is described by names and values.",
    }.items():
        (tmp_path / "wrong.yaml").write_text(text)
        assert cli.main(["train", str(tmp_path / "wrong.yaml"), "--show"]) == 2
        assert says in capsys.readouterr().err
    assert cli.main(["train", str(tmp_path / "none.yaml")]) == 2
    assert f"There is no file '{tmp_path}/none.yaml'." in capsys.readouterr().err


@pytest.mark.parametrize("task", settings.tasks())
def test_configurations(task, capsys):
    """Each is whole and makes sense, with and without a GPU and pictures, and says so."""
    data = settings.read(settings.find(task))
    for gpu in (False, True):
        for pixels in (False, True):
            config = settings.configuration(settings.settled(data, gpu, pixels), "warp", pixels)
            assert settings.problem(config, 1) is None
            states = 2048 if task == "pick_and_place" else 8192
            assert settings.learner(config)["num_envs"] == ((4096 if pixels else states) if gpu else 64)
    assert cli.main(["train", task, "--show"]) == 0
    shown = capsys.readouterr().out
    assert f"task: {task}" in shown
    assert not re.search(r"^\w+:\n(?! )", shown, re.MULTILINE), shown  # no name without a value


def trainings():
    """The trainings that pages and the help tell to type."""
    lines = [line.strip() for line in cli.train.help.splitlines()]
    for page in pages.PAGES:
        lines += [*pages.commands(page), *pages.named_commands(page)] if page != "CHANGELOG.md" else []
    found = {}
    for line in lines:
        words = (
            shlex.split(line.partition("  ")[0] if line.startswith("mjx") else line, posix=True)
            if line[:1] == "m"
            else []
        )
        if words[:2] == ["make", "train"]:
            given = dict(word.split("=", 1) for word in words[2:])
            words = ["mjx-arenas", "train", given.get("TASK", "push"), *shlex.split(given.get("ARGS", ""))]
        if words[:2] == ["mjx-arenas", "train"] and not {"TASK", "--help"} & {*words} and words[2:]:
            found[shlex.join(words[2:])] = words[2:]
    # of arms with meshes, the YAM is quick
    return [
        pytest.param(words, id=line, marks=[pytest.mark.slow] * ("--pixels" in words or "ur5e" in line))
        for line, words in found.items()
    ]


@pytest.mark.slow
@pytest.mark.parametrize("words", trainings())
def test_documented_trainings(words, tmp_path, monkeypatch, capsys):
    """A training would begin: its task, its arm and its arena are there, and what it is given is taken."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(jax, "local_device_count", lambda: 1)
    ((mine, _),) = pages.blocks("docs/policies.md", "yaml")
    (tmp_path / "mine.yaml").write_text(mine)
    (tmp_path / "kitchen.yaml").write_text(TABLE)  # whose table is called "table"
    (tmp_path / "my_task.py").write_text(pages.blocks("docs/how_to/own_task.md")[0][0])
    (tmp_path / "push_aside.py").write_text(pages.blocks("docs/how_to/own_arm_task.md")[0][0])
    few = [code for code, title in pages.blocks("docs/arms.md", "yaml") if title == "few_worlds.yaml"]
    (tmp_path / "few_worlds.yaml").write_text(few[0])
    (tmp_path / "ur5e.py").write_text(pages.blocks("docs/how_to/own_arm.md")[0][0])
    (tmp_path / "lift_ur5e.yaml").write_text(pages.blocks("docs/how_to/own_arm.md", "yaml")[0][0])
    monkeypatch.syspath_prepend(models.ROBOTS)  # where the tests have robots' packages
    ur5e = "ur5e" in " ".join(words)
    for module, needed in {"mjlab": "yam" in words, "ogbench": ur5e, "warp": "--pixels" in words}.items():
        if needed and importlib.util.find_spec(module) is None:
            pytest.skip(f"needs {module}")
    assert cli.main(["train", *words, *(() if "--show" in words else ("--show",))]) == 0, capsys.readouterr().err
    assert "num_timesteps" in capsys.readouterr().out


def test_a_training_in_no_world(tmp_path, monkeypatch, capsys):
    """On tables that are too small for the box. The first world says why."""
    monkeypatch.setattr(render, "choose_gl", lambda: None)
    monkeypatch.setattr(jax, "local_device_count", lambda: 1)
    small = "ranges.table_full_sizes={Uniform: {low: [0.02, 0.02, 0.05], high: [0.04, 0.04, 0.05]}}"
    assert train_main(*ARGUMENTS, "--set", small, "--out", tmp_path / "out", task="push") == 2
    says = "error: `ranges` gives no valid world: none of the 64 that were drawn is. World 0: Object 'box' is 0.0"
    assert says in (found := capsys.readouterr().err), found
    assert not (tmp_path / "out" / "progress.jsonl").exists()


def test_an_example_as_arena():
    """By its name; the configuration keeps the path of its file."""
    (option,) = (one for one in cli.app.commands["train"].params if one.name == "arena")
    assert option.type.convert("kitchen", None, None) == str(paths.EXAMPLES / "kitchen.yaml")


@pytest.mark.slow
def test_ranges_of_tasks():
    """What a task is judged on beside its ranges is possible, and is not what it was trained on."""
    for name in settings.tasks():
        config = {"task": name, "impl": "jax", "sees": "numbers"}
        one, other = configured.environment(config), configured.environment(config, "out_of_range")
        assert one.ranges.varying == other.ranges.varying
        assert one.ranges != other.ranges


@pytest.mark.slow
def test_wider_ranges_lie_outside():
    """What the file of a training names stays as in training; where nothing of the task's wider ranges is left, nothing is judged."""
    wide = {"LogUniform": {"low": [0.2, 0.005, 0.0001], "high": [1.2, 0.005, 0.0001]}}
    config = {"task": "lift", "impl": "jax", "sees": "numbers", "ranges": {"table_frictions": wide}}
    one, other = (configured.environment(config, where).ranges for where in ("training", "out_of_range"))
    assert one.table_frictions == other.table_frictions == mja.LogUniform(*wide["LogUniform"].values())
    assert one.object_masses != other.object_masses
    config["wider_ranges"] = {"table_frictions": {"Fixed": [0.1, 0.005, 0.0001]}}
    assert isinstance(configured.environment(config, "out_of_range").ranges.table_frictions, mja.Fixed)
    every = {name: {"Fixed": 0.5} for name in ("table_rots",)}
    start = {"terms": {"arm_start": {"Uniform": [-0.1, 0.1]}}}
    offsets = {"table_offsets": {"Uniform": {"low": [0, 0, 0], "high": [0, 0, 0.1], "relative": "add"}}}
    config = {"task": "reach", "impl": "jax", "sees": "numbers", "ranges": every | start | offsets}
    assert configured.environment(config, "out_of_range") is None


@pytest.mark.slow
def test_vision_of_an_older_training():
    """What a new one may not say is no reason not to judge what was trained with it."""
    config = {"task": "reach", "impl": "jax", "sees": "numbers", "env": {"config": {"vision": True}}}
    assert configured.environment(config, "held_out").observation_size.keys() > {"state"}
    with pytest.raises(ValueError, match=r"^`env\.config\.vision` must be left out"):
        configured.environment(config)


@pytest.mark.parametrize("sees", ["numbers", "everything", "pictures"])
@pytest.mark.parametrize("given", [{}, {"policy_obs_key": "privileged_state"}, {"policy_obs_key": "state"}])
def test_what_a_policy_reads(sees, given, tmp_path):
    """A loaded policy checks the observation that its networks read, also one that a user's configuration names."""
    factory = {"policy_hidden_layer_sizes": [4], "value_hidden_layer_sizes": [4], **given}
    config = {"task": "reach", "sees": sees, ("dagger" if sees == "pictures" else "ppo"): {"network_factory": factory}}
    sizes = {"state": (2,), "privileged_state": (5,)} | ({"pixels/view_0": (16, 16, 3)} if sees == "pictures" else {})
    networks = policies.networks(config)(sizes, 1)
    normal = running_statistics.init_state(
        {name: jax.ShapeDtypeStruct(size, "float32") for name, size in sizes.items()}
    )
    params = (normal, networks.policy_network.init(jax.random.key(0)), {})
    stage = tmp_path / "checkpoints" / "stage0"
    checkpoint.save(stage, 0, params, checkpoint.network_config(sizes, 1, True, policies.networks(config)))
    (stage / f"{0:012d}").rename(stage / "params")
    (tmp_path / "config.json").write_text(json.dumps(config))
    policy = policies.load_policy(tmp_path)
    read = given.get("policy_obs_key", "privileged_state" if sees == "everything" else "state")
    views = {name: size for name, size in sizes.items() if name.startswith("pixels/")}
    assert policy.sees == {read: sizes[read], **views}
    only = {name: jnp.zeros((3, *sizes[name])) for name in policy.sees}
    assert policy(only, jax.random.key(0))[0].shape == (3, 1)
    more = only | {"pixels/view_1": jnp.ones((3, 16, 16, 3))}
    np.testing.assert_array_equal(policy(more, jax.random.key(0))[0], policy(only, jax.random.key(0))[0])
    for name in views:
        with pytest.raises(
            ValueError, match=r"the policy \(16, 16, 3\) numbers as 'pixels/view_0', .*got \(24, 24, 3\)"
        ):
            policy(only | {name: jnp.zeros((3, 24, 24, 3))}, jax.random.key(0))


def test_looks_of_a_configuration():
    """Of what is seen, the ranges of the configuration count, and else those of the task."""
    given = {"object_rgba": {"Uniform": [0.4, 0.6]}, "terms": {"lamps": {"Uniform": [0.5, 0.6]}}}
    env = configured.environment({"task": "lift", "impl": "jax", "sees": "pictures", "ranges": given})
    assert (env.ranges.object_rgba, env.ranges.terms["lamps"]) == (mja.Uniform(0.4, 0.6), mja.Uniform(0.5, 0.6))
    assert {"arm_start", "eye", "table_look"} <= {*env.ranges.terms}


@pytest.mark.parametrize("name", ["push", "transfer", "reach", "lift", "pick_and_place", "open_drawer"])
def test_configurations_are_documented(name):
    """Every key of a task's configuration, with its default and its unit."""
    module = importlib.import_module(f"mjx_arenas.envs.tasks.{name}")
    config, own = module.default_config().to_dict(), module.default_config.__doc__
    units = {"ctrl_dt": " s", "sim_dt": " s", "episode_length": " actions"}
    for key, unit in units.items():
        assert re.search(rf"`{key}` (is )?{re.escape(str(config.pop(key)))}{unit}", own)
    elsewhere = [envs.env_config.__doc__, envs.ArmTask.__doc__ if "`ArmTask`" in own else ""]
    for key, default in config.items():
        shown = re.escape(f'"{default}"' if isinstance(default, str) else str(default))
        assert any(re.search(rf"`{key}`(, `\w+`)? \({shown}\)", doc) for doc in (own, *elsewhere)), (key, default)


@pytest.mark.parametrize("theirs", [{"name": "app"}, {"task": "reach", "stages": ["build"]}])
@pytest.mark.parametrize("beside", ["notes.txt", None])
def test_a_folder_of_somebody_else(beside, theirs, tmp_path, monkeypatch, capsys):
    """Whose `config.json` is not that of a training: it stays as it is."""
    monkeypatch.setattr(train, "check", None)  # nothing begins
    theirs = json.dumps(theirs)
    (tmp_path / "config.json").write_text(theirs)
    if beside:
        (tmp_path / beside).write_text("")
    names = [*tmp_path.iterdir()]
    for more in ([], ["--stages", "4"]):
        assert train_main(*more, "--out", str(tmp_path), task="reach") == 2
        told = capsys.readouterr().err
        assert told.startswith(f"error: {tmp_path}/config.json is of another training (")
        assert told.endswith("): give another --out, or remove the folder.\n")
    assert (tmp_path / "config.json").read_text() == theirs
    assert [*tmp_path.iterdir()] == names


def test_the_file_of_an_arena_is_known_by_what_it_says(tmp_path):
    """A training goes on where its folder and the file were moved, not where the file says something else; older ones know its path."""
    from mjx_arenas import train

    def configured_at(name, text):
        folder = tmp_path / name
        folder.mkdir(exist_ok=True)
        (folder / "table.yaml").write_text(text)
        (folder / "own.yaml").write_text(OWN)
        data = settings.settled(settings.read(folder / "own.yaml"), gpu=False, pixels=False)
        return settings.configuration(data, "jax", pixels=False)

    old, saved = configured_at("here", TABLE), tmp_path / "config.json"
    assert train.conflict(configured_at("there", TABLE), old, saved) is None
    changed = train.conflict(configured_at("here", TABLE.replace("0.1, 0.2", "0.1, 0.3")), old, saved)
    assert changed.numbers["what"] == "the arena's file has changed"
    with pytest.raises(
        ValueError, match=r"^`env\.arena` must be the arena of the training, got '.*table\.yaml', which has changed"
    ):
        configured.environment(old)
    older = {name: x for name, x in old.items() if name != settings.DIGEST}
    assert configured.environment(older).ranges.object_masses == mja.Uniform(0.1, 0.3)
    assert train.conflict(configured_at("here", TABLE), older, saved) is None
    assert "env.arena" in train.conflict(configured_at("there", TABLE), older, saved).numbers["what"]


@pytest.mark.parametrize("where", [["--engine", "warp"], []])
def test_a_training_of_another_machine_is_known(where, tmp_path, monkeypatch, capsys):
    """The folder of a training that began on a GPU, whose defaults are others, is of the same command where there is none."""
    data = settings.settled(settings.read(settings.find("push")), gpu=True, pixels=False)
    config = settings.configuration(data, "warp", pixels=False)
    assert config["ppo"]["num_envs"] == 8192
    settings_of = settings.settled(settings.read(settings.find("push")), gpu=False, pixels=False)
    assert settings_of["ppo"]["num_envs"] == 64
    (tmp_path / "config.json").write_text(json.dumps(config))
    (tmp_path / "result.json").write_text(json.dumps({"held_out": {"worlds": 4096, "success": 0.5}}))
    monkeypatch.setattr(train, "draw", lambda out, film, outside, say: None)
    assert train_main(*where, "--out", str(tmp_path)) == 0
    assert "success on 4096 held out arenas: 50.0%" in capsys.readouterr().out
    assert json.loads((tmp_path / "config.json").read_text()) == config
    assert train_main("--seed", "1", "--out", str(tmp_path)) == 2
    assert "is of another training (seed 0 instead of 1" in capsys.readouterr().err
