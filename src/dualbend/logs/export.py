"""A run as a log of ROS 2 messages in MCAP, or as a table of text."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.csv

from dualbend.errors import InputError, writing
from dualbend.files import whole_file
from dualbend.logs import messages
from dualbend.run.record import RunRecord
from dualbend.scene.observation import BENDING_TO_WORLD
from dualbend.types import SIDES, Side, Vector

DEVIATION_TOPIC, SCENARIO_FILE = "/deviation", "scenario.toml"
WORLD = "world"

Message = tuple[str, str, list[bytes | None]]
"""Topic, kind and the message of each row; None: the row does not tell."""

_WRENCH = [f"{part}_{axis}" for part in ("force", "moment") for axis in "xyz"]


def write_csv(run: RunRecord, path: Path) -> None:
    """Write the trace with a line of names; numbers in the digits that read back the same.

    Raises InputError where ``path`` cannot be written.
    """
    with writing(path, "--csv"), whole_file(path) as part:
        pyarrow.csv.write_csv(run.trace.table({}), part)


def write_mcap(run: RunRecord, path: Path) -> int:
    """Write the run's messages in the order of their times; return how many.

    The scenario is attached, and how the run ended is in the metadata. Raises InputError where
    ``path`` cannot be written, or the extra ``mcap`` is missing.
    """
    try:
        from mcap.writer import Writer  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise InputError("--mcap needs the extra: pip install 'dualbend[mcap]'") from error

    times, written = stamps(run), 0
    topics = [topic for topic in topics_of(run) if any(one is not None for one in topic[2])]
    with writing(path, "--mcap"), whole_file(path) as part, part.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="dualbend")
        channels = _channels(writer, topics)
        writer.add_attachment(0, 0, SCENARIO_FILE, "text/toml", run.scenario.to_toml().encode())
        writer.add_metadata("dualbend", _about(run))
        for row, time_ns in enumerate(times):
            for channel, (_, _, rows) in zip(channels, topics, strict=True):
                if (data := rows[row]) is not None:
                    writer.add_message(channel, time_ns, data, time_ns, row)
                    written += 1
        writer.finish()
    return written


def _channels(writer: Any, topics: list[Message]) -> list[int]:  # noqa: ANN401 - of an extra
    schemas = {
        kind: writer.register_schema(kind, "ros2msg", messages.definition(kind).encode())
        for kind in dict.fromkeys(kind for _, kind, _ in topics)
    }
    return [writer.register_channel(topic, "cdr", schemas[kind]) for topic, kind, _ in topics]


def _about(run: RunRecord) -> dict[str, str]:
    about = {"scenario": run.scenario.name, "seed": str(run.scenario.seed), "outcome": run.outcome}
    return about if run.identity is None else {**about, **run.identity.to_metadata()}


def stamps(run: RunRecord) -> list[int]:
    """Return the time of each row in whole nanoseconds since the start of the run."""
    found: list[int] = np.rint(1e9 * run["time"]).astype(np.int64).tolist()
    return found


def topics_of(run: RunRecord) -> Iterator[Message]:
    """Yield every topic that a run has, with the message of each row."""
    times = stamps(run)
    joints, found = run.trace.joints, [name.split("_", 1) for name in run.trace.joints]
    for topic, kinds in (("/joint_states", ("q", "torque")), ("/joint_setpoints", ("setpoint",))):
        parts = [_columns(run, [f"{side}_{kind}_{name}" for side, name in found]) for kind in kinds]
        yield topic, messages.JOINT_STATE, _joint_states(times, joints, *parts)
    frames: list[Vector] = []
    for side in SIDES:
        grip = grip_poses(run, side)
        frames.append(grip)
        yield f"/{side}/grip_pose", messages.POSE, _stamped(times, WORLD, grip)
        if "place_x" not in run.trace:  # an assembly carries the frames of its path
            nominal = nominal_poses(run, side)
            yield f"/{side}/nominal_pose", messages.POSE, _stamped(times, WORLD, nominal)
        true = _columns(run, [f"{side}_true_{part}" for part in _WRENCH])
        yield f"/{side}/true_wrench", messages.WRENCH, _stamped(times, f"{side}_level", true)
        if f"{side}_sensor_force_x" in run.trace:
            read = _columns(run, [f"{side}_sensor_{part}" for part in _WRENCH])
            yield f"/{side}/sensor_wrench", messages.WRENCH, _stamped(times, f"{side}_sensor", read)
    prefixes = tuple(f"{side}_deviation_" for side in SIDES)
    names = [name for name, _ in run.trace.columns if name.startswith(prefixes)]
    yield DEVIATION_TOPIC, messages.JOINT_STATE, _joint_states(times, names, _columns(run, names))
    yield "/tf", messages.TRANSFORMS, _transforms(run, times, frames)


def grip_poses(run: RunRecord, side: Side) -> Vector:
    """Return the grip's pose in the world (rows, 7): x, y, z [m], quaternion x, y, z, w."""
    place = _columns(run, [f"{side}_grip_{axis}" for axis in "xyz"])
    zero, slope = np.zeros(len(place)), run[f"{side}_grip_alpha"]
    turns = [f"{side}_grip_roll", f"{side}_grip_yaw"]
    roll, yaw = (run[name] if name in run.trace else zero for name in turns)
    # Of the edge's roll, pitch and yaw the trace has the slope: tan α cos(yaw) = tan(pitch).
    pitch = slope if not yaw.any() else np.arctan2(np.sin(slope) * np.cos(yaw), np.cos(slope))
    return _in_world(side, place, roll, pitch, yaw)


def nominal_poses(run: RunRecord, side: Side) -> Vector:
    """Return the path's pose in the world (rows, 7), as :func:`grip_poses`."""
    zero = np.zeros(run.trace.rows)
    place = np.column_stack((-run["nominal_half_distance"], zero, run["nominal_z"]))
    return _in_world(side, place, zero, run["nominal_alpha"], zero)


def _in_world(side: Side, place: Vector, roll: Vector, pitch: Vector, yaw: Vector) -> Vector:
    """Return poses (rows, 7) in the world; R = R_z(yaw) R_y(pitch) R_x(roll) in a bending frame."""
    turned = yaw if side == "left" else yaw + np.pi
    (cr, cp, cy), (sr, sp, sy) = (
        [part(angle / 2.0) for angle in (roll, pitch, turned)] for part in (np.cos, np.sin)
    )
    quaternion = (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )
    return np.column_stack((place * BENDING_TO_WORLD[SIDES.index(side)], *quaternion))


def _transforms(run: RunRecord, times: list[int], grips: list[Vector]) -> list[bytes | None]:
    """Return where the grips, the frames of true wrenches and the sensors are, of each row."""
    level = {"left": (0.0, 0.0, 0.0, 1.0), "right": (0.0, 0.0, 1.0, 0.0)}
    lever = (-run.scenario.sensor.lever_arm_m, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    return [
        messages.transforms(
            time_ns,
            [
                frame
                for side, grip in zip(SIDES, grips, strict=True)
                for frame in (
                    (WORLD, f"{side}_grip", grip[row].tolist()),
                    (WORLD, f"{side}_level", (*grip[row, :3].tolist(), *level[side])),
                    (f"{side}_grip", f"{side}_sensor", lever),
                )
            ],
        )
        for row, time_ns in enumerate(times)
    ]


def _columns(run: RunRecord, names: list[str]) -> Vector:
    return np.column_stack([run[name] for name in names])


def _stamped(times: list[int], frame: str, rows: Vector) -> list[bytes | None]:
    return [
        messages.stamped(time_ns, frame, row.tolist()) if np.isfinite(row).all() else None
        for time_ns, row in zip(times, rows, strict=True)
    ]


def _joint_states(
    times: list[int], names: tuple[str, ...] | list[str], position: Vector, *effort: Vector
) -> list[bytes | None]:
    efforts = effort[0] if effort else np.empty((len(position), 0))
    return [
        messages.joint_state(time_ns, names, row.tolist(), also.tolist())
        if np.isfinite(row).all()
        else None
        for time_ns, row, also in zip(times, position, efforts, strict=True)
    ]
