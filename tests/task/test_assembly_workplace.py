"""Workplaces that cannot be: what is refused, in which words, and that the remedy named is one."""

import dataclasses
import re
from collections.abc import Callable

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dualbend.errors import InputError
from dualbend.scene.bed.config import (
    BedConfig,
    HolePairConfig,
    HolesConfig,
    LayoutConfig,
    PinsConfig,
    StandConfig,
)
from dualbend.task.assembly.config import AssemblyConfig
from dualbend.task.assembly.workplace import JAW_ROOM_M, LIFT_ROOM_M, check_workplace
from support.sheets import STRIP

FINE = AssemblyConfig()
WIDE = dataclasses.replace(STRIP, width_m=0.2)
"""Wider than the bed, whose sides limit where the pins stand."""


def changed(key: str, value: float, base: AssemblyConfig = FINE) -> AssemblyConfig:
    """Return a workplace with one value, named by its dotted key, set."""

    def put(struct: msgspec.Struct, names: list[str]) -> msgspec.Struct:
        head, *rest = names
        inner = put(getattr(struct, head), rest) if rest else value
        return msgspec.structs.replace(struct, **{head: inner})

    config = put(base, key.split("."))
    assert isinstance(config, AssemblyConfig)
    return config


REFUSED = [
    # key, a value that is too large or small, the phrase that says why, the limit it names
    ("layout.bed.half_length_m", 0.19, "grippers", 0.2 - JAW_ROOM_M),
    ("layout.stand.half_length_m", 0.2, "grippers", 0.2 - JAW_ROOM_M),
    ("layout.holes.middle.along_m", 0.165, "stand on the bed", 0.165 - 0.5 * 4.76e-3),
    ("layout.holes.outer.along_m", 0.164, "stand on the bed", 0.165 - 0.5 * 4.76e-3),
    ("layout.holes.middle.across_m", 0.049, "stand on the bed", 0.05 - 0.5 * 4.76e-3),
    ("layout.holes.outer.across_m", -0.06, "stand on the bed", 0.05 - 0.5 * 4.76e-3),
    ("layout.stand.y_m", 0.0, "stands in the bed", 0.1),
    ("layout.stand.y_m", -0.09, "stands in the bed", 0.1),
    ("sheets", 13, "higher than its pins", 12),
    ("lift_m", 0.010, "carried into the pins", 6e-3 + LIFT_ROOM_M),
]


def test_the_default_workplace_is_accepted() -> None:
    check_workplace(FINE, STRIP)


@pytest.mark.parametrize(("key", "value", "why", "limit"), REFUSED)
def test_a_refusal_names_key_value_reason_and_limit(
    key: str, value: float, why: str, limit: float
) -> None:
    with pytest.raises(InputError) as error:
        check_workplace(changed(key, value), WIDE)
    message = str(error.value)
    assert message.startswith(f"task.{key} = {value:g}: ")
    assert why in message
    named = re.search(r"at (?:most|least) ([0-9.e-]+)", message)
    assert named is not None
    # Analytic: sums of lengths, written in six digits.
    assert float(named.group(1)) == pytest.approx(limit, rel=1e-5)


@pytest.mark.parametrize(("key", "value", "why", "limit"), REFUSED)
def test_the_limit_itself_is_accepted_and_a_little_beyond_is_not(
    key: str, value: float, why: str, limit: float
) -> None:
    sign = -1.0 if value < 0 else 1.0
    kind: Callable[[float], float] = int if key == "sheets" else float
    check_workplace(changed(key, kind(sign * limit)), WIDE)
    beyond = limit + (1 if key == "sheets" else 1e-6) * (1.0 if abs(value) > limit else -1.0)
    with pytest.raises(InputError, match=why):
        check_workplace(changed(key, kind(sign * beyond)), WIDE)


def test_a_pin_too_thick_for_its_round_tip_is_refused() -> None:
    short = PinsConfig(diameter_m=0.01, height_m=5.5e-3, thicker_m=(0.0, 0.0, 1.1e-3, 0.0))
    layout = msgspec.structs.replace(FINE.layout, pins=short)
    with pytest.raises(InputError, match=r"pins\.thicker_m = .*; at most 0\.001$"):
        check_workplace(msgspec.structs.replace(FINE, layout=layout), STRIP)


def test_a_hole_beside_the_sheet_is_refused() -> None:
    # Half the sheet's width less the hole's radius.
    most = 0.5 * 0.057 - 0.5 * (4.76e-3 + 0.2e-3)
    check_workplace(changed("layout.holes.outer.across_m", most), STRIP)
    with pytest.raises(InputError, match=r"outer\.across_m = .* in the sheet; at most 0.026"):
        check_workplace(changed("layout.holes.outer.across_m", most + 1e-6), STRIP)
    off = msgspec.structs.replace(
        FINE.layout.holes, errors_m=((0.0, 0.0), (0.0, 0.0), (0.0, 0.0), (0.0, -0.03))
    )
    with pytest.raises(InputError, match=r"errors_m = .*: the outer_right hole would not be in"):
        check_workplace(
            msgspec.structs.replace(FINE, layout=msgspec.structs.replace(FINE.layout, holes=off)),
            STRIP,
        )


@given(
    st.floats(0.05, 1.0),
    st.floats(0.01, 0.2),
    st.floats(0.01, 0.2),
    st.floats(2e-3, 0.05),
    st.floats(1e-3, 0.015),
    st.floats(1e-4, 2e-3),
    st.integers(1, 10),
)
def test_following_the_advice_ends_in_a_workplace_that_is_accepted(
    length: float,
    bed_width: float,
    stand_width: float,
    height: float,
    diameter: float,
    thickness: float,
    sheets: int,
) -> None:
    """Set what is named to what is named, again and again: nothing is refused for ever."""
    sheet = dataclasses.replace(STRIP, length_m=length + 0.1, width_m=0.1, thickness_m=thickness)
    layout = LayoutConfig(
        holes=HolesConfig(
            middle=HolePairConfig(along_m=0.04, across_m=0.3),
            outer=HolePairConfig(along_m=0.9 * length, across_m=-0.3),
        ),
        pins=PinsConfig(height_m=height, diameter_m=diameter),
        bed=BedConfig(half_length_m=length, half_width_m=bed_width),
        stand=StandConfig(y_m=-0.01, half_length_m=length, half_width_m=stand_width),
    )
    config = AssemblyConfig(layout=layout, sheets=sheets, lift_m=1e-3)
    for _ in range(12):
        try:
            check_workplace(config, sheet)
            return
        except InputError as error:
            found = re.match(
                r"task\.([\w.]+) = (\S+): .*; at (?:most|least) ([0-9.e-]+)", str(error)
            )
            assert found is not None, str(error)
            key, value, limit = found.groups()
            # Written in six digits; a user gives the next rounder number.
            least = "at least" in str(error)
            better = float(limit) * (1 + 1e-5 if least else 1 - 1e-5)
            if key == "sheets":
                better = int(limit)
            elif value.startswith("-"):
                better = -better
            config = changed(key, better, config)
    raise AssertionError("still refused")


def test_all_that_is_wrong_is_found_one_after_the_other() -> None:
    """Of two mistakes the first is named; mending it brings up the second."""
    bad = msgspec.structs.replace(FINE, lift_m=1e-3, sheets=10)
    bad = msgspec.structs.replace(
        bad,
        layout=msgspec.structs.replace(bad.layout, pins=PinsConfig(height_m=4e-3)),
    )
    with pytest.raises(InputError, match="at most 8 sheets"):
        check_workplace(bad, STRIP)
    with pytest.raises(InputError, match="lift_m"):
        check_workplace(msgspec.structs.replace(bad, sheets=8), STRIP)
