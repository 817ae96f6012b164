"""What the process of the command line has around it: its standard streams, and signals."""

from __future__ import annotations

import errno
import io
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from dualbend.interrupts import ENDING_SIGNALS, Interrupted


class _Output(io.FileIO):
    """A standard stream on which no write fails: what it once did not take is all it loses.

    A reader that went away, or a full disk, must not cost the results of a run.
    """

    problem: OSError | None = None

    def write(self, data: bytes, /) -> int:  # type: ignore[override]
        if self.problem is None:
            try:
                return super().write(data)
            except OSError as error:
                self.problem = error
        return len(data)


@contextmanager
def whole_streams() -> Iterator[_Output]:
    """Print to streams that are open and take every character; yield the standard output.

    A descriptor that the caller closed would else be given to the next file that is opened.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)
    before = sys.stdout, sys.stderr
    output = _Output(1, "wb", closefd=False)
    for name, raw in (("stdout", output), ("stderr", _Output(2, "wb", closefd=False))):
        # None where the descriptor was closed.
        encoding = getattr(getattr(sys, name), "encoding", "utf-8")
        setattr(sys, name, _text(raw, encoding))
    try:
        yield output
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        sys.stdout, sys.stderr = before


def _text(raw: _Output, encoding: str) -> io.TextIOWrapper:
    return io.TextIOWrapper(
        io.BufferedWriter(raw),  # type: ignore[type-var]
        encoding=encoding,
        errors="backslashreplace",
        line_buffering=raw.fileno() == 2 or raw.isatty(),
    )


def lost(output: _Output) -> str:
    """Return why not all of the output arrived; "" also where its reader has seen enough."""
    problem = output.problem
    if problem is None or problem.errno == errno.EPIPE:
        return ""
    return f"standard output: {problem.strerror}"


@contextmanager
def signals_raised() -> Iterator[list[int]]:
    """Raise Interrupted in the main thread for a signal that asks to end; yield those that came.

    A signal that the caller ignores, as ``nohup`` does, stays ignored. What comes later ends the
    process at once.
    """
    came: list[int] = []

    def end(number: int, _: FrameType | None) -> None:
        came.append(number)
        raise Interrupted(number)

    numbers = [
        number for number in ENDING_SIGNALS if signal.getsignal(number) is not signal.SIG_IGN
    ]
    try:
        for number in numbers:
            signal.signal(number, end)
        yield came
    finally:
        for number in numbers:
            signal.signal(number, signal.SIG_DFL)
