"""A study's folder, in which it goes on where it was interrupted.

It holds ``study.json`` (what the study is) and ``runs.jsonl`` (one row per line, in the order in
which the runs ended). A row is on disk before the next run is waited for.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, Generic, TypeVar

import msgspec

from dualbend.errors import InputError, refusing
from dualbend.run.output import prepare_folder, uninterrupted

STUDY, RUNS, LOCK = "study.json", "runs.jsonl", ".lock"

Row = TypeVar("Row")


@dataclass(frozen=True, kw_only=True)
class StudyFolder(Generic[Row]):
    """A folder that one process at a time writes.

    ``study``: what it is of; ``files``: texts to write into a new one; ``row``: what a line of
    ``runs.jsonl`` holds. ``name`` and ``row_name`` are what messages call study and row.
    """

    folder: Path
    row: type[Row]
    study: Mapping[str, Any]
    files: Mapping[str, str] = field(default_factory=dict)
    name: str = "study"
    row_name: str = "run"

    @contextmanager
    def opened(self) -> Iterator[tuple[list[Row], Callable[[Row], None]]]:
        """Make the folder or go on with it; give the rows that it has and what adds one.

        Raises
        ------
        InputError
            It holds another study, is in use or cannot be used, or a line is no row.
        """
        prepare_folder(self.folder)
        with self._locked():
            try:
                self._make()
                rows = self._read()
                file = (self.folder / RUNS).open("ab")
            except OSError as error:
                raise InputError(f"--out {self.folder}: {error.strerror or error}") from error
            with file:
                yield rows, lambda row: _append(file, row)

    def _make(self) -> None:
        path = self.folder / STUDY
        if path.exists():
            with refusing(f"{path}: no valid JSON", ValueError):
                found = json.loads(path.read_text(encoding="utf-8"))
            self._refuse_other(found)
            return
        if (self.folder / RUNS).exists():
            raise InputError(
                f"--out {self.folder}: has {RUNS} but no {STUDY}: whose runs are they?"
            )
        for file, text in self.files.items():
            (self.folder / file).write_text(text, encoding="utf-8")
        part = path.with_suffix(".part")
        part.write_text(json.dumps(self.study, indent=2) + "\n", encoding="utf-8")
        part.replace(path)

    def _refuse_other(self, found: object) -> None:
        for key, value in self.study.items():
            other = found.get(key) if isinstance(found, dict) else None
            if other != value:
                short = not any(isinstance(v, str) and "\n" in v for v in (value, other))
                change = f" ({key} = {other!r}, now {value!r})" if short else ""
                raise InputError(
                    f"--out {self.folder}: holds a {self.name} of another {key}{change}; "
                    "give another folder, or remove this one"
                )

    def _read(self) -> list[Row]:
        """Read the rows; cut off a last one that was not written to its end."""
        path = self.folder / RUNS
        if not path.exists():
            return []
        data = path.read_bytes()
        whole = data.rfind(b"\n") + 1
        if whole < len(data):
            os.truncate(path, whole)
        rows = []
        for number, text in enumerate(data[:whole].splitlines(), start=1):
            with refusing(f"{path}: line {number} is no {self.row_name}", msgspec.DecodeError):
                rows.append(msgspec.json.decode(text, type=self.row))
        return rows

    @contextmanager
    def _locked(self) -> Iterator[None]:
        """Keep other processes out; the system takes the lock back whatever ends this one."""
        with (self.folder / LOCK).open("ab") as file:
            try:
                _lock(file)
            except OSError as error:
                raise InputError(
                    f"--out {self.folder}: another process is writing to it; "
                    "wait for its end, or give another folder"
                ) from error
            yield


def _append(file: IO[bytes], row: object) -> None:
    with uninterrupted():
        file.write(msgspec.json.encode(row) + b"\n")
        file.flush()
        os.fsync(file.fileno())


if sys.platform == "win32":
    import msvcrt

    def _lock(file: IO[bytes]) -> None:
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)

else:
    import fcntl

    def _lock(file: IO[bytes]) -> None:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
