"""Stiffness in the loop: the rod's tangent, arms and grasps in series, equilibrium."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from dualbend.arm.mjcf import FT_SITE, GRIP_SITE
from dualbend.beam import elastica
from dualbend.beam.rod.tangent import sheet_tangent, sheet_wrench, solve_grips
from dualbend.errors import InputError
from dualbend.run.cell import RobotCell
from dualbend.scenario.load import load_scenario
from dualbend.scene.observation import tool_mass_and_centre
from dualbend.stability.plant.environment import environments, scenario_coupling
from dualbend.stability.plant.equilibrium import find_equilibrium, sheet_mass
from dualbend.stability.plant.pose import PosedArm
from support.strip import STRIP8

Vector = NDArray[np.float64]

SHEET = load_scenario(STRIP8).sheet.sheet()
EI, L = SHEET.bending_stiffness_nm2, SHEET.length_m
X_L, ALPHA_L = 0, 2
BOTH = '["left","right"]'


def on_path(alpha: float) -> Vector:
    return np.array([-elastica.half_distance(alpha, L), 0.0, alpha] * 2)


@pytest.mark.parametrize("alpha", [0.2, 0.5, 1.0])
def test_tangent_is_the_central_difference_of_the_wrenches(alpha: float) -> None:
    grips = on_path(alpha)
    state = solve_grips(SHEET, grips)
    tangent = sheet_tangent(state)
    for j, h in enumerate([1e-6, 1e-6, 1e-5] * 2):
        step = h * np.eye(6)[j]
        ahead, back = (sheet_wrench(solve_grips(SHEET, grips + d, state)) for d in (step, -step))
        # Discretisation-limited: second order in the step; scaled to EI/L³, EI/L², EI/L.
        size = EI / L * np.outer([1 / L, 1 / L, 1] * 2, [1 / L, 1 / L, 1] * 2)[:, j]
        error = np.abs((back - ahead) / (2.0 * h) - tangent[:, j]) / size
        assert error.max() < 1e-4 * (np.abs(tangent[:, j]) / size).max(), j
    # Analytic: it comes from an energy.
    np.testing.assert_allclose(tangent, tangent.T, atol=1e-9 * np.abs(tangent).max())


def test_one_arm_along_x_feels_the_known_stiffness_of_the_bent_sheet() -> None:
    tangent = sheet_tangent(solve_grips(SHEET, on_path(0.2)))
    # Leading term without weight, 8π² EI/(α² L³); higher terms and the weight are a few per cent.
    assert tangent[X_L, X_L] == pytest.approx(8 * math.pi**2 * EI / (0.04 * L**3), rel=0.1)


def test_moving_a_sheet_as_a_whole_costs_nothing() -> None:
    tangent = sheet_tangent(solve_grips(SHEET, on_path(0.4)))
    sideways, up = np.array([1.0, 0, 0, -1.0, 0, 0]), np.array([0, 1.0, 0, 0, 1.0, 0])
    # Analytic.
    for along in (sideways, up):
        assert np.abs(tangent @ along).max() < 1e-9 * np.abs(tangent).max()


def test_arms_and_grasps_soften_the_sheet_and_most_where_it_is_stiff() -> None:
    near, far = environments(load_scenario(STRIP8), [0.2, 0.8], at_rest=False)
    parts = [1.0 - e.loops["single"][0, 0] / e.rigid_loops["single"][0, 0] for e in (near, far)]
    # Golden: 1.39 N/mm on an arm of about 50 N/mm, then 0.1 N/mm; the rest by rotation and pads.
    # The other arm, which nothing commands, is held by its dry friction.
    assert parts[0] == pytest.approx(0.032, abs=0.003)
    assert parts[1] == pytest.approx(0.011, abs=0.004)
    # Golden: 55.6 N/mm of the arm (the validation measures it) and 1400 N/mm of the pads.
    arm = PosedArm(load_scenario(STRIP8), np.array([-elastica.half_distance(0.2, L), 0.7, 0.2]))
    along = (arm.compliance + arm.grasp)[0, 0]
    assert 1e-3 / along == pytest.approx(1 / (1 / 55.6 + 1 / 1400), rel=0.1)


def test_a_scenario_solved_at_rest_balances_filter_arms_and_sheet() -> None:
    compliance = np.diag([2e-3, 2e-5, 0.1, 2e-5, 2e-5, 0.01])
    nominal = on_path(0.3)
    found = find_equilibrium(SHEET, nominal, compliance)
    assert found.settled
    wrench = sheet_wrench(solve_grips(SHEET, found.grips))
    # Solver tolerance 1e-9, times what a gap does to the wrench.
    np.testing.assert_allclose(found.grips, nominal + compliance @ wrench, atol=2e-9)
    # The sheet pushes the yielding arm outward, and is the stiffer for it.
    assert found.grips[X_L] < nominal[X_L] - 1e-3
    tangents = [sheet_tangent(s)[X_L, X_L] for s in (found.state, solve_grips(SHEET, nominal))]
    assert tangents[0] > 1.2 * tangents[1]


def test_no_rest_is_found_where_the_sheet_is_not() -> None:
    beyond = np.array([-0.6 * L, 0.0, 2.0, -0.6 * L, 0.0, 2.0])
    state = solve_grips(SHEET, beyond)
    if state.converged:
        pytest.skip("the rod solver follows even this")
    assert not find_equilibrium(SHEET, beyond, np.zeros((6, 6))).settled
    with pytest.raises(InputError, match="was not found"):
        sheet_tangent(state)


def test_both_arms_are_twice_as_stiff_along_x_and_symmetric() -> None:
    one = environments(load_scenario(STRIP8), [0.4], at_rest=False)[0].rigid_loops["single"]
    mirrored = environments(
        load_scenario(STRIP8, [f"compliance.complying={BOTH}"]), [0.4], at_rest=False
    )[0].rigid_loops["symmetric"]
    # Analytic: only the distance between the grips counts.
    assert mirrored[0, 0] == pytest.approx(2.0 * one[0, 0], rel=1e-9)
    each = environments(
        load_scenario(STRIP8, [f"compliance.complying={BOTH}", f"compliance.sensing={BOTH}"]),
        [0.4],
        at_rest=False,
    )[0].rigid_loops
    np.testing.assert_allclose(each["symmetric"], mirrored, rtol=1e-9)
    # Antisymmetric along x the sheet is carried sideways: no force.
    assert abs(each["antisymmetric"][0, 0]) < 1e-9 * one[0, 0]


def test_right_arm_alone_is_the_left_arm_alone() -> None:
    left = environments(load_scenario(STRIP8), [0.4])[0].loops["single"]
    right = environments(
        load_scenario(STRIP8, ['compliance.complying=["right"]', 'compliance.sensing=["right"]']),
        [0.4],
    )[0].loops["single"]
    # Analytic but for the solver's tolerance.
    np.testing.assert_allclose(right, left, rtol=1e-6)


def test_an_arm_that_follows_the_others_sensor_feels_the_cross_stiffness() -> None:
    scenario = load_scenario(STRIP8, ['compliance.complying=["right"]'])
    stiffness = np.arange(36.0).reshape(6, 6)
    # Analytic: force x and moment of the left, displaced by the right.
    np.testing.assert_array_equal(
        scenario_coupling(scenario, 0.3).loops(stiffness)["single"], [[3.0, 5.0], [15.0, 17.0]]
    )


def test_tool_mode_moves_along_the_grip_and_a_wrong_lever_mixes_forces_in() -> None:
    scenario = load_scenario(STRIP8, ['robot.alter.mode="tool"', "sensor.lever_arm_m=0.10"])
    coupling = scenario_coupling(scenario, 0.5)
    c, s = math.cos(0.5), math.sin(0.5)
    # Analytic: x_G = (cos α, −sin α), and M_read = M + 0.02 (x_G × F)_y.
    np.testing.assert_allclose(coupling.deviation_jacobian[:, 0], [c, -s, 0.0])
    np.testing.assert_allclose(coupling.reading[1], [-0.02 * s, -0.02 * c, 1.0], rtol=1e-12)
    frozen = scenario_coupling(load_scenario(STRIP8, ['robot.alter.mode="tool-frozen"']), 0.5)
    np.testing.assert_allclose(frozen.deviation_jacobian[:, 0], [1.0, 0.0, 0.0], atol=1e-15)


@pytest.mark.parametrize("alpha", [0.2, 0.8])
def test_an_arm_that_moves_its_sensor_feels_its_own_tool(alpha: float) -> None:
    """F = m ẍ and M = (r × F)_y + I α̈ of what hangs beyond the sensor; the sheet's comes on top."""
    scenario = load_scenario(STRIP8)
    (at,) = environments(scenario, [alpha])
    x, _, slope = on_path(alpha)[:3]
    height = scenario.cell.sheet_height_m + elastica.rise(alpha, L)
    cell = RobotCell(scenario, np.array([x, height, slope]))
    model = cell.ik.model
    data = mujoco.MjData(model)
    data.qpos[:] = cell.home
    mujoco.mj_kinematics(model, data)
    mass, centre = tool_mass_and_centre(model, "left")
    sensor, grip = data.site(f"left_{FT_SITE}"), data.site(f"left_{GRIP_SITE}")
    along, _, up = sensor.xpos + sensor.xmat.reshape(3, 3) @ centre - grip.xpos
    (arm,) = at.arms.values()
    sheet = sheet_mass(SHEET, solve_grips(SHEET, on_path(alpha) + at.moved))
    own = arm.mass_read - sheet[[0, 2], :3]
    # Analytic: first and second moments of mass, of MuJoCo's sum over the bodies of the tool.
    np.testing.assert_allclose(own[0], mass * np.array([1.0, 0.0, up]), atol=1e-6 * mass)
    np.testing.assert_allclose(own[1, :2], mass * np.array([up, -along]), atol=1e-6 * mass)
    assert own[1, 2] > mass * (along**2 + up**2)


def test_an_arm_that_follows_the_others_sensor_reads_none_of_its_own_tool() -> None:
    crossed = load_scenario(STRIP8, ['compliance.sensing=["right"]'])
    (at,) = environments(crossed, [0.5])
    (alone,) = environments(load_scenario(STRIP8), [0.5])
    (arm,), (own,) = at.arms.values(), alone.arms.values()
    # The other hand stands still: what is left is the sheet's 31 g of the 0.6 kg.
    assert abs(arm.mass_read[0, 0]) < 0.1 * own.mass_read[0, 0]


def test_a_pose_out_of_reach_is_named() -> None:
    with pytest.raises(InputError, match=r"path at 0\.000 rad: grip pose out of reach"):
        environments(load_scenario(STRIP8, ["cell.base_distance_m=2.0"]), [0.3])


def test_the_sheets_mass_is_what_its_points_do_when_the_grips_move() -> None:
    grips = on_path(0.2)
    state = solve_grips(SHEET, grips)
    mass = sheet_mass(SHEET, state)
    sideways, up = np.array([1.0, 0, 0, -1.0, 0, 0]), np.array([0, 1.0, 0, 0, 1.0, 0])
    # Analytic: carried as a whole it weighs what it weighs.
    assert sideways @ mass @ sideways == pytest.approx(SHEET.mass_kg, rel=1e-6)
    assert up @ mass @ up == pytest.approx(SHEET.mass_kg, rel=1e-6)
    step = np.array([1e-6, 0, 0, 0, 0, 0])
    ahead, back = (solve_grips(SHEET, grips + d, state) for d in (step, -step))
    moved = np.hypot(ahead.x_m - back.x_m, ahead.z_m - back.z_m) / 2e-6
    # Discretisation-limited: second order in the step.
    expected = SHEET.mass_kg * np.trapezoid(moved**2, dx=1.0 / (moved.size - 1))
    assert mass[X_L, X_L] == pytest.approx(expected, rel=1e-4)
    # Leading term: between clamps that keep their slopes a raised cosine grows by 3/(4 α) of what
    # the ends come together; its mean square is 3/8. The tilt of the frame adds 0.01 kg.
    bulge = SHEET.mass_kg * 0.375 * (3.0 / (4.0 * 0.2)) ** 2
    assert mass[X_L, X_L] == pytest.approx(bulge, rel=0.05)
