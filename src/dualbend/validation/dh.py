"""The PUMA 560 from its published table: reference for the MuJoCo model.

Standard Denavit-Hartenberg convention, T_i = Rz(q) Tz(d) Tx(a) Rx(α); joint i turns about z of
frame i-1; frame 0 sits on the shoulder axis with z up. Nothing here is read from the MJCF file.

Source: P. Corke and B. Armstrong-Hélouvry, "A search for consensus among model parameters reported
for the PUMA 560 robot", ICRA 1994, as tabulated in the Robotics Toolbox (Puma560.py); motor and
drive inertia: Armstrong, Khatib and Burdick, ICRA 1986.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from dualbend.types import Vector
from dualbend.validation.lagrange import Link, SerialArm

FLANGE_OFFSET_M: Final = 0.05625
"""Wrist centre to mounting face along z6 [m]; Corke (1996), Table 2.1."""


@dataclass(frozen=True, kw_only=True)
class DhLink:
    """One row of the table: geometry, mass properties and drive.

    alpha_rad, a_m, d_m: DH parameters. com_m: centre of mass in frame i. inertia_kg_m2: Ixx, Iyy,
    Izz about the centre of mass, axes of frame i. armature_kg_m2: motor and gear train at the
    joint. gear: motor turns per joint turn. viscous_n_m_s, coulomb_n_m (in + and in - direction):
    at the motor. range_rad, torque_limit_n_m: at the joint.
    """

    alpha_rad: float
    a_m: float
    d_m: float
    mass_kg: float
    com_m: tuple[float, float, float]
    inertia_kg_m2: tuple[float, float, float]
    armature_kg_m2: float
    gear: float
    viscous_n_m_s: float
    coulomb_n_m: tuple[float, float]
    range_rad: tuple[float, float]
    torque_limit_n_m: float

    @property
    def fixed_part(self) -> Vector:
        """What the joint turns, Tz(d) Tx(a) Rx(α), multiplied out (4, 4) [m]."""
        c, s = math.cos(self.alpha_rad), math.sin(self.alpha_rad)
        rows = [[1.0, 0.0, 0.0, self.a_m], [0.0, c, -s, 0.0], [0.0, s, c, self.d_m]]
        return np.array([*rows, [0.0, 0.0, 0.0, 1.0]])


def _degrees(low: float, high: float) -> tuple[float, float]:
    return math.radians(low), math.radians(high)


# Link 1: only Iyy (about the waist) acts; its mass lies on the waist axis and is 0 in the table.
# Link 3: published Iyy 0.086 exceeds Ixx + Izz = 0.0785; repaired to 0.0785, see models/puma560.
PUMA560: Final = (
    DhLink(
        alpha_rad=math.pi / 2, a_m=0.0, d_m=0.0,
        mass_kg=0.0, com_m=(0.0, 0.0, 0.0), inertia_kg_m2=(0.0, 0.35, 0.0),
        armature_kg_m2=1.14, gear=-62.6111, viscous_n_m_s=1.48e-3, coulomb_n_m=(0.395, -0.435),
        range_rad=_degrees(-160, 160), torque_limit_n_m=97.6,
    ),
    DhLink(
        alpha_rad=0.0, a_m=0.4318, d_m=0.0,
        mass_kg=17.4, com_m=(-0.3638, 0.006, 0.2275), inertia_kg_m2=(0.13, 0.524, 0.539),
        armature_kg_m2=4.71, gear=107.815, viscous_n_m_s=0.817e-3, coulomb_n_m=(0.126, -0.071),
        range_rad=_degrees(-45, 225), torque_limit_n_m=186.4,
    ),
    DhLink(
        alpha_rad=-math.pi / 2, a_m=0.0203, d_m=0.15005,
        mass_kg=4.8, com_m=(-0.0203, -0.0141, 0.070), inertia_kg_m2=(0.066, 0.0785, 0.0125),
        armature_kg_m2=0.83, gear=-53.7063, viscous_n_m_s=1.38e-3, coulomb_n_m=(0.132, -0.105),
        range_rad=_degrees(-225, 45), torque_limit_n_m=89.4,
    ),
    DhLink(
        alpha_rad=math.pi / 2, a_m=0.0, d_m=0.4318,
        mass_kg=0.82, com_m=(0.0, 0.019, 0.0), inertia_kg_m2=(1.8e-3, 1.3e-3, 1.8e-3),
        armature_kg_m2=0.200, gear=76.0364, viscous_n_m_s=71.2e-6,
        coulomb_n_m=(11.2e-3, -16.9e-3),
        range_rad=_degrees(-110, 170), torque_limit_n_m=24.2,
    ),
    DhLink(
        alpha_rad=-math.pi / 2, a_m=0.0, d_m=0.0,
        mass_kg=0.34, com_m=(0.0, 0.0, 0.0), inertia_kg_m2=(0.3e-3, 0.4e-3, 0.3e-3),
        armature_kg_m2=0.179, gear=71.923, viscous_n_m_s=82.6e-6,
        coulomb_n_m=(9.26e-3, -14.5e-3),
        range_rad=_degrees(-100, 100), torque_limit_n_m=20.1,
    ),
    DhLink(
        alpha_rad=0.0, a_m=0.0, d_m=0.0,
        mass_kg=0.09, com_m=(0.0, 0.0, 0.032), inertia_kg_m2=(0.15e-3, 0.15e-3, 0.04e-3),
        armature_kg_m2=0.193, gear=76.686, viscous_n_m_s=36.7e-6,
        coulomb_n_m=(3.96e-3, -10.5e-3),
        range_rad=_degrees(-266, 266), torque_limit_n_m=21.3,
    ),
)  # fmt: skip


def puma() -> SerialArm:
    """Return the arm of the table from frame 0 to the mounting face, T_06 Tz(d6), without drives.

    Link i is DH frame i before its fixed part, where joint i turns about z.
    """
    links, pose = [], np.eye(4)
    for row in PUMA560:
        fixed = row.fixed_part
        turn = fixed[:3, :3]
        link = Link(
            pose=pose,
            axis=np.array([0.0, 0.0, 1.0]),
            mass_kg=row.mass_kg,
            centre_m=turn @ np.array(row.com_m) + fixed[:3, 3],
            inertia_kg_m2=turn @ np.diag(row.inertia_kg_m2) @ turn.T,
        )
        links.append(link)
        pose = fixed
    face = np.eye(4)
    face[2, 3] = FLANGE_OFFSET_M
    return SerialArm(links=tuple(links), flange=pose @ face)
