"""Integral action on the whole arm: where it stands under a load that does not move."""

import numpy as np
import pytest

from dualbend.arm.mjcf import GRIP_SITE
from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.run.make import make_run
from dualbend.scenario.load import load_scenario
from dualbend.types import Vector

LOAD_N = 20.0


def displaced(integral: str, force: Vector, seconds: float) -> tuple[Vector, float]:
    """Return the left grip's displacement [m] and turn [rad] under a force, with free hands."""
    run = make_run(
        load_scenario("fig6", ["imperfections=none", f"robot.servo.integral={integral}"])
    )
    run.begin()
    simulation, home = run.cell.simulation, run.cell.home
    model, data = simulation.model, simulation.data
    data.eq_active[:] = 0  # the sheet falls: two arms on a sheet are another test
    site = model.site(f"left_{GRIP_SITE}").id

    def settle(seconds: float) -> tuple[Vector, Vector]:
        for _ in range(round(seconds / COMMAND_PERIOD_S)):
            simulation.observe()
            run.cell.send(home)
        return data.site_xpos[site].copy(), data.site_xmat[site].reshape(3, 3).copy()

    before, axes = settle(0.3)
    hand = model.body("left_hand").id
    data.xfrc_applied[hand, :3] = force
    after, turned = settle(seconds)
    angle = np.arccos(np.clip((np.trace(axes.T @ turned) - 1.0) / 2.0, -1.0, 1.0))
    return after - before, float(angle)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_with_integral_action_an_arm_stands_where_it_was_sent(axis: int) -> None:
    force = np.zeros(3)
    force[axis] = LOAD_N
    moved, turn = displaced("{}", force, 1.0)
    # The acceptance of the robot: after a second, under 20 N.
    assert np.linalg.norm(moved) < 0.05e-3
    assert turn < 1e-3


def test_without_it_an_arm_yields_as_its_servos_are_stiff() -> None:
    moved, _ = displaced("none", np.array([0.0, 0.0, LOAD_N]), 1.0)
    assert np.linalg.norm(moved) > 0.15e-3
    assert moved[2] > 0.0
