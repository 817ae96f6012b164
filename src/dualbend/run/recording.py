"""The recording of a run in 3D and over time: one self-contained file for the rerun viewer.

Everything is written after the run, as columns: one call an entity, however many rows. Shapes are
logged once a body; a cycle adds only the poses of what moves against its parent body.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dualbend.control.alter import COMMAND_PERIOD_S
from dualbend.run.runner import RunResult
from dualbend.scene import arm
from dualbend.scene.cell import SIDES
from dualbend.scene.sheet import LEFT_END, RIGHT_END, strip_body
from dualbend.task.bending import PHASES

Vector = NDArray[np.float64]
Colours = NDArray[np.uint8]

TIMELINE = "sim_time"
"""Name of the only timeline: simulated time since the start of the run."""

_STILL = 1e-6
"""What moves less than this against its parent [m, 1] in the whole run is logged once."""

_DECIMALS, _SHEET_DECIMALS = 6, 5
"""Places are rounded to 1 µm, the sheet's to 10 µm: what rests is then the same in every row, and
compresses away."""

_LONGEST_ARROW_M = 0.25
_VISUAL_GROUP = 2
_NICE = np.outer(10.0 ** np.arange(-9, 10), [1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0]).ravel()

# Diverging map by K. Moreland, ISVC 2009: blue, grey, red at -1, 0, 1.
_MAP_STOPS = (-1.0, -0.5, 0.0, 0.5, 1.0)
_MAP_CHANNELS = ((59, 141, 221, 244, 180), (76, 176, 221, 152, 4), (192, 254, 221, 122, 38))

_WHITE, _BLUE, _ORANGE, _GREY = [240, 240, 240], [70, 180, 255], [255, 165, 60], [130, 130, 130]
_SIDE_COLOURS = {"left": (_BLUE, [60, 110, 150]), "right": (_ORANGE, [150, 105, 55])}
_FORCE_COLOUR, _MOMENT_COLOUR, _PATH_COLOUR = [255, 193, 7], [224, 64, 251], [0, 230, 118]
_STATE_COLOURS = {
    "settle": 0x78909CFF,
    "bend": 0x42A5F5FF,
    "hold": 0x7E57C2FF,
    "completed": 0x4CAF50FF,
    "protective stop": 0xFFB300FF,
    "failed": 0xEF5350FF,
}


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
    stream.save(path, default_blueprint=_layout(result))
    try:
        stream.send_recording_name(name)
        times = np.rint(1e9 * result.trace["time"]).astype("timedelta64[ns]")
        log, scales, motion = _Log(stream, times), _Scales.of(result), _forward(result)
        log.once("scenario", rr.TextDocument(toml))
        log.once("outcome", rr.TextDocument(_story(result, scales), media_type="text/markdown"))
        _log_robots(log, result.model, motion)
        _log_sheet(log, result, motion, scales)
        _log_grips(log, result, scales)
        _log_series(log, result)
        _log_phases(log, result)
    finally:
        stream.disconnect()


@dataclass(frozen=True)
class _Log:
    """A stream and the times of the trace's rows."""

    stream: rr.RecordingStream
    times: NDArray[np.timedelta64]

    def once(self, entity: str, *archetypes: rr.AsComponents) -> None:
        self.stream.log(entity, *archetypes, static=True)

    def rows(self, entity: str, archetype: type[rr.AsComponents], **values: NDArray[Any]) -> None:
        """Log (rows, ...) or (rows, instances, ...) values, without the rows that hold a NaN."""
        finite = np.ones(len(self.times), dtype=bool)
        for value in values.values():
            finite &= np.isfinite(value).all(axis=tuple(range(1, value.ndim)))
        kept = {key: value[finite] for key, value in values.items()}
        several = [value.shape[1] for value in values.values() if value.ndim == 3]
        if several:
            kept = {key: value.reshape(-1, value.shape[-1]) for key, value in kept.items()}
        columns = archetype.columns(**kept)
        if several:
            columns = columns.partition(np.full(finite.sum(), several[0]))
        self.send(entity, self.times[finite], columns)

    def send(
        self, entity: str, times: NDArray[np.timedelta64], columns: rr.ComponentColumnList
    ) -> None:
        if len(times):
            index = rr.TimeColumn(TIMELINE, duration=times)
            self.stream.send_columns(entity, indexes=[index], columns=columns)

    def lines(self, entity: str, *series: tuple[str, Vector, list[int], float]) -> None:
        """Log series of one entity, each with its name, values, colour and width in points."""
        names, values, colours, widths = zip(*series, strict=True)
        self.once(entity, rr.SeriesLines(names=names, colors=colours, widths=widths))
        self.rows(entity, rr.Scalars, scalars=np.stack(values, axis=1))


@dataclass(frozen=True, kw_only=True)
class _Scales:
    """What a colour and an arrow's length stand for, the same through a run."""

    moment_range_n_m: float
    force_m_per_n: float
    torque_m_per_n_m: float

    @classmethod
    def of(cls, result: RunResult) -> _Scales:
        """Return round scales that hold the run's largest values."""
        trace = result.trace
        force, torque = (
            np.abs([trace[f"{s}_true_{kind}_{a}"] for s in SIDES for a in "xyz"]).max(initial=1e-6)
            for kind in ("force", "moment")
        )
        peak = result.bend_stiffness * np.abs(trace.bends).max(initial=1e-6)
        return cls(
            moment_range_n_m=float(_NICE[0.999 * peak <= _NICE].min()),
            force_m_per_n=float(_NICE[_LONGEST_ARROW_M / force >= _NICE].max()),
            torque_m_per_n_m=float(_NICE[_LONGEST_ARROW_M / torque >= _NICE].max()),
        )


@dataclass(frozen=True, kw_only=True)
class _Motion:
    """Places (rows, n, 3), orientations (rows, n, 4; w first) of bodies; places of the two ends."""

    place: Vector
    quaternion: Vector
    ends: Vector


def _forward(result: RunResult) -> _Motion:
    model, qpos = result.model, result.trace.qpos
    data, rows = mujoco.MjData(model), len(qpos)
    place, quaternion = np.empty((rows, model.nbody, 3)), np.empty((rows, model.nbody, 4))
    ends, sites = np.empty((rows, 2, 3)), [model.site(name).id for name in (LEFT_END, RIGHT_END)]
    for row, q in enumerate(qpos):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        place[row], quaternion[row], ends[row] = data.xpos, data.xquat, data.site_xpos[sites]
    return _Motion(place=place, quaternion=quaternion, ends=ends)


def _log_robots(log: _Log, model: mujoco.MjModel, motion: _Motion) -> None:
    """Log floor, arms and tools; entities nest as bodies do, so that most poses never change."""
    floor = rr.Boxes3D(
        half_sizes=[1.5, 0.9, 0.01], centers=[0, 0, -0.011], colors=[74, 78, 84], fill_mode="solid"
    )
    log.once("cell", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    log.once("cell/floor", floor)
    turns = Rotation.from_quat(motion.quaternion.reshape(-1, 4), scalar_first=True)
    turn_of = [turns[body :: model.nbody] for body in range(model.nbody)] if len(turns) else []
    entity = {0: "cell"}
    for body in range(1, model.nbody):
        name, parent = model.body(body).name, int(model.body_parentid[body])
        shapes = _shapes(model, body)
        if not shapes or not name.startswith(SIDES):
            continue
        entity[body] = f"{entity[parent]}/{name}"
        if not turn_of:
            log.once(entity[body], *shapes)
            continue
        back = turn_of[parent].inv()
        place = back.apply(motion.place[:, body] - motion.place[:, parent]).round(_DECIMALS)
        quaternion = (back * turn_of[body]).as_quat(canonical=True)
        if max(np.ptp(place, axis=0).max(), np.ptp(quaternion, axis=0).max()) <= _STILL:
            pose = rr.Transform3D(
                translation=place[0], quaternion=rr.Quaternion(xyzw=quaternion[0])
            )
            log.once(entity[body], *shapes, pose)
        else:
            log.once(entity[body], *shapes)
            log.rows(entity[body], rr.Transform3D, translation=place, quaternion=quaternion)


def _shapes(model: mujoco.MjModel, body: int) -> list[Any]:
    """Return the visual shapes of one body, one archetype a kind."""
    mine = (model.geom_bodyid == body) & (model.geom_group == _VISUAL_GROUP)
    shapes = []
    for kind in np.unique(model.geom_type[mine]):
        which = np.flatnonzero(mine & (model.geom_type == kind))
        size, place = model.geom_size[which], model.geom_pos[which]
        quaternion, material = model.geom_quat[which][:, [1, 2, 3, 0]], model.geom_matid[which]
        plain = material[:, None] < 0
        rgba = np.where(plain, model.geom_rgba[which], model.mat_rgba[material])
        look = {"quaternions": quaternion, "colors": rgba, "fill_mode": "solid"}
        round_ = {"radii": size[:, 0], "lengths": 2.0 * size[:, 1]}
        match mujoco.mjtGeom(kind):
            case mujoco.mjtGeom.mjGEOM_BOX:
                shapes.append(rr.Boxes3D(half_sizes=size, centers=place, **look))
            case mujoco.mjtGeom.mjGEOM_SPHERE:
                shapes.append(rr.Ellipsoids3D(radii=size[:, 0], centers=place, **look))
            case mujoco.mjtGeom.mjGEOM_ELLIPSOID:
                shapes.append(rr.Ellipsoids3D(half_sizes=size, centers=place, **look))
            case mujoco.mjtGeom.mjGEOM_CYLINDER:
                shapes.append(rr.Cylinders3D(centers=place, **round_, **look))
            case mujoco.mjtGeom.mjGEOM_CAPSULE:
                # A capsule stands on its place in rerun and has its middle there in MuJoCo.
                foot = Rotation.from_quat(quaternion).apply([0.0, 0.0, 1.0]) * -size[:, 1:2]
                shapes.append(rr.Capsules3D(translations=place + foot, **round_, **look))
            case other:
                raise NotImplementedError(f"a visual geom of type {other.name} in the recording")
    return shapes


def diverging_colours(values: Vector) -> Colours:
    """Return red, green, blue (..., 3) for values from -1 (blue) through 0 (grey) to 1 (red)."""
    channels = [np.interp(values, _MAP_STOPS, channel) for channel in _MAP_CHANNELS]
    return np.rint(np.stack(channels, axis=-1)).astype(np.uint8)


def _log_sheet(log: _Log, result: RunResult, motion: _Motion, scales: _Scales) -> None:
    """Log the sheet as one ribbon through the hinge lines, coloured by the bending moment there."""
    hinges = result.trace.bends.shape[1]
    strips = [result.model.body(strip_body(i)).id for i in range(hinges + 1)]
    # The middle strip's frame is at its centre, that of every other at its hinge.
    hinged = strips[: hinges // 2] + strips[hinges // 2 + 1 :]
    left, right = motion.ends[:, :1], motion.ends[:, 1:]
    places = np.concatenate((left, motion.place[:, hinged], right), axis=1)
    w, x, y, z = np.moveaxis(motion.quaternion[:, [hinged[0], *hinged, hinged[-1]]], -1, 0)
    y_axes = np.stack((2 * (x * y - w * z), w * w - x * x + y * y - z * z, 2 * (y * z + w * x)), -1)
    across = 0.5 * result.scenario.sheet.width_m * y_axes
    vertices = np.concatenate((places - across, places + across), axis=1).round(_SHEET_DECIMALS)

    moment = result.bend_stiffness * result.trace.bends
    ends = (
        1.5 * moment[:, [0, -1]] - 0.5 * moment[:, [1, -2]]
    )  # half a strip beyond the last hinges
    moment = np.concatenate((ends[:, :1], moment, ends[:, 1:]), axis=1)
    colours = np.tile(diverging_colours(moment / scales.moment_range_n_m), (1, 2, 1))

    lines = hinges + 2
    cell = np.array([[0, 1, lines], [1, lines + 1, lines]])
    triangles = (np.arange(lines - 1)[:, None, None] + cell).reshape(-1, 3)
    log.once("cell/sheet", rr.Mesh3D.from_fields(triangle_indices=triangles))
    log.rows("cell/sheet", rr.Mesh3D, vertex_positions=vertices, vertex_colors=colours)


def _log_grips(log: _Log, result: RunResult, scales: _Scales) -> None:
    """Log what the sheet does to the grips, where these are, and where they should be."""
    trace = result.trace
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        to_world = np.array([sign, sign, 1.0])  # from the arm's bending frame
        grip, force, moment = (
            np.stack([trace[f"{side}_{kind}_{a}"] for a in "xyz"], axis=1) * to_world
            for kind in ("grip", "true_force", "true_moment")
        )
        arrows = np.stack((scales.force_m_per_n * force, scales.torque_m_per_n_m * moment), axis=1)
        look = rr.Arrows3D.from_fields(colors=[_FORCE_COLOUR, _MOMENT_COLOUR], radii=0.004)
        log.once(f"cell/wrench/{side}", look)
        origins = np.stack((grip, grip), axis=1).round(_DECIMALS)
        log.rows(f"cell/wrench/{side}", rr.Arrows3D, origins=origins, vectors=arrows)

        still = np.zeros(trace.rows)
        nominal = (-trace["nominal_half_distance"], still, trace["nominal_z"])
        command = (trace[f"{side}_command_x"], still, trace[f"{side}_command_z"])
        lines = [np.stack(xyz, axis=1) * to_world for xyz in (nominal, command)]
        _log_frame(log, f"cell/grip/{side}_actual", 0.03, grip, trace[f"{side}_grip_alpha"], sign)
        angle = trace[f"{side}_command_alpha"]
        _log_frame(log, f"cell/grip/{side}_commanded", 0.045, lines[1], angle, sign)
        strips = [line[np.isfinite(line).all(axis=1)] for line in lines]
        drawn = rr.LineStrips3D(strips, colors=[_GREY, _PATH_COLOUR], radii=0.001)
        log.once(f"cell/path/{side}", drawn)


def _log_frame(
    log: _Log, entity: str, length_m: float, place: Vector, alpha: Vector, sign: float
) -> None:
    """Log a frame turned by R_y(α), for the right arm by R_z(π) R_y(α)."""
    c, s, none = np.cos(alpha / 2), np.sin(alpha / 2), np.zeros_like(alpha)
    turn = np.stack((none, s, none, c) if sign > 0 else (-s, none, c, none), axis=1)
    log.once(entity, rr.TransformAxes3D(length_m))
    log.rows(entity, rr.Transform3D, translation=place.round(_DECIMALS), quaternion=turn)


def _log_series(log: _Log, result: RunResult) -> None:
    trace, sensing = result.trace, result.scenario.arms.sensing
    for quantity, column, unit in (("moment", "moment_y", "N m"), ("force", "force_x", "N")):
        truth = [
            (f"{side} true [{unit}]", trace[f"{side}_true_{column}"], colour, width)
            for side, colour, width in (("left", _WHITE, 2.5), ("right", [255, 220, 150], 1.0))
        ]
        log.lines(f"{quantity}/true", *truth)
        for side in sensing:
            bright, dull = _SIDE_COLOURS[side]
            measured, filtered = (
                trace[f"{side}_{kind}_{column}"] for kind in ("measured", "filtered")
            )
            log.lines(
                f"{quantity}/{side}",
                (f"{side} measured [{unit}]", measured, dull, 1.0),
                (f"{side} filtered [{unit}]", filtered, bright, 1.5),
            )
    angles, deviations = [("nominal [rad]", trace["nominal_alpha"], _GREY, 1.5)], []
    for side in SIDES:
        bright, dull = _SIDE_COLOURS[side]
        angles.append((f"{side} grip [rad]", trace[f"{side}_grip_alpha"], bright, 1.5))
        turn = np.degrees(trace[f"{side}_deviation_alpha"])
        deviations.append((f"{side} δx [mm]", 1e3 * trace[f"{side}_deviation_x"], bright, 1.5))
        deviations.append((f"{side} δα [deg]", turn, dull, 1.5))
        torques = np.stack([trace[f"{side}_torque_{joint}"] for joint in arm.JOINTS], axis=1)
        names = [f"{side} joint {i} [N m]" for i in range(1, len(arm.JOINTS) + 1)]
        log.once(f"torque/{side}", rr.SeriesLines(names=names))
        log.rows(f"torque/{side}", rr.Scalars, scalars=torques)
    log.lines("angle", *angles)
    log.lines("deviation", *deviations)
    log.lines(
        "ik",
        ("position [µm]", 1e6 * trace["ik_position"], _BLUE, 1.5),
        ("rotation [µrad]", 1e6 * trace["ik_rotation"], _ORANGE, 1.5),
    )


def _log_phases(log: _Log, result: RunResult) -> None:
    """Log when each phase began and, one cycle after the last row, how the run ended."""
    phase = result.trace["phase"].astype(int)
    starts = np.flatnonzero(np.diff(phase, prepend=-1))
    end = np.timedelta64(round(1e9 * COMMAND_PERIOD_S * len(phase)), "ns")
    states = [*(PHASES[phase[i]] for i in starts), _words(result.outcome)]
    look = rr.StateConfiguration(values=list(_STATE_COLOURS), colors=list(_STATE_COLOURS.values()))
    log.once("phase", look)
    log.send("phase", np.append(log.times[starts], end), rr.StateChange.columns(state=states))


def _words(outcome: str) -> str:
    return outcome.replace("_", " ")


def _story(result: RunResult, scales: _Scales) -> str:
    scenario, limit = result.scenario, f"{scales.moment_range_n_m:g}"
    reason = [f"**{result.reason}**\n"] if result.reason else []
    return "\n".join(
        (
            f"# {scenario.name}: {_words(result.outcome)}",
            *reason,
            scenario.description,
            f"\n{result.simulated_s:.3f} s in {result.trace.rows} cycles, seed {scenario.seed}\n",
            f"* sheet: bending moment, −{limit} N m blue, 0 grey, +{limit} N m red",
            f"* yellow arrow: force of the sheet on the grip, {1e3 * scales.force_m_per_n:g} mm/N",
            f"* violet arrow: its moment about the grip, {scales.torque_m_per_n_m:g} mm/(N mm)",
            "* axes at the grip: short as it is, long as commanded",
            "* path of the grip: grey nominal, green commanded with compliance",
        )
    )


def _layout(result: RunResult) -> rrb.Blueprint:
    """Return the viewer's layout: the scene, phases and texts beside the plots."""
    height, length = result.scenario.cell.sheet_height_m, result.scenario.sheet.length_m
    cell, sheet = (
        rrb.Spatial3DView(
            origin="cell",
            name=name,
            line_grid=False,
            eye_controls=rrb.EyeControls3D(position=eye, look_target=target, eye_up=[0, 0, 1]),
        )
        for name, eye, target in (
            ("Cell", [0.0, -1.75, height + 0.4], [0.0, 0.0, height - 0.1]),
            (
                "Sheet",
                [0.0, -1.2 * length, height + 0.5 * length],
                [0.0, 0.0, height + 0.18 * length],
            ),
        )
    )
    # What ended a run is at the right of its plots; what a completed one shows is at the left.
    done = result.outcome == "completed"
    corner = rrb.Corner2D.RightTop if done else rrb.Corner2D.LeftTop
    titles = {
        "moment": "Moment about the bending axis, on the gripper",
        "force": "Horizontal force on the gripper",
        "deviation": "Deviation from the nominal path",
        "angle": "Bending angle",
        "ik": "IK residual",
        "torque": "Joint torque",
    }
    plots = [
        rrb.TimeSeriesView(origin=origin, name=title, plot_legend=corner)
        for origin, title in titles.items()
    ]
    lane = rrb.StateTimelineView(origin="phase", name="Phase")
    texts = rrb.Tabs(
        rrb.TextDocumentView(origin="outcome", name="Outcome"),
        rrb.TextDocumentView(origin="scenario", name="Scenario"),
    )
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(cell, rrb.Horizontal(sheet, texts), lane, row_shares=[5.0, 3.4, 1.0]),
            rrb.Vertical(*plots[:3], rrb.Tabs(*plots[3:])),
            column_shares=[3, 2],
        ),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed"),
        collapse_panels=True,
    )
