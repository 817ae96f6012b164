"""The coupling of both arms that a scenario's controller makes."""

from __future__ import annotations

import math

import numpy as np

from dualbend.arm.mjcf import LEVER_ARM_M
from dualbend.mechanics.coupling import Coupling, deviation_angle
from dualbend.scenario.scenario import Scenario


def scenario_coupling(scenario: Scenario, alpha_rad: float) -> Coupling:
    """Return the coupling that ComplianceController makes at one bending angle.

    A lever arm that is believed wrongly mixes forces into the moment.
    """
    error = LEVER_ARM_M - scenario.sensor.lever_arm_m
    c, s = math.cos(alpha_rad), math.sin(alpha_rad)
    reference = scenario.compliance.reference
    # A vertical force that is known is not read: its lever arm's moment is missing.
    known = scenario.sensor.lever_arm_m if reference and reference.known_weight else 0.0
    return Coupling.between(
        scenario.compliance.sensing,
        scenario.compliance.complying,
        deviation_angle(scenario.robot.alter.mode, alpha_rad, scenario.path.start_rad),
        np.array([[1.0, 0.0, 0.0], [-error * s, -(error + known) * c, 1.0]]),
    )
