"""The recording of a series of sheets: every sheet on one timeline."""

from pathlib import Path

import numpy as np
import pytest
import rerun as rr

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.recording.learning import SheetSeries, write_sheets_recording
from dualbend.types import Vector

TIMES = 1.0 + COMMAND_PERIOD_S * np.arange(5)


def sheets(count: int) -> list[SheetSeries]:
    return [
        SheetSeries(
            name=f"sheet {i + 1}",
            time_s=TIMES,
            moment_nm=np.linspace(0.0, 0.5 / (i + 1), 5),
            correction_rad=np.array([np.full(40, 0.01 * i), np.full(40, -0.02 * i)]),
        )
        for i in range(count)
    ]


def read(path: Path) -> dict[str, tuple[str, Vector, Vector]]:
    """Return name, times [s] and values of every series, by entity."""
    names: dict[str, str] = {}
    values: dict[str, tuple[Vector, Vector]] = {}
    for chunk in rr.chunk.RrdReader(path).stream():
        batch, entity = chunk.to_record_batch(), str(chunk.entity_path)
        if chunk.is_static and "SeriesLines:names" in batch.schema.names:
            names[entity] = batch.column("SeriesLines:names")[0].as_py()[0]
        elif not chunk.is_static:
            times = batch.column("sim_time").to_numpy().astype(np.int64) / 1e9
            values[entity] = times, np.ravel(batch.column("Scalars:scalars").to_pylist())
    return {entity: (name, *values[entity]) for entity, name in names.items()}


@pytest.mark.parametrize("count", [1, 3])
def test_every_sheet_has_its_moment_and_both_corrections(count: int, tmp_path: Path) -> None:
    path = tmp_path / "sheets.rrd"
    write_sheets_recording(sheets(count), "learned", path, COMMAND_PERIOD_S)
    found = read(path)
    assert len(found) == 3 * count
    for i, sheet in enumerate(sheets(count)):
        name, times, moment = found[f"/moment/sheet-{i + 1}"]
        assert name == f"sheet {i + 1} [mN m]"
        assert times == pytest.approx(sheet.time_s)
        assert moment == pytest.approx(1e3 * sheet.moment_nm)
        for side, turn in zip(("left", "right"), sheet.correction_rad, strict=True):
            name, times, correction = found[f"/correction/{side}/sheet-{i + 1}"]
            assert name == f"sheet {i + 1} [mrad]"
            assert times == pytest.approx(COMMAND_PERIOD_S * np.arange(40))
            assert correction == pytest.approx(1e3 * turn)


def test_a_folder_that_is_none_is_no_place_for_it(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="none"):
        write_sheets_recording(
            sheets(1), "learned", tmp_path / "none" / "sheets.rrd", COMMAND_PERIOD_S
        )
