"""The picture of two runs: the moment of both over the bending angle."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dualbend.run.record import RunRecord
from dualbend.scenario.path import make_path

_LOOKS = (("tab:blue", 2.8), ("tab:orange", 1.4))
"""Colour and width: where both are equal, the second is seen on the first."""


def plot_compared_moments(
    runs: tuple[RunRecord, RunRecord], labels: tuple[str, str], path: Path
) -> None:
    """Write the moments at the sensing grippers during bending as PNG: true, and thin, filtered.

    Raises
    ------
    OSError
        ``path`` cannot be written.
    """
    figure = Figure(figsize=(9.0, 5.0), layout="constrained")
    axes = figure.add_subplot()
    for run, label, look in zip(runs, labels, _LOOKS, strict=True):
        _plot_one(axes, run, label, *look)
    for knot in sorted({knot for run in runs for knot in _knots(run)}):
        axes.axvline(knot, color="0.9", linewidth=0.8, zorder=0)
    axes.axhline(0.0, color="0.5", linewidth=0.8, zorder=0)
    axes.set_xlabel("bending angle α, nominal [rad]")
    axes.set_ylabel("moment at the sensing gripper [mN m]")
    axes.set_title(f"{labels[0]} and {labels[1]}", loc="left")
    axes.legend(loc="upper right", frameon=False)
    axes.margins(x=0.01)
    figure.savefig(path, dpi=120)


def _plot_one(axes: Axes, run: RunRecord, label: str, colour: str, width: float) -> None:
    rows, side = run["phase"] == run.phases.index("bend"), run.sensing_side
    alpha = run["nominal_alpha"][rows]
    true, filtered = (1e3 * run[f"{side}_{kind}_moment_y"][rows] for kind in ("true", "filtered"))
    largest = np.nanmax(np.abs(true), initial=0.0)
    name = f"{label}, {side}: largest {largest:.1f} mN m"
    axes.plot(alpha, filtered, color=colour, linewidth=0.6, alpha=0.5)
    axes.plot(alpha, true, color=colour, linewidth=width, label=name)


def _knots(run: RunRecord) -> list[float]:
    knots: list[float] = make_path(run.scenario.path, run.scenario.sheet.length_m).knots.tolist()
    return knots
