"""The shell as compiled: its solver, what stores energy, where its columns are placed."""

import math

import mujoco
import numpy as np
import pytest

from dualbend.beam.sheet import Sheet
from dualbend.run.arms import arm_pair
from dualbend.run.cell import make_servo
from dualbend.scenario.load import load_scenario
from dualbend.scene.cell import compose_cell, robots_only
from dualbend.scene.sheet.model import ShellModel
from dualbend.scene.sheet.shell import BENDING, ShellConfig, end_body, hinges
from dualbend.scene.sheet.strips import LEFT_END, RIGHT_END
from dualbend.types import Vector
from support.sheets import STRIP
from support.strip import STRIP6


def shell(config: ShellConfig) -> tuple[mujoco.MjModel, ShellModel]:
    scenario = load_scenario(STRIP6, ["sheet.model=shell"])
    pair = arm_pair(scenario)
    servo = make_servo(scenario, robots_only(pair).compile(), pair.home)
    sheet: Sheet = scenario.sheet.sheet()
    model = compose_cell(
        scenario.cell, pair, scenario.grasp, sheet, config, servo, 1e-3, looks=False
    ).compile()
    return model, ShellModel(model, sheet, config)


def test_a_shell_has_its_own_solver_and_inertia_at_its_edges() -> None:
    config = ShellConfig(cells_along=8, cells_across=2)
    model, _ = shell(config)
    assert model.opt.jacobian == mujoco.mjtJacobian.mjJAC_SPARSE
    assert (model.opt.iterations, model.opt.tolerance) == (3000, 1e-6)
    for end in (LEFT_END, RIGHT_END):
        first = model.joint(end_body(end)).dofadr[0]
        # 100 g and 1 kg cm² without weight.
        np.testing.assert_array_equal(model.dof_armature[first : first + 3], 0.1)
        np.testing.assert_array_equal(model.dof_armature[first + 3 : first + 6], 1e-4)
    free = model.body("sheet_vertex_003_01")
    np.testing.assert_array_equal(free.inertia, 1e-9)
    assert not model.flex_contype.any()
    assert not model.flex_conaffinity.any()
    # The membrane is drawn, the hinges are not.
    groups = {
        mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_FLEX, i): model.flex_group[i] for i in range(2)
    }
    assert groups == {"sheet_membrane": 2, "sheet_bending": 5}


def test_only_the_hinges_of_the_plate_store_bending_energy() -> None:
    config = ShellConfig(cells_along=8, cells_across=2)
    model, _ = shell(config)
    flex = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_FLEX, BENDING)
    count = model.flex_edgenum[flex]
    start = model.flex_bendingadr[flex]
    forms = model.flex_bending[start : start + 17 * count].reshape(count, 17)
    listed = hinges(load_scenario(STRIP6, ["sheet.model=shell"]).sheet.sheet(), config)
    used = np.any(forms != 0.0, axis=1)
    # Exact: one edge of each hinge's own four vertices; the curved rest shape has no part.
    assert used.sum() == len(listed)
    np.testing.assert_array_equal(forms[:, 16], 0.0)


def test_the_mean_of_the_columns_is_the_middle_of_a_bent_shell() -> None:
    config = ShellConfig(cells_along=8, cells_across=4)
    model, placed = shell(config)
    data = mujoco.MjData(model)
    slopes = np.linspace(0.4, -0.4, config.cells_along + 1)
    middle, yaw = np.array([0.1, -0.2, 0.9]), 0.3
    placed.place(data.qpos, slopes, middle, yaw)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_flex(model, data)
    columns: Vector = placed.columns(data)
    # Analytic: in the middle as placed, symmetric; the slopes' differences are the bends.
    assert placed.middle_height(data) == pytest.approx(middle[2], abs=1e-12)
    np.testing.assert_allclose(columns.mean(axis=(0, 1))[:2], middle[:2], atol=1e-12)
    np.testing.assert_allclose(placed.bending_angles(data), np.diff(slopes), atol=1e-12)
    along = columns[-1].mean(axis=0) - columns[0].mean(axis=0)
    assert math.atan2(along[1], along[0]) == pytest.approx(yaw, abs=1e-12)
    assert STRIP.length_m > np.hypot(*along[:2]) - STRIP.length_m / 8
