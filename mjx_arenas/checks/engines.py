"""What rolls worlds out to be checked: MJX on either implementation, or C MuJoCo (host). W worlds, K objects."""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from mjx_arenas.arena import Arena
from mjx_arenas.checks import causes, watch, watch_c, watch_mjx
from mjx_arenas.checks.causes import Failure
from mjx_arenas.checks.watch_c import State
from mjx_arenas.params.params import ArenaParams, ArenaRanges, each, on_host
from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import error
from mjx_arenas.progress import Tell
from mjx_arenas.record.record import Record
from mjx_arenas.sample import placement
from mjx_arenas.sample import tops as grounds
from mjx_arenas.sim import data as data_
from mjx_arenas.sim import programs, starts
from mjx_arenas.sim.batch import capacity, make_data
from mjx_arenas.sim.warp_notes import no_room_answered
from mjx_arenas.twin import twin

CHUNK = 50  # steps on MJX between two reports of progress
FALL = 2.0  # how long objects that are dropped fall before anything is judged [s]
ENGINES = {"jax": "MJX on JAX", "warp": "MJX on Warp", "c": "C MuJoCo"}


class Drawn(NamedTuple):
    """Worlds before the first step."""

    params: ArenaParams  # (W, ...)
    valid: np.ndarray  # (W,) bool, as `ArenaBatch.valid`
    possible: np.ndarray  # (W,) bool: MuJoCo compiles it
    qpos: np.ndarray  # (W, K, 7) of the objects
    placed: np.ndarray  # (W, K) bool: found a free place

    def world(self, index: int) -> ArenaParams:
        """Parameters of one world."""
        return each(lambda value: value[index], self.params)

    @property
    def wrong(self) -> np.ndarray:
        """(W,) bool: it fails before the first step."""
        return ~self.valid | ~self.placed.all(-1)


class Run(NamedTuple):
    """What is kept of one world."""

    params: ArenaParams
    qpos: np.ndarray  # (K, 7) of the objects at the start
    failures: dict[str, Failure]  # in its steps, by cause
    start: State | None = None  # of the model that is compiled for the world; None: it cannot be stepped
    good: State | None = None  # the last one before anything went wrong
    good_step: int = 0


class Ran(NamedTuple):
    """The runs of all worlds."""

    runs: dict[int, Run]
    """The runs of worlds that fail and can be stepped, by their index."""
    room: int | None
    """Room for contacts of each world; None: no limit."""
    limited: np.ndarray
    """(W,) bool: Warp's solver reached the limit of its iterations."""


def choose(engine: str | None) -> tuple[str, str]:
    """The engine, and what it is: the fastest one here, if none is given."""
    if engine is not None and engine not in ENGINES:
        raise error([problem("engine", "options", None, engine, known=", ".join(map(repr, ENGINES)))])
    if engine is not None:
        return engine, ENGINES[engine]
    if not data_.on_nvidia():
        return "c", f"{ENGINES['c']}, the fastest engine on a machine without a GPU"
    engine = "warp" if data_.warp_installed() else "jax"
    return engine, f"{ENGINES[engine]}, the fastest engine here"


def settle_steps(record: Record, timesteps: np.ndarray) -> int:
    """How many steps dropped objects fall before anything is judged; 0 where none is dropped.

    Args:
        record: of the arena.
        timesteps: (W,) how long a step is in each [s]: in all they fall long enough.
    """
    return math.ceil(FALL / timesteps.min()) if record.layout.places.drop.any() else 0


def draw(record: Record, ranges: ArenaRanges, keys: jax.Array) -> Drawn:
    """The worlds (W,) of some keys, with the places of their objects."""
    params, valid, possible = programs.draw(record, keys, ranges)
    places = jax.vmap(lambda one, key: programs.place(record, one, key, 0.0))(params, keys)
    return Drawn(*jax.tree.map(np.asarray, (params, valid, possible, *places)))


def run(
    engine: str,
    arena: Arena,
    ranges: ArenaRanges,
    keys: jax.Array,
    drawn: Drawn,
    n_steps: int,
    before: int,
    keyframe: str | None,
    max_contacts: int | None,
    progress: Tell,
) -> Ran:
    """Steps the worlds: `before` steps in which nothing is judged, then `n_steps`.

    Raises:
        MemoryError: Warp finds no room on the GPU.
    """
    record, names = arena.record, list(arena.record.object_names)
    if engine == "c":
        return Ran(_run_c(record, drawn, n_steps, before, keyframe, progress), None, np.zeros(len(keys), bool))
    batch = arena.randomize(arena.put_model(engine), keys, ranges)
    data = make_data(batch, keys, keyframe, max_contacts)
    room = record.room(max_contacts).contacts if engine == "warp" else None
    tops, total = jax.tree.map(jnp.asarray, _tops(record, drawn.params)), before + n_steps
    with no_room_answered():
        for step in range(0, before, CHUNK):
            data = jax.block_until_ready(watch_mjx.fall(batch, data, min(CHUNK, before - step)))
            progress(min(step + CHUNK, before), total)
        start = jax.tree.map(np.asarray, watch_mjx.state(data))
        rolled = watch_mjx.begin(batch, data)
        for step in range(0, n_steps, CHUNK):
            rolled = jax.block_until_ready(watch_mjx.roll(batch, rolled, tops, min(CHUNK, n_steps - step)))
            progress(before + min(step + CHUNK, n_steps), total)
    limited = np.asarray(capacity(batch, rolled.data).solver_limits)
    seen, good, good_step = jax.tree.map(np.asarray, rolled[1:])
    runs = {}
    for w in np.flatnonzero(drawn.possible & (drawn.wrong | causes.happened(seen))).tolist():
        rows = record.layout.state_rows(record.layout.presence.there(on_host(drawn.world(w))))
        first, last = (
            {name: x[w][rows[name]] if name in rows else x[w] for name, x in states.items()} for states in (start, good)
        )
        failures = causes.steps(seen, w, watch_c.pairs_of(seen, w, record.mj_model), names)
        runs[w] = Run(drawn.world(w), drawn.qpos[w], failures, first, last, int(good_step[w]))
    return Ran(runs, room, limited)


def _run_c(
    record: Record, drawn: Drawn, n_steps: int, before: int, keyframe: str | None, progress: Tell
) -> dict[int, Run]:
    starts.check_keyframe(record.mj_model, keyframe)
    starts.warn_of_idle(record, keyframe, drawn.params.terms)
    names, possible = list(record.object_names), np.flatnonzero(drawn.possible).tolist()
    if not possible:
        return {}

    def make(index: int) -> mujoco.MjData:
        w = possible[index]
        params = drawn.world(w)
        model = twin.world_spec(record, params)[1]
        c = starts.c_data(model, keyframe)
        starts.vary_c(record, params, c)
        for k in np.flatnonzero(grounds.present(params, record.parts.places.ground)[1]).tolist():
            c.joint(record.parts.objects[k].joint).qpos = drawn.qpos[w, k]
        return c

    tops = _tops(record, each(lambda value: value[possible], drawn.params))
    rolled = watch_c.roll(make, tops, names, n_steps, progress, before)
    fails = drawn.wrong[possible] | causes.happened(rolled.seen)
    return {
        w: Run(
            drawn.world(w),
            drawn.qpos[w],
            causes.steps(rolled.seen, i, rolled.pairs[i], names),
            *(rolled.start[i], rolled.kept[i], int(rolled.kept_step[i])),
        )
        for i, w in enumerate(possible)
        if fails[i]
    }


def _tops(record: Record, params: ArenaParams) -> watch.Tops:
    """The surfaces to which the objects of worlds (W, ...) belong."""
    places = record.layout.places
    centers = jax.vmap(lambda one: placement.body_centers(places, one))(params)
    return watch.tops(params, np.asarray(centers), places.ground)
