"""Trains the push task with Brax: `make train`, or `python -m mjx_arenas.train`.

By PPO; with --pixels a teacher, who is told everything, learns by PPO, and a policy that sees pictures learns from it by DAgger.
Training is cut into stages. Each starts from the policy, the value function and the observations' statistics of the stage
before, with a fresh optimizer and fresh worlds, and ends with a checkpoint: after an interruption, the same command goes on
as if there had been none.
"""

import argparse
import concurrent.futures
import importlib.util
import json
import multiprocessing
import pathlib
import sys
from collections.abc import Callable
from typing import Any

from mjx_arenas import gpu as gpu_
from mjx_arenas import judged, policies, stages
from mjx_arenas.files import output
from mjx_arenas.policies import load_policy as load_policy
from mjx_arenas.stages import steps_of_stage
from mjx_arenas.trained import show, write

DEFAULTS = {
    # where: worlds, steps of all worlds, worlds to evaluate on; steps of the teacher
    "gpu": {"num_envs": 8192, "num_timesteps": 60_000_000, "eval_worlds": 4096},
    "cpu": {"num_envs": 64, "num_timesteps": 400_000, "eval_worlds": 64},
    "gpu, pixels": {
        "num_envs": 4096,
        "num_timesteps": 40_000_000,
        "eval_worlds": 4096,
        "teacher_timesteps": 30_000_000,
    },
    "cpu, pixels": {"num_envs": 64, "num_timesteps": 40_000, "eval_worlds": 16, "teacher_timesteps": 400_000},
}
PPO = {
    "unroll_length": 20,
    "num_updates_per_batch": 4,
    "learning_rate": 1e-3,
    "entropy_cost": 1e-2,
    "discounting": 0.97,
    "gae_lambda": 0.95,
    "clipping_epsilon": 0.3,
    "max_grad_norm": 1.0,
    "normalize_observations": True,
}
DAGGER = {
    "demo_length": 10,  # steps of each world between two rounds of fitting
    "minibatches": 40,
    "epochs": 2,
    "learning_rate": 1e-3,
    "normalize_observations": False,
}
MINIBATCHES = 16
EXAMPLES = """examples:
  python -m mjx_arenas.train                                   the defaults, into out/train
  python -m mjx_arenas.train --num-envs 32 --num-timesteps 50000 --out out/small
  python -m mjx_arenas.train --stages 4                        goes on with a training of three stages, for a stage of the same length

The folder then holds config.json, progress.jsonl and curve.png (while it trains), checkpoints/, result.json and strip.png, a film strip;
docs/training.md says what is in them, and how to load the policy.
"""


def by_device(name: str) -> str:
    """What `--help` says of a default."""
    *plain, gpu, cpu = (f"{numbers[name]:,}" if name in numbers else "" for numbers in DEFAULTS.values())
    if not any(plain):
        return f"default: {gpu} on a GPU, else {cpu}"
    with_pixels = "" if plain == [gpu, cpu] else f"; with --pixels {gpu} and {cpu}"
    return f"default: {plain[0]} on a GPU, else {plain[1]}{with_pixels}"


def arguments(argv: list[str] | None = None) -> argparse.Namespace:
    """What the command line says."""
    parser = argparse.ArgumentParser(
        prog="python -m mjx_arenas.train",
        description=__doc__,
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )

    parser.add_argument(
        "--arenas",
        choices=("every_episode", "fixed", "nominal"),
        default="every_episode",
        help="a new arena for each world in every episode (default), one that is drawn once and kept, or the same one for all; a teacher's "
        "are always new",
    )
    parser.add_argument(
        "--pixels",
        action="store_true",
        help="the policy sees pictures, of new looks, and the ball's place and speed; by default numbers",
    )
    parser.add_argument(
        "--teacher-timesteps",
        type=int,
        help=f"with --pixels: steps of all worlds from which the teacher learns; {by_device('teacher_timesteps')}",
    )
    parser.add_argument("--seed", type=int, default=0, help="of arenas, networks and actions (default 0)")
    parser.add_argument("--impl", choices=("jax", "warp"), help="of MJX; default: warp on an NVIDIA GPU, else jax")
    parser.add_argument(
        "--num-envs", type=int, help=f"worlds that train at once, a multiple of {MINIBATCHES}; {by_device('num_envs')}"
    )
    parser.add_argument(
        "--num-timesteps", type=int, help=f"steps of all worlds and stages together; {by_device('num_timesteps')}"
    )
    parser.add_argument("--stages", type=int, default=3, help="parts that end with a checkpoint each (default 3)")
    parser.add_argument(
        "--num-evals",
        type=int,
        default=5,
        help="points of the curve in a stage, its start and end among them (default 5)",
    )
    parser.add_argument(
        "--eval-worlds", type=int, help=f"held-out arenas to judge the policy on; {by_device('eval_worlds')}"
    )
    parser.add_argument(
        "--out", type=pathlib.Path, default=pathlib.Path("out/train"), help="folder of all results (default out/train)"
    )
    options = parser.parse_args(argv)
    if options.stages < 1 or options.num_evals < 2:
        parser.error(
            f"--stages must be at least 1 and --num-evals at least 2, got {options.stages} and {options.num_evals}."
        )
    if options.teacher_timesteps is not None and not options.pixels:
        parser.error("--teacher-timesteps is of --pixels: without it there is no teacher.")
    return options


def main(argv: list[str] | None = None) -> int:
    """Trains, or goes on where it stopped, and evaluates."""
    options = arguments(argv)
    missing = [
        name for name in ("brax", "mujoco_playground", "matplotlib", "rich") if not importlib.util.find_spec(name)
    ]
    if missing:
        print(f"Training needs {', '.join(missing)}: pip install 'mjx_arenas[train]', or make train.", file=sys.stderr)
        return 2
    from mjx_arenas.viz import render

    gl = render.choose_gl()  # before MuJoCo is imported
    gpu_.leave_room(options.impl)  # before JAX starts
    import jax

    from mjx_arenas.sim.warp_notes import no_room_answered

    gpu = jax.default_backend() == "gpu"
    out = options.out.resolve()
    saved, finished, picture = (out / name for name in ("config.json", "result.json", "strip.png"))
    before = {"sees": "numbers", **json.loads(saved.read_text())} if saved.exists() else None
    longer = before is not None and options.stages > before["stages"]
    if before is not None and longer and options.num_timesteps is None:
        options.num_timesteps = options.stages * steps_of_stage(before)
    if problem := fill_in(options, gpu, jax.local_device_count()):
        print(problem, file=sys.stderr)
        return 2
    config = configuration(options, gpu)
    try:
        out.mkdir(parents=True, exist_ok=True)
        output.check_folder(out)
    except OSError as error:
        why = f" {options.out} cannot be written: {error.strerror}." if error.strerror else f": {error}"
        print(f"--out{why}", file=sys.stderr)
        return 2
    if before is not None and (problem := conflict(config, before, saved)):
        print(problem, file=sys.stderr)
        return 2
    if longer:
        for old in (finished, picture):
            old.unlink(missing_ok=True)
    write(saved, json.dumps(config, indent=1))
    if finished.exists():
        print(f"The training in {out} is finished; --stages {config['stages'] + 1} goes on with it.", flush=True)
    else:
        what = f"{config['num_envs']:,} worlds, impl={config['impl']!r}, into {out}"
        print(f"{what}; the first minutes compile.", flush=True)
        try:
            with no_room_answered():
                train(config, out)
                write(finished, json.dumps(judged.evaluate(config, load_policy(out)), indent=1))
        except MemoryError as error:
            print(f"{error or 'There is not enough memory.'}", file=sys.stderr)
            return 2
        except KeyboardInterrupt:
            print("Interrupted: the same command goes on after the last stage that was finished.", file=sys.stderr)
            return 130
    tell(finished, picture, out, bool(gl), options.pixels)
    return 0


def fill_in(options: argparse.Namespace, gpu: bool, devices: int) -> str | None:
    """Gives options that were left out their defaults; the one that makes no sense, in a sentence."""
    for name, value in DEFAULTS[("gpu" if gpu else "cpu") + (", pixels" if options.pixels else "")].items():
        if getattr(options, name) is None:
            setattr(options, name, value)
    if options.num_envs < 1 or options.num_envs % MINIBATCHES:
        return f"--num-envs must be a multiple of {MINIBATCHES}, got {options.num_envs}."
    if options.pixels and devices > 1:
        return f"--pixels trains on one device, and here are {devices}: set CUDA_VISIBLE_DEVICES=0."
    for name in ("num_timesteps", "eval_worlds", "teacher_timesteps"):
        number = getattr(options, name)
        if number is not None and number < 1:
            return f"--{name.replace('_', '-')} must be at least 1, got {number}."
    return None


def configuration(options: argparse.Namespace, gpu: bool) -> dict[str, Any]:
    """What decides a training, as its file has it; of a policy that sees with its teacher's."""
    given = {name: x for name, x in vars(options).items() if name not in ("out", "pixels", "teacher_timesteps")}
    given |= {"impl": options.impl or ("warp" if gpu else "jax"), "minibatches": MINIBATCHES, "ppo": PPO}
    config = given | {"sees": "numbers", "networks": policies.HIDDEN}
    if options.pixels:
        worlds = DEFAULTS["gpu" if gpu else "cpu"]["num_envs"]
        steps = {"num_envs": worlds, "num_timesteps": options.teacher_timesteps, "stages": 1}
        teacher = config | {"sees": "everything", "arenas": "every_episode"} | steps
        del given["ppo"], given["minibatches"]
        config = given | {"sees": "pictures", "networks": policies.CNN, "dagger": DAGGER, "teacher": teacher}
    return json.loads(json.dumps(config))


def train(config: dict[str, Any], out: pathlib.Path) -> None:
    """What there is to train yet, a teacher first."""
    if "teacher" in config:
        teacher = out / "teacher"
        teacher.mkdir(exist_ok=True)
        write(teacher / "config.json", json.dumps(config["teacher"], indent=1))
        print(f"The teacher learns, {config['teacher']['num_envs']:,} worlds, into {teacher}.", flush=True)
        apart(train, config["teacher"], teacher)
        print("The policy that sees learns from it.", flush=True)
    with show(config["num_timesteps"]) as progress:
        stages.train(config, out, progress)


def apart(function: Callable[..., None], *arguments: Any) -> None:
    """Calls it in a process of its own: where two trainings followed each other in one, Warp forgot the stream that it was to capture."""
    with concurrent.futures.ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        pool.submit(function, *arguments).result()


def tell(finished: pathlib.Path, picture: pathlib.Path, out: pathlib.Path, draws: bool, pixels: bool) -> None:
    """Prints what the policy is worth, and draws it where that can be."""
    for where, numbers in json.loads(finished.read_text()).items():
        print(f"success on {numbers['worlds']} {where.replace('_', ' ')} arenas: {numbers['success']:.1%}")
        if numbers.get("solver_limits"):
            print(f"  in {numbers['solver_limits']:.1%} of them the solver reached the limit of its iterations")
    if not draws and not pixels:
        print("No pictures: OpenGL is missing here (on Debian and Ubuntu: apt install libegl1 libgl1-mesa-dri).")
    elif not picture.exists():
        judged.strip(load_policy(out), picture, pixels)


def conflict(config: dict[str, Any], before: dict[str, Any], saved: pathlib.Path) -> str | None:
    """Why a training cannot go on from what another one left in a folder; for more stages of the same length it can."""
    differing = [name for name in config if before.get(name) != config[name]]
    if config["stages"] > before["stages"] and {*differing} <= {"stages", "num_timesteps"}:
        stages, each = config["stages"], steps_of_stage(before)
        wrong = f"{saved} is of a training whose stages have {each:,} steps: for {stages} of them give --num-timesteps {stages * each}."
        return None if steps_of_stage(config) == each else wrong
    what = ", ".join(f"{name} {before.get(name)} instead of {config[name]}" for name in differing)
    return f"{saved} is of another training ({what}): give another --out, or remove the folder." if differing else None


if __name__ == "__main__":
    sys.exit(main())
