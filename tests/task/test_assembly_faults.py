"""Whole assemblies whose pins are not as drawn: what a cell must notice, and with which words."""

import pytest

from dualbend.evaluation.metrics import peak
from dualbend.run.make import make_run
from dualbend.scenario.load import load_scenario
from dualbend.scene.bed.config import HOLES
from dualbend.study.ending import result_of
from dualbend.task.assembly.config import assembly_of
from dualbend.task.assembly.metrics import peaks, seated, wrong_checks

pytestmark = pytest.mark.slow


UNEQUAL = (
    'task.layout.holes.each=[{group="middle", along_m=-0.03}, '
    '{group="middle", along_m=0.05, across_m=0.01}, '
    '{group="outer", along_m=-0.15, across_m=-0.015}, {group="outer", along_m=0.12}]'
)
"""Nothing is mirrored, and two holes are off the centre line."""


def reason(setting: str, seed: int, *others: str) -> str:
    """Return why the run was stopped, in which no force was above its limit."""
    run = result_of(make_run(load_scenario("pwb", (*others, setting), seed)))
    limits, largest = assembly_of(run.scenario).limits, peaks(run)
    assert run.outcome == "aborted"
    assert wrong_checks(run) == 0
    for name, limit in (
        ("peak_pin_force", limits.pin_force_n),
        ("peak_edge_force", limits.edge_force_n),
    ):
        assert (peak(largest[name]) or 0.0) < limit
    return run.reason


@pytest.mark.parametrize("seed", range(len(HOLES)))
def test_a_missing_pin_is_named(seed: int) -> None:
    pair, side = HOLES[seed].split("_")
    said = reason(f'task.layout.pins.missing=["{HOLES[seed]}"]', seed + 1)
    # By design: its own name, where one pin holds the sheet; not where it does not so soon.
    assert f"the {pair} {side} pin is not felt" in said or "not all holes are on their pins" in said


def test_a_hole_on_a_pin_that_is_too_thick_is_noticed_before_it_is_wedged() -> None:
    said = reason("task.layout.pins.thicker_m=[0.0, 0.3e-3, 0.0, 0.0]", 1)
    assert "the hole is too small, or the pin too thick" in said


def test_a_sheet_with_holes_anywhere_is_laid_from_a_millimetre_off() -> None:
    off = [f"task.errors.pickup_{axis}_m=0.001" for axis in "xy"]
    run = result_of(make_run(load_scenario("pwb", (UNEQUAL, *off), 1)))
    assert (run.outcome, run.reason) == ("completed", "")
    assert seated(run).tolist() == [[True] * 4]


def test_a_missing_middle_pin_is_named_where_nothing_is_mirrored() -> None:
    said = reason('task.layout.pins.missing=["middle_2"]', 1, UNEQUAL)
    assert "the middle 2 pin is not felt" in said
