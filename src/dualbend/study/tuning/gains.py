"""What a search changes of a compliance: static compliance and lag of each axis, and its model.

An axis is a sampled lag C/(1 + τ s) with static compliance C and τ = b/k. The gain of the loop is
proportional to C, so its gain margin is inversely proportional to it; the longer τ, the less noise
passes and the later an error is answered. Both are times and ratios whatever the units of b and k
are.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Literal, NamedTuple, TypeAlias

import msgspec

from dualbend.control.compliance.admittance import (
    AdmittanceConfig,
    ComplianceConfig,
    ModelAdmittanceConfig,
)
from dualbend.control.compliance.base import AxisConfig, DirectionConfig
from dualbend.control.compliance.mass_spring_damper import DIRECTIONS, MassSpringDamperConfig
from dualbend.control.compliance.own import OwnComplianceConfig

Gains: TypeAlias = (
    AdmittanceConfig | ModelAdmittanceConfig | MassSpringDamperConfig | OwnComplianceConfig
)

SHORTEST_LAG, LONGEST_LAG_S = 0.2, 10.0
"""In command periods T and in seconds; e^(−T/τ) < 0.007: shorter makes no difference."""

_DIGITS = 4


class Knob(NamedTuple):
    """One number that a search changes: ``compliance`` or ``lag`` of an axis, a key, an option."""

    part: str
    key: str


OF_THE_MODEL = {
    Knob("predictor", "lead_x_s"): (2e-3, 0.5),
    Knob("predictor", "lead_rotation_s"): (2e-3, 0.5),
    Knob("predictor", "lead_until_rad"): (0.05, 4.0),
    Knob("schedule", "from_rad"): (0.005, 1.0),
}
"""Keys of a compliance with a model that are searched where they are given, and their range."""


def acting_axes(config: ComplianceConfig, end_rad: float) -> list[Literal["x", "rotation"]]:
    """Return the paper's axes of a compliance that act before a bending angle."""
    names: tuple[Literal["x", "rotation"], ...] = ("x", "rotation")
    if isinstance(config, MassSpringDamperConfig):
        return []
    given = {name: getattr(config, name) for name in names}
    return [
        name for name, axis in given.items() if axis is not None and axis.from_alpha_rad < end_rad
    ]


def knobs(config: Gains, end_rad: float) -> list[Knob]:
    """Return what can be changed of a compliance that acts up to a bending angle."""
    if isinstance(config, OwnComplianceConfig):
        return [Knob("options", name) for name in config.gains]
    if isinstance(config, MassSpringDamperConfig):
        given = [(name, part) for name in DIRECTIONS if (part := getattr(config, name)) is not None]
        return [Knob(name, "compliance") for name, _ in given] + [
            Knob(name, "lag") for name, part in given if part.k
        ]
    axes = acting_axes(config, end_rad)
    found = [Knob(name, key) for key in ("compliance", "lag") for name in axes]
    # A lead of 0 is none: there is nothing to multiply.
    return found + [
        knob for knob in OF_THE_MODEL if getattr(getattr(config, knob.part, None), knob.key, None)
    ]


def turned(config: Gains, knob: Knob, factor: float, period_s: float) -> Gains | None:
    """Return a compliance with one number multiplied; None where that leaves its range.

    ``period_s``: command period [s].
    """
    if isinstance(config, OwnComplianceConfig):
        return _multiplied(config, [knob.key], factor)
    part = getattr(config, knob.part)
    if isinstance(config, MassSpringDamperConfig):
        by = 1.0 / factor if knob.key == "compliance" else factor
        return msgspec.structs.replace(
            config, **{knob.part: _direction(part, by, whole=knob.key == "compliance")}
        )
    if knob in OF_THE_MODEL:
        value = _moved(getattr(part, knob.key), factor, *OF_THE_MODEL[knob])
        changed = value and msgspec.structs.replace(part, **{knob.key: _rounded(value)})
    elif knob.key == "compliance":
        changed = _scaled(part, 1.0 / factor, 1.0 / factor)
    else:
        lag = _moved(part.b / part.k, factor, SHORTEST_LAG * period_s, LONGEST_LAG_S)
        changed = lag and with_lag(part, lag, period_s)
    return msgspec.structs.replace(config, **{knob.part: changed}) if changed else None


def _moved(value: float, factor: float, low: float, high: float) -> float | None:
    """Return a number multiplied, from the nearest in its range; None where it leaves that."""
    moved = min(max(value, low), high) * factor
    return moved if low <= moved <= high else None


def softened(config: Gains, factor: float) -> Gains:
    """Return a compliance with the static compliance of both axes multiplied.

    Of a class of the user's all gains are divided: as large as they are, it is stiff.
    """
    if isinstance(config, OwnComplianceConfig):
        return _multiplied(config, config.gains, 1.0 / factor)
    if isinstance(config, MassSpringDamperConfig):
        each = {name: getattr(config, name) for name in DIRECTIONS}
        changed = {name: _direction(p, 1.0 / factor, whole=True) for name, p in each.items() if p}
        return msgspec.structs.replace(config, **changed)
    parts = {name: getattr(config, name) for name in ("x", "rotation")}
    return msgspec.structs.replace(
        config,
        **{name: _scaled(p, 1.0 / factor, 1.0 / factor) for name, p in parts.items() if p},
    )


def _multiplied(
    config: OwnComplianceConfig, names: Iterable[str], factor: float
) -> OwnComplianceConfig:
    changed = {name: _rounded(config.options[name] * factor) for name in names}
    return msgspec.structs.replace(config, options={**config.options, **changed})


def _direction(part: DirectionConfig, by: float, *, whole: bool) -> DirectionConfig:
    """Return a direction all of it multiplied, or its times: b by a factor, m by its square."""
    m, k = (part.m * by, part.k * by) if whole else (part.m * by**2, part.k)
    return msgspec.structs.replace(part, m=_rounded(m), b=_rounded(part.b * by), k=_rounded(k))


def with_lag(axis: AxisConfig, lag_s: float, period_s: float) -> AxisConfig:
    """Return an axis of the same static compliance with another lag b/k [s].

    The static compliance is 1/k in the static form and proportional to 1/(b (1 − a)),
    a = e^(−kT/b), in the other two.
    """
    if axis.form == "static":
        return _scaled(axis, lag_s * axis.k / axis.b, 1.0)
    before, after = (-math.expm1(-period_s / lag) for lag in (axis.b / axis.k, lag_s))
    b = axis.b * before / after
    return msgspec.structs.replace(axis, b=_rounded(b), k=_rounded(b / lag_s))


def _scaled(axis: AxisConfig, of_b: float, of_k: float) -> AxisConfig:
    return msgspec.structs.replace(axis, b=_rounded(axis.b * of_b), k=_rounded(axis.k * of_k))


def _rounded(value: float) -> float:
    """Return a number as a person would write it into a file."""
    return float(f"{value:.{_DIGITS}g}")
