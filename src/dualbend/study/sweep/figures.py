"""The pictures of a sweep: a heat map of a grid of two keys, and the sensitivities."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa

from dualbend.report.canvas import Axes, Figure, own_style
from dualbend.report.figures import save
from dualbend.report.plot import Axis
from dualbend.study.sweep.design import Design
from dualbend.study.sweep.file import Sweep
from dualbend.study.sweep.sensitivity import CONFIDENCE, Sensitivity
from dualbend.study.sweep.table import key_unit, numbers, unit_of

_MOST_TICKS, _MOST_WRITTEN = 12, 12


def heat_map_file(metric: str) -> str:
    """Return the name of a metric's heat map: ``heat_peak_moment.png``."""
    return f"heat_{re.sub(r'[^A-Za-z0-9]+', '_', metric).strip('_')}.png"


@own_style()
def plot_heat_map(sweep: Sweep, design: Design, table: pa.Table, metric: str, path: Path) -> None:
    """Write a metric over a grid of two keys as PNG: the first key to the right, the second up.

    One cell a run, all of one size whatever the keys' steps. × marks a run that did not complete,
    in a corner of its cell where its value is written; a cell without colour has no value.
    """
    levels = [list(dict.fromkeys(str(row[i]) for row in design.rows)) for i in (0, 1)]
    shape = (len(levels[0]), len(levels[1]))
    values = numbers(table, metric).reshape(shape)
    ended = np.array([o == "completed" for o in table.column("outcome").to_pylist()]).reshape(shape)
    width, height = np.clip(0.7 * np.array(shape), 4.0, 12.0).tolist()
    figure = Figure(figsize=(width + 3.0, height + 1.5), layout="constrained")
    axes = figure.add_subplot()
    drawn = axes.imshow(np.ma.masked_invalid(values.T), origin="lower", aspect="auto")
    axes.set_facecolor("0.9")
    x, y = np.nonzero(~ended)
    written = max(shape) <= _MOST_WRITTEN
    if written:
        _write_values(axes, values)
    aside, size = (0.33, 6) if written else (0.0, 9)
    axes.plot(x + aside, y + aside, "x", color="tab:red", markersize=size, markeredgewidth=1.5)
    for axis, name, i in ((axes.xaxis, design.names[0], 0), (axes.yaxis, design.names[1], 1)):
        every = -(-shape[i] // _MOST_TICKS)
        ticks = range(0, shape[i], every)
        axis.set_ticks(list(ticks), [_short(design, i, levels[i][k]) for k in ticks])
        axis.set_label_text(Axis(name, key_unit(name)).text)
    figure.colorbar(drawn, ax=axes, label=Axis(metric, unit_of(table, metric)).text)
    crossed = "; ×: did not complete" if x.size else ""
    axes.set_title(f"{sweep.name}: {metric}{crossed}", loc="left", fontsize="medium")
    save(figure, path)


def _write_values(axes: Axes, values: np.ndarray) -> None:
    middle = 0.5 * (np.nanmin(values) + np.nanmax(values)) if np.isfinite(values).any() else 0.0
    for (i, k), value in np.ndenumerate(values):
        if np.isfinite(value):
            colour = "black" if value > middle else "white"
            text = f"{value:.3g}"
            axes.text(i, k, text, color=colour, ha="center", va="center", fontsize="x-small")


@own_style()
def plot_sensitivity(
    sweep: Sweep, design: Design, found: Sequence[Sensitivity], path: Path
) -> None:
    """Write first and total Sobol indices of each metric with their intervals as PNG."""
    drawn = [one for one in found if not one.why]
    height = 1.2 + len(drawn) * (0.8 + 0.35 * len(design.names))
    figure = Figure(figsize=(8.0, height), layout="constrained")
    panels = figure.subplots(len(drawn), 1, squeeze=False, sharex=True)[:, 0]
    at = np.arange(len(design.names))[::-1]
    for axes, one in zip(panels, drawn, strict=True):
        for k, (label, side, colour) in enumerate(
            (
                ("first: the key alone", 0.18, "tab:blue"),
                ("total: with the others", -0.18, "tab:orange"),
            )
        ):
            value = one.indices[k]
            spread = np.abs(one.ends[:, k] - value)
            axes.barh(at + side, value, 0.34, color=colour, label=label)
            axes.errorbar(value, at + side, xerr=spread, fmt="none", ecolor="0.2", capsize=3)
        axes.set_yticks(at, design.names)
        axes.axvline(0.0, color="0.5", linewidth=0.8)
        axes.set_title(one.metric, loc="left", fontsize="medium")
        axes.grid(axis="x", color="0.93")
        axes.set_axisbelow(True)
    panels[-1].set_xlabel(
        f"share of the metric's variance; bars: {100.0 * CONFIDENCE:g} % intervals"
    )
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2, frameon=False)
    figure.suptitle(f"{sweep.name}: Sobol's indices, {len(design.rows)} runs", fontsize="medium")
    save(figure, path)


def _short(design: Design, i: int, text: str) -> str:
    """Return a tick's label: four digits of a number, the beginning of a text."""
    value = next(row[i] for row in design.rows if str(row[i]) == text)
    if isinstance(value, int | float) and not isinstance(value, bool):
        return f"{value:.4g}"
    return text if len(text) < 20 else f"{text[:18]}…"
