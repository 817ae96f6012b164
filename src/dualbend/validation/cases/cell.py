"""The cell held still, pushed and stepped: tracking, end-point stiffness, the sheet's weight."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy import optimize, signal

from dualbend.arm import mjcf as arm
from dualbend.beam import elastica
from dualbend.beam.sheet import GRAVITY_M_PER_S2
from dualbend.control.response import CommandResponseConfig
from dualbend.mechanics.compliance import endpoint_compliance
from dualbend.mechanics.jacobian import PLANE, site_jacobian
from dualbend.run.cell import RobotCell
from dualbend.scene.observation import Observation
from dualbend.types import SIDES, Vector
from dualbend.validation.handbook import STRIP
from dualbend.validation.perfect import perfect_scenario
from dualbend.validation.row import Row, of_property, relative

DIRECTIONS = (("x", 0.01, "N/m"), ("z", 0.01, "N/m"), ("alpha", 0.05, "N m/rad"))
"""Direction of the grip in the bending frame, step commanded [m, rad], unit of its stiffness.

Dry friction holds the last 0.1 mm of a step in z back, so smaller steps look slower: 1.98 Hz and
0.90 instead of 2.2 Hz and 1 for 2 mm, 2.14 Hz and 0.97 for 10 mm.
"""

STEP_SLOPE_RAD = 0.5
"""Bending angle at which the arms are stepped and pushed: the sheet is soft there."""

_GRIP_PLANE = (0, 2, 3)
"""x, z and end slope among the four numbers of an observed grip."""

_REST_CYCLES, _STEP_CYCLES = 60, 45
_PUSH_N, _PUSH_NM = 20.0, 4.0


class HeldCell:
    """The cell of ``exact``, ``settings`` changed, grips commanded by hand; no compliance.

    It starts in the zero-moment pose of a bending angle. ``dry_friction`` keeps the arm joints'
    Coulomb friction.
    """

    def __init__(
        self, alpha_rad: float, settings: Sequence[str] = (), *, dry_friction: bool = True
    ) -> None:
        self.scenario = scenario = perfect_scenario("exact", settings)
        length, height = scenario.sheet.length_m, scenario.cell.sheet_height_m
        x, rise = elastica.half_distance(alpha_rad, length), elastica.rise(alpha_rad, length)
        self.pose = np.array([-x, height + rise, alpha_rad])
        self._cell = RobotCell(scenario, self.pose)
        self.simulation, self.model = self._cell.simulation, self._cell.simulation.model
        self.arms, self.servo = self._cell.arms, self._cell.servo
        joints = [self.model.joint(name) for name in self.simulation.joints]
        self.dof = np.array([joint.dofadr[0] for joint in joints])
        if not dry_friction:
            self.model.dof_frictionloss[self.dof] = 0.0
        self._q = self._cell.home
        self._cell.reset()

    def command(self, pose: Vector, cycles: int) -> list[Observation]:
        """Command both grips to (x, z, α) [m, m, rad] and return what is seen at each cycle."""
        self._q = self._cell.reach(pose, self._q)
        seen = []
        for _ in range(cycles):
            seen.append(self.simulation.observe())
            self._cell.send(self._q)
        return seen

    def rest(self) -> Observation:
        """Hold the last pose until it is still and look."""
        return self.command(self.pose, _REST_CYCLES)[-1]


def fit_response(position: Vector, start: float, period_s: float) -> tuple[float, float]:
    """Identify ω_n [rad/s] and ξ from a step response, one sample a cycle from the command on (n,).

    Least squares of y = start + A g(t): g is the answer of ω_n² / (s² + 2ξω_n s + ω_n²) to a ramp
    from 0 to 1 over the first cycle, which is what the interpolation makes of a step.
    """
    times = period_s * np.arange(len(position))
    ramp = np.minimum(times / period_s, 1.0)

    def residual(p: Vector) -> Vector:
        omega, ratio, height = p
        system = ([omega**2], [1.0, 2.0 * ratio * omega, omega**2])
        # Linear between samples, as the ramp is: no error of interpolation.
        _, answer, _ = signal.lsim(system, ramp, times, interp=True)
        return np.asarray((start + height * answer - position) / span)

    span = float(position[-1] - start)
    fit = optimize.least_squares(residual, [12.0, 0.8, span], x_scale=[10.0, 1.0, abs(span)])
    return float(fit.x[0]), float(fit.x[1])


def identify_response(
    direction: int, settings: Sequence[str] = ()
) -> tuple[float, float, CommandResponseConfig]:
    """Step both grips; return ω_n [rad/s] and ξ of the left one, and the configured response."""
    cell = HeldCell(STEP_SLOPE_RAD, settings=settings)
    before = cell.rest().grip[0, _GRIP_PLANE[direction]]
    target = cell.pose.copy()
    target[direction] += DIRECTIONS[direction][1]
    seen = cell.command(target, _STEP_CYCLES)
    position = np.array([look.grip[0, _GRIP_PLANE[direction]] for look in seen])
    scenario = cell.scenario
    return *fit_response(position, float(before), scenario.period_s), scenario.robot.response


def response_rows(settings: Sequence[str] = ()) -> Iterator[Row]:
    """Compare the left end effector's identified ω_n and ξ with the configured ones."""
    for i, (name, _, _) in enumerate(DIRECTIONS):
        omega, ratio, wanted = identify_response(i, settings)
        where, configured = f"of the end effector in {name}", wanted.natural_frequency_hz
        found = omega / (2.0 * np.pi)
        yield relative(f"natural frequency {where}", found, configured, "Hz", 0.05)
        yield relative(f"damping ratio {where}", ratio, wanted.damping_ratio, "1", 0.05)


def stiffness_rows(settings: Sequence[str] = ()) -> Iterator[Row]:
    """Push the left grip and compare its static stiffness with (J Kq⁻¹ Jᵀ)⁻¹.

    The servos hold still; dry friction is off, which would hold a push of this size by itself. The
    reference deflection is that of the whole change of the load: the push and what the sheet does
    in answer.
    """
    cell = HeldCell(STEP_SLOPE_RAD, settings=settings, dry_friction=False)
    before = cell.rest()
    compliance = _compliance(cell)
    for i, (name, _, unit) in enumerate(DIRECTIONS):
        push = np.zeros(6)
        push[PLANE[i]] = _PUSH_NM if name == "alpha" else _PUSH_N
        _push_left_grip(cell, push)
        after = cell.rest()
        _push_left_grip(cell, np.zeros(6))
        load = push + after.wrench[0] - before.wrench[0]
        moved = (after.grip - before.grip)[0, _GRIP_PLANE[i]]
        found, wanted = push[PLANE[i]] / [moved, (compliance @ load)[PLANE[i]]]
        yield relative(f"static end-point stiffness in {name}", found, wanted, unit, 0.05)


def _compliance(cell: HeldCell) -> Vector:
    """Return J Kq⁻¹ Jᵀ of the left grip (6, 6), world axes, which are its bending frame's."""
    grip = cell.model.site(f"{SIDES[0]}_{arm.GRIP_SITE}").id
    jacobian = site_jacobian(cell.model, cell.simulation.data, grip)
    left = cell.arms.joints("left")
    return endpoint_compliance(jacobian[:, cell.dof[left]], cell.servo.stiffness[left])


def _push_left_grip(cell: HeldCell, wrench: Vector) -> None:
    """Apply a wrench (6,) at the left grip; MuJoCo wants it at the hand's centre of mass."""
    model, data = cell.model, cell.simulation.data
    hand = model.body(f"{SIDES[0]}_hand").id
    lever = data.site(f"{SIDES[0]}_{arm.GRIP_SITE}").xpos - data.xipos[hand]
    data.xfrc_applied[hand] = wrench
    data.xfrc_applied[hand, 3:] += np.cross(lever, wrench[:3])


def weight_rows(alphas: tuple[float, ...] = (0.0, 0.5)) -> Iterator[Row]:
    """Compare the two grippers' vertical forces with the weight of the sheet, held still."""
    weight = STRIP.mass_kg * GRAVITY_M_PER_S2
    for alpha in alphas:
        vertical = -HeldCell(alpha).rest().wrench[:, 2]
        where = f"held at {alpha:g} rad"
        both = f"both grippers carry the sheet, {where}"
        yield of_property(relative(both, vertical.sum(), weight, "N", 0.01))
        half = f"left gripper carries half, {where}"
        yield of_property(relative(half, vertical[0], weight / 2.0, "N", 0.01))
