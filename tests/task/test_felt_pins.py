"""Pins anywhere are felt: which one of two is missing, and a turn about the middle between them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dualbend.errors import InputError
from dualbend.planning.geometry import smallest_circle
from dualbend.run.outcome import TaskStopped
from dualbend.scenario.load import load_scenario
from dualbend.scene.bed.config import HoleConfig, HolesConfig
from dualbend.task.assembly.config import SearchConfig, assembly_of
from dualbend.task.assembly.program.motions import PHASES, Posture, turned
from dualbend.task.assembly.program.seats import CheckPair, CheckPlay
from dualbend.task.assembly.program.state import Pushed, State
from dualbend.types import Vector

NAMES = ("outer_1", "outer_2")
STILL: Vector = np.zeros(3)
ROW = 'holes.each=[{group="middle", along_m=0.0}, {group="outer", along_m=-0.14}, ' + (
    '{group="outer", along_m=0.12, across_m=0.01}]'
)


def pushed(places: Vector, forces_n: Vector, place: Vector = STILL) -> Pushed:
    """Return the wrench of forces (k, 2) at places (k, 2), about the middle between them."""
    arms = places - places.mean(axis=0)
    moment = np.sum(arms[:, 0] * forces_n[:, 1] - arms[:, 1] * forces_n[:, 0])
    return Pushed(place, np.array([*forces_n.sum(axis=0), moment]))


def turned_against(*pushes: Pushed) -> State:
    state = State(
        posture=Posture(y=0.0, z=0.0),
        period_s=0.028,
        begin=Posture(y=0, z=0),
        end=Posture(y=0, z=0),
    )
    state.row = PHASES.index("check seats")
    state.pushed.extend(pushes)
    return state


def check(places: Vector, *forces_n: Vector, turn: Vector = STILL, least_m: float = 0.0) -> None:
    """Ask of a sheet that stands turned one way, with the first forces, and the other."""
    pushes = (
        pushed(places, forces, way * turn) for way, forces in zip((1, -1), forces_n, strict=True)
    )
    CheckPair(names=NAMES, places=places, least=least_m).advance(turned_against(*pushes))


@given(
    angle=st.floats(-3.0, 3.0),
    half=st.floats(0.01, 0.15),
    centre=st.tuples(st.floats(-0.05, 0.05), st.floats(-0.02, 0.02)),
    force_n=st.floats(1.0, 10.0),
    along_n=st.floats(-0.2, 0.2),
)
def test_the_pin_that_is_missing_is_named_wherever_both_would_stand(
    angle: float, half: float, centre: tuple[float, float], force_n: float, along_n: float
) -> None:
    way = np.array([np.cos(angle), np.sin(angle)])
    across = np.array([-way[1], way[0]])
    places = np.array(centre) + np.outer([-half, half], way)
    couple = np.array([-force_n * across, force_n * across])
    # Pins on both sides, that stand off the middle of their play: the same force at both ends.
    off = np.array([0.3 * force_n * across, along_n * way])
    check(places, couple + off, -couple + off)
    for alone in (0, 1):
        one = np.zeros((2, 2))
        one[alone] = 2.0 * couple[alone] + along_n * way
        # Turned by 1 mrad either way about that pin, the other hole goes 2 mrad times 2 s in all.
        (x, y), travel = places[alone], 1e-3 * 4.0 * half
        turn = 1e-3 * np.array([y, -x, 1.0])
        with pytest.raises(TaskStopped, match=f"the outer {2 - alone} pin is not felt"):
            check(places, one, -one, turn=turn, least_m=0.999 * travel)
        # A hole that stays in its play has its pin.
        check(places, one, -one, turn=turn, least_m=1.001 * travel)


@pytest.mark.parametrize(
    ("turned_rad", "alone", "force_n", "around"),
    [
        (1.5e-3, False, 2.5, True),  # wedged fast
        (4.0e-3, False, 2.5, True),  # lightly: it climbs the tip, and bears the turn
        (1.5e-3, True, 2.5, True),  # without any play, whatever bears it
        (5.0e-3, True, 2.5, False),  # beside its pin: the other one's play
        (1.5e-3, False, 1.0, False),  # not held: it was turned no farther
    ],
)
def test_a_hole_around_a_tip_has_no_play_or_bears_its_share_of_the_turn(
    turned_rad: float, alone: bool, force_n: float, around: bool
) -> None:
    places = np.array([[-0.04, 0.0], [0.04, 0.0]])
    forces = np.zeros((2, 2))
    forces[:, 1] = np.array([-2.0, 0.0] if alone else [-1.0, 1.0]) * force_n
    state = turned_against(
        *(
            Pushed(np.array([0.0, 0.0, way * turned_rad / 2]), pushed(places, -way * forces).wrench)
            for way in (1.0, -1.0)
        )
    )
    # By hand: holes of 0.2 mm play, 0.04 m from the middle; held with 2 N there.
    step = CheckPlay(play=5e-3, force=2.0 * 0.08, places=places)
    if not around:
        assert step.advance(state) is False
        return
    with pytest.raises(TaskStopped, match="a middle hole is around the tip of its pin"):
        step.advance(state)


@given(st.floats(-0.02, 0.02), st.tuples(st.floats(-0.1, 0.1), st.floats(-0.02, 0.02)))
def test_a_sheet_that_is_turned_about_a_point_leaves_it_where_it_is(
    by_rad: float, centre: tuple[float, float]
) -> None:
    point = np.array(centre)
    found = turned(Posture(x=1e-3, y=-2e-3, z=0.7, yaw=0.0), by_rad, point)
    c, s = np.cos(by_rad), np.sin(by_rad)
    moved = np.array([found.x, found.y]) + np.array([[c, -s], [s, c]]) @ point
    # Analytic, to the second order of a small angle.
    np.testing.assert_allclose(
        moved, [1e-3 + point[0], -2e-3 + point[1]], atol=0.6 * by_rad**2 * 0.11
    )
    assert found.yaw == by_rad


def test_the_sheet_is_turned_through_the_play_of_its_middle_holes_and_by_any_turn_on_one() -> None:
    def turns(*middle: tuple[float, float]) -> list[float]:
        each = [HoleConfig(group="middle", along_m=s, across_m=y) for s, y in middle]
        each += [HoleConfig(group="outer", along_m=s) for s in (-0.15, 0.11)]
        return SearchConfig().turns(HolesConfig(each=tuple(each)))

    # Analytic: c/2 at 25 mm from the middle between both; 0.13/0.025 is 5 and a bit.
    room = 0.1e-3 / 0.025
    found = turns((-0.02, 0.015), (0.02, -0.015))
    np.testing.assert_allclose(found[:3], [0.0, room / 6, -room / 6])
    assert (len(found), max(found)) == (13, pytest.approx(room))
    assert turns((0.01, 0.0)) == [0.0, 0.01, -0.01]


def test_pins_are_named_by_their_list_and_those_of_another_number_are_refused() -> None:
    scenario = load_scenario("pwb", [f"task.layout.{ROW}", 'task.layout.pins.missing=["outer_2"]'])
    layout = assembly_of(scenario).layout
    assert layout.holes.names == ("middle_1", "outer_1", "outer_2")
    assert layout.standing.tolist() == [True, True, False]
    assert smallest_circle(layout.holes.places_of("outer")).centre_m.tolist() == pytest.approx(
        [-0.01, 0.005]
    )
    for setting, words in (
        ('pins.missing=["outer_left"]', "outer_left.* is no pin; they are middle_1, outer_1"),
        ("pins.thicker_m=[0, 0, 0, 0]", "pins.thicker_m has 4 entries: .* the 3 holes"),
        ("holes.errors_m=[[0, 0]]", "holes.errors_m has 1 entries: .* the 3 holes"),
    ):
        with pytest.raises(InputError, match=words):
            load_scenario("pwb", [f"task.layout.{ROW}", f"task.layout.{setting}"])


def test_a_list_takes_the_place_of_pairs_and_does_not_stand_beside_them() -> None:
    # Its own middle holes are 0.2 m apart.
    listed = assembly_of(load_scenario("pwb-impossible", [f"task.layout.{ROW}"])).layout.holes
    assert listed.places_of("middle").tolist() == [[0.0, 0.0]]
    with pytest.raises(InputError, match="middle: each lists all holes"):
        load_scenario("pwb", [f"task.layout.{ROW}", "task.layout.holes.middle.along_m=0.05"])
