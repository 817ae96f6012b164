"""What a run exports drives the cell again: the same trace, from every format."""

import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

from dualbend import InputError, load_run, load_scenario, make_run
from dualbend.cli import main
from dualbend.logs import messages
from dualbend.logs.commands import COLUMNS, read_commands
from dualbend.logs.export import write_csv, write_mcap
from dualbend.logs.replay import refuse_log, replay
from dualbend.run.disk.folder import run_folder
from dualbend.run.disk.output import write_numbers
from dualbend.run.loop import Run
from dualbend.run.record import RunRecord
from dualbend.run.trace import WALL_CLOCK_COLUMNS
from support.left_runs import leave
from support.short_bend import SHORT

PERIOD_S = 0.028


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return leave(tmp_path_factory.mktemp("run") / "fig8", "fig8", *SHORT)


@pytest.fixture(scope="module")
def run() -> Run:
    return make_run(load_scenario("fig8", SHORT))


def same(one: RunRecord, other: RunRecord) -> None:
    assert one.trace.rows == other.trace.rows
    for name, _ in one.trace.columns:
        if name not in WALL_CLOCK_COLUMNS:
            np.testing.assert_array_equal(one[name], other[name], err_msg=name)


def exported(folder: Path, to: Path) -> Path:
    record = load_run(folder)
    if to.suffix == ".parquet":
        return folder / "trace.parquet"
    if to.suffix == ".csv":
        write_csv(record, to)
    elif to.suffix == ".mcap":
        write_mcap(record, to)
    return to if to.suffix else folder


@pytest.mark.parametrize("name", ["folder", "log.parquet", "log.csv", "log.mcap"])
def test_a_runs_own_commands_make_its_trace_bit_for_bit(
    run: Run, folder: Path, tmp_path: Path, name: str
) -> None:
    before = load_run(folder)
    assert np.ptp(before["left_deviation_alpha"]) > 5e-3
    log = read_commands(exported(folder, tmp_path / name))
    refuse_log(run, log)
    again = replay(run, log)
    same(before, again)
    assert again.controller == "dualbend replay"
    assert (log.scenario == before.scenario.to_toml()) == (name in ("folder", "log.mcap"))


def written(path: Path, **columns: Any) -> Path:
    pyarrow.csv.write_csv(pa.table(columns), path)
    return path


def test_commands_in_all_axes_are_recorded_and_replayed(run: Run, tmp_path: Path) -> None:
    """Also those of which the scenario's controller has none."""
    cycles = np.arange(20)
    columns = {name: 1e-5 * (i + 1) * np.sin(cycles / (i + 3.0)) for i, name in enumerate(COLUMNS)}
    first = replay(run, read_commands(written(tmp_path / "log.csv", **columns)))
    for name, column in columns.items():
        np.testing.assert_array_equal(first[name][:20], column, err_msg=name)
    with run_folder(tmp_path / "run") as kept:
        write_numbers(first, kept)
    write_mcap(load_run(tmp_path / "run"), tmp_path / "log.mcap")
    again = replay(run, read_commands(tmp_path / "log.mcap"))
    same(first, again)


def test_a_log_that_is_too_short_ends_the_run_where_it_ends(run: Run, tmp_path: Path) -> None:
    log = read_commands(written(tmp_path / "log.csv", right_deviation_alpha=[0.0, 1e-3, 2e-3]))
    record = replay(run, log)
    assert record.outcome == "aborted"
    assert "log.csv has no command for cycle 3" in record.reason
    assert record["right_deviation_alpha"][:3].tolist() == [0.0, 1e-3, 2e-3]
    assert record["left_deviation_alpha"][:3].tolist() == [0.0, 0.0, 0.0]


TIME = [0.0, PERIOD_S, 2.0 * PERIOD_S]


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({"time": TIME}, "has no command; commands are left_deviation_ and right_deviation_ with"),
        ({"left_deviation_b": [0.0]}, "column 'left_deviation_b' is not known"),
        ({"left_deviation_x": ["a"]}, "column 'left_deviation_x': needs numbers"),
        ({"left_deviation_x": [0.0, None, 0.0]}, "'left_deviation_x', row 1: nan: needs a number"),
        ({"left_deviation_x": [0.0, np.inf]}, "'left_deviation_x', row 1: inf: needs a number"),
        ({"left_deviation_x": [None]}, "has no row with a command"),
        ({"left_deviation_x": [0.3]}, "row 0: 0.3 m is beyond serve.limit_m = 0.05"),
        ({"right_deviation_yaw": [0.0, -9.0]}, "row 1: -9 rad is beyond serve.limit_rad = 0.2"),
        (
            {"time": [5.0, 5.028, 5.084], "left_deviation_x": [0.0] * 3},
            "row 2 is 0.084 s after the first one, not 0.056 s: needs a row every robot.command_",
        ),
    ],
)
def test_what_is_no_command_is_refused_with_column_and_row(
    run: Run, tmp_path: Path, columns: dict[str, Any], said: str
) -> None:
    with pytest.raises(InputError) as refused:
        refuse_log(run, read_commands(written(tmp_path / "log.csv", **columns)))
    assert str(refused.value).startswith(str(tmp_path / "log.csv"))
    assert said in str(refused.value)


def test_a_scenario_of_another_task_is_refused(run: Run, tmp_path: Path) -> None:
    log = read_commands(written(tmp_path / "log.csv", left_deviation_x=[0.0]))
    other = SimpleNamespace(scenario=load_scenario("pwb"))
    with pytest.raises(InputError, match=r"task.kind = 'assembly'; replayed is bending"):
        refuse_log(other, log)  # type: ignore[arg-type]


def test_a_column_that_is_there_twice_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("left_deviation_x,left_deviation_x\n0,1\n")
    with pytest.raises(InputError, match="'left_deviation_x' is there twice"):
        read_commands(path)


def test_a_column_in_another_unit_is_refused(tmp_path: Path) -> None:
    field = pa.field("left_deviation_x", pa.float64(), metadata={"unit": "mm"})
    pq.write_table(pa.table([[0.0]], schema=pa.schema([field])), tmp_path / "log.parquet")
    with pytest.raises(InputError, match="'left_deviation_x' is in 'mm': needs 'm'"):
        read_commands(tmp_path / "log.parquet")


def test_damaged_logs_are_refused_in_one_line(folder: Path, tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    for suffix in (".mcap", ".parquet"):
        whole = exported(folder, tmp_path / f"log{suffix}").read_bytes()
        path = tmp_path / f"damaged{suffix}"
        for size in (0, 5, len(whole) // 2, len(whole) - 1):
            path.write_bytes(whole[:size])
            with pytest.raises(InputError, match=str(path)):
                read_commands(path)
        for _ in range(40):
            data = bytearray(whole)
            data[int(rng.integers(len(data)))] ^= 1 << int(rng.integers(8))
            path.write_bytes(data)
            try:
                read_commands(path)
            except InputError as refused:
                assert "\n" not in str(refused)


def test_an_mcap_of_something_else_names_its_topics(tmp_path: Path) -> None:
    from mcap.writer import Writer

    path = tmp_path / "other.mcap"
    for topic, kind, said in (
        ("/tool", messages.JOINT_STATE, "has no /deviation; its topics are /tool"),
        ("/deviation", messages.WRENCH, f"is of {messages.WRENCH}: needs {messages.JOINT_STATE}"),
    ):
        with path.open("wb") as file:
            writer = Writer(file)
            writer.start()
            schema = writer.register_schema(kind, "ros2msg", messages.definition(kind).encode())
            writer.add_message(writer.register_channel(topic, "cdr", schema), 0, b"", 0)
            writer.finish()
        with pytest.raises(InputError, match=said):
            read_commands(path)


def test_what_needs_the_extra_names_it(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = exported(folder, tmp_path / "log.mcap")
    for module in ("mcap.reader", "mcap.writer"):
        monkeypatch.setitem(sys.modules, module, None)
    for use in (lambda: read_commands(path), lambda: write_mcap(load_run(folder), path)):
        with pytest.raises(InputError, match=r"needs the extra: pip install 'dualbend\[mcap\]'"):
            use()


def test_the_commands_export_and_replay(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    files = ["--mcap", "log.mcap", "--csv", "log.csv"]
    done = CliRunner().invoke(main, ["export", str(folder), *files])
    assert done.exit_code == 0, done.output
    done = CliRunner().invoke(main, ["replay", "log.mcap", "--no-record"])
    assert done.exit_code == 0, done.output
    same(load_run(folder), load_run(tmp_path / "runs" / "fig8-replayed"))
    for arguments, said in (
        (["replay", "log.csv"], "log.csv does not say of which scenario it is"),
        (["replay", "nothing.csv", "fig8"], "nothing.csv: no such file"),
        (["export", str(folder)], "export needs --mcap FILE or --csv FILE"),
    ):
        done = CliRunner().invoke(main, arguments)
        assert done.exit_code == 2
        assert said in done.output
