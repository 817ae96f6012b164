"""A study's folder, in which it goes on where it was interrupted.

It holds ``study.json`` (what the study is) and ``runs.jsonl`` (one row per line, in the order in
which the runs ended). A row is on disk before the next run is waited for.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, Generic, TypeVar

import msgspec

from dualbend.errors import InputError, refusing, writing
from dualbend.files import locked_folder, write_all, write_whole
from dualbend.run.disk.output import uninterrupted

STUDY, RUNS = "study.json", "runs.jsonl"

Row = TypeVar("Row")


@dataclass(frozen=True, kw_only=True)
class StudyFolder(Generic[Row]):
    """A folder that one process at a time writes.

    ``study``: what it is of; ``files``: texts to write into a new one; ``row``: what a line of
    ``runs.jsonl`` holds.
    """

    folder: Path
    row: type[Row]
    study: Mapping[str, Any]
    files: Mapping[str, str] = field(default_factory=dict)

    @contextmanager
    def opened(self) -> Iterator[tuple[list[Row], Callable[[Row], None]]]:
        """Make the folder or go on with it; give the rows that it has and what adds one.

        Raises InputError where it holds another study, is in use or cannot be used, or a line is
        no row.
        """
        with locked_folder(self.folder):
            with writing(self.folder, "--out"):
                self._make()
                rows = self._read()
                file = (self.folder / RUNS).open("ab", buffering=0)
            with file:
                yield rows, lambda row: self._append(file, row)

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
            write_whole(self.folder / file, text)
        write_whole(path, json.dumps(self.study, indent=2) + "\n")

    def _refuse_other(self, found: object) -> None:
        for key, value in self.study.items():
            other = found.get(key) if isinstance(found, dict) else None
            if other != value:
                short = not any(isinstance(v, str) and "\n" in v for v in (value, other))
                change = f" ({key} = {other!r}, now {value!r})" if short else ""
                raise InputError(
                    f"--out {self.folder}: holds a study of another {key}{change}; "
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
            with refusing(f"{path}: line {number} is no run", msgspec.DecodeError):
                rows.append(msgspec.json.decode(text, type=self.row))
        return rows

    def _append(self, file: IO[bytes], row: Row) -> None:
        """Write a row to the disk; InputError where that is full, say."""
        with uninterrupted(), writing(self.folder / RUNS, "--out"):
            write_all(file, msgspec.json.encode(row) + b"\n")
            os.fsync(file.fileno())
