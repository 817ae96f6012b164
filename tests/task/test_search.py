"""Where the middle holes are tried next, by what was felt at the places before."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dualbend.task.assembly.config import SearchConfig
from dualbend.task.assembly.program.motions import Pace
from dualbend.task.assembly.program.search import GoAside
from dualbend.task.assembly.program.state import Tried

CONFIG = SearchConfig()
TIP_M, FELT_M = 6e-3, 0.25e-3
ASIDE = GoAside(
    pace=Pace(linear_m_per_s=0.25, angular_rad_per_s=0.1, jaw_m_per_s=0.02, period_s=0.028),
    places=CONFIG.places(),
    turn=CONFIG.turn_rad,
    centre=np.zeros(2),
    felt=FELT_M,
    near=0.5 * CONFIG.step_m,
)


def tried(place: tuple[float, ...], height: float = TIP_M, moment: float = 0.0) -> Tried:
    return Tried(np.array(place), np.array(place), height, moment)


def test_on_level_tips_the_lattice_is_gone_through_in_its_order() -> None:
    found = [tried((0.0, 0.0, 0.0))]
    for place in CONFIG.places()[1:9]:
        assert ASIDE.next(found) == (*place, 0.0)  # analytic: the same numbers
        found.append(tried((*place, 0.0)))


@pytest.mark.parametrize("moment", [0.03, -0.03])
def test_where_a_flank_was_felt_the_sheet_is_turned_as_the_moment_points(moment: float) -> None:
    low = (-1.6e-3, -1.7e-3, 2e-3)
    found = [tried((0.0, 0.0, 0.0)), tried(low, TIP_M - 2.0 * FELT_M, moment)]
    way = math.copysign(CONFIG.turn_rad, moment)
    for n in (1, -1, 2, -2):
        # Analytic: a turn further each time, one way and the other.
        np.testing.assert_allclose(ASIDE.next(found), (*low[:2], low[2] + n * way), atol=1e-15)
        found.append(tried(ASIDE.next(found)))


def test_what_is_hardly_lower_is_noise_and_what_is_known_to_be_lower_later_is_gone_back_to() -> (
    None
):
    found = [tried((0.0, 0.0, 0.0), TIP_M - 0.5 * FELT_M), tried((1.2e-3, 0.0, 0.0))]
    assert ASIDE.next(found) == (*CONFIG.places()[2], 0.0)
    found.append(tried((-1.2e-3, 0.0, 0.0), TIP_M + FELT_M))
    assert ASIDE.next(found)[:2] == (0.0, 0.0)  # now 1.5 of what is felt lower than the highest


Heights = st.floats(TIP_M - 2e-3, TIP_M)


@given(st.lists(st.tuples(Heights, st.floats(-0.1, 0.1)), min_size=1, max_size=20))
def test_no_place_is_tried_twice(felt: list[tuple[float, float]]) -> None:
    """Whatever is felt where the sheet was sent."""
    found: list[Tried] = []
    place = (0.0, 0.0, 0.0)
    for height, moment in felt:
        for one in found:
            away = math.dist(place[:2], one.wanted[:2])
            turned = abs(place[2] - one.wanted[2])
            assert away >= 0.5 * CONFIG.step_m or turned >= 0.5 * CONFIG.turn_rad
        found.append(tried(place, height, moment))
        place = ASIDE.next(found)
