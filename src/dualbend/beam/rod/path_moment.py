"""The largest moment on the grippers along a path, by the reference solution of the rod."""

import itertools
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from dualbend.beam._check import FloatArray, within
from dualbend.beam.path import BendingPath
from dualbend.beam.rod import planar as rod
from dualbend.beam.sheet import Sheet
from dualbend.errors import InputError

_SAMPLES = 24
"""End slopes of a piece at which the rod is solved, before the peak is refined."""


@dataclass(frozen=True, kw_only=True)
class WorstMoment:
    """The largest |M| on a path [N m], its end slope [rad], and the largest |M| of each piece.

    unsolved counts the sampled points without a reference solution; they are ignored.
    """

    moment_nm: float
    alpha_rad: float
    piece_moments_nm: FloatArray
    unsolved: int


def worst_moment(
    path: BendingPath,
    sheet: Sheet,
    alpha_range: tuple[float, float] | None = None,
    *,
    weight: bool = False,
    stretch: bool = False,
) -> WorstMoment:
    """Return the largest moment on grippers that follow a path exactly.

    alpha_range [rad] is the part of the path (default: all of it); weight includes the weight of
    the sheet, stretch its axial compliance. Every piece is sampled, then the peak between the
    neighbours of its largest sample is found to 1e-6 rad. Raises InputError for a range
    off the path, or a path for a sheet of another length.
    """
    if path.length_m != sheet.length_m:
        raise InputError(f"path is for length {path.length_m!r} m, sheet has {sheet.length_m!r} m")
    start, end = alpha_range or (float(path.knots[0]), float(path.knots[-1]))
    within("alpha_range [rad]", np.array([start, end]), path.knots[0], path.knots[-1])
    inner = path.knots[(path.knots > start) & (path.knots < end)]
    edges = np.concatenate([[start], inner, [end]])
    q = sheet.weight_per_length_n_per_m if weight else 0.0
    axial = sheet.axial_stiffness_n if stretch else None
    pieces = [
        _peak(path, sheet, np.linspace(a, b, _SAMPLES).tolist(), q, axial)
        for a, b in itertools.pairwise(edges)
    ]
    moments, alphas, unsolved = (np.array(column) for column in zip(*pieces, strict=True))
    worst = int(np.argmax(moments))
    return WorstMoment(
        moment_nm=float(moments[worst]),
        alpha_rad=float(alphas[worst]),
        piece_moments_nm=moments,
        unsolved=int(unsolved.sum()),
    )


def _peak(
    path: BendingPath, sheet: Sheet, alphas: list[float], q: float, axial: float | None
) -> tuple[float, float, int]:
    """Return the largest |M| between two end slopes, its α, and the number of unsolved points."""
    EI, L = sheet.bending_stiffness_nm2, sheet.length_m
    points = [(a, path.at(a)[0]) for a in alphas]
    states = rod.follow_symmetric(EI, L, points, q, None, axial, sheet)
    moments = [abs(s.end_moment_nm) if s.converged else -1.0 for s in states]
    best = int(np.argmax(moments))
    failed = sum(not s.converged for s in states)
    near = (alphas[max(best - 1, 0)], alphas[min(best + 1, len(alphas) - 1)])

    def negative(alpha: float) -> float:
        x = path.at(alpha)[0]
        state = rod.solve_symmetric(EI, L, alpha, x, q, states[best], axial, sheet)
        return -abs(state.end_moment_nm) if state.converged else 0.0

    found = minimize_scalar(negative, bounds=near, method="bounded", options={"xatol": 1e-6})
    if -float(found.fun) > moments[best]:
        return -float(found.fun), float(found.x), failed
    return moments[best], alphas[best], failed
