"""A study's folder, in which it goes on where it was interrupted.

It holds ``study.json`` (what the study is) and ``runs.jsonl`` (one row per line, in the order in
which the runs ended). A row is on disk before the next run is waited for.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, Generic, TypeVar

import msgspec

from dualbend.errors import InputError, refusing, writing
from dualbend.files import locked_folder, write_all, write_whole
from dualbend.interrupts import uninterrupted
from dualbend.run.reading.json_file import file_bytes, json_of, read_json

STUDY, RUNS = "study.json", "runs.jsonl"

_LONGEST = 200
"""Characters in which a change is said; that of a scenario's text is not."""

Row = TypeVar("Row")


@dataclass(frozen=True, kw_only=True)
class StudyFolder(Generic[Row]):
    """A folder that one process at a time writes.

    ``study``: what it is of; ``files``: texts to write into a new one; ``row``: what a line of
    ``runs.jsonl`` holds; ``check`` raises InputError where rows cannot be of this study.
    """

    folder: Path
    row: type[Row]
    study: Mapping[str, Any]
    files: Mapping[str, str] = field(default_factory=dict)
    check: Callable[[Sequence[Row]], None] = lambda _: None

    @contextmanager
    def opened(
        self, key: Callable[[Row], Hashable]
    ) -> Iterator[tuple[dict[Hashable, Row], Callable[[Row], None]]]:
        """Make the folder or go on with it; give the rows that it has, by key, and what adds one.

        Raises InputError where it holds another study, is in use or cannot be used, or a line is
        no row of it.
        """
        with locked_folder(self.folder):
            with writing(self.folder, "--out"):
                self._make()
                rows = self._read(key)
                file = (self.folder / RUNS).open("ab", buffering=0)
            with file:
                yield rows, lambda row: self._append(file, row)

    def _make(self) -> None:
        path = self.folder / STUDY
        if path.exists():
            self._refuse_other(read_json(path, dict[str, Any], "study"))
            return
        if (self.folder / RUNS).exists():
            raise InputError(
                f"--out {self.folder}: has {RUNS} but no {STUDY}: whose runs are they?"
            )
        for file, text in self.files.items():
            write_whole(self.folder / file, text)
        write_whole(path, json.dumps(self.study, indent=2) + "\n")

    def _refuse_other(self, found: Mapping[str, Any]) -> None:
        for key, value in self.study.items():
            if found.get(key) != value:
                files = " beside ".join((STUDY, *self.files))
                raise InputError(
                    f"--out {self.folder}: holds a study of another "
                    f"{key}{_change(key, found.get(key), value)}, by its {files}; "
                    "give another folder, or remove this one"
                )

    def _read(self, key: Callable[[Row], Hashable]) -> dict[Hashable, Row]:
        """Read the rows and check them; cut off a last one that was not written to its end."""
        path = self.folder / RUNS
        if not os.path.lexists(path):
            return {}
        data = file_bytes(path)
        *lines, rest = data.split(b"\n")
        rows: dict[Hashable, Row] = {}
        for number, text in enumerate(lines, start=1):
            said = f"{path}: line {number} is no run"
            fields = json_of(text, dict[str, Any], said)
            if (named := fields.pop("study", None)) != self.id:
                other = "names no study" if named is None else f"is of another one than {STUDY}"
                raise InputError(f"{said}: it {other}")
            with refusing(said, msgspec.ValidationError):
                row = msgspec.convert(fields, self.row)
            if key(row) in rows:
                raise InputError(f"{path}: line {number}: run {key(row)} is there twice")
            rows[key(row)] = row
        with refusing(str(path)):
            self.check(list(rows.values()))
        if rest and not rest.startswith(b"{"):
            raise InputError(f"{path}: line {len(lines) + 1} is no run, nor the beginning of one")
        if rest:
            os.truncate(path, len(data) - len(rest))
        return rows

    @property
    def id(self) -> str:
        """What the study is of, as every row names it."""
        return hashlib.sha256(json.dumps(self.study, sort_keys=True).encode()).hexdigest()[:16]

    def line(self, row: Row) -> bytes:
        """Return the line of a row in ``runs.jsonl``."""
        return msgspec.json.encode({"study": self.id, **msgspec.to_builtins(row)}) + b"\n"

    def _append(self, file: IO[bytes], row: Row) -> None:
        """Write a row to the disk; InputError where that is full, say."""
        with uninterrupted(), writing(self.folder / RUNS, "--out"):
            write_all(file, self.line(row))
            os.fsync(file.fileno())


def _change(key: str, old: object, new: object) -> str:
    """Return what changed, where that is short enough to be said; of tables, the first key."""
    if isinstance(old, dict) and isinstance(new, dict):
        name = next(name for name in {**new, **old} if old.get(name) != new.get(name))
        return _change(f"{key}.{name}", old.get(name), new.get(name))
    said = f" ({key} = {old!r}, now {new!r})"
    return said if len(said) <= _LONGEST else ""
