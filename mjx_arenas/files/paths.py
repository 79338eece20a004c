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
        raise TypeError(f"`path` must be the path of a file or the name of an example, got {path!r}.")
    file = pathlib.Path(path)
    names = sorted(f.stem for f in EXAMPLES.glob("*.yaml"))
    if str(path) in names and not file.exists():
        return EXAMPLES / f"{path}.yaml"
    if file.is_dir():
        raise ValueError(f"{str(file)!r} is a folder: give a {_SUFFIXES_SAID} file.")
    if not file.exists():
        known = f"; examples: {', '.join(names)}" if file.name == str(path) and not file.suffix else ""
        beside = {f.stem: str(f) for f in sorted(file.parent.glob("*")) if f.suffix in SUFFIXES}
        meant = beside | {name: name for name in names if known}
        written = {name.lower(): path for name, path in reversed(meant.items())}  # the first of two counts
        close = difflib.get_close_matches(file.stem.lower(), written, n=1)
        hint = f" Did you mean {written[close[0]]}?" if close else ""
        raise FileNotFoundError(f"There is no file {str(file)!r}{known}.{hint}")
    if file.suffix == ".xml":
        shown = f"a file shows an MJCF as `arena: {{type: Arena.from_xml, xml: {file.name}}}`"
        raise ValueError(f"{str(file)!r} must end in {_SUFFIXES_SAID}: {shown}.")
    check_suffix(file)
    return file


def check_suffix(file: pathlib.Path) -> None:
    """Refuses a file that is neither YAML nor JSON."""
    if file.suffix not in SUFFIXES:
        raise ValueError(f"{str(file)!r} must end in {_SUFFIXES_SAID}.")
