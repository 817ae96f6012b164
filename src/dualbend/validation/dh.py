"""The PUMA 560 from its published table, in plain NumPy: the oracle for the MuJoCo model.

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
from numpy.typing import ArrayLike, NDArray

from dualbend.errors import InputError

Array = NDArray[np.float64]

GRAVITY_M_PER_S2: Final = 9.81
FLANGE_OFFSET_M: Final = 0.05625
"""Wrist centre to mounting face along z6 [m]; Corke (1996), Table 2.1."""


@dataclass(frozen=True, kw_only=True)
class Link:
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
    def damping_n_m_s(self) -> float:
        """Viscous friction at the joint, B G² [N m s/rad]."""
        return self.viscous_n_m_s * self.gear**2

    @property
    def friction_n_m(self) -> float:
        """Coulomb friction at the joint, |G| (|Tc+| + |Tc-|) / 2 [N m]."""
        return abs(self.gear) * sum(abs(t) for t in self.coulomb_n_m) / 2.0


def _degrees(low: float, high: float) -> tuple[float, float]:
    return math.radians(low), math.radians(high)


# Link 1: only Iyy (about the waist) acts; its mass lies on the waist axis and is 0 in the table.
# Link 3: published Iyy 0.086 exceeds Ixx + Izz = 0.0785; repaired to 0.0785, see models/puma560.
PUMA560: Final = (
    Link(
        alpha_rad=math.pi / 2, a_m=0.0, d_m=0.0,
        mass_kg=0.0, com_m=(0.0, 0.0, 0.0), inertia_kg_m2=(0.0, 0.35, 0.0),
        armature_kg_m2=1.14, gear=-62.6111, viscous_n_m_s=1.48e-3, coulomb_n_m=(0.395, -0.435),
        range_rad=_degrees(-160, 160), torque_limit_n_m=97.6,
    ),
    Link(
        alpha_rad=0.0, a_m=0.4318, d_m=0.0,
        mass_kg=17.4, com_m=(-0.3638, 0.006, 0.2275), inertia_kg_m2=(0.13, 0.524, 0.539),
        armature_kg_m2=4.71, gear=107.815, viscous_n_m_s=0.817e-3, coulomb_n_m=(0.126, -0.071),
        range_rad=_degrees(-45, 225), torque_limit_n_m=186.4,
    ),
    Link(
        alpha_rad=-math.pi / 2, a_m=0.0203, d_m=0.15005,
        mass_kg=4.8, com_m=(-0.0203, -0.0141, 0.070), inertia_kg_m2=(0.066, 0.0785, 0.0125),
        armature_kg_m2=0.83, gear=-53.7063, viscous_n_m_s=1.38e-3, coulomb_n_m=(0.132, -0.105),
        range_rad=_degrees(-225, 45), torque_limit_n_m=89.4,
    ),
    Link(
        alpha_rad=math.pi / 2, a_m=0.0, d_m=0.4318,
        mass_kg=0.82, com_m=(0.0, 0.019, 0.0), inertia_kg_m2=(1.8e-3, 1.3e-3, 1.8e-3),
        armature_kg_m2=0.200, gear=76.0364, viscous_n_m_s=71.2e-6,
        coulomb_n_m=(11.2e-3, -16.9e-3),
        range_rad=_degrees(-110, 170), torque_limit_n_m=24.2,
    ),
    Link(
        alpha_rad=-math.pi / 2, a_m=0.0, d_m=0.0,
        mass_kg=0.34, com_m=(0.0, 0.0, 0.0), inertia_kg_m2=(0.3e-3, 0.4e-3, 0.3e-3),
        armature_kg_m2=0.179, gear=71.923, viscous_n_m_s=82.6e-6,
        coulomb_n_m=(9.26e-3, -14.5e-3),
        range_rad=_degrees(-100, 100), torque_limit_n_m=20.1,
    ),
    Link(
        alpha_rad=0.0, a_m=0.0, d_m=0.0,
        mass_kg=0.09, com_m=(0.0, 0.0, 0.032), inertia_kg_m2=(0.15e-3, 0.15e-3, 0.04e-3),
        armature_kg_m2=0.193, gear=76.686, viscous_n_m_s=36.7e-6,
        coulomb_n_m=(3.96e-3, -10.5e-3),
        range_rad=_degrees(-266, 266), torque_limit_n_m=21.3,
    ),
)  # fmt: skip


def _vector(name: str, values: ArrayLike) -> Array:
    vector = np.asarray(values, dtype=np.float64)
    if vector.shape != (len(PUMA560),):
        raise InputError(f"{name} needs shape ({len(PUMA560)},), got {vector.shape}")
    return vector


def _transform(link: Link, q: float) -> Array:
    """Return T = Rz(q) Tz(d) Tx(a) Rx(α), multiplied out (4, 4)."""
    c, s = math.cos(q), math.sin(q)
    ca, sa = math.cos(link.alpha_rad), math.sin(link.alpha_rad)
    return np.array(
        [
            [c, -s * ca, s * sa, link.a_m * c],
            [s, c * ca, -c * sa, link.a_m * s],
            [0.0, sa, ca, link.d_m],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def link_frames(q_rad: ArrayLike) -> Array:
    """Return DH frames 0 to 6 in frame 0, T_0i = T_1(q_1) ... T_i(q_i), shape (7, 4, 4) [m]."""
    frames = [np.eye(4)]
    for link, angle in zip(PUMA560, _vector("q_rad", q_rad), strict=True):
        frames.append(frames[-1] @ _transform(link, float(angle)))
    return np.array(frames)


def flange_pose(q_rad: ArrayLike) -> Array:
    """Return the mounting face in frame 0, T_06 Tz(d6), shape (4, 4) [m]."""
    pose: Array = link_frames(q_rad)[-1].copy()
    pose[:3, 3] += FLANGE_OFFSET_M * pose[:3, 2]
    return pose


def inverse_dynamics(
    q_rad: ArrayLike,
    velocity_rad_per_s: ArrayLike,
    acceleration_rad_per_s2: ArrayLike,
    *,
    gravity_m_per_s2: float = GRAVITY_M_PER_S2,
) -> Array:
    """Return the joint torques of a motion, τ = M(q) q̈ + c(q, q̇) + g(q), without the drives.

    Recursive Newton-Euler in the axes of frame 0: outward ω, ω̇ and v̇ of every link, inward
    F = m v̇_c and N = I ω̇ + ω × I ω; gravity enters as an upward acceleration of the base.
    Shapes (6,) [rad, rad/s, rad/s², N m]. Raises InputError for another shape.
    Source: Luh, Walker and Paul (1980), with joint i about z of frame i-1.
    """
    frames = link_frames(q_rad)
    rates = _vector("velocity_rad_per_s", velocity_rad_per_s)
    accelerations = _vector("acceleration_rad_per_s2", acceleration_rad_per_s2)
    axes, origins = frames[:-1, :3, 2], frames[:, :3, 3]
    omega, domega = np.zeros(3), np.zeros(3)
    linear = np.array([0.0, 0.0, gravity_m_per_s2])
    forces, moments, centres = [], [], []
    for i, link in enumerate(PUMA560):
        domega = domega + axes[i] * accelerations[i] + np.cross(omega, axes[i] * rates[i])
        omega = omega + axes[i] * rates[i]
        R = frames[i + 1, :3, :3]
        inertia = R @ np.diag(link.inertia_kg_m2) @ R.T
        centre = origins[i + 1] + R @ np.array(link.com_m)
        forces.append(link.mass_kg * (linear + _swing(omega, domega, centre - origins[i])))
        moments.append(inertia @ domega + np.cross(omega, inertia @ omega))
        centres.append(centre)
        linear = linear + _swing(omega, domega, origins[i + 1] - origins[i])
    torques = np.zeros(len(PUMA560))
    force, moment = np.zeros(3), np.zeros(3)  # of everything beyond, about origin i
    for i in reversed(range(len(PUMA560))):
        moment = moment + np.cross(origins[i + 1] - origins[i], force)
        moment = moment + moments[i] + np.cross(centres[i] - origins[i], forces[i])
        force = force + forces[i]
        torques[i] = axes[i] @ moment
    return torques


def _swing(omega: Array, domega: Array, arm: Array) -> Array:
    """Return ω̇ × r + ω × (ω × r), the acceleration of a point r away on a turning body (3,)."""
    return np.asarray(np.cross(domega, arm) + np.cross(omega, np.cross(omega, arm)))


def gravity_torque(q_rad: ArrayLike, *, gravity_m_per_s2: float = GRAVITY_M_PER_S2) -> Array:
    """Return the torques that hold the arm still, g(q), shape (6,) [N m]."""
    rest = np.zeros(len(PUMA560))
    return inverse_dynamics(q_rad, rest, rest, gravity_m_per_s2=gravity_m_per_s2)


def mass_matrix(q_rad: ArrayLike, *, armature: bool = False) -> Array:
    """Return the joint-space inertia, column i = τ(q, 0, e_i) without gravity, (6, 6) [kg m²].

    With `armature` the drives' inertia at the joints is added to the diagonal.
    """
    n = len(PUMA560)
    columns = [inverse_dynamics(q_rad, np.zeros(n), e, gravity_m_per_s2=0.0) for e in np.eye(n)]
    M: Array = np.column_stack(columns)
    if armature:
        M += np.diag([link.armature_kg_m2 for link in PUMA560])
    return M
