"""The shell's validation: the theory it is held against, and the rows that are cheap."""

from dataclasses import replace

import pytest

from dualbend.validation.cases import shell as validation_shell
from dualbend.validation.cases.sheet import default_sheet
from dualbend.validation.cases.shell import ashwell, restrained_twist

SHEET, _ = default_sheet()


def test_ashwells_strip_is_a_beam_when_narrow_and_a_plate_when_wide() -> None:
    plate = 1.0 / (1.0 - SHEET.poisson_ratio**2)
    narrow, wide = replace(SHEET, width_m=0.005), replace(SHEET, width_m=2.0)
    # Analytic limits; the wide one is off by its two edge zones, some 2 cm of 2 m.
    assert ashwell(narrow, 1.0)[1] == pytest.approx(1.0, abs=1e-4)
    assert ashwell(wide, 0.4)[1] == pytest.approx(plate, abs=2e-3)
    # Analytic: the whole width curls with ν κ, w²/8 of it in the middle of the arc.
    curl = SHEET.poisson_ratio * narrow.width_m**2 / 8.0
    assert ashwell(narrow, 1.0)[0] == pytest.approx(curl, rel=1e-3)


def test_restrained_warping_vanishes_for_a_narrow_sheet() -> None:
    # Analytic: 2 λ/L of the length, λ = w/4.
    assert restrained_twist(replace(SHEET, width_m=0.005)) == pytest.approx(1.0, abs=0.01)
    assert restrained_twist(replace(SHEET, width_m=0.2)) > 1.3


def test_anticlastic_bending_and_twist_are_those_of_theory() -> None:
    rows = [*validation_shell.anticlastic_rows()]
    assert len(rows) == 2
    assert [row.name for row in rows if not row.passed] == []
