"""How far each metric may be from its baseline, and why: what a baseline is first written with.

The sizes lie between two measurements on the shipped scenarios. Below: a Young's modulus changed by
one part in 10¹³, as much as another platform's rounding, moves the metrics of bending by 10⁻¹⁰ and
the forces of contact by 3·10⁻⁵; kernels of BLAS and NumPy for a processor of 2008 move them by
2·10⁻⁹ and 10⁻⁴, and where a hole comes to rest by half its clearance. Above: of 5 % of E
or b, a tap or a cycle of delay more, the weakest moves a moment of ``fig8`` by 0.6 %. Another seed
moves the forces of contact by a third: a baseline is of one seed. From then on the baseline's file
holds each metric's own.
"""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec

from dualbend.registry import TASKS
from dualbend.types import Config

Better = Literal["lower", "higher", "neither"]


class Tolerance(Config):
    """How far a value may be from the baseline's: |new − old| ≤ size, or ≤ size · |old|.

    ``kind`` "none": the metric is kept to be read and not gated. ``reason`` says why so much.
    """

    kind: Literal["relative", "absolute", "none"]
    size: Annotated[float, msgspec.Meta(ge=0)] = 0.0
    reason: Annotated[str, msgspec.Meta(min_length=1)]

    def allows(self, old: float, new: float) -> bool:
        """Tell whether the new value is within the tolerance of the old one."""
        if self.kind == "none":
            return True
        return abs(new - old) <= self.size * (abs(old) if self.kind == "relative" else 1.0)

    def in_words(self, unit: str) -> str:
        """Return the allowed change with its unit."""
        if self.kind == "relative":
            return f"{100 * self.size:g} %"
        return f"{self.size:g} {unit}" if self.kind == "absolute" else "not gated"


_NEVER = "is 0 here"
_SOLVER = "where the solver stops, not where the arm is; its limit is 1e-5"

_UNKNOWN = Tolerance(kind="relative", size=0.01, reason="no default for this metric: review it")

_Size = tuple[Literal["relative", "absolute"], float, float, str]
"""Kind, size, absolute size where the baseline is 0 and the kind is relative, reason."""

_SIZES: dict[str, _Size] = {
    "ik_residual_max": ("absolute", 1e-6, 0.0, _SOLVER),
    "ik_rotation_residual_max": ("absolute", 1e-6, 0.0, _SOLVER),
    **dict.fromkeys(
        ("after_stop_peak_force", "after_stop_peak_moment", "after_stop_peak_strain"),
        ("relative", 5e-3, 1e-6, "as much as the peaks before the stop"),
    ),
    **dict.fromkeys(
        ("peak_left_slip", "peak_right_slip"),
        ("relative", 1e-2, 1e-9, "friction that is met at the end of a physics step"),
    ),
    "saturated_cycles": ("absolute", 1.0, 0.0, "a count of cycles above a bound; one may be on it"),
    "stale_commands": ("absolute", 0.0, 0.0, "drawn from the seed alone"),
    "unintended_contacts": ("absolute", 0.0, 0.0, "a count of pairs of bodies"),
    "simulated_time": ("absolute", 0.014, 0.0, "half a cycle"),
}
"""Of the metrics that a run of any task has; the others are those of their task."""

_BETTER: dict[str, Better] = {
    "holes_seated": "higher",
    **dict.fromkeys(
        ("oscillation_frequency", "yield_strain", "middle_spacing_error", "simulated_time"),
        "neither",
    ),
}


def _sizes(task: str) -> dict[str, _Size]:
    return {**_SIZES, **TASKS[task].part("tolerances")}


def default_tolerance(
    metric: str, value: float | list[float | None] | None, task: str
) -> Tolerance:
    """Return the tolerance that a metric is first written with, by its name and the run's task."""
    sizes = _sizes(task)
    if metric not in sizes:
        return _UNKNOWN
    kind, size, at_zero, reason = sizes[metric]
    if value is None:
        return Tolerance(kind="absolute", reason="there is none here")
    if kind == "relative" and value == 0.0:
        return Tolerance(kind="absolute", size=at_zero, reason=_NEVER)
    return Tolerance(kind=kind, size=size, reason=reason)


def better_where(metric: str, task: str) -> Better:
    """Return in which direction a metric improves; most are peaks and errors, the lower the better.

    One that its task has no tolerance for has neither.
    """
    return _BETTER.get(metric, "lower" if metric in _sizes(task) else "neither")
