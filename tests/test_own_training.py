"""Tasks and arms of a user's own, by `module:function`: trained, resumed, drawn and judged as those of the library are."""

import importlib
import json
import os
import sys
import textwrap

import jax
import pytest

pytest.importorskip("brax")

from brax.training.agents.ppo import train as ppo
from command import train_main
from PIL import Image
from test_train import ARGUMENTS

import mjx_arenas as mja
from mjx_arenas import judged, policies, settings, stages, train
from mjx_arenas.envs.tasks import configured
from mjx_arenas.problems import messages
from mjx_arenas.viz import render

MINE = """
import mjx_arenas as mja
from mjx_arenas import envs
from sliding import Slide

RANGES = mja.ArenaRanges(table_rots=mja.Uniform(-0.5, 0.5), table_full_sizes=mja.Uniform([0.5, 0.5, 0.04], [0.8, 0.8, 0.1]))

def slide(config_overrides, ranges=RANGES, speed=1):
    return Slide(ranges=ranges, objects=(), **{"sim_dt": 0.05} | config_overrides)

def nominal(config_overrides, ranges=RANGES):
    return slide({"arenas": "nominal"} | config_overrides, ranges)

class Plain(Slide):
    def __init__(self, config_overrides):
        super().__init__(ranges=RANGES, objects=(), **config_overrides)

    def observe(self, data, episode):
        return super().observe(data, episode)["state"]

def plain(config_overrides, ranges=RANGES):
    return Plain(config_overrides)

def curriculum(config_overrides, ranges=RANGES, vision=None):
    return Slide(ranges=lambda level: ranges, objects=(), **config_overrides)

def climbing(config_overrides):
    given = {"level": 0.1, "level_step": 0.2} | config_overrides
    return Slide(ranges=lambda level: mja.ArenaRanges(table_rots=mja.Uniform(0.5 * level, level)), objects=(), **given)

def lift(config_overrides, **given):
    return envs.Lift(config_overrides=config_overrides, **given)

def arm():
    return envs.arms.small()

def needs(config_overrides, size):
    return envs.Reach(config_overrides=config_overrides)

def broken(config_overrides=None):
    return {}["left_finger"]

def unread(config_overrides=None):
    return int("two")

def number(config_overrides=None):
    return 3

three = 3
"""


@pytest.fixture
def mine(tmp_path, monkeypatch):
    """A folder with a module `mine`, in which the command is called."""
    (tmp_path / "mine.py").write_text(textwrap.dedent(MINE))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.setattr(jax, "local_device_count", lambda: 1)
    monkeypatch.setattr(jax, "local_devices", lambda: jax.devices()[:1])
    yield tmp_path
    sys.modules.pop("mine", None)


@pytest.mark.xslow
@pytest.mark.slow
def test_own_task(mine, monkeypatch, capsys):
    """It is trained, goes on, is drawn from its folder, and judged on held-out arenas, in C MuJoCo as on MJX."""
    out = mine / "out"
    with monkeypatch.context() as without_pictures:
        without_pictures.setattr(render, "choose_gl", lambda: None)
        assert train_main(*ARGUMENTS, "--stages", "1", "--out", out, task="mine:slide") == 0
        first = json.loads((out / "config.json").read_text())
        assert (first["task"], first["ppo"]["num_envs"]) == ("mine:slide", 4)
        (mine / "mine.yaml").write_text("task: mine:slide\nwider_ranges: {table_rots: {Uniform: [1, 2]}}")
        assert train_main(*ARGUMENTS, "--stages", "1", "--out", out, task="mine.yaml") == 2
        assert "wider_ranges None instead of" in capsys.readouterr().err
        assert train_main(*ARGUMENTS, "--num-timesteps", "200", "--stages", "2", "--out", out, task="mine:slide") == 0
    assert "success on 2 held out arenas" in capsys.readouterr().out
    assert {path.name for path in (out / "checkpoints").iterdir()} == {"stage0", "stage1"}
    result = json.loads((out / "result.json").read_text())
    assert {*result} == {"held_out"}
    policy, env = policies.load_policy(out), policies.load_env(out)
    assert mja.evaluate(policy, env, 2) == {name: x for name, x in result["held_out"].items() if name != "worlds"}
    assert mja.evaluate(policy, env, 2, engine="c") == mja.evaluate(policy, env, 2)
    if os.environ.get("MUJOCO_GL") != "disable":
        judged.strip(first, policy, out / "strip.png", n_worlds=1)
        with Image.open(out / "strip.png") as strip:
            assert 640 <= strip.width < 960  # the first and the last of three steps


def test_environment_of_a_training(mine, monkeypatch):
    """Its ranges are the task's with those of the configuration over them; beyond them it is judged where `wider_ranges` say so."""
    sys.path.insert(0, str(mine))
    config = {"task": "mine:slide", "impl": "jax", "sees": "numbers", "env": {"config": {"level": 0.5}}}
    turned, wider = {"table_rots": {"Uniform": [1, 2]}}, {"table_rots": {"Uniform": [2, 3]}}
    env = configured.environment(config | {"ranges": turned, "wider_ranges": wider}, overrides={"arenas": "fixed"})
    assert (env.config.level, env.config.arenas, env.config.impl) == (0.5, "fixed", "jax")
    assert env.ranges.table_rots == mja.Uniform(1, 2)
    assert env.ranges.table_full_sizes == mja.Uniform([0.5, 0.5, 0.04], [0.8, 0.8, 0.1])
    assert configured.environment(config, "out_of_range") is None
    (mine / "config.json").write_text(json.dumps(config | {"wider_ranges": wider}))
    assert policies.load_env(mine, wider=True).ranges.table_rots == mja.Uniform(2, 3)
    assert policies.load_env(mine, {"level": 0.25}).config.level == 0.25
    with pytest.raises(
        TypeError, match=r"`config_overrides` must be a dictionary of dotted names and values, got list\."
    ):
        policies.load_env(mine, ["level"])
    (mine / "config.json").write_text(json.dumps(config))
    with pytest.raises(ValueError, match=r"`wider` must be False, as the training in .* has no `wider_ranges`"):
        policies.load_env(mine, wider=True)
    with pytest.raises(ValueError, match=r"`folder` must be the folder of a training, got '.*nowhere'\."):
        policies.load_env(mine / "nowhere")
    with pytest.raises(TypeError, match=r"^`folder` must be a path, got NoneType\.$"):
        policies.load_env(None)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("Uniform(-0.5, 0.5)", "Uniform(-0.25, 0.25)", "the task's range.table_rots Uniform(low=-0.5, high=0.5"),
        (
            '{"sim_dt": 0.05}',
            '{"sim_dt": 0.05, "episode_length": 7}',
            "the task's config.episode_length 3 instead of 7",
        ),
        ("return 3", "return 3 # as before", None),
    ],
    ids=["ranges", "configuration", "nothing"],
)
def test_a_task_that_has_changed(old, new, told, mine):
    """A training does not go on with a task whose ranges, configuration or sizes the user has changed in the meantime."""
    sys.path.insert(0, str(mine))
    config = settings.configuration({**settings.settled(settings.read("mine:slide"), False, False)}, "jax", False)
    before = config | {"made": configured.made(config)}
    (mine / "mine.py").write_text(textwrap.dedent(MINE).replace(old, new))
    sys.modules.pop("mine")
    importlib.invalidate_caches()
    after = config | {"made": configured.made(config)}
    assert train.conflict(before, before, mine) is None
    assert train.conflict(after, config, mine) is None  # of an older training nothing is known
    found = train.conflict(after, before, mine)
    assert (told in str(messages.error([found]))) if told else found is None


@pytest.mark.slow
@pytest.mark.parametrize("own", [{}, {"config": {"arenas": "fixed"}}], ids=["of the task", "of an older training"])
def test_judged_on_new_arenas(own, mine):
    """In every episode, also where a task has another default, and where an older training's configuration says so."""
    sys.path.insert(0, str(mine))
    wider = {"table_rots": {"Uniform": [2, 3]}}
    config = {"task": "mine:nominal", "impl": "jax", "sees": "numbers", "env": own, "wider_ranges": wider}
    (mine / "config.json").write_text(json.dumps(config))
    for env in (policies.load_env(mine), policies.load_env(mine, wider=True)):
        assert env.config.arenas == "every_episode"
    assert policies.load_env(mine, {"arenas": "fixed"}).config.arenas == "fixed"
    assert configured.environment(config, overrides={"arenas": "nominal"}).config.arenas == "nominal"


def test_a_curriculum_is_judged_as_a_whole(mine, monkeypatch):
    """Policies are judged at its last level, in training and afterwards, although worlds begin at the first one."""
    sys.path.insert(0, str(mine))
    given = {}
    monkeypatch.setattr(ppo, "train", lambda **arguments: given.update(arguments))
    for task, level in (("mine:climbing", 0.1), ("mine:slide", 0.0)):
        config = settings.configuration(settings.settled(settings.read(task), False, False), "jax", False)
        env, held_out = configured.environment(config), configured.environment(config, "held_out")
        assert (env.config.level, held_out.config.level, held_out.config.level_step) == (level, 1.0, 0.0)
        given.clear()
        stages.ppo(env, config, lambda *_: None)
        assert given["environment"] is env
        judges = given.get("eval_env", held_out)
        assert (judges.config.level, judges.config.level_step) == (1.0, 0.0)
        assert ("eval_env" in given) == (task == "mine:climbing")
    asked = configured.environment(
        settings.settled(settings.read("mine:climbing"), False, False) | {"impl": "jax"}, "held_out", {"level": 0.5}
    )
    assert asked.config.level == 0.5


@pytest.mark.slow
def test_own_arm(mine):
    """Of a library's task and of one's own; an arena file goes to both."""
    sys.path.insert(0, str(mine))
    (mine / "table.yaml").write_text(
        "arena: {type: TableArena, objects: [cube], options: {cone: 1, impratio: 10}}\nranges: {table_rots: {Uniform: [-1, 1]}}"
    )
    given = {"arm": "mine:arm", "arena": str(mine / "table.yaml"), "on": "table", "pos": [-0.3, 0, 0]}
    for task in ("lift", "mine:lift"):
        env = configured.environment({"task": task, "impl": "jax", "sees": "numbers", "env": given, "ranges": None})
        assert env.arm.tool == "tool"
        assert env.arena.objects[0].name == "cube"
        assert env.ranges.table_rots == mja.Uniform(-1, 1)
        config = {"task": task, "impl": "jax", "sees": "numbers", "env": given}
        assert configured.environment(config, "out_of_range") is None
        wider = {"object_masses": {"Uniform": [1, 2]}}
        env = configured.environment(config | {"wider_ranges": wider}, "out_of_range")
        assert (env.ranges.table_rots, env.ranges.object_masses) == (mja.Uniform(-1, 1), mja.Uniform(1, 2))


WRONG = {
    "no module": ("nowhere:task", [], "`task` must be importable, got 'nowhere:task': No module named 'nowhere'."),
    "no such name": (
        "mine:fly",
        [],
        "`task` must be importable, got 'mine:fly': module 'mine' has no attribute 'fly'.",
    ),
    "a near name": (
        "mine:slid",
        [],
        "`task` must be importable, got 'mine:slid': module 'mine' has no attribute 'slid': did you mean 'slide'?",
    ),
    "no name": ("mine:a b", [], "`task` must be importable, got 'mine:a b': invalid format: 'mine:a b'."),
    "no function": ("mine:three", [], "`task` must be a function or a class, got 'mine:three', an int."),
    "no environment": ("mine:number", [], "`task` must make an ArenaEnv, got 'mine:number', which makes an int."),
    "no config": ("mine:arm", [], "`task` must take `config_overrides`, got 'mine:arm', which takes no arguments."),
    "not its argument": (
        "mine:slide",
        ["--set", "env.speeds=1"],
        "`env` of the task mine:slide may have config, speed, got speeds: did you mean `speed`?",
    ),
    "no arm of its": (
        "mine:slide",
        ["--arm", "small"],
        "`env` of the task mine:slide may have config, speed, got arm.",
    ),
    "no ranges": (
        "mine:Plain",
        ["--set", "ranges.table_rots={Uniform: [0, 1]}"],
        "`task` must take `ranges`, got 'mine:Plain', which takes config_overrides.",
    ),
    "levels": (
        "mine:curriculum",
        ["--set", "ranges.table_rots={Uniform: [0, 1]}"],
        "`task` must have ranges that do not depend on a level, for other ones or pictures, got 'mine:curriculum'.",
    ),
    "no pictures": (
        "mine:slide",
        ["--pixels"],
        "`task` must take `vision`, got 'mine:slide', which takes config_overrides, ",
    ),
    "one array": ("mine:Plain", [], "`task` must give observations 'state' and 'privileged_state', got one array."),
    "one array and ranges": (
        "mine:plain",
        ["--set", "ranges.table_rots={Uniform: [0, 1]}"],
        "`task` must give observations 'state' and 'privileged_state', got one array.",
    ),
    "no arm": ("lift", ["--arm", "smal"], "`env.arm`: no arm is called 'smal': did you mean `small`?"),
    "no arm there": ("lift", ["--arm", "mine:limb"], "`env.arm` must be importable, got 'mine:limb': module 'mine'"),
    "arguments of its own": (
        "lift",
        ["--arm", "mine:needs"],
        "`env.arm` must be a function that needs no arguments, got",
    ),
    "more arguments": ("mine:needs", [], "`task` must be something to call with config_overrides, got 'mine:needs'."),
    "a mistake in its code": (
        "lift",
        ["--arm", "mine:broken"],
        "`env.arm` names 'mine:broken', which raised KeyError: 'left_",
    ),
    "a number in its code": (
        "lift",
        ["--arm", "mine:unread"],
        "`env.arm` names 'mine:unread', which raised ValueError: invalid",
    ),
    "a mistake in a task's": ("mine:broken", [], "`task` names 'mine:broken', which raised KeyError: 'left_finger' ("),
    "config by its name in Python": (
        "reach",
        ["--set", "env.config_overrides.action_noise=0.1"],
        "`env.config_overrides` must be left out, as the configuration of a training has it as `env.config`, got",
    ),
    "ranges of its environment": (
        "mine:slide",
        ["--set", "env.ranges.table_rots=3"],
        "`env.ranges` must be left out, as the configuration of a training has it as `ranges` beside `env`, got",
    ),
    "another thing": (
        "lift",
        ["--arm", "mine:number"],
        "`env.arm` must make an Arm, got 'mine:number', which makes an int.",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong(case, mine, monkeypatch, capsys):
    """One sentence, before anything is trained."""
    task, arguments, says = WRONG[case]
    monkeypatch.setattr(render, "choose_gl", lambda: None)
    assert train_main(*ARGUMENTS, *arguments, "--out", mine / "out", task=task) == 2
    assert f"error: {says}" in capsys.readouterr().err
    assert not [*(mine / "out").glob("**/checkpoints")]
