"""Files that are whole or not there (host)."""

import contextlib
import os
import pathlib
import shutil
import tempfile
from collections.abc import Iterator


@contextlib.contextmanager
def whole(path: pathlib.Path) -> Iterator[pathlib.Path]:
    """A path beside `path` to write a file or make a folder at, moved to `path` at the end, or removed if that fails.

    A file that is there is replaced; a folder only where it is empty.

    Raises:
        OSError: one sentence, if nothing can be written there.
    """
    if not path.parent.is_dir():
        raise FileNotFoundError(f"There is no folder {str(path.parent)!r} to write {path.name!r} in.")
    try:
        folder = pathlib.Path(tempfile.mkdtemp(prefix=f".{path.stem}.", dir=path.parent))
    except OSError as error:
        raise type(error)(f"Cannot write in folder {str(path.parent)!r}: {error.strerror}.") from None
    try:
        unfinished = folder / path.name
        yield unfinished
        try:
            os.replace(unfinished, path)
        except OSError as error:
            raise type(error)(f"Cannot write {str(path)!r}: {error.strerror}.") from None
    finally:
        shutil.rmtree(folder, ignore_errors=True)
