"""The picture of a series of sheets: the moment falls."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dualbend.report.canvas import Axes, Figure, mpl, own_style
from dualbend.report.figures import save
from dualbend.study.learning.sheet import Sheet

_LEAST_MNM = 1.0
"""Moments are drawn from 1 mN m on, below the noise of any reading."""


@own_style()
def plot_sheets(sheets: Sequence[Sheet], name: str, path: Path) -> None:
    """Write |moment| over the angle, a line a sheet, and peaks and rms over the sheets, as PNG.

    InputError where the file cannot be written.
    """
    figure = Figure(figsize=(10.0, 4.8), layout="constrained")
    curves, numbers = figure.subplots(1, 2, width_ratios=(3, 2), sharey=True)
    _plot_moments(curves, sheets)
    _plot_numbers(numbers, sheets)
    curves.set_title(f"{name}: {len(sheets)} sheets", loc="left", fontsize="medium")
    curves.set_ylabel("moment on the arm where it is larger [mN m]")
    curves.set_ylim(bottom=_LEAST_MNM)
    save(figure, path)


def _plot_moments(axes: Axes, sheets: Sequence[Sheet]) -> None:
    shades = mpl.colormaps["viridis_r"](np.linspace(0.1, 1.0, len(sheets)))
    shown = {0, len(sheets) - 1, *np.linspace(0, len(sheets) - 1, 5).astype(int).tolist()}
    for i, (sheet, colour) in enumerate(zip(sheets, shades, strict=True)):
        axes.semilogy(
            sheet.angle_rad,
            np.maximum(1e3 * np.array(sheet.moment_nm), _LEAST_MNM),
            color=colour,
            linewidth=1.2,
            label=f"sheet {sheet.sheet}, {sheet.speed_rad_per_s:g} rad/s" if i in shown else "_",
        )
    axes.set_xlabel("bending angle α, nominal [rad]")
    axes.grid(color="0.93")
    axes.legend(frameon=False, fontsize="small", loc="upper right")


def _plot_numbers(axes: Axes, sheets: Sequence[Sheet]) -> None:
    at = [sheet.sheet for sheet in sheets]
    pieces = max(len(sheet.peaks_nm) for sheet in sheets)
    shades = mpl.colormaps["plasma"](np.linspace(0.0, 0.8, pieces))
    for i, colour in enumerate(shades):
        peaks = [1e3 * s.peaks_nm[i] if i < len(s.peaks_nm) else np.nan for s in sheets]
        axes.semilogy(at, peaks, marker="o", color=colour, linewidth=1.0, label=f"piece {i + 1}")
    rms = [np.nan if s.rms_nm is None else 1e3 * s.rms_nm for s in sheets]
    axes.semilogy(at, rms, marker="s", color="black", linewidth=1.5, label="rms")
    for sheet in sheets:
        if not sheet.learned:
            axes.axvline(sheet.sheet, color="tab:red", linestyle="dotted", linewidth=1.0)
    axes.set_xlim(0.5, len(sheets) + 0.5)
    axes.set_xlabel("sheet (dotted: nothing learned)")
    axes.xaxis.set_major_locator(mpl.ticker.MaxNLocator(integer=True))
    axes.grid(color="0.93")
    axes.legend(frameon=False, fontsize="small", ncols=2)
