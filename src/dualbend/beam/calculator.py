"""The calculator behind ``dualbend beam``: one state of a bent sheet, in numbers."""

import numpy as np

from dualbend.beam import elastica, rod
from dualbend.beam.sheet import Sheet
from dualbend.errors import InputError


def bent_sheet(
    length_m: float,
    width_m: float,
    thickness_m: float,
    young_pa: float,
    alpha_rad: float,
    half_distance_m: float | None = None,
    weight_n_per_m: float = 0.0,
) -> dict[str, float]:
    """Return force, moment, half distance, rise and largest curvature of a symmetric state.

    Without a half distance the grips are where they feel no moment, paper (3). Without a weight
    that state is the closed form (1)-(5); everything else is solved by :mod:`dualbend.beam.rod`.

    Raises
    ------
    InputError
        A number is out of range, or the state cannot be solved; the message says why.
    """
    sheet = Sheet(
        length_m=length_m,
        width_m=width_m,
        thickness_m=thickness_m,
        young_pa=young_pa,
        poisson_ratio=0.3,  # does not enter: beam bending has no cross contraction
        density_kg_per_m3=1.0,  # does not enter: the weight is given
    )
    try:
        EI = sheet.bending_stiffness_nm2
    except OverflowError as error:
        raise InputError("length, width, thickness or young is too large; all are SI") from error
    zero_moment = elastica.half_distance(alpha_rad, length_m)
    if half_distance_m is None and weight_n_per_m == 0.0:
        return {
            "force_n": elastica.end_force(alpha_rad, EI, length_m),
            "moment_nm": 0.0,
            "half_distance_m": zero_moment,
            "rise_m": elastica.rise(alpha_rad, length_m),
            "curvature_max_per_m": elastica.curvature_max(alpha_rad, length_m),
        }
    half_distance = zero_moment if half_distance_m is None else half_distance_m
    state = rod.solve_symmetric(EI, length_m, alpha_rad, half_distance, weight_n_per_m)
    if not state.converged:
        raise InputError(
            f"no bent state at alpha = {alpha_rad} rad, half distance = {half_distance} m: "
            f"{state.reason}"
        )
    return {
        "force_n": state.end_force_n,
        "moment_nm": state.end_moment_nm,
        "half_distance_m": half_distance,
        "rise_m": state.rise_m,
        "curvature_max_per_m": float(np.max(np.abs(state.curvature_per_m))),
    }
