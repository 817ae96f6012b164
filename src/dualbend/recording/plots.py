"""The plots of a recording: wrench, angles, path, deviations, joints; names carry the units."""

from __future__ import annotations

import numpy as np
import rerun as rr

from dualbend.recording.log import FRAME_CYCLES, Colour, RecordingLog
from dualbend.run.record import RunRecord
from dualbend.run.trace import Trace
from dualbend.types import SIDES, Vector

NOMINAL_COLOUR = [130, 130, 130]
"""Grey: what is nominal, in the scene and in the plots."""

_WHITE, _CREAM, _BLUE, _ORANGE = [240, 240, 240], [255, 220, 150], [70, 180, 255], [255, 165, 60]
_SIDE_COLOURS = {"left": (_BLUE, [60, 110, 150]), "right": (_ORANGE, [150, 105, 55])}


def log_wrench(log: RecordingLog, result: RunRecord, quantity: str, column: str, unit: str) -> None:
    """Log one component of the wrench on the grips: true, and measured where there is a sensor."""
    trace = result.trace
    truth = [
        (f"{side} true [{unit}]", trace[f"{side}_true_{column}"], colour, width)
        for side, colour, width in (("left", _WHITE, 2.5), ("right", _CREAM, 1.0))
    ]
    log.lines(f"{quantity}/true", *truth)
    for side in result.scenario.compliance.sensing:
        bright, dull = _SIDE_COLOURS[side]
        measured, filtered = (trace[f"{side}_{kind}_{column}"] for kind in ("measured", "filtered"))
        log.lines(
            f"{quantity}/{side}",
            (f"{side} measured [{unit}]", measured, dull, 1.0),
            (f"{side} filtered [{unit}]", filtered, bright, 1.5),
        )


def log_angles(log: RecordingLog, trace: Trace) -> None:
    """Log the angles of the grips."""
    angles: list[tuple[str, Vector, Colour, float]] = []
    angles.append(("nominal [rad]", trace["nominal_alpha"], NOMINAL_COLOUR, 1.5))
    for side in SIDES:
        bright, _ = _SIDE_COLOURS[side]
        angles.append((f"{side} grip [rad]", trace[f"{side}_grip_alpha"], bright, 1.5))
    log.lines("angle", *angles)


def log_path(log: RecordingLog, trace: Trace) -> None:
    """Log how far the grips are from the mid-plane: the path, as planned and as it became."""
    series: list[tuple[str, Vector, Colour, float]] = []
    series.append(("nominal [mm]", 1e3 * trace["nominal_half_distance"], NOMINAL_COLOUR, 1.5))
    for side in SIDES:
        bright, dull = _SIDE_COLOURS[side]
        series.append((f"{side} commanded [mm]", -1e3 * trace[f"{side}_command_x"], dull, 1.0))
        series.append((f"{side} grip [mm]", -1e3 * trace[f"{side}_grip_x"], bright, 1.5))
    log.lines("path", *series, every=FRAME_CYCLES)


def log_deviations(log: RecordingLog, trace: Trace) -> None:
    """Log the deviations that each arm's compliance makes."""
    deviations: list[tuple[str, Vector, Colour, float]] = []
    for side in SIDES:
        bright, dull = _SIDE_COLOURS[side]
        turn = np.degrees(trace[f"{side}_deviation_alpha"])
        deviations.append((f"{side} δx [mm]", 1e3 * trace[f"{side}_deviation_x"], bright, 1.5))
        deviations.append((f"{side} δα [deg]", turn, dull, 1.5))
    log.lines("deviation", *deviations)


def log_joints(log: RecordingLog, trace: Trace) -> None:
    """Log joint torques and what the inverse kinematics left over."""
    columns = [f"{name.replace('_', '_torque_', 1)}" for name in trace.joints]
    names = [f"{name.replace('_joint', ' joint ', 1)} [N m]" for name in trace.joints]
    log.once("torque", rr.SeriesLines(names=names))
    torques = np.stack([trace[column] for column in columns], axis=1)
    log.rows("torque", rr.Scalars, FRAME_CYCLES, scalars=torques)
    log.lines(
        "ik",
        ("position [µm]", 1e6 * trace["ik_position"], _BLUE, 1.5),
        ("rotation [µrad]", 1e6 * trace["ik_rotation"], _ORANGE, 1.5),
        every=FRAME_CYCLES,
    )
