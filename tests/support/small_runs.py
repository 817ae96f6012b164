"""Runs of no study in particular, importable by a worker process that is to start quickly."""

import os
import signal
import time
from pathlib import Path
from typing import Any

import msgspec

CALLS = "DUALBEND_TEST_CALLS"
"""Environment variable: the file to which each run adds its line."""


class Row(msgspec.Struct, frozen=True):
    """What a run of no study in particular comes to."""

    index: int
    said: str = "done"


def plain(index: int) -> Row:
    called(index)
    return Row(index)


def called(index: int) -> None:
    if CALLS in os.environ:
        with Path(os.environ[CALLS]).open("a", encoding="utf-8") as file:
            file.write(f"{index} {os.environ.get('OMP_NUM_THREADS')}\n")


def slow(index: int) -> Row:
    time.sleep(0.0 if index < 2 else 60.0)
    return plain(index)


def deadly(index: int) -> Row:
    """Run 3 kills its process, whenever it is tried."""
    if index == 3:
        called(index)
        os._exit(1)
    return plain(index)


def unlucky(index: int) -> Row:
    """Run 1's process is killed once."""
    mark = Path(os.environ[CALLS]).with_suffix(".killed")
    if index == 1 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return plain(index)


def never(index: int, *_: object) -> Any:
    raise AssertionError(f"run {index} is done already")
