"""Map of stability in (b, k): margins of the sampled loop, and the paper's largest stiffness."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import msgspec
import numpy as np

from dualbend.control.clock import ComplexVector, rational
from dualbend.control.compliance.admittance import (
    Admittance,
    AdmittanceAxis,
    ComplianceConfig,
    si_per_unit,
)
from dualbend.control.compliance.base import AxisConfig
from dualbend.errors import InputError
from dualbend.scenario.scenario import Scenario
from dualbend.stability.continuous import largest_stiffness, paper_loop
from dualbend.stability.margins import frequency_grid, margins
from dualbend.stability.plant.environment import environments
from dualbend.stability.prediction import Prediction
from dualbend.stability.sampled import LoopElements, environment_loops
from dualbend.types import Vector

PER_DECADE = 20
"""Gains in a decade of a map, b and k alike."""

B_TIMES, K_TIMES = (1e-2, 1e2), (1e-4, 1e1)
"""How far a map reaches, times the scenario's gains; the paper's boundary is at k below k_e."""

SHOWN_ANGLES = 4


@dataclass(frozen=True, kw_only=True)
class Panel:
    """The map of one axis by itself.

    ``b`` (n,) and ``k`` (m,) in the scenario's units; ``stiffness``: by bending angle [rad], that
    of the loop at the scenario's gains, in SI; ``sampled``: by bending angle, the gain
    margin (n, m) of the sampled loop; ``paper`` (n, m): the largest stiffness that (23) allows;
    ``gains``: b and k set.
    """

    axis: Literal["x", "rotation"]
    units: tuple[str, str]
    b: Vector
    k: Vector
    sampled: dict[float, Vector]
    paper: Vector
    stiffness: dict[float, float]
    gains: tuple[float, float]


def stability_map(
    scenario: Scenario,
    prediction: Prediction,
    b_times: tuple[float, float] = B_TIMES,
    k_times: tuple[float, float] = K_TIMES,
) -> list[Panel]:
    """Return the map of every axis that a prediction is about, times the scenario's gains.

    Raises InputError where there is nothing to map, or a range is empty or not positive.
    """
    for key, (low, high) in (("--map-b", b_times), ("--map-k", k_times)):
        if not 0.0 < low < high < math.inf:
            raise InputError(
                f"{key} {low:g} {high:g}: an empty range; needs two growing multiples of the "
                "scenario's gain above 0, e.g. 0.01 100"
            )
    if beyond := scenario.compliance.beyond:
        raise InputError(
            f"--map: scenario {scenario.name!r}: {beyond}: its loop is no point of a map in (b, k)"
        )
    factors = _reach(*b_times), _reach(*k_times)
    if not prediction.rows:
        raise InputError(f"--map: {prediction.reason}")
    elements = LoopElements.from_scenario(scenario)
    # The last row has all axes that ever act.
    return [
        _panel(scenario, elements, prediction, name, factors) for name in prediction.rows[-1].axes
    ]


def _panel(
    scenario: Scenario,
    elements: LoopElements,
    prediction: Prediction,
    axis: Literal["x", "rotation"],
    factors: tuple[Vector, Vector],
) -> Panel:
    config = scenario.compliance
    given: AxisConfig = getattr(config, axis)
    factor = si_per_unit(config.units, axis)
    b, k = given.b * factors[0], given.k * factors[1]
    robot, index = paper_loop(elements, axis, 0.0), 0 if axis == "x" else 1
    rows = [row for row in prediction.rows if axis in row.axes]
    shown = [
        rows[i] for i in sorted({round(i) for i in np.linspace(0, len(rows) - 1, SHOWN_ANGLES)})
    ]
    filters, sampled = _filters(config, axis, factors, scenario.period_s), {}
    at = environments(scenario, [row.alpha_rad for row in shown])
    # The stiffness, but not the mode, is that of the scenario's gains.
    for row, e in zip(shown, at, strict=True):
        loop = environment_loops(elements, e, (axis == "x", axis == "rotation"))[row.moving]
        response = loop.wrench_response(frequency_grid(scenario.period_s)[1])[:, 0, 0]
        sampled[row.alpha_rad] = _gain_margins(response, *filters, scenario.period_s)
    return Panel(
        axis=axis,
        units=gain_units(config, axis),
        b=b,
        k=k,
        sampled=sampled,
        paper=largest_stiffness(
            b[:, np.newaxis] * factor,
            k[np.newaxis] * factor,
            robot.omega_rad_per_s,
            robot.two_xi_omega,
        ),
        stiffness={
            row.alpha_rad: (row.stiffness_x_n_per_m, row.stiffness_rotation_nm_per_rad)[index]
            for row in shown
        },
        gains=(given.b, given.k),
    )


def _reach(low: float, high: float) -> Vector:
    """Return the factors on a gain, as far apart in every range: a diagonal is one k/b."""
    steps = max(1, round(PER_DECADE * math.log10(high / low)))
    return low * 10.0 ** (np.arange(steps + 1) / PER_DECADE)


def gain_units(config: ComplianceConfig, axis: Literal["x", "rotation"]) -> tuple[str, str]:
    """Return the units of b and k."""
    if config.units == "sheet":
        return "s", "1"
    length, si, load = ("mm", "m", "N") if axis == "x" else ("deg", "rad", "N m")
    unit = length if config.units == "paper" else si
    return f"{load} s/{unit}", f"{load}/{unit}"


def _filters(
    config: ComplianceConfig,
    axis: Literal["x", "rotation"],
    factors: tuple[Vector, Vector],
    period_s: float,
) -> tuple[Vector, dict[int, ComplexVector]]:
    """Return the filter's factor g (n, m), and by diagonal of the map its shape 1/(1 − a z⁻¹).

    Along a diagonal k/b is one and so is the pole a, and g falls as 1/b: δ = F/(b s + k) is
    linear. One filter for each diagonal does.
    """
    given: AxisConfig = getattr(config, axis)
    along_b, along_k = factors
    n, m = along_b.size, along_k.size
    gains = np.empty((n, m))
    shapes: dict[int, ComplexVector] = {}
    for diagonal in range(1 - n, m):
        rows = np.arange(max(0, -diagonal), min(n, m - diagonal))
        first = int(rows[0])
        changed = msgspec.structs.replace(
            given,
            b=given.b * float(along_b[first]),
            k=given.k * float(along_k[first + diagonal]),
        )
        filters = Admittance(msgspec.structs.replace(config, **{axis: changed}), period_s=period_s)
        part: AdmittanceAxis = getattr(filters, axis)
        gains[rows, rows + diagonal] = part.gain * along_b[first] / along_b[rows]
        shapes[diagonal] = rational(
            (np.ones(1), part.transfer_function()[1]), frequency_grid(period_s)[1]
        )
    return gains, shapes


def _gain_margins(
    response: ComplexVector, gains: Vector, shapes: dict[int, ComplexVector], period_s: float
) -> Vector:
    """Return the gain margin (n, m) of the sampled loop; 1 is the boundary.

    With H = g/(1 − a z⁻¹), g is a factor only: one sweep for each diagonal of the map does.
    """
    n, m = gains.shape
    frequencies, _ = frequency_grid(period_s)
    along = [
        margins(frequencies, (response * shapes[diagonal])[:, np.newaxis], stable=True).gain
        for diagonal in range(1 - n, m)
    ]
    return np.asarray(np.array(along)[np.arange(m) - np.arange(n)[:, np.newaxis] + n - 1] / gains)
