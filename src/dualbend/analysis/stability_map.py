"""The map in (b, k): the largest stiffness at which a loop with these gains is stable."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from dualbend.analysis.stability import Prediction, Row
from dualbend.analysis.stability_blocks import rational
from dualbend.analysis.stability_continuous import largest_stiffness
from dualbend.analysis.stability_loop import LoopElements, si_per_unit
from dualbend.analysis.stability_margins import Sweep, margins
from dualbend.control.admittance import Admittance, AdmittanceConfig, AxisConfig
from dualbend.errors import InputError
from dualbend.run.scenario import Scenario

Vector = NDArray[np.float64]

PER_DECADE = 20
"""Gains in a decade of a map, b and k alike."""

B_DECADES, K_DECADES = (-2, 2), (-4, 1)
"""How far a map reaches from the scenario's gains; the paper's boundary is at k below k_e."""

SHOWN_ANGLES = 4


@dataclass(frozen=True, kw_only=True)
class Panel:
    """The map of one axis by itself.

    ``b`` (n,) and ``k`` (m,) in the scenario's units; ``stiffness``: by bending angle [rad], what
    the loop feels there at the scenario's gains, in SI; ``sampled``: by bending angle, the gain
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


def stability_map(scenario: Scenario, prediction: Prediction) -> list[Panel]:
    """Return the map of every axis that a prediction is about.

    Raises InputError where there is nothing to map.
    """
    if not prediction.rows:
        raise InputError(f"--map: {prediction.reason}")
    elements = LoopElements.from_scenario(scenario)
    sweep = Sweep.of(elements)
    # The last row has all axes that ever act.
    return [
        _panel(scenario, elements, sweep, prediction, name) for name in prediction.rows[-1].axes
    ]


def _panel(
    scenario: Scenario,
    elements: LoopElements,
    sweep: Sweep,
    prediction: Prediction,
    axis: Literal["x", "rotation"],
) -> Panel:
    config = scenario.compliance
    given = config.x if axis == "x" else config.rotation
    assert given is not None
    factor = si_per_unit(config.units, axis)
    b, k = given.b * _reach(B_DECADES), given.k * _reach(K_DECADES)
    omega = 2.0 * math.pi * elements.response.config.natural_frequency_hz
    rows = [row for row in prediction.rows if axis in row.axes]
    shown = [
        rows[i] for i in sorted({round(i) for i in np.linspace(0, len(rows) - 1, SHOWN_ANGLES)})
    ]
    length = "mm" if axis == "x" else "deg"
    si = "m" if axis == "x" else "rad"
    unit = length if config.units == "paper" else si
    load = "N" if axis == "x" else "N m"
    return Panel(
        axis=axis,
        units=(f"{load} s/{unit}", f"{load}/{unit}"),
        b=b,
        k=k,
        sampled={
            row.alpha_rad: _gain_margins(config, given, axis, sweep, felt(row, axis))
            for row in shown
        },
        paper=largest_stiffness(
            b[:, np.newaxis] * factor,
            k[np.newaxis] * factor,
            omega,
            2.0 * elements.response.config.damping_ratio * omega,
        ),
        stiffness={row.alpha_rad: felt(row, axis)[0] for row in shown},
        gains=(given.b, given.k),
    )


def _reach(decades: tuple[int, int]) -> Vector:
    """Return the factors on a gain, equally spaced in the logarithm."""
    return np.logspace(*decades, PER_DECADE * (decades[1] - decades[0]) + 1)


def felt(row: Row, axis: Literal["x", "rotation"]) -> tuple[float, float]:
    """Return the stiffness and the inertia that an axis feels, in SI."""
    if axis == "x":
        return row.stiffness_x_n_per_m, row.inertia_x_kg
    return row.stiffness_rotation_nm_per_rad, row.inertia_rotation_kg_m2


def _gain_margins(
    config: AdmittanceConfig,
    given: AxisConfig,
    axis: Literal["x", "rotation"],
    sweep: Sweep,
    environment: tuple[float, float],
) -> Vector:
    """Return the gain margin (n, m) of the sampled loop; 1 is the boundary.

    With H = g/(1 − a z⁻¹) the boundary depends on the pole a, so on k/b, and on g as a factor
    only: one sweep for each diagonal of the map does.
    """
    along_b, along_k = _reach(B_DECADES), _reach(K_DECADES)
    found = np.empty((along_b.size, along_k.size))
    by_diagonal: dict[int, float] = {}
    for i, of_b in enumerate(along_b):
        for j, of_k in enumerate(along_k):
            changed = msgspec.structs.replace(given, b=given.b * of_b, k=given.k * of_k)
            filters = Admittance(msgspec.structs.replace(config, **{axis: changed}))
            part = filters.x if axis == "x" else filters.rotation
            assert part is not None
            if j - i not in by_diagonal:
                shape = rational((np.ones(1), part.transfer_function()[1]), sweep.z_inverse)
                locus = (sweep.shared @ environment * shape)[:, np.newaxis]
                by_diagonal[j - i] = margins(sweep.frequency_hz, locus, stable=True).gain
            found[i, j] = by_diagonal[j - i] / part.gain
    return found
