"""A run that is read is believed only where its files agree; else the file and the field are named.

Exact, all of them: a folder is read, or it is refused with this message.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

from dualbend.arm.catalog import JOINT_COUNT
from dualbend.arm.pair import arm_joints
from dualbend.cli import main
from dualbend.control.guard import Guard
from dualbend.errors import InputError
from dualbend.run.arms import arm_pair
from dualbend.run.disk.saved import load_run
from dualbend.run.outcome import TaskStopped
from dualbend.run.reading.consistency import columns_of
from dualbend.run.reading.json_file import read_json
from dualbend.run.record import Metric
from dualbend.scenario.load import load_scenario
from dualbend.scene.cell import robots_only
from support.left_runs import copied, leave

BRIEF = (
    *("path.end_rad=0.2", "motion.speed_rad_per_s=1.0", "motion.settle_s=0.1"),
    *("motion.hold_s=0.1", "sheet.model.hinges=10"),
)
ROWS = 17
"""0.1 s of settling, 0.2 s of bending, 0.1 s of holding, in whole periods of 28 ms, and the end."""
OLD = ("scenario", "seed", "outcome", "model_sha256")
"""What the trace of version 0.1.0 says of its run."""

Change = Callable[[pa.Table], pa.Table]


@pytest.fixture(scope="module")
def top(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs")
    leave(folder / "one", "fig8", *BRIEF)
    leave(folder / "again", "fig8", *BRIEF)
    leave(folder / "seed", "fig8", *BRIEF, "seed=2")
    leave(folder / "stopped", "fig8", *BRIEF, until=9)
    leave(folder / "pwb", "pwb", until=20)
    return folder


@pytest.fixture
def one(top: Path, tmp_path: Path) -> Path:
    """A copy of a run, to be corrupted."""
    return copied(top / "one", tmp_path / "run")


def refused(folder: Path, file: str, words: str) -> None:
    """Assert that a run is refused, in one line that names the file and says these words."""
    with pytest.raises(InputError, match=words) as caught:
        load_run(folder, unfinished=True)
    assert file in str(caught.value)
    result = CliRunner().invoke(main, ["report", str(folder), "--out", str(folder / "x.html")])
    assert result.exit_code == 2
    assert isinstance(result.exception, SystemExit)
    assert len(result.stderr.splitlines()) == 1


def of_0_1_0(folder: Path, change: Change = lambda table: table) -> Path:
    """Make a run one of version 0.1.0, which says nowhere which run it is, its trace changed."""
    text = (folder / "scenario.toml").read_text()
    (folder / "scenario.toml").write_text(text.split("\n", 1)[1])
    raw = json.loads((folder / "summary.json").read_text())
    kept = {key: value for key, value in raw.items() if key not in ("run", "sha256")}
    (folder / "summary.json").write_text(json.dumps(kept))
    table = change(pq.read_table(folder / "trace.parquet"))
    about = json.loads(table.schema.metadata[b"dualbend"])
    said = {"dualbend": json.dumps({key: about[key] for key in OLD if key in about})}
    pq.write_table(table.replace_schema_metadata(said), folder / "trace.parquet")
    return folder


def column(name: str, change: Callable[[Any], Any], kind: Any = None) -> Change:
    """Return what replaces a column's values, and maybe their type."""

    def changed(table: pa.Table) -> pa.Table:
        at = table.column_names.index(name)
        values = pa.array(change(table.column(at).to_numpy().copy()), kind)
        field = pa.field(name, values.type, metadata=table.schema.field(at).metadata)
        return table.set_column(at, field, values)

    return changed


def at(row: int, value: float) -> Callable[[Any], Any]:
    def changed(values: Any) -> Any:
        values[row] = value
        return values

    return changed


def summary(folder: Path, change: Callable[[dict[str, Any]], None]) -> None:
    raw = json.loads((folder / "summary.json").read_text())
    change(raw)
    (folder / "summary.json").write_text(json.dumps(raw))


# -- what agrees is read -------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["one", "stopped", "pwb"])
def test_what_was_written_is_read_back(top: Path, tmp_path: Path, name: str) -> None:
    run = load_run(top / name)
    assert run.identity is not None
    old = load_run(of_0_1_0(copied(top / name, tmp_path / "old")))
    assert old.identity is None
    assert old.trace.equals(run.trace)
    assert old.summary == msgspec.structs.replace(run.summary, run=None)
    assert run.trace.rows == {"one": ROWS, "stopped": 9, "pwb": 20}[name]


@pytest.mark.parametrize("arm", JOINT_COUNT)
def test_the_columns_of_a_run_are_known_without_it(arm: str) -> None:
    """Analytic: names of the joints in the compiled scene, for every arm, in work it can do."""
    near = ["path.end_rad=0.2", "sheet.length_m=0.2"]
    scenario = load_scenario("fig6", [f"robot.model={arm}", *near])
    wanted = arm_joints(robots_only(arm_pair(scenario)).compile())
    found = [name.replace("_q_", "_") for name, _ in columns_of(scenario)["q"]]
    assert found == list(wanted)


def test_a_row_that_was_not_completed_is_one_of_a_run_that_stopped(
    top: Path, tmp_path: Path
) -> None:
    """The controller's columns of the last row may be missing, and of no other, and no others."""
    stopped = copied(top / "stopped", tmp_path / "stopped")
    assert load_run(of_0_1_0(stopped, column("left_command_x", at(-1, np.nan)))).trace.rows == 9
    for name, change in (("left_command_x", at(3, np.nan)), ("left_grip_x", at(-1, np.nan))):
        folder = of_0_1_0(copied(top / "stopped", tmp_path / name), column(name, change))
        refused(folder, "trace.parquet", f"column '{name}', row .*: nan: no value of a run")
    whole = of_0_1_0(copied(top / "one", tmp_path / "whole"), column("wall_s", at(-1, np.nan)))
    refused(whole, "trace.parquet", "column 'wall_s', row 16: nan")


def test_a_tasks_own_columns_may_begin_late_or_never(top: Path, tmp_path: Path) -> None:
    """All of them together, as they are written: or they are no task's."""

    def missing(*where: slice) -> Change:
        def changed(table: pa.Table) -> pa.Table:
            for name in columns_of(load_run(top / "pwb").scenario)["task"]:
                for rows in where:
                    table = column(name[0], at(rows, np.nan))(table)  # type: ignore[arg-type]
            return table

        return changed

    late = of_0_1_0(copied(top / "pwb", tmp_path / "late"), missing(slice(0, 2)))
    assert np.isnan(load_run(late)["sheet"]).sum() == 2
    unknown = column("net_force_x", lambda values: values + np.nan)
    never = of_0_1_0(copied(top / "pwb", tmp_path / "never"), unknown)
    assert np.isnan(load_run(never)["net_force_x"]).all()
    for name, change in (
        ("between", missing(slice(5, 6))),
        ("alone", column("sheet", at(0, np.nan))),
    ):
        folder = of_0_1_0(copied(top / "pwb", tmp_path / name), change)
        refused(folder, "trace.parquet", "column '(sheet|attempt)', row .*: nan")


@pytest.mark.parametrize("name", ["fig8", "pwb"])
def test_a_run_that_ended_in_its_first_cycle_is_written_and_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """One row, without what the controller and the task add to it."""

    def stopping(*_: object) -> None:
        raise TaskStopped("made up")

    monkeypatch.setattr(Guard, "check", stopping)
    run = load_run(leave(tmp_path, name))
    assert (run.outcome, run.trace.rows, run.simulated_s) == ("aborted", 1, 0.0)
    result = CliRunner().invoke(main, ["report", str(tmp_path)])
    assert result.exit_code == 0, result.output


# -- the trace -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda table: table.slice(0, 0), "has no rows"),
        (lambda table: table.slice(1), "column 'time', row 0: 0.028: rows are a command period"),
        (lambda table: table.slice(0, 9), "simulated_time = .* trace.parquet has 9 rows"),
        (
            lambda table: pa.concat_tables([table] * 3),
            "has 51 rows; a run of scenario.toml has at most 35",
        ),
        (lambda table: table.remove_column(1), "has no column phase, which runs of scenario.toml"),
        (
            lambda table: table.append_column("bend_010", table.column(0)),
            "has a column bend_010, which no run of scenario.toml has",
        ),
        (
            lambda table: table.append_column(table.schema.field(0), table.column(0)),
            "has its columns twice, or in another order",
        ),
        (
            lambda table: table.select([1, 0, *range(2, table.num_columns)]),
            "has its columns twice, or in another order",
        ),
        (column("time", at(4, np.nan)), "column 'time', row 4: nan"),
        (column("time", at(4, 0.1121)), "column 'time', row 4: 0.1121: rows are a command"),
        (column("time", lambda t: t.astype(str)), "column 'time' holds string, not double"),
        (column("phase", np.int64), "column 'phase' holds int64, not double"),
        (column("phase", at(2, 99.0)), "row 2: 99: the phases are 0 settle, 1 bend, 2 hold"),
        (column("phase", at(2, 0.5)), "column 'phase', row 2: 0.5"),
        (column("bend_003", at(2, np.inf)), "column 'bend_003', row 2: inf: no value of a run"),
        (column("bend_003", at(2, 1e300)), r"column 'bend_003', row 2: 1e\+300: no value"),
        (lambda t: t.replace_schema_metadata({"dualbend": "{}"}), "is of a run with scenario None"),
    ],
)
def test_a_trace_that_no_run_leaves_is_refused(one: Path, change: Change, words: str) -> None:
    refused(of_0_1_0(one, change), "trace.parquet" if "simulated" not in words else "", words)


def test_another_number_of_hinges_is_refused(one: Path) -> None:
    of_0_1_0(one)
    text = (one / "scenario.toml").read_text()
    (one / "scenario.toml").write_text(text.replace("hinges = 10", "hinges = 14"))
    refused(one, "trace.parquet", "has no column bend_010, bend_011, bend_012 and 1 more")


def test_a_unit_that_is_not_the_columns_is_refused(one: Path) -> None:
    def in_mm(table: pa.Table) -> pa.Table:
        at = table.column_names.index("sag")
        return table.set_column(
            at, pa.field("sag", pa.float64(), metadata={"unit": "mm"}), table["sag"]
        )

    refused(of_0_1_0(one, in_mm), "trace.parquet", "column 'sag' is in 'mm', not in 'm'")


def test_a_value_that_was_changed_after_the_run_is_refused(one: Path) -> None:
    """Of a run that says what it holds; a value as good as any other, which no law contradicts."""
    table = pq.read_table(one / "trace.parquet")
    pq.write_table(column("sag", at(2, 1e-3))(table), one / "trace.parquet")
    refused(one, "trace.parquet", "was changed after the run: its values")


def test_a_file_that_is_none_is_refused(one: Path) -> None:
    (one / "trace.parquet").unlink()
    (one / "trace.parquet").mkdir()
    refused(one, "trace.parquet", "there is no trace.parquet")


# -- the summary ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"outcome": "lost"}, "outcome = 'lost': must be one of completed, aborted"),
        ({"metrics": {"wall_time": Metric(0.0, "s")}}, r"metrics\.wall_time = 0\.0: must be a pos"),
        (
            {"metrics": {"simulated_time": Metric(9.0, "s")}},
            r"simulated_time = 9\.0: trace.parquet",
        ),
        ({"metrics": {"peak_moment": Metric(1.0, "mN m")}}, r"peak_moment\.unit = 'mN m': must be"),
        ({"metrics": {"peak_moment": Metric([1.0], "N m")}}, "value = .*: must be a number"),
        ({"metrics": {"peak_moment_by_piece": Metric([1.0, 2.0, 3.0], "N m")}}, "has 3 values"),
        ({"sheet": {"thickness_m": "thin"}}, "sheet.thickness_m = 'thin': must be a number"),
        ({"arms": {"left": 1}}, "arms.left = 1: must be a table"),
    ],
)
def test_a_summary_that_no_run_leaves_is_refused(
    top: Path, tmp_path: Path, change: dict[str, Any], words: str
) -> None:
    copied(top / "one", tmp_path, **change)
    if "outcome" in change:
        table = pq.read_table(tmp_path / "trace.parquet")
        about = json.loads(table.schema.metadata[b"dualbend"]) | change
        table = table.replace_schema_metadata({"dualbend": json.dumps(about)})
        pq.write_table(table, tmp_path / "trace.parquet")
    refused(tmp_path, "summary.json", words)


@pytest.mark.parametrize("name", ["seed", "scenario", "outcome"])
def test_a_summary_of_another_run_of_version_0_1_0_is_refused(one: Path, name: str) -> None:
    of_0_1_0(one)
    other = {"seed": 2, "scenario": "fig6", "outcome": "aborted"}[name]
    summary(one, lambda raw: raw.update({name: other}))
    refused(one, "trace.parquet", f"is of a run with {name} .*, summary.json with '{other}'")


def test_a_table_of_another_shape_is_refused(top: Path, tmp_path: Path) -> None:
    tables = load_run(top / "pwb").summary.tables
    rows = [{**row, "offset_m": "far"} for row in tables["holes"]]
    copied(top / "pwb", tmp_path, tables={**tables, "holes": rows})
    refused(tmp_path, "summary.json", r"tables\.holes\[0\]\.offset_m = 'far': must be a number")


def test_a_summary_that_was_changed_after_the_run_is_refused(one: Path) -> None:
    summary(one, lambda raw: raw["metrics"]["peak_moment"].update(value=1.0))
    refused(one, "summary.json", "was changed after the run")


# -- two runs ------------------------------------------------------------------------------------


@pytest.mark.parametrize("other", ["again", "seed"])
@pytest.mark.parametrize("file", ["scenario.toml", "summary.json", "trace.parquet"])
def test_a_folder_of_two_runs_is_refused_with_both(
    top: Path, one: Path, file: str, other: str
) -> None:
    """Also of two runs of one scenario and seed, which nothing but their names tells apart."""
    shutil.copyfile(top / other / file, one / file)
    ids = [load_run(top / name).identity for name in ("one", other)]
    assert all(ids)
    words = f"(?=.*{ids[0].id})(?=.*{ids[1].id}).*{file}"  # type: ignore[union-attr]
    refused(one, file, words)


def test_a_file_without_a_name_beside_files_that_have_one_is_refused(one: Path) -> None:
    text = (one / "scenario.toml").read_text()
    (one / "scenario.toml").write_text(text.split("\n", 1)[1])
    refused(one, "scenario.toml", "scenario.toml of a run that it does not name; summary.json of")


def test_another_tasks_scenario_is_refused(top: Path, one: Path) -> None:
    of_0_1_0(one)
    text = (of_0_1_0(copied(top / "pwb", one / "pwb")) / "scenario.toml").read_text()
    (one / "scenario.toml").write_text(text.replace('name = "pwb"', 'name = "fig8"'))
    refused(one, "trace.parquet", "has no column")


# -- JSON ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('{"a": 1, "a": 2}', "key 'a' is there twice"),
        ('{"b": {"a": 1, "a": 2}}', "key 'a' is there twice"),
        ('{"a": NaN}', "malformed"),
        ('{"a": 1e999}', "out of range"),
        ("[]", "Expected `object`"),
        ('{"a": "\\ud800"}', "truncated"),
        (5000 * '{"a":' + "1" + 5000 * "}", "recursion"),
        ("", "truncated"),
    ],
)
def test_json_is_strict(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "x.json"
    file.write_text(text)
    with pytest.raises(InputError, match=words) as caught:
        read_json(file, dict[str, Any], "summary")
    assert str(caught.value).startswith(f"{file}: no summary")
