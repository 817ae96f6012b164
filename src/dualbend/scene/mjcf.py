"""What the MuJoCo specifications of cell, sheet and bed share."""

import math
from collections.abc import Iterable
from typing import Final

import mujoco

from dualbend.beam.sheet import Sheet
from dualbend.types import Reals

BOX: Final = mujoco.mjtGeom.mjGEOM_BOX

SHEET_RGBA: Final = [0.30, 0.52, 0.80, 1.0]

DRAWN: Final = {"contype": 0, "conaffinity": 0, "group": 2}
"""A geom that is only looked at: it touches nothing."""

SITE: Final = {"group": 4, "size": [0.003] * 3}
"""A site as small as a grip, not drawn by default."""


def about_z(angle_rad: float) -> tuple[float, float, float, float]:
    """Return the quaternion (w, x, y, z) of a turn about z."""
    return math.cos(angle_rad / 2), 0.0, 0.0, math.sin(angle_rad / 2)


def about_zyx(cosines: Iterable[Reals], sines: Iterable[Reals]) -> tuple[Reals, ...]:
    """Return the quaternion w, x, y, z of R_z(yaw) R_y(pitch) R_x(roll).

    Of the cosines and sines of half the roll, pitch and yaw, numbers or arrays.
    """
    (cr, cp, cy), (sr, sp, sy) = cosines, sines
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def add_floor_and_sky(spec: mujoco.MjSpec, conaffinity: int = 0) -> None:
    """Put a floor, which collides with what ``conaffinity`` says, and a light sky into a scene."""
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.93, 0.95, 0.97],
        rgb2=[0.70, 0.76, 0.82],
        width=64,
        height=384,
    )
    spec.worldbody.add_geom(
        name="floor",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[3.0, 3.0, 0.1],
        rgba=[0.80, 0.82, 0.84, 1.0],
        contype=0,
        conaffinity=conaffinity,
    )


def make_plate(body: mujoco.MjsBody, sheet: Sheet, length_m: float, centre_x_m: float) -> None:
    """Give a body the inertia of a stretch of the flat sheet, centred on the body's x axis."""
    w, t = sheet.width_m, sheet.thickness_m
    body.explicitinertial = True
    mass = body.mass = sheet.mass_kg * length_m / sheet.length_m
    body.ipos = [centre_x_m, 0.0, 0.0]
    sides = (w**2 + t**2, length_m**2 + t**2, length_m**2 + w**2)
    body.inertia = [mass * squares / 12 for squares in sides]
