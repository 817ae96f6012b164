"""Two runs side by side, from the folders that they left."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
import rerun as rr

from dualbend.errors import InputError
from dualbend.report.compare import compare_runs, labels, report_text, write_comparison
from dualbend.run.disk.folder import run_folder
from dualbend.run.disk.output import write_numbers
from dualbend.run.disk.saved import load_run
from dualbend.run.record import RunRecord
from dualbend.scenario.load import load_scenario
from dualbend.task.bending.run import BendingRun

FOUR_PIECES = 'path={kind="pieces",pieces=4,end_rad=0.4}'
SHORT = ("path.end_rad=0.4", "motion.speed_rad_per_s=0.4", "motion.settle_s=0.1")


def leave(folder: Path, name: str, *settings: str) -> RunRecord:
    result = BendingRun(load_scenario(name, [*SHORT, *settings])).run()
    with run_folder(folder) as kept:
        write_numbers(result, kept)
    return result


PIECES = ("path.kind=pieces", "path.pieces=4")


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, RunRecord, RunRecord]:
    top = tmp_path_factory.mktemp("runs")
    return (
        top,
        leave(top / "one", "fig6"),
        leave(top / "other", "fig8", "motion.speed_rad_per_s=0.5", *PIECES),
    )


@pytest.fixture(scope="module")
def runs(results: tuple[Path, RunRecord, RunRecord]) -> tuple[RunRecord, RunRecord]:
    return load_run(results[0] / "one"), load_run(results[0] / "other")


def test_a_folder_gives_back_the_run(
    results: tuple[Path, RunRecord, RunRecord], runs: tuple[RunRecord, RunRecord]
) -> None:
    result, run = results[1], runs[0]
    assert run.scenario == result.scenario  # exact
    assert np.array_equal(run["left_true_moment_y"], result.trace["left_true_moment_y"])  # exact
    assert run.summary.metrics["peak_moment"].value == result.metrics["peak_moment"].value
    assert (run.phases, run.sensing_side) == (result.phases, "left")


def test_whose_compliance_it_was_is_compared(runs: tuple[RunRecord, RunRecord]) -> None:
    a, b = runs
    mine = replace(b, controller="mine.Still")
    assert "controller" not in compare_runs(a, b).settings
    found = next(iter(compare_runs(a, mine).settings.items()))
    assert found == ("controller", ("the scenario's own", "mine.Still"))


def test_metrics_are_put_side_by_side_with_their_change(runs: tuple[RunRecord, RunRecord]) -> None:
    rows = {row.name: row for row in compare_runs(*runs).metrics}
    peak = rows["peak_moment"]
    first, second = (run.summary.metrics["peak_moment"].value for run in runs)
    assert (peak.a, peak.b, peak.unit) == (first, second, "N m")
    assert isinstance(first, float)
    assert isinstance(second, float)
    assert peak.change == pytest.approx(second / first - 1.0, rel=1e-12)  # analytic
    assert rows["peak_deviation_x"].a == 0.0
    assert rows["peak_deviation_x"].change is None  # of nothing there is no share
    # The second run has four pieces, the first has two.
    assert rows["peak_moment_by_piece[3]"].a is None
    assert rows["peak_moment_by_piece[3]"].b is not None


def test_settings_that_differ_are_all_that_were_set_otherwise(
    runs: tuple[RunRecord, RunRecord],
) -> None:
    found = compare_runs(*runs).settings
    assert {name for name in found if not name.startswith("compliance.")} == {
        *("name", "motion.speed_rad_per_s", "path.kind", "path.interval_rad", "path.pieces")
    }
    assert found["motion.speed_rad_per_s"] == ("0.4", "0.5")
    assert found["path.pieces"] == ("-", "4")
    assert found["compliance.rotation.b"] == ("-", "0.5")


def test_a_run_against_itself_differs_in_nothing(runs: tuple[RunRecord, RunRecord]) -> None:
    found = compare_runs(runs[0], runs[0])
    assert found.settings == found.versions == {}
    assert {row.change for row in found.metrics} <= {0.0, None}
    assert "settings: the same" in report_text(found)
    assert found.labels == ("one (a)", "one (b)")


def test_runs_are_called_by_the_shortest_name_that_tells_them_apart(
    runs: tuple[RunRecord, RunRecord],
) -> None:
    assert labels(*runs) == ("one", "other")


def test_everything_is_written(runs: tuple[RunRecord, RunRecord], tmp_path: Path) -> None:
    found = compare_runs(*runs)
    write_comparison(*runs, found, tmp_path / "out")
    files = {path.name: path for path in (tmp_path / "out").iterdir()}
    assert set(files) == {"compare.txt", "compare.png", "compare.rrd"}
    assert files["compare.txt"].read_text() == report_text(found) + "\n"
    assert files["compare.png"].read_bytes().startswith(b"\x89PNG")


def test_the_recording_holds_both_runs_moments(
    runs: tuple[RunRecord, RunRecord], tmp_path: Path
) -> None:
    write_comparison(*runs, compare_runs(*runs), tmp_path)
    reader = rr.chunk.RrdReader(tmp_path / "compare.rrd")
    assert len(reader.recordings()) == len(reader.blueprints()) == 1
    batches = {
        str(chunk.entity_path): chunk.to_record_batch()
        for chunk in reader.stream()
        if not chunk.is_static
    }
    for run, entity in zip(runs, ("/moment/a", "/moment/b"), strict=True):
        batch = batches[entity]
        values = np.array(batch.column("Scalars:scalars").to_pylist())
        assert np.array_equal(values[:, 0], run["left_true_moment_y"])  # exact
        times = batch.column("sim_time").to_numpy().astype(np.int64)
        assert np.array_equal(times, np.rint(1e9 * run["time"]).astype(np.int64))
    assert {"/phase/a", "/phase/b", "/grips/a/left", "/grips/b/right"} <= set(batches)


def test_what_is_no_run_is_said(results: tuple[Path, RunRecord, RunRecord], tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nowhere: no such folder"):
        load_run(tmp_path / "nowhere")
    with pytest.raises(InputError, match=r"no folder of a run: there is no scenario\.toml, summ"):
        load_run(tmp_path)
    (tmp_path / "trace.arrow").write_bytes(b"")
    with pytest.raises(InputError, match="ended before it could write"):
        load_run(tmp_path)
    for name in ("scenario.toml", "summary.json", "trace.parquet"):
        (tmp_path / name).write_bytes((results[0] / "one" / name).read_bytes())
    assert load_run(tmp_path).summary.outcome == "completed"
    (tmp_path / "summary.json").write_text("{}")
    with pytest.raises(InputError, match=r"summary\.json: no summary of a run"):
        load_run(tmp_path)
    (tmp_path / "trace.parquet").write_text("")
    (tmp_path / "summary.json").write_bytes((results[0] / "one" / "summary.json").read_bytes())
    with pytest.raises(InputError, match=r"trace\.parquet: no trace of a run"):
        load_run(tmp_path)


def test_another_table_is_no_trace(
    results: tuple[Path, RunRecord, RunRecord], tmp_path: Path
) -> None:
    for name in ("scenario.toml", "summary.json"):
        (tmp_path / name).write_bytes((results[0] / "one" / name).read_bytes())
    table = pq.read_table(results[0] / "one" / "trace.parquet").select(["time", "sag"])
    pq.write_table(table, tmp_path / "trace.parquet")
    with pytest.raises(InputError, match="has no column phase, nominal_alpha"):
        load_run(tmp_path)


def test_a_scenario_that_is_not_understood_names_its_folder(
    results: tuple[Path, RunRecord, RunRecord], tmp_path: Path
) -> None:
    for name in ("summary.json", "trace.parquet"):
        (tmp_path / name).write_bytes((results[0] / "one" / name).read_bytes())
    (tmp_path / "scenario.toml").write_text('name = "x"\nspeed = 1\n')
    with pytest.raises(InputError, match="speed") as caught:
        load_run(tmp_path)
    assert str(caught.value).startswith(str(tmp_path))


def test_an_unwritable_folder_is_said(runs: tuple[RunRecord, RunRecord]) -> None:
    with pytest.raises(InputError, match="--out /proc/none: cannot be written"):
        write_comparison(*runs, compare_runs(*runs), Path("/proc/none"))
