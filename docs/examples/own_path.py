"""A path of your own: the exact path replaced by the first two terms of its power series.

With α the bending angle and L the length of the sheet,

    x = L (1/2 − α²/8 + 5 α⁴/768),   y = (L/π) (α − 5 α³/48).

The reference solution predicts the largest moment on the path; the simulation measures it.

Run: python docs/examples/own_path.py
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dualbend import ExactPath, Scenario, load_scenario, make_run, worst_moment

ROWS = 41
"""Rows of the table that the scenario gets; a cubic spline joins them."""


@dataclass(frozen=True)
class SeriesPath:
    """Half distance x and rise y of the grips [m] from two terms of their power series in α."""

    length_m: float
    target_rad: float

    @property
    def knots(self) -> np.ndarray:
        """Return the first and the last bending angle [rad]: the path has one piece."""
        return np.array([0.0, self.target_rad])

    def at(self, alpha: float) -> tuple[float, float]:
        """Return x and y [m] at the bending angle α [rad], a float or an array."""
        u = alpha * alpha
        x = self.length_m * (0.5 - u / 8.0 + 5.0 * u * u / 768.0)
        y = self.length_m / np.pi * alpha * (1.0 - 5.0 * u / 48.0)
        return x, y


def scenario_of(path: SeriesPath, settings: Sequence[str] = ()) -> Scenario:
    """Return the scenario `exact`, in a perfect cell, with the path as a table."""
    rows = [[a, *path.at(a)] for a in np.linspace(*path.knots, ROWS).tolist()]
    table = f"path={{kind='table',smooth=true,end_rad={path.target_rad},table={rows}}}"
    return load_scenario("exact", ["imperfections=none", *settings, table])


def main(settings: Sequence[str] = ()) -> dict[str, float]:
    """Predict the largest moment of both paths, run the own one, print and return [N m]."""
    sheet = load_scenario("exact", settings).sheet.sheet()
    found = {}
    for path in (ExactPath(sheet.length_m, 1.0), SeriesPath(sheet.length_m, 1.0)):
        predicted = worst_moment(path, sheet, (0.2, 1.0)).moment_nm
        found[type(path).__name__] = predicted
        print(f"{type(path).__name__:12}{1e3 * predicted:8.3f} mN m predicted, without weight")
    result = make_run(scenario_of(SeriesPath(sheet.length_m, 1.0), settings)).run()
    found["simulated"] = result.metrics["peak_moment"].value
    print(f"{result.outcome}: {1e3 * found['simulated']:.1f} mN m in the simulation, with weight")
    return found


if __name__ == "__main__":
    main(sys.argv[1:])
