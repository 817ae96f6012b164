"""What a scenario's controller knows beforehand: the zero-moment states of its sheet, its arms."""

from __future__ import annotations

import functools
import math

import numpy as np

from dualbend.arm.pair import ArmPair
from dualbend.beam import elastica
from dualbend.beam.rod.state import RodState
from dualbend.beam.rod.tangent import sheet_tangent, solve_grips
from dualbend.beam.sheet import Sheet
from dualbend.control.alter import AlterConfig
from dualbend.control.clock import steps_per_cycle
from dualbend.control.compliance.admittance import Admittance, ModelAdmittanceConfig
from dualbend.control.compliance.mass_spring_damper import (
    MassSpringDamperConfig,
    SpatialAdmittance,
)
from dualbend.control.compliance.model import ModelAdmittance
from dualbend.control.compliance.own import OwnComplianceConfig, OwnController
from dualbend.control.compliance.pair import PairCompliance
from dualbend.control.compliance.predictor import ResponseModel
from dualbend.control.compliance.schedule import KnownSheet
from dualbend.control.controller import Controller
from dualbend.control.filters import LowPassConfig
from dualbend.errors import InputError, refusing
from dualbend.mechanics.compliance import series_stiffness
from dualbend.mechanics.coupling import Coupling, deviation_angle, wrench_response
from dualbend.run.arms import joint_stiffness, one_kind
from dualbend.scenario.scenario import Scenario
from dualbend.scenario.sheet import SheetConfig
from dualbend.scene.arm_compliance import ArmCompliance
from dualbend.scene.cell import CellConfig, GraspConfig
from dualbend.types import SIDES, Side, Vector

_FIRST_RAD, _DENSE_TO_RAD, _DENSE_RAD, _STEP_RAD = 0.01, 0.1, 0.005, 0.025
"""The tables' angles: denser where the stiffness falls steeply."""

_NEARER = np.array([3.0, 2.0, 1.4, 1.0, 0.7, 0.4, 0.2, 0.1, 0.04, 0.0, -0.02, -0.05, -0.1]) / 400
"""How much nearer than in the zero-moment state the grips are, over the length."""

_NEWTON_STEPS, _LARGEST_STEP_M, _ZERO_NM = 30, 2e-4, 1e-9


def make_compliance(scenario: Scenario) -> Controller:
    """Return the scenario's controller of both arms.

    Raises InputError where the states of its model are not found or out of reach, or a class of the
    user's cannot be made.
    """
    if isinstance(scenario.compliance, OwnComplianceConfig):
        with refusing(f"scenario {scenario.name!r}"):
            return OwnController(scenario.compliance, scenario)
    sensing, complying = (
        [i for i, side in enumerate(SIDES) if side in sides]
        for sides in (scenario.compliance.sensing, scenario.compliance.complying)
    )
    if isinstance(scenario.compliance, MassSpringDamperConfig):
        return SpatialAdmittance(
            scenario.compliance, period_s=scenario.period_s, sensing=sensing, complying=complying
        )
    admittance = make_admittance(scenario, (len(sensing),))
    return PairCompliance(admittance, sensing=sensing, complying=complying)


def make_admittance(scenario: Scenario, shape: tuple[int, ...] = ()) -> Admittance:
    """Return the admittance of one arm or of a leading shape: the paper's, or that with a model.

    Raises InputError where the model's states are not found or out of reach.
    """
    config = scenario.compliance
    if not isinstance(config, ModelAdmittanceConfig) or not config.beyond:
        return Admittance(config, period_s=scenario.period_s, shape=shape)
    own, nominal = (
        response_model(scenario, delay_cycles=delay_cycles, channels=channels, shape=shape)
        for delay_cycles, channels in ((scenario.robot.longest_delay, 2), (0, 3))
    )
    return ModelAdmittance(
        config,
        known=known_sheet(scenario),
        response=scenario.robot.response_of("left"),
        own=own,
        nominal=nominal,
        period_s=scenario.period_s,
        shape=shape,
    )


def reading_age_steps(scenario: Scenario) -> int:
    """Return the age of a reading when a cycle uses it [physics steps], at least 1.

    As in scene.simulation: the force that acts during a step is known when the step is done. Of
    sensors that sample by their own clock it is the mean, rounded up to whole steps, unless their
    samples keep step with the commands.
    """
    step_s = scenario.step_s
    least, sampling = (
        max(scenario.sensor.latency_steps(step_s), 1),
        scenario.sensor.sampling_steps(step_s),
    )
    if sampling is None:
        return least
    if steps_per_cycle(step_s, scenario.period_s) % sampling == 0:
        return least + (1 - least) % sampling
    return least + sampling // 2


def response_model(
    scenario: Scenario,
    *,
    delay_cycles: int,
    channels: int,
    low_pass: LowPassConfig | None = None,
    age_steps: int | None = None,
    shape: tuple[int, ...] = (),
) -> ResponseModel:
    """Return the model of a scenario's robot response as its sensor reads it.

    ``low_pass`` and ``age_steps`` are the scenario's own where they are not given.
    """
    return ResponseModel(
        response=scenario.robot.response_of("left"),
        low_pass=low_pass or scenario.filter,
        delay_cycles=delay_cycles,
        steps=steps_per_cycle(scenario.step_s, scenario.period_s),
        age_steps=age_steps or reading_age_steps(scenario),
        channels=channels,
        period_s=scenario.period_s,
        shape=shape,
    )


def known_sheet(scenario: Scenario) -> KnownSheet:
    """Return the tables for a scenario's path."""
    return _known_sheet(
        scenario.sheet,
        scenario.cell,
        one_kind(scenario, "a model in the compliance"),
        tuple(joint_stiffness(scenario).tolist()),
        scenario.robot.servo.integral is not None,
        scenario.grasp,
        (scenario.compliance.sensing, scenario.compliance.complying),
        scenario.robot.alter,
        scenario.path.start_rad,
        scenario.path.end_rad,
        scenario.sensor.lever_arm_m,
    )


@functools.lru_cache(maxsize=8)
def _known_sheet(
    sheet_config: SheetConfig,
    cell: CellConfig,
    pair: ArmPair,
    stiffness: tuple[float, ...],
    integrates: bool,
    grasp: GraspConfig,
    sides: tuple[tuple[Side, ...], tuple[Side, ...]],
    alter: AlterConfig,
    start_rad: float,
    end_rad: float,
    lever_arm_m: float,
) -> KnownSheet:
    if not sheet_config.sheet().is_symmetric:
        raise InputError(
            "sheet.profile: a compliance that knows its sheet needs one that is alike from both "
            'ends; compliance.kind = "admittance" without a schedule does not'
        )
    sheet, arm = sheet_config.sheet(), ArmCompliance(pair, stiffness, grasp, integrates=integrates)
    sensors, movers = sides
    sensing = SIDES.index(next(side for side in SIDES if side in sensors))
    arms_share = max(len(movers), 1)
    rows = []
    state: RodState | None = None
    offset_m = 0.0
    # From the bent end towards the flat sheet, each state from the one before.
    for alpha in _angles(end_rad)[::-1]:
        found = zero_moment(sheet, alpha, offset_m, state)
        if found is None:
            break
        offset_m, state = found
        half_distance = elastica.half_distance(alpha, sheet.length_m) + offset_m
        rise = elastica.rise(alpha, sheet.length_m)
        arm.move(np.array([-half_distance, cell.sheet_height_m + rise, alpha]))
        coupling = Coupling.between(sensors, movers, deviation_angle(alter.mode, alpha, start_rad))
        compliance = coupling.arm_compliance(arm.rest_compliance, arm.grasp)
        series = series_stiffness(sheet_tangent(state), compliance)
        response = wrench_response(series, sensing, coupling.source)
        squeeze = float(compliance[0, 0] + compliance[3, 3])
        compression = _compression(sheet, alpha, half_distance, squeeze, state)
        if compression is None:
            break
        rows.append(
            (
                alpha,
                state.left.force_x_n,
                response @ coupling.deviation_jacobian,
                arm.tool_inertia,
                coupling.deviation_jacobian,
                compression[0] / arms_share,
                compression[1],
            )
        )
    if len(rows) < 2:
        raise InputError(
            f"compliance: the sheet's zero-moment state was not found at {end_rad:.3f} rad"
        )
    columns = [np.array(column) for column in zip(*rows[::-1], strict=True)]
    return KnownSheet(
        alpha_rad=columns[0],
        force_x_n=columns[1],
        stiffness=columns[2],
        inertia=columns[3],
        deviation_jacobian=columns[4],
        compression_m=columns[5],
        compression_n=columns[6],
        force_z_n=-sheet.weight_per_length_n_per_m * sheet.length_m / 2.0,
        lever_arm_m=lever_arm_m,
    )


def _angles(end_rad: float) -> list[float]:
    dense = np.arange(_FIRST_RAD, _DENSE_TO_RAD, _DENSE_RAD)
    last = max(end_rad, _DENSE_TO_RAD + _STEP_RAD)
    rest = np.linspace(_DENSE_TO_RAD, last, math.ceil((last - _DENSE_TO_RAD) / _STEP_RAD) + 1)
    return [*dense.tolist(), *rest.tolist()]


def zero_moment(
    sheet: Sheet, alpha_rad: float, offset_m: float = 0.0, guess: RodState | None = None
) -> tuple[float, RodState] | None:
    """Return how much further apart than (3) the grips feel no moment, and the state there."""
    x = elastica.half_distance(alpha_rad, sheet.length_m)
    for _ in range(_NEWTON_STEPS):
        grips = np.array([-(x + offset_m), 0.0, alpha_rad] * 2)
        state = solve_grips(sheet, grips, guess)
        if not state.converged:
            return None
        moment = state.left.moment_nm
        if abs(moment) < _ZERO_NM:
            return offset_m, state
        guess = state
        tangent = sheet_tangent(state)
        step = -moment / float(tangent[2, 0] + tangent[2, 3])
        offset_m += math.copysign(min(abs(step), _LARGEST_STEP_M), step)
    return None


def _compression(
    sheet: Sheet,
    alpha_rad: float,
    half_distance_m: float,
    compliance: float,
    state: RodState,
) -> tuple[Vector, Vector] | None:
    """Return by how much the commanded grips are nearer, falling, and the force x on the arm."""
    middle = int(np.flatnonzero(_NEARER == 0.0)[0])
    forces = np.full(len(_NEARER), state.left.force_x_n)
    for part in (range(middle - 1, -1, -1), range(middle + 1, len(_NEARER))):
        guess = state
        for i in part:
            x = half_distance_m - _NEARER[i] * sheet.length_m / 2.0
            guess = solve_grips(sheet, np.array([-x, 0.0, alpha_rad] * 2), guess)
            if not guess.converged:
                return None
            forces[i] = guess.left.force_x_n
    nearer = _NEARER * sheet.length_m - compliance * (forces - state.left.force_x_n)
    return nearer, forces
