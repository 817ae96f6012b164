"""The paper's admittance as a class of your own, which a scenario names.

B δ' + K δ = M (paper (7)) about y, sampled as the paper prints it: δ[n] = a δ[n−1] + M/b with
a = exp(−k T/b). The scenario beside it, own_admittance.toml, is fig8 with this class in the place
of the built-in admittance: both make the same trace, bit for bit.

Run: dualbend run docs/examples/own_admittance.toml
"""

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dualbend import Observation, Scenario, load_scenario, make_run


class PaperAdmittance:
    """Turn each arm with the moment that its sensor reads; b [N m s/deg], k [N m/deg], in rad."""

    gains = ("b", "k")

    def __init__(self, scenario: Scenario, b: float, k: float, limit: float = 0.1) -> None:
        self.gain, self.limit = np.pi / 180.0 / b, limit
        self.pole = np.exp(-k / b * scenario.period_s)
        self.turn = np.zeros(2)

    def __call__(self, observation: Observation) -> np.ndarray:
        """Return the deviation of both arms (2, 6): x, y, z [m], roll, pitch, yaw [rad]."""
        turn = self.pole * self.turn + self.gain * observation.filtered.torque_nm[:, 1]
        self.saturated = np.abs(turn) > self.limit
        self.turn = np.clip(turn, -self.limit, self.limit)
        deviation = np.zeros((2, 6))
        deviation[:, 4] = self.turn
        return deviation

    def transfer_functions(self, alpha_rad: float) -> tuple:
        """Return what makes δx of the force, nothing, and δα of the moment, in powers of z⁻¹."""
        return None, ([self.gain], [1.0, -self.pole])


def main(settings: Sequence[str] = ()) -> dict[str, float]:
    """Run it and the built-in one; return the peak moment of each and how far traces differ."""
    file = Path(__file__).with_suffix(".toml")
    own, built_in = (make_run(load_scenario(name, settings)).run() for name in (str(file), "fig8"))
    columns = [name for name, _ in built_in.trace.columns if name != "wall_s"]
    difference = max(float(np.nanmax(np.abs(own[name] - built_in[name]))) for name in columns)
    peaks = [run.metrics["peak_moment"].value for run in (own, built_in)]
    print("own {:.6f} N m, built-in {:.6f} N m".format(*peaks))
    print(f"largest difference of the traces: {difference}")
    return {"own": peaks[0], "built_in": peaks[1], "difference": difference}


if __name__ == "__main__":
    main(sys.argv[1:])
