"""The recording of a run in 3D and over time: one self-contained file for the rerun viewer.

Everything is written after the run, as columns: one call an entity, however many rows.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import rerun as rr

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.recording.assembly import log_contact, log_sheet_lane, state_colours, states
from dualbend.recording.layout import layout
from dualbend.recording.log import FRAME_CYCLES, Colour, RecordingLog, Times
from dualbend.recording.notes import Notes, guide, story, words
from dualbend.recording.scales import Scales
from dualbend.recording.scene import NOMINAL_COLOUR, log_paths, log_scene
from dualbend.run.loop import RunResult
from dualbend.run.trace import Trace
from dualbend.types import SIDES, Vector

_WHITE, _CREAM, _BLUE, _ORANGE = [240, 240, 240], [255, 220, 150], [70, 180, 255], [255, 165, 60]
_PREDICTED_COLOUR = [105, 240, 174]
_SIDE_COLOURS = {"left": (_BLUE, [60, 110, 150]), "right": (_ORANGE, [150, 105, 55])}
_STATE_COLOURS = {
    "settle": 0x78909CFF,
    "bend": 0x42A5F5FF,
    "hold": 0x7E57C2FF,
    "return": 0x26A69AFF,
    "rest": 0x8D6E63FF,
}
_OUTCOME_COLOURS = {
    "completed": 0x4CAF50FF,
    "protective stop": 0xFFB300FF,
    "failed": 0xEF5350FF,
}

_LANE = 0.1
"""Length of the outcome in the lane of phases, over that of the run."""


def write_recording(result: RunResult, path: Path, notes: Notes | None = None) -> None:
    """Write the run to ``path`` (``.rrd``), with the layout in which the viewer opens it.

    The scene is under ``/cell`` (world frame, metres, every 84 ms), the series under ``/moment``,
    ``/force``, ``/path``, ``/deviation``, ``/angle``, ``/ik`` and ``/torque``, units in their
    names; ``/phase`` is a lane of states, ``/guide``, ``/outcome`` and ``/scenario`` are texts.
    ``notes`` add metrics and the predicted moment. Two recordings of one run hold equal data,
    although their bytes differ. Cells that an early end left unfinished are left out.

    Raises
    ------
    OSError
        ``path`` cannot be written.
    """
    path.write_bytes(b"")  # refuses a bad path; rerun itself would only warn
    stream = open_stream(result)
    stream.save(path, default_blueprint=layout(result))
    try:
        log, scales = RecordingLog(stream, row_times(result.trace)), Scales.of(result)
        log_texts(log, result, scales, notes)
        log_scene(log, result, scales)
        log_run(log, result)
        if notes is not None:
            log_predicted(log, notes)
        log_lanes(log, result)
    finally:
        stream.disconnect()


def open_stream(result: RunResult, kind: str = "") -> rr.RecordingStream:
    """Return a stream for the run; one of another ``kind`` is another recording."""
    scenario = result.scenario
    name = f"{scenario.name}, seed {scenario.seed}"
    # Two runs of one name with other settings are two recordings, not one with doubled data.
    digest = hashlib.sha256(scenario.to_toml().encode()).hexdigest()[:8]
    stream = rr.RecordingStream(
        "dualbend", recording_id=f"{name}, {digest}{kind}", send_properties=False
    )
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    return stream


def row_times(trace: Trace) -> Times:
    """Return the times of the rows (rows,) in whole nanoseconds."""
    return np.rint(1e9 * trace["time"]).astype("timedelta64[ns]")


def log_texts(
    log: RecordingLog,
    result: RunResult,
    scales: Scales,
    notes: Notes | None,
    *,
    ended: bool = True,
) -> None:
    """Log the guide, the outcome with its metrics, and the scenario."""
    log.stream.send_recording_name(f"{result.scenario.name}, seed {result.scenario.seed}")
    markdown = {"guide": guide(result, scales), "outcome": story(result, notes, ended=ended)}
    for entity, text in markdown.items():
        log.replace(entity, rr.TextDocument(text, media_type="text/markdown"))
    log.replace("scenario", rr.TextDocument(result.scenario.to_toml()))


def log_run(log: RecordingLog, result: RunResult) -> None:
    """Log the paths in the scene and every plot; ``result`` holds the run from its start."""
    log_paths(log, result)
    for quantity, column, unit in (("moment", "moment_y", "N m"), ("force", "force_x", "N")):
        _log_wrench(log, result, quantity, column, unit)
    _log_angles(log, result.trace)
    if result.scenario.assembly is None:
        _log_path(log, result.trace)
        _log_deviations(log, result.trace)
    else:
        log_contact(log, result.trace)
    _log_joints(log, result.trace)


def log_predicted(log: RecordingLog, notes: Notes) -> None:
    """Log the moment that theory predicts for the left grip, if it predicts any."""
    if not np.isfinite(notes.predicted_moment).any():
        return
    name = "left predicted [N m]"
    series = (name, notes.predicted_moment, _PREDICTED_COLOUR, 5.0)
    log.broken_line("moment/predicted", series, every=FRAME_CYCLES)


def log_lanes(log: RecordingLog, result: RunResult) -> None:
    """Log the lanes: phases, sheets of a book, and at the end of the run how it ended."""
    if result.scenario.assembly is not None and log.ended:
        log_sheet_lane(log, result)
    _log_phases(log, result)


def _log_wrench(
    log: RecordingLog, result: RunResult, quantity: str, column: str, unit: str
) -> None:
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


def _log_angles(log: RecordingLog, trace: Trace) -> None:
    """Log the angles of the grips."""
    angles: list[tuple[str, Vector, Colour, float]] = []
    angles.append(("nominal [rad]", trace["nominal_alpha"], NOMINAL_COLOUR, 1.5))
    for side in SIDES:
        bright, _ = _SIDE_COLOURS[side]
        angles.append((f"{side} grip [rad]", trace[f"{side}_grip_alpha"], bright, 1.5))
    log.lines("angle", *angles)


def _log_path(log: RecordingLog, trace: Trace) -> None:
    """Log how far the grips are from the mid-plane: the path, as planned and as it became."""
    series: list[tuple[str, Vector, Colour, float]] = []
    series.append(("nominal [mm]", 1e3 * trace["nominal_half_distance"], NOMINAL_COLOUR, 1.5))
    for side in SIDES:
        bright, dull = _SIDE_COLOURS[side]
        series.append((f"{side} commanded [mm]", -1e3 * trace[f"{side}_command_x"], dull, 1.0))
        series.append((f"{side} grip [mm]", -1e3 * trace[f"{side}_grip_x"], bright, 1.5))
    log.lines("path", *series, every=FRAME_CYCLES)


def _log_deviations(log: RecordingLog, trace: Trace) -> None:
    """Log the deviations that each arm's compliance makes."""
    deviations: list[tuple[str, Vector, Colour, float]] = []
    for side in SIDES:
        bright, dull = _SIDE_COLOURS[side]
        turn = np.degrees(trace[f"{side}_deviation_alpha"])
        deviations.append((f"{side} δx [mm]", 1e3 * trace[f"{side}_deviation_x"], bright, 1.5))
        deviations.append((f"{side} δα [deg]", turn, dull, 1.5))
    log.lines("deviation", *deviations)


def _log_joints(log: RecordingLog, trace: Trace) -> None:
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


def _log_phases(log: RecordingLog, result: RunResult) -> None:
    """Log when each phase began and, one cycle after the last row, how the run ended.

    The lane goes on after the run and is reset there: a state is drawn up to the next change.
    """
    trace = result.trace
    if result.scenario.assembly is None:
        names = [result.phases[phase] for phase in trace["phase"].astype(int)]
        colours = _STATE_COLOURS | _OUTCOME_COLOURS
    else:
        names = states(result)
        colours = state_colours(names) | _OUTCOME_COLOURS | {"aborted": 0xFFB300FF}
    starts = [
        row for row in range(log.done, len(names)) if row == 0 or names[row] != names[row - 1]
    ]
    end_s = COMMAND_PERIOD_S * len(names)
    ends_ns = [round(1e9 * t) for t in (end_s, end_s + max(_LANE * end_s, COMMAND_PERIOD_S))]
    times, shown = log.times[starts], [names[row] for row in starts]
    if log.ended:
        times = np.append(times, np.array(ends_ns, dtype="timedelta64[ns]"))
        shown += [words(result.outcome), ""]
    look = rr.StateConfiguration(
        values=list(colours), colors=np.array([*colours.values()], dtype=np.uint32)
    )
    log.replace("phase", look)
    log.send("phase", times, rr.StateChange.columns(state=shown))
