"""A sheet of your own, and the path on which it has no moment.

`own_sheet.toml` describes it: a material in a file, a doubler in the middle, a curvature at rest.
The path of the shipped scenarios is that of a uniform sheet that is flat at rest; here the
reference solution finds, for each bending angle, how far apart the grips must be for this one.

Run: python docs/examples/own_sheet.py
"""

import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from dualbend import Scenario, Sheet, load_scenario, make_run, solve_symmetric

FILE = Path(__file__).with_name("own_sheet.toml")
ROWS = 25
"""Rows of the table that the scenario gets; a cubic spline joins them."""


def moment_free(sheet: Sheet, alphas: np.ndarray) -> list[list[float]]:
    """Return rows of bending angle [rad], half distance and rise [m] without a moment on grips."""
    hang = partial(
        solve_symmetric,
        sheet.bending_stiffness_nm2,
        sheet.length_m,
        weight_per_length=sheet.weight_per_length_n_per_m,
        axial_stiffness_n=sheet.axial_stiffness_n,
        sheet=sheet,
    )
    rows, state = [], None
    # From the bent end: there the sheet is soft, and each state begins at the one before.
    for alpha in alphas[::-1].tolist():
        chord = sheet.length_m / 2.0 * np.sin(alpha) / alpha  # half of an arc's

        def moment(x: float, alpha: float = alpha, near: object = state) -> float:
            return hang(alpha, x, guess=near).end_moment_nm

        x = brentq(moment, 0.9 * chord, 1.002 * chord, xtol=1e-9)
        state = hang(alpha, x, guess=state)
        rows.append([alpha, x, state.rise_m])
    return rows[::-1]


def planned(settings: Sequence[str] = ()) -> tuple[Scenario, Scenario]:
    """Return the scenario of the file, and the same with the sheet's own path."""
    given = load_scenario(str(FILE), settings)
    start, end = given.path.start_rad, given.path.end_rad
    rows = moment_free(given.sheet.sheet(), np.linspace(start, end, ROWS))
    table = f"path={{kind='table',smooth=true,start_rad={start},end_rad={end},table={rows}}}"
    return given, load_scenario(str(FILE), [*settings, table])


def main(settings: Sequence[str] = ()) -> dict[str, float]:
    """Run both paths; print and return the largest moments while bending [N m]."""
    found = {}
    for name, scenario in zip(("elastica", "own"), planned(settings), strict=True):
        run = make_run(scenario).run()
        found[name] = run.metrics["peak_moment"].value
        print(f"{name:9}{1e3 * found[name]:7.1f} mN m  {run.outcome}")
        for warning in run.summary.warnings:
            print(f"         {warning}")
    return found


if __name__ == "__main__":
    main(sys.argv[1:])
