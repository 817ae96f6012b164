"""What the admittance loop feels of the bent sheet: its tangent, softened by arms and grasps.

The six coordinates are x, z [m], α [rad] of the left and then of the right grip, each in its own
bending frame; a stiffness K says that the wrench on the arms changes by −K times their change.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

from dualbend.analysis.stability_equilibrium import rest, sheet_tangent
from dualbend.control.admittance import Admittance, AdmittanceAxis
from dualbend.errors import InputError
from dualbend.run.robot_cell import HOME_GUESS_RAD
from dualbend.run.scenario import Scenario
from dualbend.scene.arm import GRIP_SITE, LEVER_ARM_M
from dualbend.scene.cell import SIDES, robots_only
from dualbend.scene.ik import InverseKinematics, grip_targets
from dualbend.task.bending import make_path

Vector = NDArray[np.float64]
ModeName = Literal["alone", "alike", "opposed"]


@dataclass(frozen=True, kw_only=True)
class Environment:
    """The stiffness matrices at one bending angle.

    ``sheet`` (6, 6): the oracle's tangent with weight; ``series`` (6, 6): the same between
    commanded positions, with arms and grasps in series; ``compliance`` (3, 3): what one arm and its
    grasp give way per wrench. ``loops``: for each way in which the complying arms can move, the
    (2, 2) matrix of force x and moment read against δx and δα; ``rigid_loops`` the same with
    rigid arms and grasps. ``moved`` (6,): how far the grips at rest are from the path;
    ``inertia`` (2, 2): of the tool, as the sensing arm reads it when it moves itself.
    ``settled``: False where no such rest was found and the path's own poses were taken.
    """

    alpha_rad: float
    settled: bool
    moved: Vector
    sheet: Vector
    series: Vector
    compliance: Vector
    inertia: Vector
    loops: dict[ModeName, Vector]
    rigid_loops: dict[ModeName, Vector]


def in_series(stiffness: Vector, compliance: Vector) -> Vector:
    """Return the stiffness with a compliance in series: (1 + K C)⁻¹ K, also for a singular K."""
    return np.asarray(
        np.linalg.solve(np.eye(len(stiffness)) + stiffness @ compliance, stiffness),
        dtype=np.float64,
    )


class EndPointCompliance:
    """How far an arm and its grasp give way in the plane, at the poses of the nominal path."""

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._model = robots_only(scenario.cell).compile()
        self._data = mujoco.MjData(self._model)
        self._ik = InverseKinematics(self._model)
        self._q = HOME_GUESS_RAD
        self._site = self._model.site(f"{SIDES[0]}_{GRIP_SITE}").id
        joint = np.tile(scenario.servo.stiffness_n_m_per_rad, len(SIDES))
        self._per_torque = 1.0 / joint
        grasp = scenario.grasp
        self._grasp = np.diag(
            1.0
            / np.array(
                [
                    grasp.translational_stiffness_n_per_m,
                    grasp.translational_stiffness_n_per_m,
                    grasp.rotational_stiffness_n_m_per_rad,
                ]
            )
        )

    def at(self, x_m: float, z_m: float, alpha_rad: float) -> Vector:
        """Return C = J Kq⁻¹ Jᵀ + C_grasp (3, 3) in x, z, α: wrench on the arm to its give.

        Left arm; the right one is its image by a turn about z and has the same in its own frame.
        """
        pose = np.array([x_m, z_m, alpha_rad])
        targets = grip_targets(np.array([pose, pose]))
        solution = self._ik.solve(targets, self._q)
        self._q = (
            solution if solution.reached else self._ik.solve_from_home(targets, HOME_GUESS_RAD)
        ).q
        self._data.qpos[:] = self._q
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        translation, rotation = np.zeros((2, 3, self._model.nv))
        mujoco.mj_jacSite(self._model, self._data, translation, rotation, self._site)
        self.inertia = self._tool_inertia()
        planar = np.vstack([translation[[0, 2]], rotation[1]])
        return np.asarray((planar * self._per_torque) @ planar.T + self._grasp)

    def _tool_inertia(self) -> Vector:
        """Return the inertia (3, 3) in x, z, α of what hangs beyond the sensor, at the grip."""
        model, data = self._model, self._data
        inertia, hand = np.zeros((3, 3)), model.body(f"{SIDES[0]}_hand").id
        for body in range(hand, model.nbody):
            above = body
            while above > hand:
                above = int(model.body_parentid[above])
            if above != hand:
                continue
            lever = data.xipos[body] - data.site_xpos[self._site]
            moves = np.array([[1.0, 0.0, lever[2]], [0.0, 1.0, -lever[0]]])
            inertia += model.body_mass[body] * moves.T @ moves
            axis = data.ximat[body].reshape(3, 3)[1]
            inertia[2, 2] += float(axis**2 @ model.body_inertia[body])
        return inertia


@dataclass(frozen=True, kw_only=True)
class Coupling:
    """How the controller couples the arms: what is read, what is sent, and who follows whom.

    ``read`` (2, 3): force x and moment as the sensing arm reads them, of the wrench on it;
    ``sent`` (3, 2): the change of a grip's x, z, α per δx, δα; ``source``: by complying arm, the
    arm whose reading it follows.
    """

    read: Vector
    sent: Vector
    source: dict[int, int]

    @classmethod
    def of(cls, scenario: Scenario, alpha_rad: float) -> Coupling:
        """Follow ComplianceController: an arm without a sensor follows the first with one.

        ``alter.mode`` says along what δx is executed; a lever arm that is believed wrongly mixes
        forces into the moment.
        """
        sensing = [i for i, side in enumerate(SIDES) if side in scenario.arms.sensing]
        complying = [i for i, side in enumerate(SIDES) if side in scenario.arms.complying]
        modes = {"world": 0.0, "tool": alpha_rad, "tool-frozen": scenario.path.start_rad}
        phi = modes[scenario.alter.mode]
        error = LEVER_ARM_M - scenario.sensor.lever_arm_m
        c, s = math.cos(alpha_rad), math.sin(alpha_rad)
        return cls(
            read=np.array([[1.0, 0.0, 0.0], [-error * s, -error * c, 1.0]]),
            sent=np.array([[math.cos(phi), 0.0], [-math.sin(phi), 0.0], [0.0, 1.0]]),
            source={i: i if i in sensing else sensing[0] for i in complying},
        )

    def loops(self, stiffness: Vector) -> dict[ModeName, Vector]:
        """Return the (2, 2) matrices of the loops closed through a stiffness (6, 6).

        Where both arms follow their own sensors the sheet's symmetry splits the loop into two:
        both arms moving alike, and opposed.
        """

        def block(of: int, by: int) -> Vector:
            part = stiffness[3 * of : 3 * of + 3, 3 * by : 3 * by + 3]
            return np.asarray(self.read @ part @ self.sent)

        sources = set(self.source.values())
        if len(sources) == 2:
            # The means over both arms are exact where the state is symmetric, and it nearly is.
            own = (block(0, 0) + block(1, 1)) / 2
            other = (block(0, 1) + block(1, 0)) / 2
            return {"alike": own + other, "opposed": own - other}
        if not sources:
            return {}
        (of,) = sources
        name: ModeName = "alike" if len(self.source) == 2 else "alone"
        return {name: np.sum([block(of, by) for by in self.source], axis=0)}

    def tool(self, inertia: Vector) -> Vector:
        """Return the tool's inertia (2, 2) in the reading; none where the sensing arm is led."""
        felt = any(of == by for by, of in self.source.items())
        return np.asarray(self.read @ inertia @ self.sent) if felt else np.zeros((2, 2))

    def compliance(self, per_load: tuple[float, float]) -> Vector:
        """Return what the admittance gives way at rest (6, 6), from δ per load of its two axes."""
        given = np.zeros((6, 6))
        for by, of in self.source.items():
            given[3 * by : 3 * by + 3, 3 * of : 3 * of + 3] = (
                self.sent @ np.diag(per_load) @ self.read
            )
        return given


def environments(
    scenario: Scenario, alphas_rad: Sequence[float], *, at_rest: bool = True
) -> list[Environment]:
    """Return the stiffness that the loop meets at bending angles of the path.

    With ``at_rest`` about the equilibrium that the compliance has with the sheet, otherwise about
    the nominal poses; a tared axis sees hardly any load, so nominal poses serve there.

    Raises InputError where the sheet's state is not found or a pose is out of the arms' reach.
    """
    sheet = scenario.sheet.sheet()
    path = make_path(scenario.path, sheet.length_m)
    arm, admittance = EndPointCompliance(scenario), Admittance(scenario.compliance)
    axes = (admittance.x, admittance.rotation)
    found: list[Environment] = []
    for alpha in alphas_rad:
        half_distance, rise = path.at(float(alpha))
        coupling = Coupling.of(scenario, alpha)
        x, rotation = (
            axis.static_compliance
            if axis and at_rest and not scenario.compliance.tare and acts(axis, alpha)
            else 0.0
            for axis in axes
        )
        try:
            give = arm.at(-half_distance, scenario.cell.sheet_height_m + rise, alpha)
            both = np.asarray(np.kron(np.eye(2), give), dtype=np.float64)
            total = coupling.compliance((x, rotation)) + (both if at_rest else 0.0 * both)
            state = rest(sheet, np.array([-half_distance, 0.0, alpha] * 2), total)
            tangent = sheet_tangent(state.state)
        except InputError as error:
            raise InputError(f"path at {alpha:.3f} rad: {error}") from error
        series = in_series(tangent, both)
        found.append(
            Environment(
                alpha_rad=alpha,
                settled=state.settled,
                moved=state.grips - np.array([-half_distance, 0.0, alpha] * 2),
                sheet=tangent,
                series=series,
                compliance=give,
                inertia=coupling.tool(arm.inertia),
                loops=coupling.loops(series),
                rigid_loops=coupling.loops(tangent),
            )
        )
    return found


def acts(axis: AdmittanceAxis, alpha_rad: float) -> bool:
    """Say whether an axis acts at a bending angle."""
    return axis.from_alpha_rad <= alpha_rad
