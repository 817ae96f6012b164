"""Rows of properties: a sheet or an arm with another property than the written one is seen."""

from collections.abc import Iterator

import pytest

from dualbend.arm.catalog import ArmName
from dualbend.arm.model import arm_model
from dualbend.beam.sheet import Sheet
from dualbend.validation import handbook
from dualbend.validation.cases import modes, properties
from dualbend.validation.cases import sheet as vs
from dualbend.validation.cases.cell import weight_rows
from dualbend.validation.row import Row


def failed(rows: Iterator[Row]) -> list[str]:
    return [row.name for row in rows if not row.passed]


def doubled(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    once = getattr(Sheet, name).fget
    monkeypatch.setattr(Sheet, name, property(lambda sheet: 2.0 * once(sheet)))


def test_the_shipped_strip_and_materials_are_those_of_the_handbooks() -> None:
    rows = [*properties.strip_rows(), *properties.material_rows()]
    assert len(rows) == 6 + 3 * 3
    assert failed(iter(rows)) == []
    assert {row.checks for row in rows} == {"property"}
    # Analytic: pushed, bent and twisted, the chain is exact; by hand there are six digits.
    assert [row.error < 1e-5 for row in rows[:4]] == [True] * 4


@pytest.mark.parametrize(
    ("name", "seen"),
    [
        ("bending_stiffness_nm2", ["EI of the strip", "end force", "first frequency"]),
        ("torsional_stiffness_nm2", ["GJ of the strip"]),
        ("axial_stiffness_n", ["pull that stretches the rod"]),
        ("mass_kg", ["mass of the strip", "first frequency"]),
    ],
)
def test_twice_a_property_is_seen_by_the_rows_that_rest_on_it(
    monkeypatch: pytest.MonkeyPatch, name: str, seen: list[str]
) -> None:
    doubled(monkeypatch, name)
    found = failed(properties.strip_rows())
    assert [any(row.startswith(start) for start in seen) for row in found] == [True] * len(seen)


def test_twice_the_weight_is_seen_by_the_grippers_that_carry_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    doubled(monkeypatch, "mass_kg")
    assert len(failed(weight_rows((0.0,)))) == 2


def test_twice_the_stiffness_is_not_seen_where_both_sides_read_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    doubled(monkeypatch, "bending_stiffness_nm2")
    rows = [*vs.load_rows(points=2), *modes.frequency_rows()]
    # That is what "mechanics" says of these rows, and why there are the others.
    assert {row.checks for row in rows} == {"mechanics"}
    assert failed(iter(rows)) == []


@pytest.mark.slow
def test_the_pulled_shell_stretches_as_its_material_says() -> None:
    (row,) = properties.shell_rows()
    # Discretisation and clamps: stiffer than the strip alone, by less than 2 %.
    assert row.passed
    assert row.measured > row.reference


@pytest.mark.parametrize("name", sorted(handbook.ARMS))
def test_an_arm_is_the_published_one(name: ArmName) -> None:
    rows = list(properties.arm_rows(arm_model(name)))
    assert len(rows) == (4 if handbook.ARMS[name].links_kg else 3)
    assert failed(iter(rows)) == []


@pytest.mark.parametrize(("name", "other"), [("ur5", "ur10"), ("panda", "xarm7")])
def test_another_arm_is_seen_in_its_size_weight_and_ranges(
    name: ArmName, other: ArmName, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(handbook.ARMS, name, handbook.ARMS[other])
    # All of it, but for the ranges that all Universal Robots share.
    assert len(failed(properties.arm_rows(arm_model(name)))) == 3


def test_of_an_arm_of_which_nothing_was_found_nothing_is_said() -> None:
    assert "z1" not in handbook.ARMS
    assert list(properties.arm_rows(arm_model("z1"))) == []
