"""What a sweep may do with one key of a scenario: its values, a range of them, a distribution.

Each has an inverse distribution function: a number of (0, 1) makes a value of it. Values and ranges
are drawn with equal chances.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal, TypeAlias

import msgspec
import numpy as np
from scipy.special import ndtr, ndtri

from dualbend.errors import InputError, brief
from dualbend.scenario.explain import explain, refuse_unknown
from dualbend.scenario.keys import Key, sections
from dualbend.types import Config, Vector

MOST_VALUES = 100_000


class Values(Config):
    """The values themselves, of any kind that the key takes."""

    values: Annotated[tuple[Any, ...], msgspec.Meta(min_length=1, max_length=MOST_VALUES)]

    def levels(self) -> list[Any]:
        """Return the values in their order."""
        return list(self.values)


class Range(Config):
    """``steps`` values from ``min`` to ``max``, both included, in equal steps or equal ratios."""

    min: float
    max: float
    steps: Annotated[int, msgspec.Meta(ge=2, le=MOST_VALUES)]
    log: bool = False

    def __post_init__(self) -> None:
        """Refuse what is no range."""
        _refuse_bounds(self.min, self.max, positive=self.log)

    def levels(self) -> list[float]:
        """Return the values, rising."""
        space = np.geomspace if self.log else np.linspace
        return [float(value) for value in space(self.min, self.max, self.steps)]


class Uniform(Config):
    """Equally likely from ``min`` to ``max``; ``loguniform``: its logarithm is."""

    distribution: Literal["uniform", "loguniform"]
    min: float
    max: float

    def __post_init__(self) -> None:
        """Refuse what is no range."""
        _refuse_bounds(self.min, self.max, positive=self.distribution == "loguniform")

    def inverse(self, u: Vector) -> Vector:
        """Return min + u (max − min), or min (max / min)^u."""
        if self.distribution == "uniform":
            value = self.min + u * (self.max - self.min)
        else:
            value = self.min * (self.max / self.min) ** u
        return np.clip(value, self.min, self.max)  # rounding


class Normal(Config):
    """Normal, of this mean and standard deviation; cut off at ``min`` and ``max`` if given."""

    distribution: Literal["normal"]
    mean: float
    std: Annotated[float, msgspec.Meta(gt=0)]
    min: float | None = None
    max: float | None = None

    def __post_init__(self) -> None:
        """Refuse limits that leave nothing."""
        low, high = self._limits()
        _refuse_bounds(low, high, positive=False)
        if not ndtr((low - self.mean) / self.std) < ndtr((high - self.mean) / self.std):
            raise ValueError(f"min = {low} and max = {high} are too far from mean = {self.mean}")

    def _limits(self) -> tuple[float, float]:
        low = -math.inf if self.min is None else self.min
        return low, math.inf if self.max is None else self.max

    def inverse(self, u: Vector) -> Vector:
        """Return μ + σ Φ⁻¹(Φ(a) + u (Φ(b) − Φ(a))), a and b the limits in units of σ from μ."""
        low, high = self._limits()
        a, b = ndtr((low - self.mean) / self.std), ndtr((high - self.mean) / self.std)
        return np.clip(self.mean + self.std * ndtri(a + u * (b - a)), low, high)


Spec: TypeAlias = Values | Range | Uniform | Normal

_KINDS: tuple[tuple[str, type[Spec]], ...] = (("values", Values), ("distribution", Uniform))
_WORDS = {"values", "min", "max", "steps", "log", "distribution", "mean", "std"}
RIGHT = (
    "values = [...], or min, max, steps (and log = true), or distribution = "
    '"uniform" or "loguniform" with min, max, or "normal" with mean, std'
)


def is_spec(table: Mapping[str, Any]) -> bool:
    """Tell what says how a key varies from a section that holds such keys."""
    return not table or bool(_WORDS & table.keys())


def make_spec(table: object, source: str, key: str) -> Spec:
    """Return what a table says about a key; InputError names file, key, value, what is right."""
    where = f"keys.{key}"
    if not isinstance(table, dict) or not table:
        shown = "{}" if isinstance(table, dict) else brief(table)
        raise InputError(f"{source}: {where} = {shown}: needs {RIGHT}")
    kind: type[Spec] = next((kind for word, kind in _KINDS if word in table), Range)
    if table.get("distribution") == "normal":
        kind = Normal
    if kind is Range and not {"min", "max", "steps"} <= table.keys() <= _WORDS:
        raise InputError(f"{source}: {where} = {brief(table)}: needs {RIGHT}")
    refuse_unknown(table, {"": kind}, source, ("keys", key))
    try:
        return msgspec.convert(table, kind)
    except msgspec.ValidationError as error:
        text = explain(table, str(error), kind)
        dot = "." if str(error).endswith("`") else ": "
        raise InputError(f"{source}: {where}{dot}{text}") from error


def drawn(spec: Spec, u: Vector) -> list[Any]:
    """Return the values (n,) that numbers of (0, 1) make, each of the same chance."""
    if isinstance(spec, Uniform | Normal):
        # Neither 0 nor 1, where a normal distribution has no value.
        return [float(v) for v in spec.inverse(np.clip(u, 2.0**-53, 1.0 - 2.0**-53))]
    levels = spec.levels()
    at = np.minimum((u * len(levels)).astype(int), len(levels) - 1)
    return [levels[i] for i in at.tolist()]


def _refuse_bounds(low: float, high: float, *, positive: bool) -> None:
    if not low < high:
        raise ValueError(f"max = {high} must be above min = {low}")
    if positive and not low > 0.0:
        raise ValueError(f"min = {low} must be above 0: it has no logarithm")


OPTION = "compliance.options."
"""How the name begins of what a user's class is called with: which there are, it says itself."""


@functools.cache
def known_keys() -> dict[str, Key | None]:
    """Return every key of a scenario by name; None of a section."""
    found: dict[str, Key | None] = {}
    for section in sections():
        if section.path:
            found[section.title] = None
        # Kinds that share a key agree on it, but for words that only the last of them has.
        found |= {".".join((*section.path, key.name)): key for key in section.keys}
    return found
