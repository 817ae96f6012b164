"""Properties as they were written down, by hand, from sources: nothing here is read or computed.

Reference of the rows that check a property. A number here is changed only where its source says
another one, never to make a row pass. *Recalled*: known from there, and not looked up again.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, kw_only=True)
class Strip:
    """The strip of the shipped experiment, by hand: 400 x 57 x 0.5 mm of aluminium 5052-H32.

    E = 70.3 GPa, ν = 0.33, ρ = 2680 kg/m³: ASM data sheet MA5052H32 (recalled). With them

    * ρ L w t = 2680 · 0.4 · 0.057 · 0.0005 = 0.030552 kg
    * I = w t³/12 = 0.057 · 1.25e-10 / 12 = 5.9375e-13 m⁴, EI = 0.041740625 N m²
    * G = E / 2.66 = 26.4286 GPa, J = (w t³/3) (1 − 0.63 t/w) = 2.361875e-12 m⁴ (Timoshenko and
      Goodier, Theory of Elasticity, art. 109), GJ = 0.0624210 N m²
    * E w t = 70.3e9 · 2.85e-5 = 2.00355e6 N
    * first mode between clamps (4.730041/L)² √(EI/(ρ w t)) / 2π = 16.4520 Hz (Blevins, Formulas for
      Natural Frequency and Mode Shape, table 8-1)
    * end force of the pinned elastica of end slope 1 rad, (2 K(sin 0.5)/L)² EI = 2.92769 N, with
      K = 1.674994 (Abramowitz and Stegun, table 17.2, at 28.65°)
    """

    length_m: float = 0.4
    mass_kg: float = 0.030552
    bending_stiffness_nm2: float = 0.041740625
    torsional_stiffness_nm2: float = 0.0624210
    axial_stiffness_n: float = 2.00355e6
    first_clamped_hz: float = 16.4520
    end_force_at_1_rad_n: float = 2.92769


STRIP: Final = Strip()


@dataclass(frozen=True, kw_only=True)
class Substance:
    """What a strip of the size of :data:`STRIP` of a material has: mass [kg], EI and GJ [N m²].

    Volume 1.14e-5 m³, I = 5.9375e-13 m⁴, J = 2.361875e-12 m⁴; ``within``: how far sources differ
    about the moduli.
    """

    mass_kg: float
    bending_stiffness_nm2: float
    torsional_stiffness_nm2: float
    within: float


SUBSTANCES: Final = {
    # ASM data sheet MA5052H32: 2.68 g/cm³, 70.3 GPa, 25.9 GPa in shear (recalled).
    "5052-H32": Substance(
        mass_kg=0.030552,
        bending_stiffness_nm2=0.041740625,
        torsional_stiffness_nm2=0.06117,
        within=0.03,
    ),
    # NEMA grade FR-4: specific gravity 1.85 (1.82 in others' tables), 3.5e6 psi = 24 GPa
    # lengthwise; flexural tests have 2.7e6 psi (least) to 24.3 GPa. In the plane's shear 6 GPa, as
    # of the laminate in the Ansys example of a printed circuit board.
    "FR-4": Substance(
        mass_kg=0.02109,
        bending_stiffness_nm2=0.01425,
        torsional_stiffness_nm2=0.01417,
        within=0.05,
    ),
    # Recalled. CRC Handbook: copper 8.96 g/cm³; ASM Handbook vol. 2, C11000: 115 to 117 and 44 GPa.
    "copper-foil": Substance(
        mass_kg=0.102144,
        bending_stiffness_nm2=0.069469,
        torsional_stiffness_nm2=0.10392,
        within=0.05,
    ),
}
"""By the name in the library of materials."""


@dataclass(frozen=True, kw_only=True)
class Arm:
    """An arm as it is published.

    ``links_kg``: moving links that have a mass there, from ``first_link`` on; ``radius_m`` and
    ``height_m``: the flange's place off the base's axis and above its origin, all joints at zero;
    ``range_deg``: of each joint.
    """

    first_link: int = 1
    links_kg: tuple[float, ...] = ()
    radius_m: float
    height_m: float
    range_deg: tuple[tuple[float, float], ...]


# The data sheets have ±360° for all joints; ur_description halves the elbow's for planners.
_UR_RANGE: Final = ((-360.0, 360.0),) * 2 + ((-180.0, 180.0),) + ((-360.0, 360.0),) * 3

ARMS: Final[dict[str, Arm]] = {
    # Masses: Armstrong, Khatib and Burdick (1986), the waist's link is not in it. Flange at zero:
    # x = a2 + a3 = 431.8 + 20.3 mm, y = −150.05 mm, z = 431.8 + 56.25 mm; ranges: the PUMA 500
    # manual, as in Corke and Armstrong-Hélouvry (1994).
    "puma560": Arm(
        first_link=2,
        links_kg=(17.4, 4.8, 0.82, 0.34, 0.09),
        radius_m=0.47635,
        height_m=0.48805,
        range_deg=((-160, 160), (-45, 225), (-225, 45), (-110, 170), (-100, 100), (-266, 266)),
    ),
    # UR3, UR5, UR10: Universal Robots, "DH parameters for calculations of kinematics and
    # dynamics", CB3 series (UR3's and UR5's masses recalled). Radius √((a2 + a3)² + (d4 + d6)²),
    # height d1 − d5.
    "ur3": Arm(
        links_kg=(2.0, 3.42, 1.26, 0.8, 0.8, 0.35),
        radius_m=0.49648,  # 0.45690, 0.19425
        height_m=0.06655,  # 0.1519 − 0.08535
        range_deg=_UR_RANGE,
    ),
    "ur5": Arm(
        links_kg=(3.7, 8.393, 2.33, 1.219, 1.219, 0.1879),
        radius_m=0.83938,  # 0.81725, 0.19145
        height_m=-0.00549,  # 0.089159 − 0.09465
        range_deg=_UR_RANGE,
    ),
    "ur10": Arm(
        links_kg=(7.1, 12.7, 4.27, 2.0, 2.0, 0.365),
        radius_m=1.21168,  # 1.1843, 0.256141
        height_m=0.0116,  # 0.1273 − 0.1157
        range_deg=_UR_RANGE,
    ),
    # Franka Control Interface documentation, "Robot and interface specifications": radius a7,
    # height 0.333 + 0.316 + 0.384 − 0.107 m; limits ±2.8973, ±1.7628, −3.0718 ... −0.0698,
    # −0.0175 ... 3.7525 rad (recalled). It publishes no masses.
    "panda": Arm(
        radius_m=0.088,
        height_m=0.926,
        range_deg=(
            *((-166, 166), (-101, 101), (-166, 166), (-176, -4)),
            *((-166, 166), (-1, 215), (-166, 166)),
        ),
    ),
    # UFACTORY xArm user manual: zero position x = 206 mm, z = 120.5 mm; ranges (recalled).
    "xarm7": Arm(
        radius_m=0.206,
        height_m=0.1205,
        range_deg=(
            *((-360, 360), (-118, 120), (-360, 360), (-11, 225)),
            *((-360, 360), (-97, 180), (-360, 360)),
        ),
    ),
}
"""Of the Z1 nothing was found beside its own URDF."""
