"""From the true wrench at the wrist sensor to the wrench at the grip centre.

Sign: every wrench is the one that tool and sheet exert on the arm. Frames: S of the sensor, G of
the grip (origin at the gripper centre, x_G into the sheet), W of the world.
"""

import math
from typing import Annotated

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from dualbend.control.clock import TransferFunction
from dualbend.control.filters import LowPass
from dualbend.errors import InputError
from dualbend.types import Vector

_Noise = msgspec.Meta(ge=0, description="standard deviation per axis and sample; 0: none")
_Count = msgspec.Meta(ge=0, description="one count; 0: not rounded")
_Range = msgspec.Meta(gt=0, description="full scale ± per axis")
_Bias = msgspec.Meta(description="constant error along x, y, z of the sensor")


class ForceTorqueConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
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
    force_bias_n: Annotated[tuple[float, float, float], _Bias] = (0.0, 0.0, 0.0)
    torque_bias_nm: Annotated[tuple[float, float, float], _Bias] = (0.0, 0.0, 0.0)
    force_range_n: Annotated[float, _Range] = 65.0
    torque_range_nm: Annotated[float, _Range] = 5.0
    force_resolution_n: Annotated[float, _Count] = 0.05
    torque_resolution_nm: Annotated[float, _Count] = 0.003
    latency_ms: Annotated[
        float, msgspec.Meta(ge=0, le=1000, description="age of a reading (serial record) [ms]")
    ] = 0.0
    lever_arm_m: Annotated[
        float,
        msgspec.Meta(ge=0, description="sensor to grip centre as the controller believes it [m]"),
    ] = 0.12

    def __post_init__(self) -> None:
        for name, limit, count in (
            ("force_range_n", self.force_range_n, self.force_resolution_n),
            ("torque_range_nm", self.torque_range_nm, self.torque_resolution_nm),
        ):
            if not limit > count:
                raise ValueError(f"{name} = {limit!r}: must be larger than the resolution, {count}")

    def latency_steps(self, step_s: float) -> int:
        """Return the latency in whole physics steps of `step_s` [s]: the nearest, halves up.

        What is realised differs from `latency_ms` by at most half a step, but the youngest sample
        that the simulation has is one step old.
        """
        return math.floor(self.latency_ms * 1e-3 / step_s + 0.5)


def skew(vector: ArrayLike) -> Vector:
    """Return the matrix (3, 3) of the cross product: skew(r) F = r × F."""
    x, y, z = np.asarray(vector, dtype=np.float64)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def move_moment(force: Vector, torque: Vector, lever: Vector) -> Vector:
    """Move a moment from the sensor to the grip centre: M_grip = M_sensor − r × F (Fig. 7).

    Parameters
    ----------
    force, torque
        Force (3,) [N] and moment about the sensor's origin (3,) [N m], in one frame.
    lever
        r (3,) [m]: from the sensor's origin to the grip centre, in the same frame.

    Returns
    -------
    Vector
        Moment about the grip centre (3,) [N m].
    """
    return torque - skew(lever) @ force


class SensorReading(msgspec.Struct, frozen=True, kw_only=True):
    """Force [N] and torque [N m] about the sensor's origin, in S; `saturated` if any axis is."""

    force_sensor_n: Vector
    torque_sensor_nm: Vector
    saturated: bool


class Sensor:
    """Read a true wrench in S: add bias and white noise, clip to the range, round to counts.

    Parameters
    ----------
    config
        Errors and limits. Full scale is the range rounded down to whole counts.
    rng
        Source of the noise; not drawn from when both noises are 0.
    """

    def __init__(self, config: ForceTorqueConfig, rng: np.random.Generator) -> None:
        self.config = config
        self._rng = rng
        self._bias = np.array([*config.force_bias_n, *config.torque_bias_nm])
        self._noise = np.repeat([config.force_noise_n, config.torque_noise_nm], 3)
        self._noisy = bool(self._noise.any())
        counts = (config.force_resolution_n, config.torque_resolution_nm)
        ranges = (config.force_range_n, config.torque_range_nm)
        full = [
            math.floor(r / c + 1e-9) * c if c else r for r, c in zip(ranges, counts, strict=True)
        ]
        self._highest = np.repeat(full, 3)
        self._lowest = -self._highest
        # Channels that have counts: all, the forces, the torques or none.
        self._rounded = slice(0 if counts[0] else 3, 6 if counts[1] else 3)
        self._count = np.repeat(counts, 3)[self._rounded]

    def read(self, force: Vector, torque: Vector) -> SensorReading:
        """Return the reading of a true force (3,) [N] and torque (3,) [N m], both in S."""
        wrench, saturated = self.measure(force, torque)
        return SensorReading(
            force_sensor_n=wrench[:3], torque_sensor_nm=wrench[3:], saturated=saturated
        )

    def measure(self, force: Vector, torque: Vector) -> tuple[Vector, bool]:
        """Return the reading (6,) [N, N m] of a true wrench in S, and whether it was clipped."""
        wrench = np.concatenate((force, torque))
        wrench += self._bias
        if self._noisy:
            wrench += self._noise * self._rng.standard_normal(6)
        clipped = np.minimum(np.maximum(wrench, self._lowest), self._highest)
        # Six floats compare faster as lists than as arrays.
        saturated = clipped.tolist() != wrench.tolist()
        part = clipped[self._rounded]
        np.rint(part / self._count, out=part)
        part *= self._count
        return clipped, saturated


class ToolGravityCompensation:
    """Know the weight of what is bolted to the sensor: F = m g R_WSᵀ (0, 0, −1), M = c × F.

    The sheet is not part of it: its weight is a load, and a clamped flat sheet has a moment of
    q L²/12 that a tare on the held sheet would wrongly hide.

    Parameters
    ----------
    mass_kg
        Mass m of the tool [kg].
    com_sensor_m
        Centre of mass c (3,) in S [m].
    gravity_m_s2
        g [m/s²].
    """

    def __init__(self, mass_kg: float, com_sensor_m: ArrayLike, gravity_m_s2: float = 9.81) -> None:
        weight = mass_kg * gravity_m_s2
        self._weight_per_vertical = -weight * np.vstack([np.eye(3), skew(com_sensor_m)])

    def wrench(self, rotation_world_sensor: Vector) -> Vector:
        """Return the tool's weight (6,) in S, force [N] then torque [N m], from R_WS (3, 3)."""
        # The last row of R_WS is the upward vertical in sensor axes.
        weight: Vector = self._weight_per_vertical @ rotation_world_sensor[2]
        return weight

    def compensate(
        self, force: Vector, torque: Vector, rotation_world_sensor: Vector
    ) -> tuple[Vector, Vector]:
        """Return force (3,) [N] and torque (3,) [N m] in S without the tool's weight."""
        weight = self.wrench(rotation_world_sensor)
        return force - weight[:3], torque - weight[3:]


class WrenchSample(msgspec.Struct, frozen=True, kw_only=True):
    """One cycle of a wrench chain; forces (3,) [N], torques (3,) [N m].

    `*_sensor_*`: as read, about the sensor's origin, in S. `*_grip_*`: without the tool's weight,
    about the grip centre, in G. `filtered_*`: the same after the low-pass.
    """

    force_sensor_n: Vector
    torque_sensor_nm: Vector
    force_grip_n: Vector
    torque_grip_nm: Vector
    filtered_force_grip_n: Vector
    filtered_torque_grip_nm: Vector
    saturated: bool


class WrenchChain:
    """Sensor, tool compensation, move to the grip centre and low-pass, of one arm.

    F_G = R_GS (F_S − F_tool), M_G = R_GS (M_S − M_tool − r × (F_S − F_tool)), with r the lever arm
    along the approach axis.

    Parameters
    ----------
    sensor, tool, low_pass
        The elements; the low-pass has six channels.
    rotation_grip_sensor
        R_GS (3, 3): takes components in S to components in G.
    approach_axis_grip
        Unit vector (3,) in G from the sensor to the grip centre; x_G by default.

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
        approach_axis_grip: ArrayLike = (1.0, 0.0, 0.0),
    ) -> None:
        rotation = np.asarray(rotation_grip_sensor, dtype=np.float64)
        if (
            rotation.shape != (3, 3)
            or not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)
            or np.linalg.det(rotation) < 0.0
        ):
            raise InputError(f"rotation_grip_sensor: need a (3, 3) rotation, got {rotation!r}")
        self.sensor, self.tool, self.low_pass = sensor, tool, low_pass
        lever_grip = sensor.config.lever_arm_m * np.asarray(approach_axis_grip, dtype=np.float64)
        self._to_grip = np.zeros((6, 6))
        self._to_grip[:3, :3] = self._to_grip[3:, 3:] = rotation
        self._to_grip[3:, :3] = -skew(lever_grip) @ rotation
        self._primed = False

    def reset(self) -> None:
        """Forget the past: the next reading is taken as the low-pass's steady state."""
        self._primed = False

    def update(self, force: Vector, torque: Vector, rotation_world_sensor: Vector) -> WrenchSample:
        """Process the true force (3,) [N] and torque (3,) [N m] in S, with R_WS (3, 3)."""
        raw, saturated = self.sensor.measure(force, torque)
        grip = self._to_grip @ (raw - self.tool.wrench(rotation_world_sensor))
        if not self._primed:
            self.low_pass.reset(grip)
            self._primed = True
        filtered = self.low_pass.update(grip)
        return WrenchSample(
            force_sensor_n=raw[:3],
            torque_sensor_nm=raw[3:],
            force_grip_n=grip[:3],
            torque_grip_nm=grip[3:],
            filtered_force_grip_n=filtered[:3],
            filtered_torque_grip_nm=filtered[3:],
            saturated=saturated,
        )

    def transfer_function(self) -> TransferFunction:
        """Tell the low-pass in powers of z⁻¹: the only element here with a memory."""
        return self.low_pass.transfer_function()
