"""What the two numbers of `mjx_arenas/envs/when_needed.py` cost in a step: `mjx-arenas bench when_needed --json FILE`.

Steps `Push` with one physics step each, so that drawing counts for much, or with `--scene arm` what the case `terms_episodes` steps.
Episodes of `--length` steps end one after the other (spread), or all end at once (together). For several numbers: the work waits until
one in PENDING worlds wants it, and is done for one in CHUNK worlds at once. `added_ms` is what a step takes more than one of an
environment that never draws.
"""

import argparse
import functools
import importlib
import json
import pathlib
import sys
from collections.abc import Callable, Iterator, Sequence
from typing import Any
from unittest import mock

from benchmarks import measure
from mjx_arenas.parser import Parser

VALUES = ((16, 8), (4, 4), (2, 2), (4, 2), (8, 8), (16, 16), (32, 32))


def main(argv: Sequence[str] | None = None) -> int:
    """Measures, prints a line for each number and writes all of them."""
    parser = Parser(
        prog="mjx-arenas bench when_needed",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("-n", "--worlds", type=int, help="default: 8192 on a GPU, else 64")
    parser.add_argument(
        "--engine", "--impl", dest="impl", choices=("jax", "warp"), help="default: warp on a GPU, else jax"
    )
    parser.add_argument("--scene", choices=("push", "arm"), default="push", help="what is stepped (default push)")
    parser.add_argument("--length", type=int, default=120, help="of an episode, in steps (default 120)")
    parser.add_argument(
        "--values",
        nargs="+",
        metavar="PENDING,CHUNK",
        type=lambda text: tuple(map(int, text.split(","))),
        default=VALUES,
        help="default: " + " ".join(f"{p},{c}" for p, c in VALUES),
    )
    parser.add_argument("--json", type=pathlib.Path, help="file for the results")
    options = parser.parse_args(argv)
    here = measure.environment()  # before this process takes the device
    gpu = here["platform"] != "cpu"
    worlds, impl = options.worlds or (8192 if gpu else 64), options.impl or ("warp" if gpu else "jax")
    from benchmarks import terms
    from mjx_arenas.envs.tasks import push

    def make_env(kind: Callable[[type], type]) -> Any:
        if options.scene == "arm":
            return terms.holding(kind, impl, options.length)
        config = push.default_config()
        return kind(push.Push)(config_overrides={"impl": impl, "ctrl_dt": config.sim_dt})

    rows = []
    for row in costs(make_env, worlds, options.length, options.values):
        rows.append(row)
        print(
            " ".join(f"{name} {x:.4g}" if isinstance(x, float) else f"{name} {x}" for name, x in row.items()),
            flush=True,
        )
    if options.json:
        command = " ".join(["mjx-arenas bench when_needed", *(sys.argv[1:] if argv is None else argv)])
        result = {
            "command": command,
            **here,
            "impl": impl,
            "scene": options.scene,
            "worlds": worlds,
            "length": options.length,
        }
        result["rows"] = rows
        options.json.parent.mkdir(parents=True, exist_ok=True)
        options.json.write_text(json.dumps(result, indent=1) + "\n")
    return 0


def costs(
    make_env: Callable[[Callable[[type], type]], Any],
    worlds: int,
    length: int,
    values: Sequence[tuple[int, int]],
    ends: Sequence[str] = ("spread", "together"),
) -> Iterator[dict[str, Any]]:
    """A row for each pair of values and way of ending, and, first, those of an environment that never draws.

    Args:
        make_env: from a function that changes its class to an environment.
        worlds: W.
        length: steps of an episode; as many are measured.
        values: pairs of PENDING and CHUNK.
        ends: ways of ending.
    """
    import jax
    import jax.numpy as jnp

    module = importlib.import_module("mjx_arenas.envs.when_needed")
    every = {
        "spread": jnp.arange(worlds) * length // worlds,
        "together": jnp.full(worlds, length // 2),
    }
    env = make_env(lambda kind: kind)
    state = jax.jit(jax.vmap(env.reset))(jax.random.split(jax.random.key(0), worlds))

    def episode(env: Any) -> Callable:
        def step(state: Any, t: jax.Array, ends: jax.Array) -> Any:
            state = state.replace(done=(t == ends).astype(jnp.float32))
            return jax.vmap(env.step)(state, jnp.zeros((worlds, env.action_size)))

        def run(state: Any, ends: jax.Array) -> Any:
            return jax.lax.scan(lambda state, t: (step(state, t, ends), None), state, jnp.arange(length))[0]

        return run

    lowered = {(None, None): jax.jit(episode(make_env(never_drawing))).lower(state, every["spread"])}
    for pending, chunk in values:
        with mock.patch.multiple(module, _PENDING=pending, _CHUNK=chunk):  # read where it is traced
            lowered[pending, chunk] = jax.jit(episode(env)).lower(state, every["spread"])
    # One by one, as XLA tries kernels on the GPU.
    compiled = {pair: program.compile() for pair, program in lowered.items()}
    for name in ends:
        at = every[name]
        later = {
            pair: run(state, at) for pair, run in compiled.items()
        }  # the first episode draws for all worlds at once
        seconds = measure.interleaved(
            {str(pair): functools.partial(run, later[pair], at) for pair, run in compiled.items()}, repeats=3
        )
        for pair in compiled:
            ms, base = (1e3 * seconds[str(key)] / length for key in (pair, (None, None)))
            yield {"ends": name, "pending": pair[0], "chunk": pair[1], "ms_per_step": ms, "added_ms": ms - base}


def shares(
    make_env: Callable[[Callable[[type], type]], Any],
    worlds: int,
    length: int,
    ends: Sequence[str] = ("spread", "together"),
) -> Iterator[dict[str, Any]]:
    """The speed of an environment that draws, as a share of one that never does, as `costs` measures it with the library's own values."""
    module = importlib.import_module("mjx_arenas.envs.when_needed")
    for row in costs(make_env, worlds, length, [(module._PENDING, module._CHUNK)], ends):
        if row["pending"] is not None:
            share = 1 - row["added_ms"] / row["ms_per_step"]
            yield {"worlds": worlds, "ends": row["ends"], "ms_per_step": row["ms_per_step"], "speed_share": share}


def of_terms(impl: str, worlds: int, length: int, substeps: int) -> Iterator[dict[str, Any]]:
    """An environment whose episodes each draw thirty quantities of an arm and its arena, beside one whose worlds stay what they are."""
    from benchmarks import terms

    yield from shares(lambda kind: terms.holding(kind, impl, length, substeps), worlds, length)


def of_tasks(
    worlds: int, length: int, names: Sequence[str] = ("Reach", "Lift", "PickAndPlace")
) -> Iterator[dict[str, Any]]:
    """Tasks of arms, with new arenas in every episode, beside arenas that stay what they are. No action moves the arm."""
    from mjx_arenas import envs

    for name in names:

        def make(kind: Any, name: str = name) -> Any:
            return kind(getattr(envs, name))(config_overrides={"impl": "warp"})

        for row in shares(make, worlds, length, ["spread"]):
            yield {"task": name, **row}


def never_drawing(kind: type) -> type:
    """The environment's class, whose worlds stay what they are after the first reset."""

    class Never(kind):
        def _prepare(self, info: Any, begins: Any) -> Any:
            del begins
            return info["episode"], info["rng"], info["ready"]

    return Never


if __name__ == "__main__":
    sys.exit(main())
