"""A planar rod between two clamps as a small dense problem: Legendre-Ritz in the slope θ.

Everything here is without dimension: σ = s/L, p = P L²/EI, v = V L²/EI, q = weight L³/EI and the
axial compliance κ = EI/(EA L²). The section force (of the right part on the left one) is
(−p, v + qσ) in (x, z); along the rod it is N = −p cos θ − (v + qσ) sin θ, across T = ∂N/∂θ.
The rod solution makes

    Λ(θ, p, v) = ∫ ½ θ'² − N − ½ κ N² dσ + p (c − 1) + v h

stationary, c the shortening 1 − Δx/L and h = Δz/L of the clamps. Its conditions are

    θ'' + (1 + κN) T = 0,   ∫ (1 + κN) cos θ = 1 − c,   −∫ (1 + κN) sin θ = h.

θ is the straight line between the end slopes plus integrated Legendre polynomials, whose
derivatives are orthonormal: bending contributes the unit matrix, and convergence is spectral.

A rod that is not uniform, or curved by κ₀ at rest (:class:`Along`), has ½ e (θ' + κ₀ L)² in the
place of ½ θ'², e = EI(σ)/EI; where e or its slope jumps, pieces of the rod have polynomials each.
Source: Reissner's finite-strain beam without shear, J. Appl. Math. Phys. 23 (1972) 795.
"""

from dataclasses import dataclass

import numpy as np

from dualbend.beam._check import FloatArray
from dualbend.beam.rod.basis import Basis


@dataclass(frozen=True, kw_only=True)
class Along:
    """What a rod is along its length, over a uniform one that is straight at rest.

    ``stiffness`` e, ``weight`` and ``hung`` (∫₀^σ of it) at the Gauss points, ``ends`` e(0) and
    e(1), ``rest`` κ₀ L.
    """

    stiffness: FloatArray
    weight: FloatArray
    hung: FloatArray
    ends: FloatArray
    rest: float


@dataclass(frozen=True, kw_only=True)
class Clamps:
    """Boundary conditions: θ(0), θ(1), the shortening 1 − Δx/L and the climb Δz/L of the grips."""

    slope_left: float
    slope_right: float
    shortening: float
    climb: float

    def towards(self, other: "Clamps", part: float) -> "Clamps":
        """Return the clamps a part (0..1) of the way to another."""
        mixed = {
            name: (1.0 - part) * value + part * getattr(other, name)
            for name, value in vars(self).items()
        }
        return Clamps(**mixed)


@dataclass(frozen=True, kw_only=True)
class Fields:
    """Fields of a state at the Gauss points."""

    theta: FloatArray
    cos: FloatArray
    sin: FloatArray
    along: FloatArray
    across: FloatArray
    stretch: FloatArray
    moment: FloatArray | None
    """e (θ' + κ₀ L), of a rod that is not uniform or not straight at rest."""


@dataclass(frozen=True, kw_only=True)
class Problem:
    """A rod (weight q, axial compliance κ) between clamps, on a basis.

    The unknowns are one vector: coefficients of φ, then p, then v.
    """

    basis: Basis
    clamps: Clamps
    weight: float
    compliance: float
    along: Along | None = None

    @property
    def hung(self) -> FloatArray:
        """The share of the weight before each Gauss point."""
        return self.basis.sigma if self.along is None else self.along.hung

    def line(self, sigma: FloatArray) -> FloatArray:
        """Return the straight line between the end slopes."""
        return self.clamps.slope_left * (1.0 - sigma) + self.clamps.slope_right * sigma

    def fields(self, unknowns: FloatArray) -> Fields:
        """Return slope, section forces and stretch 1 + κN at the Gauss points."""
        base = self.basis
        theta = self.line(base.sigma) + base.phi @ unknowns[:-2]
        cos, sin = np.cos(theta), np.sin(theta)
        p, lift = unknowns[-2], unknowns[-1] + self.weight * self.hung
        along = -p * cos - lift * sin
        across = p * sin - lift * cos
        stretch = 1.0 + self.compliance * along
        moment = None
        if self.along is not None:
            step = self.clamps.slope_right - self.clamps.slope_left
            turn = base.slope @ unknowns[:-2] + step + self.along.rest
            moment = self.along.stiffness * turn
        return Fields(
            theta=theta,
            cos=cos,
            sin=sin,
            along=along,
            across=across,
            stretch=stretch,
            moment=moment,
        )

    def residual(self, unknowns: FloatArray, f: Fields) -> FloatArray:
        """Return the gradient of Λ."""
        base, w = self.basis, self.basis.weights
        bent = unknowns[:-2] if f.moment is None else base.slope.T @ (w * f.moment)
        bending = bent - base.phi.T @ (w * f.stretch * f.across)
        # 1 − cos θ = 2 sin²(θ/2): nothing cancels near the flat sheet.
        lost = 2.0 * np.sin(f.theta / 2.0) ** 2 - self.compliance * f.along * f.cos
        chord = self.clamps.shortening - w @ lost
        climb = w @ (f.stretch * f.sin) + self.clamps.climb
        return np.concatenate([bending, [chord, climb]])

    def tangent(self, f: Fields, *, with_ends: bool = False) -> FloatArray:
        """Return the (symmetric) second derivative of Λ in the unknowns.

        The slope varies by the functions of the basis, then, ``with_ends``, by the lines 1 − σ and
        σ of the end slopes.
        """
        phi, slope = self.basis.phi, self.basis.slope
        if with_ends:
            sigma = self.basis.sigma
            phi = np.column_stack([phi, 1.0 - sigma, sigma])
            slope = np.column_stack([slope, -np.ones_like(sigma), np.ones_like(sigma)])
        w, kappa = self.basis.weights, self.compliance
        n = phi.shape[1]
        matrix = np.empty((n + 2, n + 2))
        geometric = w * (kappa * f.across**2 - f.stretch * f.along)
        if self.along is None:
            # The derivatives are orthonormal, but for those of the lines, −1 and 1, to each other.
            bend = np.eye(n)
        else:
            bend = slope.T @ ((w * self.along.stiffness)[:, None] * slope)
        matrix[:n, :n] = bend - phi.T @ (geometric[:, None] * phi)
        if with_ends and self.along is None:
            matrix[n - 2, n - 1] -= 1.0
            matrix[n - 1, n - 2] -= 1.0
        matrix[:n, n] = -phi.T @ (w * (f.stretch * f.sin - kappa * f.cos * f.across))
        matrix[:n, n + 1] = phi.T @ (w * (f.stretch * f.cos + kappa * f.sin * f.across))
        matrix[n:, :n] = matrix[:n, n:].T
        matrix[n, n] = -kappa * (w @ f.cos**2)
        matrix[n + 1, n + 1] = -kappa * (w @ f.sin**2)
        matrix[n, n + 1] = matrix[n + 1, n] = -kappa * (w @ (f.sin * f.cos))
        return matrix

    def end_moments(self, f: Fields) -> tuple[float, float]:
        """Return θ'(0) and θ'(1) as reactions, −∂Λ/∂θ(0) and ∂Λ/∂θ(1): twice the order of θ'."""
        sigma = self.basis.sigma
        load = self.basis.weights * f.stretch * f.across
        step = self.clamps.slope_right - self.clamps.slope_left
        if f.moment is not None:
            step = float(self.basis.weights @ f.moment)
        return step + float(load @ (1.0 - sigma)), step - float(load @ sigma)

    def stiffness(self, f: Fields) -> FloatArray:
        """Return the 4 × 4 second derivative of Λ in the clamps θ(0), θ(1), c and h.

        The unknowns follow: H_ββ − H_βu H_uu⁻¹ H_uβ. Λ's gradient there is (−M(0), M(1), p, v).
        """
        n = self.basis.modes
        whole = self.tangent(f, with_ends=True)
        inner = [*range(n), n + 2, n + 3]
        mixed = np.zeros((n + 2, 4))
        mixed[:, :2] = whole[inner, n : n + 2]
        mixed[n, 2] = mixed[n + 1, 3] = 1.0
        result = np.zeros((4, 4))
        result[:2, :2] = whole[n : n + 2, n : n + 2]
        return np.asarray(result - mixed.T @ np.linalg.solve(whole[np.ix_(inner, inner)], mixed))

    def unstable_directions(self, f: Fields) -> int:
        """Return the number of unstable directions of this equilibrium with its clamps held.

        The tangent has one negative eigenvalue per constraint; each further one is unstable.
        """
        return int(np.sum(np.linalg.eigvalsh(self.tangent(f)) < 0.0)) - 2


def start(problem: Problem) -> FloatArray:
    """Return a first guess of the unknowns: the shallow U that has the right shortening.

    About the chord, θ = a cos πσ + d cos 2πσ + b sin 2πσ with a, d the odd and even part of the
    end slopes and the larger root b of the shortening; p and v by least squares.
    """
    base, clamps = problem.basis, problem.clamps
    tilt = -np.arctan2(clamps.climb, 1.0 - clamps.shortening)
    odd = 0.5 * (clamps.slope_left - clamps.slope_right)
    even = 0.5 * (clamps.slope_left + clamps.slope_right) - tilt
    chord = np.hypot(clamps.climb, 1.0 - clamps.shortening)
    half = 8.0 * odd / (3.0 * np.pi)
    square = half**2 - odd**2 - even**2 + 4.0 * (1.0 - chord)
    b = -half + np.sqrt(max(square, 0.0))
    xi = np.pi * base.sigma
    slope = -odd * np.sin(xi) - 2.0 * even * np.sin(2.0 * xi) + 2.0 * b * np.cos(2.0 * xi)
    unknowns = np.concatenate([base.slope.T @ (base.weights * np.pi * slope), [0.0, 0.0]])
    f = problem.fields(unknowns)
    columns = base.phi.T @ (base.weights[:, None] * np.stack([f.sin, -f.cos], axis=1))
    bent = unknowns[:-2] if f.moment is None else base.slope.T @ (base.weights * f.moment)
    fixed = bent + base.phi.T @ (base.weights * problem.weight * problem.hung * f.cos)
    unknowns[-2:] = np.linalg.lstsq(columns, fixed, rcond=1e-10)[0]
    return unknowns


def newton(problem: Problem, unknowns: FloatArray, iterations: int = 25) -> FloatArray | None:
    """Return the stationary point that Newton's method reaches, or None where it fails."""
    u = unknowns.copy()
    for _ in range(iterations):
        f = problem.fields(u)
        r = problem.residual(u, f)
        try:
            step = np.linalg.solve(problem.tangent(f), -r)
        except np.linalg.LinAlgError:
            return None
        turn = float(np.max(np.abs(problem.basis.phi @ step[:-2])))
        if not np.isfinite(turn):
            return None
        u = u + step * min(1.0, 0.5 / max(turn, 1e-300))
        size = 1.0 + float(np.max(np.abs(u[-2:])))
        if turn < 1e-9 and float(np.max(np.abs(step[-2:]))) < 1e-8 * size:
            return u
    return None
