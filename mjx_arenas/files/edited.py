"""Specs beside the file of an arena, one that was edited in Python or those that it was given: MJCF with its assets (host)."""

import pathlib
import tempfile
from collections.abc import Mapping

import mujoco

from mjx_arenas.arena import Arena
from mjx_arenas.build import mjcf
from mjx_arenas.files.export import with_copies
from mjx_arenas.files.output import whole
from mjx_arenas.problem import problem
from mjx_arenas.problems import messages
from mjx_arenas.spec import specs

NAME = "spec.xml"


def path_beside(file: pathlib.Path) -> pathlib.Path:
    """The path of the MJCF of the arena that a file describes."""
    return file.with_name(f"{file.stem}_spec") / NAME


def write(arena: Arena, again: Arena, file: pathlib.Path) -> bool:
    """Writes the spec of an arena beside its file, if MJCF can hold it.

    Args:
        arena: whose spec was edited.
        again: what its calls make; its spec is replaced.
        file: of the arena.

    Returns:
        Whether the MJCF gives the same model, to rounding. If not, nothing is written.

    Raises:
        ValueError: the calls that the file will have would read other numbers than those of the arena have.
    """
    spec = arena.own_spec()
    spec.compile()
    files = files_of(spec)
    with tempfile.TemporaryDirectory() as folder:
        fill(pathlib.Path(folder), files)
        again.adopt_spec(specs.read(pathlib.Path(folder, NAME), "spec"))
        try:
            lost = mjcf.lost(arena.mj_model, again.mj_model)
        except ValueError as refused:  # the calls read the spec as it was given
            raise messages.error([problem("arena", "edited_past_calls")]) from refused
        if lost:
            return False
    put(path_beside(file).parent, files)
    return True


def files_of(spec: mujoco.MjSpec) -> dict[str, bytes]:
    """A spec as MJCF, and the files that it needs, by their paths in a folder."""
    return with_copies(mjcf.text(spec), dict(spec.assets), NAME)


def fill(folder: pathlib.Path, files: Mapping[str, bytes]) -> None:
    """Writes files into a folder that exists."""
    for name, content in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)


def put(folder: pathlib.Path, files: Mapping[str, bytes]) -> None:
    """The same as a folder of their own, whole or not at all; an older one of a spec is replaced."""
    with whole(folder, over=lambda there: (there / NAME).is_file()) as unfinished:
        unfinished.mkdir()
        fill(unfinished, files)
