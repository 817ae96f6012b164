"""Discrete linear systems: in series, side by side, in feedback, and from a transfer function."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from dualbend.control.clock import ComplexVector, TransferFunction
from dualbend.types import Vector


@dataclass(frozen=True, kw_only=True)
class StateSpace:
    """A discrete system x⁺ = A x + B u, y = C x + D u."""

    a: Vector
    b: Vector
    c: Vector
    d: Vector

    def series(self, after: StateSpace) -> StateSpace:
        """Return this system followed by another one."""
        n, m = self.a.shape[0], after.a.shape[0]
        return StateSpace(
            a=np.block([[self.a, np.zeros((n, m))], [after.b @ self.c, after.a]]),
            b=np.vstack([self.b, after.b @ self.d]),
            c=np.hstack([after.d @ self.c, after.c]),
            d=after.d @ self.d,
        )

    def scaled(self, matrix: Vector) -> StateSpace:
        """Return this system with its output multiplied."""
        return StateSpace(a=self.a, b=self.b, c=matrix @ self.c, d=matrix @ self.d)

    def feedback(self, back: StateSpace) -> StateSpace:
        """Return y = self(u + back(y)); ``back`` knows the past only, so that its D is 0."""
        assert not back.d.any()
        return StateSpace(
            a=np.block(
                [
                    [self.a, self.b @ back.c],
                    [back.b @ self.c, back.a + back.b @ self.d @ back.c],
                ]
            ),
            b=np.vstack([self.b, back.b @ self.d]),
            c=np.hstack([self.c, self.d @ back.c]),
            d=self.d,
        )

    @property
    def dominant_pole(self) -> complex:
        """The eigenvalue of A with the largest magnitude; 0 of a system without states."""
        poles = np.linalg.eigvals(self.a)
        return complex(poles[np.argmax(np.abs(poles))]) if poles.size else 0j

    def frequency_response(self, z_inverse: ComplexVector) -> ComplexVector:
        """Return C (z − A)⁻¹ B + D (n, outputs, inputs) where z⁻¹ (n,) is given."""
        # With A = Q T Qᴴ, T triangular, all frequencies are substituted back at once.
        triangle, basis = linalg.schur(self.a, output="complex")
        inward = basis.conj().T @ self.b
        z = 1.0 / z_inverse
        states = np.zeros((triangle.shape[0], z.size, self.b.shape[1]), dtype=np.complex128)
        for i in reversed(range(triangle.shape[0])):
            above = (triangle[i, i + 1 :, np.newaxis, np.newaxis] * states[i + 1 :]).sum(axis=0)
            states[i] = (inward[i] + above) / (z - triangle[i, i])[:, np.newaxis]
        outward = self.c @ basis
        # Products of this shape are cheaper spelt out than as threaded matrix products.
        out = [(row[:, np.newaxis, np.newaxis] * states).sum(axis=0) for row in outward]
        return np.asarray(np.stack(out, axis=1) + self.d)


def static(matrix: Vector) -> StateSpace:
    """Return y = D u, without states."""
    rows, columns = matrix.shape
    return StateSpace(
        a=np.zeros((0, 0)), b=np.zeros((0, columns)), c=np.zeros((rows, 0)), d=np.asarray(matrix)
    )


def parallel(parts: Iterable[StateSpace]) -> StateSpace:
    """Return systems side by side, each with its own input and output."""
    items = list(parts)
    a, b, c, d = (
        linalg.block_diag(*(getattr(item, name) for item in items)) for name in ("a", "b", "c", "d")
    )
    return StateSpace(a=a, b=b, c=c, d=d)


def from_transfer_function(transfer: TransferFunction) -> StateSpace:
    """Return (numerator, denominator) in powers of z⁻¹ as observable canonical form."""
    numerator, denominator = transfer
    order = max(numerator.size, denominator.size) - 1
    n = np.pad(numerator, (0, order + 1 - numerator.size))
    d = np.pad(denominator, (0, order + 1 - denominator.size))
    a = np.eye(order, k=1)
    a[:, :1] = -d[1:, np.newaxis]
    c = np.eye(1, order)
    return StateSpace(a=a, b=(n - d * n[0])[1:, np.newaxis], c=c, d=n[:1, np.newaxis])
