"""The trace of a batch: some cycles of all worlds in memory, those before in a temporary file."""

from __future__ import annotations

import errno
import os
import shutil
import tempfile
import weakref
from io import BytesIO
from typing import IO

import numpy as np

from dualbend.errors import refusing
from dualbend.files import write_all
from dualbend.run.trace import TraceRecorder

_ROWS, _LEAST = 2560, 16
"""Rows in memory: of all worlds, 4 MB of `fig8`, a batch that has no more needs no file; of one
world at least, which is read back in pieces of so many."""


def room(worlds: int) -> int:
    """Return how many cycles of a batch are held in memory."""
    return max(_ROWS // worlds, _LEAST)


class TraceFile:
    """The rows of a batch's trace (n worlds) that there is no more room for in memory.

    The file is gone with this and with its process, however that ends. ``cycles``: rows that there
    will be, at most. Raises InputError, also where more is written, where the temporary folder
    cannot hold them.
    """

    def __init__(self, trace: TraceRecorder, cycles: int) -> None:
        self._trace, self._blocks = trace, 0
        self._file: IO[bytes] = BytesIO()
        size = trace.kept.nbytes * ((cycles - 1) // trace.room)
        if size:
            with refusing("the traces of a batch", OSError):
                folder = tempfile.gettempdir()
            self._said = (
                f"temporary folder {folder}: cannot hold the traces of {len(trace.kept)} runs, "
                f"{1e-6 * size:.0f} MB; set TMPDIR to another folder, or make smaller batches"
            )
            with refusing(self._said, OSError):
                if shutil.disk_usage(folder).free < size:
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
                # Unbuffered: what failed to be written is not tried again behind our back.
                self._file = tempfile.TemporaryFile(buffering=0, dir=folder)  # noqa: SIM115
        self.close = weakref.finalize(self, self._file.close)

    def make_room(self) -> None:
        """Let another row of the trace begin: what is in memory is written where it is full."""
        trace = self._trace
        if trace.rows == (self._blocks + 1) * trace.room:
            with refusing(self._said, OSError):
                self._file.seek(self._blocks * trace.kept.nbytes)
                write_all(self._file, trace.kept.data.cast("B"))
            self._blocks += 1

    def read(self, world: int, own: TraceRecorder) -> None:
        """Fill the trace of one world by itself, which has room for the rows that are wanted."""
        of_all = self._trace.kept
        for block, first in enumerate(range(0, own.room, self._trace.room)):
            rows = own.kept[first : first + self._trace.room]
            if block == self._blocks:
                rows[:] = of_all[world, : len(rows)]
            else:
                self._file.seek(block * of_all.nbytes + world * of_all[world].nbytes)
                rows[:] = np.frombuffer(self._file.read(rows.nbytes)).reshape(rows.shape)
        own.rows = own.room
