"""A sheet that slides in the jaws: below the limit nothing, above it friction alone."""

import math

import numpy as np
import pytest

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.run.cell import RobotCell
from dualbend.scenario.load import load_scenario
from dualbend.scene.sheet.strips import strip_body
from dualbend.scene.slip import turning_radius
from dualbend.task.bending.run import BendingRun
from dualbend.types import Vector
from support.strip import STRIP6

HEAVY = (
    "sheet.model.hinges=4",
    "sheet.material=none",
    "sheet.young_pa=2e9",
    "sheet.poisson_ratio=0.3",
    "sheet.density_kg_per_m3=9000",
    "sheet.thickness_m=2e-3",
)
FRICTION = ("grasp.friction=0.25", "grasp.normal_force_n=40")
LIMIT_N = 20.0


class Held:
    """A sheet of known mass that only the left gripper holds, without weight."""

    def __init__(self, *settings: str) -> None:
        run = BendingRun(load_scenario(STRIP6, [*HEAVY, *settings]))
        self.cell: RobotCell = run.cell
        self.simulation = run.cell.simulation
        run.begin()
        self.simulation.model.opt.gravity[:] = 0.0
        self.simulation.data.eq_active[self.simulation.model.equality("right_hold").id] = 0
        self.mass_kg = self.cell.sheet.mass_kg
        self.loads: list[Vector] = []

    def push(self, force: tuple[float, float, float], turn_nm: float, cycles: int) -> None:
        """Push the sheet's middle along world axes, and turn it about the vertical."""
        data, body = self.simulation.data, self.simulation.model.body(strip_body(2)).id
        data.xfrc_applied[body] = [*force, 0.0, 0.0, turn_nm]
        for _ in range(cycles):
            self.loads.append(self.simulation.observe().wrench[0])
            self.cell.send(self.cell.home)
        self.loads.append(self.simulation.observe().wrench[0])

    @property
    def radius_m(self) -> float:
        assert self.simulation.sliding is not None
        return self.simulation.sliding.radius_m

    @property
    def slip(self) -> Vector:
        assert self.simulation.sliding is not None
        return self.simulation.sliding.slip[0].copy()

    def size(self) -> Vector:
        """Return each load over the limit, by hand."""
        x, y, turn = np.array(self.loads)[:, [0, 1, 5]].T
        return np.sqrt((x**2 + y**2) / LIMIT_N**2 + (turn / (LIMIT_N * self.radius_m)) ** 2)


@pytest.mark.parametrize(("length", "width"), [(0.02, 0.06), (0.02, 0.02), (0.02, 0.05)])
def test_the_turning_radius_is_the_mean_distance_from_the_middle(
    length: float, width: float
) -> None:
    n = 400
    x, y = (side * ((np.arange(n) + 0.5) / n - 0.5) for side in (length, width))
    # Limited by discretisation, second order.
    mean = np.hypot(x[:, np.newaxis], y).mean()
    assert turning_radius(length, width) == pytest.approx(mean, rel=1e-4)


def test_a_load_below_the_limit_changes_no_bit() -> None:
    free, limited = Held(), Held(*FRICTION)
    for held in (free, limited):
        held.push((0.95 * LIMIT_N, 0.0, 0.0), 0.0, 5)
    np.testing.assert_array_equal(free.loads, limited.loads)
    np.testing.assert_array_equal(free.simulation.data.qpos, limited.simulation.data.qpos)
    assert not limited.slip.any()


def test_above_the_limit_the_force_stays_at_it_and_the_rest_accelerates_the_sheet() -> None:
    held = Held(*FRICTION)
    held.push((1.04 * LIMIT_N, 0.0, 0.0), 0.0, 4)
    assert held.size()[2:] == pytest.approx(1.0, abs=0.01)
    # Analytic: ½ a t², a = (F − 2 μ N)/m, from the cycle on that sees the limit near; the pads'
    # loss holds the edge back until it slides fast, some 20 ms.
    way = 0.5 * 0.04 * LIMIT_N / held.mass_kg * (3 * COMMAND_PERIOD_S) ** 2
    assert 0.6 * way < held.slip[0] < way
    assert held.slip[1:] == pytest.approx(0.0, abs=1e-6)


def test_a_sliding_sheet_comes_to_rest_by_friction_and_then_holds() -> None:
    held = Held(*FRICTION)
    held.push((1.04 * LIMIT_N, 0.0, 0.0), 0.0, 4)
    data, model = held.simulation.data, held.simulation.model
    speed = float(data.qvel[model.joint("sheet").dofadr[0]])
    before = held.slip[0]
    assert speed > 0.1
    held.push((0.0, 0.0, 0.0), 0.0, 3)
    # Analytic: m v²/2 = 2 μ N s; it takes two steps of the physics, which leave one way of a step.
    way = 0.5 * held.mass_kg * speed**2 / LIMIT_N
    step = speed * held.simulation.model.opt.timestep
    assert held.slip[0] - before == pytest.approx(way, abs=0.5 * step)
    assert abs(held.loads[-1][0]) < 0.01 * LIMIT_N
    assert held.simulation.sliding is not None
    assert not any(held.simulation.sliding.sliding)
    stuck = held.slip
    held.push((0.9 * LIMIT_N, 0.0, 0.0), 0.0, 4)
    np.testing.assert_array_equal(held.slip, stuck)
    assert held.loads[-1][0] == pytest.approx(0.9 * LIMIT_N, rel=0.01)


def test_force_and_moment_together_slide_on_the_ellipse_along_its_normal() -> None:
    held = Held(*FRICTION)
    share = 1.05 / math.sqrt(2.0)
    held.push((share * LIMIT_N, 0.0, 0.0), share * LIMIT_N * held.radius_m, 3)
    assert held.size()[2:] == pytest.approx(1.0, abs=0.02)
    x, _, turn = held.slip
    assert x > 0.0
    assert turn > 0.0
    assert held.loads[-1][0] * x + held.loads[-1][5] * turn > 0.0


def test_an_edge_that_has_left_the_pad_is_dropped() -> None:
    held = Held(*FRICTION)
    held.push((1.5 * LIMIT_N, 0.0, 0.0), 0.0, 5)
    sliding = held.simulation.sliding
    assert sliding is not None
    assert sliding.dropped == [True, False]
    # It is let go when half the pad's 20 mm are passed, and from then on feels nothing.
    assert held.slip[0] == pytest.approx(0.010, rel=0.15)
    assert held.loads[-1][:3] == pytest.approx(0.0, abs=0.5)


def test_a_run_begun_again_holds_the_sheet_anew() -> None:
    run = BendingRun(load_scenario(STRIP6, [*HEAVY, *FRICTION]))
    sliding = run.cell.simulation.sliding
    assert sliding is not None
    run.begin()
    sliding.offset[0, 0], sliding.slip[0, 0] = 1e-3, 1e-3
    run.begin()
    assert not sliding.offset.any()
    assert not sliding.slip.any()


def test_in_divided_steps_an_edge_slides_as_in_whole_ones() -> None:
    """Limited by discretisation: a step's part of the slip."""
    whole, divided = Held(*FRICTION), Held(*FRICTION)
    divided.simulation.parts = lambda: 4
    for held in (whole, divided):
        held.push((1.2 * LIMIT_N, 0.5 * LIMIT_N, 0.0), 0.0, 6)
    assert np.linalg.norm(whole.slip[:2]) > 1e-3
    np.testing.assert_allclose(divided.slip, whole.slip, rtol=0.12)
    assert divided.size()[2:].max() == pytest.approx(1.0, abs=0.002)  # friction's limit
