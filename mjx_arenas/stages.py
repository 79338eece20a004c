"""The stages of a training: by PPO, or of a policy that sees pictures by DAgger; each with a checkpoint at its end."""

import functools
import inspect
import json
import pathlib
import shutil
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from mjx_arenas import policies, settings
from mjx_arenas.keywords import nearest
from mjx_arenas.problem import Told, problem
from mjx_arenas.problems.messages import error
from mjx_arenas.trained import curve, read_log, write

Report = Callable[[int, Any], None]
_OF_WHERE = ("progress_fn", "seed", "save_checkpoint_path", "restore_checkpoint_path")
_OWN = {
    "ppo": ("environment", "episode_length", "wrap_env_fn", "run_evals", "log_training_metrics", *_OF_WHERE),
    "dagger": (
        *("teacher_inference_fn", "env", "num_eval_envs", "eval_length", "batch_size", "scramble_time", "reset"),
        *("dagger_steps", *_OF_WHERE),
    ),
}
"""Arguments of Brax's trainers that no configuration gives: each policy that is saved is judged, and reported once."""
_COUNTS = ("num_timesteps", "num_minibatches")
"""The numbers of a configuration from which DAgger's other arguments are made."""


def check(config: dict[str, Any]) -> None:
    """Refuses arguments that the trainers of a configuration do not take, a teacher's first.

    Raises:
        ValueError: there is one.
    """
    from brax.training.agents.bc import train as bc
    from brax.training.agents.ppo import train as ppo

    if "teacher" in config:
        check(config["teacher"])
    part, trainer, called = ("dagger", bc, "DAgger") if _sees(config) else ("ppo", ppo, "PPO")
    known = {*inspect.signature(trainer.train).parameters, *(_COUNTS if _sees(config) else ())}
    if unknown := [name for name in config[part] if name not in known]:
        close = nearest(unknown[0], sorted(known - {*_OWN[part]}))
        told = Told(", ".join(unknown))
        rule = "brax_meant" if close else "brax_arguments"
        raise error([problem(part, rule, None, told, called=called, close=close)])
    if own := [name for name in config[part] if name in _OWN[part]]:
        raise error([problem(part, "training_decides", None, Told(", ".join(own)))])


def train(config: dict[str, Any], out: pathlib.Path, progress: Callable[[int, dict], None]) -> None:
    """The stages that are not there yet; a policy that sees needs the teacher in `out / "teacher"`.

    Raises:
        ValueError: no world of the training's ranges is valid.
    """
    from mjx_arenas.envs.tasks import configured

    env: Any = configured.environment(config, overrides={"arenas": config["arenas"]})
    configured.check_worlds(env)
    folder, running = out / "checkpoints", out / "progress.jsonl"
    for stage in range(config["stages"]):
        here, before = folder / f"stage{stage}", folder / f"stage{stage - 1}"
        if here.exists():
            continue
        done = [line for line in read_log(running) if line["stage"] < stage]
        start = done[-1]["steps"] if done else 0  # Brax does a few more than it is asked for
        lines: list[dict[str, Any]] = []

        def report(
            step: int, metrics: Any, stage: int = stage, start: int = start, done: list = done, lines: list = lines
        ) -> None:
            numbers = {name: float(x) for name, x in metrics.items()}
            lines.append({"stage": stage, "steps": start + step, "time": time.time(), **numbers})
            write(running, "\n".join(json.dumps(line) for line in [*done, *lines]))
            curve(running, out / "curve.png")
            progress(start + step, lines[-1])

        unfinished = folder / f"unfinished{stage}"
        shutil.rmtree(unfinished, ignore_errors=True)
        learn = functools.partial(_dagger, policies.load_policy(out / "teacher")) if _sees(config) else ppo
        learn(
            env,
            config,
            report,
            seed=1000 * config["seed"] + stage,
            save_checkpoint_path=str(unfinished),
            restore_checkpoint_path=str(before / "params") if stage else None,
        )
        saved = sorted(path for path in unfinished.iterdir() if path.is_dir())
        judged = lines[-len(saved) :]
        # A stage begins by judging the policy of the stage before, which may stay the best.
        if stage and len(lines) > len(saved):
            judged, saved = lines, [shutil.copytree(before / "params", unfinished / "before"), *saved]
        best = best_evaluation(judged)
        judged[best]["kept"] = True
        write(running, "\n".join(json.dumps(line) for line in [*done, *lines]))
        saved[best].rename(unfinished / "params")
        for path in saved:
            shutil.rmtree(path, ignore_errors=True)
        unfinished.rename(here)  # a stage is there as a whole or not at all


def best_evaluation(lines: list[dict[str, Any]]) -> int:
    """Index of the evaluation whose policy a stage keeps: the last of those with the most successes, on arenas of the training.

    PPO's success is not steady at a constant learning rate. Without a measure of success it is the last evaluation.
    """
    shares = [line.get("eval/episode_success_at_end", 0.0) for line in lines]
    return max(range(len(lines)), key=lambda i: (shares[i], i))


def steps_of_stage(config: dict[str, Any]) -> int:
    """Steps of all worlds in one stage."""
    return -(-settings.learner(config)["num_timesteps"] // config["stages"])


def _sees(config: dict[str, Any]) -> bool:
    return config["sees"] == "pictures"


def ppo(env: Any, config: dict[str, Any], report: Report, **where: Any) -> None:
    """One stage of PPO; `where` are other arguments of Brax's."""
    from brax.training.agents.ppo import train as brax_ppo
    from mujoco_playground import wrapper

    from mjx_arenas import brax_bridge
    from mjx_arenas.envs import evaluate

    given = dict(config["ppo"])
    del given["network_factory"]
    given |= {"num_timesteps": steps_of_stage(config)}
    given.setdefault("batch_size", given["num_envs"] // given["num_minibatches"])
    given.setdefault("num_eval_envs", min(config["eval_worlds"], 1024))
    given.setdefault("deterministic_eval", True)  # as `judged` does
    with brax_bridge.device_put_replicated():
        brax_ppo.train(
            environment=env,
            episode_length=evaluate.episode_length(env),
            network_factory=policies.networks(config),
            wrap_env_fn=wrapper.wrap_for_brax_training,
            progress_fn=report,
            **given,
            **where,
        )


def _dagger(teacher: Callable, env: Any, config: dict[str, Any], report: Report, **where: Any) -> None:
    import optax
    from brax.training.agents.bc import train as bc
    from mujoco_playground import wrapper

    from mjx_arenas.envs import evaluate

    length = evaluate.episode_length(env)
    given = dict(config["dagger"])
    names = ("num_timesteps", "num_envs", "num_evals", "num_minibatches", "network_factory")
    _, worlds, evals, minibatches, _ = (given.pop(name) for name in names)
    each = worlds * given["demo_length"]
    rounds = (evals - 1) * -(-steps_of_stage(config) // (each * (evals - 1)))  # Brax takes as many between evaluations

    def averaged(step: Any, metrics: Any) -> None:
        means = {name: np.mean(x) for name, x in metrics.items() if name != "SPS"}
        if "walltime" in means:
            means["training/sps"] = each * int(step) / means["walltime"]
        report(each * int(step), means)

    # Adam takes a schedule, too, which the annotations of Brax do not say.
    rate: Any = optax.cosine_decay_schedule(given.pop("learning_rate"), rounds * given["epochs"] * minibatches)
    wrapped: Any = wrapper.wrap_for_brax_training(env, episode_length=length)
    bc.train(
        teacher_inference_fn=teacher,
        env=wrapped,
        num_envs=worlds,
        num_eval_envs=min(config["eval_worlds"], 1024),
        eval_length=length,
        learning_rate=rate,
        batch_size=each // minibatches,
        scramble_time=length,
        reset=False,  # each world begins a new episode by itself
        network_factory=policies.networks(config),
        dagger_steps=rounds,
        num_evals=evals,
        progress_fn=averaged,
        **given,
        **where,
    )
