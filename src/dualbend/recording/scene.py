"""The recording's scene in 3D: arms and tools, the sheet and its moment, grips and wrenches.

Shapes are logged once a body; a frame adds only the poses of what moves against its parent body.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import rerun as rr
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dualbend.arm.mjcf import GRIP_SITE
from dualbend.recording.assembly import carried, log_holes, log_laid, places
from dualbend.recording.log import FRAME_CYCLES, RecordingLog
from dualbend.recording.scales import Scales, diverging_colours
from dualbend.run.loop import RunResult
from dualbend.run.permanent_set import hinge_moments
from dualbend.run.trace import Trace
from dualbend.scene.bed.config import HOLES
from dualbend.scene.sheet.shell import ShellConfig, vertex_body
from dualbend.scene.sheet.strips import LEFT_END, RIGHT_END, strip_body
from dualbend.types import SIDES, Vector

NOMINAL_COLOUR = [130, 130, 130]
"""Grey: what is nominal, in the scene and in the plots."""

_FORCE_COLOUR, _MOMENT_COLOUR, _COMMAND_COLOUR = [255, 193, 7], [224, 64, 251], [0, 230, 118]

_STILL = 1e-6
"""What moves less than this against its parent [m, 1] in the whole run is logged once."""

_DECIMALS, _SHEET_DECIMALS = 6, 5
"""Places are rounded to 1 µm, the sheet's to 10 µm: what rests is then the same in every row, and
compresses away."""

CLEAR_OF_JAWS_M = (0.025, 0.0, 0.015)
"""From the grip to the force's arrow, towards the other arm and up: jaws and sheet hide less."""

_VISUAL_GROUP = 2

_NONE: Mapping[int, tuple[Vector, Rotation]] = {}


@dataclass(frozen=True, kw_only=True)
class _Motion:
    """Places (rows, n, 3), orientations (rows, n, 4; w first) of bodies; places of the two ends."""

    place: Vector
    quaternion: Vector
    ends: Vector


def log_scene(log: RecordingLog, result: RunResult, scales: Scales) -> None:
    """Log everything under ``/cell``, in the world frame and metres.

    Raises
    ------
    NotImplementedError
        A visual geom of the model is of a type that the recording has no shape for.
    """
    motion = _forward(result)
    log.once("cell", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    _log_robots(log, result.model, motion)
    ribbon = _ribbon(result, motion).round(_SHEET_DECIMALS)
    triangles = _triangles(ribbon.shape[1] // 2)
    _log_sheet(log, result, ribbon, triangles, scales)
    assembly = result.scenario.assembly is not None
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        _log_wrench(log, result.trace, side, sign, scales)
        if assembly:
            place, turn = _sites(result.model, motion, [f"{side}_{GRIP_SITE}"])
            _log_axes(log, f"cell/grip/{side}_actual", 0.03, place[:, 0], turn[:, 0])
        else:
            _log_grip(log, result.trace, side, sign)
        _, (path, turned) = _ways(result, side, sign)
        _log_axes(log, f"cell/grip/{side}_commanded", 0.045, path, turned)
    if assembly:
        _log_workplace(log, result.model)
        log_holes(log, result, *_sites(result.model, motion, [f"hole_{hole}" for hole in HOLES]))
        log_laid(log, result, ribbon, triangles)


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


def _log_robots(log: RecordingLog, model: mujoco.MjModel, motion: _Motion) -> None:
    """Log floor, arms and tools; entities nest as bodies do, so that most poses never change."""
    floor = rr.Boxes3D(
        half_sizes=[1.5, 0.9, 0.01], centers=[0, 0, -0.011], colors=[74, 78, 84], fill_mode="solid"
    )
    log.once("cell/floor", floor)
    entity, carrier = {0: "cell"}, _carriers(log, model, motion)
    for body in np.flatnonzero(carrier == np.arange(model.nbody)).tolist():
        name, parent = model.body(body).name, int(carrier[model.body_parentid[body]])
        fixed = [i for i in np.flatnonzero(carrier == body).tolist() if i != body]
        shapes = _shapes(model, body, {i: _fixed_pose(model, motion, i, body) for i in fixed})
        if shapes and body and name.startswith(SIDES):
            # Below its base a body is called link1, not left_link1: paths are most of an index.
            short = name.removeprefix("left_").removeprefix("right_")
            entity[body] = f"{entity[parent]}/{name if parent == 0 else short}"
            _log_body(log, entity[body], shapes, *_rows_of_pose(motion, body, parent))


def _carriers(log: RecordingLog, model: mujoco.MjModel, motion: _Motion) -> NDArray[np.intp]:
    """Return the body whose entity shows each body (bodies,): fewer entities, a smaller file.

    What is screwed to a robot's link, or rests on it in the whole run, is shown with it; a body
    with a mesh, and what stands on the floor, is its own.
    """
    meshes = model.geom_bodyid[model.geom_type == mujoco.mjtGeom.mjGEOM_MESH]
    carrier: NDArray[np.intp] = np.arange(model.nbody)
    for body in range(1, model.nbody):
        parent = int(model.body_parentid[body])
        if parent == 0 or body in meshes or not model.body(body).name.startswith(SIDES):
            continue
        screwed = not model.body_dofnum[body]
        if screwed or (not log.live and _rests(*_rows_of_pose(motion, body, parent))):
            carrier[body] = carrier[parent]
    return carrier


def _rests(place: Vector, quaternion: Vector) -> bool:
    both = np.concatenate((place, quaternion), axis=1)
    return len(both) > 0 and bool(np.ptp(both, axis=0).max() <= _STILL)


def _fixed_pose(
    model: mujoco.MjModel, motion: _Motion, body: int, carrier: int
) -> tuple[Vector, Rotation]:
    """Return place (3,) and orientation of a body that rests on its carrier."""
    if len(motion.place):
        place, quaternion = _rows_of_pose(motion, body, carrier)
        return place[0], Rotation.from_quat(quaternion[0])
    place, turn = np.zeros(3), Rotation.identity()
    while body != carrier:
        own = Rotation.from_quat(model.body_quat[body], scalar_first=True)
        place, turn = model.body_pos[body] + own.apply(place), own * turn
        body = int(model.body_parentid[body])
    return place, turn


def _log_workplace(log: RecordingLog, model: mujoco.MjModel) -> None:
    """Log bed, stand and pins, which do not move."""
    log.once("cell/workplace", *_shapes(model, 0))
    for hole in HOLES:
        body = model.body(f"pin_{hole}")
        pose = rr.Transform3D(translation=body.pos, quaternion=body.quat[[1, 2, 3, 0]])
        log.once(f"cell/pin/{hole}", *_shapes(model, body.id), pose)


def _rows_of_pose(motion: _Motion, body: int, parent: int) -> tuple[Vector, Vector]:
    """Return a body's places (rows, 3) and orientations (rows, 4; w last) in its parent body."""
    turn, base = (
        Rotation.from_quat(motion.quaternion[:, i], scalar_first=True) for i in (body, parent)
    )
    back = base.inv()
    place = back.apply(motion.place[:, body] - motion.place[:, parent])
    return place.round(_DECIMALS), (back * turn).as_quat(canonical=True).round(_DECIMALS)


def _log_body(
    log: RecordingLog, entity: str, shapes: list[Any], place: Vector, quaternion: Vector
) -> None:
    """Log a body's shapes and its pose in its parent body, the pose only once where it rests."""
    if not log.live and _rests(place, quaternion):
        turned = rr.Quaternion(xyzw=quaternion[0])
        log.once(entity, *shapes, rr.Transform3D(translation=place[0], quaternion=turned))
    else:
        log.once(entity, *shapes)
        log.frames(entity, rr.Transform3D, translation=place, quaternion=quaternion)


def _shapes(
    model: mujoco.MjModel, body: int, fixed: Mapping[int, tuple[Vector, Rotation]] = _NONE
) -> list[Any]:
    """Return the visual shapes of one body and of those fixed to it, one archetype a kind."""
    mine = np.isin(model.geom_bodyid, (body, *fixed)) & (model.geom_group == _VISUAL_GROUP)
    shapes = []
    for kind in np.unique(model.geom_type[mine]):
        which = np.flatnonzero(mine & (model.geom_type == kind))
        size, material = model.geom_size[which], model.geom_matid[which]
        place, quaternion = _poses_of_geoms(model, which, fixed)
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
            case mujoco.mjtGeom.mjGEOM_MESH:
                shapes.append(_mesh(model, which.tolist(), rgba))
            case other:
                raise NotImplementedError(f"a visual geom of type {other.name} in the recording")
    return shapes


def _poses_of_geoms(
    model: mujoco.MjModel,
    geoms: NDArray[np.intp],
    fixed: Mapping[int, tuple[Vector, Rotation]],
) -> tuple[Vector, Vector]:
    """Return places (n, 3) and orientations (n, 4; w last), of a fixed body's in its carrier."""
    place, quaternion = model.geom_pos[geoms].copy(), model.geom_quat[geoms][:, [1, 2, 3, 0]]
    for i, body in enumerate(model.geom_bodyid[geoms].tolist()):
        if body in fixed:
            origin, turn = fixed[body]
            place[i] = origin + turn.apply(place[i])
            quaternion[i] = (turn * Rotation.from_quat(quaternion[i])).as_quat(canonical=True)
    return place, quaternion


def _mesh(model: mujoco.MjModel, geoms: list[int], rgba: Vector) -> rr.Mesh3D:
    """Return a body's mesh geoms as one, in its frame, each triangle with its own three vertices.

    An entity holds one mesh: several colours are those of its vertices.
    """
    corners = [_corners(model, geom) for geom in geoms]
    if len(geoms) == 1:
        return rr.Mesh3D(vertex_positions=corners[0], albedo_factor=rgba[0])
    colours = np.repeat(rgba, [len(each) for each in corners], axis=0)
    return rr.Mesh3D(vertex_positions=np.concatenate(corners), vertex_colors=colours)


def _corners(model: mujoco.MjModel, geom: int) -> Vector:
    mesh = int(model.geom_dataid[geom])
    vertices, faces = (
        array[start : start + count]
        for array, start, count in (
            (model.mesh_vert, model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]),
            (model.mesh_face, model.mesh_faceadr[mesh], model.mesh_facenum[mesh]),
        )
    )
    turn = Rotation.from_quat(model.geom_quat[geom], scalar_first=True)
    return np.asarray((turn.apply(vertices) + model.geom_pos[geom])[faces.ravel()])


def _log_sheet(
    log: RecordingLog,
    result: RunResult,
    ribbon: Vector,
    triangles: NDArray[np.intp],
    scales: Scales,
) -> None:
    """Log the sheet as one ribbon through the hinge lines, coloured by the bending moment there."""
    moment = hinge_moments(result)
    # Half a strip beyond the last hinges.
    ends = 1.5 * moment[:, [0, -1]] - 0.5 * moment[:, [1, -2]]
    moment = np.concatenate((ends[:, :1], moment, ends[:, 1:]), axis=1)
    colours = np.tile(diverging_colours(moment / scales.moment_range_n_m), (1, 2, 1))
    log.once("cell/sheet", rr.Mesh3D.from_fields(triangle_indices=triangles))
    log.frames("cell/sheet", rr.Mesh3D, vertex_positions=ribbon, vertex_colors=colours)


def _triangles(lines: int) -> NDArray[np.intp]:
    """Return the triangles (n, 3) between two edges of ``lines`` vertices each."""
    cell = np.array([[0, 1, lines], [1, lines + 1, lines]])
    each: NDArray[np.intp] = np.arange(lines - 1)[:, None, None] + cell
    return each.reshape(-1, 3)


def _ribbon(result: RunResult, motion: _Motion) -> Vector:
    """Return the sheet's two long edges, one after the other (rows, 2 (hinges + 2), 3)."""
    config = result.scenario.sheet.model
    if isinstance(config, ShellConfig):
        return _shell_ribbon(result, config, motion)
    hinges = result.trace.bends.shape[1]
    strips = [result.model.body(strip_body(i)).id for i in range(hinges + 1)]
    # The middle strip's frame is at its centre, that of every other at its hinge.
    hinged = strips[: hinges // 2] + strips[hinges // 2 + 1 :]
    left, right = motion.ends[:, :1], motion.ends[:, 1:]
    places = np.concatenate((left, motion.place[:, hinged], right), axis=1)
    w, x, y, z = np.moveaxis(motion.quaternion[:, [hinged[0], *hinged, hinged[-1]]], -1, 0)
    y_axes = np.stack((2 * (x * y - w * z), w * w - x * x + y * y - z * z, 2 * (y * z + w * x)), -1)
    across = 0.5 * result.scenario.sheet.width_m * y_axes
    return np.concatenate((places - across, places + across), axis=1)


def _shell_ribbon(result: RunResult, shell: ShellConfig, motion: _Motion) -> Vector:
    """Return the same of a plate; the columns that the grips hold are on the way to the next."""
    edges = []
    for row in (0, shell.cells_across + 1):
        free = [result.model.body(vertex_body(i, row)).id for i in range(2, shell.cells_along)]
        inner = motion.place[:, free]
        sites = [result.model.site(name).id for name in (LEFT_END, RIGHT_END)]
        bodies = result.model.site_bodyid[sites]
        w, x, y, z = np.moveaxis(motion.quaternion[:, bodies], -1, 0)
        across = np.stack((2 * (x * y - w * z), w * w - x * x + y * y - z * z, 2 * (y * z + w * x)))
        side = 0.5 * result.scenario.sheet.width_m * np.array([1.0, -1.0])[:, None]
        ends = motion.ends + (-1.0 if row == 0 else 1.0) * side * np.moveaxis(across, 0, -1)
        left, right = ends[:, :1], ends[:, 1:]
        held = (2 * left + inner[:, :1]) / 3, (2 * right + inner[:, -1:]) / 3
        edges.append(np.concatenate((left, held[0], inner, held[1], right), axis=1))
    return np.concatenate(edges, axis=1)


def _in_world(trace: Trace, names: tuple[str, str, str], sign: float) -> Vector:
    """Return three columns of an arm's bending frame as vectors (rows, 3) of the world."""
    world: Vector = np.stack([trace[name] for name in names], axis=1) * np.array([sign, sign, 1.0])
    return world


def _log_wrench(log: RecordingLog, trace: Trace, side: str, sign: float, scales: Scales) -> None:
    """Log force and moment of the sheet on a grip, the force on the sheet's side of the gripper.

    A push ends before the grip and a pull starts there: behind it, the gripper would hide both.
    """
    grip, force, moment = (
        _in_world(trace, (f"{side}_{kind}_x", f"{side}_{kind}_y", f"{side}_{kind}_z"), sign)
        for kind in ("grip", "true_force", "true_moment")
    )
    force, moment = scales.force_m_per_n * force, scales.torque_m_per_n_m * moment
    beside = grip + np.array([sign, sign, 1.0]) * CLEAR_OF_JAWS_M
    start = np.where(sign * force[:, :1] < 0.0, beside - force, beside)
    origins = np.stack((start, grip), axis=1).round(_DECIMALS)
    look = rr.Arrows3D.from_fields(colors=[_FORCE_COLOUR, _MOMENT_COLOUR], radii=0.004)
    log.once(f"cell/wrench/{side}", look)
    vectors = np.stack((force, moment), axis=1)
    log.frames(f"cell/wrench/{side}", rr.Arrows3D, origins=origins, vectors=vectors)


def log_paths(log: RecordingLog, result: RunResult) -> None:
    """Log the nominal and commanded paths of the grips as they are so far, a point a frame."""
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        (nominal, _), (commanded, _) = _ways(result, side, sign)
        lines = [line[::FRAME_CYCLES] for line in (nominal, commanded)]
        strips = [line[np.isfinite(line).all(axis=1)] for line in lines]
        drawn = rr.LineStrips3D(strips, colors=[NOMINAL_COLOUR, _COMMAND_COLOUR], radii=0.001)
        log.replace(f"cell/path/{side}", drawn)


def _ways(
    result: RunResult, side: str, sign: float
) -> tuple[tuple[Vector, Vector], tuple[Vector, Vector]]:
    """Return places (rows, 3) and orientations (rows, 4) of a grip, nominal and as commanded."""
    trace = result.trace
    x, z, alpha = (trace[f"{side}_command_{axis}"] for axis in ("x", "z", "alpha"))
    if result.scenario.assembly is None:
        there = sent = np.zeros((trace.rows, 4))
    else:
        there = places(trace)
        sent = carried(trace, there, result.scenario.robot.alter.delay_cycles)
    height = trace["nominal_z"] - there[:, 2]
    nominal = (-trace["nominal_half_distance"], height, trace["nominal_alpha"])
    return _carry(there, nominal, sign), _carry(sent, (x, z, alpha), sign)


def _log_grip(log: RecordingLog, trace: Trace, side: str, sign: float) -> None:
    """Log where a grip is; its planar state is a frame turned by R_y(α), right by R_z(π) R_y(α)."""
    grip = _in_world(trace, (f"{side}_grip_x", f"{side}_grip_y", f"{side}_grip_z"), sign)
    flat = np.zeros((trace.rows, 4))
    _, turn = _carry(flat, (flat[:, 0], flat[:, 0], trace[f"{side}_grip_alpha"]), sign)
    _log_axes(log, f"cell/grip/{side}_actual", 0.03, grip, turn)


def _log_axes(
    log: RecordingLog, entity: str, length_m: float, place: Vector, quaternion: Vector
) -> None:
    log.once(entity, rr.TransformAxes3D(length_m))
    pose = {"translation": place.round(_DECIMALS), "quaternion": quaternion.round(_DECIMALS)}
    log.frames(entity, rr.Transform3D, **pose)


def _carry(
    place: Vector, pose: tuple[Vector, Vector, Vector], sign: float
) -> tuple[Vector, Vector]:
    """Return places (rows, 3) and orientations (rows, 4; w last) in the world of a grip.

    R_z(yaw) (R_z(π) for the right arm) R_y(α) at the place, NaN where the row is unfinished.
    """
    x, z, alpha = pose
    yaw = place[:, 3] + (0.0 if sign > 0.0 else np.pi)
    c, s = np.cos(yaw), np.sin(yaw)
    where = place[:, :3] + np.stack((c * x, s * x, z), axis=1)
    cz, sz, cy, sy = np.cos(yaw / 2), np.sin(yaw / 2), np.cos(alpha / 2), np.sin(alpha / 2)
    turn = np.stack((-sz * sy, cz * sy, sz * cy, cz * cy), axis=1)
    return where.round(_DECIMALS), turn


def _sites(model: mujoco.MjModel, motion: _Motion, names: list[str]) -> tuple[Vector, Vector]:
    """Return places (rows, n, 3) and orientations (rows, n, 4; w last) of sites in the world."""
    place, quaternion = [], []
    for site in (model.site(name) for name in names):
        body = int(site.bodyid[0])
        turn = Rotation.from_quat(motion.quaternion[:, body], scalar_first=True)
        place.append(motion.place[:, body] + turn.apply(site.pos))
        own = Rotation.from_quat(site.quat, scalar_first=True)
        quaternion.append((turn * own).as_quat(canonical=True))
    return np.stack(place, axis=1), np.stack(quaternion, axis=1)
