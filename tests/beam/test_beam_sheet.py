"""The sheet's derived numbers, against formulas that the module does not use."""

import math
from dataclasses import FrozenInstanceError, replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dualbend.errors import InputError
from support.sheets import PANEL


def test_numbers_of_the_reference_sheet() -> None:
    # Analytic: 70e9 · 0.2 · (0.5e-3)³ / 12, and so on, by hand.
    assert PANEL.bending_stiffness_nm2 == pytest.approx(0.14583333333333334, rel=1e-14)
    assert PANEL.mass_kg == pytest.approx(0.162, rel=1e-14)
    assert PANEL.weight_per_length_n_per_m == pytest.approx(2.6487, rel=1e-14)
    assert PANEL.axial_stiffness_n == pytest.approx(7.0e6, rel=1e-14)
    assert PANEL.euler_load_n == pytest.approx(math.pi**2 * 0.14583333333333334 / 0.36, rel=1e-14)


@given(ratio=st.floats(1e-4, 1.0))
@settings(max_examples=50, derandomize=True)
def test_torsion_constant_follows_the_usual_fit(ratio: float) -> None:
    sheet = replace(PANEL, width_m=0.1, thickness_m=0.1 * ratio)
    fit = 0.1 * (0.1 * ratio) ** 3 / 3 * (1 - 0.63 * ratio + 0.0525 * ratio**5)
    # Approximation-limited: Roark's fit is good to 0.6 %.
    assert sheet.torsion_constant_m4 == pytest.approx(fit, rel=6e-3)


def test_torsion_constant_of_the_square_is_the_textbook_one() -> None:
    square = replace(PANEL, width_m=0.1, thickness_m=0.1)
    # Golden: 0.140577 a⁴ (Timoshenko and Goodier, table in art. 109).
    assert square.torsion_constant_m4 == pytest.approx(0.140577e-4, rel=5e-6)


def test_thin_sheet_twists_by_the_slender_limit() -> None:
    slender = PANEL.width_m * PANEL.thickness_m**3 / 3
    # Analytic: the correction is 0.6302 t/w = 0.16 %.
    assert PANEL.torsion_constant_m4 / slender == pytest.approx(1 - 0.6302 * 0.0025, abs=1e-6)
    shear = PANEL.young_pa / (2 * 1.33)
    assert PANEL.torsional_stiffness_nm2 == pytest.approx(
        shear * PANEL.torsion_constant_m4, rel=1e-14
    )


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("length_m", 0.0),
        ("width_m", -0.1),
        ("thickness_m", math.nan),
        ("young_pa", math.inf),
        ("density_kg_per_m3", -1.0),
        ("poisson_ratio", 0.5),
        ("poisson_ratio", math.nan),
        ("thickness_m", 0.3),
    ],
)
def test_refuses_what_is_no_sheet_and_names_it(name: str, value: float) -> None:
    with pytest.raises(InputError, match=name):
        replace(PANEL, **{name: value})


def test_cannot_be_changed() -> None:
    with pytest.raises(FrozenInstanceError):
        PANEL.length_m = 1.0  # type: ignore[misc]
