"""The worlds that fail, and why (host). W worlds, K objects."""

import dataclasses
import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mjx_arenas.arena import Arena
from mjx_arenas.checks import causes, engines, folders
from mjx_arenas.checks.causes import CAUSES, Failure
from mjx_arenas.checks.goes_with import GoesWith, goes_with
from mjx_arenas.keywords import with_known_arguments
from mjx_arenas.params.params import ArenaRanges
from mjx_arenas.problem import Told, problem
from mjx_arenas.progress import Tell, teller
from mjx_arenas.record.record import Record
from mjx_arenas.rules import validation
from mjx_arenas.sample.sampling import world_keys
from mjx_arenas.viz.table import columns

N_WORLDS, N_STEPS = 256, 500
LISTED = 10  # numbers of worlds that a report prints
LOOKED_AT = 1000  # of the worlds that cannot be, for the reasons


@dataclasses.dataclass(frozen=True, eq=False)
class CheckReport:
    """Report of `check`; `print` it.

    A world fails for one or more of these causes:

    - "not_finite": its state is NaN, infinite or beyond 1e10, MuJoCo's own limit.
    - "solver_gave_up": an object that is one rigid body does not move as the forces of its contacts say. Over consecutive steps the
      deviation of its velocity adds up to 0.2 m/s. This often happens near geoms that start inside each other, of which `attach` warns, or
      with few iterations.
    - "dropped_contacts": contacts are dropped for lack of room.
    - "through_table": the middle of an object gets below its table's top, within the edges.
    - "deep_penetration": two geoms penetrate each other by more than a quarter of the smaller of their half extents.
    - "off_table": the middle of an object gets outside the edges of its table.
    - "invalid_arena": the arena is not possible (`ArenaBatch.valid`).
    - "invalid_placement": an object finds no free place at the start (`arena.place`).
    """

    engine: str
    why: str
    """Name of the engine in words, and why it was chosen."""
    seed: int
    worlds: tuple[int, ...]
    """(W,) numbers of the worlds."""
    settle_steps: int
    """Number of steps before the others, in which dropped objects fall and nothing is judged."""
    n_steps: int
    timesteps: np.ndarray
    """(W,) time steps [s]."""
    failures: Mapping[str, tuple[Failure, ...]]
    """Failures by cause, for the causes that occurred; the worst worlds come first."""
    solver_limits: np.ndarray
    """(W,) bool: on Warp, the solver or its line search stopped at the limit of its iterations. This is not a failure."""
    goes_with: tuple[GoesWith, ...]
    """The numbers by which worlds that fail differ most from the others, at most three. What depends on such a number does, too."""
    _record: Record = dataclasses.field(repr=False)
    _ranges: ArenaRanges = dataclasses.field(repr=False)
    _runs: Mapping[int, engines.Run] = dataclasses.field(repr=False)
    _room: int | None = dataclasses.field(repr=False)

    @property
    def timestep(self) -> float | None:
        """Time step of all worlds [s]; None if it varies."""
        return float(self.timesteps[0]) if np.ptp(self.timesteps) == 0 else None

    @property
    def ok(self) -> bool:
        """Whether no world fails."""
        return not self.failures

    @property
    def failed(self) -> np.ndarray:
        """(W,) bool: whether the world fails, for any cause."""
        return _failed(self.worlds, self.failures)

    @property
    def worst(self) -> tuple[int, ...]:
        """Numbers of the worst world for each cause, each number once."""
        return tuple(dict.fromkeys(found[0].world for found in self.failures.values()))

    def of(self, world: int) -> dict[str, Failure]:
        """Failures of one world, by cause."""
        return {cause: f for cause, found in self.failures.items() for f in found if f.world == world}

    def save_bundle(self, folder: str | os.PathLike, world: int) -> None:
        """Writes a world that fails to a folder, for `mja.replay`. If writing fails, nothing is left behind.

        The folder holds the world as MJCF with its meshes and textures (`world.xml`), its parameters (`params.json`), its first state and
        the last one before anything went wrong (`states.npz`), and what was found (`failure.json`).

        A world that MuJoCo would not compile, or whose parameters are wrong, is not stepped. The folder then has the objects' places, but
        no states. It has the MJCF if MuJoCo compiles it nevertheless.

        Args:
            folder: path of a folder that does not exist, is empty or is a bundle, which is replaced.
            world: number of the world.

        Raises:
            ValueError: the world does not fail.
        """
        if not validation.is_whole(world) or world not in self.worlds:
            raise validation.error([problem("world", "must", None, world, must="one of the worlds that were checked")])
        world = int(world)
        found = self.of(world)
        if not found:
            raise validation.error([problem("world", "world_fails", None, world)])
        run = self._runs[world]
        about = {
            "causes": {cause: f._asdict() for cause, f in found.items()},
            **{"engine": self.engine, "seed": self.seed, "world": world, "room": self._room},
            **{"n_steps": self.n_steps if run.start else 0, "good_step": run.good_step},
            "timestep": float(self.timesteps[self.worlds.index(world)]),
        }
        folders.write(folder, self._record, self._ranges, run, about)

    def to_dict(self) -> dict[str, Any]:
        """The report as numbers, lists and words, e.g. for JSON."""
        found = {cause: [f._asdict() for f in worst_first] for cause, worst_first in self.failures.items()}
        about = {"engine": self.engine, "why": self.why, "seed": self.seed, "n_worlds": len(self.worlds)}
        about |= {"n_steps": self.n_steps, "seconds": None if self.timestep is None else self.n_steps * self.timestep}
        about |= {"settle_steps": self.settle_steps, "n_failed": int(self.failed.sum())}
        return about | {
            "n_solver_limits": int(self.solver_limits.sum()),
            "goes_with": [one._asdict() for one in self.goes_with],
            "failures": found,
        }

    def __str__(self) -> str:
        n, low, high = len(self.worlds), self.timesteps.min(), self.timesteps.max()
        long = f"or {self.n_steps * low:g} s" if low == high else f"of {low:g} to {high:g} s"
        before = f"{self.settle_steps:,} steps in which dropped objects fall, then " if self.settle_steps else ""
        how = f"seed {self.seed}, {before}{self.n_steps:,} steps {long} on {self.why}"
        note, n_limited = "", int(self.solver_limits.sum())
        if n_limited:
            limits = "its iterations (`iterations` and `ls_iterations` of `arena.spec.option`)"
            note = f"\n\nIn {n_limited:,} of {n:,} worlds the solver stopped at the limit of {limits}: forces are less exact there."
        if self.ok:
            return f"Nothing is wrong in {n:,} world{'s' * (n != 1)} ({how}).{note}"
        rows = [("cause", "worlds", "share", "worst", "how bad")]
        for cause, found in self.failures.items():
            share = f"{100 * len(found) / n:.1f} %"
            worst = found[0]
            first, more, _ = worst.what.partition(". ")
            what = f"{first} (and {worst.number - 1:g} more)" if cause == "invalid_arena" and more else worst.what
            rows.append((CAUSES[cause], f"{len(found):,}", share, str(worst.world), what))
        failed = [str(world) for world, bad in zip(self.worlds, self.failed, strict=True) if bad]
        more = f" and {len(failed) - LISTED:,} more (`failures`)" if len(failed) > LISTED else ""
        which = f"worlds that fail: {', '.join(failed[:LISTED])}{more}"
        told = "".join(f"\n{one}" for one in self.goes_with)
        return f"{len(failed):,} of {n:,} worlds fail ({how}).\n\n{columns(rows)}\n\n{which}{told}{note}"


@with_known_arguments
def check(
    arena: Arena,
    ranges: ArenaRanges,
    n_worlds: int | None = None,
    *,
    worlds: Sequence[int] | None = None,
    seed: int = 0,
    n_steps: int = N_STEPS,
    engine: str | None = None,
    keyframe: str | None = None,
    max_contacts: int | None = None,
    settle_steps: int | None = None,
    progress: Tell | None = None,
) -> CheckReport:
    """Rolls out worlds and reports which fail and why, the worst first.

    `CheckReport` lists the causes of failure. Robots are not controlled: `ctrl` stays as at the start.

    Args:
        arena: arena whose worlds are checked.
        ranges: ranges from which the worlds are drawn.
        n_worlds: number of worlds W, for worlds 0 to W - 1 of the seed. Default: 256.
        worlds: (W,) numbers of the worlds, instead of `n_worlds`.
        seed: seed of all worlds, see `world_keys`.
        n_steps: number of steps.
        engine: "jax", "warp" or "c", which is C MuJoCo on all cores. None: the fastest one here, Warp on an NVIDIA GPU, otherwise C.
        keyframe: name of the keyframe in which a robot starts, as for `make_data`.
        max_contacts: with engine="warp", the number of contacts for which a world has room, as for `make_data`.
        settle_steps: number of steps before the others, in which nothing is judged and dropped objects (`Place(drop=True)`) come to rest.
            An object that fell through or off its surface is reported in the first step after them. None: the steps of 2 s if an object is
            dropped, otherwise 0.
        progress: function that is called with the finished and the total amount of work.

    Raises:
        ValueError: an argument makes no sense.
        MemoryError: Warp finds no room on the GPU.
    """
    validation.check_type("arena", arena, Arena, "an arena")
    tell = teller(progress)
    arena.check_ranges(ranges, held=True)
    numbers = _numbers(n_worlds, worlds)
    n_steps = validation.whole("n_steps", n_steps, 1)
    engine, why = engines.choose(engine)
    if max_contacts is not None and engine != "warp":
        raise validation.error([problem("max_contacts", "contacts_of_engine", None, max_contacts, engine=engine)])
    keys, seed, record = world_keys(seed, numbers), int(seed), arena.unchanged()
    drawn = engines.draw(record, ranges, keys)
    timesteps = record.timesteps(drawn.params)
    before = engines.settle_steps(record, timesteps)
    before = before if settle_steps is None else validation.whole("settle_steps", settle_steps, 0)
    runs, room, limited = engines.run(engine, arena, ranges, keys, drawn, n_steps, before, keyframe, max_contacts, tell)
    worst_first, kept = _failures(arena, ranges, numbers, drawn, runs), {numbers[w]: run for w, run in runs.items()}
    with_it = goes_with(record, drawn.params, _failed(numbers, worst_first))
    what = engine, why, seed, numbers, before, n_steps, timesteps
    return CheckReport(*what, worst_first, limited, with_it, record, ranges, kept, room)


def _failures(
    arena: Arena, ranges: ArenaRanges, numbers: Sequence[int], drawn: engines.Drawn, runs: dict[int, engines.Run]
) -> dict[str, tuple[Failure, ...]]:
    """The failures by cause, the worst first. Worlds that are wrong from the start get a run without steps among `runs`."""
    names = [o.name for o in arena.objects]
    found: dict[str, list[Failure]] = {cause: [] for cause in CAUSES}
    looked_at = set(np.flatnonzero(~drawn.valid)[:LOOKED_AT].tolist())
    for w in sorted({*runs, *np.flatnonzero(drawn.wrong).tolist()}):
        run = runs.setdefault(w, engines.Run(drawn.world(w), drawn.qpos[w], {}))
        failures = causes.placement(names, drawn.placed[w]) | run.failures
        if w in looked_at:
            failures["invalid_arena"] = causes.invalid(arena.problems(run.params, ranges))
        elif not drawn.valid[w]:
            failures["invalid_arena"] = Failure(0, 0, 1, f"Why is said of the first {LOOKED_AT:,} such worlds only.")
        for cause, failure in failures.items():
            found[cause].append(failure._replace(world=numbers[w]))
    return {cause: tuple(sorted(all_, key=lambda f: f.rank(cause))) for cause, all_ in found.items() if all_}


def _failed(numbers: Sequence[int], failures: Mapping[str, tuple[Failure, ...]]) -> np.ndarray:
    return np.isin(numbers, [f.world for found in failures.values() for f in found])


def _numbers(n_worlds: int | None, worlds: Sequence[int] | None) -> tuple[int, ...]:
    if n_worlds is not None and worlds is not None:
        raise validation.error([problem("worlds", "n_worlds_or_worlds", None, worlds)])
    if worlds is None:
        return tuple(range(N_WORLDS if n_worlds is None else validation.whole("n_worlds", n_worlds, 1)))
    if np.ndim(worlds) == 1 and not len(worlds):
        raise validation.error([problem("worlds", "must", None, Told("none"), must="at least one number")])
    world_keys(0, worlds)  # checks them
    return tuple(int(i) for i in dict.fromkeys(np.asarray(worlds).tolist()))
