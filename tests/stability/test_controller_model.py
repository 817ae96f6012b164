"""The state space of the analysis is what the admittance with a model does, cycle by cycle."""

import math

import numpy as np
import pytest

from dualbend.control.compliance.model import ModelAdmittance
from dualbend.run.known_sheet import known_sheet
from dualbend.scenario.load import load_scenario
from dualbend.stability.margins import loop_margins
from dualbend.stability.sampled import LoopElements, SampledLoop
from dualbend.types import PlanarPose
from support.state_space import simulate
from support.strip import STRIP6

ALPHA_RAD = 0.3


@pytest.mark.parametrize("axes", [(True, True), (True, False)])
def test_a_stream_of_calls_equals_the_state_space(axes: tuple[bool, bool]) -> None:
    """Analytic, to rounding: small loads, so that the sheet's curve is its tangent."""
    settings = ["compliance.schedule.curve=false"]
    if not axes[1]:
        settings.append("compliance.rotation.from_alpha_rad=2")
    scenario = load_scenario("tuned", settings)
    elements = LoopElements.from_scenario(scenario)
    loop = SampledLoop(elements, np.eye(2), axes, alpha_rad=ALPHA_RAD)
    admittance = elements.admittance
    assert isinstance(admittance, ModelAdmittance)
    known, pose = known_sheet(scenario), PlanarPose(np.array([-0.19, 0.7, ALPHA_RAD]))
    point = admittance.point(ALPHA_RAD)
    loads = np.random.default_rng(1).standard_normal((80, 2)) * [0.01, 0.0005]
    for load, expected in zip(loads, simulate(loop.admittance, loads), strict=True):
        force_x = float(point.reference[0] + load[0])
        out = admittance.comply(np.array([force_x, known.force_z_n, load[1]]), pose)
        assert out == pytest.approx(expected.tolist(), rel=1e-8, abs=1e-15)


def test_a_predictor_with_the_right_model_has_at_least_6_db_and_60_degrees() -> None:
    """Analytic: L = FG/(1 − FG) with |FG| < 1 crosses the negative axis at less than a half."""
    settings = [
        "compliance.rotation.from_alpha_rad=2",
        "compliance.schedule.curve=false",
        "compliance.predictor={inertia = false}",
        "compliance.x.b=0.03",
    ]
    scenario = load_scenario("tuned", settings)
    base = LoopElements.from_scenario(scenario)
    point = (
        base.admittance.point(ALPHA_RAD) if isinstance(base.admittance, ModelAdmittance) else None
    )
    assert point is not None
    loop = SampledLoop(base, point.stiffness, (True, False), alpha_rad=ALPHA_RAD)
    found = loop_margins(loop, stable=loop.mode().stable)
    assert loop.mode().stable
    assert found.gain_db > 6.0 - 0.1
    # The residual 1/(1 + k) of the static form takes a degree.
    assert math.degrees(found.phase_rad) > 59.0


def test_the_known_sheet_is_the_closed_forms_within_weight_and_give() -> None:
    """Analytic to first order: 8π²EI/(α²L³) for one arm; Euler's force less the weight's."""
    scenario = load_scenario(STRIP6)
    known, sheet = known_sheet(scenario), scenario.sheet.sheet()
    bend, length = sheet.bending_stiffness_nm2, sheet.length_m
    alpha = 0.2
    along = 8 * math.pi**2 * bend / (alpha**2 * length**3)
    assert known.tangent(alpha)[0, 0] == pytest.approx(along, rel=0.1)
    weight = 4 * sheet.weight_per_length_n_per_m * length / (math.pi**2 * alpha)
    assert known.force(alpha) == pytest.approx(weight - sheet.euler_load_n, rel=0.02)
    # On its own curve the zero-moment state is where the displacement is 0.
    assert known.displacement(known.force(0.3), 0.3) == pytest.approx(0.0, abs=2e-6)
