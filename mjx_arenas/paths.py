"""Paths of files that are read and written (host); imports nothing heavy."""

import contextlib
import os
import pathlib
import tempfile
from collections.abc import Iterator

EXAMPLES = pathlib.Path(__file__).parent / "examples"
SUFFIXES = (".yaml", ".yml", ".json")


def find(path: str | os.PathLike) -> pathlib.Path:
    """The file of a path or of an example's name."""
    if not isinstance(path, (str, os.PathLike)):
        raise TypeError(f"`path` must be the path of a file or the name of an example, got {path!r}.")
    file = pathlib.Path(path)
    names = sorted(f.stem for f in EXAMPLES.glob("*.yaml"))
    if str(path) in names and not file.exists():
        return EXAMPLES / f"{path}.yaml"
    if file.is_dir():
        raise ValueError(f"{str(file)!r} is a folder: give a {', '.join(SUFFIXES[:-1])} or {SUFFIXES[-1]} file.")
    if not file.exists():
        known = f"; examples: {', '.join(names)}" if file.name == str(path) and not file.suffix else ""
        raise FileNotFoundError(f"There is no file {str(file)!r}{known}.")
    check_suffix(file)
    return file


@contextlib.contextmanager
def replacing(path: str | os.PathLike) -> Iterator[pathlib.Path]:
    """A path beside `path`, with its suffix, for a file that takes its place when it is whole.

    Raises:
        OSError: one sentence, if the folder is not there or cannot be written to.
    """
    file = pathlib.Path(path)
    if file.is_dir():
        raise IsADirectoryError(f"{str(file)!r} is a folder: give the path of a file.")
    try:
        handle, name = tempfile.mkstemp(file.suffix, f".{file.stem}.", file.parent)
    except OSError as error:
        raise type(error)(f"Cannot write {str(file)!r}: {error.strerror}.") from None
    os.close(handle)
    temporary = pathlib.Path(name)
    try:
        yield temporary
        temporary.chmod(0o666 & ~_umask())
        temporary.replace(file)
    finally:
        temporary.unlink(missing_ok=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def check_suffix(file: pathlib.Path) -> None:
    """Refuses a file that is neither YAML nor JSON."""
    if file.suffix not in SUFFIXES:
        raise ValueError(f"{str(file)!r} must end in {', '.join(SUFFIXES[:-1])} or {SUFFIXES[-1]}.")
