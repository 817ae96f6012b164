"""Iterative learning: a correction of the bending angle over time, learned from sheet to sheet.

After sheet j, whose arms read the moments M_j [N m] under the corrections u_j [rad] while their
feedback turned them by q_j [rad],

    u_{j+1} = Q [u_j + γ z^m (G M_j + q_j)],

G the inverse of the rotational stiffness from correction to reading, z^m the lead that makes up for
the loop's delay, Q a low-pass without phase: what feedback did comes before it has to the next
time. With M_j = d − P u_j and q_j = r − D u_j what is not yet learned shrinks by |Q (1 − L P)|,
L P = γ z^m (G P + D), from sheet to sheet at each frequency. It is time that repeats, not
the angle: arms, sheet and loop are as late at one speed as at another. Source: Bristow, Tharayil
and Alleyne, A survey of iterative learning control, IEEE Control Systems Magazine 26(3), 2006,
equation (4), and its stability in the frequency domain.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from scipy import signal

from dualbend.control.clock import ComplexVector
from dualbend.control.controller import Controller, Observation
from dualbend.errors import InputError
from dualbend.types import Config, Mask, Vector, said

ORDER = 2
"""Of the Butterworth filter that runs forwards and backwards."""

_FULL_SHEETS = 3
"""That teach with the whole gain, whatever is averaged: what repeats is learned by then."""

_Speed = Annotated[float, said("of the bending angle [rad/s]", gt=0, le=5)]


class LearningConfig(Config):
    """How ``dualbend learn`` corrects the bending angle of each arm from sheet to sheet.

    A sheet whose force along x in the hold differs from the learned ones' by more than the part
    ``changed`` is another sheet: it is corrected as the others are, and nothing is learned from it.
    """

    gain: Annotated[
        float, said("share of a moment's cause that one sheet corrects [-]", gt=0, le=10)
    ] = 0.85
    averaged_sheets: Annotated[
        int,
        said(
            "to which what differs is averaged: from the fourth sheet on the gain falls to a half, "
            "a third, down to this part of it",
            ge=1,
            le=1000,
        ),
    ] = 1
    cutoff_hz: Annotated[
        float, said("frequency up to which is learned, half of it there", ge=0.1, le=1e3)
    ] = 3.0
    lead_cycles: (
        Annotated[
            int, said("of the loop's delay; none: the one with the least contraction", ge=0, le=100)
        ]
        | None
    ) = None
    limit_rad: Annotated[float, said("largest correction [rad]", gt=0, le=0.5)] = 0.1
    changed: Annotated[float, said("change of the hold's force [-]", gt=0, le=1)] = 0.1
    speeds_rad_per_s: Annotated[
        tuple[_Speed, ...],
        said("of the first sheets, on the way up to that of the motion", max_length=100),
    ] = ()


class LearningLaw:
    """From correction and moment (..., arms, cycles) of a sheet to the correction of the next one.

    ``compliance`` (arms, arms): G, turn per moment at rest [rad/(N m)]. ``ramp_cycles``: cycles in
    which a correction comes in at the start; at the first cycle it is 0.
    """

    def __init__(
        self,
        config: LearningConfig,
        compliance: Vector,
        lead_cycles: int,
        *,
        period_s: float,
        ramp_cycles: int = 0,
    ) -> None:
        self.config, self.lead_cycles = config, lead_cycles
        self.gain = config.gain * compliance
        self.period_s, self._ramp_cycles = period_s, ramp_cycles
        self._sections = signal.butter(ORDER, config.cutoff_hz, fs=1.0 / period_s, output="sos")

    def update(
        self,
        correction: Vector,
        moment: Vector,
        deviation: Vector | float = 0.0,
        *,
        sheets: int = 1,
    ) -> Vector:
        """Return the correction (..., arms, cycles) [rad] of the next sheet, within its bound.

        ``deviation`` (..., arms, cycles): by how much feedback turned the arms besides [rad];
        ``sheets``: how many have taught, this one included. A smaller gain contracts, too:
        |1 − γ x| is convex in γ.

        Raises InputError where a value is not finite, or the run is too short to be filtered.
        """
        if not all(np.isfinite(each).all() for each in (correction, moment, deviation)):
            raise InputError("learning: a reading that is no number teaches nothing")
        later = np.minimum(
            np.arange(moment.shape[-1]) + self.lead_cycles, max(moment.shape[-1] - 1, 0)
        )
        wrong = self.gain @ moment + self.config.gain * np.asarray(deviation)
        share = 1.0 / np.clip(sheets - _FULL_SHEETS + 1, 1, self.config.averaged_sheets)
        learned = self.filtered(correction + share * wrong[..., later])
        limit = self.config.limit_rad
        return np.clip(learned, -limit, limit) * self._ramp(learned.shape[-1])

    def filtered(self, values: Vector) -> Vector:
        """Return Q of series (..., cycles): the low-pass forwards and backwards, without phase."""
        try:
            return np.asarray(signal.sosfiltfilt(self._sections, values, axis=-1))
        except ValueError as error:
            raise InputError(
                f"learning: a run of {values.shape[-1]} cycles is too short to be filtered"
            ) from error

    def low_pass(self, z_inverse: ComplexVector) -> Vector:
        """Return Q (n,) where z⁻¹ (n,) is given on the unit circle: real, 1/2 at the cutoff."""
        _, response = signal.sosfreqz(self._sections, worN=-np.angle(z_inverse))
        return np.asarray(np.abs(response) ** 2)

    def contraction(
        self, z_inverse: ComplexVector, plant: ComplexVector, deviation: ComplexVector | float = 0.0
    ) -> Vector:
        """Return |Q (1 − L P)| (n,), the largest singular value.

        ``plant`` P and ``deviation`` D (n, arms, arms): what moment and feedback's turn lose per
        correction.
        """
        later = z_inverse[:, np.newaxis, np.newaxis] ** -self.lead_cycles
        wrong = self.gain @ plant + self.config.gain * np.asarray(deviation)
        left = np.eye(len(self.gain)) - later * wrong
        return np.asarray(self.low_pass(z_inverse) * np.linalg.norm(left, 2, axis=(1, 2)))

    def _ramp(self, cycles: int) -> Vector:
        """Return (1 − cos πτ)/2 over the ramp and 1 after it (cycles,)."""
        tau = np.minimum(np.arange(cycles) / max(self._ramp_cycles, 1), 1.0)
        return np.asarray(0.5 * (1.0 - np.cos(np.pi * tau)))


class CorrectedController:
    """A controller with a learned correction (arms, cycles) [rad] added to its deviation.

    The correction belongs to a cycle of the motion; after its end the last one stays.
    """

    def __init__(self, controller: Controller, correction: Vector, *, period_s: float) -> None:
        self.controller, self._correction = controller, correction
        self._period_s = period_s

    @classmethod
    def stacked(
        cls, many: Sequence[CorrectedController], controller: Controller
    ) -> CorrectedController:
        """Return that of many worlds, which their controllers in one go before."""
        longest = max(one._correction.shape[-1] for one in many)
        rows = [_lengthened(one._correction, longest) for one in many]
        return cls(controller, np.stack(rows), period_s=many[0]._period_s)

    def __call__(self, observation: Observation) -> Vector:
        """Return the deviation (..., 2, 6) with the correction in pitch."""
        cycle = min(round(observation.time_s / self._period_s), self._correction.shape[-1] - 1)
        deviation = np.array(self.controller(observation))
        deviation[..., 4] += self._correction[..., cycle]
        return deviation

    @property
    def saturated(self) -> Mask:
        """What the controller says of its own bounds."""
        never = np.zeros(1, dtype=np.bool_)
        return np.asarray(getattr(self.controller, "saturated", never))


def _lengthened(correction: Vector, cycles: int) -> Vector:
    more = cycles - correction.shape[-1]
    return np.pad(correction, ((0, 0), (0, more)), mode="edge")


def replayed(
    correction: Vector, learned_rad: Vector, asked_rad: Vector, *, lag_cycles: int = 0
) -> Vector:
    """Return a correction (arms, cycles) for another speed, at the same angles.

    ``learned_rad`` and ``asked_rad``: nominal angle over the cycles of the motion that it was
    learned on, and of the other one, both growing. ``lag_cycles``: by how many cycles the
    correction acts later than it is commanded, at either speed.
    """
    cycles = np.arange(asked_rad.size)
    angle = np.interp(cycles + lag_cycles, cycles, asked_rad)
    first = int(np.argmax(learned_rad > learned_rad[0])) - 1
    last = int(np.argmax(learned_rad == learned_rad[-1]))
    bend = slice(max(first, 0), last + 1)
    at = np.interp(angle, learned_rad[bend], np.arange(learned_rad.size)[bend]) - lag_cycles
    # Before the bending and after it, time since its start and its end goes on alike.
    own_first = int(np.argmax(asked_rad > asked_rad[0])) - 1
    own_last = int(np.argmax(asked_rad == asked_rad[-1]))
    before, after = cycles <= own_first - lag_cycles, cycles >= own_last - lag_cycles
    at = np.where(before, cycles - own_first + first, at)
    at = np.where(after, cycles - own_last + last, at)
    index = np.arange(correction.shape[-1])
    return np.array([np.interp(at, index, row) for row in correction])
