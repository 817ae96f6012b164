"""Which cases an onset study looks at: a grid of rays, angles and axes, or drawn ones."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dualbend.study.onset.held import SingleAxis

RAYS_PER_S: tuple[float, ...] = (5.0, 20.0, 80.0, 1600.0)
"""k/b of the grid's rays [1/s]: the filter's pole is 0.87, 0.57, 0.11 and 0."""

ANGLES_RAD: tuple[float, ...] = (0.2, 0.5, 0.8)
AXES: tuple[SingleAxis, ...] = ("x", "rotation")

DRAWN_ANGLES_RAD = (0.2, 1.0)
DRAWN_RAYS_PER_S = (5.0, 1600.0)


class Point(NamedTuple):
    """One axis, held at one bending angle [rad], for gains on one ray k/b [1/s]."""

    axis: SingleAxis
    alpha_rad: float
    ratio_per_s: float


def grid(
    axes: Sequence[SingleAxis] = AXES,
    angles: Sequence[float] = ANGLES_RAD,
    rays: Sequence[float] = RAYS_PER_S,
) -> list[Point]:
    """Return every axis at every angle on every ray."""
    return [Point(*point) for point in itertools.product(axes, angles, rays)]


def drawn(number: int, seed: int, axes: Sequence[SingleAxis] = AXES) -> list[Point]:
    """Return cases that nobody chose: axes in turn, angles uniform, rays uniform in log(k/b).

    Angles to 0.01 rad and rays to two digits, so that a table says all of a case.
    """
    random = np.random.default_rng(seed)
    low, high = (math.log(ray) for ray in DRAWN_RAYS_PER_S)
    return [
        Point(
            axes[i % len(axes)],
            round(float(random.uniform(*DRAWN_ANGLES_RAD)), 2),
            float(f"{math.exp(random.uniform(low, high)):.2g}"),
        )
        for i in range(number)
    ]
