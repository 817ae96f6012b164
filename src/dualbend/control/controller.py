"""From the wrist wrenches to the path modification of each arm, once a command cycle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from dualbend.control.alter import PlanarPathModification
from dualbend.control.compliance.admittance import Compliance
from dualbend.control.delay import TransportDelay
from dualbend.control.force_torque import WrenchChain
from dualbend.control.reading import Reading, horizontal_force, vertical_force
from dualbend.types import Vector


@dataclass(frozen=True, kw_only=True)
class Command:
    """What the controller made of one cycle; row 0 the left arm, row 1 the right one.

    ``deviation`` (2, 2): δx [m], δα [rad] as the admittance gave it. ``pose`` (2, 3): commanded x,
    z [m], α [rad] in the bending frame, with the deviation that the transport delay let through.
    ``saturated``: a bound of sensor or deviation was met.
    """

    deviation: Vector
    pose: Vector
    saturated: bool


class ComplianceController:
    """Wrench chain → admittance → transport delay → path modification, for both arms.

    Parameters
    ----------
    chains, admittances
        By arm index, for the arms that carry a sensor.
    complying
        Arm indices; one without a sensor takes the deviation of the first arm with one, mirrored.
    delay
        Transport delay of the four deviations.
    modifications
        How each arm executes its deviation.
    """

    def __init__(
        self,
        *,
        chains: Mapping[int, WrenchChain],
        admittances: Mapping[int, Compliance],
        complying: Sequence[int],
        delay: TransportDelay,
        modifications: tuple[PlanarPathModification, PlanarPathModification],
    ) -> None:
        self.chains, self.admittances, self.delay = chains, admittances, delay
        self._modifications = modifications
        leader = next(iter(chains))
        self._source = {i: i if i in chains else leader for i in complying}

    def sense(self, wrench: Vector, rotation: Vector, end_slope: Vector) -> dict[int, Reading]:
        """Measure the true wrenches (2, 6) on the arms; axes (2, 3, 3), slopes (2,) [rad]."""
        readings = {}
        for i, chain in self.chains.items():
            sample = chain.update(wrench[i, :3], wrench[i, 3:], rotation[i])
            slope = float(end_slope[i])
            readings[i] = Reading(
                sample=sample,
                force_x_n=horizontal_force(sample.force_grip_n, slope),
                filtered_force_x_n=horizontal_force(sample.filtered_force_grip_n, slope),
                filtered_force_z_n=vertical_force(sample.filtered_force_grip_n, slope),
            )
        return readings

    def command(
        self, readings: Mapping[int, Reading], x_m: float, z_m: float, alpha_rad: float
    ) -> Command:
        """Modify the nominal grip pose (x, z, α) in the bending frame, the same for both arms."""
        saturated = False
        nominal = np.array([x_m, z_m, alpha_rad])
        given: dict[int, tuple[float, float]] = {}
        for i, reading in readings.items():
            out = self.admittances[i].comply(
                reading.filtered_force_x_n,
                reading.filtered_force_z_n,
                reading.filtered_moment_y_nm,
                nominal,
            )
            given[i] = (out.dx_m, out.dalpha_rad)
            saturated |= out.saturated_x or out.saturated_rotation or reading.sample.saturated
        deviation = np.zeros((2, 2))
        for i, source in self._source.items():
            deviation[i] = given[source]
        delayed = self.delay.update(deviation.ravel()).tolist()
        pose = [
            modification.compose(x_m, z_m, alpha_rad, delayed[2 * i], delayed[2 * i + 1])
            for i, modification in enumerate(self._modifications)
        ]
        return Command(deviation=deviation, pose=np.array(pose), saturated=saturated)
