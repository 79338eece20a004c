"""Worlds of a file, for the commands that show, keep and step them."""

import os
import pathlib
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from mjx_arenas.cli.terminal import answered, busy, count, counted, listed, warn
from mjx_arenas.files import paths
from mjx_arenas.gpu import has_gpu
from mjx_arenas.keywords import ALIKE, nearest

if TYPE_CHECKING:
    from mujoco import mjx

    from mjx_arenas.arena import Arena
    from mjx_arenas.params.params import ArenaParams, ArenaRanges
    from mjx_arenas.viz.samples import Sample

LOOKED_AT = 1000  # of the worlds that cannot be, for the reasons
WARNINGS = 5  # of single worlds
SKY = (0.82, 0.87, 0.92)  # where Warp sees nothing
OPTIMIZED = (
    20_000  # steps of MJX, in all worlds together, from which on XLA's optimization saves more time than it takes
)


def load(file: pathlib.Path, n_steps: int = 0) -> tuple["Arena", "ArenaRanges"]:
    """What a file describes.

    Args:
        file: that describes an arena.
        n_steps: that MJX will take in all worlds together: where there are few, XLA compiles quickly what runs slowly. Flags
            that are set stay.
    """
    os.environ.setdefault("XLA_FLAGS", "" if n_steps >= OPTIMIZED else "--xla_backend_optimization_level=0")
    with busy("loading"), answered(ValueError, OSError, ImportError):
        import_mujoco()
        from mjx_arenas.files import load

        arena, ranges = load.load(file)
        _ = arena.record  # which says what only shows when the arena is compiled
        return arena, ranges


def import_mujoco() -> None:
    """Refuses what `MUJOCO_GL` must not be, as MuJoCo does when it is imported."""
    with answered(RuntimeError):
        import mujoco  # noqa: F401


def steps_on_mjx(engine: str | None, n_steps: int) -> int:
    """How many of some steps are MJX's, before JAX is there to say whether it has a GPU, and so what the default is."""
    return n_steps if engine in ("jax", "warp") or (engine is None and has_gpu()) else 0


def put_model(arena: "Arena", ranges: "ArenaRanges", engine: str | None) -> "mjx.Model":
    """The model on an engine of MJX, by default the best here; answers what that cannot do."""
    with answered(ValueError, NotImplementedError):
        arena.check_ranges(ranges, held=True)
        return arena.put_model(engine)


def name_of(file: pathlib.Path) -> str:
    """The name of a file as a user types it."""
    return file.stem if file.parent == paths.EXAMPLES else str(file)


def draw(arena: "Arena", ranges: "ArenaRanges", seed: int, numbers: Sequence[int]) -> "Sample":
    """The parameters of worlds."""
    with busy(f"drawing {count(len(numbers), 'world')}") as tell:
        from mjx_arenas.viz import samples

        return samples.draw(arena.record, ranges, seed, numbers, tell)


def impossible(arena: "Arena", ranges: "ArenaRanges", drawn: "Sample") -> dict[int, str]:
    """Why worlds cannot be, by their numbers: one world for each of the reasons that differ in more than numbers."""
    found: dict[str, tuple[int, str]] = {}
    for i in (~drawn.valid).nonzero()[0][:LOOKED_AT].tolist():
        why = reasons(arena, ranges, drawn, i)
        found.setdefault(re.sub(r"\d[\d.e+-]*", "0", why), (int(drawn.numbers[i]), why))
    return dict(found.values())


def reasons(arena: "Arena", ranges: "ArenaRanges", drawn: "Sample", index: int) -> str:
    """Why a world cannot be, in sentences."""
    from mjx_arenas import take

    return " ".join(arena.problems(take(drawn.params, index), ranges))


class Scene(NamedTuple):
    """Some worlds of a file, in C MuJoCo, with their objects in place."""

    arena: "Arena"
    ranges: "ArenaRanges"
    seed: int
    numbers: list[int]  # (W,)
    keys: Any  # (W,)
    params: "ArenaParams"  # (W, ...)
    twins: list[tuple[Any, Any]]  # (W,) MjModel and MjData
    valid: list[bool]  # (W,)

    @property
    def worlds(self) -> list["ArenaParams"]:
        """The parameters of each world, (W,)."""
        from mjx_arenas import take

        return [take(self.params, i) for i in range(len(self.twins))]

    @property
    def data(self) -> list[Any]:
        """The state of each world, (W,)."""
        return [data for _, data in self.twins]

    @property
    def labels(self) -> list[str]:
        """The text on the picture of each world, (W,)."""
        each = zip(self.numbers, self.valid, strict=True)
        return [f"world {number}, seed {self.seed}{'' if valid else ', invalid'}" for number, valid in each]


def make(
    file: pathlib.Path,
    seed: int,
    numbers: Sequence[int],
    keyframe: str | None = None,
    camera: str | None = None,
    n_steps: int = 0,
    state: pathlib.Path | None = None,
) -> Scene:
    """The worlds of a file that MuJoCo compiles; says which are left out, and which are drawn though they are not valid.

    Args:
        file: that describes an arena.
        seed: of the worlds.
        numbers: of the worlds.
        keyframe: in which robots are.
        camera: checked at once, as the keyframe is: the name of one of the arena's.
        n_steps: as for `load`.
        state: a file with the state of the one world; None: its start.
    """
    if state is not None and (len(numbers) != 1 or keyframe is not None):
        raise click.UsageError("--state shows one world, and cannot be combined with --keyframe.")
    arena, ranges = load(file, n_steps)
    check_keyframe(arena, keyframe)
    data = None if state is None else read_state(arena, state)
    check_camera(arena, camera)
    drawn = draw(arena, ranges, seed, numbers)
    made, said = {}, []
    with busy(f"making {count(len(numbers), 'world')}") as tell:
        import numpy as np

        from mjx_arenas import take, world_keys

        keys = world_keys(seed, numbers)
        for i in counted(range(len(numbers)), tell):
            fate = "is not valid"
            try:
                start = {"key": keys[i], "keyframe": keyframe} if data is None else {"data": data}
                made[i] = arena.c_world(take(drawn.params, i), **start)
            except ValueError:
                if drawn.valid[i]:
                    raise
                fate = "cannot be made"
            if not drawn.valid[i]:
                said.append(f"World {numbers[i]} of seed {seed} {fate}: {reasons(arena, ranges, drawn, i)}")
    _say(said, len(numbers), bool(made))
    rows = list(made)
    return Scene(
        arena,
        ranges,
        seed,
        [numbers[i] for i in rows],
        keys[np.array(rows)],
        take(drawn.params, rows),
        list(made.values()),
        drawn.valid[rows].tolist(),
    )


def _say(sentences: Sequence[str], of: int, some: bool) -> None:
    """Warns of worlds that are wrong; refuses if none of so many worlds was made."""
    if not some:
        raise click.ClickException(sentences[0] if of == 1 else f"No world can be made. {sentences[0]}")
    for sentence in sentences[:WARNINGS]:
        warn(sentence)
    if len(sentences) > WARNINGS:
        warn(f"The same of {count(len(sentences) - WARNINGS, 'more world')}.")


def read_state(arena: "Arena", path: pathlib.Path) -> Any:
    """The `MjData` of a state that a file has, as `numpy.savez("state.npz", qpos=data.qpos[i], qvel=data.qvel[i])` writes it."""
    import mujoco
    import numpy as np

    data = mujoco.MjData(arena.mj_model)
    names = ("qpos", "qvel", "act", "ctrl", "mocap_pos", "mocap_quat")
    with answered(OSError, ValueError):
        loaded = np.load(path)
    if isinstance(loaded, np.ndarray) or "qpos" not in loaded:
        raise click.ClickException(f"--state {str(path)!r} must be an .npz file with the array `qpos` of a world.")
    with answered(ValueError), loaded as arrays:
        for name in (name for name in names if name in arrays):
            want, value = getattr(data, name), arrays[name]
            if value.shape != want.shape or value.dtype.kind not in "fiu" or not np.isfinite(value).all():
                which = f"`{name}` must be {want.shape} finite numbers of one world"
                raise click.ClickException(f"--state: {which}, got {value.dtype} of shape {value.shape}.")
            want[...] = value
    return data


def check_keyframe(arena: "Arena", keyframe: str | None) -> None:
    """Refuses a keyframe that the arena has not."""
    if keyframe is not None:
        check_name("keyframe", keyframe, [arena.mj_model.key(i).name for i in range(arena.mj_model.nkey)])


def check_camera(arena: "Arena", camera: str | None) -> None:
    """Refuses a camera that the arena has not."""
    if camera is not None:
        check_name("camera", camera, [arena.mj_model.camera(i).name for i in range(arena.mj_model.ncam)])


def check_name(option: str, name: str, known: Sequence[str]) -> None:
    """Refuses a name that is none of those that the arena has for such an option."""
    names = [n for n in known if n]
    if name in names:
        return
    if not names:
        raise click.ClickException(f"--{option} {name!r}: the arena has no {option} with a name: leave --{option} out.")
    close = nearest(name, names, ALIKE)
    hint = f": did you mean {close!r}?" if close else "."
    raise click.ClickException(f"--{option} must be {listed([repr(n) for n in names])}, got {name!r}{hint}")
