"""Which readings of the paper make Figs. 6, 8 and 9 come out together: a scan by a cheap model.

Every reading is judged by the compliance's own equilibrium with the sheet (the rod model, arms in
series) at three angles in each piece, and by the eigenvalues of the sampled loop. Some are then run
as full simulations by `icra1995.confirm`.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator

import msgspec
import numpy as np

from dualbend.beam.rod.tangent import solve_grips
from dualbend.errors import InputError
from dualbend.scenario.scenario import Scenario
from dualbend.stability.mode import Mode
from dualbend.stability.plant.environment import Environment, environments
from dualbend.stability.sampled import LoopElements, SampledLoop
from dualbend.types import Vector
from icra1995.reading import Reading, readings
from icra1995.row import PAPER

B_FACTORS = (0.5, 0.25, 0.1, 0.05, 0.02)
"""By which B is reduced for Fig. 9, one after the other."""

CLEARLY, HALF = 0.8, 0.5
"""Bounds on the mean ratio of peaks for Fig. 8, and on exact over linear path for Fig. 6."""
READABLE_NM = 0.009
"""Three counts of the torque sensor: the smallest first peak that Fig. 6 could show."""

_LOOKED_AT = (0.25, 0.3, 0.4, 0.6, 0.8, 1.0)


class ScanRow(msgspec.Struct, frozen=True, kw_only=True):
    """What the cheap model finds of a reading.

    ``peak_nm``: first peak of Fig. 6; ``exact_ratio``: the exact path's largest moment over it;
    ``worst_ratio``, ``mean_ratio``: peaks of Fig. 8 over those of Fig. 6 in the pieces where the
    compliance acts, NaN without a state of rest; ``growth_per_s``: the fastest growth of Fig. 8's
    loop; ``b_factor``: the first factor on B at which the loop oscillates, 0 where none does, at
    ``frequency_hz``.
    """

    reading: Reading
    peak_nm: float
    exact_ratio: float
    worst_ratio: float
    mean_ratio: float
    growth_per_s: float
    b_factor: float
    frequency_hz: float

    @property
    def fig6(self) -> bool:
        """Peaks between the knots that a sensor can read and that the exact path lacks."""
        return self.peak_nm > READABLE_NM and self.exact_ratio < HALF

    @property
    def fig8(self) -> bool:
        """A stable loop that lowers every piece's moment, and clearly in the mean."""
        return self.growth_per_s < 0.0 and self.worst_ratio < 1.0 and self.mean_ratio < CLEARLY

    @property
    def fig9(self) -> bool:
        """A stable loop that a smaller B makes oscillate."""
        return self.growth_per_s < 0.0 and self.b_factor > 0.0

    @property
    def together(self) -> bool:
        """All three figures."""
        return self.fig6 and self.fig8 and self.fig9


def judge(reading: Reading) -> ScanRow:
    """Judge one reading by the cheap model."""
    # The equilibrium depends on nothing that only the loop has.
    still = msgspec.structs.replace(reading, robot="2Hz/0.995", delay=0, low_pass="fir2")
    linear, exact = _plain(reading.sheet, exact=False), _plain(reading.sheet, exact=True)
    peak = float(np.abs(linear).max(initial=0.0))
    ratios = _ratios(still)
    mode = _worst_mode(reading, still, 1.0)
    factor, frequency = 0.0, 0.0
    if mode.stable:
        for tried in B_FACTORS:
            found = _worst_mode(reading, still, tried)
            if not found.stable and found.frequency_hz > 0.5:
                factor, frequency = tried, found.frequency_hz
                break
    return ScanRow(
        reading=reading,
        peak_nm=peak,
        exact_ratio=float(np.abs(exact).max()) / peak,
        worst_ratio=float(ratios.max()),
        mean_ratio=float(ratios.mean()),
        growth_per_s=mode.growth_per_s,
        b_factor=factor,
        frequency_hz=frequency,
    )


def scan(
    chosen: Iterator[Reading] | None = None, on_row: Callable[[ScanRow], None] | None = None
) -> list[ScanRow]:
    """Judge readings (all by default), calling ``on_row`` with each result."""
    rows = []
    for reading in chosen or readings():
        rows.append(judge(reading))
        if on_row is not None:
            on_row(rows[-1])
    return rows


def piece_angles(start_rad: float) -> Vector:
    """Return three angles inside each 0.2 rad piece from a start to 1 rad (pieces, 3)."""
    knots = np.arange(start_rad, 1.0 - 1e-9, PAPER.interval_rad)
    return np.asarray(knots[:, np.newaxis] + np.array([0.05, 0.1, 0.15]))


def moments(scenario: Scenario, alphas_rad: Vector) -> Vector:
    """Return the moment [N m] at the left grip at rest, NaN where there is no state of rest."""
    sheet = scenario.sheet.sheet()
    path = scenario.path.make(sheet.length_m)
    limits = scenario.compliance.limit_x_m, scenario.compliance.limit_rotation_rad
    found = []
    for at in environments(scenario, alphas_rad.tolist()):
        nominal = np.array([-path.at(at.alpha_rad)[0], 0.0, at.alpha_rad] * 2)
        inside = abs(at.moved[0]) <= limits[0] and abs(at.moved[2]) <= limits[1]
        state = solve_grips(sheet, nominal + at.moved) if at.settled and inside else None
        found.append(state.end_moment_nm if state and state.converged else math.nan)
    return np.array(found)


@functools.lru_cache(maxsize=64)
def _plain(sheet: str, *, exact: bool) -> Vector:
    reading = next(r for r in readings() if r.sheet == sheet)
    alphas = piece_angles(0.0)
    if exact:
        # The flat sheet's weight makes a moment that no path removes.
        return moments(reading.without_compliance(exact=True), np.append(0.0, alphas))
    return moments(reading.without_compliance(), alphas.ravel()).reshape(alphas.shape)


@functools.lru_cache(maxsize=256)
def _ratios(still: Reading) -> Vector:
    """Return the peaks of Fig. 8 over those of Fig. 6 by piece; NaN where none was found."""
    alphas = piece_angles(still.start_rad)
    before = np.abs(_plain(still.sheet, exact=False))[-len(alphas) :].max(axis=1)
    try:
        after = moments(still.scenario(), alphas.ravel())
    except InputError:
        return np.full(len(alphas), math.nan)
    return np.asarray(np.abs(after).reshape(alphas.shape).max(axis=1) / before)


@functools.lru_cache(maxsize=32)
def _felt(still: Reading, b_factor: float) -> list[Environment]:
    start = [still.start_rad, still.start_rad + 0.1] if still.start_rad < 0.2 else [0.2]
    return environments(still.scenario(b_factor), [*start, *_LOOKED_AT])


def _worst_mode(reading: Reading, still: Reading, b_factor: float) -> Mode:
    """Return the mode that grows fastest at the angles looked at."""
    parts = LoopElements.from_scenario(reading.scenario(b_factor))
    modes = [
        SampledLoop(parts, at.loops["single"], (True, True), at.inertia).mode()
        for at in _felt(still, b_factor)
    ]
    return max(modes, key=lambda mode: mode.growth_per_s)
