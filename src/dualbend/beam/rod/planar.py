"""The reference solution in the plane: the rod with weight between any two grips.

In the planar frame (x right, z up) θ is the slope below the horizontal, positive at the left end:

    M' + (1 + ε) (P sin θ − (V + q s) cos θ) = 0,   x' = (1 + ε) cos θ,   z' = −(1 + ε) sin θ

with M = EI (θ' + κ₀), θ(0) = α_left, θ(L) = −α_right. P is the compressive horizontal force, V + qs
the vertical section force, q the weight per arc length, and ε = N/EA the stretch (0 for the
inextensible rod). In the symmetric case V = −q L/2, hence EI θ'' + P sin θ + q (L/2 − s) cos θ = 0.
The weight of a hanging sheet pulls the grippers together: it lowers P, as it does in a chain. EI
and q may vary along the rod, κ₀ is its curvature at rest: a uniform rod has the shape of a straight
one between the same grips, with EI κ₀ more moment on both.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import lru_cache

import numpy as np

from dualbend.beam._check import FloatArray, finite, positive
from dualbend.beam.rod import branch, ritz
from dualbend.beam.rod.basis import basis
from dualbend.beam.rod.state import (
    RESIDUAL_TOLERANCE,
    Grip,
    RodState,
    Scale,
    dimensional_state,
    unsolved,
)
from dualbend.beam.sheet import Sheet
from dualbend.errors import InputError

__all__ = [
    "Grip",
    "RodState",
    "follow_planar",
    "follow_symmetric",
    "solve_planar",
    "solve_symmetric",
]

MODES = (24, 48, 96)
"""Numbers of trial functions: the next one is taken where a state (taut, say) is not resolved."""
FLAT_ANGLE_RAD = 1e-7
"""Below this an end slope shortens the rod by less than rounding."""

PlainGrip = tuple[float, float, float]
"""(x [m], z [m], end slope α [rad]) of a grip; a Grip is one."""


def solve_symmetric(
    EI: float,
    L: float,
    alpha: float,
    half_distance: float,
    weight_per_length: float = 0.0,
    guess: RodState | None = None,
    axial_stiffness_n: float | None = None,
    sheet: Sheet | None = None,
) -> RodState:
    """Return the symmetric hanging rod with both end slopes α [rad] and half distance x [m].

    It is solve_planar with the grips at (−x, 0, α) and (x, 0, α).
    """
    left, right = (-half_distance, 0.0, alpha), (half_distance, 0.0, alpha)
    return solve_planar(EI, L, left, right, weight_per_length, guess, axial_stiffness_n, sheet)


def solve_planar(
    EI: float,
    L: float,
    left: PlainGrip,
    right: PlainGrip,
    weight_per_length: float = 0.0,
    guess: RodState | None = None,
    axial_stiffness_n: float | None = None,
    sheet: Sheet | None = None,
) -> RodState:
    """Return the rod that hangs between two grips (x [m], z [m], end slope α [rad]).

    EI [N m²], L [m], weight_per_length [N/m]; axial_stiffness_n is EA [N], None for a rod that
    does not stretch. guess is a known state nearby. A sheet that is given is of these and says how
    they vary along it, and how it is curved at rest. The solution is the first buckling mode with
    the middle below the grips. If none is found, converged is False and reason says why.
    Raises InputError only for numbers that cannot be a rod or a grip.
    """
    scale = _scale(EI, L, Grip(*left), Grip(*right))
    if finite("weight_per_length", weight_per_length) < 0.0:
        raise InputError(f"weight_per_length must not be negative, got {weight_per_length!r}")
    EA = axial_stiffness_n
    problem = ritz.Problem(
        basis=basis(MODES[0]),
        clamps=ritz.Clamps(
            slope_left=left[2],
            slope_right=-right[2],
            shortening=(L - (right[0] - left[0])) / L,
            climb=(right[1] - left[1]) / L,
        ),
        weight=weight_per_length * L**3 / EI,
        compliance=0.0 if EA is None else EI / (positive("axial_stiffness_n", EA) * L * L),
    )
    clamps = problem.clamps
    uniform = sheet is None or not sheet.profile
    if EA is None and not problem.weight and _is_flat(clamps) and uniform:
        return _flat_limit(scale, _on_basis(problem, MODES[0], sheet))
    if EA is None and math.hypot(1.0 - clamps.shortening, clamps.climb) >= 1.0:
        reason = "taut: the grips are at least L apart and the rod cannot stretch"
        return unsolved(scale, problem, reason)
    return _refine(scale, problem, guess, sheet)


def follow_symmetric(
    EI: float,
    L: float,
    points: Iterable[tuple[float, float]],
    weight_per_length: float = 0.0,
    guess: RodState | None = None,
    axial_stiffness_n: float | None = None,
    sheet: Sheet | None = None,
) -> tuple[RodState, ...]:
    """Return the states along a sequence of (α [rad], half distance [m]), as follow_planar does."""
    pairs = (((-x, 0.0, alpha), (x, 0.0, alpha)) for alpha, x in points)
    return follow_planar(EI, L, pairs, weight_per_length, guess, axial_stiffness_n, sheet)


def follow_planar(
    EI: float,
    L: float,
    grips: Iterable[tuple[PlainGrip, PlainGrip]],
    weight_per_length: float = 0.0,
    guess: RodState | None = None,
    axial_stiffness_n: float | None = None,
    sheet: Sheet | None = None,
) -> tuple[RodState, ...]:
    """Return the states along a sequence of (left grip, right grip), each from the previous one.

    A point without a solution has converged False and is not used as the next start.
    """
    states: list[RodState] = []
    for left, right in grips:
        state = solve_planar(EI, L, left, right, weight_per_length, guess, axial_stiffness_n, sheet)
        states.append(state)
        guess = state if state.converged else guess
    return tuple(states)


def _scale(EI: float, L: float, left: Grip, right: Grip) -> Scale:
    """Check the input and return the units of the dimensionless problem."""
    for side, grip in (("left", left), ("right", right)):
        for name, value in zip(Grip._fields, grip, strict=True):
            finite(f"{side} {name}", value)
        if abs(grip.angle_rad) >= math.pi:
            raise InputError(f"{side} angle_rad must lie within ±π, got {grip.angle_rad!r}")
    return Scale(EI=positive("EI", EI), L=positive("L", L), left=left)


def _is_flat(clamps: ritz.Clamps) -> bool:
    """Return whether the clamps are those of the straight rod, except for rounding."""
    steepest = max(abs(clamps.slope_left), abs(clamps.slope_right), abs(clamps.climb))
    return steepest <= FLAT_ANGLE_RAD and abs(clamps.shortening) < 1e-14


def _flat_limit(scale: Scale, problem: ritz.Problem) -> RodState:
    """Return the flat rod, the limit of the zero-moment path; any P up to 4π² EI/L² is possible."""
    unknowns = np.concatenate([np.zeros(problem.basis.modes), [math.pi**2, 0.0]])
    reason = "flat: P is indeterminate, the limit of the zero-moment path is given"
    return replace(dimensional_state(scale, problem, unknowns), converged=True, reason=reason)


def _on_basis(problem: ritz.Problem, modes: int, sheet: Sheet | None) -> ritz.Problem:
    """Return the problem on a basis, with what varies along the rod at its Gauss points."""
    if sheet is None or sheet.is_plain:
        return replace(problem, basis=basis(modes))
    return replace(problem, basis=basis(modes, _breaks(sheet)), along=_along(sheet, modes))


def _breaks(sheet: Sheet) -> tuple[float, ...]:
    return tuple(s / sheet.length_m for s in sheet.breaks_m)


@lru_cache(maxsize=64)
def _along(sheet: Sheet, modes: int) -> ritz.Along:
    base, L = basis(modes, _breaks(sheet)), sheet.length_m
    places = [*(L * base.sigma).tolist(), 0.0, L]
    stiffness = [sheet.section_at(s).bending_stiffness_nm2 for s in places]
    relative = np.array(stiffness) / sheet.bending_stiffness_nm2
    weight = sheet.thickness_at(L * base.sigma) / sheet.thickness_m
    return ritz.Along(
        stiffness=relative[:-2],
        weight=weight,
        hung=base.running @ weight,
        ends=relative[-2:],
        rest=sheet.rest_curvature_per_m * L,
    )


def _refine(
    scale: Scale, problem: ritz.Problem, guess: RodState | None, sheet: Sheet | None
) -> RodState:
    """Solve on larger and larger bases until the state is resolved."""
    best: RodState | None = None
    for modes in MODES:
        state = _attempt(scale, _on_basis(problem, modes, sheet), guess)
        if state is not None and state.residual <= RESIDUAL_TOLERANCE:
            return state
        best = state or best
        guess = best or guess
    return best or unsolved(scale, problem, "no equilibrium found, in sub-steps neither")


def _attempt(scale: Scale, problem: ritz.Problem, guess: RodState | None) -> RodState | None:
    """Try five starts: guess, steps from it, first guess, steps from the elastica, straight."""
    modes = problem.basis.modes
    starts: list[Callable[[], FloatArray | None]] = []
    if guess is not None and guess.unknowns.size:
        clamps, known = guess.problem.clamps, branch.resized(guess.unknowns, modes)
        starts = [lambda: known, lambda: branch.walk(problem, clamps, known)]
    starts += [
        lambda: ritz.start(problem),
        lambda: branch.walk(problem, *branch.on_curve(problem)),
        lambda: np.zeros(modes + 2),
    ]
    flagged: RodState | None = None
    for start in starts:
        begin = start()
        found = None if begin is None else ritz.newton(problem, begin)
        if found is None:
            continue
        state = dimensional_state(scale, problem, found)
        if state.converged or state.residual > RESIDUAL_TOLERANCE:
            return state
        flagged = flagged or state
    return flagged
