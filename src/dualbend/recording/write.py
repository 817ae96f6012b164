"""The recording of a run in 3D and over time: one self-contained file for the rerun viewer.

Everything is written after the run, as columns: one call an entity, however many rows.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from dualbend.recording import plots
from dualbend.recording.layers import layers_of
from dualbend.recording.log import (
    TIMELINE,
    RecordingLog,
    new_stream,
    recording_log,
    saved,
)
from dualbend.recording.notes import Notes, guide, story, words
from dualbend.recording.scales import Scales
from dualbend.recording.scene import log_paths, log_scene
from dualbend.run.record import RunRecord

_PREDICTED_COLOUR = [105, 240, 174]
_OUTCOME_COLOURS = {
    "completed": 0x4CAF50FF,
    "aborted": 0xFFB300FF,
    "protective stop": 0xFFB300FF,
    "failed": 0xEF5350FF,
}

_SIDE_BY_SIDE = 3
"""Plots that are seen at once; the others share a place as tabs."""

_LANE = 0.1
"""Length of the outcome in the lane of phases, over that of the run."""


def write_recording(result: RunRecord, path: Path, notes: Notes | None = None) -> None:
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
    stream = open_stream(result)
    with saved(stream, path, layout(result)):
        log, scales = recording_log(stream, result), Scales.of(result)
        log_texts(log, result, scales, notes)
        log_scene(log, result, scales)
        log_run(log, result)
        if notes is not None:
            log_predicted(log, notes)
        log_lanes(log, result)


def open_stream(result: RunRecord, kind: str = "") -> rr.RecordingStream:
    """Return a stream for the run; one of another ``kind`` is another recording."""
    # Two runs are two recordings, not one with doubled data.
    named = "" if result.identity is None else f", {result.identity}"
    return new_stream(f"{_name(result)}{named}{kind}")


def _name(result: RunRecord) -> str:
    return f"{result.scenario.name}, seed {result.scenario.seed}"


def log_texts(
    log: RecordingLog,
    result: RunRecord,
    scales: Scales,
    notes: Notes | None,
    *,
    ended: bool = True,
) -> None:
    """Log the guide, the outcome with its metrics, and the scenario."""
    log.stream.send_recording_name(_name(result))
    markdown = {"guide": guide(result, scales), "outcome": story(result, notes, ended=ended)}
    for entity, text in markdown.items():
        log.replace(entity, rr.TextDocument(text, media_type="text/markdown"))
    log.replace("scenario", rr.TextDocument(result.scenario.to_toml()))


def log_run(log: RecordingLog, result: RunRecord) -> None:
    """Log the paths in the scene and every plot; ``result`` holds the run from its start."""
    log_paths(log, result)
    for quantity, column, unit in (("moment", "moment_y", "N m"), ("force", "force_x", "N")):
        plots.log_wrench(log, result, quantity, column, unit)
    plots.log_angles(log, result.trace)
    layers_of(result).log_series(log, result)
    plots.log_joints(log, result.trace)


def log_predicted(log: RecordingLog, notes: Notes) -> None:
    """Log the moment that theory predicts for the left grip, if it predicts any."""
    if not np.isfinite(notes.predicted_moment).any():
        return
    name = "left predicted [N m]"
    series = (name, notes.predicted_moment, _PREDICTED_COLOUR, 5.0)
    log.broken_line("moment/predicted", series, every=log.frame)


def log_lanes(log: RecordingLog, result: RunRecord) -> None:
    """Log the lanes: phases, sheets of a book, and one cycle after the last row how the run ended.

    The lane goes on after the run and is reset there: a state is drawn up to the next change.
    """
    layers = layers_of(result)
    if log.ended:
        layers.log_lanes(log, result)
    names = layers.states(result)
    colours = layers.colours(result, names) | _OUTCOME_COLOURS
    starts = [
        row for row in range(log.done, len(names)) if row == 0 or names[row] != names[row - 1]
    ]
    period_s = result.scenario.period_s
    end_s = period_s * len(names)
    ends_ns = [round(1e9 * t) for t in (end_s, end_s + max(_LANE * end_s, period_s))]
    times, shown = log.times[starts], [names[row] for row in starts]
    if log.ended:
        times = np.append(times, np.array(ends_ns, dtype="timedelta64[ns]"))
        shown += [words(result.outcome), ""]
    look = rr.StateConfiguration(
        values=list(colours), colors=np.array([*colours.values()], dtype=np.uint32)
    )
    log.replace("phase", look)
    log.send("phase", times, rr.StateChange.columns(state=shown))


def layout(result: RunRecord) -> rrb.Blueprint:
    """Return the viewer's layout for the run: its views, shares, legends and time panel."""
    layers = layers_of(result)
    views = layers.views(result)
    reading = rrb.TextDocumentView(origin="guide", name="How to read this")
    results = rrb.Tabs(
        rrb.TextDocumentView(origin="outcome", name="Outcome and metrics"),
        rrb.TextDocumentView(origin="scenario", name="Scenario"),
    )
    texts = rrb.Horizontal(views.near, reading, results, column_shares=[1.0, 0.8, 0.9])
    scenes = [rrb.Horizontal(*views.top, column_shares=[1.4, 1.0]), texts, views.lane]
    # What ended a run is at the right of its series; what a completed one shows is at the left.
    done = result.outcome == "completed"
    series = [
        rrb.TimeSeriesView(
            origin=origin,
            name=title,
            plot_legend=rrb.Corner2D.RightTop if done else rrb.Corner2D.LeftTop,
            axis_y=rrb.ScalarAxis(range=near) if (near := layers.ranges.get(origin)) else None,
        )
        for origin, title in layers.titles.items()
    ]
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(*scenes, row_shares=list(views.shares)),
            rrb.Vertical(*series[:_SIDE_BY_SIDE], rrb.Tabs(*series[_SIDE_BY_SIDE:])),
            column_shares=[3, 2],
        ),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed"),
        collapse_panels=True,
    )
