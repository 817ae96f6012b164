"""Shapes and poses of a model's bodies over the rows of a run, for the recording's scene."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import rerun as rr
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dualbend.recording.log import RecordingLog
from dualbend.run.record import RunRecord
from dualbend.scene.sheet.strips import LEFT_END, RIGHT_END
from dualbend.types import Vector

DECIMALS = 6
"""Places are rounded to 1 µm: what rests is then the same in every row, and compresses away."""

_VISUAL_GROUP = 2

_NONE: Mapping[int, tuple[Vector, Rotation]] = {}


@dataclass(frozen=True, kw_only=True)
class Motion:
    """Places (rows, n, 3), orientations (rows, n, 4; w first) of bodies; places of the two ends."""

    place: Vector
    quaternion: Vector
    ends: Vector


def forward(result: RunRecord) -> Motion:
    """Return the motion of all bodies and of the sheet's two ends."""
    model, qpos = result.model, result.trace.qpos
    data, rows = mujoco.MjData(model), len(qpos)
    place, quaternion = np.empty((rows, model.nbody, 3)), np.empty((rows, model.nbody, 4))
    ends, sites = np.empty((rows, 2, 3)), [model.site(name).id for name in (LEFT_END, RIGHT_END)]
    for row, q in enumerate(qpos):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        place[row], quaternion[row], ends[row] = data.xpos, data.xquat, data.site_xpos[sites]
    return Motion(place=place, quaternion=quaternion, ends=ends)


def rows_of_pose(motion: Motion, body: int, parent: int) -> tuple[Vector, Vector]:
    """Return a body's places (rows, 3) and orientations (rows, 4; w last) in its parent body."""
    turn, base = (
        Rotation.from_quat(motion.quaternion[:, i], scalar_first=True) for i in (body, parent)
    )
    back = base.inv()
    place = back.apply(motion.place[:, body] - motion.place[:, parent])
    return place.round(DECIMALS), (back * turn).as_quat(canonical=True).round(DECIMALS)


def shapes_of(
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


def in_world(run: RunRecord, prefix: str, sign: float) -> Vector:
    """Return the columns x, y, z of an arm's bending frame as vectors (rows, 3) of the world."""
    mine = np.stack([run[f"{prefix}_{axis}"] for axis in "xyz"], axis=1)
    return np.asarray(mine * [sign, sign, 1.0])


def log_axes(
    log: RecordingLog, entity: str, length_m: float, place: Vector, quaternion: Vector
) -> None:
    """Log a frame of axes at places (rows, 3) and orientations (rows, 4; w last)."""
    log.once(entity, rr.TransformAxes3D(length_m))
    pose = {"translation": place.round(DECIMALS), "quaternion": quaternion.round(DECIMALS)}
    log.frames(entity, rr.Transform3D, **pose)


def carry(place: Vector, pose: tuple[Vector, Vector, Vector], sign: float) -> tuple[Vector, Vector]:
    """Return places (rows, 3) and orientations (rows, 4; w last) in the world of a grip.

    R_z(yaw) (R_z(π) for the right arm) R_y(α) at the place, NaN where the row is unfinished.
    """
    x, z, alpha = pose
    yaw = place[:, 3] + (0.0 if sign > 0.0 else np.pi)
    c, s = np.cos(yaw), np.sin(yaw)
    where = place[:, :3] + np.stack((c * x, s * x, z), axis=1)
    cz, sz, cy, sy = np.cos(yaw / 2), np.sin(yaw / 2), np.cos(alpha / 2), np.sin(alpha / 2)
    turn = np.stack((-sz * sy, cz * sy, sz * cy, cz * cy), axis=1)
    return where.round(DECIMALS), turn


def sites(model: mujoco.MjModel, motion: Motion, names: list[str]) -> tuple[Vector, Vector]:
    """Return places (rows, n, 3) and orientations (rows, n, 4; w last) of sites in the world."""
    place, quaternion = [], []
    for site in (model.site(name) for name in names):
        body = int(site.bodyid[0])
        turn = Rotation.from_quat(motion.quaternion[:, body], scalar_first=True)
        place.append(motion.place[:, body] + turn.apply(site.pos))
        own = Rotation.from_quat(site.quat, scalar_first=True)
        quaternion.append((turn * own).as_quat(canonical=True))
    return np.stack(place, axis=1), np.stack(quaternion, axis=1)
