"""Files that are whole or not there (host)."""

import contextlib
import errno
import os
import pathlib
import shutil
import tempfile
import threading
from collections.abc import Callable, Iterator

_beginning, _swapping = threading.Lock(), threading.Lock()
_unfinished: set[pathlib.Path] = set()


@contextlib.contextmanager
def whole(path: pathlib.Path, over: Callable[[pathlib.Path], bool] = lambda _: False) -> Iterator[pathlib.Path]:
    """A path beside `path` to write a file or make a folder at, moved to `path` at the end, or removed if that fails.

    A file that is there, or that a link there leads to, is replaced; a folder only where it is empty, or `over`, asked at
    the end, says so of it. What is there stays until then, and comes back if the new cannot be moved there.

    Raises:
        OSError: one sentence, if nothing can be written there.
    """
    if path.is_symlink():
        path = path.resolve()
    if not path.parent.is_dir():
        for part in path.parents:
            if part.is_file():
                raise _in_file(path, part)
        raise FileNotFoundError(f"There is no folder {str(path.parent)!r} to write {path.name!r} in.")
    try:
        with _beginning:
            folder = pathlib.Path(tempfile.mkdtemp(prefix=f".{path.stem[:40]}.", dir=path.parent))
            _unfinished.add(folder)
    except OSError as error:
        raise _unwritable(path.parent, error) from None
    try:
        unfinished = folder / path.name
        try:
            yield unfinished
        except OSError as error:  # a full disk, say
            raise _unwritten(path, error, OSError) from None
        try:
            if over(path):
                _swap(path, unfinished, folder.with_name(f"{folder.name}.old"))
            else:
                os.replace(unfinished, path)
        except NotADirectoryError:  # a folder in a file's place
            raise _in_file(path, path) from None
        except OSError as error:
            raise _unwritten(path, error, type(error)) from None
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        _unfinished.discard(folder)


def _swap(path: pathlib.Path, new: pathlib.Path, old: pathlib.Path) -> None:
    """Moves a folder to where another one is, which goes; that is never without a name of its own, `path` or `old`."""
    with _swapping:
        try:
            os.replace(path, old)
            os.replace(new, path)
        except BaseException:
            if old.exists() and not path.exists():
                os.replace(old, path)
            raise
        _unfinished.add(old)
    shutil.rmtree(old, ignore_errors=True)
    _unfinished.discard(old)


def sync(*paths: pathlib.Path) -> None:
    """Has files and folders written to the disk."""
    for path in paths:
        opened = os.open(path, os.O_RDONLY)
        with contextlib.suppress(OSError):  # some file systems do not do it for folders
            os.fsync(opened)
        os.close(opened)


def check_folder(folder: pathlib.Path) -> None:
    """Tries whether anything can be written in a folder that exists; leaves nothing there.

    Raises:
        OSError: one sentence.
    """
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise _unwritable(folder, error) from None


def abandon() -> None:
    """Removes what is unfinished, while other threads still write it: for a process that is about to end.

    Nothing can be begun any more.
    """
    _beginning.acquire()
    _swapping.acquire()
    for folder in list(_unfinished):
        for _ in range(100):  # what is written meanwhile keeps a folder from going
            shutil.rmtree(folder, ignore_errors=True)
            if not folder.exists():
                break


def _unwritten(path: pathlib.Path, error: OSError, kind: type[OSError]) -> OSError:
    why = (error.strerror or str(error)).rstrip(".")
    if error.errno == errno.ENOTEMPTY:
        why = "the folder is there, with files in it: choose another one, or delete it"
    return kind(f"Cannot write {str(path)!r}: {why}.")


def _in_file(path: pathlib.Path, part: pathlib.Path) -> NotADirectoryError:
    return NotADirectoryError(f"Cannot write {str(path)!r}: {str(part)!r} is a file, not a folder.")


def _unwritable(folder: pathlib.Path, error: OSError) -> OSError:
    why = "" if isinstance(error, FileNotFoundError) else f": {error.strerror}"  # /proc says that it does not exist
    return type(error)(f"Nothing can be written in folder {str(folder)!r}{why}.")
