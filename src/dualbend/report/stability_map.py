"""A stability map as a plot: boundaries in (b, k) at some bending angles, unstable part shaded."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import contourpy
import numpy as np

from dualbend.report.plot import COLOURS, Axis, Curve, Plot, Range, Ring
from dualbend.stability.map import Panel
from dualbend.types import Vector


def stability_panel(panel: Panel, *, stiffness: bool = False) -> Plot:
    """Return the map of one axis; with ``stiffness`` the legend says the environment's.

    Solid: where the sampled loop's gain margin is 1, shaded beyond at the worst angle; dashed: the
    paper's condition (23); star: the gains of the scenario.
    """
    b, k = (np.log10(values) for values in (panel.b, panel.k))
    curves = []
    for i, (alpha, k_e) in enumerate(panel.stiffness.items()):
        colour = COLOURS[i % len(COLOURS)]
        sampled = _boundary(b, k, panel.sampled[alpha])
        paper = _boundary(b, k, panel.paper / max(k_e, 1e-12))
        drawn = np.isfinite(sampled[0]).any() or np.isfinite(paper[0]).any()
        name = f"{alpha:.2f} rad" + (f", k_e = {k_e:.3g}" if stiffness else "")
        curves.append(Curve(name if drawn else "", *sampled, colour=colour, width=2.0))
        curves.append(Curve("", *paper, colour=colour, dash="dashed"))
    b_set, k_set = (np.array([gain]) for gain in panel.gains)
    curves.append(Curve("gains set", b_set, k_set, colour="red", marker="star"))
    shown = [Range(low=float(v[0]), high=float(v[-1])) for v in (panel.b, panel.k)]
    return Plot(
        x=Axis("damping b", panel.units[0], "log", shown[0]),
        y=Axis("stiffness k", panel.units[1], "log", shown[1]),
        curves=curves,
        areas=_unstable(b, k, np.minimum.reduce(list(panel.sampled.values()))),
        title=f"{panel.axis} alone",
    )


def _log_ratio(ratio: Vector) -> Vector:
    return np.asarray(np.log(np.clip(ratio, 1e-12, 1e12)).T)


def _boundary(b: Vector, k: Vector, ratio: Vector) -> Ring:
    """Return where a ratio is 1, pieces apart by NaN; b, k as logarithms, returned as gains."""
    gap = np.full((1, 2), np.nan)
    pieces = contourpy.contour_generator(b, k, _log_ratio(ratio)).lines(0.0)
    parts = [part for piece in pieces for part in (np.asarray(piece), gap)]
    points = np.concatenate(parts or [gap])
    return 10.0 ** points[:, 0], 10.0 ** points[:, 1]


def _unstable(b: Vector, k: Vector, margin: Vector) -> list[list[Ring]]:
    """Return the polygons in which a gain margin is below 1."""
    kind = contourpy.FillType.OuterOffset
    generator = contourpy.contour_generator(b, k, _log_ratio(margin), fill_type=kind)
    found: Any = generator.filled(-1e9, 0.0)
    areas = []
    for points, offsets in zip(*found, strict=True):
        rings = [points[i:j] for i, j in pairwise(offsets)]
        areas.append([(10.0 ** ring[:, 0], 10.0 ** ring[:, 1]) for ring in rings])
    return areas
