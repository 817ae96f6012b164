"""Fitted windows of the oscillation measure that are written down."""

from typing import Any

import numpy as np

from dualbend.evaluation.sinusoids import Fits


def windows(**changed: Any) -> Fits:
    """Return one window that tells a rate, but for what is changed."""
    parts: dict[str, Any] = {
        "start": 0,
        "rows": 50,
        "rate": -1.0,
        "frequency": 2.5,
        "error": 0.1,
        "bend": 0.05,
        "rest": 0.01,
        "size": 1.0,
    }
    size = max(np.size(value) for value in changed.values()) if changed else 1
    return Fits(*(np.resize(value, size) for value in {**parts, **changed}.values()))
