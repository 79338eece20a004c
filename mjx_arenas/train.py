"""Trains a task with Brax, from a configuration (`settings`) into a folder: the work of `mjx-arenas train`.

By PPO; a policy that sees pictures learns by DAgger from a teacher, who is told everything and learns by PPO. Training is cut into stages.
Each starts from the policy, the value function and the observations' statistics of the stage before, with a fresh optimizer and fresh
worlds. After an interruption between two stages, the same configuration goes on as if there had been none. Within a stage it goes on from
the last policy that was evaluated, as a new stage does.
"""

import concurrent.futures
import importlib.util
import json
import multiprocessing
import os
import pathlib
import threading
from collections.abc import Callable
from typing import Any

from mjx_arenas import checkpoints, judged, policies, settings, stages
from mjx_arenas.files import output
from mjx_arenas.policies import load_policy as load_policy
from mjx_arenas.problem import Problem
from mjx_arenas.problems.messages import error
from mjx_arenas.stages import steps_of_stage
from mjx_arenas.trained import read, show, write

Say = Callable[[str], None]


def missing() -> list[str]:
    """What must be installed to train, and is not."""
    return [name for name in ("brax", "mujoco_playground", "matplotlib", "rich") if not importlib.util.find_spec(name)]


def before(out: pathlib.Path) -> dict[str, Any] | None:
    """What `config.json` in a folder says, if it is there; not that of a training that was refused, which left nothing else."""
    saved = out / "config.json"
    if not saved.exists():
        return None
    old = read(saved)
    started = any(path.is_file() and path.name != saved.name for path in out.rglob("*"))
    return old if started or "sees" not in old else None  # what no training has written is somebody else's


def run(config: dict[str, Any], out: pathlib.Path, say: Say = print) -> None:
    """Trains, or goes on where it stopped, and judges the policy.

    Args:
        config: as of `settings.configuration`.
        out: folder of all results, which is there.
        say: told what goes on.

    Raises:
        ValueError: another training is in the folder, or nothing can be trained so.
        MemoryError: there is too little.
    """
    from mjx_arenas.envs.tasks import configured
    from mjx_arenas.sim.warp_notes import no_room_answered

    config, old = json.loads(json.dumps(config)), before(out)
    if settings.is_own(config["task"]):
        config[settings.MADE] = configured.made(config)
    saved, finished = out / "config.json", out / "result.json"
    if old is not None and (why := conflict(config, old, saved)):
        raise error([why])
    more = old is not None and _has_more_stages(config, old)
    if more or not finished.exists():
        check(config)  # before anything of what is there goes
    for name in ("result.json", "strip.png", "film.mp4", "seen.mp4") if more else ():
        (out / name).unlink(missing_ok=True)
    write(saved, json.dumps(config, indent=1))
    if finished.exists():
        say(f"The training in {out} is finished; --stages {config['stages'] + 1} goes on with it.")
        return
    worlds = settings.learner(config)["num_envs"]
    say(f"{worlds:,} worlds, impl={config['impl']!r}, into {out}; the first minutes compile.")
    with no_room_answered():
        train(config, out, say)
        say(
            f"The policy is judged on {config['eval_worlds']:,} arenas that it has not seen; on a CPU this takes minutes."
        )
        write(finished, json.dumps(judged.evaluate(config, load_policy(out)), indent=1))


def again(out: pathlib.Path) -> str:
    """What the same command does after an interruption of the training in a folder."""
    for folder, whose in ((out, ""), (out / "teacher", " of the teacher")):
        if (steps := checkpoints.saved_steps(folder)) is not None:
            return f"the same command goes on from {steps:,} steps{whose}"
    return "the same command begins again, as no policy has been evaluated yet"


def check(config: dict[str, Any]) -> None:
    """Refuses a configuration that nothing can be trained with, or that cannot be judged once it is.

    Raises:
        ValueError: an argument that a trainer or the task does not take, or an arena that cannot be made.
    """
    from mjx_arenas.envs.tasks import configured

    stages.check(config)
    env: Any = configured.environment(config, overrides={"arenas": config["arenas"]})
    policies.check_observed(config, env)
    if config.get("wider_ranges"):
        configured.environment(config, "out_of_range")


def train(config: dict[str, Any], out: pathlib.Path, say: Say = print) -> None:
    """What there is to train yet, a teacher first."""
    if "teacher" in config:
        teacher = out / "teacher"
        teacher.mkdir(exist_ok=True)
        write(teacher / "config.json", json.dumps(config["teacher"], indent=1))
        say(f"The teacher learns, {config['teacher']['ppo']['num_envs']:,} worlds, into {teacher}.")
        apart(train, config["teacher"], teacher)
        say("The policy that sees learns from it.")
    with show(settings.learner(config)["num_timesteps"]) as progress:
        stages.train(config, out, progress, say)


def apart(function: Callable[..., None], *arguments: Any) -> None:
    """Calls it in a process of its own, which ends with this one: what its programs held on the GPU is free afterwards."""
    with concurrent.futures.ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), _end_with_parent) as pool:
        pool.submit(function, *arguments).result()


def _end_with_parent() -> None:
    parent: Any = multiprocessing.parent_process()

    def wait() -> None:
        parent.join()
        output.abandon()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


def results(out: pathlib.Path) -> list[str]:
    """What the policy in a folder is worth, in lines."""
    lines = []
    for where, numbers in read(out / "result.json").items():
        lines.append(f"success on {numbers['worlds']} {where.replace('_', ' ')} arenas: {numbers['success']:.1%}")
        if numbers.get("solver_limits"):
            lines.append(f"  in {numbers['solver_limits']:.1%} of them the solver reached the limit of its iterations")
    return lines


def draw(out: pathlib.Path, film: bool, outside: bool = True, say: Say = print) -> None:
    """Draws the policy in a folder on held-out arenas, and films it there, if that is not done yet.

    Args:
        out: the folder.
        film: from outside, and what a policy sees that sees pictures.
        outside: where OpenGL is there.
        say: takes a line before each picture.
    """
    config = read(out / "config.json")
    wanted = {
        "strip.png": (True, judged.strip),
        "film.mp4": (film and outside, judged.film),
        "seen.mp4": (film and settings.sees_pictures(config), judged.seen),
    }
    for name, (asked, picture) in wanted.items():
        if asked and not (out / name).exists():
            say(f"Drawing {name}.")
            picture(config, load_policy(out), out / name)


def longer(config: dict[str, Any], old: dict[str, Any]) -> dict[str, Any]:
    """The same, if it has more stages than an old one, with steps for stages of the length of the old one's."""
    if not _has_more_stages(config, old):
        return config
    part = settings.part(config)
    return config | {part: config[part] | {"num_timesteps": config["stages"] * steps_of_stage(old)}}


def _has_more_stages(config: dict[str, Any], old: dict[str, Any]) -> bool:
    """Whether an old configuration, which may be somebody else's, is of a training with fewer stages that sees the same."""
    return old.get("sees") == config["sees"] and old.get("stages", config["stages"]) < config["stages"]


def conflict(config: dict[str, Any], old: dict[str, Any], saved: pathlib.Path) -> Problem | None:
    """Why a training cannot go on from what another one left in a folder; for more stages of the same length it can."""
    # The file of an arena is known by what it says, wherever it is; older trainings know its path alone.
    left_out = "env.arena" if settings.DIGEST in config and settings.DIGEST in old else settings.DIGEST
    unknown = () if settings.MADE in config and settings.MADE in old else (f"{settings.MADE}.",)
    new, was = (
        {
            name: x
            for name, x in settings.flat(one).items()
            if x != {} and not name.endswith(left_out) and not name.startswith(unknown)
        }
        for one in (config, old)
    )
    differing = [name for name in {**new, **was} if new.get(name) != was.get(name)]
    steps = f"{settings.part(config)}.num_timesteps"
    if {*differing} <= {"stages", steps} and _has_more_stages(config, old):
        stages, each = config["stages"], steps_of_stage(old)
        told = {"file": saved, "each": each, "stages": stages, "steps": stages * each}
        return (
            None if steps_of_stage(config) == each else Problem("stages", "stages_of_other_length", None, stages, told)
        )
    what = ", ".join(_differs(name, was, new) for name in differing[:5])
    return Problem("out", "other_training", None, str(saved), {"file": saved, "what": what}) if differing else None


def _differs(name: str, was: dict[str, Any], new: dict[str, Any]) -> str:
    if name.endswith(settings.DIGEST):
        return "the arena's file has changed"
    told = name.removeprefix(f"{settings.MADE}.")
    whose = "" if told == name else "the task's "
    return f"{whose}{told} {was.get(name)} instead of {new.get(name)}"
