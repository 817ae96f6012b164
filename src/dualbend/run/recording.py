"""The recording of a run in 3D and over time: one self-contained file for the rerun viewer.

Everything is written after the run, as columns: one call an entity, however many rows.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import rerun as rr

from dualbend.control.alter import COMMAND_PERIOD_S
from dualbend.run.recording_assembly import log_contact, log_sheet_lane, state_colours, states
from dualbend.run.recording_layout import layout
from dualbend.run.recording_log import Colour, RecordingLog, Vector
from dualbend.run.recording_scales import Scales
from dualbend.run.recording_scene import NOMINAL_COLOUR, log_scene
from dualbend.run.runner import RunResult
from dualbend.run.trace import Trace
from dualbend.scene.cell import SIDES

_WHITE, _CREAM, _BLUE, _ORANGE = [240, 240, 240], [255, 220, 150], [70, 180, 255], [255, 165, 60]
_SIDE_COLOURS = {"left": (_BLUE, [60, 110, 150]), "right": (_ORANGE, [150, 105, 55])}
_STATE_COLOURS = {
    "settle": 0x78909CFF,
    "bend": 0x42A5F5FF,
    "hold": 0x7E57C2FF,
}
_OUTCOME_COLOURS = {
    "completed": 0x4CAF50FF,
    "protective stop": 0xFFB300FF,
    "failed": 0xEF5350FF,
}

_ASSEMBLY_LEGEND = (
    '* phases: "lower 2" is the second attempt to lower',
    "* brass: the pins; dark discs with a white rim: the sheet's holes; pale: sheets laid before",
    "* a hole is on its pin where its offset is within half the clearance and its height is that "
    "of the sheets below",
)

_LANE = 0.1
"""Length of the outcome in the lane of phases, over that of the run."""


def write_recording(result: RunResult, path: Path) -> None:
    """Write the run to ``path`` (``.rrd``), with the layout in which the viewer opens it.

    The scene is under ``/cell`` (world frame, metres), the series under ``/moment``, ``/force``,
    ``/deviation``, ``/angle``, ``/ik`` and ``/torque``, units in their names; ``/phase`` is a lane
    of states, ``/outcome`` and ``/scenario`` are texts. Two recordings of one run hold equal data,
    although their bytes differ. Cells that an early end left unfinished are left out.

    Raises
    ------
    OSError
        ``path`` cannot be written.
    """
    name = f"{result.scenario.name}, seed {result.scenario.seed}"
    toml = result.scenario.to_toml()
    # Two runs of one name with other settings are two recordings, not one with doubled data.
    digest = hashlib.sha256(toml.encode()).hexdigest()[:8]
    path.write_bytes(b"")  # refuses a bad path; rerun itself would only warn
    stream = rr.RecordingStream("dualbend", recording_id=f"{name}, {digest}", send_properties=False)
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    stream.save(path, default_blueprint=layout(result))
    try:
        stream.send_recording_name(name)
        times = np.rint(1e9 * result.trace["time"]).astype("timedelta64[ns]")
        log, scales = RecordingLog(stream, times), Scales.of(result)
        log.once("scenario", rr.TextDocument(toml))
        log.once("outcome", rr.TextDocument(_story(result, scales), media_type="text/markdown"))
        log_scene(log, result, scales)
        for quantity, column, unit in (("moment", "moment_y", "N m"), ("force", "force_x", "N")):
            _log_wrench(log, result, quantity, column, unit)
        _log_angles(log, result.trace)
        if result.scenario.assembly is None:
            _log_deviations(log, result.trace)
        else:
            log_contact(log, result.trace)
            log_sheet_lane(log, result)
        _log_joints(log, result.trace)
        _log_phases(log, result)
    finally:
        stream.disconnect()


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
    for side in result.scenario.arms.sensing:
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
    for side in SIDES:
        joints = [name.removeprefix(f"{side}_") for name in trace.joints if name.startswith(side)]
        torques = np.stack([trace[f"{side}_torque_{joint}"] for joint in joints], axis=1)
        names = [f"{side} joint {i} [N m]" for i in range(1, len(joints) + 1)]
        log.once(f"torque/{side}", rr.SeriesLines(names=names))
        log.rows(f"torque/{side}", rr.Scalars, scalars=torques)
    log.lines(
        "ik",
        ("position [µm]", 1e6 * trace["ik_position"], _BLUE, 1.5),
        ("rotation [µrad]", 1e6 * trace["ik_rotation"], _ORANGE, 1.5),
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
    starts = [row for row in range(len(names)) if row == 0 or names[row] != names[row - 1]]
    end_s = COMMAND_PERIOD_S * len(names)
    ends_ns = [round(1e9 * t) for t in (end_s, end_s + max(_LANE * end_s, COMMAND_PERIOD_S))]
    times = np.append(log.times[starts], np.array(ends_ns, dtype="timedelta64[ns]"))
    shown = [*(names[row] for row in starts), _words(result.outcome), ""]
    look = rr.StateConfiguration(
        values=list(colours), colors=np.array([*colours.values()], dtype=np.uint32)
    )
    log.once("phase", look)
    log.send("phase", times, rr.StateChange.columns(state=shown))


def _words(outcome: str) -> str:
    return outcome.replace("_", " ")


def _story(result: RunResult, scales: Scales) -> str:
    scenario, limit = result.scenario, f"{scales.moment_range_n_m:g}"
    reason = [f"**{result.reason}**\n"] if result.reason else []
    return "\n".join(
        (
            f"# {scenario.name}: {_words(result.outcome)}",
            *reason,
            scenario.description,
            f"\n{result.simulated_s:.3f} s in {result.trace.rows} cycles, seed {scenario.seed}\n",
            f"* sheet: bending moment, −{limit} N m blue, 0 grey, +{limit} N m red",
            f"* yellow arrow: force of the sheet on the grip, {1e3 * scales.force_m_per_n:g} mm/N;"
            " towards the grip it is a push",
            f"* violet arrow: its moment about the grip, {scales.torque_m_per_n_m:g} mm/(N mm)",
            "* axes at the grip: short as it is, long as commanded",
            "* path of the grip: grey nominal, green commanded with compliance",
            *(() if scenario.assembly is None else _ASSEMBLY_LEGEND),
        )
    )
