"""The stages of a training: by PPO, or of a policy that sees pictures by DAgger; each with a checkpoint at its end."""

import functools
import inspect
import pathlib
from collections.abc import Callable, Collection
from typing import Any

import numpy as np

from mjx_arenas import policies, settings
from mjx_arenas.checkpoints import Stage
from mjx_arenas.keywords import nearest
from mjx_arenas.problem import Told, problem
from mjx_arenas.problems.messages import error
from mjx_arenas.trained import curve

Report = Callable[[int, Any], None]
_OF_WHERE = ("progress_fn", "seed", "save_checkpoint_path", "restore_checkpoint_path")
_OWN = {
    "ppo": (
        *(
            "environment",
            "eval_env",
            "episode_length",
            "action_repeat",
            "wrap_env_fn",
            "run_evals",
            "log_training_metrics",
        ),
        "normalize_observations_mode",  # which checkpoints do not keep
        *_OF_WHERE,
    ),
    "dagger": (
        *("teacher_inference_fn", "env", "num_eval_envs", "eval_length", "batch_size", "scramble_time", "reset"),
        *("dagger_steps", "tanh_squash", *_OF_WHERE),
    ),
    "network_factory": ("observation_size", "action_size", "preprocess_observations_fn"),
}
"""Arguments of Brax's trainers and networks that no configuration gives: policies that are saved are judged as trained, and once."""
_COUNTS = ("num_timesteps", "num_minibatches")
"""The numbers of a configuration from which DAgger's other arguments are made."""


def check(config: dict[str, Any]) -> None:
    """Refuses arguments that the trainers and the networks of a configuration do not take, a teacher's first.

    Raises:
        ValueError: there is one.
    """
    from brax.training.agents.bc import train as bc
    from brax.training.agents.ppo import train as ppo

    if "teacher" in config:
        check(config["teacher"])
    part, sees = settings.part(config), settings.sees_pictures(config)
    trainer, called = (bc, "DAgger") if sees else (ppo, "PPO")
    _check_names(part, config[part], trainer.train, called, _OWN[part], _COUNTS if sees else ())
    make, factory = policies.maker(config), "network_factory"
    _check_names(f"{part}.{factory}", config[part][factory], make, make.__name__, _OWN[factory])


def _check_names(
    path: str,
    given: Collection[str],
    function: Callable,
    called: str,
    own: Collection[str],
    besides: Collection[str] = (),
) -> None:
    """Refuses names that are neither of a function of Brax nor `besides`, and its `own` that no configuration gives."""
    known = {*inspect.signature(function).parameters, *besides}
    if unknown := [name for name in given if name not in known]:
        close = nearest(unknown[0], sorted(known - {*own}))
        told = Told(", ".join(unknown))
        rule = "brax_meant" if close else "brax_arguments"
        raise error([problem(path, rule, None, told, called=called, close=close)])
    if decided := [name for name in given if name in own]:
        raise error([problem(path, "training_decides", None, Told(", ".join(decided)))])


def train(
    config: dict[str, Any],
    out: pathlib.Path,
    progress: Callable[[int, dict], None],
    say: Callable[[str], None] = print,
) -> None:
    """The stages that are not there yet; a policy that sees needs the teacher in `out / "teacher"`.

    Raises:
        ValueError: no world of the training's ranges is valid.
    """
    from mjx_arenas.envs.tasks import configured

    env: Any = configured.environment(config, overrides={"arenas": config["arenas"]})
    configured.check_worlds(env)
    learn = functools.partial(_dagger, policies.load_policy(out / "teacher")) if settings.sees_pictures(config) else ppo
    first = True
    for number in range(config["stages"]):
        stage = Stage(out, number)
        if stage.finished.exists():
            stage.clear()
            continue
        broken, begun = stage.begin(), stage.steps
        start = "" if stage.rounds else ", the start of the stage"
        for one in broken:
            say(f"{one}; the training goes on from {begun:,} steps{start}.")
        if first and begun and not broken:
            say(f"The training goes on from {begun:,} steps.")
        first = False

        def report(step: int, metrics: Any, stage: Stage = stage, begun: int = begun) -> None:
            if line := stage.add(begun + step, metrics):
                curve(stage.log, out / "curve.png")
                progress(line["steps"], line)

        left = stage.left(steps_of_stage(config), settings.learner(config)["num_evals"])
        if left[0]:
            learn(
                env,
                config,
                report,
                left,
                seed=seed_of(config["seed"], number, stage.rounds),
                save_checkpoint_path=str(stage.new),
                restore_checkpoint_path=stage.newest and str(stage.newest),
            )
        for one in stage.finish():
            say(f"{one}; the stage keeps another one.")


def seed_of(seed: int, stage: int, rounds: int) -> int:
    """The seed of the worlds of a stage that goes on after some rounds, which are others than at its start."""
    return int(np.random.SeedSequence((seed, stage, rounds)).generate_state(1)[0])


def steps_of_stage(config: dict[str, Any]) -> int:
    """Steps of all worlds in one stage."""
    return -(-settings.learner(config)["num_timesteps"] // config["stages"])


def ppo(env: Any, config: dict[str, Any], report: Report, left: tuple[int, int] | None = None, **where: Any) -> None:
    """One stage of PPO, or the steps and evaluations that are left of it; `where` are other arguments of Brax's."""
    from brax.training.agents.ppo import train as brax_ppo
    from mujoco_playground import wrapper

    from mjx_arenas import brax_bridge
    from mjx_arenas.envs import evaluate
    from mjx_arenas.envs.tasks import configured

    given = dict(config["ppo"])
    if callable(getattr(env, "ranges", None)):  # a world begins at the first level, also when a policy is judged
        whole = {"arenas": config["arenas"], **configured.LAST_LEVEL}
        given["eval_env"] = configured.environment(config, overrides=whole)
    del given["network_factory"]
    given["num_timesteps"], given["num_evals"] = left or (steps_of_stage(config), given["num_evals"])
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


def _dagger(
    teacher: Callable, env: Any, config: dict[str, Any], report: Report, left: tuple[int, int], **where: Any
) -> None:
    import optax
    from brax.training.agents.bc import train as bc
    from mujoco_playground import wrapper

    from mjx_arenas.envs import evaluate

    length = evaluate.episode_length(env)
    given = dict(config["dagger"])
    names = ("num_timesteps", "num_envs", "num_evals", "num_minibatches", "network_factory")
    _, worlds, evals, minibatches, _ = (given.pop(name) for name in names)
    each = worlds * given["demo_length"]
    of_stage, dagger_steps = (  # Brax takes as many between evaluations
        (n - 1) * -(-steps // (each * (n - 1))) for steps, n in ((steps_of_stage(config), evals), left)
    )

    def averaged(step: Any, metrics: Any) -> None:
        means = {name: np.mean(x) for name, x in metrics.items() if name != "SPS"}
        if "walltime" in means:
            means["training/sps"] = each * int(step) / means["walltime"]
        report(each * int(step), means)

    updates = given["epochs"] * minibatches
    of_update = optax.cosine_decay_schedule(given.pop("learning_rate"), of_stage * updates)
    # Adam takes a schedule, too, which the annotations of Brax do not say.
    rate: Any = lambda update: of_update(update + (of_stage - dagger_steps) * updates)  # noqa: E731
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
        dagger_steps=dagger_steps,
        num_evals=left[1],
        progress_fn=averaged,
        **given,
        **where,
    )
