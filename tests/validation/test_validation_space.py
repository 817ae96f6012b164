"""What misaligned grips feel, against the rod in space."""

import numpy as np
import pytest

from dualbend.scene.sheet.strips import StripConfig
from dualbend.validation.cases import space as validation_space
from dualbend.validation.cases.sheet import default_sheet
from dualbend.validation.cases.space import reference_state, twisted_between_ideal_grips


@pytest.mark.slow
def test_every_row_passes() -> None:
    rows = list(validation_space.space_rows())
    assert len(rows) > 10
    assert [row.name for row in rows if not row.passed] == []


def test_the_strips_twist_converges_with_the_square_of_their_number() -> None:
    sheet, _ = default_sheet()
    errors = []
    for hinges in (20, 40):
        strips = StripConfig(hinges=hinges, damping_ratio=0.5)
        wrench, left, right = twisted_between_ideal_grips(sheet, strips, 1.0, 0.02)
        wanted = reference_state(sheet, left, right, weight=False).left
        errors.append(wrench[3:] @ left.axes[:, 0] / (wanted[3:] @ left.axes[:, 0]) - 1.0)
    # Discretisation-limited: order 2 in the number of hinges; 1.8 is asked for.
    assert np.log2(errors[0] / errors[1]) > 1.8
    assert errors[0] == pytest.approx(0.0, abs=0.02)
