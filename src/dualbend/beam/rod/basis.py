"""Trial functions of a rod's slope: integrated Legendre polynomials, of the whole or of pieces.

Their derivatives are orthonormal, so that the bending of a uniform rod is the unit matrix.
"""

from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np
from numpy.polynomial.legendre import leggauss, legvander

from dualbend.beam._check import FloatArray

OUTPUT_POINTS = 81
"""Equally spaced arc lengths of a result; L/80 meets the hinges of 10, 20 and 40 strips."""


@dataclass(frozen=True, kw_only=True)
class Basis:
    """Tables of the trial functions φ_k at the Gauss points and at the output points."""

    sigma: FloatArray
    weights: FloatArray
    phi: FloatArray
    slope: FloatArray
    running: FloatArray
    """∫₀^σ at the Gauss points of a function known there."""
    out_sigma: FloatArray
    out_phi: FloatArray
    out_slope: FloatArray
    cumulative: FloatArray
    """∫₀^σ at the output points of a function known at the Gauss points."""

    @property
    def modes(self) -> int:
        """Number of trial functions."""
        return int(self.phi.shape[1])


def _integrated(xi: FloatArray, count: int) -> FloatArray:
    """∫₀^σ of the Legendre polynomials 1..count in 2σ − 1, each scaled to unit norm on [0, 1]."""
    table = legvander(xi, count + 1)
    degree = np.arange(1, count + 1)
    return np.asarray((table[:, 2:] - table[:, :-2]) / (2.0 * np.sqrt(2.0 * degree + 1.0)))


def _legendre(xi: FloatArray, count: int) -> FloatArray:
    """Return the Legendre polynomials 1..count, each scaled to unit norm on [0, 1]."""
    degree = np.arange(1, count + 1)
    return np.asarray(legvander(xi, count)[:, 1:] * np.sqrt(2.0 * degree + 1.0))


def _antiderivative(sigma: FloatArray, count: int) -> FloatArray:
    """∫₀^σ of the first scaled Legendre polynomials, the constant one included."""
    return np.hstack([sigma[:, None], _integrated(2.0 * sigma - 1.0, count - 1)])


_FEWEST = 6
"""Trial functions of a piece of a rod."""


@cache
def basis(modes: int, breaks: tuple[float, ...] = (0.0, 1.0)) -> Basis:
    """Return the tables for a number of trial functions (twice as many Gauss points).

    With ``breaks``, from 0 to 1, the functions are smooth between them alone.
    """
    if len(breaks) > 2:
        return _pieced(max(_FEWEST, -(-modes // (len(breaks) - 1))), breaks)
    xi, gauss = leggauss(2 * modes)
    weights = gauss / 2.0
    out = np.linspace(0.0, 1.0, OUTPUT_POINTS)
    points = xi.size
    norm = np.sqrt(2.0 * np.arange(points) + 1.0)
    inner = (xi + 1.0) / 2.0
    coefficients = (legvander(xi, points - 1) * norm).T * weights
    return Basis(
        sigma=inner,
        weights=weights,
        phi=_integrated(xi, modes),
        slope=_legendre(xi, modes),
        running=_antiderivative(inner, points) @ coefficients,
        out_sigma=out,
        out_phi=_integrated(2.0 * out - 1.0, modes),
        out_slope=_legendre(2.0 * out - 1.0, modes),
        cumulative=_antiderivative(out, points) @ coefficients,
    )


def _pieced(modes: int, breaks: tuple[float, ...]) -> Basis:
    """Return the tables of pieces between breaks, each with as many functions.

    First come those that are straight in each piece, as many as inner breaks, then those of each
    piece by their degree: a larger basis begins with a smaller one.
    """
    lengths = np.diff(breaks)
    # Slopes d of the straight ones: Σ ℓ d = 0, Σ ℓ d dᵀ = 1, so that √ℓ d are orthonormal to √ℓ.
    roots = np.sqrt(lengths)
    q, _ = np.linalg.qr(np.column_stack([roots, np.eye(lengths.size)[:, :-1]]))
    straight = q[:, 1:] / roots[:, np.newaxis]
    starts = np.vstack([np.zeros(lengths.size - 1), np.cumsum(lengths[:, None] * straight, axis=0)])
    one = basis(modes)
    points = one.sigma.size
    out = np.linspace(0.0, 1.0, OUTPUT_POINTS)
    of_out = np.clip(np.searchsorted(breaks, out, "right") - 1, 0, lengths.size - 1)
    norm = np.sqrt(2.0 * np.arange(points) + 1.0)
    coefficients = (legvander(2.0 * one.sigma - 1.0, points - 1) * norm).T * one.weights
    tables: list[list[FloatArray]] = []
    integrals: list[list[FloatArray]] = []
    for i, (low, high) in enumerate(pairwise(breaks)):
        shown = (out[of_out == i] - low) / (high - low)
        places = (one.sigma, shown)
        piece = (i, high - low, straight[i], starts[i], modes)
        tables.append([_of_piece(*piece, xi, slopes=k) for xi in places for k in (False, True)])
        local = (one.running, _antiderivative(shown, points) @ coefficients)
        integrals.append([_over_pieces(i, lengths, one.weights, table) for table in local])
    phi, slope, out_phi, out_slope = (np.vstack(table) for table in zip(*tables, strict=True))
    running, cumulative = (np.vstack(table) for table in zip(*integrals, strict=True))
    return Basis(
        sigma=np.concatenate(
            [low + n * one.sigma for low, n in zip(breaks, lengths, strict=False)]
        ),
        weights=np.concatenate([n * one.weights for n in lengths]),
        phi=phi,
        slope=slope,
        running=running,
        out_sigma=out,
        out_phi=out_phi,
        out_slope=out_slope,
        cumulative=cumulative,
    )


def _over_pieces(
    piece: int, lengths: FloatArray, weights: FloatArray, table: FloatArray
) -> FloatArray:
    """Return ∫₀^σ at places of one piece of a function known at the Gauss points of all."""
    blocks = [
        *(np.tile(n * weights, (len(table), 1)) for n in lengths[:piece]),
        lengths[piece] * table,
        *(np.zeros((len(table), weights.size)) for _ in lengths[piece + 1 :]),
    ]
    return np.hstack(blocks)


def _of_piece(
    piece: int,
    length: float,
    straight: FloatArray,
    start: FloatArray,
    modes: int,
    xi: FloatArray,
    *,
    slopes: bool,
) -> FloatArray:
    """Return all trial functions, or their derivatives, at places 0..1 of one piece."""
    count, s = straight.size + 1, 2.0 * xi - 1.0
    if slopes:
        ramp, own = np.tile(straight, (xi.size, 1)), _legendre(s, modes) / np.sqrt(length)
    else:
        ramp = start + length * xi[:, np.newaxis] * straight
        own = _integrated(s, modes) * np.sqrt(length)
    inner = np.zeros((xi.size, modes, count))
    inner[:, :, piece] = own
    return np.hstack([ramp, inner.reshape(xi.size, modes * count)])
