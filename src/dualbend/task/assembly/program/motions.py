"""What the robots are told and what they sense, and how a motion runs between two postures."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

from dualbend.types import Vector

CHECK: Final = "check seats"
"""The phase in which the sheet is moved on its pins, to feel whether they hold it."""

PHASES = (
    "approach",
    "grasp",
    "lift",
    "carry",
    "bend",
    "lower",
    "seat middle",
    "unfold",
    "lower outer",
    "seat outer",
    CHECK,
    "release",
    "withdraw",
)
"""Of each sheet, in this order."""

_PEAK_OVER_MEAN_SPEED = 1.875
"""Of the polynomial of fifth degree that every motion follows."""


@dataclass(frozen=True, kw_only=True)
class Posture:
    """Commanded place and bend of the sheet, and state of the grippers.

    ``x, y, z`` [m] and ``yaw`` [rad] of the middle of the sheet's mid-plane, ``alpha`` its end
    slope [rad], ``retreat`` [m] of each gripper outward from the sheet's end, ``opening`` [m] of
    a jaw.
    """

    x: float = 0.0
    y: float
    z: float
    yaw: float = 0.0
    alpha: float = 0.0
    retreat: float = 0.0
    opening: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Goal:
    """Nominal posture of one cycle, with the compliance that is wanted in it.

    ``levels`` (2,) [m]: by how much each arm is to be higher than the posture says.
    ``phase``: index into `PHASES`. ``alpha_ratio``: bending angle, over that at which the sheet is
    laid, for which the compliance is scheduled; None: no compliance. ``seeking``, with this share
    of the least speed in turning: the sheet lies on
    the tips of pins, whose flanks it feels, not their sides. ``relax``: it goes back to where it
    was sent. ``attempt``: counted from 0.
    """

    phase: int
    posture: Posture
    levels: tuple[float, float] = (0.0, 0.0)
    alpha_ratio: float | None = None
    seeking: float = 0.0
    relax: bool = False
    attempt: int = 0

    @property
    def free(self) -> bool:
        """The arms hold nothing yet."""
        return self.phase < PHASES.index("grasp")


@dataclass(frozen=True, kw_only=True)
class Sensed:
    """Measurements of one cycle, all from sensors that the robots have.

    ``net`` (4,): net force x, y, z [N] and moment about the vertical [N m] of the sheet on the
    arms. ``vertical`` (2,): force z on each arm [N]; ``moment`` (2,): about its bending axis [N m],
    positive where the sheet bends down. ``tension`` of the sheet between both arms,
    their mean [N]. ``gap`` (2,): between the pads [m].
    ``error_m``: distance of the grips from where they were sent; ``place`` (3,): x, y [m] and yaw
    [rad] of the sheet between them; ``behind`` (3,): where it was sent, less that; all by the
    joints' encoders.
    """

    net: Vector
    vertical: Vector
    moment: Vector
    tension: float
    gap: Vector
    error_m: float
    place: Vector
    behind: Vector


@dataclass(frozen=True, kw_only=True)
class Pace:
    """Highest speeds of a motion, and the command period in whose multiples it lasts."""

    linear_m_per_s: float
    angular_rad_per_s: float
    jaw_m_per_s: float
    period_s: float

    def cycles(self, begin: Posture, end: Posture) -> int:
        """Count the cycles that the slowest part of a motion takes, at least one."""
        distance = math.dist((begin.x, begin.y, begin.z), (end.x, end.y, end.z))
        duration = _PEAK_OVER_MEAN_SPEED * max(
            max(distance, abs(end.retreat - begin.retreat)) / self.linear_m_per_s,
            max(abs(end.alpha - begin.alpha), abs(end.yaw - begin.yaw)) / self.angular_rad_per_s,
            abs(end.opening - begin.opening) / self.jaw_m_per_s,
        )
        return max(1, math.ceil(duration / self.period_s))


def turned(posture: Posture, by_rad: float, centre_m: Vector) -> Posture:
    """Return a posture turned by a small angle about a point of the sheet, x, y from its middle."""
    x, y = centre_m.tolist()
    return replace(
        posture,
        x=posture.x + by_rad * y,
        y=posture.y - by_rad * x,
        yaw=posture.yaw + by_rad,
    )


def interpolate(begin: Posture, end: Posture, u: float) -> Posture:
    """Return the posture at u in [0, 1] of a motion's time: s(u) = u³ (10 − 15 u + 6 u²)."""
    share = u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
    both = zip(vars(begin).items(), vars(end).values(), strict=True)
    # Rounding must not leave the range, nor change what stays.
    return Posture(**{k: a if a == b else (1.0 - share) * a + share * b for (k, a), b in both})
