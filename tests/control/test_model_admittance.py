"""The admittance with a model: each switch by itself, and the delay-free loop that it promises."""

import math

import msgspec
import numpy as np
import pytest

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.control.compliance.admittance import Admittance, ModelAdmittanceConfig
from dualbend.control.compliance.base import AxisConfig
from dualbend.control.compliance.model import ModelAdmittance
from dualbend.control.compliance.predictor import PredictorConfig, ResponseLead, ResponseModel
from dualbend.control.compliance.reference import ReferenceConfig
from dualbend.control.compliance.schedule import FusionConfig, KnownSheet, ScheduleConfig
from dualbend.control.filters import FirConfig, LowPassConfig
from dualbend.control.response import CommandResponseConfig
from dualbend.errors import InputError
from dualbend.types import PlanarPose, Vector

T = COMMAND_PERIOD_S

RESPONSE = CommandResponseConfig(natural_frequency_hz=2.2, damping_ratio=1.0)
LOW_PASS = FirConfig(taps=2)
STIFFNESS = np.array([[600.0, -17.0], [0.0, -1.3], [-17.0, 0.77]])
INERTIA = np.array([[0.6, 0.0, 0.01], [0.0, 0.6, 0.04], [0.01, 0.04, 0.0038]])
SENT = np.array([[1.0, 0.0], [0.0, 0.0], [0.0, 1.0]])
AXIS = AxisConfig(b=0.1, k=0.01, form="static")
PREDICTED = ModelAdmittanceConfig(
    units="sheet",
    x=AXIS,
    rotation=AXIS,
    schedule=ScheduleConfig(),
    reference=ReferenceConfig(),
    fusion=FusionConfig(),
    predictor=PredictorConfig(),
)


def known(force_n: float = -2.0) -> KnownSheet:
    return KnownSheet(
        alpha_rad=np.array([0.1, 1.0]),
        force_x_n=np.full(2, force_n),
        stiffness=np.stack([STIFFNESS] * 2),
        inertia=np.stack([INERTIA] * 2),
        deviation_jacobian=np.stack([SENT] * 2),
        compression_m=np.array([[0.01, 0.0, -0.01]] * 2),
        compression_n=np.array([[-8.0, -2.0, 4.0]] * 2),
        force_z_n=-0.15,
        lever_arm_m=0.12,
    )


def model(delay_cycles: int, channels: int, low_pass: LowPassConfig = LOW_PASS) -> ResponseModel:
    return ResponseModel(
        response=RESPONSE,
        low_pass=low_pass,
        delay_cycles=delay_cycles,
        steps=16,
        age_steps=6,
        channels=channels,
        period_s=T,
    )


def made(config: ModelAdmittanceConfig) -> ModelAdmittance:
    return ModelAdmittance(
        config,
        known=known(),
        response=RESPONSE,
        own=model(2, 2),
        nominal=model(0, 3),
        period_s=T,
    )


POSE = PlanarPose(np.array([-0.19, 0.7, 0.5]))


def comply(admittance: Admittance, *wrench: float) -> Vector:
    """Run one cycle on F_x, F_z and M_y; return δx, δα."""
    return admittance.comply(np.array(wrench), POSE)


def test_without_any_part_it_is_the_papers_admittance() -> None:
    paper = ModelAdmittanceConfig(x=AxisConfig(b=7, k=575), rotation=AxisConfig(b=0.5, k=1e4))
    plain, modelled = Admittance(paper, period_s=T), made(paper)
    rng = np.random.default_rng(1)
    for force, moment in rng.standard_normal((50, 2)):
        one, other = (comply(each, force, 0.0, moment) for each in (plain, modelled))
        # Analytic: only divided and multiplied by the same stiffness.
        assert other == pytest.approx(one, rel=1e-12)


def test_the_reference_is_not_complied_with() -> None:
    """Analytic: at the known force and no moment nothing moves."""
    config = ModelAdmittanceConfig(x=AxisConfig(b=7, k=575), reference=ReferenceConfig())
    admittance = made(config)
    assert comply(admittance, -2.0, -0.15, 0.0)[0] == pytest.approx(0.0, abs=1e-15)
    assert comply(admittance, -3.0, -0.15, 0.0)[0] < 0.0  # pushed back, it yields


def test_scheduled_gains_are_multiples_of_the_stiffness() -> None:
    """Analytic: δ at rest is F/(k K) whatever K is."""
    stiff = AxisConfig(b=0.1, k=0.5, form="static")
    config = msgspec.structs.replace(
        PREDICTED, x=stiff, reference=None, fusion=None, predictor=None, limit_x_m=10.0
    )
    admittance = made(config)
    for _ in range(300):
        out = comply(admittance, 0.5, 0.0, 0.0)
    assert out[0] == pytest.approx(0.5 / (0.5 * STIFFNESS[0, 0]), rel=1e-6)


def test_a_known_weight_takes_the_lever_arms_noise_out_of_the_moment() -> None:
    """Analytic: an error of F_z that enters M with the lever arm changes nothing."""
    config = msgspec.structs.replace(
        PREDICTED, fusion=None, predictor=None, reference=ReferenceConfig(known_weight=True)
    )
    true, off, lever = 0.01, 0.3, 0.12 * math.cos(POSE.alpha_rad)
    right = comply(made(config), -2.0, -0.15, true)[1]
    noisy = comply(made(config), -2.0, -0.15 + off, true + lever * off)[1]
    assert noisy == pytest.approx(right, rel=1e-12)
    assert right > 0.0


def test_fusion_finds_a_wrong_x_from_force_and_moment_alike() -> None:
    """Analytic: the readings that a wrong x makes give that x, whatever their weights."""
    for weights in (
        FusionConfig(),
        FusionConfig(force_error_n=5.0),
        FusionConfig(moment_error_nm=1),
    ):
        point = made(msgspec.structs.replace(PREDICTED, fusion=weights)).point(0.5)
        assert point.estimate[0] @ STIFFNESS[[0, 2], 0] == pytest.approx(1.0, rel=1e-12)


def closed_loop(config: ModelAdmittanceConfig, error_m: float, cycles: int) -> list[float]:
    """Run the loop on a linear sheet whose x is wrong by error_m from the start."""
    admittance = made(config)
    plant = model(2, 2)
    deviations = []
    for _ in range(cycles):
        q, acceleration = plant.read()
        grip = SENT @ q
        moved = grip + np.array([error_m, 0.0, 0.0])
        wrench = [-2.0, -0.15, 0.0] - STIFFNESS @ moved[[0, 2]] - INERTIA @ (SENT @ acceleration)
        deviation = admittance.comply(wrench, POSE)
        plant.send(deviation)
        deviations.append(float(deviation[0]))
    return deviations


def test_with_the_right_model_the_loop_has_no_delay() -> None:
    """Analytic: δ follows −error as the first-order lag of the admittance, without overshoot."""
    config = msgspec.structs.replace(PREDICTED, rotation=None, fusion=None)
    found = closed_loop(config, 1e-4, 60)
    # δ[n] = a δ[n−1] + g (−e − δ[n−1]) with a = exp(−kT/b), g = (1 − a)/k.
    a = math.exp(-0.01 * 0.028 / 0.1)
    g = (1 - a) / 0.01
    expected, delta = [], 0.0
    for _ in found:
        delta = a * delta + g * (-1e-4 - delta)
        expected.append(delta)
    assert found == pytest.approx(expected, rel=1e-9)


def test_without_the_prediction_the_same_gains_oscillate() -> None:
    """Analytic: 4 cycles of dead time do not bear a crossover of 1/(0.05 s)."""
    fast = AxisConfig(b=0.05, k=0.01, form="static")
    config = msgspec.structs.replace(PREDICTED, x=fast, rotation=None, fusion=None)
    still = closed_loop(config, 1e-5, 200)
    grown = closed_loop(msgspec.structs.replace(config, predictor=None), 1e-5, 200)
    assert max(abs(d) for d in still) < 1.01e-5
    assert max(abs(d) for d in grown) > 1e-3


def test_the_lead_undoes_the_response_at_the_cycles() -> None:
    """Analytic: response × inverse has no poles of the response left, and unit gain at rest."""
    lead = ResponseLead(RESPONSE, 0.0, period_s=T)
    numerator, denominator = lead.transfer_function()
    pole = math.exp(-2 * math.pi * 2.2 * 0.028)
    # A double root is known to the square root of rounding.
    assert np.roots(numerator) == pytest.approx([pole, pole], abs=1e-6)
    assert numerator.sum() / denominator.sum() == pytest.approx(1.0, rel=1e-12)


def test_gains_in_units_of_the_sheet_need_a_schedule() -> None:
    with pytest.raises(ValueError, match="belong together"):
        ModelAdmittanceConfig(units="sheet", x=AXIS)
    with pytest.raises(ValueError, match="belong together"):
        ModelAdmittanceConfig(x=AXIS, schedule=ScheduleConfig())


def test_a_table_that_does_not_grow_is_refused() -> None:
    with pytest.raises(InputError, match="growing"):
        KnownSheet(
            alpha_rad=np.array([1.0, 0.5]),
            force_x_n=np.zeros(2),
            stiffness=np.zeros((2, 3, 2)),
            inertia=np.zeros((2, 3, 3)),
            deviation_jacobian=np.zeros((2, 3, 2)),
            compression_m=np.zeros((2, 3)),
            compression_n=np.zeros((2, 3)),
            force_z_n=0.0,
            lever_arm_m=0.1,
        )


def test_the_curve_agrees_with_the_tangent_where_the_sheet_is_linear() -> None:
    """Analytic: the table above is a straight line of 600 N/m, and so is what lies beyond it."""
    config = msgspec.structs.replace(
        PREDICTED, schedule=ScheduleConfig(curve=True), predictor=None, fusion=None
    )
    straight = msgspec.structs.replace(config, schedule=ScheduleConfig())
    for force in (-15.0, -5.0, 3.0):
        one, other = (comply(made(c), force, 0.0, 0.0)[0] for c in (config, straight))
        assert one == pytest.approx(other, rel=1e-9)
