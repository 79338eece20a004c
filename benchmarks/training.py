"""What arenas in training buy and cost: `mjx-arenas bench training` (an hour of one GPU; several share the work).

Trains the push task on the nominal arena, on arenas that are drawn once and kept, and on new arenas in every episode,
with some seeds each, and judges each policy on arenas that no training has seen (`mjx-arenas train`). Then
measures the speed of training with each. Writes `results/training.json`; `mjx-arenas bench training --plot` draws
it. What stands in that file already is not done again. `--in-c` judges the policies in `--out` in C MuJoCo, too, on the
same arenas, which needs no GPU. `--task lift` does the same with another task, into
`results/training_lift.json`, `--num-envs 256` with fewer worlds, into `results/training_256.json`; `--pixels` does the
same with policies that see pictures, on the nominal arena and look and on new ones in every episode, into
`results/training_pixels.json`.
"""

import argparse
import concurrent.futures
import json
import os
import pathlib
import queue
import statistics
import subprocess
import sys
import time
from typing import Any

from benchmarks import measure
from benchmarks.devices import visible_gpus
from mjx_arenas import gpu as gpu_
from mjx_arenas.parser import Parser

ARENAS = ("nominal", "fixed", "every_episode")
RESULTS = pathlib.Path(__file__).parent / "results"


def main() -> int:
    """Runs what is asked for."""
    parser = Parser(
        prog="mjx-arenas bench training", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--task", default="push", help="as of mjx-arenas train (default push)")
    parser.add_argument("--num-envs", type=int, help="worlds that train at once; default that of training")
    parser.add_argument("--pixels", action="store_true", help="policies see pictures")
    parser.add_argument(
        "--arenas", nargs="+", choices=ARENAS, help="to train on (default all, with --pixels without fixed)"
    )
    parser.add_argument(
        "--num-timesteps",
        type=int,
        help="default of push 50,000,000; with --pixels, and of other tasks, that of training",
    )
    parser.add_argument(
        "--set", nargs="+", default=[], metavar="NAME=VALUE", help="as of mjx-arenas train, several at once"
    )
    parser.add_argument("--at-once", type=int, default=1, help="trainings that share each GPU (default 1)")
    parser.add_argument("--cost-envs", type=int, default=8192)
    parser.add_argument(
        "-o", "--out", type=pathlib.Path, default=pathlib.Path("out/study"), help="for checkpoints and logs"
    )
    parser.add_argument("--json", type=pathlib.Path, help="default: results/training.json, or training_pixels.json")
    parser.add_argument(
        "--ways", nargs="*", default=list(WAYS), choices=(*WAYS, *ARENAS), help="to measure the speed of"
    )
    parser.add_argument("--in-c", action="store_true", help="only judge the policies in --out in C MuJoCo")
    parser.add_argument("--plot", action="store_true", help="only draw what is in the file")
    parser.add_argument("--child", help=argparse.SUPPRESS)
    options = parser.parse_args()
    options.arenas = options.arenas or [arenas for arenas in ARENAS if arenas != "fixed" or not options.pixels]
    options.num_timesteps = options.num_timesteps or (None if options.pixels or options.task != "push" else 50_000_000)
    kinds = [options.task] * (options.task != "push") + ["pixels"] * options.pixels
    name = "_".join(["training", *kinds, *([str(options.num_envs)] if options.num_envs else [])])
    options.json = options.json or RESULTS / f"{name}.json"
    if options.child:
        gpu_.leave_room("warp")  # before JAX starts
        print(json.dumps(cost(options.task, options.cost_envs, options.child)))
        return 0
    if options.in_c:
        in_c(options)
    elif not options.plot:
        study(options)
    if (result := json.loads(options.json.read_text()))["runs"]:
        plot(result, options.json.with_suffix(".png"))
    return 0


def study(options: argparse.Namespace) -> None:
    """All trainings and, with the usual number of worlds, the speeds: a job at once for each GPU, or `at_once` times as many."""
    gpus: queue.Queue[str | None] = queue.Queue()
    for gpu in options.at_once * (visible_gpus() or [None]):
        gpus.put(gpu)
    here = measure.environment()
    result: dict[str, Any] = {
        "command": "mjx-arenas bench training " + " ".join(sys.argv[1:]),
        **here,
        "versions_training": {name: measure.version(name) for name in ("brax", "playground", "flax", "optax")},
        "runs": [],
    }
    if options.json.exists():
        before = json.loads(options.json.read_text())
        result |= {name: before[name] for name in ("runs", "speed") if name in before}
    have = {(r["arenas"], r["seed"]) for r in result["runs"]}
    wanted = [
        (seed, arenas) for seed in range(options.seeds) for arenas in options.arenas if (arenas, seed) not in have
    ]

    def on_a_gpu(function: Any, *args: Any) -> Any:
        gpu = gpus.get()
        try:
            return function(*args, {**os.environ, **({"CUDA_VISIBLE_DEVICES": gpu} if gpu is not None else {})})
        finally:
            gpus.put(gpu)

    with concurrent.futures.ThreadPoolExecutor(gpus.qsize()) as pool:
        jobs = {pool.submit(on_a_gpu, run, options, *job): "runs" for job in wanted}
        if options.ways and not options.pixels and not options.num_envs and "speed" not in result:
            jobs[pool.submit(on_a_gpu, costs_of_all, options)] = "speed"
        options.json.parent.mkdir(parents=True, exist_ok=True)
        failed = []
        for done in concurrent.futures.as_completed(jobs):
            if why := done.exception():
                failed.append(why)
                continue
            row = {**done.result(), **{name: here[name] for name in ("device", "commit", "date")}}
            if jobs[done] == "speed":
                result["speed"] = row
            else:
                result["runs"].append(row)
                result["runs"].sort(key=lambda r: (ARENAS.index(r["arenas"]), r["seed"]))
            options.json.write_text(json.dumps(result, indent=1) + "\n")
    if failed:
        raise ExceptionGroup(f"{len(failed)} of {len(jobs)} failed", failed)


def run(options: argparse.Namespace, seed: int, arenas: str, env: dict[str, str]) -> dict[str, Any]:
    """One training and its judgement; without its seconds where something of it was there before."""
    out = options.out / f"{arenas}_{seed}"
    arguments = [options.task, "--arenas", arenas, "--seed", str(seed), "--stages", "1"]
    arguments += ["--num-evals", "7"] if options.task == "push" else []
    arguments += ["--num-timesteps", str(options.num_timesteps)] if options.num_timesteps else []
    arguments += ["--num-envs", str(options.num_envs)] if options.num_envs else []
    arguments += [word for given in options.set for word in ("--set", given)]
    arguments += ["--out", str(out), *(["--pixels"] if options.pixels else [])]
    out.mkdir(parents=True, exist_ok=True)
    begin, anew = time.perf_counter(), not any(out.iterdir())
    if not (out / "result.json").exists():
        with (out / "log.txt").open("a") as log:
            command = [sys.executable, "-m", "mjx_arenas", "train", *arguments]
            done = subprocess.run(command, check=False, env=env, stdout=log, stderr=log, cwd=measure.ROOT)
        if not (out / "result.json").exists():  # pictures of it may fail, as OpenGL may be missing
            raise RuntimeError(f"The training in {out} ended with {done.returncode}; its log.txt says why.")
    keep = ("steps", "time", "eval/episode_reward", "eval/episode_success_at_end", "training/sps", "kept")
    lines = [json.loads(line) for line in (out / "progress.jsonl").read_text().splitlines()]
    return {
        "arenas": arenas,
        "seed": seed,
        "seconds": round(time.perf_counter() - begin, 1) if anew else None,
        "at_once": options.at_once,
        **json.loads((out / "result.json").read_text()),
        "curve": [{name: line[name] for name in keep if name in line} for line in lines],
        "config": json.loads((out / "config.json").read_text()),
    }


WAYS = ("stock", "fixed", "every_episode", "apply_in_every_step")


def costs_of_all(options: argparse.Namespace, env: dict[str, str]) -> dict[str, Any]:
    """Training steps a second of each way, in processes one after the other on one GPU."""
    rows = {}
    for way in options.ways:
        command = [sys.executable, "-m", "benchmarks.training", "--task", options.task]
        command += ["--cost-envs", str(options.cost_envs), "--child", way]
        done = subprocess.run(command, env=env, capture_output=True, text=True, cwd=measure.ROOT, check=False)
        if done.returncode:
            raise RuntimeError(f"{way}: {done.stderr[-2000:]}")
        rows[way] = json.loads(done.stdout.splitlines()[-1])
    first = options.ways[0]
    return {
        "num_envs": options.cost_envs,
        **{way: {**row, f"over_{first}": row["sps"] / rows[first]["sps"]} for way, row in rows.items()},
    }


def in_c(options: argparse.Namespace) -> None:
    """Judges the policies of the file in C MuJoCo, on the arenas they were judged on before."""
    os.environ["JAX_PLATFORMS"] = "cpu"
    from mjx_arenas import policies
    from mjx_arenas.envs import evaluate
    from mjx_arenas.envs.tasks import configured

    result, here = json.loads(options.json.read_text()), measure.environment()
    where = {name: here[name] for name in ("cpu", "cores", "commit", "date")}
    for row in result["runs"]:
        out = options.out / f"{row['arenas']}_{row['seed']}"
        if "in_c" not in row:
            config = json.loads((out / "config.json").read_text())
            env = configured.environment(config, "held_out")
            shares = evaluate.evaluate(policies.load_policy(out), env, config["eval_worlds"], engine="c")
            row["in_c"] = {"worlds": config["eval_worlds"], **shares, **where}
            options.json.write_text(json.dumps(result, indent=1) + "\n")


def cost(task: str, num_envs: int, way: str) -> dict[str, Any]:
    """Steps a second of PPO's training, the median of several epochs after the first two, in which it compiles.

    `stock` is the same environment with drawing switched off: a wrapper puts back the first state, as Brax and Playground do.
    """
    import jax
    import jax.numpy as jnp

    from mjx_arenas import settings, stages
    from mjx_arenas.envs.tasks import configured
    from mjx_arenas.sim import programs

    data = settings.settled(settings.read(settings.find(task)), gpu=True, pixels=False)
    plain: Any = configured.task(data).kind

    class Stock(plain):
        def _prepare(self, info: Any, begins: jax.Array) -> Any:
            del begins
            return info["episode"], info["rng"], jnp.ones((), bool)

        def _started(self, data: Any, episode: Any, begins: jax.Array) -> Any:
            del episode, begins
            return data

    class Apply(plain):
        def step(self, state: Any, action: jax.Array) -> Any:
            episode = state.info["episode"]
            values = programs.written(self.arena.record, self._mjx_model, episode.params, self._varying)
            info = {**state.info, "episode": episode._replace(fields=values)}
            return super().step(state.replace(info=info), action)

    impl = "warp" if jax.default_backend() == "gpu" else "jax"
    arenas = way if way in ARENAS else "fixed" if way == "stock" else "every_episode"
    kind = {"stock": Stock, "apply_in_every_step": Apply}.get(way, plain)
    env = kind(config_overrides={"impl": impl, "arenas": arenas})
    speeds = []
    epochs, steps = 7, num_envs * env.config.episode_length
    config = settings.configuration(
        settings.merged(data, {"stages": 1, "ppo": {"num_envs": num_envs}}, "cost"), impl, False
    )
    config["ppo"] |= {"num_timesteps": epochs * steps, "num_evals": epochs + 1, "run_evals": False}
    stages.ppo(env, config, lambda _, metrics: speeds.append(float(metrics["training/sps"])))
    return {"sps": statistics.median(speeds[2:]), "epochs": speeds}


def _success(point: dict[str, float]) -> float:
    """At the end of an episode; older files have the share of its time."""
    if "eval/episode_success_at_end" in point:
        return point["eval/episode_success_at_end"]
    return point["eval/episode_success"] / max(point["eval/avg_episode_length"], 1)


def plot(result: dict[str, Any], picture: pathlib.Path) -> None:
    """Success against steps, and on unseen arenas."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    colours = dict(zip(ARENAS, ("#000000", "#0072B2", "#D55E00"), strict=True))
    labels = {"nominal": "the nominal arena", "fixed": "arenas drawn once", "every_episode": "new arenas every episode"}
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    trained = [arenas for arenas in ARENAS if any(row["arenas"] == arenas for row in result["runs"])]
    for arenas in trained:
        for i, row in enumerate(r for r in result["runs"] if r["arenas"] == arenas):
            curve = row["curve"]
            share = [_success(p) for p in curve]
            steps = [p["steps"] / 1e6 for p in curve]
            left.plot(steps, share, color=colours[arenas], marker=".", label=None if i else labels[arenas])
    left.set_xlabel("million steps of all worlds")
    at_end = all("eval/episode_success_at_end" in p for row in result["runs"] for p in row["curve"])
    left.set_ylabel(
        f"{'success at the end' if at_end else 'share of time at the goal'},\non arenas like those of training"
    )
    left.set_ylim(0, 1)
    left.legend(title="trained on", loc="lower center", bbox_to_anchor=(0.5, 1.0), frameon=False)
    for i, arenas in enumerate(trained):
        for j, where in enumerate(("held_out", "out_of_range")):
            values = [r[where]["success"] for r in result["runs"] if r["arenas"] == arenas]
            x = i + 0.18 * (2 * j - 1)
            hatch = "//" if j else None
            right.bar(
                x,
                statistics.mean(values),
                0.32,
                color=colours[arenas],
                alpha=0.45 if j else 0.9,
                hatch=hatch,
                edgecolor="white",
            )
            right.plot([x] * len(values), values, "o", color="#888888", markeredgecolor="black", markersize=5)
    worlds = " or ".join(sorted({f"{row['held_out']['worlds']:,}" for row in result["runs"]}))
    right.set_xticks(range(len(trained)), [labels[a].replace(" ", "\n", 1) for a in trained])
    right.set_ylabel("success at the end of an episode")
    right.set_ylim(0, 1)
    right.set_title(
        f"left: {worlds} held-out arenas; hatched: outside the ranges\nbars: means of the seeds (dots)", fontsize=9
    )
    figure.savefig(picture, dpi=110)


if __name__ == "__main__":
    sys.exit(main())
