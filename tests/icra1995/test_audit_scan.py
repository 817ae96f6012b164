"""The scan of Figs. 6, 8 and 9: its table reproduces, its readings and thresholds mean it."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np
import pytest
from scipy import optimize

from dualbend.beam.rod import planar as rod
from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.control.compliance.admittance import Admittance, AdmittanceConfig
from dualbend.control.compliance.base import AxisConfig
from dualbend.errors import InputError
from dualbend.evaluation.metrics import peak_by_piece
from dualbend.scenario.load import load_scenario
from dualbend.task.bending.run import BendingRun
from icra1995 import audit
from icra1995.confirm import oscillates, select
from icra1995.findings_scan import (
    counted,
    excluded,
    figures,
    simulated_together,
    survivors,
    tables,
)
from icra1995.reading import Reading, readings
from icra1995.scan import CLEARLY, HALF, ScanRow, judge, moments, scan
from icra1995.table import Simulated, Table, read_table, to_csv
from support.strip import STRIP6, STRIP8

SHIPPED = Reading(
    sheet="400x57x0.5",
    form="printed",
    length="mm",
    angle="deg",
    start_rad=0.2,
    robot="2Hz/0.995",
    delay=2,
    low_pass="fir2",
)


@pytest.fixture(scope="module")
def table() -> Table:
    return read_table()


def numbers(row: ScanRow) -> list[float]:
    return [getattr(row, name) for name in ScanRow.__struct_fields__ if name != "reading"]


def test_the_table_has_every_reading_once(table: Table) -> None:
    tried = [row.reading for row in table.rows]
    assert len(tried) == len(set(tried)) == 6 * 3 * 2 * 2 * 2 * 2 * 3 * 3
    assert set(tried) == set(readings())
    assert "mujoco" in table.made
    assert table.made[:2] == "20"


def test_a_sample_of_the_table_reproduces(table: Table) -> None:
    by = {row.reading: row for row in table.rows}
    rng = np.random.default_rng(8)
    together = [row.reading for row in table.rows if row.together]
    sample = [SHIPPED, together[int(rng.integers(len(together)))]]
    sample += [table.rows[i].reading for i in rng.choice(len(table.rows), 2, replace=False)]
    for row in scan(iter(sample)):
        # Four digits are kept.
        np.testing.assert_allclose(
            numbers(row), numbers(by[row.reading]), rtol=2e-3, atol=2e-4, err_msg=str(row.reading)
        )


def test_a_simulated_row_reproduces_and_is_what_the_cheap_model_says(table: Table) -> None:
    before = np.array(peak_by_piece(BendingRun(SHIPPED.without_compliance()).run()))
    complying = BendingRun(SHIPPED.scenario()).run()
    ratios = (np.array(peak_by_piece(complying)) / before)[1:]
    ran = table.simulated[SHIPPED]
    # Golden: the same seed; contact solvers differ by machine in the last digits.
    assert ratios.max() == pytest.approx(ran.worst_ratio, rel=0.02)
    assert ratios.mean() == pytest.approx(ran.mean_ratio, rel=0.02)
    assert not oscillates(complying, float(before.max()))
    assert oscillates(complying, 1e-4)


def test_fig6_of_the_cheap_model_is_that_of_the_simulation(table: Table) -> None:
    by = {row.reading: row for row in table.rows}
    assert len(table.simulated) > 5
    for reading, ran in table.simulated.items():
        # Golden: three angles a piece, no lag; within 15 % of the full simulation.
        assert by[reading].peak_nm == pytest.approx(ran.peak_nm, rel=0.15)
        assert by[reading].exact_ratio == pytest.approx(ran.exact_ratio, abs=0.1)


def gains(config: AdmittanceConfig) -> list[float]:
    filters = Admittance(config, period_s=COMMAND_PERIOD_S)
    assert filters.x is not None
    assert filters.rotation is not None
    return [filters.x.pole, filters.x.gain, filters.rotation.pole, filters.rotation.gain]


@pytest.mark.parametrize("form", ["printed", "impulse-invariant", "static"])
def test_metres_and_radians_are_the_si_units(form: str) -> None:
    reading = msgspec.structs.replace(SHIPPED, length="m", angle="rad", form=form)
    si = AdmittanceConfig(
        x=AxisConfig(b=7.0, k=575.0, form=form),  # type: ignore[arg-type]
        rotation=AxisConfig(b=0.5, k=1e4, form=form),  # type: ignore[arg-type]
        units="si",
    )
    # Analytic: the same filters.
    np.testing.assert_allclose(gains(reading.scenario().compliance), gains(si), rtol=1e-12)
    mixed = msgspec.structs.replace(reading, length="mm")
    expected = [gains(si)[0], gains(si)[1] / 1e3, *gains(si)[2:]]
    np.testing.assert_allclose(gains(mixed.scenario().compliance), expected, rtol=1e-12)


def test_the_shipped_reading_is_the_shipped_scenario() -> None:
    ours, shipped = SHIPPED.scenario(), load_scenario(STRIP8)
    assert gains(ours.compliance) == pytest.approx(gains(shipped.compliance), rel=1e-12)
    for name in ("path", "motion", "filter", "cell"):
        assert getattr(ours, name) == getattr(shipped, name), name
    assert ours.robot.alter == shipped.robot.alter
    assert (ours.compliance.sensing, ours.compliance.complying) == (("left",), ("left",))
    assert ours.sheet.sheet() == shipped.sheet.sheet()
    tenth = SHIPPED.scenario(0.1).compliance
    # Analytic: b scales the printed gain, k stays.
    assert gains(tenth)[1] == pytest.approx(10.0 * gains(ours.compliance)[1], rel=1e-12)
    assert gains(tenth)[3] == pytest.approx(10.0 * gains(ours.compliance)[3], rel=1e-12)
    assert SHIPPED.without_compliance().compliance.x is None
    assert SHIPPED.without_compliance(exact=True).path.kind == "exact"


def test_rest_is_where_filter_and_sheet_agree() -> None:
    """Rigid arms, rotation alone: α_left = α + M(α_left)/b, by bisection on the rod itself."""
    rigid = [
        "robot.servo.stiffness_n_m_per_rad=[1e9, 1e9, 1e9, 1e9, 1e9, 1e9]",
        "grasp.translational_stiffness_n_per_m=1e12",
        "grasp.rotational_stiffness_n_m_per_rad=1e9",
    ]
    turning = ["compliance.rotation.b=0.5", "compliance.rotation.k=10000.0"]
    alphas = np.array([0.3, 0.5])
    found = moments(load_scenario(STRIP6, rigid + turning), alphas)
    plain = load_scenario(STRIP6, rigid)
    sheet, path = plain.sheet.sheet(), plain.path.make(plain.sheet.length_m)
    for alpha, moment, alone in zip(alphas, found, moments(plain, alphas), strict=True):
        x = float(path.at(float(alpha))[0])

        def of(left: float, alpha: float = alpha, x: float = x) -> float:
            return rod.solve_planar(
                sheet.bending_stiffness_nm2,
                sheet.length_m,
                (-x, 0.0, left),
                (x, 0.0, alpha),
                sheet.weight_per_length_n_per_m,
                None,
                sheet.axial_stiffness_n,
            ).end_moment_nm

        # 1/b is 2 degrees per N m.
        def gap(left: float, alpha: float = alpha) -> float:
            return left - alpha - math.radians(2.0) * of(left)

        left = optimize.brentq(gap, alpha, alpha + 0.1)
        # Analytic, but for the arms' last 1e-6.
        assert moment == pytest.approx(of(float(left)), rel=1e-4)
        assert alone == pytest.approx(of(float(alpha)), rel=1e-4)


def row(**changed: float) -> ScanRow:
    good = {
        "peak_nm": 0.04,
        "exact_ratio": HALF - 0.01,
        "worst_ratio": 0.99,
        "mean_ratio": CLEARLY - 0.01,
        "growth_per_s": -1.0,
        "b_factor": 0.1,
        "frequency_hz": 2.0,
    }
    return ScanRow(reading=SHIPPED, **(good | changed))


@pytest.mark.parametrize(
    ("changed", "lost"),
    [
        ({"peak_nm": 0.008}, {"fig6"}),
        ({"exact_ratio": HALF}, {"fig6"}),
        ({"worst_ratio": 1.01}, {"fig8"}),
        ({"mean_ratio": CLEARLY}, {"fig8"}),
        ({"mean_ratio": math.nan}, {"fig8"}),
        ({"worst_ratio": math.nan}, {"fig8"}),
        ({"growth_per_s": 0.1}, {"fig8", "fig9"}),
        ({"b_factor": 0.0}, {"fig9"}),
    ],
)
def test_each_figure_needs_its_own(changed: dict[str, float], lost: set[str]) -> None:
    assert row().together
    judged = row(**changed)
    assert not judged.together
    assert {name for name in ("fig6", "fig8", "fig9") if not getattr(judged, name)} == lost
    # What no reading shows is named as excluded.
    for name in lost:
        assert "form printed" in excluded([judged], name)
    assert "form printed" not in excluded([row()], "together")


def test_what_the_page_says_of_the_table(table: Table) -> None:
    # Golden: one reading of those run in full holds, the shipped one's.
    assert survivors(table) == [SHIPPED]
    assert counted(table.rows, "fig8", form="static") == 0
    assert counted(table.rows, "fig9", form="static") == 0
    assert counted(table.rows, "together", length="m") == 0
    assert counted(table.rows, "together") == sum(r.together for r in table.rows)
    assert table.rows[0].reading.sheet in tables(table)


def test_the_verdict_on_all_three_figures_can_be_lost(table: Table) -> None:
    assert figures(table)[-1].verdict == "confirmed under an assumption"
    worse = {
        reading: msgspec.structs.replace(ran, mean_ratio=ran.mean_ratio + 0.3)
        for reading, ran in table.simulated.items()
    }
    changed = msgspec.structs.replace(table, simulated=worse)
    assert figures(changed)[-1].verdict == "not reproducible"
    unstable = tuple(msgspec.structs.replace(r, growth_per_s=1.0) for r in table.rows)
    verdicts = [f.verdict for f in figures(msgspec.structs.replace(table, rows=unstable))]
    assert verdicts[:3] == ["confirmed under an assumption", *["not reproducible"] * 2]


@pytest.mark.parametrize(
    "changed", [{"ended": "oscillates"}, {"b_factor": 0.0}, {"worst_ratio": 1.1}, {"peak_nm": 1e-3}]
)
def test_a_simulation_must_show_all_three(changed: dict[str, object], table: Table) -> None:
    ran = table.simulated[SHIPPED]
    assert simulated_together(ran)
    assert not simulated_together(msgspec.structs.replace(ran, **changed))


def test_what_is_run_in_full(table: Table) -> None:
    chosen = select(table.rows)
    assert set(chosen) == set(table.simulated)
    assert SHIPPED in chosen
    # Every form and angle unit of its sheet is beside it.
    beside = {(r.form, r.angle) for r in chosen if r.sheet == SHIPPED.sheet}
    assert len(beside) == 6
    assert select([row(growth_per_s=1.0)]) == []


def test_the_table_survives_the_file(tmp_path: Path) -> None:
    rows = [row(), msgspec.structs.replace(row(mean_ratio=math.nan), reading=next(readings()))]
    ran = Simulated(
        peak_nm=0.1, exact_ratio=0.2, worst_ratio=0.3, mean_ratio=0.4, ended="failed", b_factor=0.5
    )
    path = tmp_path / "table.csv"
    path.write_text(to_csv(rows, {SHIPPED: ran}, "today"), encoding="utf-8")
    back = read_table(path)
    assert back.made == "today"
    assert back.rows[0] == rows[0]
    assert math.isnan(back.rows[1].mean_ratio)
    assert back.simulated == {SHIPPED: ran}


@pytest.mark.parametrize(
    "text", ["", "no table\n1\n2\n", "# today\nsheet,form\na,b\n", "# today\n"]
)
def test_a_broken_table_is_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"table\.csv"):
        read_table(path)
    with pytest.raises(InputError, match="nowhere"):
        read_table(tmp_path / "nowhere.csv")


def test_a_scan_writes_its_table_or_refuses_before_it_begins(
    tmp_path: Path, table: Table, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[ScanRow] = []

    def few(on_row: Callable[[ScanRow], None] | None = None) -> list[ScanRow]:
        return scan(iter([SHIPPED]), on_row)

    monkeypatch.setattr(audit, "scan", few)
    monkeypatch.setattr(audit, "simulate", lambda reading: table.simulated[reading])
    written = audit.run_scan(tmp_path / "table.csv", seen.append)
    assert [row.reading for row in written.rows] == [row.reading for row in seen] == [SHIPPED]
    assert written.simulated == {SHIPPED: table.simulated[SHIPPED]}
    monkeypatch.setattr(audit, "scan", lambda **_: pytest.fail("scanned for nothing"))
    with pytest.raises(InputError, match="cannot be written"):
        audit.run_scan(tmp_path / "nowhere" / "table.csv")


def test_an_unstable_reading_has_no_fig9() -> None:
    wild = judge(msgspec.structs.replace(SHIPPED, length="m", angle="rad"))
    # The printed form in SI gives 0.16 m/N: unstable beyond doubt.
    assert wild.growth_per_s > 5.0
    assert wild.b_factor == 0.0
    assert not wild.fig8
