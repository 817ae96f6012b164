"""The composed models' own response against properties that were written down.

Both sides of the other rows read the same sheet, so that one twice as stiff would pass them all.
Here a force or moment is put on the compiled model, and what it does is compared with numbers of
:mod:`dualbend.validation.handbook`, which nothing computes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import mujoco
import numpy as np

from dualbend.arm import mjcf as arm
from dualbend.arm.model import ArmModel
from dualbend.beam.path import ExactPath
from dualbend.beam.rod.planar import solve_planar
from dualbend.beam.sheet import Sheet
from dualbend.scene.sheet.strips import LEFT_END, RIGHT_END, strip_body
from dualbend.types import Vector
from dualbend.validation.cases.cell import HeldCell
from dualbend.validation.cases.ideal_grips import gripped_strips
from dualbend.validation.cases.modes import clamped_modes
from dualbend.validation.cases.sheet import default_sheet, settled_loads
from dualbend.validation.handbook import ARMS, STRIP, SUBSTANCES
from dualbend.validation.row import Row, absolute, of_property, relative

_ANALYTIC, _DENSITY_WITHIN, _MASS_WITHIN, _SHELL_WITHIN = 1e-4, 0.01, 0.02, 0.02
"""Hinges in series have EI/L and GJ/L whatever their number; sources differ by 1 % about a density
and by 2 % about a link's mass; a shell's clamps hold it across, ν² stiffer over half a width."""

_STRIPS_WITHIN = 0.005
"""O(h²) of 20 strips, as in the rows of the sheet's force; the frequency takes 1 %."""

_REST_S, _STRETCH = 3.0, 5e-5
_MOMENT_NM, _TORQUE_NM, _PULL_N = 0.05, 0.02, 100.0


class FreeSheet:
    """The sheet of the composed cell of ``exact``, flat, let go and without weight."""

    def __init__(self, settings: Sequence[str] = ()) -> None:
        cell = HeldCell(0.0, settings)
        self.config = cell.scenario.sheet
        self.model, self.data = cell.model, cell.simulation.data
        self.model.opt.gravity[:] = 0.0
        # Nothing is in its way: it is turned where the grippers are.
        self.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        self.data.eq_active[:] = 0
        self._ends = [self.model.site(name).id for name in (LEFT_END, RIGHT_END)]
        self._start = self.data.qpos.copy()

    def mass_kg(self) -> float:
        """Return force over acceleration where the middle is pushed along the sheet."""
        middle = strip_body(self.config.model.sections // 2)
        self.data.xfrc_applied[self.model.body(middle).id, 0] = 1.0
        mujoco.mj_forward(self.model, self.data)
        self.data.xfrc_applied[:] = 0.0
        return 1.0 / float(self.data.qacc[self.model.joint("sheet").dofadr[0]])

    def bending_stiffness_nm2(self) -> float:
        """Return M L over the angle between the ends, at rest under two opposite moments M."""
        self._load(np.array([0.0, 0.0, 0.0, 0.0, _MOMENT_NM, 0.0]))
        first, last = self._axes()
        return _MOMENT_NM * STRIP.length_m / math.acos(float(-first[:, 0] @ last[:, 0]))

    def torsional_stiffness_nm2(self) -> float:
        """Return T L over the twist between the ends, at rest under two opposite torques T."""
        self._load(np.array([0.0, 0.0, 0.0, _TORQUE_NM, 0.0, 0.0]))
        first, last = self._axes()
        return _TORQUE_NM * STRIP.length_m / math.acos(float(first[:, 2] @ last[:, 2]))

    def axial_stiffness_n(self) -> float:
        """Return F (L − h) over the elongation, at rest under two opposite pulls F.

        Each edge holds the sheet's outermost half cell, which cannot stretch: together one h.
        """
        self._load(np.zeros(6))
        before = self._length()
        self._load(np.array([-_PULL_N, 0.0, 0.0, 0.0, 0.0, 0.0]))
        stretching = STRIP.length_m * (1.0 - 1.0 / self.config.model.sections)
        return _PULL_N * stretching / (self._length() - before)

    def _load(self, left: Vector) -> None:
        """Put a wrench (6,) on the left end and its opposite on the right, from the flat state."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:], self.data.eq_active[:] = self._start, 0
        for end, sign in zip(self._ends, (1.0, -1.0), strict=True):
            self.data.xfrc_applied[self.model.site_bodyid[end]] = sign * left
        mujoco.mj_step(self.model, self.data, nstep=round(_REST_S / self.model.opt.timestep))
        mujoco.mj_forward(self.model, self.data)

    def _axes(self) -> Vector:
        return np.asarray(self.data.site_xmat[self._ends].reshape(2, 3, 3))

    def _length(self) -> float:
        return float(np.linalg.norm(np.subtract(*self.data.site_xpos[self._ends])))


def strip_rows() -> Iterator[Row]:
    """Compare what the shipped strip does in the composed cell, and its theory, with handbooks."""
    (sheet, strips), free = default_sheet(), FreeSheet()
    yield _row("mass of the strip, pushed", free.mass_kg(), STRIP.mass_kg, "kg", _ANALYTIC)
    found, wanted = free.bending_stiffness_nm2(), STRIP.bending_stiffness_nm2
    yield _row("EI of the strip, bent by two moments", found, wanted, "N m2", _ANALYTIC)
    found, wanted = free.torsional_stiffness_nm2(), STRIP.torsional_stiffness_nm2
    yield _row("GJ of the strip, twisted by two torques", found, wanted, "N m2", _ANALYTIC)
    found, wanted = stretched_rod_n(sheet), STRIP.axial_stiffness_n * _STRETCH
    yield _row("pull that stretches the rod by 20 µm", found, wanted, "N", _ANALYTIC)
    exact, end = ExactPath(STRIP.length_m, 1.0), np.array([1.0])
    found = float(settled_loads(sheet, strips.hinges, exact, end, weight=False).force_n[0])
    wanted = STRIP.end_force_at_1_rad_n
    yield _row("end force of the strip, exact path, 1 rad", found, wanted, "N", _STRIPS_WITHIN)
    modes, _ = clamped_modes(gripped_strips(sheet, strips, weight=False), strips.hinges)
    found, wanted = float(modes[0]), STRIP.first_clamped_hz
    yield _row("first frequency of the clamped strip", found, wanted, "Hz", 2.0 * _STRIPS_WITHIN)


def _row(name: str, found: float, wanted: float, unit: str, within: float) -> Row:
    return of_property(relative(name, found, wanted, unit, within))


def stretched_rod_n(sheet: Sheet) -> float:
    """Return the pull of the reference rod [N], straight and longer by 50 millionths."""
    half = 0.5 * sheet.length_m * (1.0 + _STRETCH)
    grips = (-half, 0.0, 0.0), (half, 0.0, 0.0)
    EI, EA = sheet.bending_stiffness_nm2, sheet.axial_stiffness_n
    return -solve_planar(EI, sheet.length_m, *grips, axial_stiffness_n=EA).end_force_n


def material_rows() -> Iterator[Row]:
    """Compare a strip of each of three materials of the library, in the cell, with handbooks."""
    for name, wanted in SUBSTANCES.items():
        free, what = FreeSheet((f'sheet.material="{name}"',)), f"of a strip of {name}"
        yield _row(f"mass {what}", free.mass_kg(), wanted.mass_kg, "kg", _DENSITY_WITHIN)
        found, reference = free.bending_stiffness_nm2(), wanted.bending_stiffness_nm2
        yield _row(f"EI {what}", found, reference, "N m2", wanted.within)
        found, reference = free.torsional_stiffness_nm2(), wanted.torsional_stiffness_nm2
        yield _row(f"GJ {what}", found, reference, "N m2", wanted.within)


def shell_rows() -> Iterator[Row]:
    """Compare the pulled shell with the handbook."""
    found = FreeSheet(("sheet.model=shell",)).axial_stiffness_n()
    yield _row("EA of the shell, pulled", found, STRIP.axial_stiffness_n, "N", _SHELL_WITHIN)


def arm_rows(about: ArmModel) -> Iterator[Row]:
    """Compare an arm's model with what is published of it; nothing where nothing was found."""
    name, published = about.name, ARMS.get(about.name)
    if published is None:
        return
    model = about.spec(looks=False).compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    x, y, z = data.site(arm.FLANGE_SITE).xpos
    for what, found, wanted in (
        ("off the base's axis", math.hypot(x, y), published.radius_m),
        ("above the base", z, published.height_m),
    ):
        text = f"{name} flange {what}, joints at zero"
        yield of_property(absolute(text, found, wanted, "m", 1e-4))
    off = np.degrees(about.range_rad) - np.array(published.range_deg)
    text = f"{name} joint ranges, largest difference from the published"
    yield of_property(absolute(text, float(np.abs(off).max()), 0.0, "deg", 0.1))
    if published.links_kg:
        first = published.first_link
        links = [f"link{first + i}" for i in range(len(published.links_kg))]
        mass = sum(float(model.body(link).mass[0]) for link in links)
        text, wanted = f"{name} mass of {links[0]} to {links[-1]}", sum(published.links_kg)
        yield _row(text, mass, wanted, "kg", _MASS_WITHIN)
