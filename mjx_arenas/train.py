"""Trains the push task with Brax's PPO: `make train`, or `python -m mjx_arenas.train`.

Training is cut into stages. Each starts from the policy, the value function and the observations' statistics of the stage
before, with a fresh optimizer and fresh worlds, and ends with a checkpoint: after an interruption, the same command goes on
as if there had been none.
"""

import argparse
import functools
import importlib.util
import json
import os
import pathlib
import shutil
import sys
import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from mjx_arenas import gpu as gpu_
from mjx_arenas.files import output
from mjx_arenas.trained import curve, read_log, show, write

if TYPE_CHECKING:
    import jax

DEFAULTS = {
    # where: worlds, steps of all worlds, worlds to evaluate on
    "gpu": {"num_envs": 8192, "num_timesteps": 60_000_000, "eval_worlds": 4096},
    "cpu": {"num_envs": 64, "num_timesteps": 400_000, "eval_worlds": 64},
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
MINIBATCHES = 16
EXAMPLES = """examples:
  python -m mjx_arenas.train                                   the defaults, into out/train
  python -m mjx_arenas.train --num-envs 32 --num-timesteps 50000 --out out/small
  python -m mjx_arenas.train --stages 4                        goes on with a training of three stages, for a stage of the same length

The folder then holds config.json, progress.jsonl and curve.png (while it trains), checkpoints/, result.json and strip.png, a film strip;
docs/training.md says what is in them, and how to load the policy.
"""
HIDDEN = {"policy_hidden_layer_sizes": (128, 128, 128), "value_hidden_layer_sizes": (256, 256, 256)}


def arguments(argv: list[str] | None = None) -> argparse.Namespace:
    """What the command line says."""
    parser = argparse.ArgumentParser(
        prog="python -m mjx_arenas.train",
        description=__doc__,
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    gpu, cpu = DEFAULTS["gpu"], DEFAULTS["cpu"]

    def by_device(name: str) -> str:
        return f"default: {gpu[name]:,} on a GPU, else {cpu[name]:,}"

    parser.add_argument(
        "--arenas",
        choices=("every_episode", "fixed", "nominal"),
        default="every_episode",
        help="a new arena for each world in every episode (default), one that is drawn once and kept, or the same one for all",
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
    before = json.loads(saved.read_text()) if saved.exists() else None
    longer = before is not None and options.stages > before["stages"]
    if before is not None and longer and options.num_timesteps is None:
        options.num_timesteps = options.stages * steps_of_stage(before)
    if problem := fill_in(options, gpu):
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
                with show(config["num_timesteps"]) as progress:
                    train(config, out, progress)
                write(finished, json.dumps(evaluate(config, load_policy(out)), indent=1))
        except MemoryError as error:
            print(f"{error or 'There is not enough memory.'}", file=sys.stderr)
            return 2
        except KeyboardInterrupt:
            print("Interrupted: the same command goes on after the last stage that was finished.", file=sys.stderr)
            return 130
    tell(finished, picture, out, bool(gl))
    return 0


def fill_in(options: argparse.Namespace, gpu: bool) -> str | None:
    """Gives options that were left out their defaults; the one that makes no sense, in a sentence."""
    for name, value in DEFAULTS["gpu" if gpu else "cpu"].items():
        if getattr(options, name) is None:
            setattr(options, name, value)
    if options.num_envs < 1 or options.num_envs % MINIBATCHES:
        return f"--num-envs must be a multiple of {MINIBATCHES}, got {options.num_envs}."
    for name in ("num_timesteps", "eval_worlds"):
        if getattr(options, name) < 1:
            return f"--{name.replace('_', '-')} must be at least 1, got {getattr(options, name)}."
    return None


def configuration(options: argparse.Namespace, gpu: bool) -> dict[str, Any]:
    """What decides a training, as its file has it."""
    config = {name: value for name, value in vars(options).items() if name != "out"}
    impl = options.impl or ("warp" if gpu else "jax")
    return json.loads(json.dumps(config | {"impl": impl, "ppo": PPO, "minibatches": MINIBATCHES, "networks": HIDDEN}))


def tell(finished: pathlib.Path, picture: pathlib.Path, out: pathlib.Path, draws: bool) -> None:
    """Prints what the policy is worth, and draws it where that can be."""
    for where, numbers in json.loads(finished.read_text()).items():
        print(f"success on {numbers['worlds']} {where.replace('_', ' ')} arenas: {numbers['success']:.1%}")
        if numbers.get("solver_limits"):
            print(f"  in {numbers['solver_limits']:.1%} of them the solver reached the limit of its iterations")
    if not draws:
        print("No pictures: OpenGL is missing here (on Debian and Ubuntu: apt install libegl1 libgl1-mesa-dri).")
    elif not picture.exists():
        strip(load_policy(out), picture)


def steps_of_stage(config: dict[str, Any]) -> int:
    """Steps of all worlds in one stage."""
    return -(-config["num_timesteps"] // config["stages"])


def conflict(config: dict[str, Any], before: dict[str, Any], saved: pathlib.Path) -> str | None:
    """Why a training cannot go on from what another one left in a folder; for more stages of the same length it can."""
    differing = [name for name in config if before.get(name) != config[name]]
    if config["stages"] > before["stages"] and {*differing} <= {"stages", "num_timesteps"}:
        stages, each = config["stages"], steps_of_stage(before)
        wrong = f"{saved} is of a training whose stages have {each:,} steps: for {stages} of them give --num-timesteps {stages * each}."
        return None if steps_of_stage(config) == each else wrong
    what = ", ".join(f"{name} {before.get(name)} instead of {config[name]}" for name in differing)
    return f"{saved} is of another training ({what}): give another --out, or remove the folder." if differing else None


def train(config: dict[str, Any], out: pathlib.Path, progress: Callable[[int, dict], None]) -> None:
    """The stages that are not there yet."""
    from brax.training.agents.ppo import train as ppo
    from mujoco_playground import wrapper

    from mjx_arenas import brax_bridge
    from mjx_arenas.envs import push

    env: Any = push.Push(config_overrides={"impl": config["impl"], "arenas": config["arenas"]})
    batch = config["num_envs"] // config["minibatches"]
    steps = steps_of_stage(config)
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
        with brax_bridge.device_put_replicated():
            ppo.train(
                environment=env,
                num_timesteps=steps,
                num_envs=config["num_envs"],
                episode_length=env._config.episode_length,
                batch_size=batch,
                num_minibatches=config["minibatches"],
                network_factory=networks(config),
                seed=1000 * config["seed"] + stage,
                num_evals=config["num_evals"],
                num_eval_envs=min(config["eval_worlds"], 1024),
                wrap_env_fn=wrapper.wrap_for_brax_training,
                progress_fn=report,
                save_checkpoint_path=str(unfinished),
                restore_checkpoint_path=str(before / "params") if stage else None,
                **config["ppo"],
            )
        saved = sorted(path for path in unfinished.iterdir() if path.is_dir())
        saved[-1].rename(unfinished / "params")
        for path in saved[:-1]:
            shutil.rmtree(path)
        unfinished.rename(here)  # a stage is there as a whole or not at all


def networks(config: dict[str, Any]) -> Callable:
    """Brax's factory of the networks of a training."""
    from brax.training.agents.ppo import networks as ppo_networks

    return functools.partial(
        ppo_networks.make_ppo_networks,
        policy_obs_key="state",
        value_obs_key="privileged_state",
        **{name: tuple(sizes) for name, sizes in config["networks"].items()},
    )


def load_policy(folder: str | os.PathLike) -> "Callable[[Any, jax.Array], tuple[jax.Array, Mapping]]":
    """The policy of the last stage that a training has finished.

    Args:
        folder: the training's `--out`.

    Returns:
        `policy(observation, key)`, Brax's convention: actions (..., n) within -1 and 1 for the observations (a dict with
        "state" (..., m)) of any number of worlds, and an empty dict. It gives its best action, and does not use the key; jit, vmap.

    Raises:
        ValueError: there is no such training.
    """
    from brax.training.acme import running_statistics
    from brax.training.agents.ppo import checkpoint
    from brax.training.agents.ppo import networks as ppo_networks

    folder = pathlib.Path(folder).resolve()
    stages = folder.glob("checkpoints/stage*/params")
    last = max(stages, key=lambda params: int(params.parent.name.removeprefix("stage")), default=None)
    if last is None:
        wanted = "a folder in which `python -m mjx_arenas.train --out FOLDER` has finished a stage"
        raise ValueError(f"`folder` must be {wanted}, got {str(folder)!r}.")
    # Brax 0.14.2's own `load_policy` fails on the defaults of the networks that its `train` writes.
    config = json.loads((folder / "config.json").read_text())
    action_size = json.loads((last / "ppo_network_config.json").read_text())["action_size"]
    params = checkpoint.load(str(last))
    sizes = {name: mean.shape for name, mean in params[0].mean.items()}
    network = networks(config)(sizes, action_size, preprocess_observations_fn=running_statistics.normalize)
    policy: Any = ppo_networks.make_inference_fn(network)(params, deterministic=True)
    return policy


def evaluate(config: dict[str, Any], policy: Callable) -> dict[str, dict[str, Any]]:
    """Success at the end of one episode, on arenas that training has not seen: within the ranges and outside of them."""
    from mjx_arenas.envs import push

    results = {}
    for where, ranges in {"held_out": push.training_ranges(), "out_of_range": push.wider_ranges()}.items():
        env = push.Push(config_overrides={"impl": config["impl"]}, ranges=ranges)
        results[where] = {"worlds": config["eval_worlds"], **success(env, policy, config["eval_worlds"], HELD_OUT)}
    return results


HELD_OUT = 10_000_019  # seed of the arenas that policies are judged on


def episode(env: Any, policy: Callable, keys: "jax.Array", record: Callable[[Any], Any]) -> tuple[Any, Any]:
    """First states of W worlds, and what `record` keeps of all states of the episode that the policy plays there (T, ...).

    No world starts anew before the end: a box that fell stays fallen.
    """
    import jax
    import jax.numpy as jnp

    @jax.jit
    def run(keys: jax.Array) -> tuple[Any, Any]:
        def step(state: Any, _: None) -> tuple[Any, Any]:
            actions = policy(state.obs, keys[0])[0]
            state = jax.vmap(env.step)(state.replace(done=jnp.zeros_like(state.done)), actions)
            return state, record(state)

        first = jax.vmap(env.reset)(keys)
        return first, jax.lax.scan(step, first, length=env._config.episode_length)[1]

    return run(keys)


def success(env: Any, policy: Callable, n_worlds: int, seed: int) -> dict[str, float]:
    """Shares of worlds, as docs/training.md has them: at their goal when the episode ends, and at any time, before they end early."""
    import jax
    import numpy as np

    def record(state: Any) -> tuple[Any, ...]:
        bad = sum(state.metrics[name] for name in ("nan_state", "invalid_arena", "dropped_contacts"))
        return state.metrics["success"] > 0, state.done > 0, bad > 0, state.metrics["solver_limits"] > 0

    keys = jax.random.split(jax.random.key(seed), n_worlds)
    at_goal, done, bad, limited = map(np.asarray, episode(env, policy, keys, record)[1])  # (T, W)
    ended = np.maximum.accumulate(done)
    before = np.vstack([np.zeros_like(ended[:1]), ended[:-1]])  # a state that is not finite ends the episode itself
    at_goal, bad, limited = at_goal & ~ended, bad & ~before, limited & ~before
    counts = {"success": at_goal[-1], "ended_early": ended[-1], "success_ever": at_goal.any(0), "reported": bad.any(0)}
    counts["solver_limits"] = limited.any(0)
    return {name: float(x.mean()) for name, x in counts.items()}


def strip(policy: Callable, picture: pathlib.Path, n_worlds: int = 4, n_frames: int = 6) -> None:
    """Draws the policy on arenas that training has not seen, a row of frames for each."""
    import jax

    from mjx_arenas.envs import push
    from mjx_arenas.viz import render

    env: Any = push.Push()  # with impl="jax": a few worlds, and MJX on Warp gives no single one of them back
    keys = jax.random.split(jax.random.key(HELD_OUT), n_worlds)
    first, (qpos, goal) = episode(env, policy, keys, lambda state: (state.data.qpos, state.data.mocap_pos))
    frames, labels = [], []
    for world in range(n_worlds):
        for i in [0, 6, 15, 30, 60, len(qpos) - 1][:n_frames]:
            state = jax.tree.map(lambda x, w=world: x[w], first)
            data = state.data.replace(qpos=qpos[i, world], mocap_pos=goal[i, world])
            frames.append(env.render(state.replace(data=data), height=240, width=320, camera=_camera(state)))
            labels.append(f"arena {world}, {(i + 1) * env.dt:.1f} s")
    with output.whole(picture) as unfinished:
        render.grid(frames, labels, columns=n_frames).save(unfinished)


def _camera(state: Any) -> Any:
    import mujoco

    camera = mujoco.MjvCamera()
    camera.lookat = [*state.info["episode"].params.table_offsets[0, :2], 0.75]
    camera.distance, camera.azimuth, camera.elevation = 1.9, 125, -35
    return camera


if __name__ == "__main__":
    sys.exit(main())
