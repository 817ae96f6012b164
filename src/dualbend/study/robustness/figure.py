"""The picture of a Monte Carlo study: success over misalignment, with and without compliance."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dualbend.report.canvas import Axes, Figure, own_style
from dualbend.report.figures import save
from dualbend.scenario.scenario import Scenario
from dualbend.study.robustness.summary import CONFIDENCE, success_interval
from dualbend.study.robustness.trial import Trial
from dualbend.task.assembly.draws import play

_BIN_HOLDS, _MOST_BINS = 8, 10
_LOOKS = {True: ("tab:blue", "o", -1.0), False: ("tab:orange", "s", 1.0)}


def misalignment_bins(misalignment_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the edges of bins that hold equally many draws, at least eight where there are."""
    bins = int(np.clip(misalignment_m.size // _BIN_HOLDS, 1, _MOST_BINS))
    return np.asarray(np.quantile(misalignment_m, np.linspace(0.0, 1.0, bins + 1)))


@own_style()
def plot_success(trials: Sequence[Trial], scenario: Scenario, path: Path) -> None:
    """Write the success rate over bins of the misalignment as PNG.

    Each with its exact 95 % interval; above and below, one stroke a run. InputError where the file
    cannot be written.
    """
    figure = Figure(figsize=(8.0, 5.0), layout="constrained")
    axes = figure.add_subplot()
    # Both runs of a draw have the same.
    drawn = {t.index: t.misalignment_m for t in trials}
    edges = 1e3 * misalignment_bins(np.array(list(drawn.values())))
    for case in sorted({t.compliance for t in trials}, reverse=True):
        _plot_case(axes, edges, [t for t in trials if t.compliance == case], case)
    axes.vlines(edges, 0.0, 1.0, color="0.9", linewidth=0.8, zorder=0)
    half_clearance = 1e3 * play(scenario)
    axes.axvline(half_clearance, color="0.4", linestyle="dashed", linewidth=1.0, zorder=0)
    axes.annotate(
        "half the clearance",
        xy=(half_clearance, 0.5),
        xytext=(-4, 0),
        textcoords="offset points",
        color="0.4",
        fontsize="small",
        rotation="vertical",
        ha="right",
        va="center",
    )
    axes.set_yticks([0.0, 0.25, 0.5, 0.75, 1.0])
    axes.set_ylim(-0.15, 1.15)
    axes.set_xlim(left=0.0)
    axes.grid(axis="y", color="0.93")
    axes.set_axisbelow(True)
    axes.set_xlabel("misalignment: farthest that a hole would be from its pin uncorrected [mm]")
    axes.set_ylabel("share of runs with all holes seated")
    axes.set_title(
        f"{scenario.name}: {len(drawn)} draws; "
        f"bars: {100 * CONFIDENCE:g} % intervals; strokes: runs",
        loc="left",
        fontsize="medium",
    )
    figure.legend(loc="outside lower center", ncols=2, frameon=False)
    save(figure, path)


def _plot_case(axes: Axes, edges: NDArray[np.float64], trials: Sequence[Trial], case: bool) -> None:
    colour, marker, side = _LOOKS[case]
    at = 1e3 * np.array([t.misalignment_m for t in trials])
    success = np.array([t.success for t in trials])
    bins = np.clip(np.searchsorted(edges, at, side="right") - 1, 0, edges.size - 2)
    held = [success[bins == i] for i in range(edges.size - 1)]
    places = np.array([np.median(at[bins == i]) for i, of in enumerate(held) if of.size])
    rates = np.array([of.mean() for of in held if of.size])
    spans = np.array([success_interval(int(of.sum()), of.size) for of in held if of.size])
    label = f"{'with' if case else 'without'} compliance: {success.sum()} of {success.size}"
    axes.errorbar(
        # Beside each other, since both have the same draws.
        places + side * 0.006 * edges[-1],
        rates,
        # An interval's end may differ from the rate by rounding.
        yerr=np.maximum(np.abs(spans.T - rates), 0.0),
        color=colour,
        marker=marker,
        linestyle="-",
        linewidth=1.0,
        elinewidth=1.8,
        capsize=4,
        label=label,
    )
    level = np.where(success, 1.0, 0.0) + np.where(success, 1.0, -1.0) * (0.07 + 0.02 * side)
    axes.plot(at, level, "|", color=colour, markersize=6, alpha=0.8)
