"""What an onset study found: predicted and simulated onset of the oscillation, case by case."""

from __future__ import annotations

import math
from typing import Annotated, TypeAlias

import msgspec

from dualbend.study.onset.held import SingleAxis

_Size: TypeAlias = Annotated[float, msgspec.Meta(ge=0)]


class Rate(msgspec.Struct, frozen=True, kw_only=True):
    """Growth rates [1/s] at one b; the simulated one is null where no stretch of the run tells."""

    b: float
    predicted_per_s: float
    simulated_per_s: float | None


class Simulated(msgspec.Struct, frozen=True, kw_only=True):
    """The onset b that the runs give, and more.

    Below ``unstable_b`` every run grows, above ``stable_b`` none, between them friction decides;
    ``frequency_hz`` at ``growing_b``, of the runs that grow the nearest to the onset; ``residual``:
    rms of the deviation [m] or [rad] that stays at 1.1 times the onset, where a linear loop would
    rest. Null where a run ended too early.
    """

    b: float
    unstable_b: float
    stable_b: float
    growing_b: _Size
    frequency_hz: _Size | None
    residual: _Size | None
    rates: tuple[Rate, ...]
    runs: int


class Case(msgspec.Struct, frozen=True, kw_only=True):
    """One axis at one angle on one ray; b in the axis's own units.

    ``*_b``: onset by each analysis; ``sampled_hz``: of the sampled loop at its own onset,
    ``same_gains_hz``: with the gains at which the simulation oscillates; ``simulated``: with dry
    friction, as the scenario runs; ``frictionless``: without that of the joints.
    """

    key: str
    axis: SingleAxis
    alpha_rad: float
    ratio_per_s: float
    paper_b: _Size
    delayed_b: _Size
    sampled_b: _Size
    sampled_hz: _Size
    same_gains_hz: _Size
    simulated: Simulated
    frictionless: Simulated

    def error(self, analysis: str) -> float:
        """Return predicted over simulated onset, less 1; positive is an early warning."""
        predicted: float = getattr(self, f"{analysis}_b")
        return predicted / self.simulated.b - 1.0

    @property
    def frequency_error(self) -> float:
        """Return predicted over simulated frequency with the same gains, less 1."""
        simulated_hz = self.simulated.frequency_hz
        return math.nan if simulated_hz is None else self.same_gains_hz / simulated_hz - 1.0


class OnsetStudy(msgspec.Struct, frozen=True, kw_only=True):
    """All cases of one scenario, in the order that was asked for."""

    scenario: str
    cases: tuple[Case, ...]
