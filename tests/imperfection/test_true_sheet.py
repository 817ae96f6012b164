"""The sheet that is another one than believed: drawn from the seed, felt by the physics alone."""

import msgspec
import numpy as np
import pytest

from dualbend.beam.sheet import Sheet
from dualbend.errors import InputError
from dualbend.imperfection.sheet import SheetErrors, true_sheet
from dualbend.run.record import RunRecord
from dualbend.scenario.load import load_scenario
from dualbend.scene.sheet.strips import bend_joint
from dualbend.task.bending.run import BendingRun
from support.strip import STRIP6

KEY = "imperfections.sheet"
SHORT = ("imperfections=none", "path.end_rad=0.2", "motion.hold_s=0.5", "sheet.model.hinges=10")
BELIEVED = load_scenario("exact", SHORT).sheet.sheet()


def run(*settings: str) -> RunRecord:
    return BendingRun(load_scenario("exact", [*SHORT, *settings])).run()


def held(result: RunRecord, column: str) -> float:
    """Return a column at the end of the run, where the sheet has been held for half a second."""
    return float(result.trace[column][-1])


def test_no_errors_are_the_believed_sheet_itself() -> None:
    assert true_sheet(BELIEVED, SheetErrors(), 7) is BELIEVED


def test_ratios_and_spreads_make_the_true_sheet() -> None:
    errors = SheetErrors(thickness_ratio=1.1, modulus_ratio=0.9, curvature_per_m=0.2)
    true = true_sheet(BELIEVED, errors, 1)
    # Analytic: E I goes with E t³.
    expected = 0.9 * 1.1**3 * BELIEVED.bending_stiffness_nm2
    assert true.bending_stiffness_nm2 == pytest.approx(expected, rel=1e-12)
    assert true.mass_kg == pytest.approx(1.1 * BELIEVED.mass_kg, rel=1e-12)
    assert true.rest_curvature_per_m == 0.2


def test_spreads_are_drawn_from_the_seed_around_the_ratios() -> None:
    errors = SheetErrors(
        thickness_ratio=1.1, thickness_spread=0.05, modulus_spread=0.1, curvature_spread_per_m=0.3
    )
    drawn = [true_sheet(BELIEVED, errors, seed) for seed in range(400)]
    assert true_sheet(BELIEVED, errors, 3) == drawn[3]

    def numbers(value: str, scale: float) -> np.ndarray:
        return np.array([getattr(sheet, value) for sheet in drawn]) / scale

    # Statistical, 400 draws: the mean within 4 s / sqrt(n), the deviation within 15 %.
    for values, mean, spread in (
        (numbers("thickness_m", BELIEVED.thickness_m), 1.1, 0.055),
        (numbers("young_pa", BELIEVED.young_pa), 1.0, 0.1),
        (numbers("rest_curvature_per_m", 1.0), 0.0, 0.3),
    ):
        assert values.mean() == pytest.approx(mean, abs=4.0 * spread / 20.0)
        assert values.std() == pytest.approx(spread, rel=0.15)
        assert np.abs(values - mean).max() <= 3.0 * spread * (1.0 + 1e-12)


def test_a_sheet_curved_at_rest_turns_the_grips_by_ei_kappa_and_pushes_no_more() -> None:
    flat, curved = run(), run(f"{KEY}.curvature_per_m=0.1")
    moment = BELIEVED.bending_stiffness_nm2 * 0.1
    for column in ("left_true_moment_y", "right_true_moment_y"):
        # Analytic: a uniform moment is in equilibrium with any shape between two clamps, and turns
        # both grips the way the path does. What pads and arms yield to it: 3 %.
        change = held(curved, column) - held(flat, column)
        assert change == pytest.approx(moment, rel=0.03)
    assert held(curved, "left_true_force_x") == pytest.approx(
        held(flat, "left_true_force_x"), rel=0.02
    )


def test_the_free_sheet_has_its_curvature() -> None:
    scenario = load_scenario("exact", [*SHORT, f"{KEY}.curvature_per_m=0.5"])
    model = BendingRun(scenario).cell.simulation.model
    angles = [model.qpos_spring[model.joint(bend_joint(i)).qposadr[0]] for i in range(10)]
    # Analytic: κ L/N a hinge, the slope falling along the sheet as on the path.
    assert angles == pytest.approx([-0.5 * BELIEVED.length_m / 10.0] * 10, rel=1e-12)


def test_the_strain_is_that_of_the_true_sheet() -> None:
    straight = Sheet(**{**vars(BELIEVED), "rest_curvature_per_m": 0.5})
    angles = np.full((1, 10), -0.5 * BELIEVED.length_m / 10.0)
    # Analytic: at its rest curvature nothing is strained, laid flat it is by κ₀ t/2.
    assert straight.surface_strain(angles)[0] == pytest.approx(0.0, abs=1e-15)
    flat = straight.surface_strain(np.zeros((1, 10)))[0]
    assert flat == pytest.approx(0.25 * BELIEVED.thickness_m, rel=1e-12)


def test_the_controller_and_the_path_know_the_believed_sheet() -> None:
    settings = [*SHORT, f"{KEY}.thickness_ratio=1.2"]
    prepared = BendingRun(load_scenario("tuned", settings))
    assert prepared.cell.sheet.thickness_m == pytest.approx(1.2 * BELIEVED.thickness_m)
    plain = BendingRun(load_scenario("tuned", SHORT))
    np.testing.assert_array_equal(prepared.motion.half_distance_m, plain.motion.half_distance_m)
    known, believed = (msgspec.to_builtins(r.scenario.sheet) for r in (prepared, plain))
    assert known == believed


def test_a_stiffer_sheet_is_that_of_the_higher_modulus() -> None:
    true = run(f"{KEY}.modulus_ratio=1.2")
    believed = run(f"sheet.young_pa={BELIEVED.young_pa * 1.2!r}")
    # Without compliance nobody asks what is believed: the same physics to the last bit.
    for column in ("left_true_force_x", "right_true_moment_y"):
        np.testing.assert_array_equal(true[column], believed[column])


def test_a_curved_shell_is_refused() -> None:
    with pytest.raises(InputError, match="a shell is flat at rest"):
        load_scenario(STRIP6, [f"{KEY}.curvature_per_m=0.1", 'sheet.model.kind="shell"'])


@pytest.mark.parametrize("name", ["thickness_ratio=0.1", "curvature_spread_per_m=-1"])
def test_bounds_are_kept(name: str) -> None:
    with pytest.raises(InputError, match=name.split("=", maxsplit=1)[0]):
        load_scenario(STRIP6, [f"{KEY}.{name}"])


def test_a_run_with_all_of_them_is_the_same_again() -> None:
    settings = (f"{KEY}.thickness_spread=0.02", f"{KEY}.curvature_spread_per_m=0.1")
    one, again = run(*settings), run(*settings)
    for name in ("left_true_moment_y", "right_true_force_x", "bend_003", "sag"):
        np.testing.assert_array_equal(one.trace[name], again.trace[name])
