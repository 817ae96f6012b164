"""A trace on disk: written while its run goes on, and read back."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import IO

import pyarrow as pa
import pyarrow.parquet as pq

from dualbend.errors import refusing
from dualbend.files import whole_file, write_all
from dualbend.run.trace import Trace


class TraceStream:
    """A trace on disk while its run goes on: what was written is there whatever ends the process.

    An Arrow stream, a batch every 36 rows; :func:`read_trace` reads it, finished or not.

    Parameters
    ----------
    path
        Says where; asked when there is a first batch, which replaces a file that is there.
    metadata
        Says what the stream says of its run; asked then, too.
    """

    _BATCH_ROWS = 36

    def __init__(self, path: Callable[[], Path], metadata: Callable[[], dict[str, str]]) -> None:
        self._path, self._metadata = path, metadata
        self._about: dict[str, str] = {}
        self._file: IO[bytes] | None = None
        self._written = 0

    def update(self, trace: Trace) -> None:
        """Write what is new, a batch at a time."""
        if trace.rows - self._written >= self._BATCH_ROWS:
            # A disk that is full does not end the run; when it has room again, nothing is missing.
            with suppress(OSError):
                self._append(trace)

    def close(self, trace: Trace | None) -> None:
        """Write the rest of a trace and stop; the file stays."""
        with suppress(OSError):
            if trace is not None and trace.rows > self._written:
                self._append(trace)
        if self._file is not None:
            self._file.close()

    def _append(self, trace: Trace) -> None:
        self._about = self._about or self._metadata()
        table = trace.table(self._about, self._written)
        batches = b"".join(batch.serialize().to_pybytes() for batch in table.to_batches())
        if self._file is None:
            # Unbuffered: what failed to be written is not tried again behind our back.
            with whole_file(self._path()) as part:
                file = part.open("wb", buffering=0)
                write_all(file, table.schema.serialize().to_pybytes() + batches)
            self._file = file
        else:
            whole = self._file.tell()
            try:
                write_all(self._file, batches)
            except OSError:
                self._file.seek(whole)
                self._file.truncate()
                raise
        self._written = trace.rows


def read_trace(path: Path) -> pa.Table:
    """Return a run's trace, Parquet or the stream that a killed run left.

    Raises
    ------
    InputError
        The file is neither, or is damaged.
    """
    with refusing(f"{path}: no trace of a run", *_DAMAGED):
        if path.suffix == ".parquet":
            with pq.ParquetFile(path) as file:
                return file.read()
        with path.open("rb") as file, pa.ipc.open_stream(file) as stream:
            return pa.Table.from_batches(_whole(stream), stream.schema)


def trace_head(path: Path) -> tuple[pa.Schema, int]:
    """Return the schema and the number of rows of a trace in Parquet, whose values stay unread.

    Raises InputError where it is none, or is damaged.
    """
    with refusing(f"{path}: no trace of a run", *_DAMAGED), pq.ParquetFile(path) as file:
        return file.schema_arrow, file.metadata.num_rows


def _whole(stream: pa.ipc.RecordBatchStreamReader) -> Iterator[pa.RecordBatch]:
    """Yield the batches of a stream whose last one may have been cut off."""
    try:
        yield from stream
    except _DAMAGED:
        return


_DAMAGED = (OSError, ValueError, MemoryError, pa.ArrowException)
"""What a damaged file can be to Arrow."""
