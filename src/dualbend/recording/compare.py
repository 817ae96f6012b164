"""Two saved runs in one recording: their plots on one timeline, one colour a run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from dualbend.recording.geometry import DECIMALS, in_world
from dualbend.recording.layers import view
from dualbend.recording.log import TIMELINE, RecordingLog, new_stream, recording_log, saved
from dualbend.recording.plots import BRIGHT, DULL
from dualbend.run.record import RunRecord
from dualbend.types import SIDES

_PHASE_COLOURS = (0x78909CFF, 0x42A5F5FF, 0x7E57C2FF, 0x26A69AFF, 0xFFB300FF, 0xEC407AFF)

_TITLES = {
    "moment": "Moment about the bending axis, on the sensing gripper",
    "force": "Horizontal force on the sensing gripper",
    "deviation": "Deviation from the nominal path, sensing arm",
    "angle": "Bending angle",
}


def write_compared_recording(
    runs: tuple[RunRecord, RunRecord], labels: tuple[str, str], text: str, path: Path
) -> None:
    """Write both runs' moments, forces, deviations, angles and phases to ``path`` (``.rrd``).

    ``/{quantity}/a`` and ``/{quantity}/b`` are the runs', units in the names of the series;
    ``/grips`` has the grips and their ways in 3D (world frame, m). ``text`` is shown beside them.
    OSError where ``path`` cannot be written.
    """
    name = f"{labels[0]} and {labels[1]}"
    stream = new_stream(name)
    with saved(stream, path, _layout(runs, labels)):
        stream.send_recording_name(name)
        stream.log("comparison", rr.TextDocument(text), static=True)
        stream.log("grips", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for i, (run, label) in enumerate(zip(runs, labels, strict=True)):
            log = recording_log(stream, run)
            _log_plots(log, run, label, i)
            _log_grips(log, run, label, i)
            _log_phases(log, run, i)


def _log_plots(log: RecordingLog, run: RunRecord, label: str, i: int) -> None:
    side, entity = run.sensing_side, "ab"[i]
    for quantity, column, unit in (("moment", "moment_y", "N m"), ("force", "force_x", "N")):
        true, filtered = (run[f"{side}_{kind}_{column}"] for kind in ("true", "filtered"))
        log.lines(
            f"{quantity}/{entity}",
            (f"{label}: {side} true [{unit}]", true, BRIGHT[i], 2.0),
            (f"{label}: {side} filtered [{unit}]", filtered, DULL[i], 1.0),
        )
    along, turn = 1e3 * run[f"{side}_deviation_x"], np.degrees(run[f"{side}_deviation_alpha"])
    log.lines(
        f"deviation/{entity}",
        (f"{label}: {side} δx [mm]", along, BRIGHT[i], 1.5),
        (f"{label}: {side} δα [deg]", turn, DULL[i], 1.5),
    )
    log.lines(
        f"angle/{entity}",
        (f"{label}: nominal [rad]", run["nominal_alpha"], DULL[i], 1.0),
        (f"{label}: {side} grip [rad]", run[f"{side}_grip_alpha"], BRIGHT[i], 1.5),
    )


def _log_grips(log: RecordingLog, run: RunRecord, label: str, i: int) -> None:
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        place = in_world(run, f"{side}_grip", sign).round(DECIMALS)
        entity = f"grips/{'ab'[i]}/{side}"
        look = rr.Points3D.from_fields(colors=BRIGHT[i], radii=0.005, labels=f"{label} {side}")
        log.once(entity, look)
        # A point a row: positions (rows, 1, 3).
        log.rows(entity, rr.Points3D, positions=place[:, None])
        way = rr.LineStrips3D([place], colors=[DULL[i]], radii=0.001)
        log.once(f"{entity}/way", way)


def _log_phases(log: RecordingLog, run: RunRecord, i: int) -> None:
    phase = run["phase"].astype(int)
    starts = np.flatnonzero(np.diff(phase, prepend=-1))
    names = list(run.phases)
    colours = np.resize(np.array(_PHASE_COLOURS, dtype=np.uint32), len(names))
    entity = f"phase/{'ab'[i]}"
    log.once(entity, rr.StateConfiguration(values=names, colors=colours))
    states = [names[phase[row]] for row in starts]
    log.send(entity, log.times[starts], rr.StateChange.columns(state=states))


def _layout(runs: tuple[RunRecord, RunRecord], labels: tuple[str, str]) -> rrb.Blueprint:
    """Return the viewer's layout: the grips and the comparison beside four plots."""
    plots = [rrb.TimeSeriesView(origin=origin, name=title) for origin, title in _TITLES.items()]
    height = max(float(run["nominal_z"].max()) for run in runs)
    length = max(run.scenario.sheet.length_m for run in runs)
    grips = view(
        f"Grips: {labels[0]} blue, {labels[1]} orange",
        [0.0, -2.0 * length, height + 0.3 * length],
        [0.0, 0.0, height],
        origin="grips",
    )
    text = rrb.TextDocumentView(origin="comparison", name="Comparison")
    lanes = rrb.StateTimelineView(origin="phase", name="Phases: a above b")
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(grips, text, lanes, row_shares=[3.0, 4.0, 1.2]),
            rrb.Vertical(*plots),
            column_shares=[2, 3],
        ),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed"),
        collapse_panels=True,
    )
