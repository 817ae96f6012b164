"""What a model is, to seven digits: equal on every platform, where its bytes are not."""

from __future__ import annotations

import hashlib

import mujoco
import numpy as np
from numpy.typing import NDArray

DIGITS = 7
"""Significant digits that count: the compiler of the model and BLAS differ in the last of 16."""

NOTHING = 1e-9
"""What is smaller in size is 0: the rest of a difference that should be."""


def model_fingerprint(model: mujoco.MjModel) -> str:
    """Return the SHA-256 of a compiled model's names and numbers, rounded.

    :func:`~dualbend.run.disk.output.model_hash` is the exact one: it tells a machine's models apart
    and is another on a machine whose rounding is.
    """
    digest = hashlib.sha256()
    for name in sorted(dir(model)):
        if name.startswith("_"):
            continue
        value = getattr(model, name)
        if isinstance(value, np.ndarray) and value.dtype.kind == "f":
            parts = [part.tobytes() for part in _rounded(value.astype(np.float64).ravel())]
        elif isinstance(value, np.ndarray | int):
            parts = [np.asarray(value).astype(np.int64).tobytes()]
        elif isinstance(value, bytes):
            parts = [value]
        else:
            continue
        digest.update(b"".join((name.encode(), *parts)))
    return digest.hexdigest()


def _rounded(values: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return mantissas of so many digits and exponents, as whole numbers."""
    kept = np.abs(values) > NOTHING
    some = values[kept]
    exponents = np.floor(np.log10(np.abs(some))).astype(np.int64)
    mantissas = np.rint(some / 10.0 ** (exponents - DIGITS + 1)).astype(np.int64)
    return mantissas, np.concatenate((exponents, np.flatnonzero(kept)))
