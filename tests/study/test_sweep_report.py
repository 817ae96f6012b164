"""What is made of a sweep's rows: the table, the indices, the words and the pictures."""

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
import tomli_w
from scipy.stats import sobol_indices, uniform

from dualbend.errors import InputError
from dualbend.run.record import Metric
from dualbend.study.sweep.design import Design, make_design
from dualbend.study.sweep.figures import plot_heat_map
from dualbend.study.sweep.file import Sweep, load_sweep
from dualbend.study.sweep.progress import Progress, duration
from dualbend.study.sweep.report import SENSITIVITY, report_lines, write_report
from dualbend.study.sweep.run import RunRow
from dualbend.study.sweep.sensitivity import sensitivities
from dualbend.study.sweep.table import TABLE, make_table, numbers, shown_metrics, unit_of
from support.pictures import kept_figures
from support.stand_in import a_sweeps_run

GRID = {
    "sample": {"kind": "grid"},
    "keys": {
        "compliance.rotation.b": {"values": [4.0, 7.0, 9.0]},
        "sheet.length_m": {"min": 0.3, "max": 0.4, "steps": 2},
    },
}
ISHIGAMI_KEYS = ("sheet.young_pa", "sheet.density_kg_per_m3", "sheet.width_m")


def load(folder: Path, **said: Any) -> tuple[Sweep, Design]:
    path = folder / "s.toml"
    path.write_text(tomli_w.dumps({"scenario": "fig8", **said}))
    sweep = load_sweep(path)
    return sweep, make_design(sweep)


def rows_of(sweep: Sweep, design: Design) -> list[RunRow]:
    return [a_sweeps_run(i, sweep.resolve(design.settings(i))) for i in range(len(design.rows))]


def test_the_table_is_tidy(tmp_path: Path) -> None:
    """Analytic: the stand-in's numbers, a column each; units and nulls where they belong."""
    sweep, design = load(tmp_path, **GRID)
    rows = rows_of(sweep, design)
    rows[1] = RunRow(index=1, outcome="refused", reason="why")
    write_report(sweep, design, rows, tmp_path)
    table = pq.read_table(tmp_path / TABLE)
    assert table.column_names == [
        *("index", "compliance.rotation.b", "sheet.length_m", "outcome", "reason"),
        *("peak_moment", "peak_force"),
        *(f"peak_moment_by_piece[{i}]" for i in range(3)),
        "seed",
    ]
    assert unit_of(table, "sheet.length_m") == "m"
    assert unit_of(table, "peak_moment_by_piece[2]") == "N m"
    found = table.to_pylist()
    assert (found[1]["reason"], found[1]["peak_moment"]) == ("why", None)
    for i in (0, 2, 3, 4, 5):
        b, length = design.rows[i]
        assert (found[i]["compliance.rotation.b"], found[i]["sheet.length_m"]) == (b, length)
        assert found[i]["peak_moment"] == b**2 / length
        assert found[i]["peak_force"] == (None if b > 8.0 else b)
        assert found[i]["peak_moment_by_piece[1]"] is None
        assert found[i]["peak_moment_by_piece[2]"] == (b * length if i % 2 else None)
    about = json.loads(table.schema.metadata[b"dualbend"])
    assert (about["sweep"], about["sample"]) == ("s", "grid")


def test_keys_of_every_kind_have_a_column(tmp_path: Path) -> None:
    """Analytic: numbers, truth and words as they are, the rest as JSON that reads back."""
    values = {
        "robot.alter.mode": ["world", "tool"],
        "compliance.tare": [True, False],
        "robot.alter.delay_cycles": [1, 2],
        "compliance.predictor": ["none", {"lead_x_s": 0.01}],
        "compliance.complying": [["left"], ["left", "right"]],
        "sheet.young_pa": [70_000_000_000, 7e10],
    }
    keys = {name: {"values": two} for name, two in values.items()}
    sweep, design = load(
        tmp_path, sample={"kind": "list"}, keys=keys, set={"compliance.kind": "model"}
    )
    rows = [RunRow(index=i, outcome="completed") for i in range(2)]
    found = make_table(sweep, design, rows).to_pylist()
    for name, two in values.items():
        got = [row[name] for row in found]
        as_json = name in ("compliance.predictor", "compliance.complying")
        assert (list(map(json.loads, got)) if as_json else got) == two


def test_a_run_s_own_noise_is_in_the_table(tmp_path: Path) -> None:
    keys = {"sheet.young_pa": {"distribution": "uniform", "min": 6e10, "max": 7e10}}
    sweep, design = load(tmp_path, sample={"kind": "random", "n": 3, "noise": "each"}, keys=keys)
    rows = [RunRow(index=i, outcome="completed") for i in range(3)]
    assert make_table(sweep, design, rows).column("seed").to_pylist() == design.seeds
    assert len(set(design.seeds)) == 3


def test_a_metric_that_no_run_has_is_named_with_those_there_are(tmp_path: Path) -> None:
    sweep, design = load(tmp_path, metrics=["peak_momnet"], **GRID)
    with pytest.raises(InputError, match=r"metrics = 'peak_momnet': there are peak_moment, peak"):
        shown_metrics(sweep, make_table(sweep, design, rows_of(sweep, design)))


# -- sensitivity ---------------------------------------------------------------------------------


def ishigami(x: np.ndarray) -> np.ndarray:
    return np.asarray(np.sin(x[0]) + 7.0 * np.sin(x[1]) ** 2 + 0.1 * x[2] ** 4 * np.sin(x[0]))


def ishigami_sweep(folder: Path, n: int) -> tuple[Sweep, Design, list[RunRow]]:
    """Return a sweep of keys in (−π, π), and rows whose metric is Ishigami's function of them."""
    keys = {
        name: {"distribution": "uniform", "min": -np.pi, "max": np.pi} for name in ISHIGAMI_KEYS
    }
    sample = {"kind": "sobol", "n": n, "seed": 7, "sensitivity": True}
    sweep, design = load(folder, sample=sample, keys=keys, metrics=["y", "constant"])
    y = ishigami(np.array(design.rows).T)
    rows = [
        RunRow(
            index=i,
            outcome="completed",
            metrics={"y": Metric(float(v), "N m"), "constant": Metric(2.0, "1")},
        )
        for i, v in enumerate(y)
    ]
    return sweep, design, rows


def test_the_indices_are_scipy_s_of_the_same_seed(tmp_path: Path) -> None:
    """Analytic, to rounding: the design is the one that scipy makes for a function it may call."""
    sweep, design, rows = ishigami_sweep(tmp_path, 64)
    assert len(rows) == 64 * 5
    found, constant = sensitivities(
        sweep, design, make_table(sweep, design, rows), ["y", "constant"]
    )
    theirs = sobol_indices(
        func=ishigami,
        n=64,
        dists=[uniform(loc=-np.pi, scale=2.0 * np.pi)] * 3,
        rng=np.random.default_rng(7),
    )
    assert found.indices[0] == pytest.approx(np.ravel(theirs.first_order), rel=1e-9)
    assert found.indices[1] == pytest.approx(np.ravel(theirs.total_order), rel=1e-9)
    assert constant.why == "it does not vary"


def test_the_indices_and_their_intervals_are_ishigami_s(tmp_path: Path) -> None:
    """Analytic values; statistical, n = 1024: within 0.03, and each in its 95 % interval."""
    sweep, design, rows = ishigami_sweep(tmp_path, 1024)
    found = sensitivities(sweep, design, make_table(sweep, design, rows), ["y"])[0]
    for value, interval, exact in (
        (found.indices[0], found.ends[:, 0], [0.3139, 0.4424, 0.0]),
        (found.indices[1], found.ends[:, 1], [0.5576, 0.4424, 0.2437]),
    ):
        assert value == pytest.approx(exact, abs=0.03)
        assert (interval[0] - 1e-3 <= exact).all()
        assert (interval[1] + 1e-3 >= exact).all()


def test_a_run_without_a_value_leaves_no_indices_and_says_so(tmp_path: Path) -> None:
    sweep, design, rows = ishigami_sweep(tmp_path, 4)
    rows[3] = RunRow(index=3, outcome="refused", reason="why")
    report = write_report(sweep, design, rows, tmp_path)
    assert report.sensitivities[0].why == "1 of 20 runs have no value"
    text = "\n".join(report_lines(sweep, design, rows, report))
    assert "none: 1 of 20 runs have no value" in text
    assert "1 runs did not complete" in text
    assert not (tmp_path / SENSITIVITY).exists()


def test_the_report_says_the_indices_and_draws_them(tmp_path: Path) -> None:
    """Analytic: the numbers that are printed are those of the table."""
    sweep, design, rows = ishigami_sweep(tmp_path, 16)
    report = write_report(sweep, design, rows, tmp_path)
    lines = report_lines(sweep, design, rows, report)
    first = report.sensitivities[0].indices[0]
    assert any(ISHIGAMI_KEYS[1] in line and f"{first[1]:.3f}" in line for line in lines)
    assert report.files == [tmp_path / SENSITIVITY]
    assert report.files[0].read_bytes()[:4] == b"\x89PNG"
    y = numbers(report.table, "y")
    assert any(f"{y.max():>12.4g}  {y.argmin()}, {y.argmax()}  [N m]" in line for line in lines)


# -- progress ------------------------------------------------------------------------------------


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_the_time_left_is_that_of_the_runs_made_now() -> None:
    """Analytic: 2 of 10 runs were there, 4 more took 40 s, so the last 4 take 40 s."""
    now = 0.0
    stream = io.StringIO()
    progress = Progress(stream, clock=lambda: now)
    progress(2, 10, None)
    for done in range(3, 7):
        now += 10.0
        progress(done, 10, RunRow(index=done, outcome="refused" if done == 4 else "completed"))
    assert progress.text() == "6/10 runs, 1 refused, about 40 s left"
    # A log: the start, and a line every 30 s.
    assert stream.getvalue().splitlines() == ["2/10 runs", "5/10 runs, 1 refused, about 50 s left"]


def test_a_terminal_has_one_line_that_is_wiped() -> None:
    stream = Terminal()
    progress = Progress(stream, clock=lambda: 0.0)
    progress(0, 2, None)
    progress(1, 2, RunRow(index=0, outcome="completed"))
    progress(2, 2, RunRow(index=1, outcome="completed"))
    assert (
        stream.getvalue() == "\r0/2 runs\r1/2 runs, about 0 s left\r" + "2/2 runs".ljust(24) + "\n"
    )


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(45.4, "45 s"), (59.7, "1 min 0 s"), (200.0, "3 min 20 s"), (7500.0, "2 h 5 min")],
)
def test_durations_are_as_people_say_them(seconds: float, text: str) -> None:
    assert duration(seconds) == text


def test_no_cross_lies_over_a_number(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every run of the largest grid whose values are written, all crossed."""
    steps = {"min": 0.3, "max": 0.4, "steps": 12}
    keys = {"compliance.rotation.b": {"min": 4.0, "max": 9.0, "steps": 12}, "sheet.length_m": steps}
    sweep, design = load(tmp_path, sample={"kind": "grid"}, keys=keys)
    metrics = {"peak_moment": Metric(-1.234567e-5, "N m")}
    rows = [
        RunRow(index=i, outcome="protective_stop", metrics=metrics) for i in range(len(design.rows))
    ]
    table = make_table(sweep, design, rows)
    found = kept_figures(monkeypatch)
    plot_heat_map(sweep, design, table, "peak_moment", tmp_path / "heat.png")
    (figure,) = found
    axes = figure.axes[0]
    (crosses,) = axes.lines
    places = axes.transData.transform(np.column_stack(crosses.get_data()))
    half = 0.5 * crosses.get_markersize() * figure.dpi / 72.0
    texts = [text.get_window_extent() for text in axes.texts]
    assert len(texts) == len(places) == 144
    corners = np.array([[text.x0, text.y0, text.x1, text.y1] for text in texts])
    for x, y in places:
        apart = (x + half < corners[:, 0]) | (x - half > corners[:, 2])
        apart |= (y + half < corners[:, 1]) | (y - half > corners[:, 3])
        assert apart.all()
