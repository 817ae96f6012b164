"""How far a sweep is, and how long it will still take."""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Callable
from typing import Protocol, TextIO

_EVERY_S = 30.0
"""Where there is no terminal, a line this often: a log is not to be flooded."""


class Row(Protocol):
    """The row of a study's run, as far as its progress is told."""

    @property
    def outcome(self) -> str:
        """How the run ended."""


class Progress:
    """Writes one line that changes on a terminal, or a line now and then into a log.

    ``stream``: where to, standard error if None; ``clock``: seconds that never run backwards.
    """

    def __init__(
        self, stream: TextIO | None = None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._clock = clock
        self._ended: Counter[str] = Counter()
        self._before = self.done = self.total = 0
        self._began = self._told = clock()
        self._width = 0

    def __call__(self, done: int, total: int, row: Row | None) -> None:
        """Take note of the last run's row; there is none at the start."""
        self.done, self.total = done, total
        if row is not None:
            self._ended[row.outcome] += 1
        else:
            self._before, self._began = done, self._clock()
        last = done == total
        if self._stream.isatty():
            text = self.text()
            self._stream.write(f"\r{text:<{self._width}}" + ("\n" if last else ""))
            self._width = len(text)
        elif last or row is None or self._clock() - self._told >= _EVERY_S:
            self._stream.write(self.text() + "\n")
            self._told = self._clock()
        self._stream.flush()

    def text(self) -> str:
        """Return the runs that are done, those that did not complete, and the time left.

        Estimated from the mean time between the ends of runs since the start: runs of other length
        that come later make it wrong.
        """
        parts = [f"{self.done}/{self.total} runs"]
        parts += [f"{n} {what}" for what, n in self._ended.items() if what != "completed"]
        now = self.done - self._before
        if now and self.done < self.total:
            each = (self._clock() - self._began) / now
            parts.append(f"about {duration(each * (self.total - self.done))} left")
        return ", ".join(parts)

    def end_line(self) -> None:
        """End a terminal's line where the sweep ends early."""
        if self._stream.isatty() and self.done < self.total:
            self._stream.write("\n")


def duration(seconds: float) -> str:
    """Return a time as a person says it: 45 s, 3 min 20 s, 2 h 5 min."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"
