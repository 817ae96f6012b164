"""The metrics of bending runs of a few rows that are written down."""

import math

import numpy as np
import pytest

from dualbend.beam import elastica
from dualbend.evaluation.fingerprint import model_fingerprint
from dualbend.evaluation.metrics import (
    bending_rows,
    common_metrics,
    finite,
    listed,
    peak,
    peak_by_piece,
    side_by_side,
    surface_strain,
)
from dualbend.evaluation.peaks import common_peaks, last_place, peak_places
from dualbend.evaluation.recorded_rod import recorded_rods, reference_moments
from dualbend.run.record import Metric, RunRecord
from dualbend.scenario.load import load_scenario
from dualbend.scenario.scenario import Scenario
from dualbend.task.bending.metrics import metrics, peaks, permanent_set
from support.rows import written_run
from support.strip import STRIP8

FIG8 = load_scenario(STRIP8, ["sheet.model.hinges=4"])
RIGHT = load_scenario(STRIP8, ["sheet.model.hinges=4", 'compliance.sensing=["right"]'])
NAN = math.nan
# Phases of a bending run: settle, bend, hold; the sheet is bent in rows 1 to 4.
PHASE = [0, 1, 1, 1, 1, 2]


def run(scenario: Scenario = FIG8, **columns: object) -> RunRecord:
    return written_run(scenario, {"phase": PHASE, **columns})


def value(found: dict[str, Metric], name: str) -> object:
    return found[name].value


@pytest.mark.parametrize(("scenario", "side"), [(FIG8, "left"), (RIGHT, "right")])
def test_moments_and_forces_are_those_of_the_sensing_arm_while_it_bends(
    scenario: Scenario, side: str
) -> None:
    other = "right" if side == "left" else "left"
    result = run(
        scenario,
        **{
            f"{side}_true_moment_y": [9.0, 0.1, -0.7, 0.5, 0.3, 8.0],
            f"{side}_true_force_x": [50.0, 3.0, -6.0, 1.0, 0.0, 60.0],
            f"{side}_true_force_z": [50.0, 4.0, 8.0, 1.0, 0.0, 60.0],
            f"{other}_true_moment_y": 100.0,
            f"{other}_true_force_x": 100.0,
            f"{side}_deviation_x": [0.0, 1e-3, -4e-3, 0.0, 0.0, 5e-3],
            f"{side}_deviation_alpha": [-0.02, 0.0, 0.01, 0.0, 0.0, 0.0],
            f"{other}_deviation_x": 1.0,
        },
    )
    found = metrics(result)
    # Exact: read off the rows.
    assert value(found, "peak_moment") == 0.7
    assert value(found, "peak_force") == 10.0
    assert value(found, "rms_moment") == pytest.approx(math.sqrt((0.01 + 0.49 + 0.25 + 0.09) / 4))
    # A deviation counts in all phases: it may grow while the arms hold.
    assert value(found, "peak_deviation_x") == 5e-3
    assert value(found, "peak_deviation_alpha") == 0.02
    units = {name: metric.unit for name, metric in found.items()}
    assert units["peak_moment"] == units["rms_moment"] == units["peak_moment_by_piece"] == "N m"
    assert (units["peak_force"], units["peak_deviation_x"]) == ("N", "m")
    assert "peak_lateral_force" not in found
    assert "permanent_curvature" not in found


@pytest.mark.parametrize(
    ("phase", "expected"),
    [
        # Exact: of four held rows the last two count, of three too; signs cancel.
        ([1, 2, 2, 2, 2, 3], 0.5 * abs(-0.4 + 0.1)),
        ([0, 1, 2, 2, 2, 3], 0.5 * abs(-0.4 + 0.1)),
        ([0, 1, 1, 1, 1, 1], None),
    ],
)
def test_the_mean_moment_of_the_hold_is_that_of_its_second_half(
    phase: list[int], expected: float | None
) -> None:
    result = run(phase=phase, left_true_moment_y=[9.0, 8.0, 7.0, -0.4, 0.1, 6.0])
    assert value(metrics(result), "mean_moment_hold") == pytest.approx(expected)


def test_the_mean_moment_of_the_hold_has_no_noise_but_a_constant() -> None:
    """Analytic: an oscillation of whole periods about −3 mN m has the mean of 3 mN m."""
    turns = 2.0 * np.pi * np.arange(40) / 10.0
    result = run(phase=[2] * 40, left_true_moment_y=-3e-3 + 0.5 * np.cos(turns))
    assert value(metrics(result), "mean_moment_hold") == pytest.approx(3e-3, rel=1e-12)


def test_only_misaligned_grips_have_peaks_out_of_the_plane() -> None:
    scenario = load_scenario(
        STRIP8, ["sheet.model.hinges=4", "task.misalignment.right.lateral_m=5e-4"]
    )
    result = run(
        scenario,
        left_true_force_y=[9.0, -2.0, 1.0, 0.0, 0.0, 9.0],
        left_true_moment_x=[9.0, 0.1, -0.3, 0.0, 0.0, 9.0],
        left_true_moment_z=[9.0, 0.0, 0.0, 0.4, 0.0, 9.0],
    )
    found = metrics(result)
    # Exact.
    assert found["peak_lateral_force"] == Metric(2.0, "N")
    assert found["peak_twist_moment"] == Metric(0.3, "N m")
    assert found["peak_yaw_moment"] == Metric(0.4, "N m")


def test_each_piece_has_its_own_peak_and_a_skipped_one_has_none() -> None:
    """fig8 has knots every 0.2 rad; the nominal angle steps over one piece."""
    result = run(
        nominal_alpha=[0.0, 0.05, 0.199, 0.2, 0.65, 0.7],
        left_true_moment_y=[9.0, 0.3, -0.5, 0.4, -0.2, 9.0],
    )
    found = peak_by_piece(result)
    # Exact: a knot belongs to the piece that begins there.
    assert found[:2] == [0.5, 0.4]
    assert math.isnan(found[2])
    assert found[3:] == [0.2]
    assert metrics(result)["peak_moment_by_piece"].value == [0.5, 0.4, None, 0.2]


def test_before_and_beyond_the_path_are_its_first_and_last_piece() -> None:
    knots = FIG8.path.make(FIG8.sheet.length_m).knots
    moments = [0.0, 0.1, 0.2, 0.3, 0.4, 0.0]
    alphas = [0.0, -0.01, 0.1, knots[-1], knots[-1] + 0.01, 0.0]
    found = peak_by_piece(run(nominal_alpha=alphas, left_true_moment_y=moments))
    assert len(found) == len(knots) - 1
    assert (found[0], found[-1]) == (0.2, 0.4)
    assert peak_by_piece(written_run(FIG8, {"phase": [0, 2]})) == []


def test_a_run_that_did_not_bend_has_no_moment() -> None:
    found = metrics(written_run(FIG8, {"phase": [0, 0], "left_true_moment_y": 5.0}))
    for name in ("peak_moment", "rms_moment", "peak_force"):
        assert value(found, name) is None
    assert value(found, "peak_moment_by_piece") == []


def test_the_surface_strain_is_that_of_the_largest_bend() -> None:
    result = run(bend_000=[0.0, 0.01, 0, 0, 0, 0], bend_002=[0.0, -0.02, 0.03, 0, 0, 0])
    spacing = FIG8.sheet.length_m / 4
    # Analytic: |Δθ| t / (2 h).
    expected = np.array([0.0, 0.02, 0.03, 0, 0, 0]) * FIG8.sheet.thickness_m / (2.0 * spacing)
    np.testing.assert_allclose(surface_strain(result), expected, rtol=1e-14)
    assert value(metrics(result), "peak_surface_strain") == pytest.approx(expected.max())


def test_what_every_run_has() -> None:
    result = run(
        ik_position=[0.0, 1e-9, NAN, 3e-9, -4e-9, 0.0],
        ik_rotation=[0.0, 2e-8, 0.0, 0.0, 0.0, NAN],
        saturated=[0.0, 1.0, 1.0, NAN, 1.0, 0.0],
    )
    found = common_metrics(result)
    # Exact: a row that was not completed has no number and does not count.
    assert found == {
        "ik_residual_max": Metric(4e-9, "m"),
        "ik_rotation_residual_max": Metric(2e-8, "rad"),
        "unintended_contacts": Metric(0.0, "1"),
        "saturated_cycles": Metric(3.0, "1"),
        "simulated_time": Metric(6 * 0.028, "s"),
        "realtime_factor": Metric(3 * 0.028, "1"),
        "wall_time": Metric(2.0, "s"),
    }
    assert bending_rows(result).tolist() == [False, True, True, True, True, False]


def test_a_sheet_that_yields_keeps_its_largest_curvature_and_end_slope() -> None:
    scenario = load_scenario("springback", ["sheet.model.hinges=4"])
    sheet = scenario.sheet.sheet()
    assert sheet.plasticity is not None
    first = sheet.plasticity.first_yield(sheet.thickness_m)
    h = sheet.length_m / 4
    # Bent to three and to two times the first yield, and still held; the others stay elastic.
    bends = {
        "bend_000": np.array([0.0, 0.5, 0.5, 0.4]) * first * h,
        "bend_001": np.array([0.0, 1.5, 1.2, 3.0]) * first * h,
        "bend_002": np.array([0.0, 1.0, 1.5, 2.0]) * first * h,
        "bend_003": np.array([0.0, 0.3, 0.3, 0.2]) * first * h,
    }
    result = written_run(scenario, {"phase": [0, 1, 1, 2], **bends}, bend_stiffness=5.0)
    found = permanent_set(result)
    kept = [
        float(sheet.plasticity.residual(np.array([k * first]), sheet.thickness_m)[0])
        for k in (3.0, 2.0)
    ]
    # Discretisation-limited: the hinge's ten springs are within 2 % of the section (its own test).
    assert found["permanent_curvature"].value == pytest.approx(kept[0], rel=0.02)
    assert found["permanent_end_slope"].value == pytest.approx(sum(kept) * h / 2, rel=0.02)
    # Exact: the largest curvature of the hinge that keeps most.
    assert found["curvature_before_release"].value == pytest.approx(3.0 * first, rel=1e-12)
    assert [metric.unit for metric in found.values()] == ["1/m", "rad", "1/m"]
    empty = written_run(scenario, {"phase": np.zeros(0)}, bend_stiffness=5.0)
    assert {metric.value for metric in permanent_set(empty).values()} == {None}
    assert permanent_set(empty).keys() == found.keys()
    assert permanent_set(result).items() <= metrics(result).items()


# --- where the peaks are ------------------------------------------------------------------------


def test_a_peak_is_where_its_signal_has_exactly_its_value() -> None:
    result = run(
        time=np.arange(6) * 0.028,
        left_true_moment_y=[9.0, 0.1, -0.7, 0.7, 0.6, 9.0],
        nominal_alpha=[0.0, 0.1, 0.1, 0.1, 0.3, 0.3],
        ik_position=[0.0, 0.0, 0.0, 0.0, 0.0, 1e-9],
    )
    found = metrics(result)
    places = peak_places(result, found)
    # Exact: the first of two equal ones; of each piece; of all phases where the metric is.
    (moment,) = places["peak_moment"]
    assert moment is not None
    assert (moment.time_s, moment.phase) == (2 * 0.028, "bend")
    assert [place and place.time_s for place in places["peak_moment_by_piece"]] == [0.056, 0.112]
    (ik,) = places["ik_residual_max"]
    assert ik is not None
    assert (ik.time_s, ik.phase) == (5 * 0.028, result.phases[2])
    assert str(ik) == f"at 0.140 s, {result.phases[2]}"
    # A peak of 0 is everywhere, and what is no peak is nowhere.
    assert places["peak_force"] == [None]
    assert "rms_moment" not in places
    assert places.keys() <= peaks(result).keys()
    assert "peak_moment" not in peak_places(result, {"rms_moment": found["rms_moment"]})
    end = last_place(result)
    assert end is not None
    assert end.time_s == 5 * 0.028
    assert last_place(written_run(FIG8, {"phase": np.zeros(0)})) is None
    assert common_peaks(result)["ik_residual_max"].tolist() == [0, 0, 0, 0, 0, 1e-9]


# --- small parts --------------------------------------------------------------------------------


def test_numbers_that_are_none() -> None:
    assert peak(np.array([1.0, -3.0, NAN, 2.0])) == 3.0
    assert peak(np.array([NAN, math.inf])) is None
    assert peak(np.zeros(0)) is None
    assert (finite(2.5), finite(NAN), finite(-math.inf)) == (2.5, None, None)
    assert (listed(Metric(1.0, "N")), listed(Metric([1.0, None], "N"))) == ((1.0,), [1.0, None])


def test_runs_side_by_side_have_a_value_each_or_none() -> None:
    one = {"a": Metric(1.0, "N"), "b": Metric([1.0, 2.0], "m"), "c": Metric(5.0, "N")}
    two = {"a": Metric(3.0, "N"), "b": Metric(7.0, "m"), "c": Metric(6.0, "kN")}
    # Exact: one unit a row, a list beside a single value, what one run lacks is None.
    assert side_by_side([one, two, {}]) == {
        ("a", "N"): (1.0, 3.0, None),
        ("b[0]", "m"): (1.0, 7.0, None),
        ("b[1]", "m"): (2.0, None, None),
        ("c", "N"): (5.0, None, None),
        ("c", "kN"): (None, 6.0, None),
    }


def test_the_reference_moment_is_the_rods_between_recorded_grips_and_nan_where_there_is_none() -> (
    None
):
    alpha = 0.5
    sheet = FIG8.sheet.sheet()
    x, rise = elastica.half_distance(alpha, sheet.length_m), elastica.rise(alpha, sheet.length_m)
    poses = {}
    for side in ("left", "right"):
        # The last row has the grips farther apart than any sheet reaches.
        poses |= {
            f"{side}_grip_x": [-x, -x + 5e-4, -2.0 * x],
            f"{side}_grip_z": rise,
            f"{side}_grip_alpha": alpha,
            f"{side}_edge_x": [-x, -x + 5e-4, -2.0 * x],
            f"{side}_edge_z": rise,
            f"{side}_edge_alpha": [alpha, alpha, alpha],
        }
    result = written_run(FIG8, {"phase": [1, 1, 1], **poses})
    for place in ("grip", "edge"):
        first, second, third = reference_moments(result, place, np.array([0, 1, 2]))
        states = recorded_rods(result, place, np.array([0, 1, 2]))
        # Analytic: on the zero-moment path the weight's moment alone is left, some mN m; the grips
        # nearer by 1 mm bend by EI/L times what dM/dx says.
        assert first == states[0].left.moment_nm
        assert abs(first) < 0.02
        tangent = states[0].symmetric_stiffness().moment_per_distance_n
        assert second - first == pytest.approx(-5e-4 * tangent, rel=0.05)
        assert math.isnan(third)
    backward = reference_moments(result, "grip", np.array([1, 0]))
    assert backward[1] == pytest.approx(first, abs=1e-9)


def test_a_fingerprint_tells_names_and_seven_digits_of_every_number() -> None:
    import mujoco

    def of(mass: str, name: str = "a", tiny: str = "0") -> str:
        text = f"""<mujoco><worldbody><body name="{name}" pos="{tiny} 0 0"><freejoint/>
          <geom size="1" mass="{mass}"/></body></worldbody></mujoco>"""
        return model_fingerprint(mujoco.MjModel.from_xml_string(text))

    same = of("2")
    assert of("2.0000001") == same  # the eighth digit
    assert of("2.000001") != same  # the seventh
    assert of("20") != same  # the exponent
    assert of("2", name="b") != same
    assert of("2", tiny="1e-10") == same  # the rest of a difference that should be 0
    assert of("2", tiny="1e-8") != same
