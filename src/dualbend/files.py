"""Files that are whole or not there, and folders that one process at a time writes."""

from __future__ import annotations

import errno
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from dualbend.errors import InputError, writing

LOCK = ".lock"

_RETRY_S = 0.01
_HELD = (errno.EWOULDBLOCK, errno.EACCES, errno.EDEADLK)
"""What a system says of a lock that another process has."""


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a path to write to; what is there afterwards takes the place of ``path`` in one step.

    Where the block fails, or the process is killed in it, ``path`` is what it was. What is no file,
    such as a pipe or ``/dev/stdout``, is written to directly. A link stays one.

    Raises OSError where the folder cannot be written to.
    """
    target = Path(os.path.realpath(path))  # of links in a circle `resolve` raises RuntimeError
    if target.exists() and not target.is_file():
        yield path
        return
    part = part_of(target)
    try:
        yield part
        part.replace(target)
    except BaseException:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        raise


def part_of(path: Path) -> Path:
    """Return what a file is written as; its ending stays, which tells some writers the format."""
    return path.with_name(f".part-{path.name}")


def write_whole(path: Path, content: str | bytes) -> None:
    """Write a text (UTF-8) or bytes as :func:`whole_file` does."""
    data = content.encode() if isinstance(content, str) else content
    with whole_file(path) as part:
        part.write_bytes(data)


def write_all(file: IO[bytes], data: bytes | memoryview) -> None:
    """Write bytes to an unbuffered file; OSError where not all of them could be."""
    left = memoryview(data)
    while left:
        left = left[file.write(left) :]


@contextmanager
def locked_folder(folder: Path, option: str = "--out", *, wait_s: float = 0.0) -> Iterator[None]:
    """Make a folder and keep other processes out of it; ``option`` gave it, in messages.

    The system takes the lock back whatever ends the process. What is left empty is removed.

    Raises InputError where another process has the lock for longer than ``wait_s``, or the folder
    cannot be written to.
    """
    with writing(folder, option):
        made = _made(folder)
        file = _lock_file(folder, option, time.monotonic() + wait_s)
    try:
        yield
    finally:
        # Removed while it is locked: who opens it now finds that it is no longer the folder's.
        with suppress(OSError):
            (folder / LOCK).unlink()
        file.close()
        for empty in made:
            with suppress(OSError):
                empty.rmdir()


def _made(folder: Path) -> list[Path]:
    """Make a folder; return it and those above it that were not there."""
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    return missing


def _lock_file(folder: Path, option: str, until: float) -> IO[bytes]:
    path = folder / LOCK
    while True:
        file = path.open("ab")
        try:
            _lock(file)
        except OSError as error:
            if error.errno not in _HELD:
                return file  # a file system without locks
            file.close()
            if time.monotonic() >= until:
                raise InputError(
                    f"{option} {folder}: another process is writing to it; "
                    "wait for its end, or give another folder"
                ) from error
            time.sleep(_RETRY_S)
        else:
            if _is_at(file, path):
                return file
            file.close()


def _is_at(file: IO[bytes], path: Path) -> bool:
    """Tell whether an open file is still the one of that name."""
    try:
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except FileNotFoundError:
        return False


if sys.platform == "win32":
    import msvcrt

    def _lock(file: IO[bytes]) -> None:
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)

else:
    import fcntl

    def _lock(file: IO[bytes]) -> None:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
