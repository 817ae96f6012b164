"""The plots of a recording: wrench, angles, path, deviations, joints; names carry the units."""

from __future__ import annotations

import numpy as np
import rerun as rr

from dualbend.recording.log import Colour, RecordingLog, Series
from dualbend.run.record import RunRecord
from dualbend.run.trace import Trace
from dualbend.types import SIDES

NOMINAL_COLOUR = [130, 130, 130]
"""Grey: what is nominal, in the scene and in the plots."""

BRIGHT: tuple[Colour, Colour] = ([70, 180, 255], [255, 165, 60])
DULL: tuple[Colour, Colour] = ([60, 110, 150], [150, 105, 55])
"""Blue and orange: left and right, or one run and another."""

_WHITE, _CREAM = [240, 240, 240], [255, 220, 150]
_SIDE_COLOURS = dict(zip(SIDES, zip(BRIGHT, DULL, strict=True), strict=True))


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
    series: list[Series] = [("nominal [rad]", trace["nominal_alpha"], NOMINAL_COLOUR, 1.5)]
    for side, (bright, _) in _SIDE_COLOURS.items():
        series.append((f"{side} grip [rad]", trace[f"{side}_grip_alpha"], bright, 1.5))
    log.lines("angle", *series)


def log_path(log: RecordingLog, trace: Trace) -> None:
    """Log how far the grips are from the mid-plane: the path, as planned and as it became."""
    half = 1e3 * trace["nominal_half_distance"]
    series: list[Series] = [("nominal [mm]", half, NOMINAL_COLOUR, 1.5)]
    for side, (bright, dull) in _SIDE_COLOURS.items():
        series.append((f"{side} commanded [mm]", -1e3 * trace[f"{side}_command_x"], dull, 1.0))
        series.append((f"{side} grip [mm]", -1e3 * trace[f"{side}_grip_x"], bright, 1.5))
    log.lines("path", *series, every=log.frame)


def log_deviations(log: RecordingLog, trace: Trace) -> None:
    """Log the deviations that each arm's compliance makes."""
    series: list[Series] = []
    for side, (bright, dull) in _SIDE_COLOURS.items():
        turn = np.degrees(trace[f"{side}_deviation_alpha"])
        series.append((f"{side} δx [mm]", 1e3 * trace[f"{side}_deviation_x"], bright, 1.5))
        series.append((f"{side} δα [deg]", turn, dull, 1.5))
    log.lines("deviation", *series)


def log_joints(log: RecordingLog, trace: Trace) -> None:
    """Log joint torques and what the inverse kinematics left over."""
    units = dict(trace.columns)
    columns = {name: name.replace("_", "_torque_", 1) for name in trace.joints}
    names = [
        f"{name.replace('_joint', ' joint ', 1)} [{units[column]}]"
        for name, column in columns.items()
    ]
    log.once("torque", rr.SeriesLines(names=names))
    torques = np.stack([trace[column] for column in columns.values()], axis=1)
    log.rows("torque", rr.Scalars, log.frame, scalars=torques)
    log.lines(
        "ik",
        ("position [µm]", 1e6 * trace["ik_position"], BRIGHT[0], 1.5),
        ("rotation [µrad]", 1e6 * trace["ik_rotation"], BRIGHT[1], 1.5),
        every=log.frame,
    )
