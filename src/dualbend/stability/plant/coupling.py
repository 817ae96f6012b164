"""How the controller couples the two arms: what is read, what is sent, and who follows whom."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from dualbend.arm.mjcf import LEVER_ARM_M
from dualbend.scenario.scenario import Scenario
from dualbend.types import SIDES, Vector

ModeName = Literal["alone", "alike", "opposed"]


@dataclass(frozen=True, kw_only=True)
class Coupling:
    """How the controller couples the arms: what is read, what is sent, and who follows whom.

    ``read`` (2, 3): force x and moment as the sensing arm reads them, of the wrench on it;
    ``sent`` (3, 2): the change of a grip's x, z, α per δx, δα; ``source``: by complying arm, the
    arm whose reading it follows.
    """

    read: Vector
    sent: Vector
    source: dict[int, int]

    @classmethod
    def of(cls, scenario: Scenario, alpha_rad: float) -> Coupling:
        """Follow ComplianceController: an arm without a sensor follows the first with one.

        ``robot.alter.mode`` says along what δx is executed; a lever arm that is believed wrongly
        mixes forces into the moment.
        """
        sensing = [i for i, side in enumerate(SIDES) if side in scenario.compliance.sensing]
        complying = [i for i, side in enumerate(SIDES) if side in scenario.compliance.complying]
        modes = {"world": 0.0, "tool": alpha_rad, "tool-frozen": scenario.path.start_rad}
        phi = modes[scenario.robot.alter.mode]
        error = LEVER_ARM_M - scenario.sensor.lever_arm_m
        c, s = math.cos(alpha_rad), math.sin(alpha_rad)
        taken = scenario.compliance.reference
        # A vertical force that is known is not read: its lever arm's moment is missing.
        known = scenario.sensor.lever_arm_m if taken and taken.known_weight else 0.0
        return cls(
            read=np.array([[1.0, 0.0, 0.0], [-error * s, -(error + known) * c, 1.0]]),
            sent=np.array([[math.cos(phi), 0.0], [-math.sin(phi), 0.0], [0.0, 1.0]]),
            source={i: i if i in sensing else sensing[0] for i in complying},
        )

    def ways(self, stiffness: Vector) -> dict[ModeName, tuple[Vector, Vector]]:
        """Return what a moving grip meets: by way, its own (3, 3) and what is read (3, 3) of it.

        Where both arms follow their own sensors the sheet's symmetry splits the loop into two:
        both arms moving alike, and opposed.
        """

        def block(of: int, by: int) -> Vector:
            return stiffness[3 * of : 3 * of + 3, 3 * by : 3 * by + 3]

        sources = set(self.source.values())
        if not sources:
            return {}
        if len(sources) == 2:
            # The means over both arms are exact where the state is symmetric, and it nearly is.
            own = (block(0, 0) + block(1, 1)) / 2
            other = (block(0, 1) + block(1, 0)) / 2
            return {"alike": (own + other, own + other), "opposed": (own - other, own - other)}
        (of,) = sources
        if len(self.source) == 2:
            both = block(of, 0) + block(of, 1)
            return {"alike": (both, both)}
        (by,) = self.source
        return {"alone": (block(by, by), block(of, by))}

    def loops(self, stiffness: Vector) -> dict[ModeName, Vector]:
        """Return the (2, 2) matrices of the loops closed through a stiffness (6, 6)."""
        return {
            way: np.asarray(self.read @ read @ self.sent)
            for way, (_, read) in self.ways(stiffness).items()
        }

    @property
    def feels_itself(self) -> bool:
        """The sensing arm moves: it reads the inertia of its own tool."""
        return any(of == by for by, of in self.source.items())

    def tool(self, inertia: Vector) -> Vector:
        """Return the tool's inertia (2, 2) in the reading; none where the sensing arm is led."""
        if not self.feels_itself:
            return np.zeros((2, 2))
        return np.asarray(self.read @ inertia @ self.sent)

    def compliance(self, per_load: Vector) -> Vector:
        """Return what the admittance gives way at rest (6, 6), from δ per load (2, 2)."""
        given = np.zeros((6, 6))
        for by, of in self.source.items():
            given[3 * by : 3 * by + 3, 3 * of : 3 * of + 3] = self.sent @ per_load @ self.read
        return given
