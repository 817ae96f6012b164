"""Natural frequencies of the strips between clamps against those of the beam."""

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np
from scipy import linalg

from dualbend.beam.sheet import Sheet
from dualbend.scene.sheet.strips import CLAMPED_FIRST_ROOT, bend_joint
from dualbend.types import Vector
from dualbend.validation.cases.ideal_grips import end_jacobian, gripped_strips
from dualbend.validation.cases.sheet import default_sheet
from dualbend.validation.row import Row, relative

CLAMPED_ROOTS = (CLAMPED_FIRST_ROOT, 7.853204624095838, 10.995607838001671)
"""First roots b of cosh(b) cos(b) = 1; ω = (b/L)² √(EI/ρA)."""


def theoretical_frequencies(sheet: Sheet) -> Vector:
    """Return (b/L)² √(EI/ρA) / 2π of the first clamped modes (3,) [Hz]."""
    per_length = sheet.mass_kg / sheet.length_m
    speed = np.sqrt(sheet.bending_stiffness_nm2 / per_length) / sheet.length_m**2
    return np.asarray(np.square(CLAMPED_ROOTS) * speed / (2.0 * np.pi))


def clamped_modes(model: mujoco.MjModel, hinges: int) -> tuple[Vector, Vector]:
    """Return the bending frequencies [Hz] and shapes (nv, modes) of strips with clamped ends.

    M q̈ + K q = 0 on the null space of the ends' Jacobian, in the plane only: x, z and tilt of the
    middle strip, and the bending hinges.
    """
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    bends = [model.joint(bend_joint(i)) for i in range(hinges)]
    plane = [0, 2, 4, *(int(joint.dofadr[0]) for joint in bends)]
    inertia = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, inertia)
    stiffness = np.diag([0.0] * 3 + [float(joint.stiffness.flat[0]) for joint in bends])
    free = linalg.null_space(end_jacobian(model, data)[:, plane])
    squares, shapes = linalg.eigh(
        free.T @ stiffness @ free, free.T @ inertia[np.ix_(plane, plane)] @ free
    )
    whole = np.zeros((model.nv, squares.size))
    whole[plane] = free @ shapes
    return np.sqrt(squares) / (2.0 * np.pi), whole


def frequency_rows() -> Iterator[Row]:
    """Compare the first three frequencies of the shipped division with theory."""
    sheet, strips = default_sheet()
    model = gripped_strips(sheet, strips, weight=False)
    found, _ = clamped_modes(model, strips.hinges)
    for i, wanted in enumerate(theoretical_frequencies(sheet)):
        name = f"sheet clamped frequency {i + 1}, {strips.hinges} hinges"
        yield relative(name, found[i], wanted, "Hz", 0.01)
