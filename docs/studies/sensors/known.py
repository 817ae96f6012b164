"""The moment that the sensors of ``learned`` tell wrongly in the hold, by what is known of them."""

from __future__ import annotations

import numpy as np

from dualbend.beam import elastica
from dualbend.beam.sheet import GRAVITY_M_PER_S2
from dualbend.control.calibration import ACCURACY, Calibration, uncalibrated, weight_of
from dualbend.control.force_torque import ForceTorqueConfig
from dualbend.run.cell import believed_tool
from dualbend.run.make import make_run
from dualbend.scenario.load import load_scenario
from dualbend.scene.observation import tool_mass_and_centre
from dualbend.table import Table, quantity
from dualbend.types import SIDES, Vector

KNOWN = (
    ("the data sheet", "none"),
    ("the tool's own weight in 12 attitudes", "{weight_kg=0.0}"),
    ("1.5 kg, gripped 4 times", "{grips=4}"),
    ("1.5 kg, gripped 8 times", "{grips=8}"),
    ("24 attitudes as well", "{attitudes=24,grips=8}"),
)
"""``sensor.calibration`` of each row."""


def load_at(alpha_rad: float, force_n: float, lever_m: float) -> tuple[Vector, Vector]:
    """Return an end force's wrench at the sensor (6,) and gravity there (3,), both in S."""
    sine, cosine = np.sin(alpha_rad), np.cos(alpha_rad)
    force = -force_n * np.array([cosine, 0.0, sine])
    down = GRAVITY_M_PER_S2 * np.array([sine, 0.0, -cosine])
    return np.concatenate([force, np.cross([lever_m, 0.0, 0.0], force)]), down


def moment_at_grip(sensor: ForceTorqueConfig) -> Vector:
    """Return what makes the moment about y at the grip of a wrench (6,) at the sensor."""
    return np.array([0.0, 0.0, sensor.lever_arm_m, 0.0, 1.0, 0.0])


def balance_sd_nm(sensor: ForceTorqueConfig, sheet_ends: tuple[Vector, Vector, Vector]) -> float:
    """Return how well a moment is known after both arms' readings of one sheet, all else exact.

    ``sheet_ends``: bending angles, end forces [N] and half distances [m] along the path (k,). Of
    both sensors' C, the data sheet and F₁ + F₂ + W = 0 in x and z, and moments about the middle.
    """
    full = np.repeat(sensor.full_scale, 3)
    precision = np.diag(np.tile((ACCURACY * np.divide.outer(full, full)).ravel() ** -2.0, 2))
    to_moment, told = moment_at_grip(sensor), np.zeros(36)
    for alpha, force, half in zip(*sheet_ends, strict=True):
        wrench, _ = load_at(alpha, force, sensor.lever_arm_m)
        x, z = (
            np.kron(np.r_[axis, 0.0, 0.0, 0.0], wrench)
            for axis in (
                [np.cos(alpha), 0.0, np.sin(alpha)],
                [-np.sin(alpha), 0.0, np.cos(alpha)],
            )
        )
        told = np.kron(to_moment, wrench)
        turning = told + half * z
        for left, right, noise in ((x, -x, 0.01), (z, z, 0.01), (turning, -turning, 0.002)):
            row = np.concatenate([left, right])
            precision += np.outer(row, row) / noise**2
    last = np.concatenate([told, np.zeros(36)])
    return float(np.sqrt(last @ np.linalg.solve(precision, last)))


def table(cells: int) -> Table:
    """Return predicted standard deviation and rms of what is left, over both arms of cells."""
    scenario = load_scenario("learned")
    sheet, sensor, end = scenario.sheet.sheet(), scenario.sensor, scenario.path.end_rad
    alphas = np.linspace(scenario.path.start_rad, end, 19)
    forces = elastica.end_force(alphas, sheet.bending_stiffness_nm2, sheet.length_m)
    halves = elastica.half_distance(alphas, sheet.length_m)
    rows: list[tuple[str, float, float | None]] = [
        (name, *_row(setting, float(forces[-1]), end, cells)) for name, setting in KNOWN
    ]
    balance = 1e3 * balance_sd_nm(sensor, (alphas, forces, halves))
    rows.insert(1, ("both arms' readings of one sheet, all else exact", balance, None))
    columns = (
        "known of the sensors",
        quantity("predicted", "mN m", ".1f"),
        quantity("left", "mN m", ".1f"),
    )
    return Table(columns, rows)


def _row(setting: str, force_n: float, end_rad: float, cells: int) -> tuple[float, float]:
    predicted, left = list[float](), list[float]()
    for seed in range(cells):
        cell = make_run(load_scenario("learned", [f"sensor.calibration={setting}"], seed)).cell
        scenario, model = cell.scenario, cell.simulation.model
        wrench, down = load_at(end_rad, force_n, scenario.sensor.lever_arm_m)
        for side in SIDES:
            found: Calibration = cell.calibrations.get(side) or uncalibrated(
                scenario.sensor, believed_tool(scenario, model, side)
            )
            predicted.append(found.moment_sd_nm(wrench, down, scenario.sensor.lever_arm_m))
            mass, centre = tool_mass_and_centre(model, side)
            truth = scenario.imperfections.sensor.matrix(seed, side, scenario.sensor)
            read = truth @ (wrench + weight_of(down) @ np.r_[mass, mass * centre])
            tool = weight_of(down) @ np.r_[found.mass_kg, found.mass_kg * found.centre_m]
            error = found.matrix @ read - tool - wrench
            left.append(float(moment_at_grip(scenario.sensor) @ error))
    return 1e3 * float(np.mean(predicted)), 1e3 * float(np.sqrt(np.mean(np.square(left))))
