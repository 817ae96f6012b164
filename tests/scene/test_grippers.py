"""The grippers on a sheet that lies on the stand: what they hold, how it lies in them, letting go.

Both arms stand still at the sheet's ends, as a perfect pick-up has them; only the jaws move.
"""

import math

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from dualbend.arm import mjcf as arm
from dualbend.run.cell import RobotCell
from dualbend.scenario.load import load_scenario
from dualbend.scene.cell import PAD_SITE
from dualbend.scene.contacts import GRIPPING
from dualbend.scene.grippers import Grippers
from dualbend.scene.sheet.strips import LEFT_END, RIGHT_END
from dualbend.task.assembly.config import assembly_of
from dualbend.types import SIDES

Array = NDArray[np.float64]
SCENARIO = load_scenario("pwb")
THICKNESS_M, LENGTH_M = SCENARIO.sheet.thickness_m, SCENARIO.sheet.length_m
OPEN_M = 0.012


class Bench:
    """Arms at the stand, a flat sheet upon it."""

    def __init__(self) -> None:
        stand = assembly_of(SCENARIO).layout.stand
        self.middle = np.array([0.0, stand.y_m, stand.top_m + 0.5 * THICKNESS_M])
        pose = np.array([-0.5 * LENGTH_M, 0.0, 0.0])
        self.cell = RobotCell(SCENARIO, pose, np.array([*self.middle, 0.0]))
        simulation = self.cell.simulation
        self.model, self.data = simulation.model, simulation.data
        self.jaws = Grippers(self.model, self.data, THICKNESS_M)

    def lay(self, x: float = 0.0, y: float = 0.0, yaw: float = 0.0) -> None:
        """Start anew with the sheet this far from where the arms believe it."""
        flat = np.zeros(SCENARIO.sheet.strips.hinges + 1)
        self.cell.response.reset(self.cell.home)
        simulation, middle = self.cell.simulation, self.middle + np.array([x, y, 0.0])
        simulation.reset(simulation.positions(self.cell.home, OPEN_M, flat, middle, yaw))
        self.jaws.reset(OPEN_M)

    def go(self, opening: float, cycles: int) -> None:
        """Drive the jaws to an opening as the robots' program does, up to 20 mm/s; then wait."""
        begin = float(self.jaws.gap_m.max()) / 2.0
        steps = max(1, math.ceil(1.875 * abs(opening - begin) / 0.02 / 0.028))
        for n in range(steps + cycles):
            u = min(1.0, (n + 1) / steps)
            share = u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
            self.cell.simulation.observe()
            self.jaws.drive(opening if u == 1.0 else (1.0 - share) * begin + share * opening)
            self.cell.send(self.cell.home)
            self.jaws.update()
        mujoco.mj_forward(self.model, self.data)

    def ends(self) -> tuple[Array, Array]:
        """Return place (2, 3) and axis along (2, 3) of the sheet's end strips, by their bodies."""
        hinges = SCENARIO.sheet.strips.hinges
        plates = [f"sheet_strip_{i:02d}_plate" for i in (0, hinges)]
        ids = [self.model.geom(plate).id for plate in plates]
        return self.data.geom_xpos[ids].copy(), self.data.geom_xmat[ids][:, [0, 3, 6]].copy()

    def pads(self) -> Array:
        return np.array([self.data.site(f"{side}_{PAD_SITE}").xpos for side in SIDES])


@pytest.fixture(scope="module")
def bench() -> Bench:
    return Bench()


@pytest.mark.parametrize(
    ("x", "y", "yaw"), [(0.0, 0.0, 0.0), (1e-3, 1e-3, 0.00873), (-3e-3, 2e-3, -0.01)]
)
def test_a_sheet_is_held_as_it_lies(bench: Bench, x: float, y: float, yaw: float) -> None:
    """In the jaws' plane nothing moves it; across the jaws its middle plane goes to theirs."""
    bench.lay(x, y, yaw)
    before, along_before = bench.ends()
    bench.go(0.0, 25)
    assert bench.jaws.holding == (True, True)
    after, along = bench.ends()
    # Discretisation-limited: what the arms give way under a sheet of 0.3 N, and the stand's touch.
    np.testing.assert_allclose(after[:, :2], before[:, :2], atol=20e-6)
    np.testing.assert_allclose(along[:, :2], along_before[:, :2], atol=1e-4)
    np.testing.assert_allclose(after[:, 2], bench.pads()[:, 2], atol=20e-6)
    np.testing.assert_allclose(along[:, 2], 0.0, atol=1e-3)
    # The sites that the holds pull on lie in the pads, as the sheet was met.
    for side, end in zip(SIDES, (LEFT_END, RIGHT_END), strict=True):
        pad, site = bench.data.site(f"{side}_{PAD_SITE}"), bench.data.site(end)
        np.testing.assert_allclose(site.xpos, pad.xpos, atol=5e-6)
        np.testing.assert_allclose(site.xmat, pad.xmat, atol=1e-3)


def test_the_hold_carries_without_jaws_pressing(bench: Bench) -> None:
    """Pull at a held end with 5 N along the sheet: it gives way as its rubber and its arm do."""
    bench.lay()
    bench.go(0.0, 25)
    body = bench.model.body("sheet_strip_00").id
    before = bench.ends()[0][0, 0]
    bench.data.xfrc_applied[body, 0] = 5.0
    bench.go(0.0, 40)
    moved = bench.ends()[0][0, 0] - before
    bench.data.xfrc_applied[body] = 0.0
    # Order of magnitude: two rubber pads in series with two arms of some 10⁴ to 10⁵ N/m each.
    assert 1e-6 < moved < 1e-3
    assert bench.jaws.holding == (True, True)


def test_a_sheet_beyond_the_jaws_is_not_held(bench: Bench) -> None:
    """12 mm along x: one end has left the jaws, 10 mm deep each way, the other is well inside."""
    bench.lay(x=12e-3)
    bench.go(0.0, 25)
    assert bench.jaws.holding == (False, True)
    left, right = bench.jaws.gap_m.tolist()
    # Statics: pad meets pad, but for its contact's softness; the sheet keeps the others apart.
    assert left < 0.1 * THICKNESS_M
    assert right == pytest.approx(THICKNESS_M, rel=0.1)


def test_the_gap_is_the_pads_distance(bench: Bench) -> None:
    """What the encoders add up to, against the faces of the rubber in the world."""
    bench.lay()
    for opening in (0.008, 0.003):
        bench.go(opening, 15)
        for i, side in enumerate(SIDES):
            faces = []
            for jaw, inward in zip(arm.JAW_JOINTS, (-1.0, 1.0), strict=True):
                geom = bench.model.geom(f"{side}_{jaw}_rubber").id
                face = bench.data.geom_xpos[geom][2] + inward * bench.model.geom_size[geom, 2]
                faces.append(face)
            # Kinematics: rounding. The arm's pad is level.
            assert bench.jaws.gap_m[i] == pytest.approx(faces[0] - faces[1], abs=1e-6)
        # Discretisation-limited: dry friction in the jaws, 5 N on drives of 2e4 N/m.
        np.testing.assert_allclose(bench.jaws.gap_m, 2.0 * opening, atol=2 * 5 / 2e4 + 5e-5)


def test_a_held_sheet_keeps_its_gap_and_tells_its_thickness(bench: Bench) -> None:
    bench.lay()
    bench.go(0.0, 25)
    # Discretisation-limited: the pads' contact gives way by a part of the sheet's 0.5 mm.
    np.testing.assert_allclose(bench.jaws.gap_m, THICKNESS_M, rtol=0.1)
    early = bench.jaws.gap_m
    bench.go(0.0, 60)
    # The spindle locks itself: below a hundredth of the sheet in 1.7 s.
    np.testing.assert_allclose(bench.jaws.gap_m, early, atol=0.01 * THICKNESS_M)


def test_opening_lets_go_and_the_sheet_lies_where_it_was(bench: Bench) -> None:
    bench.lay(1e-3, -1e-3, 0.005)
    bench.go(0.0, 25)
    before, _ = bench.ends()
    bench.go(OPEN_M, 15)
    assert bench.jaws.holding == (False, False)
    assert not bench.data.eq_active.any()
    after, _ = bench.ends()
    # Statics: on the stand, whose friction holds it.
    np.testing.assert_allclose(after[:, :2], before[:, :2], atol=50e-6)
    # Nothing holds it: half a newton upward, above its weight of 0.3 N, takes it away.
    middle = bench.model.body(f"sheet_strip_{SCENARIO.sheet.strips.hinges // 2:02d}").id
    bench.data.xfrc_applied[middle, 2] = 0.5
    bench.go(OPEN_M, 5)
    bench.data.xfrc_applied[middle] = 0.0
    assert bench.ends()[0][:, 2].min() > after[:, 2].max() + 1e-3


def test_what_was_let_go_can_be_gripped_again_elsewhere(bench: Bench) -> None:
    """The first hold's place and turn must not be remembered."""
    bench.lay(2e-3, 1e-3, 0.008)
    bench.go(0.0, 25)
    bench.go(OPEN_M, 15)
    flat = np.zeros(SCENARIO.sheet.strips.hinges + 1)
    bench.cell.simulation.put_sheet(flat, bench.middle - np.array([2e-3, 1e-3, 0.0]), -0.008)
    mujoco.mj_forward(bench.model, bench.data)
    before, along_before = bench.ends()
    bench.go(0.0, 25)
    assert bench.jaws.holding == (True, True)
    after, along = bench.ends()
    np.testing.assert_allclose(after[:, :2], before[:, :2], atol=20e-6)
    np.testing.assert_allclose(along[:, :2], along_before[:, :2], atol=1e-4)


def test_a_reset_forgets_the_hold(bench: Bench) -> None:
    """A run's start is the same whatever was held before, also in the model that holds change."""
    bench.lay()
    sites = [bench.model.site(end).id for end in (LEFT_END, RIGHT_END)]
    fresh = bench.model.site_pos[sites].copy(), bench.model.site_quat[sites].copy()
    rubber = [
        bench.model.geom(f"{side}_{jaw}_rubber").id for side in SIDES for jaw in arm.JAW_JOINTS
    ]
    bench.lay(2e-3, 1e-3, 0.008)
    bench.go(0.0, 25)
    assert (bench.model.site_pos[sites] != fresh[0]).any()
    np.testing.assert_array_equal(bench.model.geom_conaffinity[rubber], 0)
    bench.lay()
    np.testing.assert_array_equal(bench.model.site_pos[sites], fresh[0])
    np.testing.assert_array_equal(bench.model.site_quat[sites], fresh[1])
    np.testing.assert_array_equal(bench.model.geom_conaffinity[rubber], GRIPPING)
    assert bench.jaws.holding == (False, False)
