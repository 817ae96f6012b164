"""A loop of your own: a script turns both grips with the moment, one command period at a time.

    δα[n] = δα[n−1] + (T/B) M[n],    the same in both arms, from the left arm's sensor

A run without actions is that of the scenario's own controller.

Run: python docs/examples/own_loop.py
"""

import sys
from collections.abc import Sequence

import numpy as np

from dualbend import COMMAND_PERIOD_S, open_cell

DAMPING_NM_S_PER_RAD, LIMIT_RAD = 0.5, 0.1


def main(settings: Sequence[str] = ()) -> dict[str, float]:
    """Bend a light strip without and with the script's turn; return the peak moments [N m]."""
    peaks, turn_rad = {}, 0.0
    with open_cell("tuned", ["compliance=none", *settings]) as cell:
        cell.reset()
        while not cell.done:
            cell.step()
        peaks["without"] = cell.record().metrics["peak_moment"].value

        observation = cell.reset()
        while not cell.done:
            moment_nm = observation.filtered.torque_nm[0, 1]
            turn_rad += COMMAND_PERIOD_S / DAMPING_NM_S_PER_RAD * moment_nm
            turn_rad = float(np.clip(turn_rad, -LIMIT_RAD, LIMIT_RAD))
            observation = cell.step([[0.0, 0.0, turn_rad]] * 2)
        peaks["with"] = cell.record().metrics["peak_moment"].value
    for name, peak in peaks.items():
        print(f"{name:8}{1e3 * peak:6.1f} mN m")
    return peaks


if __name__ == "__main__":
    main(sys.argv[1:])
