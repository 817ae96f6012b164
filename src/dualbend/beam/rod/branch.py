"""Solution on the first buckling mode: starts, sub-steps and detection of other modes."""

from dataclasses import replace

import numpy as np

from dualbend.beam import elastica
from dualbend.beam._check import FloatArray
from dualbend.beam.rod import ritz
from dualbend.beam.rod.basis import OUTPUT_POINTS

SMALLEST_STEP = 1.0 / 256.0
"""Where a sub-step shorter than this part of the way fails, the point is given up."""


def resized(unknowns: FloatArray, modes: int) -> FloatArray:
    """Return the unknowns on a basis of another size; its functions are hierarchical."""
    return np.concatenate([np.pad(unknowns[:-2], (0, modes))[:modes], unknowns[-2:]])


def on_curve(problem: ritz.Problem) -> tuple[ritz.Clamps, FloatArray]:
    """Return the elastica of the problem's mean end slope as a start: EI θ' = P z there."""
    mean = 0.5 * (problem.clamps.slope_left - problem.clamps.slope_right)
    alpha = min(max(mean, 0.1), 0.95 * elastica.END_SLOPE_GRIPPERS_MEET)
    clamps = ritz.Clamps(
        slope_left=alpha,
        slope_right=-alpha,
        shortening=2.0 * elastica.shortening(alpha, 1.0),
        climb=0.0,
    )
    base = problem.basis
    force = elastica.end_force(alpha, 1.0, 1.0)
    bend = force * elastica.shape(alpha, 1.0, base.sigma)[1]
    return clamps, np.concatenate([base.slope.T @ (base.weights * bend), [force, 0.0]])


def walk(problem: ritz.Problem, begin: ritz.Clamps, unknowns: FloatArray) -> FloatArray | None:
    """Follow the first mode from a known state to the problem's clamps, halving failed steps.

    Returns the unknowns there, or None where a step below SMALLEST_STEP would be needed.
    """
    done, step, known = 0.0, 0.5, unknowns
    while done < 1.0:
        reach = min(done + step, 1.0)
        stage = replace(problem, clamps=begin.towards(problem.clamps, reach))
        found = ritz.newton(stage, known, 10)
        if found is not None and not other_mode(stage, found):
            done, known, step = reach, found, 2.0 * step
        else:
            step /= 2.0
        if step < SMALLEST_STEP:
            return None
    return known


def other_mode(problem: ritz.Problem, unknowns: FloatArray) -> str:
    """Return why a state is not the hanging first mode, or nothing where it is.

    The first mode is stable while the clamps are held, and its middle is below its ends.
    """
    f = problem.fields(unknowns)
    unstable = problem.unstable_directions(f)
    if unstable:
        return f"another mode: unstable in {unstable} direction(s), the sheet would snap"
    base, clamps = problem.basis, problem.clamps
    drop = base.cumulative @ (f.stretch * f.sin)
    sag = float(drop[OUTPUT_POINTS // 2] - 0.5 * drop[-1])
    # A taut sheet whose ends point up by a little may stand above its chord by their slope.
    allowed = 0.25 * max(0.0, -0.5 * (clamps.slope_left - clamps.slope_right)) + 1e-9
    return f"another mode: the middle is {-sag:.3g} L above the ends" if sag < -allowed else ""
