"""Holes anywhere in the sheet: the play of those that go first, and what they are refused for."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize

from dualbend.errors import InputError
from dualbend.planning.geometry import hole_play, smallest_circle
from dualbend.planning.layout import Layout
from dualbend.planning.plan import plan_assembly, plan_summary
from dualbend.scene.bed.config import Group, HoleConfig, HolesConfig, PinsConfig
from support.sheets import STRIP

PINS = PinsConfig()
Places = tuple[tuple[float, float], ...]


def holes(middle: Places, outer: Places, clearance_m: float = 0.2e-3) -> HolesConfig:
    def each(group: Group, places: Places) -> list[HoleConfig]:
        return [HoleConfig(group=group, along_m=s, across_m=y) for s, y in places]

    return HolesConfig(
        each=(*each("middle", middle), *each("outer", outer)), clearance_m=clearance_m
    )


OUTER = ((-0.15, 0.01), (0.12, -0.01))


def test_two_mirrored_pairs_are_planned_alike_however_they_are_written() -> None:
    listed = holes(((-0.04, 0.0), (0.04, 0.0)), ((-0.14, 0.0), (0.14, 0.0)))
    found, short = (plan_assembly(STRIP, one, PINS) for one in (listed, HolesConfig()))
    # Exact: the same numbers.
    assert found.range == short.range
    assert plan_summary(found, 0.18) == plan_summary(short, 0.18)


@given(
    along=st.lists(st.floats(-0.09, 0.09), min_size=1, max_size=4),
    alpha=st.floats(0.02, 0.5),
    clearance_m=st.floats(0.05e-3, 1e-3),
)
def test_the_sheet_has_the_play_that_is_left_between_all_its_middle_pins(
    along: list[float], alpha: float, clearance_m: float
) -> None:
    """At each end of its play one hole touches its pin; a micrometre farther it does not fit."""
    layout = Layout(
        sheet=STRIP,
        holes=holes(tuple((s, 0.0) for s in along), OUTER, clearance_m),
        pins=PINS,
        weight=False,
    )
    shape = layout.hang(alpha)
    place, slack = layout.place_m(shape), layout.fit_slack_m(shape)

    def fits(u: float) -> bool:
        for s in along:
            pose = shape.at(abs(s))
            free = hole_play(layout.hole_m, PINS.diameter_m, STRIP.thickness_m, pose.slope_rad)
            if abs(math.copysign(pose.x_m, s) + u - s) > free / 2.0:
                return False
        return True

    # Analytic; half a micrometre to either side of each end.
    for end in (-1.0, 1.0):
        assert fits(place + end * (slack - 5e-7)) == (slack > 5e-7)
        assert not fits(place + end * (slack + 5e-7))


@given(
    st.lists(
        st.tuples(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1)), min_size=2, max_size=6, unique=True
    )
)
def test_a_plate_turns_by_its_clearance_over_the_radius_of_the_circle_round_its_holes(
    points: list[tuple[float, float]],
) -> None:
    """What the farthest hole of a turned plate is off its pin, the plate being moved as may be."""
    places = np.array(points)
    around = smallest_circle(places)

    def farthest(centre: np.ndarray) -> float:
        return float(np.hypot(*(places - centre).T).max())

    # Convex: what a search finds from several places is the least there is.
    starts = (places.mean(axis=0), *(0.5 * (p + q) for p, q in itertools.combinations(places, 2)))
    least = min(
        minimize(farthest, start, method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-12}).fun
        for start in starts[:4]
    )
    assert farthest(around.centre_m) == pytest.approx(around.radius_m, rel=1e-8, abs=1e-12)
    assert around.radius_m == pytest.approx(least, rel=1e-3, abs=1e-9)
    assert around.radius_m <= least + 1e-9


def test_unequal_middle_holes_that_bending_brings_too_close_are_refused_with_the_number() -> None:
    wide = holes(((-0.03, 0.0), (0.1, 0.0)), OUTER)
    alpha = 0.139  # where the nearer outer hole clears its pin by the margin
    shape = Layout(sheet=STRIP, holes=wide, pins=PINS).hang(alpha)
    closer = 1e3 * (0.13 - shape.at(0.03).x_m - shape.at(0.1).x_m)
    words = rf"holes\.each: .* {closer:.2f}\d mm closer .* mm missing; holes\.clearance_m >= "
    with pytest.raises(InputError, match=words) as refused:
        plan_assembly(STRIP, wide, PINS)
    wanted = float(str(refused.value).partition("clearance_m >= ")[2].split()[0])
    enough = holes(((-0.03, 0.0), (0.1, 0.0)), OUTER, wanted)
    plan_assembly(STRIP, enough, PINS)
    with pytest.raises(InputError, match="missing"):
        plan_assembly(STRIP, holes(((-0.03, 0.0), (0.1, 0.0)), OUTER, wanted - 2e-6), PINS)


def test_each_outer_hole_reaches_its_own_tip_and_the_nearest_first() -> None:
    both = plan_assembly(STRIP, holes(((-0.03, 0.0), (0.03, 0.0)), OUTER), PINS).range
    near, far = (
        plan_assembly(STRIP, holes(((-0.03, 0.0), (0.03, 0.0)), ((-s, 0.0), (s, 0.0))), PINS).range
        for s in (0.12, 0.15)
    )
    # Exact: the same condition of the same hole.
    assert both.reach_rad == near.reach_rad > far.reach_rad
    assert both.clear_rad == near.clear_rad


@pytest.mark.parametrize(
    ("middle", "outer", "words"),
    [
        ((), OUTER, 'no hole has group = "middle"'),
        (((-0.03, 0.0), (0.03, 0.0)), ((0.12, 0.0), (0.15, 0.0)), "on both sides"),
        (((-0.03, 0.0), (0.125, 0.0)), OUTER, "0.12 m .* a middle one 0.125 m"),
        (((0.03, 0.01), (0.03, 0.016)), OUTER, r"each\[0\] and holes\.each\[1\] are 0.006 m apart"),
        (((0.03, -0.027),), OUTER, r"each\[0\]\.across_m = -0.027 is off the sheet"),
    ],
)
def test_lists_that_are_no_layout_are_refused_by_key(
    middle: Places, outer: Places, words: str
) -> None:
    with pytest.raises(InputError, match=words):
        plan_assembly(STRIP, holes(middle, outer), PINS)


def test_middle_holes_hang_as_unevenly_as_they_are_far_from_the_middle() -> None:
    found = plan_assembly(STRIP, holes(((0.0, 0.0), (-0.05, 0.0)), OUTER), PINS)
    # Analytic: the height of the farther one, and none between two mirrored ones.
    assert found.uneven_m(0.18) == pytest.approx(found.shape(0.18).at(0.05).z_m, abs=1e-9)
    assert plan_assembly(STRIP, HolesConfig(), PINS).uneven_m(0.18) == 0.0
