"""A compliance of your own: rotate with the moment, but only beyond a dead band.

    δα[n] = δα[n−1] + (T/B) (M[n] − band)   for M > band, and likewise for M < −band

Small moments, and the noise of the sensor, then cause no motion.

Run: python docs/examples/own_compliance.py
"""

import sys
from collections.abc import Sequence

import numpy as np

from dualbend import COMMAND_PERIOD_S, Deviation, Scenario, load_scenario, make_run


class DeadBandRotation:
    """Rotate in proportion to the integral of the moment beyond a dead band."""

    damping_nm_s_per_rad = 0.25
    band_nm = 0.01
    limit_rad = 0.1

    def __init__(self, scenario: Scenario) -> None:
        self.turn_rad = 0.0

    def comply(
        self, force_x_n: float, force_z_n: float, moment_y_nm: float, pose: np.ndarray
    ) -> Deviation:
        """Return the deviation of one command period.

        Parameters
        ----------
        force_x_n, force_z_n, moment_y_nm
            Filtered wrench on the arm in its bending frame [N], [N m].
        pose
            Nominal x, z [m] and bending angle α [rad].
        """
        beyond = np.sign(moment_y_nm) * max(abs(moment_y_nm) - self.band_nm, 0.0)
        turn = self.turn_rad + COMMAND_PERIOD_S / self.damping_nm_s_per_rad * beyond
        self.turn_rad = float(np.clip(turn, -self.limit_rad, self.limit_rad))
        return Deviation(
            dx_m=0.0,
            dalpha_rad=self.turn_rad,
            saturated_x=False,
            saturated_rotation=abs(self.turn_rad) == self.limit_rad,
        )


def main(settings: Sequence[str] = ()) -> dict[str, float]:
    """Run `fig6` without and with the compliance; print and return the peak moments [N m]."""
    scenario = load_scenario("fig6", settings)
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
