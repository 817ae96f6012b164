"""The layout in which the viewer opens a recording: scene, phases and texts beside the plots."""

from __future__ import annotations

import rerun.blueprint as rrb

from dualbend.recording.log import TIMELINE
from dualbend.run.loop import RunResult
from dualbend.scene.bed.config import HOLES, LayoutConfig, hole_places
from dualbend.types import SIDES

_TITLES = {
    "moment": "Moment about the bending axis, on the gripper [N m]",
    "force": "Horizontal force on the gripper [N]",
    "path": "Path: grip to mid-plane [mm]",
    "deviation": "Deviation from the nominal path [mm, deg]",
    "angle": "Bending angle [rad]",
    "ik": "IK residual [µm, µrad]",
    "torque": "Joint torque [N m]",
}
_ASSEMBLY_TITLES = {
    "hole_offset": "Holes off their pins, horizontally [mm]",
    "pin_force": "Force on the pins [N]",
    "moment": _TITLES["moment"],
    "path": "Path: place of the sheet [mm]",
    "object_deviation": "Deviation by compliance, of the whole sheet [mm, deg]",
    "contact_force": "Contact force on the sheet, as the arms feel it [N]",
    "hole_height": "Height of the holes above the bed [mm]",
    **{key: _TITLES[key] for key in ("force", "angle", "ik", "torque")},
}
_SIDE_BY_SIDE = 3
"""Plots that are seen at once; the others share a place as tabs."""

_NEAR_MM = {"hole_offset": (0.0, 2.5), "hole_height": (-0.5, 12.0)}
"""What the plots of the holes show at first: while a sheet is carried they are far off."""

_UNCLUTTERED = ["+ $origin/**", "- $origin/wrench/**", "- $origin/grip/**", "- $origin/path/**"]


def layout(result: RunResult) -> rrb.Blueprint:
    """Return the viewer's layout for the run: its views, shares, legends and time panel."""
    reading = rrb.TextDocumentView(origin="guide", name="How to read this")
    results = rrb.Tabs(
        rrb.TextDocumentView(origin="outcome", name="Outcome and metrics"),
        rrb.TextDocumentView(origin="scenario", name="Scenario"),
    )
    lane = rrb.StateTimelineView(origin="phase", name="Phase")
    cell, sheet, gripper = _scenes(result)
    if result.scenario.assembly is None:
        plots = _plots(result, _TITLES)
        top, near = [cell, gripper], sheet
        shares = [4.0, 3.6, 0.9]
    else:
        book = result.scenario.assembly.sheets > 1
        plots = _plots(result, _ASSEMBLY_TITLES)
        height = result.scenario.cell.sheet_height_m
        cell = _view("Cell", [0.0, -2.2, height + 0.6], [0.0, 0.0, height - 0.1])
        bed, *pins = _close_ups(result.scenario.assembly.layout)
        if book:
            lane = rrb.StateTimelineView(origin="/", contents=["phase", "sheet"], name="Phase")
        top, near = [cell, bed], rrb.Tabs(*pins, gripper, active_tab=0)
        shares = [4.0, 3.6, 1.5 if book else 0.9]
    texts = rrb.Horizontal(near, reading, results, column_shares=[1.0, 0.8, 0.9])
    scenes = [rrb.Horizontal(*top, column_shares=[1.4, 1.0]), texts, lane]
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
    """Return the views of the whole cell, of the sheet, and of a gripper that the eye follows."""
    height, length = result.scenario.cell.sheet_height_m, result.scenario.sheet.length_m
    return [
        _view("Cell", [0.0, -1.75, height + 0.4], [0.0, 0.0, height - 0.1]),
        _view(
            "Sheet", [0.0, -1.2 * length, height + 0.5 * length], [0.0, 0.0, height + 0.18 * length]
        ),
        _gripper(result),
    ]


def _gripper(result: RunResult) -> rrb.Spatial3DView:
    """Return the close-up of the gripper that senses, from a camera that moves with it."""
    side = next(side for side in SIDES if side in result.scenario.compliance.sensing)
    front = -1.0 if side == "left" else 1.0
    return _view(
        f"{side.capitalize()} gripper, close up",
        [0.10, 0.26 * front, 0.13],
        [0.02, 0.0, 0.0],
        "/cell/**",
        origin=f"cell/grip/{side}_actual",
    )


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
    name: str,
    eye: list[float],
    target: list[float],
    contents: str | list[str] = "$origin/**",
    origin: str = "cell",
) -> rrb.Spatial3DView:
    return rrb.Spatial3DView(
        origin=origin,
        contents=contents,
        name=name,
        line_grid=False,
        eye_controls=rrb.EyeControls3D(position=eye, look_target=target, eye_up=[0, 0, 1]),
    )
