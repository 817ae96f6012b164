"""The layout in which the viewer opens a recording: scene, phases and texts beside the plots."""

from __future__ import annotations

import rerun.blueprint as rrb

from dualbend.run.recording_log import TIMELINE
from dualbend.run.runner import RunResult
from dualbend.scene.bed import HOLES, LayoutConfig, hole_places

_TITLES = {
    "moment": "Moment about the bending axis, on the gripper",
    "force": "Horizontal force on the gripper",
    "deviation": "Deviation from the nominal path",
    "angle": "Bending angle",
    "ik": "IK residual",
    "torque": "Joint torque",
}
_ASSEMBLY_TITLES = {
    "hole_offset": "Holes off their pins, horizontally",
    "pin_force": "Force on the pins",
    "object_deviation": "Deviation by compliance, of the whole sheet",
    "contact_force": "Contact force on the sheet, as the arms feel it",
    "hole_height": "Height of the holes above the bed",
    **{key: title for key, title in _TITLES.items() if key != "deviation"},
}
_SIDE_BY_SIDE = 3
"""Plots that are seen at once; the others share a place as tabs."""

_NEAR_MM = {"hole_offset": (0.0, 2.5), "hole_height": (-0.5, 12.0)}
"""What the plots of the holes show at first: while a sheet is carried they are far off."""

_UNCLUTTERED = ["+ $origin/**", "- $origin/wrench/**", "- $origin/grip/**", "- $origin/path/**"]


def layout(result: RunResult) -> rrb.Blueprint:
    """Return the viewer's layout for the run: its views, shares, legends and time panel."""
    texts = rrb.Tabs(
        rrb.TextDocumentView(origin="outcome", name="Outcome"),
        rrb.TextDocumentView(origin="scenario", name="Scenario"),
    )
    lane = rrb.StateTimelineView(origin="phase", name="Phase")
    cell, sheet = _scenes(result)
    if result.scenario.assembly is None:
        plots = _plots(result, _TITLES)
        scenes = [cell, rrb.Horizontal(sheet, texts), lane]
        shares = [5.0, 3.4, 1.0]
    else:
        book = result.scenario.assembly.sheets > 1
        plots = _plots(result, _ASSEMBLY_TITLES)
        height = result.scenario.cell.sheet_height_m
        cell = _view("Cell", [0.0, -2.2, height + 0.6], [0.0, 0.0, height - 0.1])
        bed, *pins = _close_ups(result.scenario.assembly.layout)
        if book:
            lane = rrb.StateTimelineView(origin="/", contents=["phase", "sheet"], name="Phase")
        near = rrb.Horizontal(rrb.Tabs(*pins, active_tab=0), texts, column_shares=[1.0, 1.0])
        scenes = [rrb.Horizontal(cell, bed), near, lane]
        shares = [4.2, 3.6, 1.6 if book else 1.0]
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(*scenes, row_shares=shares),
            rrb.Vertical(*plots[:_SIDE_BY_SIDE], rrb.Tabs(*plots[_SIDE_BY_SIDE:])),
            column_shares=[3, 2],
        ),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed"),
        collapse_panels=True,
    )


def _plots(result: RunResult, titles: dict[str, str]) -> list[rrb.TimeSeriesView]:
    # What ended a run is at the right of its plots; what a completed one shows is at the left.
    done = result.outcome == "completed"
    corner = rrb.Corner2D.RightTop if done else rrb.Corner2D.LeftTop
    return [
        rrb.TimeSeriesView(
            origin=origin,
            name=title,
            plot_legend=corner,
            axis_y=rrb.ScalarAxis(range=_NEAR_MM[origin]) if origin in _NEAR_MM else None,
        )
        for origin, title in titles.items()
    ]


def _scenes(result: RunResult) -> list[rrb.Spatial3DView]:
    """Return the views of the whole cell and of the sheet, from the front."""
    height, length = result.scenario.cell.sheet_height_m, result.scenario.sheet.length_m
    return [
        _view("Cell", [0.0, -1.75, height + 0.4], [0.0, 0.0, height - 0.1]),
        _view(
            "Sheet", [0.0, -1.2 * length, height + 0.5 * length], [0.0, 0.0, height + 0.18 * length]
        ),
    ]


def _close_ups(workplace: LayoutConfig) -> list[rrb.Spatial3DView]:
    """Return the views of the bed and of each pin, without the arrows and axes."""
    top, half = workplace.bed.top_m, workplace.bed.half_length_m
    views = [
        _view("Bed", [0.0, -2.6 * half, top + 2.2 * half], [0.0, 0.2 * half, top], _UNCLUTTERED)
    ]
    for hole, (x, y) in zip(HOLES, hole_places(workplace.holes), strict=True):
        name, at = f"Pin {hole.replace('_', ' ')}", [x, y, top + 0.004]
        views.append(_view(name, [x + 0.010, y - 0.032, top + 0.024], at, _UNCLUTTERED))
    return views


def _view(
    name: str, eye: list[float], target: list[float], contents: list[str] | None = None
) -> rrb.Spatial3DView:
    return rrb.Spatial3DView(
        origin="cell",
        contents="$origin/**" if contents is None else contents,
        name=name,
        line_grid=False,
        eye_controls=rrb.EyeControls3D(position=eye, look_target=target, eye_up=[0, 0, 1]),
    )
