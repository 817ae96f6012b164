"""Which key matters how much: Sobol's indices of a sweep's metrics."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from scipy.stats import sobol_indices

from dualbend.study.sweep.design import Design
from dualbend.study.sweep.file import Sweep
from dualbend.study.sweep.table import numbers
from dualbend.types import Vector

CONFIDENCE, _RESAMPLES = 0.95, 400


@dataclass(frozen=True)
class Sensitivity:
    """One metric's indices of each key (2, d), and the ends of their intervals (2, 2, d).

    Row 0, first: share of the variance that the key alone makes, V(E(Y|x_i))/V(Y). Row 1, total:
    share that it has a part in, 1 − V(E(Y|x_~i))/V(Y). ``why``: why there are none, else empty.
    """

    metric: str
    indices: Vector
    ends: Vector
    why: str = ""


def sensitivities(
    sweep: Sweep, design: Design, table: pa.Table, metrics: Sequence[str]
) -> list[Sensitivity]:
    """Return Sobol's first and total indices of metrics, with bootstrapped 95 % intervals.

    A metric that not every run has, or that is the same in all, has none, and says so: without a
    run the design is no longer the one whose estimate is known.
    """
    n, d = sweep.sample.n or 0, len(design.names)
    return [_indices(name, numbers(table, name), n, d) for name in metrics]


def _indices(name: str, y: Vector, n: int, d: int) -> Sensitivity:
    missing = np.count_nonzero(~np.isfinite(y))
    why = f"{missing} of {y.size} runs have no value" if missing else ""
    if not why and np.ptp(y) <= 1e-12 * np.abs(y).max():
        why = "it does not vary"
    if why:
        return Sensitivity(name, np.empty((2, 0)), np.empty((2, 2, 0)), why)
    f_a, f_b, f_ab = y[:n], y[n : 2 * n], y[2 * n :].reshape(d, n)
    # Rows of the design, resampled; the same ones on every call.
    draws = np.random.default_rng(0).integers(n, size=(_RESAMPLES, n))
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore", RuntimeWarning)  # a draw without variance
        again = np.array([_estimate(f_a[i], f_b[i], f_ab[:, i]) for i in draws])
        tail = 50.0 * (1.0 - CONFIDENCE)
        ends = np.nanpercentile(again, [tail, 100.0 - tail], axis=0)
    return Sensitivity(name, _estimate(f_a, f_b, f_ab), ends)


def _estimate(f_a: Vector, f_b: Vector, f_ab: Vector) -> Vector:
    """Return first and total indices (2, d) of samples (n,), (n,) and (d, n)."""
    found = sobol_indices(
        func={"f_A": f_a[None, :], "f_B": f_b[None, :], "f_AB": f_ab[:, None, :]}, n=f_a.size
    )
    return np.reshape([found.first_order, found.total_order], (2, -1))
