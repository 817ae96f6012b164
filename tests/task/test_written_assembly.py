"""The metrics and tables of an assembly of a few rows that are written down."""

import math
from dataclasses import replace

import numpy as np
import pytest

from dualbend.errors import InputError
from dualbend.planning.plan import plan_assembly
from dualbend.run.record import RunRecord
from dualbend.scenario.load import load_scenario
from dualbend.scenario.scenario import Scenario
from dualbend.scene.bed.config import HOLES
from dualbend.task.assembly.config import assembly_of
from dualbend.task.assembly.metrics import (
    final_holes,
    hole_table,
    metrics,
    middle_spacing,
    not_seated,
    peaks,
    phase_table,
    pin_table,
    seated,
    sheet_table,
    tables,
)
from dualbend.task.assembly.run import columns as columns_of
from support.rows import written_run

PWB, STACK = (load_scenario(name, ["imperfections=none"]) for name in ("pwb", "pwb-stack"))
CLEARANCE_M = assembly_of(PWB).layout.holes.clearance_m
THICKNESS_M = PWB.sheet.thickness_m
SEATED = np.zeros((4, 3))


def run(scenario: Scenario = PWB, **columns: object) -> RunRecord:
    laid = columns.pop("laid", ())
    return written_run(scenario, columns, columns_of(scenario), laid=laid)  # type: ignore[arg-type]


def phase(result_of: Scenario, *names: str) -> list[int]:
    phases = run(result_of, phase=[0]).phases
    return [phases.index(name) for name in names]


def last_hole(**offsets: float) -> dict[str, list[float]]:
    """Return columns of two rows whose last one has a hole off its pin by so much."""
    return {f"hole_{name}": [9.0, value] for name, value in offsets.items()}


# --- holes --------------------------------------------------------------------------------------


def test_each_laid_sheet_rests_on_those_before_it() -> None:
    heights = [0.0, THICKNESS_M, 2.0 * THICKNESS_M]
    laid = tuple(SEATED + np.array([1e-5, 0.0, height]) for height in heights)
    result = run(STACK, phase=[0, 0], laid=laid)
    # Exact: above what it rests on, thickness by thickness.
    np.testing.assert_allclose(
        final_holes(result), np.stack([SEATED + np.array([1e-5, 0, 0])] * 3), atol=1e-15
    )
    assert seated(result).all()
    assert metrics(result)["holes_seated"].value == 12.0
    # The second one in the place of the fourth: two thicknesses above its rest.
    high = run(STACK, phase=[0, 0], laid=(laid[0], laid[2] + [0.0, 0.0, THICKNESS_M]))
    assert seated(high)[:2].tolist() == [[True] * 4, [False] * 4]


def test_a_sheet_in_the_air_is_where_the_last_row_has_it() -> None:
    columns = last_hole(outer_left_x=3e-3, outer_left_y=-4e-3, outer_left_z=2e-3)
    holes = final_holes(run(phase=[0, 0], **columns))
    expected = SEATED.copy()
    expected[HOLES.index("outer_left")] = 3e-3, -4e-3, 2e-3
    # Exact.
    np.testing.assert_array_equal(holes, [expected])
    assert not seated(run(phase=[0, 0])).any()  # around the pins, but held
    assert final_holes(run(phase=np.zeros(0))).shape == (0, 4, 3)
    # After the last sheet nothing is in the air.
    assert final_holes(run(phase=[0, 0], laid=(SEATED,), **columns)).shape == (1, 4, 3)


@pytest.mark.parametrize(
    ("x", "y", "z", "holds"),
    [
        (0.0, 0.0, 0.0, True),
        (CLEARANCE_M / 2 + 1.9e-5, 0.0, 0.0, True),
        (CLEARANCE_M / 2 + 2.1e-5, 0.0, 0.0, False),
        (0.0, -CLEARANCE_M / 2 - 1.9e-5, 0.0, True),
        (0.0, -CLEARANCE_M / 2 - 2.1e-5, 0.0, False),
        (0.8 * CLEARANCE_M / 2, 0.8 * CLEARANCE_M / 2, 0.0, True),
        (0.9 * CLEARANCE_M / 2, 0.9 * CLEARANCE_M / 2, 0.0, False),
        (0.0, 0.0, 0.49e-3, True),
        (0.0, 0.0, 0.51e-3, False),
        (0.0, 0.0, -0.51e-3, False),
    ],
)
def test_a_seated_hole_is_around_its_pin_and_down(
    x: float, y: float, z: float, holds: bool
) -> None:
    """Half the clearance and 20 µm from the axis, within half a millimetre of its rest."""
    holes = SEATED.copy()
    holes[1] = x, y, z
    assert seated(run(phase=[0], laid=(holes,))).tolist() == [[True, holds, True, True]]


def test_a_thicker_pin_leaves_its_hole_less_room() -> None:
    tight = load_scenario("pwb", ["task.layout.pins.thicker_m=[0, 1e-4, 0, 0]"])
    for x, holds in ((0.69e-4, True), (0.71e-4, False)):
        laid = SEATED + np.array([x, 0.0, 0.0])
        assert seated(run(tight, phase=[0], laid=(laid,))).tolist() == [[True, holds, True, True]]


def test_no_hole_is_seated_on_a_pin_that_is_missing() -> None:
    gone = load_scenario("pwb", ['task.layout.pins.missing=["outer_left"]'])
    result = run(gone, phase=[0], laid=(SEATED,))
    assert seated(result).tolist() == [[True, True, False, True]]
    assert not_seated(result, 0) == "there is no outer_left pin"
    assert metrics(result)["wrong_seat_checks"].value == 1.0  # it was let go
    assert not_seated(run(phase=[0], laid=(SEATED,)), 0) == ""


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("thicker_m=[0, 0.01, 0, 0]", r"pins\.thicker_m\[1\]"),
        ("thicker_m=[0, 0]", r"pins\.thicker_m"),
        ('missing=["left"]', r"pins\.missing"),
    ],
)
def test_pins_that_cannot_be_are_refused(setting: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        load_scenario("pwb", [f"task.layout.pins.{setting}"])


def test_the_table_of_holes_is_the_offsets_and_the_verdict() -> None:
    holes = SEATED.copy()
    holes[2] = 3e-4, -4e-4, 1e-4
    result = run(phase=[0], laid=(holes,))
    table = hole_table(result)
    assert [row["hole"] for row in table] == list(HOLES)
    assert [row["seated"] for row in table] == [True, True, False, True]
    # Exact.
    assert table[2] == {
        "sheet": 0,
        "hole": HOLES[2],
        "offset_x_m": 3e-4,
        "offset_y_m": -4e-4,
        "offset_m": pytest.approx(5e-4, rel=1e-12),
        "height_m": 1e-4,
        "seated": False,
    }
    found = metrics(result)
    assert found["worst_hole_offset"].value == pytest.approx(5e-4)
    assert found["worst_hole_height"].value == pytest.approx(1e-4)
    assert found["holes_seated"].value == 3.0


# --- peaks and phases ---------------------------------------------------------------------------


def test_peaks_are_the_larger_of_both_arms_and_of_all_pins() -> None:
    result = run(
        phase=[0, 0, 0],
        left_true_moment_y=[0.1, -0.4, 0.0],
        right_true_moment_y=[0.2, 0.3, -0.5],
        left_true_force_x=[1.0, 0.0, 0.0],
        left_true_force_y=[2.0, 0.0, 0.0],
        left_true_force_z=[2.0, 0.0, 0.0],
        right_true_force_z=[0.0, -4.0, 1.0],
        pin_force_middle_right=[0.0, 5.0, 0.0],
        pin_force_outer_left=[1.0, 0.0, 7.0],
        edge_force_outer_right=[0.0, 0.5, 0.0],
        bend_003=[0.0, 0.0, -0.02],
        ik_position=[-1e-9, 0.0, 0.0],
    )
    found = peaks(result)
    # Exact.
    assert found["peak_moment"].tolist() == [0.2, 0.4, 0.5]
    assert found["peak_force"].tolist() == pytest.approx([3.0, 4.0, 1.0])
    assert found["peak_pin_force"].tolist() == [1.0, 5.0, 7.0]
    assert found["peak_edge_force"].tolist() == [0.0, 0.5, 0.0]
    assert found["ik_residual_max"].tolist() == [1e-9, 0.0, 0.0]
    spacing = PWB.sheet.length_m / PWB.sheet.model.sections
    strain = 0.02 / spacing * THICKNESS_M / 2.0
    assert found["peak_surface_strain"].tolist() == pytest.approx([0.0, 0.0, strain])
    numbers = {name: metric.value for name, metric in metrics(result).items()}
    for name, signal in found.items():
        assert numbers[name] == signal.max()
    assert [row["peak_force_n"] for row in pin_table(result)] == [0.0, 5.0, 7.0, 0.0]
    assert [row["peak_edge_force_n"] for row in pin_table(result)] == [0.0, 0.0, 0.0, 0.5]
    assert [row["pin"] for row in pin_table(result)] == list(HOLES)
    units = {name: metric.unit for name, metric in metrics(result).items()}
    assert units["peak_moment"] == "N m"
    assert {units[f"peak_{part}"] for part in ("force", "pin_force", "edge_force")} == {"N"}
    assert "ik_rotation_residual_max" not in units


def test_a_phase_begins_where_phase_attempt_or_sheet_changes() -> None:
    lift, bend = phase(PWB, "lift", "bend")
    result = run(
        time=np.arange(7) * 0.028,
        phase=[lift, lift, bend, bend, bend, bend, lift],
        attempt=[0, 0, 0, 0, 1, 1, 1],
        sheet=[0, 0, 0, 0, 0, 1, 1],
        left_true_moment_y=[0.1, 0.2, 0.3, 0.0, 0.4, 0.5, 0.6],
        right_true_force_z=[1.0, 2.0, 3.0, 0.0, 4.0, 5.0, 6.0],
        pin_force_outer_left=[10.0, 20.0, 30.0, 0.0, 40.0, 50.0, 60.0],
    )
    rows = phase_table(result)
    # Exact.
    assert [(row["phase"], row["attempt"], row["sheet"]) for row in rows] == [
        ("lift", 0, 0),
        ("bend", 0, 0),
        ("bend", 1, 0),
        ("bend", 1, 1),
        ("lift", 1, 1),
    ]
    assert [row["start_s"] for row in rows] == pytest.approx([0, 0.056, 0.112, 0.14, 0.168])
    assert [row["time_s"] for row in rows] == pytest.approx([0.056, 0.056, 0.028, 0.028, 0.028])
    for name, size in (("moment_nm", 0.1), ("force_n", 1.0), ("pin_force_n", 10.0)):
        found = [row[f"peak_{name}"] for row in rows]
        assert found == pytest.approx([2 * size, 3 * size, 4 * size, 5 * size, 6 * size])
    assert phase_table(run(phase=np.zeros(0))) == []
    assert tables(result) == {
        "phases": rows,
        "sheets": sheet_table(result),
        "holes": hole_table(result),
        "pins": pin_table(result),
    }


def test_a_sheet_has_its_retries_its_time_its_peak_and_what_was_learned() -> None:
    lower, lift = phase(PWB, "lower", "lift")
    result = run(
        STACK,
        phase=[lift, lower, lower, lift, lower],
        attempt=[0, 0, 1, 0, 0],
        sheet=[0, 0, 0, 1, 1],
        pin_force_outer_left=[1.0, 2.0, 5.0, 3.0, 4.0],
    )
    result = replace(result, lessons=({"found_x_m": 1e-3, "learned": True},))
    # Exact: cycles of 28 ms; the second sheet has not been found seated.
    first, second = sheet_table(result)
    assert (first.pop("time_s"), second.pop("time_s")) == pytest.approx((0.084, 0.056))
    told = {"sheet": 0, "retries": 1, "peak_pin_force_n": 5.0, "found_x_m": 1e-3, "learned": True}
    assert first == told
    assert second == {"sheet": 1, "retries": 0, "peak_pin_force_n": 4.0}
    assert sheet_table(run(phase=np.zeros(0))) == []


def test_a_retry_is_a_lowering_after_the_first() -> None:
    lowering = [name for name in run(phase=[0]).phases if "lower" in name]
    numbers = phase(PWB, *lowering)
    other = phase(PWB, "lift")[0]
    rows = [(other, 0), (other, 1), *((number, a) for number in numbers for a in (0, 1, 2))]
    result = run(phase=[row[0] for row in rows], attempt=[row[1] for row in rows])
    # Exact: two of each way of lowering; attempts of other phases are none.
    assert metrics(result)["retries"].value == 2.0 * len(lowering)
    assert len(lowering) >= 1


# --- the bent sheet's holes ---------------------------------------------------------------------


def test_the_spacing_of_the_middle_holes_is_along_the_chord_at_the_end_of_the_bending() -> None:
    layout = assembly_of(PWB).layout
    pair = layout.holes.middle
    lift, bend = phase(PWB, "lift", "bend")
    closer, aside = -3e-3, 4e-3
    result = run(
        phase=[bend, bend, lift],
        hole_middle_left_x=[9.0, -1e-3, 7.0],
        hole_middle_right_x=[9.0, -1e-3 + closer, 7.0],
        hole_middle_left_y=[9.0, 5e-4, 7.0],
        hole_middle_right_y=[9.0, 5e-4 + aside, 7.0],
    )
    # Analytic: the distance of the two holes less what they are apart across, by Pythagoras.
    along, across = 2.0 * pair.along_m + closer, 2.0 * pair.across_m + aside
    expected = math.sqrt(along**2 + across**2 - (2.0 * pair.across_m) ** 2)
    assert middle_spacing(result) == pytest.approx(expected, rel=1e-12)
    plan = plan_assembly(PWB.sheet.sheet(), layout.holes, layout.pins)
    nominal = plan.spacing_m(PWB.path.end_rad)
    error = metrics(result)["middle_spacing_error"]
    assert error.value == pytest.approx(expected - nominal, abs=1e-15)
    assert error.unit == "m"
    assert middle_spacing(run(phase=[lift])) is None
    assert metrics(run(phase=[lift]))["middle_spacing_error"].value is None


def test_holes_off_the_centre_line_are_as_far_apart_along() -> None:
    """A pair at (−a, −b) and (a, b) that lies as it should is 2 a apart along, whatever b is."""
    scenario = load_scenario(
        "pwb", [f"task.layout.holes.middle.{part}" for part in ("along_m=0.05", "across_m=0.012")]
    )
    (bend,) = phase(scenario, "bend")
    along = assembly_of(scenario).layout.holes.middle.along_m
    # Exact.
    assert along == 0.05
    assert middle_spacing(run(scenario, phase=[bend])) == pytest.approx(0.1, rel=1e-12)
    # Analytic, by Pythagoras: 24 mm apart across, and now one more.
    aside = middle_spacing(run(scenario, phase=[bend], hole_middle_right_y=1e-3))
    assert aside == pytest.approx(math.sqrt(0.1**2 + 0.025**2 - 0.024**2), rel=1e-12)
