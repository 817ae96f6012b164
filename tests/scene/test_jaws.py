"""Jaws over nothing, their encoders set by hand: when they squeeze, hold, let go and meet again."""

import mujoco
import numpy as np
import pytest

from dualbend.arm import mjcf as arm
from dualbend.run.arms import arm_pair
from dualbend.run.cell import make_servo
from dualbend.scenario.load import load_scenario
from dualbend.scene.cell import compose_cell, robots_only
from dualbend.scene.grippers import Grippers
from dualbend.scene.sheet.strips import StripConfig
from dualbend.task.assembly.config import assembly_of
from dualbend.types import SIDES


@pytest.fixture(scope="module")
def assembling() -> mujoco.MjModel:
    scenario = load_scenario("pwb")
    pair = arm_pair(scenario)
    servo = make_servo(scenario, robots_only(pair).compile(), pair.home)
    return compose_cell(
        scenario.cell,
        pair,
        scenario.grasp,
        scenario.sheet.sheet(),
        StripConfig(),
        servo,
        scenario.step_s,
        assembly_of(scenario).layout,
        looks=False,
    ).compile()


class Jaws:
    """Jaws over nothing: their encoders are set by hand."""

    def __init__(self, model: mujoco.MjModel, thickness_m: float = 1e-3) -> None:
        self.model, self.data = model, mujoco.MjData(model)
        self.grippers = Grippers(model, self.data, thickness_m)
        joints = [
            [model.joint(f"{side}_{jaw}").qposadr[0] for jaw in arm.JAW_JOINTS] for side in SIDES
        ]
        self.q = np.array(joints)
        rubber = [
            [model.geom(f"{side}_{jaw}_rubber").id for jaw in arm.JAW_JOINTS] for side in SIDES
        ]
        self.rubber = np.array(rubber)
        self.drives = [
            [model.actuator(f"{side}_{jaw}_drive").id for jaw in arm.JAW_JOINTS] for side in SIDES
        ]
        self.holds = [model.equality(f"{side}_hold").id for side in SIDES]
        self.grippers.reset(0.01)

    def opened(self, left_gap_m: float, right_gap_m: float) -> None:
        self.data.qpos[self.q] = np.array([[left_gap_m], [right_gap_m]]) / 2

    @property
    def touchable(self) -> list[bool]:
        return self.model.geom_conaffinity[self.rubber].all(axis=1).tolist()


@pytest.fixture
def jaws(assembling: mujoco.MjModel) -> Jaws:
    return Jaws(assembling)


def test_closing_grows_the_squeeze_by_20_um_a_cycle_up_to_0_4_mm(jaws: Jaws) -> None:
    for n in range(1, 30):
        jaws.grippers.drive(0.0)
        # Exact: 20 µm a cycle beyond closed, at most 0.4 mm: 8 N on 20 N/mm.
        expected = -min(2e-5 * n, 4e-4)
        np.testing.assert_allclose(jaws.data.ctrl[jaws.drives], expected, atol=1e-15)
    jaws.grippers.drive(0.005)
    np.testing.assert_array_equal(jaws.data.ctrl[jaws.drives], 0.005)
    jaws.grippers.drive(0.0)
    # Opened in between, it begins anew.
    np.testing.assert_allclose(jaws.data.ctrl[jaws.drives], -2e-5, atol=1e-18)


def test_a_jaw_that_holds_moves_only_to_open(jaws: Jaws) -> None:
    jaws.opened(1e-3, 1e-3)
    jaws.data.eq_active[jaws.holds[0]] = 1
    jaws.data.ctrl[jaws.drives] = 5e-4
    jaws.grippers.drive(0.0)
    assert jaws.data.ctrl[jaws.drives[0]].tolist() == [5e-4, 5e-4]
    assert (jaws.data.ctrl[jaws.drives[1]] < 0.0).all()
    jaws.grippers.drive(4.9e-4)
    assert jaws.data.ctrl[jaws.drives[0]].tolist() == [5e-4, 5e-4]
    jaws.grippers.drive(5.1e-4)
    assert jaws.data.ctrl[jaws.drives[0]].tolist() == [5.1e-4, 5.1e-4]


def test_a_sheet_is_let_go_half_a_millimetre_off_and_met_again_at_three(jaws: Jaws) -> None:
    """Each gripper by itself, both faces: the gap less the sheet's thickness of 1 mm, halved."""
    jaws.data.eq_active[jaws.holds] = 1
    jaws.model.geom_conaffinity[jaws.rubber] = 0
    jaws.opened(1e-3 + 2 * 0.49e-3, 1e-3 + 2 * 0.51e-3)
    jaws.grippers.update()
    assert jaws.grippers.holding == (True, False)
    assert jaws.touchable == [False, False]
    jaws.opened(1e-3 + 2 * 0.6e-3, 1e-3 + 2 * 2.9e-3)
    jaws.grippers.update()
    assert jaws.grippers.holding == (False, False)
    assert jaws.touchable == [False, False]
    jaws.opened(1e-3 + 2 * 2.9e-3, 1e-3 + 2 * 3.1e-3)
    jaws.grippers.update()
    assert jaws.touchable == [False, True]
    assert jaws.grippers.gap_m == pytest.approx([6.8e-3, 7.2e-3])


def test_between_cycles_only_closing_jaws_that_hold_nothing_look_for_a_sheet(
    jaws: Jaws, monkeypatch: pytest.MonkeyPatch
) -> None:
    looked = []
    monkeypatch.setattr(jaws.grippers, "update", lambda: looked.append(True))
    for opening, held, expected in (
        (2e-3, (0, 0), False),
        (0.0, (0, 0), True),
        (0.0, (1, 0), True),
        (0.0, (0, 1), True),
        (0.0, (1, 1), False),
        (0.9e-3, (0, 0), True),
    ):
        jaws.grippers.drive(opening)
        jaws.data.eq_active[jaws.holds] = held
        looked.clear()
        jaws.grippers.on_step()
        assert bool(looked) is expected, (opening, held)
