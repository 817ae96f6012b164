"""Checks of the paper's beam mathematics, (1)-(6), against the rod model.

All numbers are dimensionless: EI = L = 1 and no weight, unless a sheet is given.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from scipy import integrate
from scipy.special import ellipe, ellipk

from dualbend.beam import elastica
from dualbend.beam.path import PiecewiseLinearPath
from dualbend.beam.rod import planar as rod
from dualbend.beam.rod.path_moment import worst_moment
from dualbend.beam.rod.tangent import sheet_tangent, solve_grips
from dualbend.beam.sheet import Sheet
from dualbend.types import Vector

ANGLES_RAD: tuple[float, ...] = (0.05, 0.2, 0.4, 0.6, 0.8, 1.0, 1.2)

_UNIT = Sheet(
    length_m=1.0,
    width_m=0.5,
    thickness_m=1e-3,
    young_pa=12.0 / (0.5 * 1e-9),  # EI = 1 N m²
    poisson_ratio=0.3,
    density_kg_per_m3=1.0,
)


def strip(length_m: float, width_m: float, thickness_m: float) -> Sheet:
    """Return an aluminium strip (70.3 GPa, 2680 kg/m³), sizes in metres."""
    return Sheet(
        length_m=length_m,
        width_m=width_m,
        thickness_m=thickness_m,
        young_pa=70.3e9,
        poisson_ratio=0.33,
        density_kg_per_m3=2680.0,
    )


def closed_form_error(quantity: Literal["force", "moment", "rise"]) -> float:
    """Return the worst difference between (1), (3), (4) and the rod solved between the grips.

    Force relative, moment over EI/L (which (3) says is 0), rise over L; 0.05 to 1.2 rad.
    """
    worst = 0.0
    for alpha in ANGLES_RAD:
        state = rod.solve_symmetric(1.0, 1.0, alpha, elastica.half_distance(alpha, 1.0))
        force = float(elastica.end_force(alpha, 1.0, 1.0))
        error = {
            "force": state.end_force_n / force - 1.0,
            "moment": state.end_moment_nm,
            "rise": state.rise_m - float(elastica.rise(alpha, 1.0)),
        }[quantity]
        worst = max(worst, abs(error))
    return worst


def integral_error(alpha_rad: float = 1.0) -> float:
    """Return the larger relative error of K(m), E(m) used here against (2), (5) by quadrature."""
    m = math.sin(alpha_rad / 2.0) ** 2
    first = integrate.quad(lambda p: 1.0 / math.sqrt(1.0 - m * math.sin(p) ** 2), 0, math.pi / 2)
    second = integrate.quad(lambda p: math.sqrt(1.0 - m * math.sin(p) ** 2), 0, math.pi / 2)
    return max(abs(ellipk(m) / first[0] - 1.0), abs(ellipe(m) / second[0] - 1.0))


def moment_if_m_is_the_modulus(alpha_rad: float = 1.0) -> float:
    """Return the moment over EI/L where m of (2), (5) is read as the modulus (m² as parameter)."""
    parameter = math.sin(alpha_rad / 2.0) ** 4
    x = float(ellipe(parameter) / ellipk(parameter)) - 0.5
    return rod.solve_symmetric(1.0, 1.0, alpha_rad, x).end_moment_nm


def flat_distance() -> float:
    """Return x/L of (3) at α = 0: 1 if x were the distance of the grippers, 1/2 if half of it."""
    return float(elastica.half_distance(0.0, 1.0))


def force_at_no_bending() -> float:
    """Return F L²/(π² EI) of (1) at α = 0."""
    return float(elastica.end_force(0.0, 1.0, 1.0)) / math.pi**2


def smallest_force(alpha_rad: float = 0.6) -> float:
    """Return the end force over that of (1) where the sheet is bent to an arc of a circle.

    At half distance L sin α/(2α) only a moment 2α EI/L acts, so no force is needed.
    """
    arc = rod.solve_symmetric(1.0, 1.0, alpha_rad, math.sin(alpha_rad) / (2.0 * alpha_rad))
    return abs(arc.end_force_n) / float(elastica.end_force(alpha_rad, 1.0, 1.0))


def last_knot(pieces: int) -> float:
    """Return the largest α(k) of (6) as printed [rad]: k/N at k = N."""
    return max(k / pieces for k in range(1, pieces + 1))


def piece_peak(interval_rad: float, piece: int, target_rad: float = 1.0) -> float:
    """Return the peak |M| over EI/L in a linear piece of the path, counted from 0."""
    path = PiecewiseLinearPath.from_interval(1.0, target_rad, interval_rad)
    return float(worst_moment(path, _UNIT).piece_moments_nm[piece]) / _UNIT.bending_stiffness_nm2


def knot_moment(interval_rad: float, target_rad: float = 1.0) -> float:
    """Return the largest |M| over EI/L at the knots of the path, without weight."""
    path = PiecewiseLinearPath.from_interval(1.0, target_rad, interval_rad)
    states = [rod.solve_symmetric(1.0, 1.0, float(a), path.at(float(a))[0]) for a in path.knots[1:]]
    return max(abs(state.end_moment_nm) for state in states)


def _along(interval_rad: float, start_rad: float, target_rad: float) -> tuple[Vector, Vector]:
    """Return the force over that of (1), and the moment over EI/L, along the path."""
    path = PiecewiseLinearPath.from_interval(1.0, target_rad, interval_rad)
    alphas = np.linspace(start_rad, target_rad, 81)
    states = rod.follow_symmetric(1.0, 1.0, [(float(a), path.at(float(a))[0]) for a in alphas])
    optimal = np.asarray(elastica.end_force(alphas, 1.0, 1.0))
    force = np.array([state.end_force_n for state in states]) / optimal
    return force, np.array([state.end_moment_nm for state in states])


def force_ratio(interval_rad: float) -> float:
    """Return the largest end force on the linear path over that of (1) at the same angle."""
    force, _ = _along(interval_rad, 0.02, 1.0)
    return float(force.max())


def force_follows_moment(interval_rad: float) -> float:
    """Return the correlation of the force in excess of (1) with the moment, from 0.2 to 1 rad."""
    force, moment = _along(interval_rad, 0.2, 1.0)
    optimal = np.asarray(elastica.end_force(np.linspace(0.2, 1.0, 81), 1.0, 1.0))
    return float(np.corrcoef((force - 1.0) * optimal, moment)[0, 1])


def moment_per_slope(alpha_rad: float = 0.6) -> float:
    """Return dM/dα over EI/L at fixed x: negative where turning on reduces the moment."""
    state = rod.solve_symmetric(1.0, 1.0, alpha_rad, elastica.half_distance(alpha_rad, 1.0))
    return state.symmetric_stiffness().moment_per_slope_nm_per_rad


def force_per_slope(alpha_rad: float = 0.6) -> float:
    """Return dP/dα over EI/L² at fixed x: negative where turning on reduces the force."""
    state = rod.solve_symmetric(1.0, 1.0, alpha_rad, elastica.half_distance(alpha_rad, 1.0))
    return state.symmetric_stiffness().force_per_slope_n_per_rad


def weight_share(length_m: float, width_m: float, thickness_m: float, alpha_rad: float) -> float:
    """Return which part of the end force of (1) an aluminium strip's weight takes off."""
    sheet = strip(length_m, width_m, thickness_m)
    x = float(elastica.half_distance(alpha_rad, length_m))
    state = rod.solve_symmetric(
        sheet.bending_stiffness_nm2, length_m, alpha_rad, x, sheet.weight_per_length_n_per_m
    )
    return 1.0 - state.end_force_n / _force(sheet, alpha_rad)


def chord_stiffness(length_m: float, width_m: float, thickness_m: float, alpha_rad: float) -> float:
    """Return the stiffness [N/mm] of a strip along x, one grip moving, on the zero-moment path."""
    sheet = strip(length_m, width_m, thickness_m)
    x = float(elastica.half_distance(alpha_rad, length_m))
    state = solve_grips(sheet, np.array([-x, 0.0, alpha_rad] * 2))
    return float(sheet_tangent(state)[0, 0]) / 1e3


def flat_stiffness(length_m: float, width_m: float, thickness_m: float) -> float:
    """Return the stiffness [N/mm] of the flat strip against one moving grip, EA/L."""
    return strip(length_m, width_m, thickness_m).axial_stiffness_n / length_m / 1e3


def moment_made(
    length_m: float,
    width_m: float,
    thickness_m: float,
    alpha_rad: float,
    compliance_mm_per_n: float,
) -> float:
    """Return the moment that yielding to the optimal force makes, over the next piece's peak.

    At a knot the path is right and the moment 0; one arm gives way by c F all the same. The peak
    is that of the 0.2 rad piece that begins there.
    """
    sheet = strip(length_m, width_m, thickness_m)
    given = 1e-3 * compliance_mm_per_n * _force(sheet, alpha_rad)
    # One arm alone: half of it on each side is the same but for a shift of the whole sheet.
    x = float(elastica.half_distance(alpha_rad, length_m)) + given / 2.0
    EI = sheet.bending_stiffness_nm2
    state = rod.solve_symmetric(EI, length_m, alpha_rad, x)
    path = PiecewiseLinearPath(length_m=1.0, knots_rad=(alpha_rad, alpha_rad + 0.2))
    peak = worst_moment(path, _UNIT).moment_nm / _UNIT.bending_stiffness_nm2
    return abs(state.end_moment_nm) / (peak * EI / length_m)


def lever_share(
    length_m: float, width_m: float, thickness_m: float, alpha_rad: float, lever_m: float
) -> float:
    """Return the moment F L_x sin α of the force (1) about the sensor, over the piece's peak.

    The peak is that of the 0.2 rad piece in whose middle α is; the lever arm L_x [m] points along
    the gripper, the force along the chord.
    """
    sheet = strip(length_m, width_m, thickness_m)
    path = PiecewiseLinearPath(length_m=1.0, knots_rad=(alpha_rad - 0.1, alpha_rad + 0.1))
    peak = worst_moment(path, _UNIT).moment_nm / _UNIT.bending_stiffness_nm2
    made = lever_m * math.sin(alpha_rad) * _force(sheet, alpha_rad)
    return made / (peak * sheet.bending_stiffness_nm2 / length_m)


def _force(sheet: Sheet, alpha_rad: float) -> float:
    return float(elastica.end_force(alpha_rad, sheet.bending_stiffness_nm2, sheet.length_m))
