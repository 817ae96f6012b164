"""A compliance of your own: rotate with the moment, but only beyond a dead band.

    δα[n] = δα[n−1] + (T/B) (M[n] − band)   for M > band, and likewise for M < −band

Small moments, and the noise of the sensor, then cause no motion.

Run: python docs/examples/own_compliance.py
"""

import sys
from collections.abc import Sequence

import numpy as np

from dualbend import Observation, Scenario, load_scenario, make_run

X, Y, Z, ROLL, PITCH, YAW = range(6)
"""Components of a deviation in the bending frame of each arm; the bending angle is the pitch."""


class DeadBandRotation:
    """Rotate the left grip in proportion to the integral of its moment beyond a dead band."""

    damping_nm_s_per_rad = 0.25
    band_nm = 0.01
    limit_rad = 0.1

    def __init__(self, scenario: Scenario) -> None:
        self.turn_rad, self.period_s = 0.0, scenario.period_s

    def __call__(self, observation: Observation) -> np.ndarray:
        """Return the deviation of both arms (2, 6) in one command period."""
        moment_nm = float(observation.filtered.torque_nm[0, 1])
        beyond = np.sign(moment_nm) * max(abs(moment_nm) - self.band_nm, 0.0)
        turn = self.turn_rad + self.period_s / self.damping_nm_s_per_rad * beyond
        self.turn_rad = float(np.clip(turn, -self.limit_rad, self.limit_rad))
        deviation = np.zeros((2, 6))
        deviation[0, PITCH] = self.turn_rad
        return deviation


def main(settings: Sequence[str] = ()) -> dict[str, float]:
    """Bend a light strip without and with it; print and return the peak moments [N m]."""
    scenario = load_scenario("tuned", ["compliance=none", *settings])
    runs = {
        "without": make_run(scenario),
        "with": make_run(scenario, compliance=DeadBandRotation),
    }
    peaks = {}
    for name, run in runs.items():
        peaks[name] = run.run().metrics["peak_moment"].value
        print(f"{name:8}{1e3 * peaks[name]:6.1f} mN m")
    return peaks


if __name__ == "__main__":
    main(sys.argv[1:])
