"""What it takes to compile an arena with its proof, and what a second arena that is equal to the first still compiles."""

import time
import warnings
from collections.abc import Iterator, Sequence
from typing import Any

import jax

import mjx_arenas as mja
from benchmarks import measure, robots, scene
from mjx_arenas import dr
from mjx_arenas.files import paths

REPEATS = 5


def compiling(examples: Sequence[str], worlds: int) -> Iterator[dict[str, Any]]:
    """Seconds of an arena's first compile (the best of some), and of all that a loop does with it and a second, equal one.

    Args:
        examples: names of the package's examples, or "arm": an arm with a gripper on a table with three cubes.
        worlds: the number of worlds of the loop.
    """
    for name in examples:
        proven, alone = min(_seconds(_load(name)[0]) for _ in range(REPEATS))
        first, compiled_first, _ = _used(name, worlds)
        second, compiled, batch = _used(name, worlds)
        flatten, compare = _batch_seconds(batch)
        yield {
            "example": name,
            "proof_seconds": proven,
            "compile_seconds": alone,
            "first_arena_seconds": first,
            "first_arena_compiles": compiled_first,
            "second_arena_seconds": second,
            "second_arena_compiles": compiled,
            "batch_leaves": len(jax.tree.leaves(batch)),
            "batch_flatten_seconds": flatten,
            "batch_hash_seconds": compare,
        }


def proofs(names: Sequence[str] = ("panda", "ur5e", "yam", "xarm7")) -> Iterator[dict[str, Any]]:
    """Seconds of the first compile of an arm of another package on a table, as it is and with the usual terms of a robot.

    Args:
        names: of `mja.robots.known()`.
    """
    for name in names:
        for terms in (False, True):
            proven, alone = min(_seconds(_arm(name, terms)) for _ in range(REPEATS))
            yield {"robot": name, "terms": terms, "proof_seconds": proven, "compile_seconds": alone}


def _arm(name: str, terms: bool) -> mja.Arena:
    arena = robots.arena(robots.made(name, "as_it_is")[0])
    if terms:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of what it has and cannot vary
            arena.vary(**dr.robot(arena.spec, "r_").terms)
    return arena


def _load(name: str) -> tuple[mja.Arena, mja.ArenaRanges]:
    if name == "arm":
        return scene.with_an_arm(), scene.ranges()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of tables that overlap on purpose
        return mja.load(paths.EXAMPLES / f"{name}.yaml")


def _seconds(arena: mja.Arena) -> tuple[float, float]:
    """Of its first compile with its proof, and of MuJoCo's alone."""
    spec = arena.spec.copy()
    begin = time.perf_counter()
    arena.mj_model  # noqa: B018  # compiles it, and proves it
    proven = time.perf_counter()
    spec.compile()
    return proven - begin, time.perf_counter() - proven


def _batch_seconds(batch: mja.ArenaBatch) -> tuple[float, float]:
    """Of what each call of a compiled function does with a batch: taking it apart, and hashing what is static in it."""
    structure = jax.tree.structure(batch)
    seconds = measure.interleaved({"flatten": lambda: jax.tree.flatten(batch), "hash": lambda: hash(structure)})
    return seconds["flatten"], seconds["hash"]


def _used(name: str, worlds: int) -> tuple[float, int, mja.ArenaBatch]:
    """Seconds from nothing to the first steps, how often JAX traced or compiled, and the batch."""
    events: list[str] = []

    def count(event: str, *_: Any, **__: Any) -> None:
        events.extend([event] if event.startswith("/jax/core/compile") else [])

    jax.monitoring.register_event_duration_secs_listener(count)
    try:
        begin = time.perf_counter()
        arena, ranges = _load(name)
        keys = mja.world_keys(0, range(worlds))
        batch = arena.randomize(arena.put_model(), keys, ranges)
        jax.block_until_ready(mja.rollout(batch, mja.make_data(batch, keys), 2))
        return time.perf_counter() - begin, len(events), batch
    finally:
        jax.monitoring.unregister_event_duration_listener(count)
