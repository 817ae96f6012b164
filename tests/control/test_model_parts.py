"""What the admittance with a model knows and predicts, each part against its own closed form."""

import math
from typing import Any

import msgspec
import numpy as np
import pytest
from scipy import signal

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.control.compliance.admittance import ModelAdmittanceConfig
from dualbend.control.compliance.base import AxisConfig
from dualbend.control.compliance.model import ModelAdmittance
from dualbend.control.compliance.predictor import (
    PredictorConfig,
    ResponseLead,
    ResponseModel,
    lead_share,
)
from dualbend.control.compliance.reference import ReferenceConfig
from dualbend.control.compliance.schedule import FusionConfig, KnownSheet, ScheduleConfig
from dualbend.control.filters import FirConfig
from dualbend.control.response import CommandResponseConfig
from dualbend.errors import InputError
from dualbend.types import PlanarPose, Vector

T = COMMAND_PERIOD_S
RESPONSE = CommandResponseConfig(natural_frequency_hz=2.2, damping_ratio=0.8)
AXIS = AxisConfig(b=0.1, k=0.2, form="static")
ANGLES = np.array([0.1, 0.4, 1.0])
FORCES = np.array([-2.0, -5.0, -8.0])
STIFFNESS = np.array([[600.0, -17.0], [3.0, -1.3], [-17.0, 0.77]])
SOFTER = np.array([1.0, 0.5, 0.25])
INERTIA = np.array([[0.6, 0.0, 0.01], [0.0, 0.6, 0.04], [0.01, 0.04, 0.0038]])
SENT = np.array([[1.0, 0.0], [0.2, 0.0], [0.0, 1.0]])
INWARD = np.array([0.02, 0.008, 0.0, -0.003])
"""Displacements of the table's curves [m], inward positive."""


def curves() -> Vector:
    """Return the force at each displacement: about the known force, softer the more pushed in."""
    about = np.array([-6.0, -3.0, 0.0, 2.0])
    return FORCES[:, np.newaxis] + SOFTER[:, np.newaxis] * about


def known(**changed: Any) -> KnownSheet:
    parts = {
        "alpha_rad": ANGLES,
        "force_x_n": FORCES,
        "stiffness": SOFTER[:, np.newaxis, np.newaxis] * STIFFNESS,
        "inertia": np.stack([INERTIA, 2.0 * INERTIA, 3.0 * INERTIA]),
        "deviation_jacobian": np.stack([SENT, 0.9 * SENT, 0.8 * SENT]),
        "compression_m": np.stack([INWARD] * 3),
        "compression_n": curves(),
        "force_z_n": -0.15,
        "lever_arm_m": 0.12,
    }
    return KnownSheet(**{**parts, **changed})


def model(delay_cycles: int, channels: int) -> ResponseModel:
    return ResponseModel(
        response=RESPONSE,
        low_pass=FirConfig(taps=2),
        delay_cycles=delay_cycles,
        steps=16,
        age_steps=6,
        channels=channels,
        period_s=T,
    )


def made(config: ModelAdmittanceConfig, sheet: KnownSheet | None = None) -> ModelAdmittance:
    return ModelAdmittance(
        config,
        known=sheet or known(),
        response=RESPONSE,
        own=model(2, 2),
        nominal=model(0, 3),
        period_s=T,
    )


SCHEDULED = ModelAdmittanceConfig(
    units="sheet",
    x=AXIS,
    rotation=AXIS,
    schedule=ScheduleConfig(),
    limit_x_m=1e6,
    limit_rotation_rad=1e6,
)
CONSTANT = ModelAdmittanceConfig(
    x=AxisConfig(b=7.0, k=75.0),
    rotation=AxisConfig(b=0.5, k=3.0, form="static"),
    limit_x_m=1e6,
    limit_rotation_rad=1e6,
)


# --- the tables ---------------------------------------------------------------------------------


@pytest.mark.parametrize("alpha", [0.1, 0.2, 0.4, 0.85, 1.0])
def test_between_its_angles_the_table_is_linear_and_beyond_them_it_is_its_end(alpha: float) -> None:
    sheet = known()
    softer = np.interp(alpha, ANGLES, SOFTER)
    # Analytic: numpy's own interpolation of each part by itself.
    assert sheet.force(alpha) == pytest.approx(np.interp(alpha, ANGLES, FORCES), rel=1e-14)
    np.testing.assert_allclose(sheet.tangent(alpha), softer * STIFFNESS, rtol=1e-14)
    inertia, jacobian = sheet.tool(alpha)
    np.testing.assert_allclose(inertia, np.interp(alpha, ANGLES, [1, 2, 3]) * INERTIA, rtol=1e-14)
    np.testing.assert_allclose(jacobian, np.interp(alpha, ANGLES, [1, 0.9, 0.8]) * SENT, rtol=1e-14)
    for outside, end in ((-3.0, 0), (0.0, 0), (1.1, -1), (9.0, -1)):
        assert sheet.force(outside) == FORCES[end]
        np.testing.assert_array_equal(sheet.tangent(outside), SOFTER[end] * STIFFNESS)


@pytest.mark.parametrize("row", [0, 1, 2])
@pytest.mark.parametrize("share", [-1.5, -1.0, -0.9, -0.5, -0.2, 0.0, 0.3, 0.9, 1.0, 1.7])
def test_displacement_is_read_off_the_curve_and_beyond_it_off_its_tangent(
    row: int, share: float
) -> None:
    """At an angle of the table; below the first force and above the last, K₁₁ goes on."""
    sheet, softer = known(), SOFTER[row]
    force = FORCES[row] + softer * (6.0 * share if share < 0.0 else 2.0 * share)
    found = float(sheet.displacement(force, ANGLES[row]))
    inside = float(np.interp(force, curves()[row], INWARD))
    beyond = force - np.clip(force, curves()[row, 0], curves()[row, -1])
    # Analytic.
    assert found == pytest.approx(inside - beyond / (softer * 600.0), rel=1e-12, abs=1e-15)
    # Analytic: the force there is the force that was asked about, on the curve and beyond it.
    assert sheet.compression_force(found, ANGLES[row]) == pytest.approx(force, rel=1e-12)


def test_between_two_curves_the_displacement_is_theirs_in_proportion() -> None:
    sheet = known()
    ends = [float(sheet.displacement(-4.0, alpha)) for alpha in ANGLES[:2]]
    # Analytic: a quarter of the way.
    found = sheet.displacement(-4.0, 0.175)
    assert found == pytest.approx(0.75 * ends[0] + 0.25 * ends[1], rel=1e-12)


@pytest.mark.parametrize(("alpha", "row"), [(0.24, 0), (0.26, 1), (0.69, 1), (0.71, 2), (5.0, 2)])
def test_the_force_at_a_displacement_is_the_nearest_curves(alpha: float, row: int) -> None:
    for place, n in zip(INWARD, range(4), strict=True):
        # Exact: a point of the table.
        assert known().compression_force(place, alpha) == pytest.approx(curves()[row, n], rel=1e-14)


@pytest.mark.parametrize("part", ["force_x_n", "stiffness", "inertia", "deviation_jacobian"])
def test_a_table_of_another_length_is_refused(part: str) -> None:
    with pytest.raises(InputError, match="tables of 3 angles have the shapes"):
        known(**{part: getattr(known(), part)[:-1]})


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"alpha_rad": ANGLES[::-1]}, "growing angles"),
        ({"alpha_rad": np.array([0.1, 0.4, 0.4])}, "growing angles"),
        ({"alpha_rad": ANGLES[:1], "force_x_n": FORCES[:1]}, "two or more"),
        ({"compression_n": curves()[:, ::-1]}, "must grow along its rows"),
        ({"compression_n": np.zeros((3, 4))}, "must grow along its rows"),
        ({"compression_n": curves()[:, :3]}, "one number for each"),
    ],
)
def test_what_is_no_table_is_refused(changed: dict[str, Vector], says: str) -> None:
    with pytest.raises(InputError, match=says):
        known(**changed)


def test_two_angles_are_a_table() -> None:
    two = {
        name: getattr(known(), name)[:2]
        for name in ("alpha_rad", "force_x_n", "stiffness", "inertia", "deviation_jacobian")
    }
    assert known(**two).force(0.25) == pytest.approx(-3.5, rel=1e-14)  # analytic: half way


# --- the slope of the curve ---------------------------------------------------------------------


@pytest.mark.parametrize("reference", [None, ReferenceConfig(from_rad=0.4)])
@pytest.mark.parametrize("alpha", [0.05, 0.4])
def test_the_slope_is_how_much_softer_the_curve_is_than_the_tangent(
    reference: ReferenceConfig | None, alpha: float
) -> None:
    """At the reference, or at no force: within 0.3 N of it the sheet is softer than elsewhere."""
    force = -5.0 if reference else 0.0
    about = np.array([-6.3, -0.3, 0.3, 6.3])
    inward = np.array([0.012, 0.002, -0.002, -0.012])
    sheet = known(compression_m=np.stack([inward] * 3), compression_n=np.stack([force + about] * 3))
    config = msgspec.structs.replace(
        SCHEDULED, schedule=ScheduleConfig(curve=True, from_rad=0.1), reference=reference
    )
    modelled = made(config, sheet)
    tangent = np.interp(max(alpha, 0.1), ANGLES, SOFTER) * 600.0
    # Analytic: K₁₁ over the stiffness of the curve, 150 N/m.
    assert modelled.slope(modelled.point(alpha)) == pytest.approx(tangent / 150.0, rel=1e-9)
    plain = made(msgspec.structs.replace(config, schedule=ScheduleConfig()), sheet)
    assert plain.slope(plain.point(alpha)) == 1.0


# --- at rest ------------------------------------------------------------------------------------


def settled(config: ModelAdmittanceConfig, pose: PlanarPose, load: Vector) -> Vector:
    """Return the deviation after which a constant wrench changes nothing any more."""
    admittance = made(config)
    for _ in range(400):
        found = admittance.comply(load, pose)
    return found.copy()


@pytest.mark.parametrize("alpha", [0.1, 0.6])
@pytest.mark.parametrize(
    "config",
    [CONSTANT, SCHEDULED, msgspec.structs.replace(CONSTANT, fusion=FusionConfig())],
    ids=["constant", "scheduled", "fused"],
)
def test_the_compliance_at_rest_is_what_constant_loads_settle_at(
    config: ModelAdmittanceConfig, alpha: float
) -> None:
    pose = PlanarPose(np.array([-0.19, 0.7, alpha]))
    none = settled(config, pose, np.zeros(3))
    columns = [settled(config, pose, load) - none for load in np.eye(3)[::2]]
    # Analytic: the last e^(−kT/b) of a stream of 400 cycles is gone.
    rest = made(config).rest_compliance(alpha)
    np.testing.assert_allclose(rest, np.column_stack(columns), rtol=1e-9)


def test_fusion_weighs_force_and_moment_by_their_errors() -> None:
    """Analytic: least squares, e_x = (Kᵀ W K)⁻¹ Kᵀ W w with W = diag(1/σ²)."""
    config = msgspec.structs.replace(
        SCHEDULED, fusion=FusionConfig(force_error_n=0.2, moment_error_nm=0.01)
    )
    estimate = made(config).point(0.1).estimate
    scaled = np.linalg.lstsq(
        (STIFFNESS[[0, 2], 0] / [0.2, 0.01])[:, np.newaxis], np.diag([5.0, 100.0]), rcond=None
    )[0]
    np.testing.assert_allclose(estimate[0], scaled[0], rtol=1e-12)
    # The rotation complies with the moment alone.
    np.testing.assert_allclose(estimate[1], [0.0, 1.0 / STIFFNESS[2, 1]], rtol=1e-14)


@pytest.mark.parametrize("force", [-7.0, -4.2, -2.5])
def test_the_curve_tells_how_far_the_sheet_is_from_where_it_belongs(force: float) -> None:
    config = msgspec.structs.replace(
        SCHEDULED, schedule=ScheduleConfig(curve=True), reference=ReferenceConfig(from_rad=0.1)
    )
    pose = PlanarPose(np.array([-0.19, 0.7, 0.1]))
    inward, right = (float(known().displacement(each, 0.1)) for each in (force, -2.0))
    # Analytic: at rest δ = e/k with the ratio k = 0.2 and e the way back to the known force.
    found = settled(config, pose, np.array([force, 0.0, 0.0]))[0]
    assert found == pytest.approx((right - inward) / 0.2, rel=1e-9)
    # A tangent would say something else.
    assert abs(found - (force + 2.0) / 600.0 / 0.2) > 0.05 * abs(found)


# --- the prediction -----------------------------------------------------------------------------


@pytest.mark.parametrize("inertia", [True, False])
def test_the_nominal_motion_of_the_known_tool_is_no_error(inertia: bool) -> None:
    """The sensor reads the known force and −M q̈ of a path that is carried out late and filtered."""
    config = msgspec.structs.replace(
        SCHEDULED,
        schedule=ScheduleConfig(from_rad=0.1),
        reference=ReferenceConfig(from_rad=0.1),
        predictor=PredictorConfig(inertia=inertia),
    )
    sheet, admittance, truth = known(), made(config), model(0, 3)
    start = np.array([-0.2, 0.7, 0.15])
    truth.reset(start)
    largest = loudest = 0.0
    for n in range(60):
        pose = start + np.array([1e-3, -2e-3, 0.01]) * n * min(n, 30)  # it accelerates, then moves
        position, acceleration = truth.read()
        force = [sheet.force(position[2]), -0.15, 0.0]
        made_by_tool = sheet.tool(position[2])[0] @ acceleration
        largest = max(
            largest, np.abs(admittance.comply(force - made_by_tool, PlanarPose(pose))).max()
        )
        loudest = max(loudest, np.abs(made_by_tool[[0, 2]]).max())
        truth.send(pose)
    assert loudest > 0.1
    # Analytic: the same response on both sides; without the inertia its load is complied with.
    assert largest < 1e-12 if inertia else largest > 1e-4


@pytest.mark.parametrize(
    ("alpha", "share"), [(0.0, 1.0), (0.2, 1.0), (0.3, 1.0), (0.45, 0.5), (0.6, 0.0), (0.9, 0.0)]
)
def test_the_lead_fades_out_over_the_second_half_of_its_way(alpha: float, share: float) -> None:
    # Analytic: linear from 1 at half the way to 0 at its end.
    config = PredictorConfig(lead_until_rad=0.6)
    assert lead_share(config, alpha) == pytest.approx(share, abs=1e-14)


@pytest.mark.parametrize("lag_s", [0.0, 0.01, 0.1])
def test_the_stream_of_the_lead_is_its_transfer_function(lag_s: float) -> None:
    lead = ResponseLead(RESPONSE, lag_s, period_s=T)
    numerator, denominator = lead.transfer_function()
    samples = np.random.default_rng(1).normal(size=60)
    # Analytic: the same recursion; twice the pole of the lag, unit gain at rest.
    expected = signal.lfilter(numerator, denominator, samples)
    np.testing.assert_allclose([lead.update(x) for x in samples], expected, rtol=1e-9, atol=1e-12)
    pole = math.exp(-T / lag_s) if lag_s else 0.0
    np.testing.assert_allclose(denominator, np.poly([pole, pole]), atol=1e-15)
    assert numerator.sum() / denominator.sum() == pytest.approx(1.0, rel=1e-9)
    # Analytic: a share of it and the rest of what comes in, by superposition.
    part, same = lead.transfer_function(0.3)
    np.testing.assert_allclose(part, 0.3 * numerator + 0.7 * denominator, rtol=1e-14)
    np.testing.assert_array_equal(same, denominator)


def test_the_leads_zeros_are_the_poles_of_the_response() -> None:
    numerator, _ = ResponseLead(RESPONSE, 0.05, period_s=T).transfer_function()
    omega, ratio = 2.0 * math.pi * 2.2, 0.8
    pole = complex(-ratio * omega, omega * math.sqrt(1.0 - ratio**2))
    # Analytic: e^(sT) of s = −ξω ± jω√(1 − ξ²).
    found = sorted(np.roots(numerator), key=lambda z: z.imag)
    np.testing.assert_allclose(found, [np.exp(pole.conjugate() * T), np.exp(pole * T)], rtol=1e-9)
