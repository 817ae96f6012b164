"""A sweep's table: one row per run, one column per key or metric, with their units as metadata."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from dualbend.errors import InputError, writing
from dualbend.evaluation.metrics import side_by_side, versions
from dualbend.files import whole_file
from dualbend.study.sweep.design import Design
from dualbend.study.sweep.file import Sweep
from dualbend.study.sweep.keys import known_keys
from dualbend.study.sweep.run import RunRow

TABLE = "table.parquet"
KEY, METRIC = "key", "metric"
"""What a column's metadata says that it is, under ``role``, beside its ``unit``."""

_FIRST = ("peak_moment", "rms_moment", "peak_force", "peak_pin_force", "worst_hole_offset")
"""Metrics that are shown where the sweep's file names none."""


def make_table(sweep: Sweep, design: Design, rows: Sequence[RunRow]) -> pa.Table:
    """Return the table: index, the keys, outcome, reason, every metric; null where there is none.

    A metric of each piece of the path is ``metric[0]``, ``metric[1]`` … Values that are neither
    numbers nor words are written as JSON.
    """
    columns = [("index", "", "index", pa.array([row.index for row in rows], pa.int64()))]
    for name, values in zip(design.names, zip(*design.rows, strict=True), strict=True):
        columns.append((name, key_unit(name), KEY, _typed(values)))
    if design.seeds:
        columns.append(("seed", "", "seed", pa.array(design.seeds, pa.int64())))
    for name in ("outcome", "reason"):
        texts = pa.array([getattr(row, name) for row in rows], pa.string())
        columns.append((name, "", name, texts))
    for (name, unit), found in side_by_side([row.metrics for row in rows]).items():
        columns.append((name, unit, METRIC, pa.array(found, pa.float64())))
    fields = [
        pa.field(name, array.type, metadata={"unit": unit, "role": role})
        for name, unit, role, array in columns
    ]
    about = {"sweep": sweep.name, "sample": sweep.sample.kind, "versions": versions()}
    schema = pa.schema(fields, metadata={"dualbend": json.dumps(about)})
    return pa.Table.from_arrays([array for *_, array in columns], schema=schema)


def write_table(table: pa.Table, folder: Path) -> None:
    """Write ``table.parquet``; the old one stays whole until the new one is."""
    path = folder / TABLE
    with writing(path), whole_file(path) as part:
        pq.write_table(table, part)


def key_unit(name: str) -> str:
    """Return a key's unit, "" where it has none."""
    found = known_keys().get(name)
    return "" if found is None else found.unit.removeprefix("-")


def unit_of(table: pa.Table, name: str) -> str:
    """Return a column's unit."""
    return str(table.schema.field(name).metadata[b"unit"].decode())


def shown_metrics(sweep: Sweep, table: pa.Table) -> list[str]:
    """Return the metrics that the sweep's file names, else a few; InputError where it has none."""
    have = [f.name for f in table.schema if f.metadata[b"role"] == METRIC.encode()]
    wanted = sweep.config.metrics
    for name in wanted:
        if have and name not in have:
            raise InputError(f"{sweep.source}: metrics = {name!r}: there are {', '.join(have)}")
    return [name for name in wanted or _FIRST if name in have]


def numbers(table: pa.Table, name: str) -> NDArray[np.float64]:
    """Return a column of numbers (runs,), NaN where there is none."""
    return np.asarray(table.column(name).to_numpy(), dtype=np.float64)


def _typed(values: Sequence[Any]) -> pa.Array:
    """Return a column of one kind: all are numbers, or words, or else JSON."""
    for kinds, arrow in (
        ((bool,), pa.bool_()),
        ((int,), pa.int64()),
        ((int, float), pa.float64()),
        ((str,), pa.string()),
    ):
        if all(type(value) in kinds for value in values):
            try:
                return pa.array(values, arrow)
            except (OverflowError, pa.ArrowInvalid):  # a whole number that is too long
                continue
    return pa.array([json.dumps(value, sort_keys=True) for value in values], pa.string())
