"""Arenas and ranges in files: YAML or JSON (host).

A file says what Python calls would, with their names and arguments (`calls`): it has no schema of its own.
"""

import os
import pathlib
import tempfile
from collections.abc import Mapping
from typing import Any

import mujoco

from mjx_arenas.arena import Arena
from mjx_arenas.build import mjcf
from mjx_arenas.dr import Term
from mjx_arenas.files import edited
from mjx_arenas.files.numbered import named
from mjx_arenas.files.output import whole
from mjx_arenas.files.paths import check_suffix, find
from mjx_arenas.files.schema import Reader
from mjx_arenas.files.text import dump, parse, read
from mjx_arenas.files.writer import Writer
from mjx_arenas.keywords import with_known_arguments
from mjx_arenas.params.params import ArenaRanges
from mjx_arenas.problem import problem
from mjx_arenas.problems import messages
from mjx_arenas.rules import validation
from mjx_arenas.spec import calls, specs


@with_known_arguments
def load(path: str | os.PathLike) -> tuple[Arena, ArenaRanges]:
    """The arena and the ranges that a file describes.

    The file says what the Python calls would:

        arena:
          type: MultiTableArena
          table_offsets: [[0, -0.6, 0.8], [0, 0.6, 0.8]]
          objects:
            - {name: cube, on: 0}
            - {name: ball, type: sphere, full_size: 0.06, on: 1}
          then:
            - attach: {robot: panda.xml, on: 0}
        ranges:
          table_offsets: {Uniform: {low: [0, 0, -0.2], high: [0, 0, 0.2], relative: add}}
          table_rots: {Uniform: [-0.5, 0.5]}
          object_tables: {Choice: [0, 1]}  # or names of tables and surfaces

    `type` is MultiTableArena, TableArena or Arena.from_xml. Its arguments stand beside it. `then` lists calls of the arena's methods
    `attach`, `add_camera`, `add_material`, `add_part`, `add_object`, `vary` and `merge`, whose `other` is an arena like this one.
    `options`, beside `then`, has those of `arena.spec.option`, by name. `spec` is an MJCF file that replaces the spec that these calls
    make; `save` writes it if the spec was edited.

    A distribution, a texture or a part of furniture is `Name: {...}`, with its arguments by name. It may also be `Name: [...]`, with the
    arguments that it requires, in order. One that requires a single argument, such as Choice, takes that argument as it is. An object or
    a term is just its arguments, `{name: ball, type: sphere}`. File names are relative to the folder of this file.

    Args:
        path: path of a `.yaml`, `.yml` or `.json` file, or the name of an example that comes with this package.

    Raises:
        ValueError: all problems of the file, with their lines if it is YAML.
        FileNotFoundError: there is no such file or example.
        ImportError: the file is YAML, and `ruamel.yaml` is not installed.
    """
    file = find(path)
    try:
        parsed = parse(read(file), file)
    except OSError as error:
        raise type(error)(f"Cannot read {str(file)!r}: {error.strerror}.") from None
    reader = Reader(file, parsed.lines)
    for at in parsed.twice:
        reader.problem(at, "node_twice")
    arena, ranges = reader.file(parsed.data)
    validation.raise_all(reader.problems, str(file))
    for warning in reader.warnings:
        messages.warn(warning)
    assert arena is not None
    assert ranges is not None
    return arena, ranges


def ranges(data: Any, source: str) -> ArenaRanges:
    """The ranges that plain data describe, as `ranges` of a file.

    Raises:
        ValueError: all that is wrong with them, after the `source`.
    """
    reader = Reader(pathlib.Path(source), {})
    found = reader.ranges(data)
    validation.raise_all(reader.problems, source)
    assert found is not None
    return found


def terms(data: Any, source: str) -> dict[str, Term]:
    """The terms that plain data describe, by their names, as arguments of `vary` in a file.

    Raises:
        ValueError: all that is wrong with them, after the `source`.
    """
    if not isinstance(data, dict):
        raise messages.error([problem(source.strip("`"), "terms_by_name", None, data)])
    reader = Reader(pathlib.Path(source), {})
    found = reader.arguments(Arena.vary, data, (), "vary")
    validation.raise_all(reader.problems, source)
    assert found is not None
    return found


@with_known_arguments
def save(path: str | os.PathLike, arena: Arena, ranges: ArenaRanges | None = None) -> None:
    """Writes an arena and ranges to a file that `load` reads. An existing file is replaced.

    Args:
        path: path of a `.yaml`, `.yml` or `.json` file, in a folder that exists.
        arena: arena built from files or MJCF text by the constructors and methods that `load` knows. Its current options are written. If
            its `spec` was edited in addition, the spec is written as MJCF with its assets, to the folder `<name>_spec` beside the file.
            Specs that were given to these calls, such as a robot's, are written to the folders `<name>_given0`, ...
        ranges: ranges to write. None: nothing varies.

    Raises:
        ValueError, TypeError: something cannot be written to such a file.
        OSError: the file cannot be written.
    """
    validation.check_path("path", path)
    file = pathlib.Path(path)
    check_suffix(file)
    validation.check_type("arena", arena, Arena, "an arena")
    if ranges is not None:
        validation.check_ranges_type(ranges)
    if not arena.calls:
        raise messages.error([problem("arena", "not_made")])
    ranges = ranges or ArenaRanges()
    arena.check_ranges(ranges)
    writer = Writer(file)
    data: dict[str, Any] = {"arena": writer.arena(arena.calls, ("arena",))}
    varying = {name: dist for name, dist in ranges._asdict().items() if dist is not None and name != "terms"}
    if varying or ranges.given_terms:
        data["ranges"] = {name: writer.named(calls.plain(dist), ("ranges", name)) for name, dist in varying.items()}
    if ranges.given_terms:
        at = ("ranges", "terms")
        terms = {name: writer.named(calls.plain(dist), (*at, name)) for name, dist in ranges.given_terms.items()}
        data["ranges"]["terms"] = terms
    if "ranges" in data:
        data["ranges"] = named(data["ranges"], arena)
    validation.raise_all(writer.problems, "`save`")
    given = {path: edited.files_of(spec) for path, spec in writer.specs.items()}
    with tempfile.TemporaryDirectory() as folder:
        there = {path: os.path.join(folder, path) for path in given}
        for path, files in given.items():
            edited.fill(pathlib.Path(there[path]).parent, files)
        _complete(data["arena"], arena, file, there)
    for path, files in given.items():
        edited.put((file.parent / path).parent, files)
    text = dump(data, file)
    with whole(file) as unfinished:
        unfinished.write_text(text, encoding="utf-8")


def _complete(data: dict[str, Any], arena: Arena, file: pathlib.Path, there: Mapping[str, str]) -> None:
    """Adds to the data of an arena what its calls do not make again: options, and an edited spec, which is written.

    Args:
        data: of the arena, as the file will have it.
        arena: that it is of.
        file: that is to be written.
        there: where the MJCF of the specs that the calls were given is now, by its path in the data.
    """
    again, own = _again(data, file, there), arena.own_spec()
    if options := specs.other_options(own.option, again.spec.option):
        data["options"] = options
        specs.assign(again.spec.option, **options)
    if _xml(again.own_spec()) == _xml(own) or (there and not mjcf.lost(arena.mj_model, again.mj_model)):
        return
    data.pop("options", None)  # it was edited, or a file has changed since
    data["spec"] = edited.path_beside(file).relative_to(file.parent).as_posix()
    if not edited.write(arena, _again(data | {"spec": None}, file, there), file):
        raise messages.error([problem("arena", "edited_past_mjcf")])


def _again(data: dict[str, Any], file: pathlib.Path, there: Mapping[str, str]) -> Arena:
    reader = Reader(file, {}, there)
    again = reader.arena(data, ("arena",))
    validation.raise_all(reader.problems, "`save`")
    assert again is not None
    return again


def _xml(spec: mujoco.MjSpec) -> str:
    spec.compile()
    return spec.to_xml()
