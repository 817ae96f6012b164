"""The plan: its range against a quadrature of its own, its refusals, the path and the descent."""

import dataclasses
import math
import re

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import fsolve
from scipy.special import ellipk

from dualbend.beam import elastica
from dualbend.beam._check import FloatArray
from dualbend.errors import InputError
from dualbend.planning import shape as planning_shape
from dualbend.planning.layout import Layout
from dualbend.planning.plan import AssemblyPlan, plan_assembly, plan_summary
from dualbend.scene.bed.config import HolePairConfig, HolesConfig, PinsConfig
from support.sheets import STRIP

L, EI, T = STRIP.length_m, STRIP.bending_stiffness_nm2, STRIP.thickness_m
Q = STRIP.weight_per_length_n_per_m
HOLES, PINS = HolesConfig(), PinsConfig(height_m=8e-3)


def holes(middle: float, outer: float, clearance: float = 2e-4) -> HolesConfig:
    return HolesConfig(
        middle=HolePairConfig(along_m=middle),
        outer=HolePairConfig(along_m=outer),
        clearance_m=clearance,
    )


def march(rate0: FloatArray, P: FloatArray, q: float, stops: tuple[float, ...]) -> list[FloatArray]:
    """Integrate EI ψ'' = −P sin ψ − q s cos ψ, x' = cos ψ, z' = sin ψ from the middle (RK4).

    Returns rows x, z, ψ at each stop, a column per (rate0, P).
    """

    def slope(s: float, y: FloatArray) -> FloatArray:
        bend = -(P * np.sin(y[2]) + q * s * np.cos(y[2])) / EI
        return np.stack([np.cos(y[2]), np.sin(y[2]), y[3], bend])

    y, s, found = np.stack([0 * rate0, 0 * rate0, 0 * rate0, rate0]), 0.0, []
    for stop in stops:
        h = (stop - s) / 60
        for _ in range(60 if h > 0 else 0):
            a = slope(s, y)
            b = slope(s + h / 2, y + h / 2 * a)
            c = slope(s + h / 2, y + h / 2 * b)
            d = slope(s + h, y + h * c)
            y, s = y + h / 6 * (a + 2 * b + 2 * c + d), s + h
        found.append(y[:3])
    return found


def free_shapes(alphas: FloatArray, *along: float) -> list[FloatArray]:
    """Return the poses of holes at end slopes, without weight: P and κ of the pendulum."""
    k = np.sin(alphas / 2)
    rate = 2 * ellipk(k * k) / L
    return march(2 * k * rate, rate**2 * EI, 0.0, along)


def heavy_shape(alpha: float, *along: float) -> list[FloatArray]:
    """Return the poses of holes with weight, by shooting for P and κ in the middle."""
    k = math.sin(alpha / 2)
    rate = 2 * float(ellipk(k * k)) / L
    half = elastica.half_distance(alpha, L)

    def miss(unknown: FloatArray) -> list[float]:
        y = march(unknown[:1] * rate, unknown[1:] * rate**2 * EI, Q, (L / 2,))[0]
        return [float(y[2, 0]) - alpha, (float(y[0, 0]) - half) / (L * alpha)]

    found = fsolve(miss, [2 * k, 0.7], xtol=1e-12)
    assert np.allclose(miss(found), 0.0, atol=1e-10)
    return march(found[:1] * rate, found[1:] * rate**2 * EI, Q, along)


def slacks(layout: Layout, middle: FloatArray, outer: FloatArray) -> dict[str, FloatArray]:
    """Return what is left of each inequality [m], written out from the poses of the holes."""
    d, h = layout.pins.diameter_m, layout.pins.height_m
    D = d + layout.holes.clearance_m
    s0, s1 = layout.holes.middle.along_m, layout.holes.outer.along_m
    r, mu, tip = d / 2, layout.pins.friction, layout.pins.tip
    open0, open1 = (D * np.cos(p[2]) - T * np.sin(p[2]) for p in (middle, outer))
    if tip == "round":
        lost = r * mu / math.hypot(1, mu)
    else:
        lost = r if layout.pins.taper_length_m / (2 * r / 3) < mu else r / 3
    return {
        "lift": outer[1] + T / 2 * (1 - np.cos(outer[2])) - D / 2 * np.sin(outer[2]) - h,
        "fit": (open0 - d) / 2 - (s0 - middle[0]),
        "seat": h - T / 2 - middle[1],
        "guide": open1 / 2 - lost - (s1 - outer[0]),
    }


def badly_laid_out(layout: Layout) -> bool:
    """Say whether holes or pins are where none can be (all on the centre line here)."""
    D = layout.pins.diameter_m + layout.holes.clearance_m
    s0, s1 = layout.holes.middle.along_m, layout.holes.outer.along_m
    tip = layout.pins.taper_length_m if layout.pins.tip == "taper" else layout.pins.diameter_m / 2
    return s1 - s0 < 1.5 * D or 2 * s0 < 1.5 * D or s1 > L / 2 - D or tip > layout.pins.height_m


layouts = st.builds(
    lambda s0, gap, c, d, h, tip, taper, margin: Layout(
        sheet=STRIP,
        holes=holes(s0, s0 + gap, c),
        pins=PinsConfig(diameter_m=d, height_m=h, tip=tip, taper_length_m=taper),
        margin_m=margin,
        weight=False,
    ),
    s0=st.floats(5e-3, 0.12),
    gap=st.floats(5e-3, 0.15),
    c=st.floats(2e-5, 1e-3),
    d=st.floats(2e-3, 6e-3),
    h=st.floats(2e-3, 0.02),
    tip=st.sampled_from(["round", "taper"]),
    taper=st.floats(1e-3, 0.01),
    margin=st.floats(0.0, 2e-3),
)


def plan(layout: Layout) -> AssemblyPlan:
    return plan_assembly(
        layout.sheet,
        layout.holes,
        layout.pins,
        margin_m=layout.margin_m,
        weight=layout.weight,
        yield_strain=layout.yield_strain,
    )


def changed(layout: Layout, key: str, value: float) -> Layout:
    part, *inner, name = key.split(".")
    struct = getattr(layout, part)
    if inner:
        nested = msgspec.structs.replace(getattr(struct, inner[0]), **{name: value})
        name, value = inner[0], nested
    return dataclasses.replace(layout, **{part: msgspec.structs.replace(struct, **{name: value})})


REMEDY = re.compile(r"((?:holes|pins)\.[a-z_.]+) (<=|>=) ([0-9.e-]+)")


@given(layout=layouts)
@settings(max_examples=60)
def test_accepted_layouts_satisfy_all_inequalities_and_refused_ones_break_one(
    layout: Layout,
) -> None:
    along = layout.holes.middle.along_m, layout.holes.outer.along_m
    # Discretisation-limited: RK4 with 60 steps a span and Hermite pieces, 1e-8 m together.
    grain = 1e-8
    try:
        found = plan(layout).range
    except InputError as refusal:
        for key, _, value in REMEDY.findall(str(refusal).partition("missing")[2]):
            plan(changed(layout, key, float(value)))
        if badly_laid_out(layout):
            return
        alphas = np.linspace(planning_shape.LOWEST_RAD, math.pi / 2, 300)
        left = slacks(layout, *free_shapes(alphas, *along))
        in_range = np.minimum(left["lift"] - layout.margin_m, np.minimum(left["fit"], left["seat"]))
        over = np.flatnonzero(left["lift"] >= 0.0)
        # Either no angle of the grid has room, or the tips do not guide from where they reach.
        assert np.max(in_range) <= grain or left["guide"][over[0]] <= grain
        return
    assert not badly_laid_out(layout)
    reach, low, high = found.reach_rad, found.clear_rad, found.highest_rad
    alphas = np.array([reach, *np.linspace(low, high, 9), 0.99 * low, min(1.01 * high, 1.57)])
    left = slacks(layout, *free_shapes(alphas, *along))
    inside = slice(1, 10)
    assert np.min(left["lift"][inside]) >= layout.margin_m - grain
    assert np.min(left["fit"][inside]) >= -grain
    assert np.min(left["seat"][inside]) >= -grain
    assert left["guide"][0] >= -grain
    # The range is the largest one: both its ends are where an inequality turns.
    if low > planning_shape.LOWEST_RAD:
        assert left["lift"][-2] < layout.margin_m
    if found.limit == "middle pair":
        assert left["fit"][-1] < 0.0
    if found.limit == "pin height":
        assert left["seat"][-1] < 0.0


@given(
    s0=st.floats(0.01, 0.06),
    s1=st.floats(0.11, 0.18),
    clearance=st.floats(1e-4, 4e-4),
    height=st.floats(3e-3, 0.012),
)
@settings(max_examples=8)
def test_with_weight_the_ends_of_the_range_are_those_of_a_shooting_solution(
    s0: float, s1: float, clearance: float, height: float
) -> None:
    layout = Layout(sheet=STRIP, holes=holes(s0, s1, clearance), pins=PinsConfig(height_m=height))
    try:
        found = plan(layout).range
    except InputError as refusal:
        assert "mm missing" in str(refusal)
        return
    low = slacks(layout, *heavy_shape(found.clear_rad, s0, s1))
    high = slacks(layout, *heavy_shape(found.fit_rad, s0, s1))
    # Discretisation-limited: the table of shapes, 0.1 µm.
    assert low["lift"] == pytest.approx(layout.margin_m, abs=2e-7)
    assert low["fit"] >= -2e-7
    if found.fit_rad < math.pi / 2:
        assert high["fit"] == pytest.approx(0.0, abs=2e-7)


@pytest.mark.parametrize("weight", [False, True])
def test_slacks_are_monotone_in_the_bending_angle(weight: bool) -> None:
    layout = Layout(sheet=STRIP, holes=HOLES, pins=PINS, weight=weight)
    states = [layout.hang(float(a)) for a in np.linspace(0.006, math.pi / 2, 80)]
    # Analytic: every slope of the half grows with α up to upright ends.
    assert np.all(np.diff([layout.lift_m(state) for state in states]) > 0.0)
    for slack in (layout.fit_slack_m, layout.seat_slack_m, layout.guide_slack_m):
        assert np.all(np.diff([slack(state) for state in states]) < 0.0)


def test_default_layout_has_a_wide_range_and_half_the_clearance_a_narrower_one() -> None:
    wide, tight = (
        plan_assembly(STRIP, HOLES, PINS),
        plan_assembly(STRIP, holes(0.04, 0.14, 1e-4), PINS),
    )
    # Golden: the shipped numbers, 0.2 mm and 0.1 mm clearance.
    assert (wide.range.clear_rad, wide.range.fit_rad) == pytest.approx((0.1342, 0.3151), abs=2e-4)
    assert (tight.range.clear_rad, tight.range.fit_rad) == pytest.approx((0.1341, 0.2112), abs=2e-4)
    assert wide.range.limit == tight.range.limit == "middle pair"
    assert wide.middle_slack_m(wide.bend_rad) == pytest.approx(62e-6, abs=1e-6)
    assert tight.middle_slack_m(tight.bend_rad) == pytest.approx(20e-6, abs=1e-6)


def test_plan_is_consistent_in_itself() -> None:
    found = plan_assembly(STRIP, HOLES, PINS)
    low, high = found.range.clear_rad, found.range.highest_rad
    # Analytic: by construction, to the root's tolerance.
    assert found.bend_rad == pytest.approx(low + 0.25 * (high - low), rel=1e-12)
    assert found.outer_lift_m(low) == pytest.approx(1e-3, abs=1e-9)
    assert found.outer_lift_m(found.range.reach_rad) == pytest.approx(0.0, abs=1e-9)
    assert found.middle_slack_m(high) == pytest.approx(0.0, abs=1e-9)
    # Analytic: flat, the middle holes are as far apart as their pins, and closer ever after.
    assert found.spacing_m(0.0) == pytest.approx(0.08, abs=1e-12)
    assert np.all(np.diff([found.spacing_m(a) for a in np.linspace(0.0, high, 20)]) < 0.0)


def test_path_of_the_grips_keeps_the_middle_and_carries_the_loads_of_the_reference() -> None:
    found = plan_assembly(STRIP, HOLES, PINS)
    alphas = np.linspace(0.0, found.range.highest_rad, 49)
    assert found.grip(0.0) == pytest.approx((L / 2, 0.0), abs=1e-12)
    x, z = found.grip(alphas)
    # Analytic: half distance of the closed form; discretisation-limited: the table, 0.1 µm.
    np.testing.assert_allclose(x, elastica.half_distance(alphas, L), atol=1e-15)
    for i in (9, 24, 48):
        alpha = float(alphas[i])
        reference, told = planning_shape.hang(STRIP, alpha), plan_summary(found, alpha)
        assert z[i] == pytest.approx(reference.rise_m, abs=1e-7)
        assert told["end_force"][0] == pytest.approx(reference.end_force_n, abs=1e-4)
        assert told["end_moment"][0] == pytest.approx(reference.end_moment_nm, abs=1e-7)
    taut = planning_shape.hang(STRIP, found.taut_rad)
    assert taut.end_force_n == pytest.approx(0.0, abs=1e-4)
    with pytest.raises(InputError, match="bending angle"):
        found.grip(found.range.highest_rad + 0.01)


def overlap(found: AssemblyPlan, alpha: float) -> float:
    """Return how far a round outer pin reaches beyond the outer wall of its hole [m]."""
    layout, pins, s = found.layout, found.layout.pins, found.layout.holes.outer.along_m
    pose, r = found.shape(alpha).at(s), pins.diameter_m / 2
    sine, cosine = math.sin(pose.slope_rad), math.cos(pose.slope_rad)
    normal = np.linspace(-T / 2, T / 2, 9)
    wall = pose.x_m + layout.hole_m / 2 * cosine - normal * sine
    below = pins.height_m - (T / 2 + pose.z_m + layout.hole_m / 2 * sine + normal * cosine)
    tip = np.sqrt(np.clip(r * r - np.maximum(r - below, 0.0) ** 2, 0.0, None))
    return float(np.max(np.where(below >= 0.0, s + tip - wall, -math.inf)))


def test_outer_holes_come_down_within_reach_of_the_tips() -> None:
    found = plan_assembly(STRIP, HOLES, PINS)
    told, reach = plan_summary(found, found.bend_rad), found.range.reach_rad
    offset, guide = told["outer_offset_there"][0], told["tip_guides_up_to"][0]
    alphas = np.linspace(0.0, reach, 1001)
    pressed = [overlap(found, float(a)) for a in alphas]
    worst = int(np.argmax(pressed))
    assert 0.0 < alphas[worst] < reach < found.range.clear_rad
    assert 0.0 < pressed[worst] < offset < guide
    # Golden: 0.313 mm off at the tips, of which the compliance has to take 0.037 mm.
    assert (offset, pressed[worst]) == pytest.approx((0.313e-3, 0.037e-3), abs=1e-6)


def test_a_grip_moves_further_than_its_outer_hole_as_the_sheet_flattens() -> None:
    low, high = (planning_shape.hang(STRIP, alpha, weight=False) for alpha in (0.05, 0.06))
    ratio = (high.half_distance_m - low.half_distance_m) / (high.at(0.14).x_m - low.at(0.14).x_m)
    # Analytic limit of small slopes: (L/2 − x) / (s₁ − X) = (L/2) / (s₁ − (L/2π) sin 2πs₁/L).
    small = (L / 2) / (0.14 - L / (2 * math.pi) * math.sin(2 * math.pi * 0.14 / L))
    assert ratio == pytest.approx(small, rel=2e-3)


def test_yield_and_grippers_end_the_range() -> None:
    slender = holes(0.02, 0.14)
    strained = plan_assembly(STRIP, slender, PINS, yield_strain=1e-3)
    assert strained.range.limit == "yield"
    # Analytic: the strain at the end of the range is the one given.
    assert strained.shape(strained.range.highest_rad).strain == pytest.approx(1e-3, rel=1e-4)
    met = plan_assembly(STRIP, slender, PINS, min_half_distance_m=0.19)
    assert met.range.limit == "grippers"
    assert elastica.half_distance(met.range.highest_rad, L) == pytest.approx(0.19, abs=1e-9)


def test_a_plan_solves_for_no_more_shapes_than_its_table(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []
    solve = planning_shape._by_reference
    monkeypatch.setattr(
        planning_shape, "_by_reference", lambda *given: (calls.append(given), solve(*given))[1]
    )
    other = dataclasses.replace(STRIP, thickness_m=0.00051)
    for clearance in (2e-4, 1e-4):
        plan_assembly(other, holes(0.04, 0.14, clearance), PINS)
    # Analytic: a count, not a stop-watch; the second plan of a sheet solves for none.
    assert len(calls) == planning_shape.NODES


@pytest.mark.parametrize(
    ("middle", "outer", "clearance", "height"),
    [
        (0.08, 0.14, 2e-4, 8e-3),
        (0.06, 0.14, 1e-4, 8e-3),
        (0.04, 0.1, 5e-5, 8e-3),
        (0.04, 0.14, 2e-4, 0.02),
        (0.05, 0.07, 3e-4, 6e-3),
        (0.1, 0.12, 5e-4, 8e-3),
        (0.13, 0.14, 1.6e-3, 2.5e-3),
    ],
)
def test_what_a_refusal_proposes_does_and_a_little_less_does_not(
    middle: float, outer: float, clearance: float, height: float
) -> None:
    layout = Layout(
        sheet=STRIP, holes=holes(middle, outer, clearance), pins=PinsConfig(height_m=height)
    )
    with pytest.raises(InputError, match="missing") as refusal:
        plan(layout)
    proposals = REMEDY.findall(str(refusal.value))
    assert proposals
    for key, relation, text in proposals:
        value = float(text)
        plan(changed(layout, key, value))
        step = 2e-6 if key.endswith("clearance_m") else 2e-5
        worse = value + step if relation == "<=" else value - step
        # Discretisation-limited: the proposals are rounded to 10 µm, the clearance to 1 µm.
        with pytest.raises(InputError, match="missing"):
            plan(changed(layout, key, worse))


def test_a_refusal_says_what_is_missing() -> None:
    with pytest.raises(InputError) as refusal:
        plan_assembly(STRIP, holes(0.08, 0.14), PINS)
    # Golden: 2 (s₀ − X) against the play, both by the shooting solution too.
    assert str(refusal.value) == (
        "holes.middle.along_m = 0.08: the middle holes come 0.174 mm closer at 0.134 rad, where "
        "the outer holes clear their pins by 1.00 mm, but have 0.145 mm of room: 0.028 mm missing; "
        "holes.middle.along_m <= 0.07577 or holes.clearance_m >= 0.000229 or "
        "holes.outer.along_m >= 0.14561 or pins.height_m <= 0.00737 would do"
    )


@pytest.mark.parametrize(
    ("given_holes", "pins", "words"),
    [
        (holes(0.14, 0.14), PINS, "holes.outer.along_m = 0.14 must be above"),
        (holes(0.04, 0.197), PINS, r"holes.outer.along_m = 0.197 .* not exceed 0.19504"),
        (holes(0.04, 0.046), PINS, "holes.middle and holes.outer are 0.006 m apart: it must be"),
        (holes(0.04, 0.044), PINS, "their pins overlap"),
        (holes(0.002, 0.14), PINS, "the two of holes.middle are 0.004 m apart"),
        (HOLES, PinsConfig(tip="taper", taper_length_m=9e-3), "taper_length_m = 0.009 is longer"),
        (HOLES, PinsConfig(diameter_m=6e-3, height_m=2e-3), "height_m = 0.002 is too short"),
        (
            HolesConfig(middle=HolePairConfig(along_m=0.04, across_m=-0.025)),
            PINS,
            r"holes.middle.across_m = -0.025 .* not exceed 0.02354",
        ),
        (HOLES, PinsConfig(height_m=0.05, friction=2.0), "guides|missing"),
    ],
)
def test_impossible_layouts_are_refused_by_key_and_value(
    given_holes: HolesConfig, pins: PinsConfig, words: str
) -> None:
    with pytest.raises(InputError, match=words):
        plan_assembly(STRIP, given_holes, pins)


def test_a_tip_that_does_not_guide_is_refused() -> None:
    blunt = PinsConfig(height_m=8e-3, tip="taper", taper_length_m=1e-3, friction=2.0)
    with pytest.raises(InputError, match=r"0\.31 mm off .* taper tip guides .* missing"):
        plan_assembly(STRIP, HOLES, blunt)


def test_a_pair_in_the_middle_fits_at_every_angle() -> None:
    across = HolesConfig(middle=HolePairConfig(along_m=0.0, across_m=0.01))
    found = plan_assembly(STRIP, across, PINS)
    # Analytic: no slope and no approach in the middle.
    assert found.range.limit == "upright ends"
    assert found.spacing_m(1.0) == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize(
    "wrong", [{"margin_m": -1e-3}, {"share": 1.5}, {"min_half_distance_m": 0.3}]
)
def test_options_that_are_no_numbers_of_their_kind_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(InputError, match=next(iter(wrong))):
        plan_assembly(STRIP, HOLES, PINS, **wrong)
