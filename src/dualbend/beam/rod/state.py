"""A state of the rod: loads on both grippers, shape, and a measure of the residual."""

import math
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from dualbend.beam._check import FloatArray
from dualbend.beam.rod import branch, ritz
from dualbend.beam.rod.basis import OUTPUT_POINTS

RESIDUAL_TOLERANCE = 1e-7
"""Largest relative residual of a converged state."""


class Grip(NamedTuple):
    """A grip in the planar frame: place and end slope α (positive: the end points down)."""

    x_m: float
    z_m: float
    angle_rad: float


class GripLoad(NamedTuple):
    """Force and moment of the sheet on a gripper, about the gripper centre.

    The forces are along x and z of the planar frame. The moment is about the gripper's own bending
    axis: positive turns that gripper towards a larger end slope.
    """

    force_x_n: float
    force_z_n: float
    moment_nm: float


class SymmetricStiffness(NamedTuple):
    """Derivatives of P and M for a symmetric motion of both grips: half distance dx, slope dα.

    On the zero-moment path dM/dα is about −π² EI/L and dP/dx about −16 π² EI/(α² L³).
    """

    force_per_distance_n_per_m: float
    force_per_slope_n_per_rad: float
    moment_per_distance_n: float
    moment_per_slope_nm_per_rad: float


@dataclass(frozen=True, kw_only=True)
class Scale:
    """The units of a dimensionless solution: EI [N m²], L [m], and where its left grip is [m]."""

    EI: float
    L: float
    left: Grip


@dataclass(frozen=True, kw_only=True)
class RodState:
    """An equilibrium of the rod; the arrays hold OUTPUT_POINTS equally spaced arc lengths.

    rise_m is the mean height of the ends above the middle. residual is the largest of: Newton's
    residual, the gap between the end moments as reactions and as EI (θ' + κ₀), and the imbalance of
    the moments about the left end, each relative to 1 + the dimensionless load. Where converged is
    False, reason says why, and unknown values are NaN. curvature_per_m is θ', whatever it is at
    rest.
    """

    left: GripLoad
    right: GripLoad
    rise_m: float
    s_m: FloatArray = field(repr=False)
    theta_rad: FloatArray = field(repr=False)
    x_m: FloatArray = field(repr=False)
    z_m: FloatArray = field(repr=False)
    curvature_per_m: FloatArray = field(repr=False)
    residual: float
    converged: bool
    reason: str
    scale: Scale = field(repr=False)
    problem: ritz.Problem = field(repr=False)
    unknowns: FloatArray = field(repr=False)

    @property
    def end_force_n(self) -> float:
        """Compressive end force P [N]: the sheet pushes the left gripper by −P along x."""
        return -self.left.force_x_n

    @property
    def end_moment_nm(self) -> float:
        """Moment on the left gripper, EI (θ'(0) + κ₀) [N m]."""
        return self.left.moment_nm

    def symmetric_stiffness(self) -> SymmetricStiffness:
        """Return the stiffness against symmetric motion of the two grips.

        All NaN where the state was not found, and for the flat rod that cannot stretch: there
        dP/dx diverges and the other three have different limits from both sides.
        """
        unknown = SymmetricStiffness(*[math.nan] * 4)
        if not self.unknowns.size:
            return unknown
        try:
            whole = self.problem.stiffness(self.problem.fields(self.unknowns))
        except np.linalg.LinAlgError:
            return unknown
        motions = np.array([[0.0, 0.0, -2.0, 0.0], [1.0, -1.0, 0.0, 0.0]])
        EI, L = self.scale.EI, self.scale.L
        powers = np.array([[L**3, L**2], [L**2, L]])
        stiffness = np.stack([whole[2], -whole[0]]) @ motions.T * EI / powers
        return SymmetricStiffness(*stiffness.ravel().tolist())


def residual(problem: ritz.Problem, unknowns: FloatArray) -> float:
    """Return the residual that RodState describes."""
    base, f, clamps = problem.basis, problem.fields(unknowns), problem.clamps
    p, v, q = float(unknowns[-2]), float(unknowns[-1]), problem.weight
    first, last = problem.end_moments(f)
    # By θ', not by the reactions: those balance whatever the discretisation does.
    line = clamps.slope_right - clamps.slope_left
    bend = base.out_slope[[0, -1]] @ unknowns[:-2] + line
    x = base.running @ (f.stretch * f.cos)
    if problem.along is not None:
        bend = problem.along.ends * (bend + problem.along.rest)
        x = problem.along.weight * x
    x_mean = float(base.weights @ x)
    balance = bend[0] - bend[1] + clamps.climb * p + (1.0 - clamps.shortening) * (v + q)
    size = 1.0 + abs(p) + abs(v) + q
    gaps = (
        np.max(np.abs(problem.residual(unknowns, f))) / size,
        np.max(np.abs(bend - (first, last))) / (1.0 + abs(first) + abs(last)),
        abs(balance - q * x_mean) / size,
    )
    return float(max(gaps))


def dimensional_state(scale: Scale, problem: ritz.Problem, unknowns: FloatArray) -> RodState:
    """Return a dimensionless solution in SI units, with its residual."""
    error = residual(problem, unknowns)
    reason = branch.other_mode(problem, unknowns)
    if not (reason or error <= RESIDUAL_TOLERANCE):
        reason = f"not resolved by {problem.basis.modes} trial functions"
    return _in_si(scale, problem, unknowns, error, reason)


def unsolved(scale: Scale, problem: ritz.Problem, reason: str) -> RodState:
    """Return a state without values for a point that was not solved."""
    unknown = np.full(problem.basis.modes + 2, math.nan)
    return replace(_in_si(scale, problem, unknown, math.inf, reason), unknowns=np.empty(0))


def _in_si(
    scale: Scale, problem: ritz.Problem, unknowns: FloatArray, error: float, reason: str
) -> RodState:
    """Return the state of some unknowns; converged without a reason why not."""
    base, f, clamps = problem.basis, problem.fields(unknowns), problem.clamps
    p, v, L = float(unknowns[-2]), float(unknowns[-1]), scale.L
    first, last = problem.end_moments(f)
    x = base.cumulative @ (f.stretch * f.cos)
    z = -(base.cumulative @ (f.stretch * f.sin))
    bend = base.out_slope @ unknowns[:-2] + clamps.slope_right - clamps.slope_left
    force, moment = scale.EI / L**2, scale.EI / L
    return RodState(
        left=GripLoad(-p * force, v * force, first * moment),
        right=GripLoad(p * force, -(v + problem.weight) * force, last * moment),
        rise_m=float(0.5 * (z[0] + z[-1]) - z[OUTPUT_POINTS // 2]) * L,
        s_m=base.out_sigma * L,
        theta_rad=problem.line(base.out_sigma) + base.out_phi @ unknowns[:-2],
        x_m=scale.left.x_m + x * L,
        z_m=scale.left.z_m + z * L,
        curvature_per_m=bend / L,
        residual=error,
        converged=not reason,
        reason=reason,
        scale=scale,
        problem=problem,
        unknowns=unknowns,
    )
