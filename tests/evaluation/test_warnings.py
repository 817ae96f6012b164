"""What contradicts physics is said, with its numbers, and nothing is said next to it.

Each warning is shown with the nearest case in which it does not appear.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dualbend.beam.material import find_material, library
from dualbend.control.guard import SENSOR_AXES
from dualbend.evaluation.sheet import sheet_report
from dualbend.evaluation.warnings import _in_a_row, name_warnings, run_warnings, scenario_warnings
from dualbend.run.record import RunRecord
from dualbend.run.trace import Trace
from dualbend.scenario.load import list_scenarios, load_scenario
from dualbend.scenario.template import scenario_text
from dualbend.task.bending.run import BendingRun
from dualbend.types import SIDES
from support.strip import STRIP6, STRIP8

SHORT = ("motion.speed_rad_per_s=0.4", "path.end_rad=0.4", "motion.settle_s=0.1")
ALUMINIUM = {"young_pa": 70.3e9, "poisson_ratio": 0.33, "density_kg_per_m3": 2680.0}
UNNAMED = ("sheet.material=none", *(f"sheet.{key}={value!r}" for key, value in ALUMINIUM.items()))

UNSTOPPED = ("guard.sensor_cycles=1000000",)

BEND = 1  # index of the phase
ROWS = 20


def record(*settings: str, **columns: object) -> RunRecord:
    """Return a made-up run of 20 cycles in which nothing happens but what the columns say."""
    scenario = load_scenario(STRIP6, settings)
    quiet = ["time", "phase", "nominal_alpha", "left_true_moment_y"]
    quiet += [f"bend_{i:03d}" for i in range(scenario.sheet.model.sections)]
    quiet += [f"{side}_deviation_{part}" for side in SIDES for part in ("x", "alpha")]
    quiet += [f"{s}_sensor_{a.replace(' ', '_')}" for s in SIDES for a in SENSOR_AXES]
    values = {name: np.zeros(ROWS) for name in quiet}
    values["phase"] = np.full(ROWS, float(BEND))
    for name, given in columns.items():
        values[name] = np.array(given, dtype=float)
    return RunRecord(
        scenario=scenario,
        outcome="completed",
        trace=Trace([(name, "1") for name in values], np.stack(list(values.values()), axis=1)),
        simulated_s=1.0,
        wall_time_s=1.0,
    )


def at(rows: Sequence[int], value: float) -> np.ndarray:
    values = np.zeros(ROWS)
    values[list(rows)] = value
    return values


# --- a material's name beside numbers -------------------------------------------------------------


def test_numbers_of_another_material_beside_a_name_are_said_with_both() -> None:
    sheet = load_scenario(STRIP6, ["sheet.material=FR-4", *UNNAMED[1:]]).sheet
    (warning,) = name_warnings(sheet)
    for words in (
        'sheet.material = "FR-4"',
        "sheet.young_pa = 70.3e9 (FR-4: 24e9)",
        "sheet.poisson_ratio = 0.33 (FR-4: 0.136)",
        "sheet.density_kg_per_m3 = 2680.0 (FR-4: 1850.0)",
    ):
        assert words in warning
    assert name_warnings(load_scenario(STRIP6, ["sheet.material=FR-4"]).sheet) == []


@pytest.mark.parametrize(
    ("key", "scatter"),
    [("young_pa", 0.1), ("poisson_ratio", 0.1), ("density_kg_per_m3", 0.1), ("yield_pa", 0.25)],
)
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_number_within_the_scatter_of_sources_is_still_the_material(
    key: str, scatter: float, sign: float
) -> None:
    """Analytic: 10 % of an elastic constant or the density, 25 % of the strength."""
    own = getattr(find_material("5052-H32"), key)

    def said(change: float) -> list[str]:
        given = [f"sheet.{key}={own * (1.0 + sign * change)!r}"]
        return name_warnings(load_scenario(STRIP6, given).sheet)

    assert said(scatter - 1e-6) == []
    (warning,) = said(scatter + 1e-6)
    assert f"sheet.{key} = " in warning and "poisson_ratio" not in warning.replace(key, "")


def test_what_the_library_does_not_know_contradicts_nothing() -> None:
    # FR-4 has no yield strength: whoever gives one knows more than the library.
    assert (
        name_warnings(load_scenario(STRIP6, ["sheet.material=FR-4", "sheet.yield_pa=3e8"]).sheet)
        == []
    )
    assert name_warnings(load_scenario(STRIP6, UNNAMED).sheet) == []


def test_a_new_scenario_whose_material_is_changed_has_the_numbers_of_the_new_one(
    tmp_path: Path,
) -> None:
    """The trial that left aluminium's modulus in a sheet of FR-4 now changes the modulus."""
    text = scenario_text("job", "fig8")
    assert 'material = "2024-T3"' in text.splitlines()
    file = tmp_path / "job.toml"
    file.write_text(text.replace('material = "2024-T3"', 'material = "FR-4"'), encoding="utf-8")
    scenario = load_scenario(str(file))
    assert scenario.sheet.sheet().young_pa == pytest.approx(24e9, rel=1e-12)
    assert scenario_warnings(scenario) == []


def test_the_summary_calls_no_sheet_by_a_name_alone_that_has_other_numbers() -> None:
    named = sheet_report(load_scenario(STRIP6, ["sheet.material=FR-4", "sheet.young_pa=70.3e9"]))
    assert named.material == "FR-4 with young_pa = 70.3e9"
    assert sheet_report(load_scenario(STRIP6)).material == "5052-H32"
    assert sheet_report(load_scenario(STRIP6, UNNAMED)).material == "given"


# --- a sheet that yields --------------------------------------------------------------------------


def test_an_unnamed_sheet_is_measured_by_the_materials_that_have_its_numbers() -> None:
    """κ t/2 on the path of fig6 is 2.01e-3: above 1100-H14's σ_y/E, below the other alloys'."""
    (warning,) = scenario_warnings(load_scenario(STRIP6, UNNAMED))
    strain = sheet_report(load_scenario(STRIP6, UNNAMED)).nominal_strain
    # Analytic, κ t/2 = (4 K/L) sin(α/2) t/2 of the exact path; its pieces and weight add 0.3 %.
    assert strain == pytest.approx(8.0303 * 0.25e-3, rel=0.01)
    assert f"reaches {strain:.2e} on the nominal path" in warning
    assert f"1100-H14 bears {117e6 / 68.9e9:.2e}" in warning
    assert all(name not in warning for name in ("5052-H32", "6061-T6", "2024-T3", "spring-steel"))


def test_an_unnamed_sheet_below_the_weakest_that_it_could_be_is_not_warned_of() -> None:
    """Analytic: the strain goes with the thickness; 117 MPa/68.9 GPa is at 0.4224 mm."""
    at_limit = (
        0.0005 * (117e6 / 68.9e9) / sheet_report(load_scenario(STRIP6, UNNAMED)).nominal_strain
    )
    for factor, warns in ((0.995, False), (1.005, True)):
        found = scenario_warnings(
            load_scenario(STRIP6, [*UNNAMED, f"sheet.thickness_m={factor * at_limit!r}"])
        )
        assert bool(found) == warns, factor


def test_an_unnamed_sheet_like_none_of_the_library_is_measured_by_the_strongest() -> None:
    """Polyester film bears the most, σ_y/E = 98 MPa/4.8 GPa = 2.04 %."""
    soft = [*UNNAMED, "sheet.young_pa=1e9", "sheet.width_m=0.3", "sheet.length_m=0.2"]

    def said(thickness_m: float) -> list[str]:
        return scenario_warnings(load_scenario(STRIP6, [*soft, f"sheet.thickness_m={thickness_m}"]))

    assert max(m.limit_strain or 0.0 for m in library().values()) == 98e6 / 4.8e9
    assert said(0.0024) == []  # analytic, up to weight: 8.0303 · 2 · t/2 = 1.93e-2
    (warning,) = said(0.0027)  # 2.17e-2
    assert "no material of the library bears more than 2.04e-02 (PET)" in warning


def test_a_named_sheet_is_measured_by_its_own_limit() -> None:
    """The trial that gave 277 MPa at the surface without a word: 4.02e-3 against 2.75e-3."""
    (warning,) = scenario_warnings(load_scenario(STRIP6, ["sheet.thickness_m=0.001"]))
    assert "the sheet (5052-H32) yields" in warning
    assert f"above {193e6 / 70.3e9:.2e}" in warning
    assert "set sheet.plastic = true" in warning
    for other in (["sheet.plastic=true"], ["sheet.material=2024-T3"]):  # simulated so; stronger
        assert scenario_warnings(load_scenario(STRIP6, ["sheet.thickness_m=0.001", *other])) == []


def test_a_brittle_sheet_breaks() -> None:
    brittle = load_scenario(STRIP6, ["sheet.material=prepreg-B-stage", "sheet.thickness_m=0.0015"])
    (warning,) = scenario_warnings(brittle)
    assert "the sheet (prepreg-B-stage) breaks" in warning
    assert "as if it did not" in warning


def test_a_sheet_that_the_run_alone_bends_beyond_its_limit_is_said_after_it() -> None:
    """Analytic: ε = Δθ t/(2 h), h = 20 mm: 193 MPa/70.3 GPa at Δθ = 0.2196."""
    limit = 193e6 / 70.3e9 * 2.0 * 0.02 / 0.0005
    assert run_warnings(record(bend_007=at([3], -0.999 * limit))) == []
    (warning,) = run_warnings(record(bend_007=at([3], -1.001 * limit)))
    assert "reaches 2.75e-03 in the run" in warning
    # Where the path alone says it already, it is not said twice.
    thick = record("sheet.thickness_m=0.001", bend_007=at([3], limit))
    assert len(scenario_warnings(thick.scenario)) == 1 and run_warnings(thick) == []


# --- a saturated sensor ---------------------------------------------------------------------------


def test_a_sensor_at_the_end_of_its_range_is_said_with_cycles_and_axes() -> None:
    """Exact: 65 N and 5 N m in counts of 0.05 N and 3 mN m are ±65 N and ±4.998 N m."""
    full = record(
        left_sensor_force_x=at([2, 3, 4, 9], 65.0), left_sensor_moment_y=at([9, 10], -4.998)
    )
    (warning,) = run_warnings(full)
    assert "the left sensor was at the end of its range (±65 N, ±4.998 N m)" in warning
    assert "in 5 of 20 cycles, at most 3 in a row (force x, moment y)" in warning
    # A count less is a reading.
    near = record(left_sensor_force_x=at([2], 64.95), left_sensor_moment_y=at([9], -4.995))
    assert run_warnings(near) == []


def test_cycles_without_a_reading_do_not_count() -> None:
    reading = at([0], -65.0)
    reading[-1] = np.nan  # the cycle in which the guard stopped the arms
    (warning,) = run_warnings(record(left_sensor_force_z=reading))
    assert "in 1 of 19 cycles" in warning


def test_a_sensor_that_repeats_its_reading_is_said_where_the_scenario_lets_it() -> None:
    """Exact: rows 4, 5 and 9 repeat the one before; in one axis alone, as row 14, is a reading."""
    force = np.arange(20.0)
    force[[4, 5, 9, 14]] = force[[3, 3, 8, 13]]
    moment = np.where(np.arange(20) == 14, 1.0, 0.0)
    columns = {"left_sensor_force_x": force, "left_sensor_moment_y": moment}
    drops = "imperfections.sensor.dropout_probability=0.1"
    (warning,) = run_warnings(record(drops, **columns))
    assert warning == "the left sensor told nothing new in 3 of 20 cycles, at most 2 in a row"
    (stuck,) = run_warnings(record('imperfections.sensor.stuck=["right"]', **columns))
    assert stuck == warning
    assert run_warnings(record(**columns)) == []
    # One without noise may be right to say the same again.
    still = ("sensor.force_noise_n=0", "sensor.torque_noise_nm=0.002")
    assert run_warnings(record(drops, *still, **columns)) == []


def test_only_an_arm_that_senses_has_a_sensor() -> None:
    columns = {"right_sensor_force_x": at([1], 65.0)}
    assert run_warnings(record(**columns)) == []
    both = record('compliance.sensing=["left","right"]', **columns)
    assert [w[:16] for w in run_warnings(both)] == ["the right sensor"]


def test_the_reading_that_the_simulated_sensor_clips_is_the_one_that_is_said() -> None:
    """Golden: forces of fig6 within 6.2 N along x, tool and sheet between 6.1 and 6.9 N along z.

    Full scale from the scenario is that which the sensor has, with a range between counts, too.
    """
    for settings, axes in (
        (["sensor.force_range_n=2"], "force x, force z"),
        (["sensor.force_range_n=6.48"], "force z"),
    ):
        scenario = load_scenario(STRIP6, [*SHORT, *settings, *UNSTOPPED])
        (warning,) = run_warnings(BendingRun(scenario).run())
        assert f"({axes})" in warning
    wide = BendingRun(load_scenario(STRIP6, [*SHORT, "sensor.force_range_n=7"])).run()
    assert run_warnings(wide) == []


# --- a compliance that comes too late -------------------------------------------------------------


def late(moment: np.ndarray, deviation: np.ndarray, *settings: str) -> list[str]:
    alpha = np.linspace(0.0, 0.38, ROWS)  # 0.02 rad a cycle
    return run_warnings(
        record(
            *settings,
            nominal_alpha=alpha,
            left_true_moment_y=moment,
            right_deviation_alpha=deviation,
        )
    )


def test_a_compliance_that_begins_after_the_largest_moment_is_said_with_both() -> None:
    moment = -0.03 * np.ones(ROWS) + at([7], -0.02)
    (warning,) = late(moment, at(range(8, ROWS), 1e-12))
    assert "began at 0.160 rad, after the largest moment, 0.05 N m at 0.140 rad" in warning
    assert late(moment, at(range(7, ROWS), -1e-12)) == []  # in the very cycle is in time


def test_only_the_moment_while_bending_counts() -> None:
    moment = at([2], 0.1) + at([12], 0.05)
    settling = np.full(ROWS, float(BEND))
    settling[:5] = 0.0
    acts = at(range(10, ROWS), 1e-3)
    early = record(phase=settling, left_true_moment_y=moment, left_deviation_x=acts)
    assert run_warnings(early) == []
    assert len(late(moment, acts)) == 1


def test_axes_that_never_move_an_arm_are_said_and_none_are_not() -> None:
    moment = at([7], 0.05)
    on = "compliance.x={b=7.0, k=575.0, from_alpha_rad=2.0}"
    (warning,) = late(moment, np.zeros(ROWS), on)
    assert "the compliance moved no arm" in warning
    assert late(moment, np.zeros(ROWS)) == []  # fig6 has no compliance
    assert late(np.zeros(ROWS), np.zeros(ROWS), on) == []  # and nothing to reduce


def test_the_papers_compliance_comes_after_the_peak_and_an_earlier_one_does_not() -> None:
    """Simulated: the first piece of the path, 0 to 0.2 rad, has the largest moment."""
    result = BendingRun(load_scenario(STRIP8, SHORT)).run()
    (warning,) = run_warnings(result)
    moment = np.abs(result["left_true_moment_y"]) * (result["phase"] == BEND)
    where = float(result["nominal_alpha"][np.argmax(moment)])
    assert where < 0.2
    assert f"{moment.max():.3g} N m at {where:.3f} rad" in warning
    begins = [f"compliance.x.from_alpha_rad={where - 0.02!r}"]
    assert run_warnings(BendingRun(load_scenario(STRIP8, [*SHORT, *begins])).run()) == []


# --- together -------------------------------------------------------------------------------------


def test_no_shipped_scenario_is_warned_of_before_its_run() -> None:
    for name in list_scenarios():
        assert scenario_warnings(load_scenario(name)) == [], name


@pytest.mark.parametrize("name", ["exact", "fig6", "tuned", "tuned-exact"])
def test_a_shipped_run_is_not_warned_of(name: str) -> None:
    """In short; the others are longer, and fig8 and fig9 have a warning, which is true."""
    assert BendingRun(load_scenario(name, SHORT)).run().summary.warnings == []


def test_a_run_without_a_cycle_has_nothing_to_say() -> None:
    full = record()
    empty = Trace(full.trace.columns, np.empty((0, len(full.trace.columns))))
    assert run_warnings(replace(full, trace=empty)) == []


def test_the_summary_holds_those_of_before_and_after() -> None:
    settings = [*SHORT, "sheet.thickness_m=0.001", "path.end_rad=1.0", "sensor.force_range_n=2"]
    settings += UNSTOPPED
    run = BendingRun(load_scenario(STRIP6, [*settings, "motion.speed_rad_per_s=1.0"])).run()
    found = run.summary.warnings
    assert found == [*scenario_warnings(run.scenario), *run_warnings(run)]
    assert len(found) == 2
    assert run.summary.to_json()["warnings"] == found


@pytest.mark.parametrize(
    ("cycles", "longest"),
    [("0000", 0), ("", 0), ("0110", 2), ("1011", 2), ("1111", 4), ("1000", 1)],
)
def test_the_longest_run_of_cycles(cycles: str, longest: int) -> None:
    assert _in_a_row(np.array([cycle == "1" for cycle in cycles], dtype=bool)) == longest
