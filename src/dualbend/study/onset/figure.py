"""The map of an onset study: simulated onsets on the boundaries of the three analyses."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from dualbend.errors import InputError
from dualbend.report.canvas import Axes, Figure, mpl, own_style
from dualbend.report.figures import legend_below, save
from dualbend.scenario.scenario import Scenario
from dualbend.stability.map import gain_units
from dualbend.study.onset.prediction import RayLoop
from dualbend.study.onset.results import Case, OnsetStudy

_RAYS_PER_DECADE = 6
_SHOWN_BELOW, _SHOWN_ABOVE = 8.0, 4.0
_STYLES = (("sampled", "solid"), ("delayed", "dotted"), ("paper", "dashed"))


@own_style()
def plot_onsets(scenario: Scenario, found: OnsetStudy, path: Path) -> None:
    """Write the (b, k) plane of each axis as PNG; stable is to the right of a line.

    Raises InputError where there is nothing to draw or the file cannot be written.
    """
    axes_names = list(dict.fromkeys(case.axis for case in found.cases))
    if not axes_names:
        raise InputError("no case: nothing to draw")
    figure = Figure(figsize=(6.8 * len(axes_names), 6.6), layout="constrained")
    parts = figure.subfigures(1, len(axes_names), squeeze=False)[0]
    for part, axis in zip(parts, axes_names, strict=True):
        panel = part.add_subplot()
        cases = [case for case in found.cases if case.axis == axis]
        angles = sorted({case.alpha_rad for case in cases})
        for i, alpha in enumerate(angles):
            colour = mpl.colormaps["viridis"](i / len(angles))
            _draw(panel, scenario, [c for c in cases if c.alpha_rad == alpha], colour)
        for name, style in _STYLES:
            panel.plot([], [], color="0.3", linestyle=style, label=name)
        panel.plot([], [], "o", color="0.3", label="simulated")
        panel.plot([], [], "o", color="0.3", fillstyle="none", label="without dry friction")
        units = gain_units(scenario.compliance, axis)
        panel.set(xscale="log", yscale="log", title=f"{axis} alone, held")
        onsets = np.array([(c.simulated.b, c.ratio_per_s * c.simulated.b) for c in cases])
        # The paper's boundary is decades away: where it is in the picture is enough.
        panel.set_xlim(onsets[:, 0].min() / _SHOWN_BELOW, onsets[:, 0].max() * _SHOWN_ABOVE)
        panel.set_ylim(onsets[:, 1].min() / _SHOWN_BELOW, onsets[:, 1].max() * _SHOWN_ABOVE)
        panel.set_xlabel(f"damping b [{units[0]}]")
        panel.set_ylabel(f"stiffness k [{units[1]}]")
        legend_below(part, panel, 4)
    figure.suptitle(f"{found.scenario}: onset of the oscillation, predicted and simulated")
    save(figure, path)


def _draw(
    panel: Axes, scenario: Scenario, cases: list[Case], colour: tuple[float, float, float, float]
) -> None:
    """Draw the boundaries of one axis at one angle, and its simulated onsets."""
    axis, alpha = cases[0].axis, cases[0].alpha_rad
    ratios = [case.ratio_per_s for case in cases]
    least, most = min(ratios) / 2.0, max(ratios) * 2.0
    shown = np.geomspace(least, most, 1 + round(_RAYS_PER_DECADE * math.log10(most / least)))
    loop = RayLoop(scenario, axis, alpha, least)
    found = [loop.on(float(ratio)).predict() for ratio in shown]
    for name, style in _STYLES:
        b = np.array([getattr(prediction, name) for prediction in found])
        panel.plot(b, shown * b, color=colour, linestyle=style, linewidth=1.2)
    panel.plot([], [], color=colour, label=f"{alpha:g} rad")
    for case in cases:
        panel.plot(case.simulated.b, case.ratio_per_s * case.simulated.b, "o", color=colour)
        free = case.frictionless.b
        at = (free, case.ratio_per_s * free)
        panel.plot(*at, "o", color=colour, fillstyle="none", markersize=9)
