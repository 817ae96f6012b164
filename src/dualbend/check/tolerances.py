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

Better = Literal["lower", "higher", "neither"]


class Tolerance(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
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


_SMOOTH = "rounding moves it by 1e-10, a tap or a cycle of delay more by 6e-3 or more in fig8"
_CONTACT = "contact amplifies rounding to 1e-4; other noise of the sensor moves it by 1 to 50 %"
_ACROSS = "as much as the peak force; no shipped scenario is misaligned, so not measured there"
_NEVER = "is 0 here"
_COUNT = "a count"
_SOLVER = "where the solver stops, not where the arm is; its limit is 1e-5"

_REST = (
    "friction decides where in its clearance a hole rests: 44 or 87 µm by another BLAS's rounding"
)

_UNKNOWN = Tolerance(kind="relative", size=0.01, reason="no default for this metric: review it")

_SIZES: dict[str, tuple[Literal["relative", "absolute"], float, float, str]] = {
    # name: kind, size, absolute size where the baseline is 0 and kind is relative, reason
    "peak_moment": ("relative", 2e-3, 1e-6, _SMOOTH),
    "rms_moment": ("relative", 2e-3, 1e-6, _SMOOTH),
    "peak_moment_by_piece": ("relative", 2e-3, 1e-6, _SMOOTH),
    "peak_force": ("relative", 5e-3, 1e-3, _SMOOTH),
    **dict.fromkeys(
        ("peak_lateral_force", "peak_twist_moment", "peak_yaw_moment"),
        ("relative", 5e-3, 1e-6, _ACROSS),
    ),
    "peak_deviation_x": ("relative", 2e-3, 1e-9, _SMOOTH),
    "peak_deviation_alpha": ("relative", 2e-3, 1e-9, _SMOOTH),
    "permanent_curvature": ("relative", 5e-3, 1e-6, _SMOOTH),
    "permanent_end_slope": ("relative", 5e-3, 1e-6, _SMOOTH),
    "curvature_before_release": ("relative", 2e-3, 1e-6, _SMOOTH),
    "peak_surface_strain": ("relative", 2e-3, 1e-8, _SMOOTH),
    "oscillation": ("relative", 5e-3, 1e-6, _SMOOTH),
    "oscillation_frequency": ("relative", 0.02, 0.1, "from extremes on a grid of 28 ms"),
    "oscillation_growth": ("relative", 0.02, 0.1, "from extremes on a grid of 28 ms"),
    "ik_residual_max": ("absolute", 1e-6, 0.0, _SOLVER),
    "ik_rotation_residual_max": ("absolute", 1e-6, 0.0, _SOLVER),
    "saturated_cycles": ("absolute", 1.0, 0.0, "a count of cycles above a bound; one may be on it"),
    "simulated_time": ("absolute", 0.014, 0.0, "half a cycle"),
    "holes_seated": ("absolute", 0.0, 0.0, _COUNT),
    "retries": ("absolute", 0.0, 0.0, _COUNT),
    "worst_hole_offset": ("absolute", 1e-4, 0.0, _REST),
    "worst_hole_height": ("absolute", 5e-6, 0.0, "a hundredth of what seated allows"),
    "peak_pin_force": ("relative", 0.02, 0.05, _CONTACT),
    "peak_edge_force": ("relative", 0.02, 0.05, _CONTACT),
    "yield_strain": ("relative", 1e-6, 0.0, "a quotient of two settings"),
    "middle_spacing_error": (
        "absolute",
        5e-7,
        0.0,
        "a tenth of what is found without misalignment",
    ),
}

_ASSEMBLY_SIZES: dict[str, tuple[Literal["relative", "absolute"], float, float, str]] = {
    "peak_moment": ("relative", 5e-3, 1e-6, _CONTACT),
    "peak_force": ("relative", 0.02, 0.05, _CONTACT),
    "peak_surface_strain": ("relative", 5e-3, 1e-8, _CONTACT),
    "simulated_time": ("absolute", 0.28, 0.0, "phases end on readings: ten cycles"),
}

_BETTER: dict[str, Better] = {
    "holes_seated": "higher",
    **dict.fromkeys(
        ("oscillation_frequency", "yield_strain", "middle_spacing_error", "simulated_time"),
        "neither",
    ),
}


def default_tolerance(
    metric: str, value: float | list[float | None] | None, assembly: bool
) -> Tolerance:
    """Return the tolerance that a metric is first written with, by its name and the kind of run."""
    sizes = {**_SIZES, **(_ASSEMBLY_SIZES if assembly else {})}
    if metric not in sizes:
        return _UNKNOWN
    kind, size, floor, reason = sizes[metric]
    if value is None:
        return Tolerance(kind="absolute", reason="there is none here")
    if kind == "relative" and value == 0.0:
        return Tolerance(kind="absolute", size=floor, reason=_NEVER)
    return Tolerance(kind=kind, size=size, reason=reason)


def better_where(metric: str) -> Better:
    """Return in which direction a metric improves; most are peaks and errors, the lower the better.

    One that this module does not know has neither.
    """
    return _BETTER.get(metric, "lower" if metric in _SIZES else "neither")
