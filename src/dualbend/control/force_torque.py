"""From the true wrench at the wrist sensor to the wrench at the grip centre.

Sign: every wrench is the one that tool and sheet exert on the arm. Frames: S of the sensor, G of
the grip (origin at the gripper centre, x_G into the sheet), W of the world. Everything works on one
sensor, (), and on any leading shape of them alike.
"""

import math
from collections.abc import Sequence
from functools import partial
from typing import Annotated

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from dualbend.control.filters import LowPass
from dualbend.control.worlds import BLOCK, Stackable, drawn
from dualbend.errors import InputError
from dualbend.types import Config, Mask, Vector, Wrench, matvec, said

_AXES = 6

_Noise = said("standard deviation per axis and sample; 0: none", ge=0, le=1e4)
_Count = said("one count; 0: not rounded", ge=0, le=1e4)
_Range = said("full scale ± per axis", gt=0, le=1e5)
_Error = Annotated[float, msgspec.Meta(ge=-1e4, le=1e4)]
_Bias = said("constant error along x, y, z of the sensor")


class CalibrationConfig(Config):
    """Each wrist sensor is calibrated in the cell with a known weight, once for all sheets.

    The arm turns its last three joints to some attitudes and reads there, with the empty gripper
    and with the weight, each time that it grips it anew. The weight lies in the gripper with its
    centre at the grip's. That the arms have room for it is not looked at.
    """

    weight_kg: Annotated[
        float, said("what is held for it; 0: nothing, the tool's own weight alone", ge=0, le=100)
    ] = 1.5
    attitudes: Annotated[int, said("in which is read", ge=3, le=200)] = 12
    grips: Annotated[int, said("times that the weight is gripped", ge=1, le=50)] = 8
    readings: Annotated[int, said("averaged in each attitude", ge=1, le=1000)] = 36


class ForceTorqueConfig(Config):
    """Errors, limits and place of the wrist sensor.

    The defaults are a transducer of the ATI Gamma SI-65-5 class (20 counts/N, 333.33 counts per
    N m) with noise of one count rms; the noise figure is an assumption, no source gives it.
    One rounding step leaves up to half a count per axis: 0.025 N, and at the grip centre
    0.0015 N m + 0.12 m × 0.025 N = 0.0045 N m. Only averaging noisy samples goes below that.

    Raises
    ------
    ValueError
        A range that is not larger than its resolution.
    """

    force_noise_n: Annotated[float, _Noise] = 0.05
    torque_noise_nm: Annotated[float, _Noise] = 0.003
    force_bias_n: Annotated[tuple[_Error, _Error, _Error], _Bias] = (0.0, 0.0, 0.0)
    torque_bias_nm: Annotated[tuple[_Error, _Error, _Error], _Bias] = (0.0, 0.0, 0.0)
    force_range_n: Annotated[float, _Range] = 65.0
    torque_range_nm: Annotated[float, _Range] = 5.0
    force_resolution_n: Annotated[float, _Count] = 0.05
    torque_resolution_nm: Annotated[float, _Count] = 0.003
    latency_ms: Annotated[float, said("sensor latency (serial record) [ms]", ge=0, le=1000)] = 0.0
    sampling_ms: (
        Annotated[
            float,
            said(
                "between two samples, by its own clock; none: one a command",
                gt=0,
                le=1000,
            ),
        ]
        | None
    ) = None
    lever_arm_m: Annotated[
        float, said("sensor to grip centre as the controller believes it [m]", ge=0, le=1)
    ] = 0.12
    calibration: CalibrationConfig | None = None

    def __post_init__(self) -> None:
        for name, limit, count in (
            ("force_range_n", self.force_range_n, self.force_resolution_n),
            ("torque_range_nm", self.torque_range_nm, self.torque_resolution_nm),
        ):
            if not limit > count:
                raise ValueError(f"{name} = {limit!r}: must be larger than the resolution, {count}")

    @property
    def full_scale(self) -> tuple[float, float]:
        """Largest reading of a force [N] and of a torque [N m]: the range in whole counts."""
        return (
            _whole_counts(self.force_range_n, self.force_resolution_n),
            _whole_counts(self.torque_range_nm, self.torque_resolution_nm),
        )

    @property
    def may_repeat(self) -> bool:
        """Two readings in a row may be equal on all axes: no noise is as large as a count."""
        channels = (
            (self.force_noise_n, self.force_resolution_n),
            (self.torque_noise_nm, self.torque_resolution_nm),
        )
        return not any(noise > 0.0 and noise >= count for noise, count in channels)

    def latency_steps(self, step_s: float) -> int:
        """Return the latency in whole physics steps of `step_s` [s]: the nearest, halves up.

        What is realised differs from `latency_ms` by at most half a step, but the youngest sample
        that the simulation has is one step old.
        """
        return math.floor(self.latency_ms * 1e-3 / step_s + 0.5)

    def sampling_steps(self, step_s: float) -> int | None:
        """Return the time between two samples in whole physics steps, the nearest, at least one."""
        if self.sampling_ms is None:
            return None
        return max(math.floor(self.sampling_ms * 1e-3 / step_s + 0.5), 1)

    def reading_period_s(self, period_s: float) -> float:
        """Return the mean time between two new readings with commands every ``period_s`` [s]."""
        return period_s if self.sampling_ms is None else max(period_s, 1e-3 * self.sampling_ms)

    def reading_cycles(self, period_s: float) -> int:
        """Return the commands from a new reading to the next one, at most."""
        return math.ceil(self.reading_period_s(period_s) / period_s - 1e-9)


def _whole_counts(full_range: float, count: float) -> float:
    return math.floor(full_range / count + 1e-9) * count if count else full_range


class Sensor(Stackable):
    """Read a true wrench in S: add bias and white noise, clip to the range, round to counts.

    ``rng`` is the source of the noise; with a
    leading shape one for each sensor, in C order: its noise does not depend on the others'. It is
    drawn ahead, and not from where both noises are 0. ``arrived`` (...): of the last reading, that
    its record came; here it always does.

    Raises
    ------
    InputError
        There are not as many sources of noise as sensors.
    """

    def __init__(
        self,
        config: ForceTorqueConfig,
        rng: np.random.Generator | Sequence[np.random.Generator],
        shape: tuple[int, ...] = (),
    ) -> None:
        streams = [rng] if isinstance(rng, np.random.Generator) else rng
        if len(streams) != math.prod(shape):
            raise InputError(
                f"rng: {len(streams)} sources of noise for sensors of the leading shape {shape}: "
                f"need {math.prod(shape)}, one for each"
            )
        self.arrived: Mask = np.ones(shape, dtype=np.bool_)
        self.may_repeat: Mask = np.full(shape, config.may_repeat)
        self.lever_arm_m = np.full(shape, config.lever_arm_m)
        whole = (*shape, 6)
        self._bias = np.broadcast_to([*config.force_bias_n, *config.torque_bias_nm], whole).copy()
        self._scale = _each((config.force_noise_n, config.torque_noise_nm), whole)
        noisy = self._scale.any()
        self._noises = [
            partial(stream.standard_normal, (BLOCK, 6)) if noisy else None for stream in streams
        ]
        counts = (config.force_resolution_n, config.torque_resolution_nm)
        self._highest = _each(config.full_scale, whole)
        self._lowest = -self._highest
        # Channels that have counts: all, the forces, the torques or none.
        self._rounded = slice(0 if counts[0] else 3, 6 if counts[1] else 3)
        self._count = _each(counts, whole)[..., self._rounded]
        self._readings = 0

    def read(self, wrench: Vector) -> tuple[Vector, Mask]:
        """Return the reading of a true wrench in S [N, N m] and where it is clipped (..., 6)."""
        at = self._readings % BLOCK
        if not at:
            self._noise = self._scale * drawn(self._noises, self._scale.shape[:-1], 6)
        self._readings += 1
        wrench = wrench + self._bias
        wrench += self._noise[at]
        reading = np.maximum(wrench, self._lowest)
        np.minimum(reading, self._highest, out=reading)
        clipped = reading != wrench
        part = reading[..., self._rounded]
        np.rint(part / self._count, out=part)
        part *= self._count
        return reading, clipped


def _each(pair: Sequence[float], shape: tuple[int, ...]) -> Vector:
    """Return one number for the forces and one for the torques as an array (..., 6).

    Of a reading's own shape: that is cheaper, every cycle, than to broadcast.
    """
    return np.broadcast_to(np.repeat(pair, 3), shape).copy()


class ToolGravityCompensation(Stackable):
    """Know the weight of what is bolted to the sensor: F = m g R_WSᵀ (0, 0, −1), M = c × F.

    The sheet is not part of it: its weight is a load, and a clamped flat sheet has a moment of
    q L²/12 that a tare on the held sheet would wrongly hide. Masses m (...) and their centres c
    (..., 3) in S.
    """

    def __init__(
        self, mass_kg: ArrayLike, com_sensor_m: ArrayLike, gravity_m_s2: float = 9.81
    ) -> None:
        down = np.multiply.outer(-np.asarray(mass_kg) * gravity_m_s2, np.eye(3))
        moment = np.cross(np.asarray(com_sensor_m)[..., np.newaxis, :], down)
        weights = Wrench.of(down, moment, "sensor", "sensor").components
        self._weight_per_vertical = np.swapaxes(weights, -1, -2).copy()

    def wrench(self, rotation_world_sensor: Vector) -> Vector:
        """Return the tools' weight (..., 6) [N, N m] in S, from R_WS (..., 3, 3)."""
        # The last row of R_WS is the upward vertical in sensor axes.
        return matvec(self._weight_per_vertical, rotation_world_sensor[..., 2, :])


class WrenchReading(msgspec.Struct, frozen=True, kw_only=True):
    """One cycle's readings of wrist sensors, of any leading shape.

    ``sensor`` (..., 6): as read, about the sensor's origin, in S. ``grips`` (2, ..., 6): without
    the tool's weight, about the grip centre, in G, before and after the low-pass. ``clipped``
    (..., 6): axes at the end of the sensor's range. ``fresh`` (...): a new reading, not the last
    one again.
    """

    sensor: Wrench
    grips: Wrench
    clipped: Mask
    fresh: Mask

    @property
    def raw(self) -> Wrench:
        """Wrench (..., 6) at the grip centre, in G, before the low-pass."""
        return self.grips.part(0)

    @property
    def filtered(self) -> Wrench:
        """Wrench (..., 6) at the grip centre, in G, after the low-pass."""
        return self.grips.part(1)


class WrenchChain(Stackable):
    """Sensor, tool compensation, move to the grip centre and low-pass.

    F_G = R_GS (F_S − F_tool), M_G = R_GS (M_S − M_tool − r × (F_S − F_tool)), with r the lever arm
    along x_G and R_GS (3, 3) from S to G. The elements are of one leading shape; the low-pass has
    six channels and takes the first reading as its steady state. Where there is no new sample the
    last reading stands. A reading is fresh that is of a new sample, arrived and, of a sensor with a
    count of noise, is not equal to the last one on all axes. ``matrix`` (..., 6, 6) makes the
    wrench of a reading that a calibration found; None: it is the reading.

    Raises
    ------
    InputError
        A matrix that is no rotation.
    """

    def __init__(
        self,
        sensor: Sensor,
        tool: ToolGravityCompensation,
        low_pass: LowPass,
        rotation_grip_sensor: ArrayLike,
        matrix: ArrayLike | None = None,
    ) -> None:
        rotation = np.asarray(rotation_grip_sensor, dtype=np.float64)
        if (
            rotation.shape != (3, 3)
            or not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)
            or np.linalg.det(rotation) < 0.0
        ):
            raise InputError(f"rotation_grip_sensor: need a (3, 3) rotation, got {rotation!r}")
        self.sensor, self.tool, self.low_pass = sensor, tool, low_pass
        self._matrix = None if matrix is None else np.asarray(matrix)
        lever = np.multiply.outer(sensor.lever_arm_m, np.eye(1, 3))
        axes = np.broadcast_to(np.eye(6), (*sensor.lever_arm_m.shape, 6, 6))
        units = Wrench(axes, "sensor", "sensor").turned(rotation, "grip").moved(lever, "grip")
        self._to_grip = units.components.mT.copy()
        self._primed = False
        self._last = np.full(self._to_grip.shape[:-1], np.nan)
        self._clipped: Mask = np.zeros(self._last.shape, dtype=np.bool_)
        self._never: Mask = np.zeros(self._last.shape[:-1], dtype=np.bool_)

    def update(
        self, wrench: Vector, rotation_world_sensor: Vector, *, new: bool = True
    ) -> WrenchReading:
        """Process the true force [N] and torque [N m] (..., 6) in S, with R_WS (..., 3, 3).

        ``new``: it is another sample than the last one.
        """
        reading, clipped = self.sensor.read(wrench) if new else (self._last, self._clipped)
        fresh = self._fresh(reading) if new else self._never
        self._last, self._clipped = reading, clipped
        grips = np.empty((2, *reading.shape))
        told = reading if self._matrix is None else matvec(self._matrix, reading)
        grips[0] = matvec(self._to_grip, told - self.tool.wrench(rotation_world_sensor))
        if not self._primed:
            self.low_pass.reset(grips[0])
            self._primed = True
        grips[1] = self.low_pass.update(grips[0])
        return WrenchReading(
            sensor=Wrench(reading, "sensor", "sensor"),
            grips=Wrench(grips, "grip", "grip"),
            clipped=clipped,
            fresh=fresh,
        )

    def _fresh(self, reading: Vector) -> Mask:
        """Tell which readings of new samples (...) are new ones."""
        same = reading == self._last
        if np.count_nonzero(same) < _AXES:
            return self.sensor.arrived
        changed: Mask = ~same.all(axis=-1) | self.sensor.may_repeat
        return self.sensor.arrived & changed
