"""The planner's geometry: the tilted hole, the hanging sheet at its holes, the tips of the pins."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dualbend.beam import elastica
from dualbend.beam.rod import planar as rod
from dualbend.beam.sheet import Sheet
from dualbend.errors import InputError
from dualbend.planning import geometry
from dualbend.planning import shape as shapes
from dualbend.scene.bed.config import PinsConfig
from support.sheets import STRIP

L, EI, Q = STRIP.length_m, STRIP.bending_stiffness_nm2, STRIP.weight_per_length_n_per_m
seeded = settings(max_examples=40)


def cylinder_passes(x: float, D: float, d: float, t: float, slope: float) -> bool:
    """Sample both rims of the tilted bore in 3-D and see whether an upright cylinder is inside."""
    turn = np.linspace(0.0, 2.0 * math.pi, 20_001)
    for side in (-0.5, 0.5):
        local = np.stack([D / 2 * np.cos(turn), D / 2 * np.sin(turn), np.full(turn.size, side * t)])
        c, s = math.cos(slope), math.sin(slope)
        seen = np.array([[c, 0.0, -s], [0.0, 1.0, 0.0]]) @ local
        if np.min(np.hypot(seen[0] - x, seen[1])) < d / 2 or abs(x - seen[0].mean()) > D / 2 * c:
            return False
    return True


@given(
    d=st.floats(1e-3, 6e-3),
    clearance=st.floats(5e-5, 2e-3),
    t=st.floats(1e-4, 2e-3),
    slope=st.floats(-0.6, 0.6),
)
@seeded
def test_free_play_is_that_of_a_cylinder_in_the_bore(
    d: float, clearance: float, t: float, slope: float
) -> None:
    D = d + clearance
    half = geometry.hole_play(D, d, t, slope) / 2
    # Discretisation-limited: the nearest of 20 001 points of a rim is within (D π/20 000)²/d.
    grain = 1e-9 + (D * math.pi / 20_000) ** 2 / d
    if half > 2 * grain:
        assert cylinder_passes(half - grain, D, d, t, slope)
        assert cylinder_passes(-half + grain, D, d, t, slope)
        assert not cylinder_passes(half + grain, D, d, t, slope)
    if half < -2 * grain:
        assert not any(cylinder_passes(x, D, d, t, slope) for x in (-1e-4, 0.0, 1e-4))


def test_free_play_has_its_limits() -> None:
    # Analytic: flat it is the clearance; D − d − t|θ| − Dθ²/2 + O(θ³); even in θ.
    assert geometry.hole_play(5e-3, 4.8e-3, 5e-4, 0.0) == pytest.approx(2e-4, abs=1e-18)
    slope = 0.01
    small = 2e-4 - 5e-4 * slope - 5e-3 * slope**2 / 2
    assert geometry.hole_play(5e-3, 4.8e-3, 5e-4, slope) == pytest.approx(
        small, abs=5e-3 * slope**3
    )
    assert geometry.hole_play(5e-3, 4.8e-3, 5e-4, -0.2) == geometry.hole_play(
        5e-3, 4.8e-3, 5e-4, 0.2
    )
    # Analytic: a plate without thickness that stands on edge leaves −d.
    assert geometry.hole_play(5e-3, 4.8e-3, 0.0, math.pi / 2) == pytest.approx(-4.8e-3, abs=1e-15)


@pytest.mark.parametrize("alpha", [0.1, 0.6, 1.57])
def test_hole_positions_are_those_of_the_closed_form(alpha: float) -> None:
    shape = shapes.hang(STRIP, alpha, weight=False)
    s = np.linspace(0.0, L / 2, 173)
    x, z, theta = elastica.shape(alpha, L, s + L / 2)
    found = np.array([shape.at(float(along)) for along in s])
    # Discretisation-limited: cubic Hermite pieces of 5 mm, stated as below 2e-8 L.
    np.testing.assert_allclose(found[:, 0], x, atol=2e-8 * L)
    np.testing.assert_allclose(found[:, 1], z - z[0], atol=2e-8 * L)
    np.testing.assert_allclose(found[:, 2], -theta, atol=2e-6)


@pytest.mark.parametrize("weight", [False, True])
def test_hole_positions_are_the_integrals_of_the_slope(weight: bool) -> None:
    shape = shapes.hang(STRIP, 0.6, weight=weight)
    s, w = np.polynomial.legendre.leggauss(24)
    for along in (0.013, 0.04, 0.137, 0.2):
        slope = np.array([shape.at(float(p)).slope_rad for p in (s + 1) * along / 2])
        pose = shape.at(along)
        # Discretisation-limited: cubic Hermite pieces of 5 mm.
        assert pose.x_m == pytest.approx(w @ np.cos(slope) * along / 2, abs=2e-8 * L)
        assert pose.z_m == pytest.approx(w @ np.sin(slope) * along / 2, abs=2e-8 * L)


def test_the_outer_half_is_the_image_of_the_inner_one() -> None:
    alpha = 0.3
    state = rod.solve_symmetric(EI, L, alpha, elastica.half_distance(alpha, L), Q)
    shape = shapes.hang(STRIP, alpha)
    left = slice(40, None, -1)
    # Analytic: the symmetric equilibrium; solver's residual 1e-7 relative.
    np.testing.assert_allclose(shape.nodes[0], state.x_m[40] - state.x_m[left], atol=1e-9)
    np.testing.assert_allclose(shape.nodes[1], state.z_m[left] - state.z_m[40], atol=1e-9)
    np.testing.assert_allclose(shape.nodes[2], state.theta_rad[left], atol=1e-8)
    # Analytic: the same numbers, by name.
    assert (shape.end_force_n, shape.end_moment_nm) == (state.end_force_n, state.end_moment_nm)
    assert shape.at(0.0) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    assert shape.at(L / 2).slope_rad == pytest.approx(alpha, abs=1e-9)
    assert shape.at(L / 2).z_m == pytest.approx(shape.rise_m, abs=1e-9)


def test_a_light_sheet_hangs_as_the_closed_form() -> None:
    light = Sheet(
        **{name: getattr(STRIP, name) for name in STRIP.__dataclass_fields__}
        | {"density_kg_per_m3": 1e-3}
    )
    for alpha in (0.05, 0.3, 1.2):
        heavy, free = shapes.hang(light, alpha), shapes.hang(light, alpha, weight=False)
        # Analytic: the weight goes in linearly, and it is 4e-7 of the real sheet's.
        np.testing.assert_allclose(heavy.nodes, free.nodes, atol=2e-8)
        np.testing.assert_allclose(heavy.rates, free.rates, atol=2e-6)
        assert heavy.end_force_n == pytest.approx(free.end_force_n, rel=3e-6)
        assert heavy.strain == pytest.approx(free.strain, rel=1e-6)


def test_what_the_weight_changes_is_small_and_as_stated() -> None:
    heavy, free = (shapes.hang(STRIP, 0.134, weight=weight) for weight in (True, False))
    # Golden: outer holes 22 µm lower against the middle, grips 12 µm, approach −1.2 %.
    assert free.at(0.14).z_m - heavy.at(0.14).z_m == pytest.approx(22.3e-6, abs=0.5e-6)
    assert free.rise_m - heavy.rise_m == pytest.approx(11.7e-6, abs=0.5e-6)
    ratio = (0.04 - heavy.at(0.04).x_m) / (0.04 - free.at(0.04).x_m)
    assert ratio == pytest.approx(0.988, abs=1e-3)
    # Golden: a third of the end force.
    assert (free.end_force_n, heavy.end_force_n) == pytest.approx((2.581, 1.736), abs=2e-3)


@given(alpha=st.floats(shapes.LOWEST_RAD, shapes.HIGHEST_RAD))
@seeded
def test_the_table_of_shapes_is_the_reference(alpha: float) -> None:
    table, reference = shapes.shape_family(STRIP)(alpha), shapes.hang(STRIP, alpha)
    # Discretisation-limited: 49 nodes, fourth order, stated as 0.1 µm.
    np.testing.assert_allclose(table.nodes[:2], reference.nodes[:2], atol=1e-7)
    np.testing.assert_allclose(table.nodes[2], reference.nodes[2], atol=1e-6)
    assert table.rise_m == pytest.approx(reference.rise_m, abs=1e-7)
    assert table.end_force_n == pytest.approx(reference.end_force_n, abs=2e-4)
    assert table.end_moment_nm == pytest.approx(reference.end_moment_nm, abs=1e-7)
    assert table.strain == pytest.approx(reference.strain, rel=1e-3)


def test_middle_pair_approaches_as_the_cube_of_its_distance() -> None:
    alpha = 0.3
    shape = shapes.hang(STRIP, alpha, weight=False)
    kappa = elastica.curvature_max(alpha, L)

    def error(s: float) -> float:
        return 2.0 * (s - shape.at(s).x_m) / (kappa**2 * s**3 / 3.0) - 1.0

    # Analytic: κ² s³/3 with a relative error of order s²: a quarter at half the distance.
    assert error(0.02) / error(0.04) == pytest.approx(0.25, rel=0.02)
    assert abs(error(0.01)) < 2e-3


def test_a_sheet_off_the_range_is_refused() -> None:
    with pytest.raises(InputError, match="end slope"):
        shapes.hang(STRIP, 1.6)
    with pytest.raises(InputError, match="end slope"):
        shapes.shape_family(STRIP)(-0.1)
    with pytest.raises(InputError, match="arc length"):
        shapes.hang(STRIP, 0.3).at(0.21)


@given(friction=st.floats(0.0, 2.0), slope=st.floats(0.0, 0.3))
@seeded
def test_round_tip_guides_where_it_is_steeper_than_friction(friction: float, slope: float) -> None:
    pins = PinsConfig(diameter_m=4e-3, height_m=8e-3, friction=friction)
    D, t = 4.2e-3, 5e-4
    touch = (D * math.cos(slope) - t * math.sin(slope)) / 2 - geometry.tip_guides(pins, D, t, slope)
    # Analytic: the flank's inclination where it is touched, ρ/√(r² − ρ²), is the friction.
    assert touch / math.sqrt(4e-6 - touch**2) == pytest.approx(friction, rel=1e-9, abs=1e-9)


def test_a_cone_guides_all_or_nothing() -> None:
    D, t, slope = 4.2e-3, 5e-4, 0.1
    blunt = PinsConfig(diameter_m=4e-3, tip="taper", taper_length_m=0.7e-3, friction=0.6)
    sharp = PinsConfig(diameter_m=4e-3, tip="taper", taper_length_m=4e-3, friction=0.6)
    play = geometry.hole_play(D, 4e-3, t, slope)
    # Analytic: half the free play, and besides it how much thinner the end of the cone is.
    assert geometry.tip_guides(blunt, D, t, slope) == pytest.approx(play / 2, abs=1e-15)
    assert geometry.tip_guides(sharp, D, t, slope) == pytest.approx(play / 2 + 4e-3 / 3, abs=1e-15)
