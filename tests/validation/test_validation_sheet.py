"""The strips in ideal grips against the rod, and their vibration between clamps."""

import math

import mujoco
import numpy as np
import pytest
from scipy import optimize

from dualbend.beam import elastica
from dualbend.beam.path import ExactPath
from dualbend.beam.sheet import GRAVITY_M_PER_S2
from dualbend.scene.sheet.strips import bend_joint
from dualbend.types import Vector
from dualbend.validation.cases import modes
from dualbend.validation.cases import sheet as vs
from dualbend.validation.cases.ideal_grips import gripped_strips, place_grips

SHEET, STRIPS = vs.default_sheet()
EXACT = ExactPath(SHEET.length_m, 1.0)
GENTLE = np.array([0.2, 0.3])


def test_every_load_row_passes_on_a_coarse_set_of_points() -> None:
    rows = list(vs.load_rows(points=4))
    assert len(rows) == 8  # two paths, with and without weight, force and moment
    assert [row.name for row in rows if not row.passed] == []
    # Discretisation-limited, O(h²): an error of nothing would mean that nothing was simulated.
    assert all(row.error > 1e-4 for row in rows)


@pytest.mark.parametrize("hinges", [6, 10])
def test_force_of_the_strips_is_low_by_the_dispersion_of_their_hinges(hinges: int) -> None:
    found = vs.settled_loads(SHEET, hinges, EXACT, GENTLE, weight=False).force_n
    wanted = elastica.end_force(GENTLE, SHEET.bending_stiffness_nm2, SHEET.length_m)
    # Discretisation: a chain of hinges bends as 2 sin(π h/2L) and not as π h/L: −(π/N)²/12 of P.
    # The next order and the end slope change that by less than a tenth here.
    expected = -((math.pi / hinges) ** 2) / 12.0
    np.testing.assert_allclose(found / wanted - 1.0, expected, rtol=0.1)


def test_order_of_convergence_is_two() -> None:
    # Discretisation-limited: 2 by design, the fit's own error is of the next order.
    assert vs.convergence_order((10, 20), points=2) == pytest.approx(2.0, abs=0.05)


def test_reference_loads_are_the_closed_form_on_the_exact_path() -> None:
    loads = vs.reference_loads(SHEET, EXACT, GENTLE, weight=False)
    wanted = elastica.end_force(GENTLE, SHEET.bending_stiffness_nm2, SHEET.length_m)
    np.testing.assert_allclose(loads.force_n, wanted, rtol=1e-6)  # analytic
    np.testing.assert_allclose(loads.moment_nm, 0.0, atol=1e-8)  # analytic


def test_weight_of_the_hanging_sheet_lowers_the_force_of_strips_and_rod_alike() -> None:
    loads = [
        vs.settled_loads(SHEET, STRIPS.hinges, EXACT, GENTLE, weight=weight).force_n
        for weight in (False, True)
    ]
    rod = [
        vs.reference_loads(SHEET, EXACT, GENTLE, weight=weight).force_n for weight in (False, True)
    ]
    drop, expected = loads[0] - loads[1], rod[0] - rod[1]
    assert np.all(expected > 0.0)
    # Discretisation-limited: 0.2 % of P is 1 % of the drop.
    np.testing.assert_allclose(drop, expected, rtol=0.01)


def test_first_peak_is_the_published_shape_factor() -> None:
    # Golden: peak |M| L / EI of the first 0.2 rad piece, from the solver's own study.
    factor = vs.first_peak_moment(SHEET) * SHEET.length_m / SHEET.bending_stiffness_nm2
    assert factor == pytest.approx(0.402, abs=0.001)


def test_frequency_error_falls_with_the_square_of_the_spacing() -> None:
    theory = modes.theoretical_frequencies(SHEET)
    errors = []
    for hinges in (20, 40):
        strips = type(STRIPS)(hinges=hinges)
        found, _ = modes.clamped_modes(gripped_strips(SHEET, strips, weight=False), hinges)
        errors.append(found[:3] / theory - 1.0)
    # Discretisation-limited: order two within 3 %.
    np.testing.assert_allclose(np.log2(errors[0] / errors[1]), 2.0, rtol=0.03)


def test_frequency_rows_pass() -> None:
    rows = list(modes.frequency_rows())
    assert len(rows) == 3
    assert all(row.passed for row in rows)


AMPLITUDE_RAD, PERIODS = 1e-4, 25


def ring_down(step_s: float, weld_time_s: float = 0.004) -> tuple[float, float]:
    """Return frequency [Hz] and damping ratio of the shipped sheet's first mode when simulated.

    The integrator treats the hinges implicitly, which adds a damping ratio of about ω h / 2 to the
    configured 0.02: at the shipped step of 1.75 ms the first mode has 0.11 and is 1.2 % slow, the
    second 0.30 and 9 %; at 0.1 ms, with a weld of 0.2 ms, the first has 0.025. Statics, which are
    what bending at 0.1 rad/s is about, do not feel it.
    """
    model = gripped_strips(SHEET, STRIPS, weight=False, step_s=step_s, weld_time_s=weld_time_s)
    data = mujoco.MjData(model)
    place_grips(data, 0.0, SHEET.length_m / 2.0)
    frequencies, shapes = modes.clamped_modes(model, STRIPS.hinges)
    shape = shapes[:, 0] / np.abs(shapes[6:, 0]).max()
    mujoco.mj_integratePos(model, data.qpos, shape, AMPLITUDE_RAD)
    watched = model.joint(bend_joint(STRIPS.hinges // 2)).qposadr[0]
    count = round(PERIODS / frequencies[0] / step_s)
    angle = np.empty(count)
    for i in range(count):
        mujoco.mj_step(model, data)
        angle[i] = data.qpos[watched] / AMPLITUDE_RAD
    times = step_s * np.arange(1, count + 1)

    def residual(p: Vector) -> Vector:
        phase = 2.0 * np.pi * p[0] * times
        swing = p[2] * np.cos(phase) + p[3] * np.sin(phase)
        return np.asarray(np.exp(-p[1] * 2.0 * np.pi * p[0] * times) * swing - angle)

    fit = optimize.least_squares(residual, [0.97 * frequencies[0], 0.1, angle[0], 0.0])
    return float(fit.x[0]), float(fit.x[1])


@pytest.mark.parametrize(("step_s", "weld_s"), [(2.5e-4, 5e-4), (1.75e-3, 4e-3)])
def test_implicit_hinges_add_half_a_step_of_phase_as_damping(step_s: float, weld_s: float) -> None:
    frequency, ratio = ring_down(step_s, weld_s)
    omega = 2.0 * math.pi * modes.theoretical_frequencies(SHEET)[0]
    # First order in ω h: ω h / 2 on top of the configured ratio; the next order is below 3 %.
    assert ratio == pytest.approx(STRIPS.damping_ratio + omega * step_s / 2.0, rel=0.03)
    assert frequency == pytest.approx(omega / (2.0 * math.pi), rel=0.02)


def test_sheet_of_the_rows_is_the_shipped_one() -> None:
    assert SHEET.weight_per_length_n_per_m == pytest.approx(
        SHEET.mass_kg * GRAVITY_M_PER_S2 / SHEET.length_m
    )
    assert STRIPS.hinges == 20
