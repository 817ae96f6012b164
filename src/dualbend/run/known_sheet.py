"""What a scenario's controller knows beforehand: the zero-moment states of its sheet, its arms."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence

import mujoco
import numpy as np

from dualbend.arm.mjcf import GRIP_SITE
from dualbend.arm.pair import ArmPair
from dualbend.beam import elastica
from dualbend.beam.rod.state import RodState
from dualbend.beam.rod.tangent import sheet_tangent, solve_grips
from dualbend.beam.sheet import Sheet
from dualbend.control.alter import AlterConfig
from dualbend.control.clock import COMMAND_PERIOD_S, steps_per_cycle
from dualbend.control.compliance.admittance import Admittance
from dualbend.control.compliance.model import ModelAdmittance
from dualbend.control.compliance.pair import PairCompliance
from dualbend.control.compliance.predictor import ResponseModel
from dualbend.control.compliance.schedule import KnownSheet
from dualbend.errors import InputError
from dualbend.mechanics.tool import tool_inertia
from dualbend.run.arms import arm_pair, joint_stiffness, one_kind
from dualbend.scenario.scenario import Scenario
from dualbend.scenario.sections import ArmsConfig
from dualbend.scenario.sheet import SheetConfig
from dualbend.scene.cell import CellConfig, GraspConfig, robots_only
from dualbend.scene.ik import InverseKinematics, grip_targets
from dualbend.types import SIDES, Vector

_FIRST_RAD, _DENSE_TO_RAD, _DENSE_RAD, _STEP_RAD = 0.01, 0.1, 0.005, 0.025
"""The tables' angles: denser where the stiffness falls steeply."""

_PRESSED = np.array([3.0, 2.0, 1.4, 1.0, 0.7, 0.4, 0.2, 0.1, 0.04, 0.0, -0.02, -0.05, -0.1]) / 400
"""How much nearer than in the zero-moment state the grips are, over the length."""

_NEWTON_STEPS, _LARGEST_STEP_M, _ZERO_NM = 30, 2e-4, 1e-9


def make_compliance(scenario: Scenario) -> PairCompliance:
    """Return the scenario's own controller of both arms.

    Raises InputError where the states of its model are not found or out of reach.
    """
    sensing, complying = (
        [i for i, side in enumerate(SIDES) if side in sides]
        for sides in (scenario.arms.sensing, scenario.arms.complying)
    )
    admittance = make_admittance(scenario, (len(sensing),))
    return PairCompliance(admittance, sensing=sensing, complying=complying)


def make_admittance(scenario: Scenario, shape: tuple[int, ...] = ()) -> Admittance:
    """Return the admittance of one arm or of a leading shape: the paper's, or that with a model.

    Raises InputError where the model's states are not found or out of reach.
    """
    config = scenario.compliance
    if not config.modelled:
        return Admittance(config, period_s=COMMAND_PERIOD_S, shape=shape)
    step_s = scenario.physics.step_s
    models = [
        ResponseModel(
            response=scenario.response,
            low_pass=scenario.filter,
            delay_cycles=delay_cycles,
            steps=steps_per_cycle(step_s, COMMAND_PERIOD_S),
            # As in scene.simulation: the force that acts during a step is known when it is done.
            age_steps=max(scenario.sensor.latency_steps(step_s), 1),
            channels=channels,
            period_s=COMMAND_PERIOD_S,
            shape=shape,
        )
        for delay_cycles, channels in ((scenario.alter.delay_cycles, 2), (0, 3))
    ]
    return ModelAdmittance(
        config,
        known=known_sheet(scenario),
        response=scenario.response,
        own=models[0],
        nominal=models[1],
        period_s=COMMAND_PERIOD_S,
        shape=shape,
    )


def known_sheet(scenario: Scenario) -> KnownSheet:
    """Return the tables for a scenario's path."""
    return _known_sheet(
        scenario.sheet,
        scenario.cell,
        one_kind(arm_pair(scenario), "a model in the compliance"),
        tuple(joint_stiffness(scenario).tolist()),
        scenario.grasp,
        scenario.arms,
        scenario.alter,
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
    grasp: GraspConfig,
    arms: ArmsConfig,
    alter: AlterConfig,
    start_rad: float,
    end_rad: float,
    lever_arm_m: float,
) -> KnownSheet:
    sheet, give = sheet_config.sheet(), ArmGive(pair, stiffness, grasp)
    sensing = [i for i, side in enumerate(SIDES) if side in arms.sensing]
    complying = [i for i, side in enumerate(SIDES) if side in arms.complying]
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
        compliance, inertia = give.at(-half_distance, cell.sheet_height_m + rise, alpha)
        tangent = sheet_tangent(state)
        # Dry friction holds an arm that nothing commands: only its grasp gives way.
        gives = np.zeros((6, 6))
        for i in range(2):
            part = slice(3 * i, 3 * i + 3)
            gives[part, part] = give.grasp + compliance * float(i in complying)
        series = np.linalg.solve(np.eye(6) + tangent @ gives, tangent)
        phi = {"world": 0.0, "tool": alpha, "tool-frozen": start_rad}[alter.mode]
        sent = np.array([[math.cos(phi), 0.0], [-math.sin(phi), 0.0], [0.0, 1.0]])
        # The same in both bending frames, so a mirrored arm adds its block.
        felt = sum(
            (series[3 * sensing[0] :, 3 * by :][:3, :3] for by in complying), np.zeros((3, 3))
        )
        squeeze = float(gives[0, 0] + gives[3, 3])
        pressed = _pressed(sheet, alpha, half_distance, squeeze, state)
        if pressed is None:
            break
        arms_share = max(len(complying), 1)
        rows.append(
            (
                alpha,
                state.left.force_x_n,
                felt @ sent,
                inertia,
                sent,
                pressed[0] / arms_share,
                pressed[1],
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
        sent=columns[4],
        pressed_m=columns[5],
        pressed_n=columns[6],
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


def _pressed(
    sheet: Sheet, alpha_rad: float, half_distance_m: float, give_m_per_n: float, state: RodState
) -> tuple[Vector, Vector] | None:
    """Return by how much the commanded grips are nearer, falling, and the force x on the arm."""
    middle = int(np.flatnonzero(_PRESSED == 0.0)[0])
    forces = np.full(len(_PRESSED), state.left.force_x_n)
    for part in (range(middle - 1, -1, -1), range(middle + 1, len(_PRESSED))):
        guess = state
        for i in part:
            x = half_distance_m - _PRESSED[i] * sheet.length_m / 2.0
            guess = solve_grips(sheet, np.array([-x, 0.0, alpha_rad] * 2), guess)
            if not guess.converged:
                return None
            forces[i] = guess.left.force_x_n
    nearer = _PRESSED * sheet.length_m - give_m_per_n * (forces - state.left.force_x_n)
    return nearer, forces


class ArmGive:
    """What the left arm with its grasp gives way at a pose, and the inertia of its tool."""

    def __init__(self, arms: ArmPair, stiffness: Sequence[float], grasp: GraspConfig) -> None:
        self._model = robots_only(arms).compile()
        self._data = mujoco.MjData(self._model)
        self._ik = InverseKinematics(self._model, arms.home)
        self._q, self._left = arms.home, arms.joints("left")
        self._site = self._model.site(f"{SIDES[0]}_{GRIP_SITE}").id
        self._per_torque = 1.0 / np.array(stiffness)[self._left]
        translation = 1.0 / grasp.translational_stiffness_n_per_m
        rotation = 1.0 / grasp.rotational_stiffness_n_m_per_rad
        self.grasp = np.diag([translation, translation, rotation])

    def at(self, x_m: float, z_m: float, alpha_rad: float) -> tuple[Vector, Vector]:
        """Return the joints' J K⁻¹ Jᵀ and the tool's inertia (3, 3) in x, z, α at the grip."""
        targets = grip_targets(np.array([[x_m, z_m, alpha_rad]] * 2))
        self._q = self._ik.solve_from_home(targets, self._q).q
        model, data = self._model, self._data
        data.qpos[:] = self._q
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        translation, rotation = np.zeros((2, 3, model.nv))
        mujoco.mj_jacSite(model, data, translation, rotation, self._site)
        planar = np.vstack([translation[[0, 2]], rotation[1]])[:, self._left]
        compliance = (planar * self._per_torque) @ planar.T
        return np.asarray(compliance), tool_inertia(model, data, self._site)
