"""The picture of a run: moment over bending angle, as in the paper's Figs. 6, 8 and 9."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")

from matplotlib.figure import Figure

from dualbend.analysis.metrics import bending_rows, first_sensing_side
from dualbend.run.runner import RunResult
from dualbend.task.bending import make_path


def plot_moment(result: RunResult, path: Path) -> None:
    """Write the moment at the sensing gripper, true, measured and filtered, as PNG."""
    rows = bending_rows(result)
    trace, side = result.trace, first_sensing_side(result)
    alpha = trace["nominal_alpha"][rows]
    figure = Figure(figsize=(9.0, 5.0), layout="constrained")
    axes = figure.add_subplot()
    for name, colour, width in (
        ("measured", "0.75", 0.8),
        ("filtered", "tab:orange", 0.9),
        ("true", "tab:blue", 1.8),
    ):
        moment = 1e3 * trace[f"{side}_{name}_moment_y"][rows]
        axes.plot(alpha, moment, label=name, color=colour, linewidth=width)
    scenario = result.scenario
    for knot in make_path(scenario.path, scenario.sheet.length_m).knots:
        axes.axvline(float(knot), color="0.85", linewidth=0.8, zorder=0)
    axes.axhline(0.0, color="0.5", linewidth=0.8, zorder=0)
    axes.set_xlabel("bending angle α, nominal [rad]")
    axes.set_ylabel(f"moment at the {side} gripper [mN m]")
    ended = result.outcome.replace("_", " ")
    if result.reason:
        ended = f"{ended}: {result.reason}"
    axes.set_title(f"{scenario.name}  ({ended})", loc="left")
    largest = np.nanmax(np.abs(trace[f"{side}_true_moment_y"][rows]), initial=0.0)
    axes.annotate(
        f"largest true moment {1e3 * largest:.1f} mN m",
        xy=(1.0, 1.01),
        xycoords="axes fraction",
        ha="right",
        va="bottom",
    )
    axes.legend(loc="upper right", frameon=False)
    axes.margins(x=0.01)
    figure.savefig(path, dpi=120)
