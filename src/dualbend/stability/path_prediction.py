"""Moment along the path predicted in a tenth of a second: a simple sheet, the real controller.

The wrench of the nominal motion (rod, compliant arms) is computed once. A candidate controller then
runs cycle by cycle, as in the simulation, on w = w_nominal − K(α) q − M q̈ with the known tangent;
along x the force follows the known curve. The moment is of first order in the deviations, so the
first piece comes out too high. The simulation decides; this only ranks.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg import block_diag

from dualbend.beam.rod.state import RodState
from dualbend.beam.rod.tangent import sheet_wrench
from dualbend.control.clock import COMMAND_PERIOD_S, steps_per_cycle
from dualbend.control.compliance.admittance import Admittance
from dualbend.control.filters import LowPass, NoFilterConfig
from dualbend.run.arms import arm_pair, joint_stiffness
from dualbend.run.known_sheet import known_sheet, reading_age_steps, response_model
from dualbend.scenario.motion import PHASES, nominal_motion
from dualbend.scenario.scenario import Scenario
from dualbend.scene.arm_compliance import ArmCompliance
from dualbend.stability.plant.equilibrium import find_equilibrium
from dualbend.types import PlanarPose, Vector

_NO_FILTER = NoFilterConfig()
_EVERY = 4
"""Cycles between two solved states of the sheet."""


class PathPrediction:
    """The disturbance along a scenario's path, and the residual moment with a controller.

    Raises InputError where a state is not found or out of reach.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        self._motion = nominal_motion(scenario.path, scenario.motion, scenario.sheet.length_m)
        self._known = known_sheet(scenario)
        motion = self._motion
        z = scenario.cell.sheet_height_m + motion.rise_m
        self._pose = np.stack([-motion.half_distance_m, z, motion.alpha_rad], axis=1)
        self._age_steps = reading_age_steps(scenario)
        self._now = self._nominal_motion(1)
        self._read = self._nominal_motion(self._age_steps)
        self._wrench = self._nominal_wrench()
        knots = scenario.path.make(scenario.sheet.length_m).knots
        piece = np.searchsorted(knots, motion.alpha_rad, side="right") - 1
        self._piece = np.clip(piece, 0, len(knots) - 2)
        self._bend = motion.phase == PHASES.index("bend")

    def _nominal_motion(self, age_steps: int) -> Vector:
        """Return x, z, α and their accelerations (n, 6), some steps before each cycle."""
        model = response_model(
            self.scenario, delay_cycles=0, channels=3, low_pass=_NO_FILTER, age_steps=age_steps
        )
        model.reset(self._pose[0])
        rows = np.empty((len(self._pose), 6))
        for row, pose in zip(rows, self._pose, strict=True):
            row[:3], row[3:] = model.read()
            model.send(pose)
        return rows

    def _nominal_wrench(self) -> Vector:
        """Return force x, z and moment (n, 3) on the sensing arm without any compliance."""
        scenario, count = self.scenario, len(self._pose)
        sheet = scenario.sheet.sheet()
        arm = ArmCompliance(arm_pair(scenario), joint_stiffness(scenario), scenario.grasp)
        solved = np.unique([*range(0, count, _EVERY), count - 1])
        wrenches: Vector = np.empty((len(solved), 3))
        state: RodState | None = None
        for row, cycle in zip(wrenches, solved.tolist(), strict=True):
            x, _, alpha = pose = self._now[cycle, :3]
            arm.move(pose)
            compliance = arm.compliance + arm.grasp
            grips = np.array([x, 0.0, alpha] * 2)
            state = find_equilibrium(sheet, grips, block_diag(compliance, compliance), state).state
            row[:] = sheet_wrench(state)[:3]
        every = np.arange(count)
        return np.stack([np.interp(every, solved, column) for column in wrenches.T], axis=1)

    def noise(self, seed: int) -> Vector:
        """Return the errors of force x_G, z_G and torque (n, 3) of one seed."""
        sensor = self.scenario.sensor
        force = math.hypot(sensor.force_noise_n, sensor.force_resolution_n / math.sqrt(12.0))
        torque = math.hypot(sensor.torque_noise_nm, sensor.torque_resolution_nm / math.sqrt(12.0))
        rng = np.random.default_rng(seed)
        return np.asarray(rng.standard_normal((len(self._pose), 3)) * [force, force, torque])

    def peaks(self, admittance: Admittance | None, noise: Vector) -> Vector:
        """Return the largest |moment| of each piece of the path [N m]; None: no compliance."""
        moment = self._moments(admittance, noise)
        pieces = range(int(self._piece.max()) + 1)
        # A piece that is shorter than a cycle has no row: no moment is known of it.
        return np.array(
            [np.abs(moment[self._bend & (self._piece == k)]).max(initial=0.0) for k in pieces]
        )

    def _moments(self, admittance: Admittance | None, noise: Vector) -> Vector:
        if admittance is None:
            return np.asarray(self._wrench[:, 2])
        delay, lever = self.scenario.robot.alter.delay_cycles, self.scenario.sensor.lever_arm_m
        now, read = (
            response_model(
                self.scenario, delay_cycles=delay, channels=2, low_pass=_NO_FILTER, age_steps=age
            )
            for age in (1, self._age_steps)
        )
        low_pass = LowPass(self.scenario.filter, 3, period_s=COMMAND_PERIOD_S)
        ago = self._age_steps / steps_per_cycle(self.scenario.physics.step_s, COMMAND_PERIOD_S)
        moments = np.empty(len(self._pose))
        for n, pose in enumerate(self._pose):
            alpha = float(self._read[n, 2])
            stiffness, (inertia, sent) = self._known.tangent(alpha), self._known.tool(alpha)
            q, acceleration = read.read()
            here, _ = now.read()
            moments[n] = self._wrench[n, 2] - float(stiffness[2] @ here)
            before = self._wrench[max(n - 1, 0)]
            nominal = self._wrench[n] + ago * (before - self._wrench[n])
            sheet = nominal - stiffness @ q
            inward = self._known.displacement(float(nominal[0]), alpha)
            inward += float(stiffness[0] @ q) / float(stiffness[0, 0])
            sheet[0] = self._known.compression_force(inward, alpha)
            along, across, torque = noise[n].tolist()
            c, s = math.cos(alpha), math.sin(alpha)
            error = [along * c + across * s, across * c - along * s, torque + lever * across]
            wrench = sheet - inertia @ (self._read[n, 3:] + sent @ acceleration) + error
            if n == 0:
                low_pass.reset(wrench)
            deviation = admittance.comply(low_pass.update(wrench), PlanarPose(pose))
            now.send(deviation)
            read.send(deviation)
        return moments
