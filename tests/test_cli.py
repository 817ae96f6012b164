"""The command line as a user meets it: exit codes, messages, what a run leaves."""

import html
import json
import os
import subprocess
import sys
from pathlib import Path

import mujoco
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner, Result

from dualbend import load_run
from dualbend.cli import main
from dualbend.scenario.load import load_scenario

SHORT = [
    *("--set", "motion.speed_rad_per_s=0.5"),
    *("--set", "path.end_rad=0.4"),
    *("--set", "motion.settle_s=0.1"),
    *("--set", "motion.hold_s=0.1"),
]


def call(*arguments: str) -> Result:
    return CliRunner().invoke(main, list(arguments))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("runs") / "fig8"
    result = call("run", "fig8", *SHORT, "--seed", "7", "--out", str(out))
    assert result.exit_code == 0, result.output
    return out


def test_a_run_leaves_all_its_files(folder: Path) -> None:
    names = {path.name for path in folder.iterdir()}
    assert names == {"scenario.toml", "summary.json", "trace.parquet", "run.rrd", "moment.png"}


def test_the_resolved_scenario_makes_the_same_run(folder: Path, tmp_path: Path) -> None:
    again = tmp_path / "again"
    result = call("run", str(folder / "scenario.toml"), "--no-record", "--out", str(again))
    assert result.exit_code == 0, result.output
    first, second = (pq.read_table(f / "trace.parquet").drop(["wall_s"]) for f in (folder, again))
    assert first.equals(second)  # exact: bit for bit
    assert not (again / "run.rrd").exists()


def test_columns_say_their_unit(folder: Path) -> None:
    schema = pq.read_schema(folder / "trace.parquet")
    units = {field.name: field.metadata[b"unit"].decode() for field in schema}
    assert units["left_true_moment_y"] == "N m"
    assert units["left_deviation_x"] == "m"
    assert units["time"] == "s"


def test_summary_is_strict_json(folder: Path) -> None:
    found = json.loads((folder / "summary.json").read_text())
    assert found["scenario"] == "fig8"
    assert found["seed"] == 7
    assert found["outcome"] == "completed"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "fig88"], ["fig88", "did you mean 'fig8'"]),
        (["run", "nowhere.toml"], ["nowhere.toml", "no such file"]),
        (["run", "fig6", "--set", "sheet.lenght_m=0.5"], ["sheet.lenght_m", "0.5", "length_m"]),
        (["run", "fig6", "--set", "sheet.thickness_m=0.5"], ["sheet.thickness_m", "0.5"]),
        (["run", "fig6", "--set", "physics.step_s=0.003"], ["step_s", "0.003", "0.0028"]),
        (["run", "fig6", "--set", "filter.cutoff_hz=20"], ["cutoff_hz", "20", "17.857"]),
        (["run", "fig6", "--set", "path.end_rad=nan"], ["path.end_rad", "nan"]),
        (["run", "fig6", "--set", "cell.base_distance_m=2.5"], ["out of reach"]),
        (["run", "fig6", "--set", "motion.speed_rad_per_s=4.9"], ["motion.speed_rad_per_s", "4.9"]),
        (["beam", "--length", "0.6", "--width", "0.1", "--thickness", "-1", "--young", "7e10",
          "--alpha", "0.2"], ["thickness", "-1"]),
        (["render", "x.rrd", "--out", "x.png"], ["x.rrd: is a recording", "needs a scenario"]),
        (
            ["run", "fig6", "--set", "sheet.profile=[{at_m=0.1,thickness_m=1e-3},"
             "{at_m=0.8,thickness_m=1e-3}]"],
            ["profile at [0.1, 0.8] m: must lead from 0", "0.8 m"],
        ),
        (["stability", "tuned", "--validate"], ["--validate", "tuned", "beyond the paper"]),
        (["stability", "fig8", "--map", "m.png", "--map-b", "10", "1"], ["--map-b", "10", "1"]),
        (["stability", "fig8", "--map", "m.png", "--map-k", "-1", "1"], ["--map-k", "-1"]),
        (["run", "fig8", "--set", "compliance.x.k=-575"], ["compliance.x.k", "-575", "> 0"]),
        (
            ["run", "fig8", "--set", "robot.alter.delay_cycles=1.5"],
            ["robot.alter.delay_cycles", "1.5"],
        ),
        (["scene", "fig6", "--out", "/proc/none/x.xml"], ["/proc/none/x.xml"]),
        (["run", "fig6", "--out", "/proc/none"], ["/proc/none"]),
    ],
)  # fmt: skip
def test_bad_input_is_one_message_and_exit_2(arguments: list[str], words: list[str]) -> None:
    result = call(*arguments)
    assert result.exit_code == 2
    assert isinstance(result.exception, SystemExit)
    for word in words:
        assert word in result.output
    assert len(result.output.strip().splitlines()) == 1


def test_a_protective_stop_exits_3_and_keeps_its_files(tmp_path: Path) -> None:
    result = call(
        "run", "fig6", *SHORT, "--set", "guard.following_error_rad=1e-6", "--no-record",
        "--out", str(tmp_path),
    )  # fmt: skip
    assert result.exit_code == 3
    found = json.loads((tmp_path / "summary.json").read_text())
    assert found["outcome"] == "protective_stop"
    assert "following error" in found["reason"]
    assert pq.read_metadata(tmp_path / "trace.parquet").num_rows > 0


def test_an_expected_protective_stop_exits_0(tmp_path: Path) -> None:
    result = call(
        "run", "fig6", *SHORT, "--set", "guard.following_error_rad=1e-6", "--no-record",
        "--set", 'expect.outcome=["protective_stop"]', "--out", str(tmp_path),
    )  # fmt: skip
    assert result.exit_code == 0


def test_beam_prints_the_closed_form_as_json() -> None:
    result = call(
        "beam", "--length", "0.6", "--width", "0.1", "--thickness", "0.001", "--young", "69e9",
        "--alpha", "0", "--json",
    )  # fmt: skip
    found = json.loads(result.output)
    assert list(found)[:5] == [
        *("force_n", "moment_nm", "half_distance_m", "rise_m", "curvature_max_per_m")
    ]
    # Analytic: the Euler load.
    assert found["force_n"] == pytest.approx(9.869604401089358 * 0.575 / 0.36, rel=1e-12)


def test_beam_off_the_optimum_asks_the_rod() -> None:
    result = call(
        "beam", "--length", "0.6", "--width", "0.1", "--thickness", "0.001", "--young", "69e9",
        "--alpha", "0.1", "--half-distance", "0.2985031", "--json",
    )  # fmt: skip
    found = json.loads(result.output)
    # Golden, from an independent shooting solution, to the digits it was given with.
    assert found["force_n"] == pytest.approx(32.30, abs=0.03)
    assert found["moment_nm"] == pytest.approx(0.3447, abs=4e-4)


def test_scene_opens_in_mujoco_and_steps(tmp_path: Path) -> None:
    path = tmp_path / "scene.xml"
    assert call("scene", "fig6", "--out", str(path)).exit_code == 0
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for _ in range(100):
        mujoco.mj_step(model, data)
    assert not data.warning.number.any()


def test_list_names_every_scenario() -> None:
    output = call("list").output
    for name in ("fig6", "fig8", "fig9", "exact"):
        assert name in output
        assert load_scenario(name).description in output


def test_view_without_a_screen_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    result = call("view", "fig6")
    assert result.exit_code == 2
    assert "screen" in result.output


def test_help_needs_no_physics() -> None:
    code = "import sys; import dualbend.cli; sys.exit('mujoco' in sys.modules)"
    environment = dict(os.environ)
    assert (
        subprocess.run([sys.executable, "-c", code], env=environment, check=False).returncode == 0
    )


def test_a_piece_shorter_than_a_cycle_has_no_peak(tmp_path: Path) -> None:
    result = call(
        "run", "fig6", *SHORT, "--set", "path.interval_rad=0.005", "--no-record",
        "--out", str(tmp_path),
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    found = json.loads((tmp_path / "summary.json").read_text())["metrics"]
    pieces = found["peak_moment_by_piece"]["value"]
    assert None in pieces
    assert max(p for p in pieces if p is not None) == found["peak_moment"]["value"]


def test_what_cannot_be_written_is_said_before_anything_is_computed(tmp_path: Path) -> None:
    (tmp_path / "summary.json").mkdir()
    result = call("run", "fig6", *SHORT, "--no-record", "--out", str(tmp_path))
    assert result.exit_code == 2
    assert "summary.json is a folder there" in result.output
    assert [path.name for path in tmp_path.iterdir()] == ["summary.json"]


def test_pieces_replace_an_inherited_interval(tmp_path: Path) -> None:
    assert load_scenario("fig8", ["path.kind=pieces", "path.pieces=3"]).path.pieces == 3
    child = tmp_path / "child.toml"
    child.write_text('extends = "fig6"\nname = "child"\n[path]\nkind = "pieces"\npieces = 4\n')
    assert load_scenario(str(child)).path.pieces == 4


def test_an_error_names_the_file_that_holds_the_key(tmp_path: Path) -> None:
    (tmp_path / "base.toml").write_text(
        'extends = "fig6"\nname = "base"\n[sheet]\nlenght_m = 0.4\n'
    )
    (tmp_path / "child.toml").write_text('extends = "base.toml"\nname = "child"\n')
    result = call("run", str(tmp_path / "child.toml"))
    assert result.exit_code == 2
    assert "base.toml: sheet.lenght_m" in result.output


@pytest.mark.parametrize("hidden", [False, True])
def test_an_interrupt_is_one_line_and_no_traceback(
    monkeypatch: pytest.MonkeyPatch, hidden: bool
) -> None:
    def interrupted(*_: object) -> None:
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt as error:
            if hidden:  # as a compiled library does
                raise TypeError("Invoked with: ...") from error
            raise

    monkeypatch.setattr("dualbend.run.make.make_run", interrupted)
    result = call("run", "fig6")
    assert result.exit_code == 130
    assert "interrupted" in result.output


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("fig6", ""),
        ("fig8", "fig8: compliance predicted stable"),
        ("fig9", "warning: fig9: compliance predicted unstable"),
    ],
)
def test_a_run_tells_what_is_predicted_before_it_starts(
    name: str, words: str, tmp_path: Path
) -> None:
    result = call("run", name, *SHORT, "--no-record", "--out", str(tmp_path))
    assert result.exit_code == 0, result.output
    assert result.stderr.startswith(words)
    assert ("predicted" in result.stderr) == bool(words)


def test_what_cannot_be_predicted_runs_all_the_same(tmp_path: Path) -> None:
    """The loop's prediction is of two arms of a kind; a mixed pair complies without it."""
    settings = (
        "robot.right.model=ur5",
        "motion.speed_rad_per_s=1.0",
        "path.end_rad=0.3",
        "motion.hold_s=0.1",
    )
    pairs = [part for setting in settings for part in ("--set", setting)]
    done = CliRunner().invoke(
        main, ["run", "fig8", *pairs, "--no-record", "--out", str(tmp_path / "mixed")]
    )
    assert done.exit_code == 0, done.output
    assert "stability not predicted" in done.stderr
    assert (tmp_path / "mixed" / "trace.parquet").is_file()


@pytest.fixture(scope="module")
def mislabelled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A job of aluminium's numbers that was given the name of FR-4, of a sensor too weak."""
    file = tmp_path_factory.mktemp("jobs") / "job.toml"
    file.write_text(
        'extends = "fig6"\nname = "job"\n[sheet]\nmaterial = "FR-4"\nyoung_pa = 70.3e9\n'
        "[sensor]\nforce_range_n = 2\n[guard]\nsensor_cycles = 1000000\n",
        encoding="utf-8",
    )
    return file


def test_a_warning_is_told_once_and_stands_in_summary_and_report(
    mislabelled: Path, tmp_path: Path
) -> None:
    result = call("run", str(mislabelled), *SHORT, "--no-record", "--out", str(tmp_path))
    assert result.exit_code == 0, result.output
    summary = json.loads((tmp_path / "summary.json").read_text())["warnings"]
    assert ["70.3e9" in w and "24e9" in w for w in summary] == [True, False]  # name, then sensor
    told = [t for t in result.stderr.splitlines() if t.startswith("warning: job: ")]
    assert told == [f"warning: job: {warning}" for warning in summary]
    assert "warning: " not in result.stdout
    assert load_run(tmp_path).summary.warnings == summary
    assert call("report", str(tmp_path), "--out", str(tmp_path / "r.html")).exit_code == 0
    page = html.unescape((tmp_path / "r.html").read_text(encoding="utf-8"))
    for warning in summary:
        assert page.count(f"<strong>Warning:</strong> {warning}") == 1


def test_a_command_that_does_not_run_tells_of_the_name_as_well(
    mislabelled: Path, tmp_path: Path
) -> None:
    out = ["--out", str(tmp_path / "scene.xml")]
    result = call("scene", str(mislabelled), *out)
    assert result.exit_code == 0
    assert result.stderr.startswith('warning: job: sheet.material = "FR-4" stands beside numbers')
    assert result.stderr.count("\n") == 1
    assert call("scene", str(mislabelled), *out, "--set", "sheet.material=FR-4").stderr == ""
