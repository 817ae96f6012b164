"""A run's folder: it holds one whole run or none, whatever ends the process that writes it.

While a run goes on its log is in ``unfinished/``, and so are its numbers while they are written. A
file ``complete`` beside them says, in one step, that they are; then they take the place of an
earlier run's, and whoever uses the folder next goes on with that where a process ended meanwhile.
Pictures and recording are drawn from numbers that are safe. Other files in the folder stay.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from dualbend.errors import InputError, writing
from dualbend.files import locked_folder, part_of, write_whole
from dualbend.run.disk.stream import TraceStream
from dualbend.run.loop import Run

NUMBERS = ("scenario.toml", "summary.json", "trace.parquet")
"""What makes a folder a run; pictures and recording are made from these."""

PICTURES = ("moment.png", "run.rrd")
LOG = "trace.arrow"
UNFINISHED = "unfinished"
_COMPLETE = "complete"

_OTHERS_WAIT_S = 5.0
"""How long a reader waits for the process that moves numbers: it has milliseconds of work."""


class RunFolder:
    """A run's folder while one process has it for itself: see :func:`run_folder`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @property
    def unfinished(self) -> Path:
        """The folder of what is not complete, made if need be."""
        path = self.folder / UNFINISHED
        path.mkdir(exist_ok=True)
        return path

    @property
    def whole(self) -> bool:
        """There is a whole run in it."""
        return _is_whole(self.folder)

    def said_of_log(self) -> str:
        """Return what there is of a run that left no result, in words."""
        earlier = f"the earlier run in {self.folder} is as it was; " if self.whole else ""
        log = self.folder / UNFINISHED
        there = (log / LOG).is_file()
        return earlier + (f"dualbend report {log} shows this one" if there else "nothing was kept")

    @contextmanager
    def log(self, run: Run) -> Iterator[Callable[[], None]]:
        """Give what is to be called every cycle so that a killed run leaves ``trace.arrow``.

        A log that was there is replaced by the first second of the new one.
        """
        stream = TraceStream(lambda: self.unfinished / LOG, lambda: _about(run))
        try:
            yield lambda: stream.update(run.trace)
        finally:
            stream.close(run.trace if hasattr(run, "trace") else None)

    def swap_in(self) -> None:
        """Put the numbers that are in ``unfinished`` in the place of an earlier run's.

        Raises OSError where that cannot be; then the earlier run is whole, or the next reader goes
        on.
        """
        for name in NUMBERS:
            _to_disk(self.unfinished / name)
        write_whole(self.unfinished / _COMPLETE, "")
        _move(self.folder)


@contextmanager
def run_folder(folder: Path | str) -> Iterator[RunFolder]:
    """Give a folder, made if need be, that no other process writes meanwhile.

    Raises InputError where another process has it, or it cannot be written to.
    """
    folder = Path(folder)
    with locked_folder(folder):
        with writing(folder, "--out"):
            if (folder / UNFINISHED / _COMPLETE).exists():
                _move(folder)
        _refuse_strangers(folder)
        yield RunFolder(folder)


def _refuse_strangers(folder: Path) -> None:
    """Refuse a folder in which something else has a name that a run needs."""
    for name in (*NUMBERS, *PICTURES, LOG):
        if (folder / name).is_dir():
            raise InputError(f"--out {folder}: {name} is a folder there; move it, or give another")
    if (folder / UNFINISHED).is_file():
        raise InputError(f"--out {folder}: {UNFINISHED} is a file there; move it, or give another")


def settle(folder: Path) -> None:
    """Go on where a process ended while numbers took their place; before a folder is read."""
    with suppress(OSError, InputError):
        if (folder / UNFINISHED / _COMPLETE).exists():
            with locked_folder(folder, wait_s=_OTHERS_WAIT_S):
                if (folder / UNFINISHED / _COMPLETE).exists():
                    _move(folder)


def later_log(folder: Path) -> Path | None:
    """Return the folder of a later run that did not end, if there is one beside a whole run."""
    there = folder / UNFINISHED
    return there if (there / LOG).is_file() and _is_whole(folder) else None


def _is_whole(folder: Path) -> bool:
    return all((folder / name).is_file() for name in NUMBERS)


def _move(folder: Path) -> None:
    """Move complete numbers from ``unfinished`` into the folder; every step may be done already."""
    unfinished = folder / UNFINISHED
    # An earlier run's must not be taken for the new one's; so must no log of version 0.1.0.
    for path in (folder / name for name in (*PICTURES, LOG)):
        path.unlink(missing_ok=True)
        part_of(path).unlink(missing_ok=True)
    for name in NUMBERS:
        if (unfinished / name).exists():
            (unfinished / name).replace(folder / name)
    # The mark last: until then all of this is done again.
    for path in (unfinished / name for name in (*PICTURES, LOG, _COMPLETE)):
        path.unlink(missing_ok=True)
        part_of(path).unlink(missing_ok=True)
    with suppress(OSError):  # of the user's own
        unfinished.rmdir()


def _to_disk(path: Path) -> None:
    with path.open("rb+") as file:
        os.fsync(file.fileno())


def _about(run: Run) -> dict[str, str]:
    scenario = run.scenario
    return {
        **run.identity.to_metadata(),
        "scenario": scenario.name,
        "outcome": "unknown",
        "scenario_toml": scenario.to_toml(),
    }
