"""The recording of a run in 3D and over time: one self-contained file for the rerun viewer.

Everything is written after the run, as columns: one call an entity, whatever the number of rows. Geometry
is logged once a body; per cycle there are only the poses of what moved relative to its parent.
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
"""Bodies that move less than this against their parent [m, 1] in the whole run are logged once."""

_LONGEST_ARROW_M = 0.25
_VISUAL_GROUP = 2
_BLUE_GREY_RED = np.array([[59, 76, 192], [141, 176, 254], [221, 221, 221], [244, 152, 122], [180, 4, 38]])  # fmt: skip
"""Diverging colours from -1 to 1 at equal distances, after Moreland, ISVC 2009."""

_SERIES = {
    ("left", "measured"): ([95, 125, 150], 1.0),
    ("left", "filtered"): ([70, 180, 255], 1.5),
    ("left", "true"): ([240, 240, 240], 1.5),
    ("right", "measured"): ([150, 120, 85], 1.0),
    ("right", "filtered"): ([255, 165, 60], 1.5),
    ("right", "true"): ([250, 220, 160], 1.5),
}
_OUTCOME_COLOURS = {"completed": 0x4CAF50FF, "protective_stop": 0xFFB300FF, "failed": 0xEF5350FF}
_PHASE_COLOURS = (0x78909CFF, 0x42A5F5FF, 0x7E57C2FF)


def write_recording(result: RunResult, path: Path) -> None:
    """Write the run to ``path`` (``.rrd``), with the layout in which the viewer opens it.

    The scene is under ``/cell``, the series under ``/moment``, ``/force``, ``/deviation``, ``/angle``,
    ``/ik`` and ``/torque``, the texts in ``/scenario`` and ``/outcome``. Two recordings of one run
    hold the same data. Cells that a run left unfinished are left out.

    Raises
    ------
    OSError
        ``path`` cannot be written.
    """
    toml = result.scenario.to_toml()
    name = f"{result.scenario.name}, seed {result.scenario.seed}"
    digest = hashlib.sha256(toml.encode()).hexdigest()[:8]
    with path.open("wb"):  # rerun only warns about a path that it cannot write
        pass
    stream = rr.RecordingStream("dualbend", recording_id=f"{name}, {digest}", send_properties=False)
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    stream.save(path, default_blueprint=_layout(result))
    try:
        stream.send_recording_name(name)
        times_ns = np.rint(1e9 * result.trace["time"]).astype(np.int64)
        log = _Log(stream, times_ns.astype("timedelta64[ns]"))
        log.once("cell", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        log.once("scenario", rr.TextDocument(toml, media_type="text/plain"))
        scales = _Scales.of(result)
        log.once("outcome", rr.TextDocument(_story(result, scales), media_type="text/markdown"))
        motion = _forward(result)
        _log_bodies(log, result.model, motion)
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

    def once(self, entity: str, *archetypes: Any) -> None:
        self.stream.log(entity, *archetypes, static=True)

    def rows(self, entity: str, archetype: Any, **values: Vector) -> None:
        """Log one instance a row; rows with a NaN are left out."""
        finite = np.ones(len(self.times), dtype=bool)
        for value in values.values():
            finite &= np.isfinite(value).reshape(len(value), -1).all(axis=1)
        self.send(
            entity,
            self.times[finite],
            archetype.columns(**{key: value[finite] for key, value in values.items()}),
        )

    def send(self, entity: str, times: NDArray[np.timedelta64], columns: Any) -> None:
        if len(times):
            index = rr.TimeColumn(TIMELINE, duration=times)
            self.stream.send_columns(entity, indexes=[index], columns=columns)


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
        force, moment = (
            np.linalg.norm([trace[f"{side}_true_{kind}_{a}"] for side in SIDES for a in "xyz"], axis=0)
            for kind in ("force", "moment")
        )  # fmt: skip
        peak = result.bend_stiffness * np.abs(trace.bends).max(initial=0.0)
        return cls(
            moment_range_n_m=1.0 / _round_down(1.0 / max(peak, 1e-6)),
            force_m_per_n=_round_down(_LONGEST_ARROW_M / max(force.max(initial=0.0), 1e-6)),
            torque_m_per_n_m=_round_down(_LONGEST_ARROW_M / max(moment.max(initial=0.0), 1e-6)),
        )


def _round_down(value: float) -> float:
    """Return the largest of 1, 2, 5 times a power of ten that is not above ``value``."""
    decade = 10.0 ** np.floor(np.log10(value))
    return float(decade * max(step for step in (1.0, 2.0, 5.0) if step * decade <= value * 1.0001))


@dataclass(frozen=True, kw_only=True)
class _Motion:
    """Places (rows, n, 3) and orientations (rows, n, 4, w first) of bodies; places of the sheet's ends."""

    position: Vector
    quaternion: Vector
    ends: Vector


def _forward(result: RunResult) -> _Motion:
    model, qpos = result.model, result.trace.qpos
    data = mujoco.MjData(model)
    position = np.empty((len(qpos), model.nbody, 3))
    quaternion = np.empty((len(qpos), model.nbody, 4))
    ends = np.empty((len(qpos), 2, 3))
    sites = [model.site(name).id for name in (LEFT_END, RIGHT_END)]
    for row, q in enumerate(qpos):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        position[row], quaternion[row], ends[row] = data.xpos, data.xquat, data.site_xpos[sites]
    return _Motion(position=position, quaternion=quaternion, ends=ends)


def _log_bodies(log: _Log, model: mujoco.MjModel, motion: _Motion) -> None:
    """Log floor, arms and tools; an entity's parent is the body's parent, so most poses never change."""
    log.once(
        "cell/floor",
        rr.Boxes3D(
            half_sizes=[[1.6, 1.0, 0.01]],
            centers=[[0.0, 0.0, -0.011]],
            colors=[[74, 78, 84]],
            fill_mode="solid",
        ),
    )
    entity = {0: "cell"}
    for body in range(1, model.nbody):
        name, parent = model.body(body).name, int(model.body_parentid[body])
        if not name.startswith(SIDES):
            continue
        entity[body] = f"{entity[parent]}/{name}"
        _log_geoms(log, entity[body], model, body)
        if not len(motion.position):
            continue
        frame = Rotation.from_quat(motion.quaternion[:, parent], scalar_first=True).inv()
        turn = frame * Rotation.from_quat(motion.quaternion[:, body], scalar_first=True)
        place = frame.apply(motion.position[:, body] - motion.position[:, parent])
        quaternion = turn.as_quat(canonical=True)
        if max(np.ptp(place, axis=0).max(), np.ptp(quaternion, axis=0).max()) < _STILL:
            log.once(
                entity[body],
                rr.Transform3D(translation=place[0], quaternion=rr.Quaternion(xyzw=quaternion[0])),
            )
        else:
            log.rows(entity[body], rr.Transform3D, translation=place, quaternion=quaternion)


def _log_geoms(log: _Log, entity: str, model: mujoco.MjModel, body: int) -> None:
    """Log the visual shapes of one body, all of a kind as one entity."""
    mine = (model.geom_bodyid == body) & (model.geom_group == _VISUAL_GROUP)
    for kind in np.unique(model.geom_type[mine]):
        which = np.flatnonzero(mine & (model.geom_type == kind))
        log.once(f"{entity}/{mujoco.mjtGeom(kind).name[6:].lower()}", _shapes(model, which, kind))


def _shapes(model: mujoco.MjModel, which: NDArray[np.int_], kind: int) -> Any:
    size, place = model.geom_size[which], model.geom_pos[which]
    quaternion = model.geom_quat[which][:, [1, 2, 3, 0]]
    material = model.geom_matid[which]
    rgba = np.where(material[:, None] >= 0, model.mat_rgba[material], model.geom_rgba[which])
    look = {"quaternions": quaternion, "colors": rgba, "fill_mode": "solid"}
    match mujoco.mjtGeom(kind):
        case mujoco.mjtGeom.mjGEOM_BOX:
            return rr.Boxes3D(half_sizes=size, centers=place, **look)
        case mujoco.mjtGeom.mjGEOM_CYLINDER:
            return rr.Cylinders3D(lengths=2 * size[:, 1], radii=size[:, 0], centers=place, **look)
        case mujoco.mjtGeom.mjGEOM_SPHERE:
            return rr.Ellipsoids3D(half_sizes=size[:, [0, 0, 0]], centers=place, **look)
        case mujoco.mjtGeom.mjGEOM_ELLIPSOID:
            return rr.Ellipsoids3D(half_sizes=size, centers=place, **look)
        case mujoco.mjtGeom.mjGEOM_CAPSULE:
            # rerun's capsule starts at its place, MuJoCo's has its middle there.
            axis = Rotation.from_quat(quaternion).apply([0.0, 0.0, 1.0])
            start = place - size[:, 1:2] * axis
            return rr.Capsules3D(lengths=2 * size[:, 1], radii=size[:, 0], translations=start, **look)
        case other:
            raise NotImplementedError(f"recording of a visual geom of type {other.name}")


def diverging_colours(values: Vector) -> Colours:
    """Return colours (..., 3) for values from -1 (blue) through 0 (grey) to 1 (red)."""
    stops = np.linspace(-1.0, 1.0, len(_BLUE_GREY_RED))
    channels = [np.interp(values, stops, channel) for channel in _BLUE_GREY_RED.T]
    return np.rint(np.stack(channels, axis=-1)).astype(np.uint8)


def _log_sheet(log: _Log, result: RunResult, motion: _Motion, scales: _Scales) -> None:
    """Log the sheet as one ribbon through the hinge lines, coloured by the bending moment there."""
    rows, hinges = result.trace.bends.shape
    lines = hinges + 2
    strips = [result.model.body(strip_body(i)).id for i in range(hinges + 1)]
    middle = hinges // 2
    # A strip's frame is at its hinge towards the middle; the middle strip itself has none.
    places = motion.position[:, strips[:middle] + strips[middle + 1 :]]
    places = np.concatenate((motion.ends[:, :1], places, motion.ends[:, 1:]), axis=1)
    turns = motion.quaternion[:, [strips[0], *strips[:middle], *strips[middle + 1 :], strips[-1]]]
    w, x, y, z = np.moveaxis(turns, -1, 0)
    across = np.stack((2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)), axis=-1)
    half = 0.5 * result.scenario.sheet.width_m * across
    vertices = np.stack((places - half, places + half), axis=2)

    moment = result.bend_stiffness * result.trace.bends
    ends = 1.5 * moment[:, [0, -1]] - 0.5 * moment[:, [1, -2]]  # half a strip beyond the last hinges
    moment = np.concatenate((ends[:, :1], moment, ends[:, 1:]), axis=1)
    colours = np.repeat(diverging_colours(moment / scales.moment_range_n_m), 2, axis=1)

    first = 2 * np.arange(lines - 1)[:, None]
    triangles = np.concatenate((first + [0, 2, 1], first + [1, 2, 3]))
    log.once("cell/sheet", rr.Mesh3D.from_fields(triangle_indices=triangles))
    columns = rr.Mesh3D.columns(
        vertex_positions=vertices.reshape(-1, 3), vertex_colors=colours.reshape(-1, 3)
    )
    log.send("cell/sheet", log.times, columns.partition([2 * lines] * rows))


def _log_grips(log: _Log, result: RunResult, scales: _Scales) -> None:
    """Log what the sheet does to the grips, where they are, where they should be."""
    trace = result.trace
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        turn = np.array([sign, sign, 1.0])  # from the arm's bending frame to the world
        grip = np.stack([trace[f"{side}_grip_{a}"] for a in "xyz"], axis=1) * turn
        for kind, scale, colour in (
            ("force", scales.force_m_per_n, [255, 193, 7]),
            ("moment", scales.torque_m_per_n_m, [224, 64, 251]),
        ):
            vector = np.stack([trace[f"{side}_true_{kind}_{a}"] for a in "xyz"], axis=1) * turn
            entity = f"cell/wrench/{side}_{kind}"
            log.once(entity, rr.Arrows3D.from_fields(colors=[colour], radii=[0.004]))
            log.rows(entity, rr.Arrows3D, origins=grip, vectors=scale * vector)

        nominal = _planar(-trace["nominal_half_distance"], trace["nominal_z"], sign)
        command = _planar(trace[f"{side}_command_x"], trace[f"{side}_command_z"], sign)
        for kind, place, angle, length in (
            ("actual", grip, trace[f"{side}_grip_alpha"], 0.06),
            ("commanded", command, trace[f"{side}_command_alpha"], 0.09),
        ):
            entity = f"cell/grip/{side}_{kind}"
            log.once(entity, rr.TransformAxes3D(length))
            log.rows(entity, rr.Transform3D, translation=place, quaternion=_tilt(angle, sign))
        for kind, line, colour in (
            ("nominal", nominal, [150, 150, 150]),
            ("commanded", command, [0, 230, 118]),
        ):
            log.once(
                f"cell/path/{side}_{kind}",
                rr.LineStrips3D([line[np.isfinite(line).all(axis=1)]], colors=[colour], radii=[0.001]),
            )  # fmt: skip


def _planar(x: Vector, z: Vector, sign: float) -> Vector:
    return np.stack((sign * x, np.zeros_like(x), z), axis=1)


def _tilt(alpha: Vector, sign: float) -> Vector:
    """Return R_y(α), for the right arm R_z(π) R_y(α), as quaternions (n, 4), w last."""
    c, s, none = np.cos(alpha / 2), np.sin(alpha / 2), np.zeros_like(alpha)
    return np.stack((none, s, none, c) if sign > 0 else (-s, none, c, none), axis=1)


def _log_series(log: _Log, result: RunResult) -> None:
    trace = result.trace
    named = {name for name, _ in trace.columns}
    for quantity, column, unit in (("moment", "moment_y", "N m"), ("force", "force_x", "N")):
        for (side, kind), (colour, width) in _SERIES.items():
            if f"{side}_{kind}_{column}" in named:
                values = trace[f"{side}_{kind}_{column}"]
                label = f"{side} {kind} [{unit}]"
                _log_line(log, f"{quantity}/{side}_{kind}", label, values, colour, width)
    for side in SIDES:
        colour = _SERIES[side, "filtered"][0]
        millimetres = 1e3 * trace[f"{side}_deviation_x"]
        degrees = np.degrees(trace[f"{side}_deviation_alpha"])
        _log_line(log, f"deviation/{side}_x", f"{side} δx [mm]", millimetres, colour)
        pale = _SERIES[side, "true"][0]
        _log_line(log, f"deviation/{side}_alpha", f"{side} δα [deg]", degrees, pale)
        _log_line(
            log, f"angle/{side}", f"{side} grip [rad]", trace[f"{side}_grip_alpha"], colour
        )
        torques = np.stack([trace[f"{side}_torque_{joint}"] for joint in arm.JOINTS], axis=1)
        labels = [f"{side} joint {i + 1} [N m]" for i in range(len(arm.JOINTS))]
        log.once(f"torque/{side}", rr.SeriesLines(names=labels))
        log.rows(f"torque/{side}", rr.Scalars, scalars=torques)
    _log_line(log, "angle/nominal", "nominal [rad]", trace["nominal_alpha"], [150, 150, 150])
    _log_line(log, "ik/position", "position [µm]", 1e6 * trace["ik_position"], [70, 180, 255])
    _log_line(log, "ik/rotation", "rotation [µrad]", 1e6 * trace["ik_rotation"], [255, 165, 60])


def _log_line(
    log: _Log, entity: str, label: str, values: Vector, colour: list[int], width: float = 1.5
) -> None:
    log.once(entity, rr.SeriesLines(names=label, colors=[colour], widths=[width]))
    log.rows(entity, rr.Scalars, scalars=values)


def _log_phases(log: _Log, result: RunResult) -> None:
    """Log when each phase began, and how the run ended one cycle after its last row."""
    phase = result.trace["phase"].astype(int)
    starts = np.flatnonzero(np.diff(phase, prepend=-1))
    end = np.timedelta64(round(1e9 * COMMAND_PERIOD_S * len(phase)), "ns")
    ended = result.outcome.replace("_", " ")
    colours = {name.replace("_", " "): value for name, value in _OUTCOME_COLOURS.items()}
    colours |= dict(zip(PHASES, _PHASE_COLOURS, strict=True))
    log.once("phase", rr.StateConfiguration(values=list(colours), colors=list(colours.values())))
    states = [*(PHASES[phase[i]] for i in starts), ended]
    log.send("phase", np.append(log.times[starts], end), rr.StateChange.columns(state=states))


def _story(result: RunResult, scales: _Scales) -> str:
    scenario, outcome = result.scenario, result.outcome.replace("_", " ")
    return "\n".join(
        (
            f"# {scenario.name}: {outcome}",
            *([f"**{result.reason}**", ""] if result.reason else []),
            scenario.description,
            "",
            f"{result.simulated_s:.3f} s simulated, {result.trace.rows} command cycles, seed {scenario.seed}",
            "",
            f"* Sheet: bending moment from −{scales.moment_range_n_m:g} (blue) through 0 (grey) "
            f"to +{scales.moment_range_n_m:g} N m (red)",
            f"* Yellow arrow: force of the sheet on the gripper, 1 N is {1e3 * scales.force_m_per_n:g} mm",
            f"* Violet arrow: its moment, 0.01 N m is {10 * scales.torque_m_per_n_m:g} mm",
            "* Short axes: the grip as it is; long axes: as commanded",
            "* Grey line: nominal path of the grip; green line: commanded path, with compliance",
        )
    )


def _layout(result: RunResult) -> rrb.Blueprint:
    height = result.scenario.cell.sheet_height_m
    scene = rrb.Spatial3DView(
        origin="cell",
        name="Cell",
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            position=[0.0, -2.1, height + 0.55], look_target=[0.0, 0.0, height - 0.02], eye_up=[0, 0, 1]
        ),
    )  # fmt: skip
    plots = [
        rrb.TimeSeriesView(origin=origin, name=name)
        for origin, name in (
            ("moment", "Moment about the bending axis, on the gripper"),
            ("force", "Horizontal force on the gripper"),
            ("deviation", "Deviation from the nominal path"),
        )
    ]
    more = [
        rrb.TimeSeriesView(origin=origin, name=name)
        for origin, name in (
            ("angle", "Bending angle"),
            ("ik", "IK residual"),
            ("torque", "Joint torque"),
        )
    ]
    texts = rrb.Tabs(
        rrb.TextDocumentView(origin="outcome", name="Outcome"),
        rrb.TextDocumentView(origin="scenario", name="Scenario"),
    )
    lane = rrb.StateTimelineView(origin="phase", name="Phase")
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(scene, lane, texts, row_shares=[6, 1.2, 2.4]),
            rrb.Vertical(*plots, rrb.Tabs(*more)),
            column_shares=[3, 2],
        ),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed"),
        collapse_panels=True,
    )
