"""Bed, stand, pins, holes and laid sheets as compiled: sizes, who touches whom, what is in view."""

import itertools
import math

import mujoco
import numpy as np
import pytest

from dualbend.beam.sheet import Sheet
from dualbend.scene.bed.config import (
    HOLES,
    BedConfig,
    HolesConfig,
    LayoutConfig,
    PinsConfig,
    StandConfig,
    hole_places,
)
from dualbend.scene.bed.holes import add_holes
from dualbend.scene.bed.mjcf import add_workplace, laid_body
from dualbend.scene.mjcf import SITE, about_z, make_plate
from dualbend.scene.sheet.strips import StripConfig, add_sheet
from dualbend.types import Vector
from support.sheets import STRIP

STRIPS = StripConfig()
LAYOUT = LayoutConfig(
    bed=BedConfig(top_m=0.6, friction=0.3), stand=StandConfig(y_m=0.35, top_m=0.03)
)
H = STRIP.length_m / STRIPS.hinges


class Workplace:
    def __init__(self, layout: LayoutConfig = LAYOUT, laid: int = 1) -> None:
        spec = mujoco.MjSpec()
        spec.compiler.degree = False
        middle = np.array([0.0, 0.0, layout.bed.top_m + STRIP.thickness_m / 2])
        add_sheet(spec, STRIP, STRIPS, middle)
        add_workplace(spec, layout, STRIP, STRIPS, laid)
        add_holes(spec, STRIP, STRIPS, layout)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)
        self.names = [self.model.geom(i).name for i in range(self.model.ngeom)]

    def of_body(self, body: str) -> list[int]:
        return np.flatnonzero(self.model.geom_bodyid == self.model.body(body).id).tolist()

    def starting(self, prefix: str) -> list[int]:
        return [i for i, name in enumerate(self.names) if name.startswith(prefix)]

    def box(self, geom: int) -> tuple[Vector, Vector]:
        """Return the corners (lowest, highest) of a box that is parallel to the world's axes."""
        middle, half = self.data.geom_xpos[geom], self.model.geom_size[geom]
        return middle - half, middle + half


@pytest.fixture(scope="module")
def place() -> Workplace:
    return Workplace()


# --- who touches whom ---------------------------------------------------------------------------


def test_each_touches_what_it_is_to_touch_and_nothing_else(place: Workplace) -> None:
    """By MuJoCo's rule: a pair is looked at if one's contype shares a bit with the other's."""
    model = place.model
    kinds = {
        "bed": place.starting("bed"),
        "stand": place.starting("stand"),
        "pin": place.starting("pin_"),
        "foot": place.starting("foot_"),
        "ring": [i for i in place.starting("hole_") if not place.names[i].endswith("disc")],
        "laid": [i for i in place.of_body(laid_body(0, 3)) if model.geom_group[i] == 3],
        "end": [model.geom(f"sheet_strip_{i:02d}_plate").id for i in (0, STRIPS.hinges)],
        "inner plate": [model.geom("sheet_strip_04_plate").id],
        "filling": place.starting("filling_"),
        "disc": [i for i in place.starting("hole_") if place.names[i].endswith("disc")],
    }
    counts = {kind: len(geoms) for kind, geoms in kinds.items()}
    assert counts == {
        "bed": 1,
        "stand": 1,
        "pin": 4,
        "foot": 2 * (STRIPS.hinges - 1),
        "ring": 4 * 32,
        "laid": 1,
        "end": 2,
        "inner plate": 1,
        "filling": 4 * 4,
        "disc": 4,
    }
    touching = set()
    for one, other in itertools.combinations_with_replacement(kinds, 2):
        for i, j in itertools.product(kinds[one], kinds[other]):
            bits = (
                model.geom_contype[i] & model.geom_conaffinity[j]
                | model.geom_contype[j] & model.geom_conaffinity[i]
            )
            if bits and i != j:
                touching.add(frozenset((one, other)))
    # Written down: the sheet lies on its feet, no pin passes it; jaws come with the arms.
    assert touching == {
        frozenset(pair)
        for pair in (
            *(("bed", "foot"), ("stand", "foot"), ("laid", "foot")),
            *(("pin", "ring"), ("pin", "end"), ("pin", "inner plate"), ("pin", "filling")),
        )
    }
    # Arms have bit 1: they stop at bed, stand and pins; at a laid sheet their links alone do.
    for kind, stops in (("bed", True), ("stand", True), ("pin", True), ("laid", False)):
        assert bool(model.geom_conaffinity[kinds[kind][0]] & 1) is stops
    # A jaw's rubber meets the sheet's ends alone.
    gripped = np.flatnonzero(model.geom_contype & 8).tolist()
    assert gripped == sorted(kinds["end"])


def test_contacts_have_dry_friction_of_the_coefficient_of_what_lies_below(
    place: Workplace,
) -> None:
    model = place.model
    # The larger of two counts: bed and stand have one, the pins theirs, what lies on them none.
    frictions = {"bed": 0.3, "stand": 0.3, "foot_03_front": 0.0, "hole_middle_left_00": 0.0}
    frictions |= {f"pin_{hole}": LAYOUT.pins.friction for hole in HOLES}
    for name, friction in frictions.items():
        geom = model.geom(name)
        # Rolling and spinning have MuJoCo's own small numbers.
        np.testing.assert_array_equal(geom.friction, [friction, 0.005, 0.0001])
        if name not in ("bed", "stand"):
            assert model.geom_condim[geom.id] == 3
            # Critically damped, two steps of 1.75 ms; at a pin what divided steps resolve.
            slow = 0.0015 if name.startswith("pin_") else 0.0035
            np.testing.assert_array_equal(model.geom_solref[geom.id], [slow, 1.0])
    laid = next(i for i in place.of_body(laid_body(0, 3)) if model.geom_group[i] == 3)
    assert model.geom_friction[laid, 0] == 0.3  # the bed's
    # Within 20 µm the contact is as hard as it gets, whatever touches the pin.
    for hole in HOLES:
        pin = model.geom(f"pin_{hole}").id
        np.testing.assert_array_equal(model.geom_solimp[pin], [0.98, 0.999, 2e-5, 0.5, 2.0])
        assert model.geom_priority[pin] == 1 > model.geom_priority[: model.ngeom].min()


def test_nothing_but_the_plates_of_the_strips_weighs(place: Workplace) -> None:
    model = place.model
    body = model.body(f"sheet_strip_{STRIPS.hinges // 2:02d}").id
    # Analytic: ρ L w t; holes, feet and pictures add nothing.
    assert model.body_subtreemass[body] == pytest.approx(STRIP.mass_kg, rel=1e-12)


# --- places and sizes ---------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["bed", "stand"])
def test_a_block_stands_on_the_floor_up_to_its_top_and_is_drawn_so(
    place: Workplace, name: str
) -> None:
    block: BedConfig | StandConfig = getattr(LAYOUT, name)
    y = LAYOUT.stand.y_m if name == "stand" else 0.0
    low, high = place.box(place.model.geom(name).id)
    sides = np.array([block.half_length_m, block.half_width_m])
    # Exact: written out.
    np.testing.assert_allclose(low, [-sides[0], y - sides[1], 0.0], atol=1e-15)
    np.testing.assert_allclose(high, [sides[0], y + sides[1], block.top_m], atol=1e-15)
    drawn = [
        i
        for i in place.of_body("world")
        if place.model.geom_group[i] == 2 and place.data.geom_xpos[i, 1] == y
    ]
    assert not place.model.geom_contype[drawn].any()
    assert not place.model.geom_conaffinity[drawn].any()
    (plate_low, plate_high), (column_low, column_high) = (place.box(i) for i in drawn)
    # A plate of 20 mm, of half the height where that is less, upon a column of 0.7 of its sides.
    thick = min(0.02, block.top_m / 2)
    np.testing.assert_allclose(plate_high, high, atol=1e-12)
    np.testing.assert_allclose(plate_low, [*low[:2], block.top_m - thick], atol=1e-12)
    assert column_high[2] == pytest.approx(plate_low[2], abs=1e-12)
    assert column_low[2] == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(column_high[:2] - column_low[:2], 2 * 0.7 * sides, atol=1e-12)


def test_a_round_pin_is_half_a_ball_on_a_cylinder(place: Workplace) -> None:
    for hole, (along, across) in zip(HOLES, hole_places(LAYOUT.holes), strict=True):
        geom = place.model.geom(f"pin_{hole}").id
        radius, half = place.model.geom_size[geom][:2]
        top = place.data.geom_xpos[geom] + [0.0, 0.0, half + radius]
        # Exact: where the hole of a flat sheet is, its tip above the bed.
        np.testing.assert_allclose(
            top, [along, across, LAYOUT.bed.top_m + LAYOUT.pins.height_m], atol=1e-12
        )
        assert 2.0 * radius == pytest.approx(LAYOUT.pins.diameter_m, rel=1e-12)
        # Its foot is on the bed: the lower hemisphere begins there.
        assert place.data.geom_xpos[geom, 2] - half == pytest.approx(LAYOUT.bed.top_m, abs=1e-12)
        assert place.model.geom_group[geom] == 2


def test_a_tapered_pin_is_a_truncated_cone_on_a_cylinder() -> None:
    pins = PinsConfig(tip="taper", taper_length_m=2.5e-3, height_m=7e-3)
    layout = LayoutConfig(pins=pins)
    place = Workplace(layout, laid=0)
    geom = place.model.geom("pin_middle_left").id
    mesh = place.model.geom_dataid[geom]
    start, count = place.model.mesh_vertadr[mesh], place.model.mesh_vertnum[mesh]
    axes = place.data.geom_xmat[geom].reshape(3, 3)
    vertices = place.model.mesh_vert[start : start + count] @ axes.T + place.data.geom_xpos[geom]
    vertices -= [*hole_places(layout.holes)[0], layout.bed.top_m]
    height, radius = vertices[:, 2], np.hypot(*vertices[:, :2].T)
    shaft = radius[height < 4.5e-3 + 1e-6]
    # Meshes are kept in single precision.
    assert count == 3 * 24
    assert (height.min(), height.max()) == pytest.approx((0.0, 7e-3), abs=1e-8)
    np.testing.assert_allclose(shaft, pins.diameter_m / 2, atol=1e-8)
    np.testing.assert_allclose(radius[height > 6.9e-3], pins.diameter_m / 6, atol=1e-8)
    assert np.sum(np.abs(height - 4.5e-3) < 1e-7) == 24
    angles = np.sort(np.arctan2(*vertices[height > 6.9e-3][:, 1::-1].T))
    np.testing.assert_allclose(np.diff(angles), math.pi / 12, atol=1e-4)
    assert pins.tip_m == 2.5e-3
    assert PinsConfig(diameter_m=5e-3).tip_m == 2.5e-3


@pytest.mark.parametrize("clearance", [1e-4, 4e-4])
def test_a_hole_is_a_ring_of_32_boxes_around_its_circle(clearance: float) -> None:
    layout = LayoutConfig(holes=HolesConfig(clearance_m=clearance))
    place = Workplace(layout, laid=0)
    model, data = place.model, place.data
    radius = (layout.pins.diameter_m + clearance) / 2
    for hole, centre in zip(HOLES, hole_places(layout.holes), strict=True):
        site = model.site(f"hole_{hole}").id
        assert model.site_size[site] == pytest.approx(radius, rel=1e-12)
        assert model.site_group[site] == 4
        height = data.site_xpos[site, 2]
        disc = model.geom(f"hole_{hole}_disc").id
        # Drawn in the same place, hardly proud of both faces.
        np.testing.assert_allclose(data.geom_xpos[disc], [*centre, height], atol=1e-12)
        assert model.geom_size[disc, 0] == pytest.approx(radius, rel=1e-12)
        proud = model.geom_size[disc, 1] - STRIP.thickness_m / 2
        assert 0.0 < proud < 1e-4
        for i in range(32):
            box = model.geom(f"hole_{hole}_{i:02d}").id
            outward = np.array([math.cos(i * math.pi / 16), math.sin(i * math.pi / 16), 0.0])
            half = model.geom_size[box]
            inner = data.geom_xpos[box] - half[0] * outward
            # Analytic: each inner face is tangent to the hole, each box 8 mm deep, and its sides
            # meet the next one's where the ring ends outside.
            np.testing.assert_allclose(inner, [*(centre + radius * outward[:2]), height], atol=1e-9)
            np.testing.assert_allclose(data.geom_xmat[box].reshape(3, 3)[:, 0], outward, atol=1e-9)
            assert 2.0 * half[0] == pytest.approx(8e-3, rel=1e-12)
            assert half[1] == pytest.approx((radius + 8e-3) * math.tan(math.pi / 32), rel=1e-9)
            assert half[2] == pytest.approx(STRIP.thickness_m / 2, rel=1e-12)
            assert model.geom_group[box] == 3


def test_the_sheet_has_feet_under_each_inner_strip(place: Workplace) -> None:
    model, data = place.model, place.data
    for i in range(1, STRIPS.hinges):
        for side, sign in (("front", -1.0), ("back", 1.0)):
            foot = model.geom(f"foot_{i:02d}_{side}").id
            arc = i * H - STRIP.length_m / 2
            expected = [arc, sign * 0.4 * STRIP.width_m, LAYOUT.bed.top_m + STRIP.thickness_m / 2]
            # Exact: in the middle of the strip, 0.4 of the width off the centre line.
            np.testing.assert_allclose(data.geom_xpos[foot], expected, atol=1e-12)
            # As thick as the sheet, so that the sheet's face is what lies on the bed.
            assert model.geom_size[foot, 0] == STRIP.thickness_m / 2


def test_a_laid_sheet_is_the_sheet_strip_by_strip_and_waits_below_the_floor(
    place: Workplace,
) -> None:
    model, data = place.model, place.data
    lengths = []
    for i in range(STRIPS.hinges + 1):
        body = model.body(laid_body(0, i)).id
        assert model.body_mocapid[body] >= 0
        np.testing.assert_array_equal(data.xpos[body], [0.0, 0.0, -1.0])
        drawn, touched = place.of_body(laid_body(0, i))
        size, deep = model.geom_size[drawn], model.geom_size[touched]
        lengths.append(2.0 * size[0])
        assert size[1:] == pytest.approx([STRIP.width_m / 2, STRIP.thickness_m / 2], rel=1e-12)
        assert deep == pytest.approx([size[0], size[1], 2.5e-3], rel=1e-12)
        # Both have one upper face: the next sheet rests on what is seen.
        tops = [data.geom_xpos[geom, 2] + model.geom_size[geom, 2] for geom in (drawn, touched)]
        assert tops[0] == pytest.approx(tops[1], abs=1e-12)
        np.testing.assert_array_equal(data.geom_xpos[[drawn, touched], :2], 0.0)
        assert (model.geom_group[drawn], model.geom_group[touched]) == (2, 3)
    # Exact: halves at both ends, together the whole sheet.
    assert lengths == pytest.approx([H / 2, *[H] * (STRIPS.hinges - 1), H / 2], rel=1e-12)


def test_the_force_sensors_take_the_sum_and_the_largest_contact(place: Workplace) -> None:
    """MuJoCo's XML reference, sensor/contact: reduce is none, mindist, maxforce or netforce."""
    model = place.model
    force = 1 << int(mujoco.mjtConDataField.mjCONDATA_FORCE)
    for hole in HOLES:
        for kind, reduce in (("net", 3), ("edge", 2)):
            sensor = model.sensor(f"{kind}_{hole}").id
            assert model.sensor_intprm[sensor, :3].tolist() == [force, reduce, 1]
            assert model.sensor_objid[sensor] == model.geom(f"pin_{hole}").id


def test_the_camera_of_the_bed_has_the_sheet_in_view_from_the_front_and_above(
    place: Workplace,
) -> None:
    model, data = place.model, place.data
    camera = model.camera("bed").id
    eye, axes = data.cam_xpos[camera], data.cam_xmat[camera].reshape(3, 3)
    reach = math.tan(math.radians(model.cam_fovy[camera]) / 2)
    half, wide = STRIP.length_m / 2, STRIP.width_m / 2
    top = LAYOUT.bed.top_m
    corners = np.array([[x, y, top] for x in (-half, half) for y in (-wide, wide)])
    seen = (corners - eye) @ axes
    across, up = seen[:, 0] / -seen[:, 2] / reach, seen[:, 1] / -seen[:, 2] / reach
    assert (seen[:, 2] < 0.0).all()  # a camera looks along its own −z
    # Of a picture of 4:3 the sheet takes most of the width, and is near its middle.
    assert 0.4 < np.abs(across).max() < 4.0 / 3.0
    assert np.abs(up).max() < 0.5
    assert across == pytest.approx(-across[::-1][[1, 0, 3, 2]], abs=1e-9)  # symmetric
    assert eye[1] < -wide
    assert eye[2] > top + 0.5 * STRIP.length_m
    # The picture is upright: the world's x to the right, z upwards.
    assert axes[0, 0] == pytest.approx(1.0)
    assert axes[2, 1] > 0.7


# --- what all of the scene shares ---------------------------------------------------------------


@pytest.mark.parametrize("angle", [0.0, 0.3, -2.0, math.pi])
def test_a_turn_about_z_takes_x_to_its_direction(angle: float) -> None:
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, np.array(about_z(angle)))
    # Analytic.
    x, y, z = matrix.reshape(3, 3).T
    np.testing.assert_allclose(x, [math.cos(angle), math.sin(angle), 0.0], atol=1e-15)
    np.testing.assert_allclose(y, [-math.sin(angle), math.cos(angle), 0.0], atol=1e-15)
    np.testing.assert_allclose(z, [0.0, 0.0, 1.0], atol=1e-15)


def test_a_plate_has_the_inertia_of_a_box() -> None:
    spec = mujoco.MjSpec()
    for body_name, density in (("made", None), ("box", STRIP.density_kg_per_m3)):
        body = spec.worldbody.add_body(name=body_name)
        if density is None:
            make_plate(body, STRIP, 0.07, 0.02)
        else:
            size = [0.035, STRIP.width_m / 2, STRIP.thickness_m / 2]
            body.add_geom(
                type=mujoco.mjtGeom.mjGEOM_BOX, size=size, pos=[0.02, 0, 0], density=density
            )
    model = spec.compile()
    made, box = model.body("made"), model.body("box")
    # Analytic: MuJoCo's own inertia of the same box, whose order of axes it chooses.
    assert made.mass == pytest.approx(box.mass, rel=1e-12)
    assert sorted(made.inertia) == pytest.approx(sorted(box.inertia), rel=1e-12)
    np.testing.assert_allclose(made.ipos, box.ipos, atol=1e-15)
    # The largest is about the normal, the smallest about the longer side, as they were given.
    assert made.inertia[2] > made.inertia[1] > made.inertia[0]


def test_sites_are_small_and_not_drawn_by_default() -> None:
    assert SITE == {"group": 4, "size": [0.003] * 3}
    shown = mujoco.MjvOption().sitegroup
    assert not shown[SITE["group"]]


def test_a_sheet_in_the_layout_is_one_of_the_sheets(place: Workplace) -> None:
    assert isinstance(STRIP, Sheet)
    plates = [i for i in place.starting("sheet_strip_") if place.names[i].endswith("_plate")]
    # Exact: the plates cover the sheet once, end to end.
    assert len(plates) == STRIPS.hinges + 1
    for plate in plates:
        sides = 2.0 * place.model.geom_size[plate, 1:]
        assert sides == pytest.approx([STRIP.width_m, STRIP.thickness_m], rel=1e-12)
    edges = [place.box(i) for i in plates]
    edges.sort(key=lambda box: box[0][0])
    assert edges[0][0][0] == pytest.approx(-STRIP.length_m / 2, abs=1e-12)
    assert edges[-1][1][0] == pytest.approx(STRIP.length_m / 2, abs=1e-12)
    for (_, end), (start, _) in itertools.pairwise(edges):
        assert end[0] == pytest.approx(start[0], abs=1e-12)
