"""Bed, pins and holes in contact, without arms: where a sheet that falls on its pins comes to rest.

The free sheet of 31 g is put above the pins and let go; 1.5 s later it lies still.
"""

import math
from functools import cache

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from dualbend.beam.sheet import GRAVITY_M_PER_S2
from dualbend.scene.bed.config import (
    HOLES,
    HolePairConfig,
    HolesConfig,
    LayoutConfig,
    PinsConfig,
    hole_places,
)
from dualbend.scene.bed.holes import Rectangle, add_holes, without
from dualbend.scene.bed.mjcf import add_workplace
from dualbend.scene.bed.pin_contacts import PinContacts
from dualbend.scene.sheet.strips import StripConfig, add_sheet, strip_body
from support.sheets import STRIP

Array = NDArray[np.float64]
STRIPS = StripConfig()
WEIGHT_N = STRIP.mass_kg * GRAVITY_M_PER_S2
STEP_S = 0.00175
ROUND, TAPER = LayoutConfig(), LayoutConfig(pins=PinsConfig(tip="taper"))
THICK = LayoutConfig(pins=PinsConfig(thicker_m=(0.0, 3e-4, 0.0, 0.0)))
HALF_CLEARANCE_M = 0.5 * ROUND.holes.clearance_m


class Scene:
    """A sheet, a bed and its pins."""

    def __init__(self, layout: LayoutConfig, laid: int = 0) -> None:
        spec = mujoco.MjSpec()
        spec.compiler.degree = False
        spec.option.timestep = STEP_S
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
        spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ISLAND)
        add_sheet(spec, STRIP, STRIPS, np.zeros(3))
        add_workplace(spec, layout, STRIP, STRIPS, laid)
        add_holes(spec, STRIP, STRIPS, layout)
        self.layout, self.model = layout, spec.compile()
        self.data = mujoco.MjData(self.model)
        self.pins = PinContacts(self.model, self.data, layout, STRIP, STRIPS)
        bodies = {self.model.body(strip_body(i)).id for i in range(STRIPS.hinges + 1)}
        self.of_sheet = np.isin(self.model.geom_bodyid, list(bodies))

    def put(self, x: float, y: float, height: float, yaw: float = 0.0) -> None:
        """Put the flat sheet at rest, its lower face this high above the bed."""
        z = self.layout.bed.top_m + height + 0.5 * STRIP.thickness_m
        self.data.qpos[:] = self.model.qpos0
        self.data.qpos[:7] = x, y, z, math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)
        self.data.qvel[:] = 0.0
        mujoco.mj_forward(self.model, self.data)

    def fall(self, seconds: float = 1.5) -> None:
        """Let go, in steps that are divided as a run divides them."""
        for step in range(round(seconds / STEP_S)):
            if step % 16 == 0:
                self.pins.peaks()
            parts = self.pins.parts()
            if not parts:
                mujoco.mj_step1(self.model, self.data)
                parts = self.pins.parts_by_contacts()
            self.model.opt.timestep = STEP_S / parts
            for _ in range(parts):
                mujoco.mj_step(self.model, self.data)
                self.pins.on_step()
        self.model.opt.timestep = STEP_S
        mujoco.mj_forward(self.model, self.data)

    def contacts(self) -> list[tuple[int, int, Array]]:
        """Return each contact of the sheet: its geom, the other one, the force on the sheet."""
        found, wrench = [], np.zeros(6)
        for i in range(self.data.ncon):
            first, second = self.data.contact.geom[i].tolist()
            mujoco.mj_contactForce(self.model, self.data, i, wrench)
            # In axes of the contact, on the second geom.
            force = self.data.contact.frame[i].reshape(3, 3).T @ wrench[:3]
            if self.of_sheet[second]:
                found.append((second, first, force))
            else:
                found.append((first, second, -force))
        return found


@cache
def fallen(layout: LayoutConfig, x: float, y: float, yaw: float) -> Scene:
    scene = Scene(layout)
    scene.put(x, y, layout.pins.height_m + 5e-4, yaw)
    scene.fall()
    return scene


# --- places -------------------------------------------------------------------------------------


def test_holes_and_pins_are_where_the_layout_says() -> None:
    errors = ((1e-4, 0.0), (0.0, -2e-4), (3e-4, 1e-4), (0.0, 0.0))
    layout = LayoutConfig(
        holes=HolesConfig(
            middle=HolePairConfig(along_m=0.045, across_m=0.01),
            outer=HolePairConfig(along_m=0.14, across_m=-0.015),
            errors_m=errors,
        )
    )
    scene = Scene(layout)
    scene.put(0.0, 0.0, 0.0)
    # Written out: the pairs are point-symmetric about the sheet's middle, left is negative.
    places = [(-0.045, -0.01), (0.045, 0.01), (-0.14, 0.015), (0.14, -0.015)]
    np.testing.assert_allclose(hole_places(layout.holes), places, atol=1e-15)
    for name, place, error in zip(HOLES, places, errors, strict=True):
        pin = scene.data.body(f"pin_{name}").xpos
        # Analytic: sums of a few numbers.
        np.testing.assert_allclose(pin, [*place, layout.bed.top_m], atol=1e-12)
        hole = scene.data.site(f"hole_{name}").xpos
        np.testing.assert_allclose(hole[:2] - place, error, atol=1e-12)
    away = scene.pins.offsets()
    np.testing.assert_allclose(away, np.column_stack((errors, np.zeros(4))), atol=1e-12)


@pytest.mark.parametrize("clearance", [2e-4, 1e-4])
@pytest.mark.parametrize("degrees", [0.0, 5.625, 30.0, 90.0, 200.0])
def test_a_pin_has_the_room_of_a_round_hole(clearance: float, degrees: float) -> None:
    """How far the sheet goes each way before a pin's shaft touches: half the clearance.

    Discretisation-limited: the ring's polygon has 32 sides, the radii of the circles in and around
    it differ by 1/cos(π/32) = 0.5 %, 12 µm; the pin's room is between what either leaves it.
    """
    layout = LayoutConfig(holes=HolesConfig(clearance_m=clearance))
    scene = Scene(layout)
    radius = 0.5 * (layout.pins.diameter_m + clearance)
    pin = scene.model.geom("pin_outer_right").id

    def touches(away: float) -> bool:
        turn = math.radians(degrees)
        scene.put(away * math.cos(turn), away * math.sin(turn), 1e-3)
        contact = scene.data.contact
        on_pin = (contact.geom == pin).any(axis=1)
        return bool((contact.dist[on_pin] < 0.0).any())

    low, high = 0.0, 1e-3
    for _ in range(20):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if touches(middle) else (middle, high)
    slack = radius * (1.0 / math.cos(math.pi / 32) - 1.0)
    assert 0.5 * (clearance - slack) <= high <= 0.5 * clearance + slack


def test_trees_of_boxes_find_no_other_contacts_than_all_pairs_and_in_the_same_order() -> None:
    """A cell with a bed goes without them: a run is the same to the bit."""
    scene = Scene(ROUND, laid=1)
    # In its holes, off their middle, a little deep: rings, feet, pins and bed touch.
    scene.put(1.2e-4, 2e-5, -1e-5, 1e-3)
    found = []
    for _ in range(2):
        mujoco.mj_forward(scene.model, scene.data)
        contact = scene.data.contact
        found.append([contact.geom.copy(), contact.dist.copy(), contact.frame.copy()])
        scene.model.opt.disableflags ^= int(mujoco.mjtDisableBit.mjDSBL_MIDPHASE)
    for with_trees, without_trees in zip(*found, strict=True):
        np.testing.assert_array_equal(with_trees, without_trees)
    assert len(np.unique(found[0][0])) > 40


# --- falling on the pins ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("layout", "x", "y", "yaw"),
    [
        (ROUND, 1e-3, 0.0, 0.0),
        (ROUND, 0.0, 1e-3, 0.0),
        (ROUND, 0.7e-3, -0.7e-3, 0.0),
        (ROUND, 0.0, 0.0, 0.005),
        (TAPER, -1e-3, 0.0, 0.0),
        (TAPER, 0.7e-3, 0.7e-3, 0.0),
    ],
)
def test_tips_centre_a_sheet_that_is_a_millimetre_off(
    layout: LayoutConfig, x: float, y: float, yaw: float
) -> None:
    scene = fallen(layout, x, y, yaw)
    away = scene.pins.offsets()
    # Discretisation-limited: half the clearance and 20 µm for the ring and the soft contact.
    assert np.hypot(*away[:, :2].T).max() <= HALF_CLEARANCE_M + 20e-6
    # Discretisation-limited: the contacts' softness under a weight of 0.3 N.
    np.testing.assert_allclose(away[:, 2], 0.0, atol=5e-6)


@pytest.mark.parametrize(
    ("layout", "x", "y", "yaw"),
    [(ROUND, 1e-3, 0.0, 0.0), (ROUND, 0.0, 1e-3, 0.0), (TAPER, -1e-3, 0.0, 0.0)],
)
def test_at_rest_the_bed_carries_the_weight(
    layout: LayoutConfig, x: float, y: float, yaw: float
) -> None:
    scene = fallen(layout, x, y, yaw)
    contacts = scene.contacts()
    total = np.sum([force for _, _, force in contacts], axis=0)
    # Statics: equilibrium, with what motion is left after 1.5 s.
    np.testing.assert_allclose(total, [0.0, 0.0, WEIGHT_N], atol=0.02 * WEIGHT_N)
    bed = scene.model.geom("bed").id
    upward = sum(force[2] for _, other, force in contacts if other == bed)
    assert upward == pytest.approx(WEIGHT_N, rel=0.05)
    # Feet lie on it and nothing else of the sheet.
    assert all(
        scene.model.geom(own).name.startswith("foot_") for own, other, _ in contacts if other == bed
    )


@pytest.mark.parametrize(("layout", "x"), [(ROUND, 3e-3), (TAPER, 3e-3), (ROUND, 8e-3)])
def test_millimetres_off_the_sheet_lies_on_the_tips(layout: LayoutConfig, x: float) -> None:
    """The top of a pin of 4.76 mm is not under a hole of 4.96 mm that is 3 mm or more beside it."""
    scene = fallen(layout, x, 0.0, 0.0)
    away = scene.pins.offsets()
    # Statics: where it was let go; its ends hang by micrometres between and beyond the pins.
    np.testing.assert_allclose(away[:, :2], [[x, 0.0]] * 4, atol=20e-6)
    np.testing.assert_allclose(away[:, 2], layout.pins.height_m, atol=20e-6)
    contacts = scene.contacts()
    on_pins = {scene.model.geom(other).name for _, other, _ in contacts}
    assert on_pins == {f"pin_{name}" for name in HOLES}
    total = np.sum([force for _, _, force in contacts], axis=0)
    np.testing.assert_allclose(total, [0.0, 0.0, WEIGHT_N], atol=0.01 * WEIGHT_N)


AT = {
    "a strip's middle": (0.04, 0.14, 30e-3, 0.0),
    "a hinge": (0.05, 0.15, 30e-3, 0.0),
    "a corner of the square that is cut out": (0.04, 0.14, 7.3e-3, 7.3e-3),
    "the hole's edge": (0.04, 0.14, 2.6e-3, 0.0),
    "the ring's outer edge": (0.04, 0.14, 10.4e-3, 0.0),
    "beside the ring": (0.04, 0.14, 0.0, 11.5e-3),
    "the end strip": (0.04, 0.196, 50e-3, 0.0),
}
"""Where the middle and outer pins stand along the sheet, and how far off their holes are [m]."""


@pytest.mark.parametrize(("middle", "outer", "x", "y"), AT.values(), ids=AT)
@pytest.mark.parametrize("tip", ["round", "taper"])
def test_no_pin_passes_through_metal(
    middle: float, outer: float, x: float, y: float, tip: str
) -> None:
    """Pressed on each tip by 10 N wherever it is under the sheet."""
    holes = HolesConfig(
        middle=HolePairConfig(along_m=middle, across_m=0.012),
        outer=HolePairConfig(along_m=outer, across_m=-0.012),
        errors_m=((x, y), (-x, y)) * 2,
    )
    scene = Scene(LayoutConfig(holes=holes, pins=PinsConfig(tip=tip)))
    height, h = scene.layout.pins.height_m, STRIP.length_m / STRIPS.hinges
    scene.put(0.0, 0.0, height + 2e-4)
    scene.fall(0.5)
    strips = []
    for along, across in hole_places(holes):
        strips.append(scene.model.body(strip_body(STRIPS.hinges // 2 + round(along / h))).id)
        at = np.array([along, across, scene.layout.bed.top_m + height])
        force = np.array([0.0, 0.0, -10.0])
        scene.data.xfrc_applied[strips[-1], :3] = force
        scene.data.xfrc_applied[strips[-1], 3:] = np.cross(at - scene.data.xipos[strips[-1]], force)
    scene.fall(0.5)
    scene.pins.peaks()
    scene.pins.on_step()
    force_n, _, depth, _ = scene.pins.peaks()
    # Statics, with what motion is left.
    np.testing.assert_allclose(force_n, 10.0 + WEIGHT_N / 4, rtol=0.05)
    # Discretisation-limited: the contacts' softness.
    assert (depth < 10e-6).all()
    assert (scene.data.xipos[strips, 2] > scene.layout.bed.top_m + height).all()


Length = st.floats(-0.3, 0.3, allow_subnormal=False)


@given(st.lists(st.tuples(Length, Length), max_size=4), st.floats(0.005, 0.1))
def test_what_is_cut_out_of_a_plate_and_what_fills_it_are_the_plate(
    centres: list[tuple[float, float]], half: float
) -> None:
    """Every point is in exactly one filling, or cut out; but for points on edges."""
    plate = (-0.25, 0.15, -0.1, 0.2)
    cut = [(x - half, x + half, y - half, y + half) for x, y in centres]
    filling = list(without(plate, cut))
    x, y = np.random.default_rng(1).uniform((-0.25, -0.1), (0.15, 0.2), (200, 2)).T

    def inside(of: list[Rectangle]) -> NDArray[np.int_]:
        return sum(
            ((a < x) & (x < b) & (c < y) & (y < d) for a, b, c, d in of), np.zeros(len(x), int)
        )

    np.testing.assert_array_equal(inside(filling), (inside(cut) == 0).astype(int))
    for a, b, c, d in filling:
        assert plate[0] <= a < b <= plate[1]
        assert plate[2] <= c < d <= plate[3]


@pytest.mark.parametrize("friction", [0.1, 0.2, 0.4])
def test_a_sheet_on_the_tips_slides_from_the_pins_friction_on(friction: float) -> None:
    """Coulomb: it stays below μ W, and beyond goes away with (F/W − μ) g."""
    scene = Scene(LayoutConfig(pins=PinsConfig(friction=friction)))
    scene.put(3e-3, 0.0, scene.layout.pins.height_m + 5e-4)
    scene.fall()
    model, data = scene.model, scene.data
    start, middle = data.qpos.copy(), model.body(strip_body(STRIPS.hinges // 2)).id
    steps = 60
    for share in (0.9, 1.5):
        data.qpos[:], data.qvel[:] = start, 0.0
        data.xfrc_applied[middle, 0] = share * friction * WEIGHT_N
        mujoco.mj_step(model, data, nstep=steps)
        moved = 2.0 * (data.qpos[0] - start[0]) / (steps * STEP_S) ** 2 / GRAVITY_M_PER_S2
        # Analytic, but for a soft contact, which creeps, and a weight that the tips share anew.
        assert moved == pytest.approx(max(share - 1.0, 0.0) * friction, abs=0.1 * 0.5 * friction)


def test_the_pins_sensors_tell_the_sum_and_the_largest_of_their_contacts() -> None:
    """On the tips, four pins share the weight; each one's force is that of its contacts."""
    scene = fallen(ROUND, 3e-3, 0.0, 0.0)
    scene.pins.peaks()
    scene.pins.on_step()
    net, edge, *depths = scene.pins.peaks()
    for i, name in enumerate(HOLES):
        pin = scene.model.geom(f"pin_{name}").id
        forces = np.array([force for _, other, force in scene.contacts() if other == pin])
        # Analytic: the same contacts, summed here.
        assert net[i] == pytest.approx(np.linalg.norm(forces.sum(axis=0)), rel=1e-9)
        assert edge[i] == pytest.approx(np.linalg.norm(forces, axis=1).max(), rel=1e-9)
        contact = scene.data.contact
        deepest = -contact.dist[(contact.geom == pin).any(axis=1)].min()
        assert deepest > 0.0
        for depth in depths:
            assert depth[i] == pytest.approx(deepest, rel=1e-9)
    # Statics: all upright.
    assert net.sum() == pytest.approx(WEIGHT_N, rel=0.01)
    # What was read begins anew.
    np.testing.assert_array_equal(scene.pins.peaks(), 0.0)


def test_peaks_are_the_largest_since_they_were_read() -> None:
    scene = Scene(ROUND)
    scene.put(3e-3, 0.0, ROUND.pins.height_m + 1e-3)
    seen, depths = [], []
    for _ in range(60):
        mujoco.mj_step(scene.model, scene.data)
        scene.pins.on_step()
        depths.append([-scene.data.sensor(f"distance_{name}").data[0] for name in HOLES])
        read = [scene.data.sensor(f"net_{name}").data.copy() for name in HOLES]
        seen.append(np.linalg.norm(read, axis=1))
    # The blow is over by now: the largest is not the last. Analytic: the same numbers.
    largest = np.max(seen, axis=0)
    assert (largest > 2.0 * seen[-1]).all()
    peaks = scene.pins.peaks()
    np.testing.assert_allclose(peaks.force_n, largest, rtol=1e-12)
    # It fell at first: no depth has lasted.
    np.testing.assert_array_equal(peaks.penetration_m, 0.0)
    np.testing.assert_array_equal(peaks.impact_m, np.max(depths, axis=0))
    assert (peaks.impact_m > 0.0).all()


# --- steps that are divided -----------------------------------------------------------------------


def parts_of(scene: Scene, height: float, speed: float) -> int:
    """Ask into how many the next step is divided, this far above the tips and at this speed."""
    scene.put(0.0, 0.0, scene.layout.pins.height_m + height)
    scene.pins.peaks()
    scene.put(0.0, 0.0, scene.layout.pins.height_m + height - speed * STEP_S)
    return scene.pins.parts()


@pytest.mark.parametrize(
    ("speed", "parts"), [(-0.1, 1), (0.0, 0), (0.02, 0), (0.03, 2), (0.08, 4), (0.1, 8), (1.0, 8)]
)
def test_a_step_is_divided_by_how_fast_holes_come_down_to_their_tips(
    speed: float, parts: int
) -> None:
    # Written out: 40 µm in each part, which is 23 mm/s undivided (0: but where contacts change); a
    # power of two, eight at most.
    assert parts_of(Scene(ROUND), 2.0 * max(speed, 0.0) * STEP_S, speed) == parts


@pytest.mark.parametrize("height", [20e-3, 4e-3, -3.9e-3])
def test_a_step_is_not_divided_far_above_the_tips_nor_below_them(height: float) -> None:
    assert parts_of(Scene(ROUND), height, 0.1) == 1


def test_a_step_is_divided_where_a_sheet_that_lies_on_tips_comes_off_one() -> None:
    scene, in_place = Scene(ROUND), fallen(ROUND, 0.0, 0.0, 0.0)
    scene.put(3e-3, 0.0, ROUND.pins.height_m + 5e-4)
    scene.fall()
    for each, parts in ((scene, 0), (in_place, 1)):
        each.pins.on_step()
        each.pins.peaks()
        assert each.pins.parts() == parts
    pins, held = scene.pins, scene.contacts()
    pins.on_step()
    assert pins.parts_by_contacts() == 1
    # It rests less deep than that in the tips, and would have a whole step to fall.
    scene.data.qpos[2] += 5e-6
    mujoco.mj_step1(scene.model, scene.data)
    assert not scene.contacts()
    # Written out: F dt²/m n² is at most 40 µm, m of a strip; of the tip that bears most.
    largest = max(
        float(np.linalg.norm(sum(force for _, other, force in held if other == pin)))
        for pin in {other for _, other, _ in held}
    )
    fall = largest * STEP_S**2 / (STRIP.mass_kg / (STRIPS.hinges + 1)) / 40e-6
    parts = pins.parts_by_contacts()
    assert 0.5 * parts < math.sqrt(fall) <= parts
    pins.on_step()
    # One more step, in which it is caught.
    assert [pins.parts_by_contacts() for _ in range(3)] == [parts, 1, 1]


def pressed_on_a_tip(force: float) -> Scene:
    """Return a sheet at rest on the tips, of which a strip on one of them is pressed down."""
    scene = Scene(ROUND)
    scene.put(3e-3, 0.0, ROUND.pins.height_m + 5e-4)
    pin = scene.model.geom("pin_middle_left").id
    scene.fall()
    strip = next(geom for geom, other, _ in scene.contacts() if other == pin)
    scene.data.xfrc_applied[scene.model.geom_bodyid[strip], 2] = -force
    scene.fall()
    return scene


def off_a_tip(force: float, *, divided: bool) -> float:
    """Return how deep a sheet falls [m] that is pressed on a tip and comes off it for a moment."""
    scene, depth = pressed_on_a_tip(force), 0.0
    scene.data.qpos[2] += 5e-6
    if not divided:
        scene.pins.parts_by_contacts = lambda: 1  # type: ignore[method-assign]
    for _ in range(8):
        scene.fall(STEP_S)
        depth = max(depth, -float(scene.data.contact.dist.min(initial=0.0)))
    return depth


@pytest.mark.parametrize("force", [0.5, 1.5, 5.0])
def test_a_sheet_that_comes_off_a_tip_for_a_moment_is_caught_before_it_is_deep(
    force: float,
) -> None:
    # Measured: 17 to 52 µm; undivided 0.2 to 1.9 mm.
    assert off_a_tip(force, divided=True) < 0.1e-3


def test_a_falling_sheet_that_presses_a_tip_is_divided_by_its_force_as_well() -> None:
    """At 50 mm/s a step is divided into 4; what is pressed with 5 N may come off in any of them."""
    scene = pressed_on_a_tip(5.0)
    scene.pins.peaks()
    scene.data.qpos[2] -= 0.05 * STEP_S
    mujoco.mj_kinematics(scene.model, scene.data)
    fall = 5.0 * STEP_S**2 / (STRIP.mass_kg / (STRIPS.hinges + 1)) / 40e-6
    parts = scene.pins.parts()
    # Written out: F dt²/m n² is at most 40 µm; the weight adds to F.
    assert 0.5 * parts < math.sqrt(fall) <= parts


def test_in_whole_steps_it_falls_deep() -> None:
    assert off_a_tip(1.5, divided=False) > 0.2e-3


# --- one on another -----------------------------------------------------------------------------


def test_laid_sheets_hold_the_next_one_up_by_their_thickness() -> None:
    scene = Scene(ROUND, laid=2)
    t = STRIP.thickness_m
    for below in range(3):
        scene.put(2e-5, 0.0, below * t + 3e-4)
        scene.fall(0.6)
        away = scene.pins.offsets()
        # Discretisation-limited: the contacts' softness under 0.3 N.
        np.testing.assert_allclose(away[:, 2], below * t, atol=5e-6)
        total = np.sum([force for _, _, force in scene.contacts()], axis=0)
        np.testing.assert_allclose(total, [0.0, 0.0, WEIGHT_N], atol=0.02 * WEIGHT_N)
        if below < 2:
            scene.pins.lay(below)


def test_a_laid_sheet_is_a_copy_of_every_strip() -> None:
    scene = Scene(ROUND, laid=1)
    scene.put(1e-3, -2e-3, 5e-3, 0.1)
    scene.data.qpos[7:] = 0.01
    mujoco.mj_forward(scene.model, scene.data)
    plates = [scene.model.geom(f"{strip_body(i)}_plate").id for i in range(STRIPS.hinges + 1)]
    place, turn = scene.data.geom_xpos[plates].copy(), scene.data.geom_xmat[plates].copy()
    scene.pins.lay(0)
    scene.put(0.0, 0.0, 0.1)
    copies = [scene.model.body(f"laid_0_{i:02d}").id for i in range(STRIPS.hinges + 1)]
    # Analytic: the same poses, through a quaternion.
    np.testing.assert_allclose(scene.data.xpos[copies], place, atol=1e-12)
    np.testing.assert_allclose(scene.data.xmat[copies], turn, atol=1e-12)


# --- pins that are not as drawn -----------------------------------------------------------------


def test_pins_may_be_thicker_than_drawn_or_missing_while_the_holes_stay() -> None:
    pins = PinsConfig(thicker_m=(0.0, 1e-4, 0.0, -1e-4), missing=("outer_left",))
    layout = LayoutConfig(pins=pins)
    model, drawn = Scene(layout).model, Scene(ROUND).model
    for hole, more in zip(HOLES, pins.thicker_m, strict=True):
        # Exact, but for rounding: a radius is half of it; holes belong to the drawn pins.
        radius = model.geom(f"pin_{hole}").size[0]
        assert 2.0 * radius == pytest.approx(pins.diameter_m + more, rel=1e-12)
        assert model.site(f"hole_{hole}").size[0] == drawn.site(f"hole_{hole}").size[0]
    shown = [model.geom(f"pin_{hole}").group.item() == 2 for hole in HOLES]
    assert shown == layout.standing.tolist() == [True, True, False, True]


def test_a_pin_that_is_thicker_than_its_hole_does_not_let_it_down() -> None:
    heights = fallen(THICK, 0.0, 0.0, 0.0).pins.offsets()[:, 2]
    # Analytic: a round tip of radius R is as thick as the hole, r, √(R² − r²) above its foot.
    large, small = 0.5 * (4.76e-3 + 3e-4), 0.5 * (4.76e-3 + 0.2e-3)
    rim = THICK.pins.height_m - large + math.sqrt(large**2 - small**2)
    # Discretisation-limited: towards a box's corner there are 12 µm more, and a tip is steep.
    assert heights[HOLES.index("middle_right")] == pytest.approx(rim, abs=0.2e-3)


def test_a_step_is_divided_where_a_hole_is_around_a_tip_that_is_too_thick_for_it() -> None:
    """All around the tip it is as stiff as metal. Elsewhere, on the stand too, it is not."""
    for layout, parts in ((ROUND, 0), (THICK, 16)):
        assert parts_of(Scene(layout), -2.1e-3, 0.0) == parts
    assert parts_of(Scene(THICK), 1e-3, 0.0) == 1
    scene = Scene(THICK)
    scene.put(0.0, 0.3, 0.0)
    scene.pins.peaks()
    assert scene.pins.parts() == 1


def wedged(off: float, above: float, force: float, parts: int) -> tuple[float, float]:
    """Push a hole that is off by this down on a tip that is too thick for it, from above its seat.

    Return the largest force of one contact [N], and the largest share of the work done until then
    that is elastic energy of the contacts, F r/2 each.
    """
    scene = Scene(THICK)
    model, data, layout = scene.model, scene.data, scene.layout
    large = 0.5 * (layout.pins.diameter_m + max(layout.thicker_m))
    small = 0.5 * (layout.pins.diameter_m + layout.holes.clearance_m)
    # Analytic: where the rim touches the ball on one side.
    rim = layout.pins.height_m - large + math.sqrt(large**2 - (small - off) ** 2)
    scene.put(off, 0.0, rim + above)
    scene.pins.peaks()
    assert scene.pins.parts() == 16
    model.opt.timestep = STEP_S / parts
    hole, pin = model.site("hole_middle_right"), model.geom("pin_middle_right").id
    body, down = model.site_bodyid[hole.id], np.array([0.0, 0.0, -force])
    start, wrench, largest, share = data.site_xpos[hole.id, 2].item(), np.zeros(6), 0.0, 0.0
    for _ in range(round(0.02 / model.opt.timestep)):
        data.xfrc_applied[body, :3] = down
        data.xfrc_applied[body, 3:] = np.cross(data.site_xpos[hole.id] - data.xipos[body], down)
        mujoco.mj_step(model, data)
        stored = 0.0
        for i in np.flatnonzero((data.contact.geom == pin).any(axis=1)):
            mujoco.mj_contactForce(model, data, i, wrench)
            stored += 0.5 * wrench[0] * max(-data.contact.dist[i], 0.0)
            largest = max(largest, math.hypot(*wrench[:3]))
        work = force * (start - data.site_xpos[hole.id, 2].item())
        if work > 0.05 * force * 0.1e-3:
            share = max(share, stored / work)
    return largest, share


@pytest.mark.parametrize(("off", "above", "force"), [(0.0, 50e-6, 4.0), (100e-6, 1e-6, 4.0)])
def test_a_wedge_bears_what_came_down_on_it_and_no_more(
    off: float, above: float, force: float
) -> None:
    """Dropped on it from all sides, and slid off its side: the steps do not make the force."""
    coarse, *finer = (wedged(off, above, force, parts) for parts in (16, 32, 64))
    for largest, share in (coarse, *finer):
        # Conservation of energy; what is not stored is in motion, or was rubbed away.
        assert share < 1.0
        # Discretisation-limited: when the wedge is struck, within a step.
        assert coarse[0] / 1.5 < largest < 1.5 * coarse[0]


def test_a_sheet_lies_on_the_tips_of_the_pins_that_stand() -> None:
    scene = fallen(LayoutConfig(pins=PinsConfig(missing=("outer_left",))), 3e-3, 0.0, 0.0)
    on_pins = {scene.model.geom(other).name for _, other, _ in scene.contacts()}
    assert {f"pin_{hole}" for hole in HOLES} - on_pins >= {"pin_outer_left"}
    assert scene.data.sensor("net_outer_left").data.tolist() == [0.0, 0.0, 0.0]
    total = np.sum([force for _, _, force in scene.contacts()], axis=0)
    # Statics, as with all pins.
    np.testing.assert_allclose(total, [0.0, 0.0, WEIGHT_N], atol=0.02 * WEIGHT_N)
