"""Paths of the files that describe arenas (host); imports nothing heavy."""

import difflib
import os
import pathlib

EXAMPLES = pathlib.Path(__file__).parents[1] / "examples"
SUFFIXES = (".yaml", ".yml", ".json")
_SUFFIXES_SAID = ".yaml, .yml or .json"


def find(path: str | os.PathLike) -> pathlib.Path:
    """The file of a path or of an example's name."""
    if not isinstance(path, (str, os.PathLike)):
        raise _refused("must", path, TypeError, must="the path of a file or the name of an example")
    file = pathlib.Path(path)
    names = sorted(f.stem for f in EXAMPLES.glob("*.yaml"))
    if str(path) in names and not file.exists():
        return EXAMPLES / f"{path}.yaml"
    if file.is_dir():
        raise _refused("file_is_folder", str(file), suffixes=_SUFFIXES_SAID)
    if not file.exists():
        known = f"; examples: {', '.join(names)}" if file.name == str(path) and not file.suffix else ""
        beside = {f.stem: str(f) for f in sorted(file.parent.glob("*")) if f.suffix in SUFFIXES}
        meant = beside | {name: name for name in names if known}
        written = {name.lower(): path for name, path in reversed(meant.items())}  # the first of two counts
        close = difflib.get_close_matches(file.stem.lower(), written, n=1)
        hint = f" Did you mean {written[close[0]]}?" if close else ""
        raise FileNotFoundError(f"There is no file {str(file)!r}{known}.{hint}")
    if file.suffix == ".xml":
        raise _refused("file_is_mjcf", str(file), suffixes=_SUFFIXES_SAID, name=file.name)
    check_suffix(file)
    return file


def check_suffix(file: pathlib.Path) -> None:
    """Refuses a file that is neither YAML nor JSON."""
    if file.suffix not in SUFFIXES:
        raise _refused("file_suffix", str(file), suffixes=_SUFFIXES_SAID)


def _refused(rule: str, got: object, kind: type[Exception] = ValueError, **numbers: str) -> Exception:
    from mjx_arenas.problem import problem
    from mjx_arenas.problems.messages import error  # which imports JAX

    return error([problem("path", rule, None, got, numbers)], kind=kind)
