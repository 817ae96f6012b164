"""What a task adds to the recording and to the pictures of a run: layers, plots, views, texts.

:class:`Layers` is that of a sheet between two grips in the bending plane; a task with more to show
derives from it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
import rerun.blueprint as rrb
from numpy.typing import NDArray

from dualbend.recording import plots
from dualbend.recording.geometry import Motion, carry, in_world, log_axes
from dualbend.recording.log import RecordingLog
from dualbend.run.record import RunRecord
from dualbend.types import Vector

TITLES = {
    "moment": "Moment about the bending axis, on the gripper [N m]",
    "force": "Horizontal force on the gripper [N]",
    "path": "Path: grip to mid-plane [mm]",
    "deviation": "Deviation from the nominal path [mm, deg]",
    "angle": "Bending angle [rad]",
    "ik": "IK residual [µm, µrad]",
    "torque": "Joint torque [N m]",
}
"""Plots by entity, in the order in which they are shown."""

_COLOURS = (0x78909CFF, 0x42A5F5FF, 0x7E57C2FF, 0x26A69AFF, 0x8D6E63FF)


@dataclass(frozen=True, kw_only=True)
class Views:
    """How the viewer shows a run: scenes at the top, one beside the texts, the lane of phases.

    ``shares``: heights of these three rows.
    """

    top: Sequence[rrb.Spatial3DView]
    near: rrb.Spatial3DView | rrb.Tabs
    lane: rrb.StateTimelineView
    shares: Sequence[float]


class Layers:
    """Layers, plots, views and texts of a run in which a sheet is bent between two grips."""

    guide = (
        "Drag the white line in a plot or press play: every panel shows the same moment of the "
        "run. Left: the cell, one gripper close up, the sheet; below them, what the robots were "
        "doing. Right: what the sheet does to the grippers. **measured** is the wrist sensor, "
        "noise and all, **filtered** what the compliance acts on, **true** what really acts "
        "there."
    )
    predicted = (
        " **predicted** is what beam theory says for these poses: where true leaves it, the sheet "
        "swings."
    )
    legend: tuple[str, ...] = ()
    titles: Mapping[str, str] = TITLES
    ranges: Mapping[str, tuple[float, float]] = {}
    """What a plot shows at first, where that is not all of it."""
    camera = "front"
    """Of the model, for pictures."""

    def states(self, result: RunRecord) -> list[str]:
        """Return what each row's phase is called."""
        return [result.phases[phase] for phase in result.trace["phase"].astype(int)]

    def colours(self, result: RunRecord, names: Sequence[str]) -> dict[str, int]:
        """Return a colour for each state, red, green, blue and opacity in one number."""
        del names
        phases = result.phases
        return {name: _COLOURS[i % len(_COLOURS)] for i, name in enumerate(phases)}

    def log_series(self, log: RecordingLog, result: RunRecord) -> None:
        """Log the plots that only this task has."""
        plots.log_path(log, result.trace)
        plots.log_deviations(log, result.trace)

    def log_lanes(self, log: RecordingLog, result: RunRecord) -> None:
        """Log the lanes beside that of the phases, at the end of the run."""

    def log_grip(
        self, log: RecordingLog, result: RunRecord, motion: Motion, side: str, sign: float
    ) -> None:
        """Log where a grip is: a frame turned by R_y(α), right by R_z(π) R_y(α)."""
        del motion
        trace = result.trace
        grip = in_world(result, f"{side}_grip", sign)
        flat = np.zeros((trace.rows, 4))
        _, turn = carry(flat, (flat[:, 0], flat[:, 0], trace[f"{side}_grip_alpha"]), sign)
        log_axes(log, f"cell/grip/{side}_actual", 0.03, grip, turn)

    def log_scene(
        self,
        log: RecordingLog,
        result: RunRecord,
        motion: Motion,
        ribbon: Vector,
        triangles: NDArray[np.intp],
    ) -> None:
        """Log what stands in the scene besides arms and sheet; ``ribbon``: the sheet's vertices."""

    def places(self, result: RunRecord) -> tuple[Vector, Vector]:
        """Return where the bending frames are to be and were sent (rows, 4): x, y, z [m], yaw."""
        nowhere = np.zeros((result.trace.rows, 4))
        return nowhere, nowhere

    def views(self, result: RunRecord) -> Views:
        """Return the viewer's scenes."""
        height, length = result.scenario.cell.sheet_height_m, result.scenario.sheet.length_m
        return Views(
            top=[
                view("Cell", [0.0, -1.75, height + 0.4], [0.0, 0.0, height - 0.1]),
                gripper_view(result),
            ],
            near=view(
                "Sheet",
                [0.0, -1.2 * length, height + 0.5 * length],
                [0.0, 0.0, height + 0.18 * length],
            ),
            lane=rrb.StateTimelineView(origin="phase", name="Phase"),
            shares=[4.0, 3.6, 0.9],
        )

    def predictable(self, result: RunRecord, rows: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return those of the rows in which the sheet is an elastic rod between two grips."""
        del result
        return rows

    def pose_others(
        self, model: mujoco.MjModel, data: mujoco.MjData, result: RunRecord, row: int
    ) -> None:
        """Pose what the row's positions do not; ``data.qpos`` may be changed."""

    def close_up(self, result: RunRecord, row: int) -> tuple[mujoco.MjvCamera, str] | None:
        """Return the camera and the caption of a picture's inset; None: there is none."""
        del result, row
        return None


PLAIN = Layers()


def layers_of(result: RunRecord) -> Layers:
    """Return the layers of the run's task."""
    found: Layers = result.task.part("recording")
    return found


def gripper_view(result: RunRecord) -> rrb.Spatial3DView:
    """Return the close-up of the gripper that senses, from a camera that moves with it."""
    side = result.sensing_side
    front = -1.0 if side == "left" else 1.0
    return view(
        f"{side.capitalize()} gripper, close up",
        [0.10, 0.26 * front, 0.13],
        [0.02, 0.0, 0.0],
        "/cell/**",
        origin=f"cell/grip/{side}_actual",
    )


def view(
    name: str,
    eye: list[float],
    target: list[float],
    contents: str | list[str] = "$origin/**",
    origin: str = "cell",
) -> rrb.Spatial3DView:
    """Return a view of the scene from a point towards another [m]."""
    return rrb.Spatial3DView(
        origin=origin,
        contents=contents,
        name=name,
        line_grid=False,
        eye_controls=rrb.EyeControls3D(position=eye, look_target=target, eye_up=[0, 0, 1]),
    )
