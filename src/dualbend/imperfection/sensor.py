"""What the wrist sensors tell wrongly, beside noise, bias and rounding."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import msgspec
import numpy as np

from dualbend.control.force_torque import ForceTorqueConfig, Sensor
from dualbend.control.worlds import BLOCK, Draw, drawn
from dualbend.imperfection.draws import ahead, cut_normal, stream
from dualbend.types import Config, Mask, Side, Vector, matvec, said

_HOUR_S = 3600.0

_Force = Annotated[float, said("of every force since the zero [N/h]", ge=-1e3, le=1e3)]
_Torque = Annotated[float, said("of every torque since the zero [N m/h]", ge=-1e3, le=1e3)]
_ForceSpread = Annotated[
    float, said("standard deviation of that rate, by axis and arm [N/h]", ge=0, le=1e3)
]
_TorqueSpread = Annotated[
    float, said("standard deviation of that rate, by axis and arm [N m/h]", ge=0, le=1e3)
]
_ForceWalk = Annotated[
    float, said("random walk of a force: its standard deviation after an hour [N]", ge=0, le=1e3)
]
_TorqueWalk = Annotated[
    float, said("random walk of a torque: its standard deviation after an hour [N m]", ge=0, le=1e3)
]
_Metre = Annotated[float, msgspec.Meta(ge=-1, le=1)]
_Probability = Annotated[float, said("that one begins, per cycle [-]", ge=0, le=1)]


class SensorErrors(Config):
    """What the wrist sensors tell wrongly, and what is believed wrongly of the tools they carry.

    A sensor reads C w + d + s before noise and rounding. C: scale (1 + spread) on its diagonal; a
    load of full scale along one axis reads a drawn part of full scale along each other one. d: rate
    times time since the sensor was zeroed, and a random walk that grows with its root. s: a spike,
    on one axis with either sign for one cycle. After rounding, a drop-out or a stuck sensor tells
    the last reading again. What is drawn is cut at three standard deviations.

    Data sheets of ATI transducers give the measurement uncertainty as 1 to 2 % of full scale at
    95 % confidence; that it is shared between scale and cross-talk as here is assumed.
    """

    force_drift_n_per_h: _Force = 0.0
    torque_drift_nm_per_h: _Torque = 0.0
    force_drift_spread_n_per_h: _ForceSpread = 0.0
    torque_drift_spread_nm_per_h: _TorqueSpread = 0.0
    force_walk_n: _ForceWalk = 0.0
    torque_walk_nm: _TorqueWalk = 0.0
    zeroed_before_s: Annotated[
        float, said("time from the sensors' zero to the start of the run", ge=0, le=1e6)
    ] = 0.0
    scale_ratio: Annotated[float, said("reading over load, every axis", ge=0.1, le=10)] = 1.0
    scale_spread: Annotated[
        float, said("standard deviation of the scale, by axis and arm [-]", ge=0, le=0.3)
    ] = 0.0
    cross_talk_spread: Annotated[
        float,
        said("of full scale per full scale of another axis, standard deviation [-]", ge=0, le=0.3),
    ] = 0.0
    tool_mass_ratio: Annotated[float, said("tool's mass, believed over true", ge=0, le=10)] = 1.0
    tool_mass_spread: Annotated[
        float, said("standard deviation of that ratio, by arm [-]", ge=0, le=0.3)
    ] = 0.0
    tool_centre_error_m: Annotated[
        tuple[_Metre, _Metre, _Metre],
        said("tool's centre of mass, believed less true, in sensor axes"),
    ] = (0.0, 0.0, 0.0)
    tool_centre_spread_m: Annotated[
        float, said("standard deviation of that error, by axis and arm", ge=0, le=1)
    ] = 0.0
    weight_place_spread_m: Annotated[
        float, said("of a calibration's weight in the gripper, by axis and grip", ge=0, le=0.1)
    ] = 0.0
    dropout_probability: _Probability = 0.0
    dropout_cycles: Annotated[int, said("without a reading, each time", ge=1, le=1_000_000)] = 1
    stuck: Annotated[
        tuple[Side, ...], said("arms whose sensor repeats one reading", max_length=2)
    ] = ()
    stuck_from_s: Annotated[float, said("time of the run at which it begins", ge=0, le=3600)] = 0.0
    stuck_for_s: Annotated[float, said("how long it lasts", ge=0, le=3600)] = 3600.0
    spike_probability: _Probability = 0.0
    spike_force_n: Annotated[float, said("size of one on a force", ge=0, le=1e5)] = 0.0
    spike_torque_nm: Annotated[float, said("size of one on a torque", ge=0, le=1e5)] = 0.0

    def believed_tool(
        self, seed: int, side: Side, mass_kg: float, centre_m: Vector
    ) -> tuple[float, Vector]:
        """Return mass [kg] and centre (3,) [m] that are believed of a tool that has these."""
        ratio = self.tool_mass_ratio + cut_normal(
            stream(seed, "sensor", side, "tool mass"), self.tool_mass_spread, ()
        )
        error = self.tool_centre_error_m + cut_normal(
            stream(seed, "sensor", side, "tool centre"), self.tool_centre_spread_m, (3,)
        )
        return mass_kg * max(float(ratio), 0.0), centre_m + error

    def matrix(self, seed: int, side: Side, config: ForceTorqueConfig) -> Vector:
        """Return C (6, 6) of one arm's sensor."""
        full = _pair(*config.full_scale)
        talk = cut_normal(
            stream(seed, "sensor", side, "cross-talk"), self.cross_talk_spread, (6, 6)
        )
        found: Vector = talk * np.divide.outer(full, full)
        scale = cut_normal(stream(seed, "sensor", side, "scale"), self.scale_spread, (6,))
        np.fill_diagonal(found, self.scale_ratio + scale)
        return found

    def drift_per_h(self, seed: int, side: Side) -> Vector:
        """Return the rate (6,) at which one arm's sensor drifts [N/h, N m/h]."""
        spread = _pair(self.force_drift_spread_n_per_h, self.torque_drift_spread_nm_per_h)
        mean = _pair(self.force_drift_n_per_h, self.torque_drift_nm_per_h)
        return mean + spread * cut_normal(stream(seed, "sensor", side, "drift"), 1.0, (6,))

    @property
    def walk(self) -> Vector:
        """Standard deviation (6,) of the random walk after an hour [N, N m]."""
        return _pair(self.force_walk_n, self.torque_walk_nm)


def _pair(force: float, torque: float) -> Vector:
    return np.repeat([force, torque], 3)


class ErringSensor(Sensor):
    """Wrist sensors with their errors; ``arms``: seed and side of each, in C order of ``shape``.

    The noise is that of :class:`Sensor` with the same ``rng``. A reading is taken every
    ``period_s`` [s]. ``repeat``: number of the sheet in a series; walks, spikes and drop-outs are
    each sheet's own.
    """

    def __init__(
        self,
        config: ForceTorqueConfig,
        rng: np.random.Generator | Sequence[np.random.Generator],
        errors: SensorErrors,
        arms: Sequence[tuple[int, Side]],
        shape: tuple[int, ...] = (),
        *,
        period_s: float,
        repeat: int = 0,
    ) -> None:
        super().__init__(config, rng, shape)

        def streams(name: str, repeat: int = 0) -> list[np.random.Generator]:
            return [stream(seed, "sensor", side, name, repeat=repeat) for seed, side in arms]

        self._matrix = np.reshape([errors.matrix(*arm, config) for arm in arms], (*shape, 6, 6))
        rate = np.reshape([errors.drift_per_h(*arm) for arm in arms], (*shape, 6))
        walk = errors.walk + np.zeros_like(rate)
        self._drift_per_cycle = rate * period_s / _HOUR_S
        self._walk_per_cycle = walk * np.sqrt(period_s / _HOUR_S)
        walks, before = streams("walk", repeat), errors.zeroed_before_s / _HOUR_S
        walked = np.reshape([own.standard_normal(6) for own in walks], walk.shape)
        self._drift = rate * before + walk * np.sqrt(before) * walked
        self._walks = [ahead(own.standard_normal, 6, when=bool(walk.any())) for own in walks]
        chance = errors.spike_probability
        self._spikes = [ahead(own.random, 3, when=chance) for own in streams("spike", repeat)]
        self._spike_probability = np.full(shape, chance)
        self._spike = _pair(errors.spike_force_n, errors.spike_torque_nm) + np.zeros_like(rate)
        chance, cycles = errors.dropout_probability, errors.dropout_cycles
        self._dropouts = [
            dropouts(own, chance, cycles) if chance else None for own in streams("drop-out", repeat)
        ]
        stuck = np.reshape([side in errors.stuck for _, side in arms], shape)
        until_s = errors.stuck_from_s + errors.stuck_for_s
        self._stuck_from = np.where(stuck, errors.stuck_from_s / period_s - 1e-6, 0.0)
        self._stuck_until = np.where(stuck, until_s / period_s - 1e-6, 0.0)
        self._last: tuple[Vector, Mask] | None = None

    def read(self, wrench: Vector) -> tuple[Vector, Mask]:
        """Return the readings of wrenches in S [N, N m] and where they are clipped (..., 6)."""
        at = self._readings % BLOCK
        if not at:
            self._draw_distortions()
            self._draw_repeats()
        told = matvec(self._matrix, wrench)
        told += self._drifts[at]
        if self._spiked is not None:
            told += self._spiked[at]
        reading, clipped = super().read(told)
        if self._repeats[at] and self._last is not None:
            for value, last in zip((reading, clipped), self._last, strict=True):
                np.copyto(value, last, where=self._stands[at])
        self._last = reading, clipped
        self.arrived = self._arrivals[at]
        return reading, clipped

    def _draw_distortions(self) -> None:
        shape = self.arrived.shape
        # A reading's drift is the last one's, then the rate, then the walk.
        steps = np.empty((*shape, 6, 2 * BLOCK + 1))
        steps[..., 0], steps[..., 1::2] = self._drift, self._drift_per_cycle[..., np.newaxis]
        walks = self._walk_per_cycle * drawn(self._walks, shape, 6)
        steps[..., 2::2] = np.moveaxis(walks, 0, -1)
        drifts = np.moveaxis(np.add.accumulate(steps, axis=-1)[..., ::2], -1, 0)
        self._drifts: Vector = np.ascontiguousarray(drifts)
        self._drift = self._drifts[-1]
        chance, axis, sign = np.moveaxis(drawn(self._spikes, shape, 3), -1, 0)
        begins = chance < self._spike_probability
        hit = begins[..., np.newaxis] & ((6.0 * axis).astype(int)[..., np.newaxis] == np.arange(6))
        signed = np.where(sign[..., np.newaxis] < 0.5, self._spike, -self._spike)
        self._spiked = np.where(hit, signed, 0.0) if hit.any() else None

    def _draw_repeats(self) -> None:
        """Draw which records do not come, and find which readings are the last one again.

        A stuck sensor goes on sending records. The first reading of a run always arrives.
        """
        shape = self.arrived.shape
        cycles = (self._readings + np.arange(BLOCK)).reshape(-1, *[1] * len(shape))
        missing = drawn(self._dropouts, shape) > 0.0
        if not self._readings:
            missing[0] = False
        stands = missing | ((self._stuck_from <= cycles) & (cycles < self._stuck_until))
        self._arrivals, self._stands = ~missing, stands[..., np.newaxis]
        self._repeats: Mask = np.any(stands.reshape(BLOCK, -1), axis=1)


def dropouts(rng: np.random.Generator, probability: float, cycles: int) -> Draw:
    """Return what tells of the next BLOCK cycles whose record is missing; each draws a number."""
    left = 0

    def draw() -> Mask:
        nonlocal left
        missing, at = np.arange(BLOCK) < left, min(left, BLOCK)
        left -= at
        for first in np.flatnonzero(rng.random(BLOCK) < probability).tolist():
            if first >= at:
                end = first + cycles
                at = min(end, BLOCK)
                missing[first:at], left = True, end - at
        return missing

    return draw
