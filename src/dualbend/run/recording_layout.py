"""The layout in which the viewer opens a recording: scene, phases and texts beside the plots."""

from __future__ import annotations

import rerun.blueprint as rrb

from dualbend.run.recording_log import TIMELINE
from dualbend.run.runner import RunResult

_TITLES = {
    "moment": "Moment about the bending axis, on the gripper",
    "force": "Horizontal force on the gripper",
    "deviation": "Deviation from the nominal path",
    "angle": "Bending angle",
    "ik": "IK residual",
    "torque": "Joint torque",
}
_SIDE_BY_SIDE = 3
"""Plots that are seen at once; the others share a place as tabs."""


def layout(result: RunResult) -> rrb.Blueprint:
    """Return the viewer's layout for the run: its views, shares, legends and time panel."""
    # What ended a run is at the right of its plots; what a completed one shows is at the left.
    done = result.outcome == "completed"
    corner = rrb.Corner2D.RightTop if done else rrb.Corner2D.LeftTop
    plots = [
        rrb.TimeSeriesView(origin=origin, name=title, plot_legend=corner)
        for origin, title in _TITLES.items()
    ]
    texts = rrb.Tabs(
        rrb.TextDocumentView(origin="outcome", name="Outcome"),
        rrb.TextDocumentView(origin="scenario", name="Scenario"),
    )
    cell, sheet = _scenes(result)
    lane = rrb.StateTimelineView(origin="phase", name="Phase")
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(cell, rrb.Horizontal(sheet, texts), lane, row_shares=[5.0, 3.4, 1.0]),
            rrb.Vertical(*plots[:_SIDE_BY_SIDE], rrb.Tabs(*plots[_SIDE_BY_SIDE:])),
            column_shares=[3, 2],
        ),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed"),
        collapse_panels=True,
    )


def _scenes(result: RunResult) -> list[rrb.Spatial3DView]:
    """Return the views of the whole cell and of the sheet, from the front."""
    height, length = result.scenario.cell.sheet_height_m, result.scenario.sheet.length_m
    views = (
        ("Cell", [0.0, -1.75, height + 0.4], [0.0, 0.0, height - 0.1]),
        ("Sheet", [0.0, -1.2 * length, height + 0.5 * length], [0.0, 0.0, height + 0.18 * length]),
    )
    return [
        rrb.Spatial3DView(
            origin="cell",
            name=name,
            line_grid=False,
            eye_controls=rrb.EyeControls3D(position=eye, look_target=target, eye_up=[0, 0, 1]),
        )
        for name, eye, target in views
    ]
