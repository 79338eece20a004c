"""The command that trains policies."""

import os
import pathlib
import sys
from collections.abc import Mapping, Sequence
from typing import Any

import click

from mjx_arenas import gpu, settings
from mjx_arenas.cli import options, scenes, stop
from mjx_arenas.cli.terminal import answered
from mjx_arenas.files import paths


class Setting(click.ParamType):
    """A value of the configuration by its dotted name: "ppo.learning_rate=3e-4"."""

    name = "NAME=VALUE"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[str, str]:
        name, sign, given = value.partition("=")
        if not all(name.split(".")) or not sign:
            self.fail(f"{value!r} is not a name and a value, such as ppo.learning_rate=3e-4.", param, ctx)
        return name, given


_OF_TASK = "[default: the task's]"
_SHORT = {
    "arm": (
        "env.arm",
        {"metavar": "NAME"},
        "Arm of all tasks but push: small, yam (needs the package mjlab), panda (needs gym_hil) or module:function.  [default: small]",
    ),
    "arena": (
        "env.arena",
        {"type": options.File(lambda name: str(paths.find(name).resolve())), "metavar": "FILE"},
        "File with an arena and its ranges (mjx_arenas.load), or the name of an example, instead of the task's own. Push takes none.",
    ),
    "arenas": (
        "arenas",
        {"type": click.Choice(["every_episode", "fixed", "nominal"])},
        "Arenas that are new in every episode, drawn once for each world, or the nominal one for all. A teacher's are always new.  "
        "[default: every_episode]",
    ),
    "seed": ("seed", {"type": options.Whole(0, options.MOST)}, "Seed of arenas, networks and actions.  [default: 0]"),
    "impl": ("impl", options.MJX_ENGINES, options.MJX_ENGINE_HELP),
    "stages": (
        "stages",
        {"type": options.Whole(1, 10_000)},
        f"Number of stages, each of which ends with a checkpoint.  {_OF_TASK}",
    ),
    "eval-worlds": (
        "eval_worlds",
        {"type": options.Whole(1, 10**7)},
        f"Number of held-out arenas that judge the policy.  {_OF_TASK}",
    ),
    "num-envs": ("num_envs", {"type": options.Whole(1, 10**7)}, f"Number of worlds that train at once.  {_OF_TASK}"),
    "num-timesteps": (
        "num_timesteps",
        {"type": options.Whole(1, 10**13)},
        f"Number of steps of all worlds and stages together.  {_OF_TASK}",
    ),
    "num-evals": (
        "num_evals",
        {"type": options.Whole(1, 10**6)},
        f"Number of evaluations in a stage, with those at its start and end; 1: at its end alone, not with --pixels.  {_OF_TASK}",
    ),
    "teacher-timesteps": (
        "ppo.num_timesteps",
        {"type": options.Whole(1, 10**13)},
        f"With --pixels: number of the teacher's steps.  {_OF_TASK}",
    ),
}
_OF_LEARNER = ("num-envs", "num-timesteps", "num-evals")


def _with_short(command: Any) -> Any:
    for name, (_, kind, text) in reversed(_SHORT.items()):
        names = options.MJX_ENGINE if name == "impl" else (f"--{name}",)
        command = click.option(*names, help=text, **kind)(command)
    return command


@click.command(cls=options.Command, short_help="Train a policy on new arenas in every episode, and judge it.")
@click.argument("task", type=options.File(settings.find))
@_with_short
@click.option(
    "--set", "more", type=Setting(), multiple=True, help="Set any value of the configuration; may be repeated."
)
@click.option(
    "--pixels", is_flag=True, help="Train a policy that sees pictures, and of numbers only those of the robot."
)
@click.option(
    "--film",
    is_flag=True,
    help="Also write film.mp4, of nine held-out arenas, and with --pixels seen.mp4, of what the policy sees there.",
)
@click.option("--show", is_flag=True, help="Only print the configuration as YAML; one that cannot be built is refused.")
@options.folder_out("Folder of all results.  [default: out/train]", parents=True, default="out/train")
def train(
    task: pathlib.Path | str,
    more: tuple[tuple[str, str], ...],
    pixels: bool,
    film: bool,
    show: bool,
    out: pathlib.Path,
    **short: Any,
) -> None:
    """Train a policy with Brax, on new arenas in every episode, and judge it on arenas that it has not seen.

    TASK is push, reach, lift, pick_and_place or open_drawer, module:function, which makes an environment of your own, or a .yaml or .json
    file. A file says what differs from the configuration of its task: what the task is given (`env`: arm, arena, config, ...), ranges,
    and numbers of PPO, under the names that MuJoCo Playground gives them. The command line overrides it. --show prints all values.

    \b
    The folder then holds
      config.json                   the configuration
      progress.jsonl, curve.png     rewards and successes, while it trains
      checkpoints                   the policy; mjx_arenas.policies.load_policy loads it from the folder
      result.json                   successes on arenas that it has not seen
      strip.png                     the policy on four of them

    After an interruption the same command goes on.

    \b
    Examples:
      mjx-arenas train push                                  the defaults, into out/train
      mjx-arenas train lift -o out/lift --film               an arm that lifts a box
      mjx-arenas train lift --arm yam --set ppo.learning_rate=3e-4
      mjx-arenas train my_task:Hover                         a task of one's own, in my_task.py
      mjx-arenas train mine.yaml                             a file of one's own
      mjx-arenas train mine.yaml --arena kitchen.yaml --set env.on=table
      mjx-arenas train reach --num-envs 256 --set env.config.action_delay=[0,2]
      mjx-arenas train lift --pixels                         from pictures
      mjx-arenas train push --stages 4                       goes on with a training of three stages, for a fourth
      mjx-arenas train lift --show                           what would be trained
    """
    from mjx_arenas import train as training

    if missing := training.missing():
        raise click.ClickException(
            f"Training needs {', '.join(missing)}: pip install 'mjx_arenas[train]', or make train."
        )
    if short["teacher_timesteps"] is not None and not pixels:
        raise click.UsageError("--teacher-timesteps needs --pixels: only then is there a teacher.")
    scenes.import_mujoco()
    from mjx_arenas.viz import render

    draws = bool(render.choose_gl())  # before anything is drawn, also by Warp
    with answered(ValueError, OSError, ImportError):
        config = _configuration(task, said := _said(short, more, pixels), pixels, out)
        if show:
            training.check(config)
            _show(config)
            return
        _run(config, out, by_default=not _say_steps(said, pixels) and _steps_of_library(config))
        click.echo("\n".join(training.results(out)))
    _draw(out, film, pixels, draws)


def _run(config: dict[str, Any], out: pathlib.Path, by_default: bool) -> None:
    """Trains for as many steps as the configuration has, by default or not."""
    from mjx_arenas import train as training

    out.mkdir(parents=True, exist_ok=True)
    if by_default and not _on_gpu():
        click.echo("Without a GPU the training is short, to try it out: the policy hardly learns (--num-timesteps).")
    with stop.saying(lambda: training.again(out)):
        training.run(config, out.resolve(), click.echo)


def _draw(out: pathlib.Path, film: bool, pixels: bool, outside: bool) -> None:
    """Draws the policy; says so where it cannot be drawn from outside."""
    from mjx_arenas import train as training
    from mjx_arenas.viz import render

    if outside or pixels:
        training.draw(out.resolve(), film, outside, click.echo)
    if not outside:
        click.echo(f"No pictures from outside: {render.NO_GL}.")


def _said(short: Mapping[str, Any], more: Sequence[tuple[str, str]], pixels: bool) -> list[tuple[str, dict[str, Any]]]:
    """What the command line says of the configuration, each with its option."""
    from mjx_arenas.files import text

    said = []
    for name, (where, _, _) in _SHORT.items():
        value = short[name.replace("-", "_")]
        if value is not None:
            where = f"{_part(pixels)}.{where}" if name in _OF_LEARNER else where
            said.append((f"--{name}", settings.given(where, value)))
    for name, value in more:
        said.append(("--set", settings.given(name, text.parse(value, pathlib.Path("--set")).data, "--set")))
    return said


def _part(pixels: bool) -> str:
    return "dagger" if pixels else "ppo"


def _say_steps(said: Sequence[tuple[str, Mapping[str, Any]]], pixels: bool) -> bool:
    """Whether the command line says how many steps there are."""
    return any(f"{_part(pixels)}.num_timesteps" in settings.flat(one) for _, one in said)


def _steps_of_library(config: Mapping[str, Any]) -> bool:
    """Whether there are as many steps as the library has for its task without a GPU."""
    own = settings.read(settings.find(config["task"]))
    found = settings.settled(own, gpu=False, pixels=settings.sees_pictures(config))
    return settings.learner(config)["num_timesteps"] == found[settings.part(config)]["num_timesteps"]


def _show(config: Mapping[str, Any]) -> None:
    """Prints a configuration as YAML, without what is not set."""
    from mjx_arenas.files import text

    given = {name: value for name, value in config.items() if value is not None}
    click.echo(text.dump(given, pathlib.Path("config.yaml")).rstrip())


def _configuration(
    task: pathlib.Path | str, said: Sequence[tuple[str, Mapping[str, Any]]], pixels: bool, out: pathlib.Path
) -> dict[str, Any]:
    """What files, the command line and the training that is there say."""
    if os.getcwd() not in sys.path:
        sys.path.insert(0, os.getcwd())  # where `module:function` is, as for `python -m`
    data = settings.read(task)
    impls = [data.get("impl"), *(one["impl"] for _, one in said if "impl" in one)]
    gpu.leave_room(impls[-1])  # before JAX starts
    from mjx_arenas import train as training

    on_gpu, old = _on_gpu(), training.before(out)

    def configured(on_gpu: bool) -> dict[str, Any]:
        settled = settings.settled(data, on_gpu, pixels)
        for option, one in said:
            settled = settings.merged(settled, one, option)
        config = settings.configuration(settled, "warp" if on_gpu else "jax", pixels)
        return config if old is None or _say_steps(said, pixels) else training.longer(config, old)

    config = configured(on_gpu)
    if old is not None and training.conflict(config, old, out):
        other = configured(not on_gpu)  # the defaults of a machine of the other kind
        config = config if training.conflict(other, old, out) else other
    import jax

    from mjx_arenas.problems.messages import error

    if wrong := settings.problem(config, jax.local_device_count()):
        raise error([wrong])
    return config


def _on_gpu() -> bool:
    import jax

    return jax.default_backend() == "gpu"
