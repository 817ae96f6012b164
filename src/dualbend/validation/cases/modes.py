"""The strips' vibration between clamps: natural frequencies, and what the step makes of them."""

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np
from scipy import linalg, optimize

from dualbend.beam.sheet import Sheet
from dualbend.scene.sheet.strips import CLAMPED_FIRST_ROOT, bend_joint
from dualbend.types import Vector
from dualbend.validation.cases.sheet import default_sheet, end_jacobian, ideal_grips, place_grips
from dualbend.validation.row import Row, relative

CLAMPED_ROOTS = (CLAMPED_FIRST_ROOT, 7.853204624095838, 10.995607838001671)
"""First roots b of cosh(b) cos(b) = 1; ω = (b/L)² √(EI/ρA)."""

_AMPLITUDE_RAD = 1e-4
_PERIODS = 25


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
    model = ideal_grips(sheet, strips, weight=False)
    found, _ = clamped_modes(model, strips.hinges)
    for i, wanted in enumerate(theoretical_frequencies(sheet)):
        name = f"sheet clamped frequency {i + 1}, {strips.hinges} hinges"
        yield relative(name, found[i], wanted, "Hz", 0.01)


def ring_down(step_s: float, weld_time_s: float = 0.004) -> tuple[float, float]:
    """Return frequency [Hz] and damping ratio of the shipped sheet's first mode when simulated.

    The integrator treats the hinges implicitly, which adds a damping ratio of about ω h / 2 to the
    configured 0.02: at the shipped step of 1.75 ms the first mode has 0.11 and is 1.2 % slow, the
    second 0.30 and 9 %; at 0.1 ms, with a weld of 0.2 ms, the first has 0.025. Statics, which are
    what bending at 0.1 rad/s is about, do not feel it.
    """
    sheet, strips = default_sheet()
    model = ideal_grips(sheet, strips, weight=False, step_s=step_s, weld_time_s=weld_time_s)
    data = mujoco.MjData(model)
    place_grips(data, 0.0, sheet.length_m / 2.0)
    frequencies, shapes = clamped_modes(model, strips.hinges)
    shape = shapes[:, 0] / np.abs(shapes[6:, 0]).max()
    mujoco.mj_integratePos(model, data.qpos, shape, _AMPLITUDE_RAD)
    watched = model.joint(bend_joint(strips.hinges // 2)).qposadr[0]
    count = round(_PERIODS / frequencies[0] / step_s)
    angle = np.empty(count)
    for i in range(count):
        mujoco.mj_step(model, data)
        angle[i] = data.qpos[watched] / _AMPLITUDE_RAD
    times = step_s * np.arange(1, count + 1)

    def residual(p: Vector) -> Vector:
        phase = 2.0 * np.pi * p[0] * times
        swing = p[2] * np.cos(phase) + p[3] * np.sin(phase)
        return np.asarray(np.exp(-p[1] * 2.0 * np.pi * p[0] * times) * swing - angle)

    fit = optimize.least_squares(residual, [0.97 * frequencies[0], 0.1, angle[0], 0.0])
    return float(fit.x[0]), float(fit.x[1])
