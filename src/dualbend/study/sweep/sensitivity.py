"""Which key matters how much: Sobol's indices of a sweep's metrics."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import pyarrow as pa
from scipy.stats import sobol_indices

from dualbend.study.sweep.design import Design
from dualbend.study.sweep.file import Sweep
from dualbend.study.sweep.table import numbers
from dualbend.types import Vector

CONFIDENCE, _RESAMPLES = 0.95, 400


def _nothing() -> Vector:
    return np.empty(0)


@dataclass(frozen=True, kw_only=True)
class Sensitivity:
    """One metric's indices, an entry a key (d,), with the ends of their intervals (2, d).

    ``first``: share of the variance that the key alone makes, V(E(Y|x_i))/V(Y). ``total``: share
    that it has a part in, 1 − V(E(Y|x_~i))/V(Y). ``why``: why there are none, else empty.
    """

    metric: str
    first: Vector = field(default_factory=_nothing)
    total: Vector = field(default_factory=_nothing)
    first_interval: Vector = field(default_factory=_nothing)
    total_interval: Vector = field(default_factory=_nothing)
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
    if not np.isfinite(y).all():
        missing = np.count_nonzero(~np.isfinite(y))
        return Sensitivity(metric=name, why=f"{missing} of {y.size} runs have no value")
    if np.ptp(y) <= 1e-12 * np.abs(y).max():
        return Sensitivity(metric=name, why="it does not vary")
    f_a, f_b, f_ab = y[:n], y[n : 2 * n], y[2 * n :].reshape(d, n)
    first, total = _estimate(f_a, f_b, f_ab)
    # Rows of the design, resampled; the same ones on every call.
    rng = np.random.default_rng(0)
    draws = rng.integers(n, size=(_RESAMPLES, n))
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore", RuntimeWarning)  # a draw without variance
        again = np.array([_estimate(f_a[i], f_b[i], f_ab[:, i]) for i in draws])
        tail = 50.0 * (1.0 - CONFIDENCE)
        ends = np.nanpercentile(again, [tail, 100.0 - tail], axis=0)
    return Sensitivity(
        metric=name,
        first=first,
        total=total,
        first_interval=ends[:, 0],
        total_interval=ends[:, 1],
    )


def _estimate(f_a: Vector, f_b: Vector, f_ab: Vector) -> tuple[Vector, Vector]:
    """Return first and total indices (d,) of samples (n,), (n,) and (d, n)."""
    found = sobol_indices(
        func={"f_A": f_a[None, :], "f_B": f_b[None, :], "f_AB": f_ab[:, None, :]}, n=f_a.size
    )
    d = f_ab.shape[0]
    return np.reshape(found.first_order, d), np.reshape(found.total_order, d)
