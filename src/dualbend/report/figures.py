"""The pictures: moment over bending angle, as in the paper's Figs. 6, 8, 9; stability maps."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")

from matplotlib.figure import Figure

from dualbend.errors import InputError
from dualbend.evaluation.metrics import bending_rows
from dualbend.run.record import RunRecord
from dualbend.scenario.path import make_path
from dualbend.stability.map import Panel


def plot_moment(result: RunRecord, path: Path) -> None:
    """Write the moment at the sensing gripper, true, measured and filtered, as PNG."""
    rows = bending_rows(result)
    trace, side = result.trace, result.sensing_side
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


def plot_stability_map(panels: Sequence[Panel], title: str, path: Path) -> None:
    """Write the boundaries in (b, k) at a few bending angles, with the scenario's gains, as PNG.

    Solid: the sampled loop, stable on the side away from the shading of its worst angle; dashed:
    the paper's (23). Raises InputError where the file cannot be written.
    """
    figure = Figure(figsize=(6.4 * len(panels), 5.2), layout="constrained")
    axes_of = figure.subplots(1, len(panels), squeeze=False)[0]
    for axes, panel in zip(axes_of, panels, strict=True):
        worst = np.minimum.reduce(list(panel.sampled.values()))
        axes.contourf(panel.b, panel.k, worst.T, levels=[0.0, 1.0], colors=["0.9"])
        for i, (alpha, stiffness) in enumerate(panel.stiffness.items()):
            colour = mpl.colormaps["viridis"](i / len(panel.stiffness))
            for field, style in (
                (panel.sampled[alpha], "solid"),
                (panel.paper / max(stiffness, 1e-12), "dashed"),
            ):
                ratio = np.log(np.clip(field, 1e-12, 1e12)).T
                axes.contour(panel.b, panel.k, ratio, [0.0], colors=[colour], linestyles=style)
            axes.plot([], [], color=colour, label=f"{alpha:.2f} rad, k_e = {stiffness:.3g}")
        axes.plot([], [], color="0.3", label="sampled loop")
        axes.plot([], [], color="0.3", linestyle="dashed", label="paper (23)")
        axes.plot(*panel.gains, "r*", markersize=12, label="this scenario")
        axes.set(xscale="log", yscale="log", title=f"{panel.axis} alone; shaded: unstable")
        axes.set_xlabel(f"damping b [{panel.units[0]}]")
        axes.set_ylabel(f"stiffness k [{panel.units[1]}]")
        axes.legend(fontsize="small", loc="upper left")
    figure.suptitle(title)
    try:
        figure.savefig(path, dpi=120)
    except (OSError, ValueError) as error:
        raise InputError(f"--map {path}: cannot be written: {error}") from error
