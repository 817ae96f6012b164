"""The flexible sheet as a composite of rigid strips in one kinematic chain.

N bending hinges of stiffness ``k = EI/h``, ``h = L/N``, stand at arc lengths ``(i + 1/2) h``, i
from 0 to N - 1. The outermost strips are thereby half as long as the others and each clamp holds
the sheet where it really ends: the error is O(h²). Every second place also has a twist hinge; the
T of them have ``T GJ/L`` each, so that the chain twists as the sheet does. The chain hangs from a
free joint at its middle strip: half as deep as from an end. Both choices are for speed: the degrees
of freedom are what a step costs.

A sheet that yields has springs side by side on each hinge, fixed tendons with MuJoCo's
``springyield`` (ideal elasto-plasticity): together they are the section's moment and curvature.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Annotated

import mujoco
import numpy as np
from numpy.typing import NDArray

from dualbend.beam.plastic import HingeSprings
from dualbend.beam.sheet import Sheet
from dualbend.scene.contacts import sheet_bits
from dualbend.scene.mjcf import BOX, DRAWN, SHEET_RGBA, SITE, about_z, make_plate
from dualbend.types import Tagged, said

CLAMPED_FIRST_ROOT = 4.730040744862704
"""First root of cosh(b) cos(b) = 1: the clamped-clamped beam's first mode."""

_TWIST_EVERY = 2
"""Bending hinges to a twist hinge, counted from the middle."""

LEFT_END, RIGHT_END = "sheet_left_end", "sheet_right_end"
"""Sites at the clamp lines; x points into the sheet, y along the bending axis of that end's arm."""


class StripConfig(Tagged, tag="strips"):
    """A chain of strips, as stiff as rigidity says: how finely it is divided, how it is damped."""

    hinges: Annotated[int, said("bending hinges, even", ge=4, le=200)] = 20
    damping_ratio: Annotated[float, said("of the first clamped bending mode", ge=0, lt=1)] = 0.02
    springs: Annotated[
        int, said("that yield one after the other, of each hinge; plastic only", ge=4, le=16)
    ] = 10

    def __post_init__(self) -> None:
        """Refuse an odd number of hinges: the chain hangs from its middle strip."""
        if self.hinges % 2:
            raise ValueError(
                f"hinges must be even (the chain hangs from its middle strip), got {self.hinges}"
            )

    @property
    def sections(self) -> int:
        """Number of places along the sheet at which it bends."""
        return self.hinges


def damping_time(sheet: Sheet, damping_ratio: float) -> float:
    """Return β [s], hinge damping over stiffness, for a damping ratio ζ of the first clamped mode.

    ``β = 2 ζ / ω₁`` with ``ω₁ = (4.730/L)² sqrt(EI / ρA)``.
    """
    EI, mass_per_length = sheet.bending_stiffness_nm2, sheet.mass_kg / sheet.length_m
    omega_1 = (CLAMPED_FIRST_ROOT / sheet.length_m) ** 2 * np.sqrt(EI / mass_per_length)
    return float(2.0 * damping_ratio / omega_1)


def twist_hinges(config: StripConfig) -> int:
    """Return the number of twist hinges of the whole chain, both halves alike."""
    return 2 * math.ceil(config.hinges / 2 / _TWIST_EVERY)


def bend_joint(index: int) -> str:
    """Name of the bending hinge at arc length ``(index + 1/2) h`` from the left end."""
    return f"sheet_bend_{index:02d}"


def twist_joint(index: int) -> str:
    """Name of the twist hinge beside a bending hinge; every second one has it."""
    return f"sheet_twist_{index:02d}"


def strip_body(index: int) -> str:
    """Name of strip ``index`` of N + 1, counted from the left end."""
    return f"sheet_strip_{index:02d}"


def add_sheet(
    spec: mujoco.MjSpec, sheet: Sheet, config: StripConfig, middle_position_m: NDArray[np.float64]
) -> None:
    """Add the flat sheet to ``spec``, its middle at ``middle_position_m`` (3,) in the world.

    Every bending hinge's angle is positive where the slope grows along the arc length, so the
    section's moment is ``EI dθ/ds = k q`` in the sign of :mod:`dualbend.beam.rod.planar`.
    """
    n = config.hinges
    middle = spec.worldbody.add_body(name=strip_body(n // 2), pos=middle_position_m)
    middle.add_freejoint(name="sheet")
    h = sheet.length_m / n
    _fill_strip(middle, sheet, h, 0.0, (0.5 * (sheet.length_m - h),) * 2)
    if sheet.plasticity is not None:
        springs = hinge_springs(sheet, config)
        for hinge in range(n):
            stiffness, rest = sheet.bending_stiffness_nm2 / h, rest_angle(sheet, config)
            _add_yielding(spec, hinge, springs, h, stiffness, rest)
    for direction, site, yaw in ((-1, LEFT_END, 0.0), (1, RIGHT_END, math.pi)):
        # A body of its own, fixed to the strip: a harder hold must not make harder contacts.
        edge = _add_half(middle, sheet, config, direction).add_body(name=f"{site}_edge")
        edge.add_site(name=site, pos=[direction * h / 2, 0.0, 0.0], quat=about_z(yaw), **SITE)


def effective(
    sheet: Sheet, at_m: float, stretch_m: float, stiffness: Callable[[Sheet], float]
) -> float:
    """Return the stiffness of the stretch about an arc length that one hinge stands for.

    Its compliances add up, 1 / mean(1/EI): a step or a taper is in the hinges to O(h²).
    """
    if not sheet.profile:
        return stiffness(sheet)
    low, high = max(at_m - stretch_m / 2, 0.0), min(at_m + stretch_m / 2, sheet.length_m)
    return 1.0 / sheet.mean(low, high, lambda section: 1.0 / stiffness(section))


def hinge_springs(sheet: Sheet, config: StripConfig) -> HingeSprings:
    """Return how each hinge of a sheet that yields does so, in curvatures and shares of EI."""
    assert sheet.plasticity is not None
    return sheet.plasticity.springs(sheet.thickness_m, config.springs)


def rest_angle(sheet: Sheet, config: StripConfig) -> float:
    """Return the angle of each bending hinge of the free sheet, −κ h [rad]."""
    return -sheet.rest_curvature_per_m * sheet.length_m / config.hinges


def hinge_stiffness(model: mujoco.MjModel, hinge: int) -> float:
    """Return the elastic stiffness of a bending hinge with all its springs [N m/rad]."""
    joint = model.joint(bend_joint(hinge)).id
    own = f"sheet_yield_{hinge:02d}_"
    on_it = [i for i in range(model.ntendon) if model.tendon(i).name.startswith(own)]
    return float(model.jnt_stiffness[joint].flat[0] + model.tendon_stiffness[on_it].sum())


def _add_yielding(
    spec: mujoco.MjSpec, hinge: int, springs: HingeSprings, h: float, stiffness: float, rest: float
) -> None:
    """Put the yielding springs on a hinge; the joint's own is what never yields."""
    rows = np.column_stack((springs.share, springs.yield_curvature)).tolist()
    for i, (share, curvature) in enumerate(rows):
        tendon = spec.add_tendon(name=f"sheet_yield_{hinge:02d}_{i:02d}")
        tendon.wrap_joint(bend_joint(hinge), 1.0)
        tendon.stiffness = [share * stiffness, 0.0, 0.0]
        tendon.springyield = curvature * h
        # Without it the rest length is that of qpos_spring, which is the same.
        tendon.springlength = [rest, rest]


def _add_half(
    middle: mujoco.MjsBody, sheet: Sheet, config: StripConfig, direction: int
) -> mujoco.MjsBody:
    """Chain the strips of one half outward from the middle; returns the end strip."""
    n = config.hinges
    h = sheet.length_m / n
    twists = twist_hinges(config)
    beta = damping_time(sheet, config.damping_ratio)
    elastic = 1.0 if sheet.plasticity is None else hinge_springs(sheet, config).elastic
    parent, offset = middle, direction * h / 2
    for i in range(n // 2):
        strip = n // 2 + direction * (i + 1)
        hinge = min(strip, strip - direction)
        body = parent.add_body(name=strip_body(strip), pos=[offset, 0.0, 0.0])
        rest = rest_angle(sheet, config)
        at = (hinge + 0.5) * h
        bend = effective(sheet, at, h, lambda section: section.bending_stiffness_nm2) / h
        joints = [(bend_joint(hinge), [0, direction, 0], elastic, bend, rest)]
        if i % _TWIST_EVERY == 0:
            GJ = effective(sheet, at, 2.0 * h, lambda section: section.torsional_stiffness_nm2)
            twist = twists * GJ / sheet.length_m
            joints.append((twist_joint(hinge), [direction, 0, 0], 1.0, twist, 0.0))
        for name, axis, share, stiffness, sprung_at in joints:
            body.add_joint(
                name=name,
                type=mujoco.mjtJoint.mjJNT_HINGE,
                axis=axis,
                stiffness=share * stiffness,
                springref=sprung_at,
                damping=beta * stiffness,
            )
        length = h / 2 if i == n // 2 - 1 else h
        near, far = sheet.length_m / 2 - (i + 0.5) * h - length, sheet.length_m / 2 + (i + 0.5) * h
        away = (near, far) if direction < 0 else (far, near)
        _fill_strip(body, sheet, length, direction * length / 2, away)
        parent, offset = body, direction * length
    return parent


def _fill_strip(
    body: mujoco.MjsBody,
    sheet: Sheet,
    length_m: float,
    centre_x_m: float,
    from_clamps_m: tuple[float, float],
) -> None:
    """Give a strip its inertia and a plate, to see and to touch."""
    if sheet.profile:
        low, high = from_clamps_m[0], sheet.length_m - from_clamps_m[1]
        mean = sheet.mean(low, high, lambda section: section.thickness_m)
        sheet = replace(sheet, thickness_m=mean, profile=())
    make_plate(body, sheet, length_m, centre_x_m)
    body.add_geom(
        name=f"{body.name}_plate",
        type=BOX,
        size=[length_m / 2, sheet.width_m / 2, sheet.thickness_m / 2],
        pos=[centre_x_m, 0.0, 0.0],
        mass=0.0,
        rgba=SHEET_RGBA,
        **{**DRAWN, "contype": sheet_bits(*from_clamps_m)},
    )
