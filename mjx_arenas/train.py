"""Trains the push task with Brax's PPO: `make train`, or `python -m mjx_arenas.train`.

Training is cut into stages. Each starts from the policy, the value function and the observations' statistics of the stage
before, with a fresh optimizer and fresh worlds, and ends with a checkpoint: after an interruption, the same command goes on
as if there had been none.
"""

import argparse
import contextlib
import functools
import importlib.util
import json
import os
import pathlib
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

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
HIDDEN = {"policy_hidden_layer_sizes": (128, 128, 128), "value_hidden_layer_sizes": (256, 256, 256)}


def arguments(argv: list[str] | None = None) -> argparse.Namespace:
    """What the command line says."""
    parser = argparse.ArgumentParser(
        prog="python -m mjx_arenas.train", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--arenas", choices=("every_episode", "fixed", "nominal"), default="every_episode")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--impl", choices=("jax", "warp"), help="default: warp on an NVIDIA GPU, else jax")
    parser.add_argument("--num-envs", type=int, help="worlds (default 8192 on a GPU, else 64)")
    parser.add_argument("--num-timesteps", type=int, help="of all worlds (default 60 million on a GPU, else 400,000)")
    parser.add_argument("--stages", type=int, default=3, help="with a checkpoint after each (default 3)")
    parser.add_argument("--num-evals", type=int, default=5, help="of a stage (default 5)")
    parser.add_argument("--eval-worlds", type=int, help="held-out arenas (default 4096 on a GPU, else 64)")
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("out/train"), help="default out/train")
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
    from mjx_arenas import render

    gl = render.choose_gl()  # before MuJoCo is imported
    import jax

    gpu = jax.default_backend() == "gpu"
    for name, value in DEFAULTS["gpu" if gpu else "cpu"].items():
        if getattr(options, name) is None:
            setattr(options, name, value)
    if options.num_envs < 1 or options.num_envs % MINIBATCHES:
        print(f"--num-envs must be a multiple of {MINIBATCHES}, got {options.num_envs}.", file=sys.stderr)
        return 2
    for name in ("num_timesteps", "eval_worlds"):
        if getattr(options, name) < 1:
            print(f"--{name.replace('_', '-')} must be at least 1, got {getattr(options, name)}.", file=sys.stderr)
            return 2
    config = {name: value for name, value in vars(options).items() if name != "out"}
    config |= {
        "impl": options.impl or ("warp" if gpu else "jax"),
        "ppo": PPO,
        "minibatches": MINIBATCHES,
        "networks": HIDDEN,
    }
    out = options.out.resolve()
    try:
        out.mkdir(parents=True, exist_ok=True)
        (out / "config.unfinished").touch()
    except OSError as error:
        print(f"--out {options.out} cannot be written: {error.strerror}.", file=sys.stderr)
        return 2
    (out / "config.unfinished").unlink()
    saved = out / "config.json"
    config = json.loads(json.dumps(config))
    before = json.loads(saved.read_text()) if saved.exists() else config
    if before != config:
        what = ", ".join(f"{k} {before.get(k)} instead of {config[k]}" for k in config if before.get(k) != config[k])
        print(f"{saved} is of another training ({what}): give another --out, or remove the folder.", file=sys.stderr)
        return 2
    print(f"{config['num_envs']:,} worlds, impl={config['impl']!r}, into {out}; the first minutes compile.", flush=True)
    write(saved, json.dumps(config, indent=1))
    try:
        with show(config["num_timesteps"]) as progress:
            policy = train(config, out, progress)
    except KeyboardInterrupt:
        print("Interrupted: the same command goes on after the last stage that was finished.", file=sys.stderr)
        return 130
    result = evaluate(config, policy)
    write(out / "result.json", json.dumps(result, indent=1))
    for where, numbers in result.items():
        print(f"success on {numbers['worlds']} {where.replace('_', ' ')} arenas: {numbers['success']:.1%}")
    if gl:
        strip(policy, out / "strip.png")
    else:
        print("No pictures: OpenGL is missing here (on Debian and Ubuntu: apt install libegl1 libgl1-mesa-dri).")
    return 0


def train(config: dict[str, Any], out: pathlib.Path, progress: Callable[[int, dict], None]) -> Callable:
    """The stages that are not there yet; gives the policy of the last."""
    from brax.training.acme import running_statistics
    from brax.training.agents.ppo import checkpoint
    from brax.training.agents.ppo import networks as ppo_networks
    from brax.training.agents.ppo import train as ppo
    from mujoco_playground import wrapper

    from mjx_arenas import brax_bridge
    from mjx_arenas.envs import push

    factory = functools.partial(
        ppo_networks.make_ppo_networks,
        policy_obs_key="state",
        value_obs_key="privileged_state",
        **{name: tuple(sizes) for name, sizes in config["networks"].items()},
    )
    env: Any = push.Push(config_overrides={"impl": config["impl"], "arenas": config["arenas"]})
    batch = config["num_envs"] // config["minibatches"]
    steps = -(-config["num_timesteps"] // config["stages"])
    folder, running = out / "checkpoints", out / "progress.jsonl"
    for stage in range(config["stages"]):
        here, before = folder / f"stage{stage}", folder / f"stage{stage - 1}"
        if here.exists():
            continue
        done = [line for line in read_log(running) if line["stage"] < stage]
        lines: list[dict[str, Any]] = []

        def report(step: int, metrics: Any, stage: int = stage, done: list = done, lines: list = lines) -> None:
            numbers = {name: float(x) for name, x in metrics.items()}
            lines.append({"stage": stage, "steps": stage * steps + step, "time": time.time(), **numbers})
            write(running, "\n".join(json.dumps(line) for line in [*done, *lines]))
            curve(running, out / "curve.png")
            progress(stage * steps + step, lines[-1])

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
                network_factory=factory,
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
    network = factory(env.observation_size, env.action_size, preprocess_observations_fn=running_statistics.normalize)
    params = checkpoint.load(str(folder / f"stage{config['stages'] - 1}" / "params"))
    return ppo_networks.make_inference_fn(network)(params, deterministic=True)


def evaluate(config: dict[str, Any], policy: Callable) -> dict[str, dict[str, Any]]:
    """Success at the end of one episode, on arenas that training has not seen: within the ranges and outside of them."""
    from mjx_arenas.envs import push

    results = {}
    for where, ranges in {"held_out": push.training_ranges(), "out_of_range": push.wider_ranges()}.items():
        env = push.Push(config_overrides={"impl": config["impl"]}, ranges=ranges)
        results[where] = {"worlds": config["eval_worlds"], **success(env, policy, config["eval_worlds"], HELD_OUT)}
    return results


HELD_OUT = 10_000_019  # seed of the arenas that policies are judged on


def success(env: Any, policy: Callable, n_worlds: int, seed: int) -> dict[str, float]:
    """Share of worlds at their goal when the episode ends, and at any time; a box that fell stays fallen."""
    import jax
    import jax.numpy as jnp

    @jax.jit
    def run(keys: jax.Array) -> tuple[jax.Array, ...]:
        def step(carry: tuple, _: None) -> tuple[tuple, None]:
            state, _, ended, ever, reported = carry
            actions = policy(state.obs, jax.random.key(0))[0]
            state = jax.vmap(env.step)(state.replace(done=jnp.zeros_like(state.done)), actions)
            now = state.metrics["success"] > 0
            bad = sum(state.metrics[name] for name in ("nan_state", "invalid_arena", "dropped_contacts")) > 0
            ended = ended | (state.done > 0)
            return (state, now & ~ended, ended, ever | (now & ~ended), reported | (bad & ~ended)), None

        false = jnp.zeros(n_worlds, bool)
        carry = jax.vmap(env.reset)(keys), false, false, false, false
        (_, *counts), _ = jax.lax.scan(step, carry, length=env._config.episode_length)
        return tuple(x.mean() for x in counts)

    names = ("success", "ended_early", "success_ever", "reported")
    keys = jax.random.split(jax.random.key(seed), n_worlds)
    return {name: float(x) for name, x in zip(names, run(keys), strict=True)}


def strip(policy: Callable, picture: pathlib.Path, n_worlds: int = 4, n_frames: int = 6) -> None:
    """Draws the policy on arenas that training has not seen, a row of frames for each."""
    import jax
    import jax.numpy as jnp

    from mjx_arenas import render
    from mjx_arenas.envs import push

    env: Any = push.Push()  # with impl="jax": a few worlds, and MJX on Warp gives no single one of them back

    @jax.jit
    def run(keys: jax.Array) -> Any:
        def step(state: Any, _: None) -> tuple[Any, Any]:
            state = jax.vmap(env.step)(state.replace(done=jnp.zeros_like(state.done)), policy(state.obs, keys[0])[0])
            return state, (state.data.qpos, state.data.mocap_pos)

        first = jax.vmap(env.reset)(keys)
        return first, jax.lax.scan(step, first, length=env._config.episode_length)[1]

    first, (qpos, goal) = run(jax.random.split(jax.random.key(HELD_OUT), n_worlds))
    frames, labels = [], []
    for world in range(n_worlds):
        for i in [0, 6, 15, 30, 60, len(qpos) - 1][:n_frames]:
            state = jax.tree.map(lambda x, w=world: x[w], first)
            data = state.data.replace(qpos=qpos[i, world], mocap_pos=goal[i, world])
            frames.append(env.render(state.replace(data=data), height=240, width=320, camera=_camera(state)))
            labels.append(f"arena {world}, {(i + 1) * env.dt:.1f} s")
    render.grid(frames, labels, columns=n_frames).save(picture)


def _camera(state: Any) -> Any:
    import mujoco

    camera = mujoco.MjvCamera()
    camera.lookat = [*state.info["episode"].params.table_offsets[0, :2], 0.75]
    camera.distance, camera.azimuth, camera.elevation = 1.9, 125, -35
    return camera


@contextlib.contextmanager
def show(total: int) -> Iterator[Callable[[int, dict], None]]:
    """A progress bar on a terminal, lines elsewhere."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    console = Console()

    def line(numbers: dict[str, Any]) -> str:
        length = max(numbers.get("eval/avg_episode_length", 1.0), 1.0)
        at_goal = numbers.get("eval/episode_success", 0.0) / length
        speed = f", {numbers['training/sps']:,.0f} steps/s" if "training/sps" in numbers else ""
        return f"reward {numbers.get('eval/episode_reward', float('nan')):.1f}, at the goal {at_goal:.0%} of the time{speed}"

    if not console.is_terminal:
        yield lambda step, numbers: print(f"{step:,} steps: {line(numbers)}", flush=True)
        return
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
    with Progress(*columns, console=console) as bar:
        task = bar.add_task("compiling", total=total)
        yield lambda step, numbers: bar.update(task, completed=step, description=line(numbers))


def read_log(log: pathlib.Path) -> list[dict[str, Any]]:
    """Lines of the log, if there is one."""
    return [json.loads(line) for line in log.read_text().splitlines()] if log.exists() else []


def curve(log: pathlib.Path, picture: pathlib.Path) -> None:
    """Draws reward and success of the log against steps."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    rows = read_log(log)
    steps = [row["steps"] / 1e6 for row in rows]
    figure, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(6, 5), layout="constrained")
    above.plot(steps, [row["eval/episode_reward"] for row in rows], color="#0072B2", marker="o")
    above.set_ylabel("reward of an episode")
    at_goal = [row["eval/episode_success"] / max(row["eval/avg_episode_length"], 1.0) for row in rows]
    below.plot(steps, at_goal, color="#D55E00", marker="o")
    below.set_ylabel("share of time at the goal")
    below.set_xlabel("million steps of all worlds")
    below.set_ylim(0, 1)
    figure.savefig(picture, dpi=110)
    plt.close(figure)


def write(path: pathlib.Path, text: str) -> None:
    """Writes a file as a whole or not at all."""
    unfinished = path.with_suffix(".unfinished")
    unfinished.write_text(text + "\n")
    os.replace(unfinished, path)


if __name__ == "__main__":
    sys.exit(main())
