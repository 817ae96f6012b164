"""The committed table of the scan: one line a reading, with the date and versions that made it."""

from __future__ import annotations

import csv
import datetime
import importlib.metadata
import io
from collections.abc import Iterable, Sequence
from pathlib import Path

import msgspec

from dualbend.errors import InputError
from icra1995.reading import Reading
from icra1995.scan import ScanRow

COMMAND = "python docs/studies/icra1995 --scan"
TABLE = Path(__file__).with_name("scan.csv")
"""Beside the module, so that an installed package has it too."""

_KEYS = tuple(Reading.__struct_fields__)
_VALUES = tuple(name for name in ScanRow.__struct_fields__ if name != "reading")


class Simulated(msgspec.Struct, frozen=True, kw_only=True):
    """What full simulations show of a reading that the cheap model has judged.

    ``peak_nm``, ``exact_ratio``, ``worst_ratio``, ``mean_ratio`` as in ScanRow; ``ended``: outcome
    of Fig. 8's run; ``b_factor``: the first factor on B at which a run oscillates, 0: none does.
    """

    peak_nm: float
    exact_ratio: float
    worst_ratio: float
    mean_ratio: float
    ended: str
    b_factor: float


_SIMULATED = tuple(f"simulated_{name}" for name in Simulated.__struct_fields__)


class Table(msgspec.Struct, frozen=True, kw_only=True):
    """The scan: when and by what, every judged reading, and the simulated ones among them."""

    made: str
    rows: tuple[ScanRow, ...]
    simulated: dict[Reading, Simulated]


def stamp() -> str:
    """Return date and versions that a table is marked with."""
    names = ("dualbend", "mujoco", "numpy", "scipy")
    versions = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in names)
    return f"{datetime.datetime.now(datetime.UTC).date().isoformat()}, {versions}"


def to_csv(rows: Sequence[ScanRow], simulated: dict[Reading, Simulated], made: str) -> str:
    """Return the table as text; numbers to four digits."""
    out = io.StringIO()
    out.write(f"# {made}\n")
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([*_KEYS, *_VALUES, *_SIMULATED])
    for row in rows:
        ran = simulated.get(row.reading)
        writer.writerow(
            _texts(getattr(row.reading, name) for name in _KEYS)
            + _texts(getattr(row, name) for name in _VALUES)
            + (
                [""] * len(_SIMULATED)
                if ran is None
                else _texts(getattr(ran, name) for name in Simulated.__struct_fields__)
            )
        )
    return out.getvalue()


def _texts(values: Iterable[object]) -> list[str]:
    return [f"{v:.4g}" if isinstance(v, float) else str(v) for v in values]


def read_table(path: Path = TABLE) -> Table:
    """Read a table; InputError where there is none or it is no table of a scan."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise InputError(
            f"{path}: {error.strerror or error}; python docs/studies/icra1995 --scan"
        ) from error
    if len(lines) < 3 or not lines[0].startswith("# "):
        raise InputError(
            f"{path}: no table of a scan; make one with python docs/studies/icra1995 --scan"
        )
    rows: list[ScanRow] = []
    simulated: dict[Reading, Simulated] = {}
    for number, line in enumerate(csv.DictReader(lines[1:]), start=3):
        try:
            reading = msgspec.convert({key: line[key] for key in _KEYS}, Reading, strict=False)
            numbers = {key: line[key] for key in _VALUES}
            rows.append(
                msgspec.convert(
                    {key: float(value) for key, value in numbers.items()} | {"reading": reading},
                    ScanRow,
                )
            )
            if line[_SIMULATED[0]]:
                names = Simulated.__struct_fields__
                given = dict(zip(names, (line[key] for key in _SIMULATED), strict=True))
                simulated[reading] = msgspec.convert(given, Simulated, strict=False)
        except (KeyError, ValueError, TypeError) as error:
            raise InputError(f"{path}:{number}: {error}") from error
    return Table(made=lines[0][2:], rows=tuple(rows), simulated=simulated)
