"""What a low-pass filter costs of the stable gain, predicted and in the full simulation."""

from __future__ import annotations

import statistics
from collections.abc import Sequence

import msgspec

from dualbend.control.filters import FirConfig, IirConfig, LowPassConfig, NoFilterConfig
from dualbend.errors import InputError
from dualbend.scenario.scenario import Scenario
from dualbend.study.onset.held import SingleAxis, oscillate
from dualbend.study.onset.prediction import RayLoop
from dualbend.study.onset.threshold import threshold
from dualbend.table import Column, Table

FILTERS: tuple[LowPassConfig, ...] = (
    NoFilterConfig(),
    FirConfig(taps=2),
    FirConfig(taps=3),
    IirConfig(order=2),
)
"""None, two FIR and the Butterworth, at the 10 Hz of the paper."""

_STEP = 0.003
"""From one b to the next: a loss is a difference of two onsets."""

_PARTS = (0.5, 0.7, 1.0, 1.4, 2.0)
"""Of the disturbance: dry friction scatters an onset by some per cent, the median less so."""


class FilterCase(msgspec.Struct, frozen=True, kw_only=True):
    """One filter: onset b, and the part of the first filter's stable gain that it costs.

    On a ray the loop's gain is inverse to b, so the loss is 1 − b(first)/b.
    """

    name: str
    predicted_b: float
    simulated_b: float
    predicted_loss: float
    simulated_loss: float


def filters_compared(
    scenario: Scenario,
    *,
    axis: SingleAxis = "x",
    alpha_rad: float = 0.2,
    ratio_per_s: float = 80.0,
    filters: Sequence[LowPassConfig] = FILTERS,
    friction: bool = True,
) -> tuple[FilterCase, ...]:
    """Find the onset with one filter after another, on one ray at one angle.

    Raises InputError where there is no filter or no onset.
    """
    if not filters:
        raise InputError("filters: none given, nothing to compare")
    onsets = []
    for low_pass in filters:
        changed = msgspec.structs.replace(scenario, filter=low_pass)
        ray = RayLoop(changed, axis, alpha_rad, ratio_per_s)
        predicted = ray.predict().sampled
        found = [_onset(ray, axis, predicted, part, friction=friction) for part in _PARTS]
        onsets.append((predicted, statistics.median(found)))
    first = onsets[0]
    return tuple(
        FilterCase(
            name=_name(low_pass),
            predicted_b=predicted,
            simulated_b=simulated,
            predicted_loss=1.0 - first[0] / predicted,
            simulated_loss=1.0 - first[1] / simulated,
        )
        for low_pass, (predicted, simulated) in zip(filters, onsets, strict=True)
    )


def _onset(ray: RayLoop, axis: SingleAxis, guess: float, part: float, *, friction: bool) -> float:
    """Return the simulated onset b for one size of the disturbance."""

    def grow(asked: Sequence[float]) -> list[bool]:
        runs = oscillate([ray.held(b, part) for b in asked], axis, friction=friction)
        return [run.grows for run in runs]

    return threshold(grow, guess, _STEP).b


def _name(config: LowPassConfig) -> str:
    if isinstance(config, NoFilterConfig):
        return "none"
    size = f"{config.taps} taps" if isinstance(config, FirConfig) else f"order {config.order}"
    return f"{config.kind} {config.cutoff_hz:g} Hz, {size}"


def table(cases: Sequence[FilterCase]) -> Table:
    """Return a table of filters: the onset, and the gain lost against no filter."""
    headings = ("filter", "b predicted", "b simulated", "gain lost, predicted", "simulated")
    rows = [
        (
            *(case.name, case.predicted_b, case.simulated_b),
            *(f"{100 * loss:.1f} %" for loss in (case.predicted_loss, case.simulated_loss)),
        )
        for case in cases
    ]
    return Table([Column(name) for name in headings], rows)
