"""Lamination theory: what a stack of layers must be, whatever they are."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from dualbend.beam.laminate import Laminate, Layer, reduced_stiffness, stack
from dualbend.beam.material import Material, find_material
from dualbend.errors import InputError

COPPER, FR4, METAL = (find_material(name) for name in ("copper-foil", "FR-4", "6061-T6"))
CLAD = stack([(COPPER, 35e-6), (FR4, 0.5e-3), (COPPER, 35e-6)])

materials = st.builds(
    Material,
    name=st.just("any"),
    young_pa=st.floats(1e9, 3e11),
    transverse_young_pa=st.floats(1e9, 3e11),
    # Between 0 and 1e-6 a product with t³ may lose its digits to underflow.
    poisson_ratio=st.just(0.0) | st.floats(1e-6, 0.05),
    shear_pa=st.floats(1e8, 1e11),
    density_kg_per_m3=st.floats(500.0, 10000.0),
)
thicknesses = st.floats(1e-5, 1e-3)


@given(parts=st.lists(thicknesses, min_size=1, max_size=6))
def test_equal_layers_are_the_solid_sheet(parts: list[float]) -> None:
    laminate, t = stack([(METAL, part) for part in parts]), sum(parts)
    E, nu = METAL.young_pa, METAL.poisson_ratio
    # Analytic: A = Q t, D = Q t³/12, B = 0.
    np.testing.assert_allclose(laminate.A, reduced_stiffness(METAL) * t, rtol=1e-12)
    np.testing.assert_allclose(laminate.D, reduced_stiffness(METAL) * t**3 / 12.0, rtol=1e-9)
    assert laminate.coupling < 1e-12
    assert laminate.bending_per_width_nm == pytest.approx(E * t**3 / 12.0, rel=1e-9)
    assert laminate.D[0, 0] == pytest.approx(E * t**3 / 12.0 / (1.0 - nu**2), rel=1e-9)
    # Torsion: GJ = 4 D66 w of a thin sheet is G w t³/3.
    assert 4.0 * laminate.D[2, 2] == pytest.approx(E / (2 * (1 + nu)) * t**3 / 3.0, rel=1e-9)


@given(face=materials, core=materials, face_m=thicknesses, core_m=thicknesses)
def test_a_symmetric_stack_does_not_curl_and_an_unequal_one_does(
    face: Material, core: Material, face_m: float, core_m: float
) -> None:
    symmetric = stack([(face, face_m), (core, core_m), (face, face_m)])
    symmetric.refuse_curl()
    assert symmetric.coupling < 1e-12
    assume(abs(face.young_pa - core.young_pa) > 0.01 * core.young_pa)
    assume(0.01 < face_m / core_m < 100.0)
    with pytest.raises(InputError, match=r"B11 = .*mirror the layers"):
        stack([(face, face_m), (core, core_m)]).refuse_curl()


@given(face=materials, core=materials, face_m=thicknesses, core_m=thicknesses)
def test_parallel_axes(face: Material, core: Material, face_m: float, core_m: float) -> None:
    found = stack([(face, face_m), (core, core_m), (face, face_m)]).D
    arm = (core_m + face_m) / 2.0
    own = reduced_stiffness(core) * core_m**3 / 12.0
    faces = 2.0 * reduced_stiffness(face) * (face_m**3 / 12.0 + face_m * arm**2)
    np.testing.assert_allclose(found, own + faces, rtol=1e-10)  # analytic


@given(face=materials, core=materials, share=st.floats(0.01, 0.49))
def test_the_effective_moduli_lie_between_reuss_and_voigt(
    face: Material, core: Material, share: float
) -> None:
    t = 1e-3
    found = stack([(face, share * t), (core, (1 - 2 * share) * t), (face, share * t)])
    E = np.array([face.young_pa, core.young_pa])
    part = np.array([2 * share, 1 - 2 * share])
    stretch = found.stretch_per_width_n_per_m / t
    # Layers side by side are at Voigt's bound from above, up to Poisson's difference, which can
    # only stiffen: within ν²; Reuss's is far below.
    stiffest = max(1.0 / (1.0 - m.mean_poisson**2) for m in (face, core))
    assert part @ E * (1 - 1e-9) <= stretch <= part @ E * stiffest * (1 + 1e-9)
    assert stretch >= 1.0 / (part @ (1.0 / E)) * (1 - 1e-9)
    bending = 12.0 * found.bending_per_width_nm / t**3
    assert min(E) * (1 - 1e-9) <= bending <= max(E) * stiffest * (1 + 1e-9)


@given(face=materials, core=materials, face_m=thicknesses, core_m=thicknesses)
def test_the_stiffness_is_symmetric_and_positive(
    face: Material, core: Material, face_m: float, core_m: float
) -> None:
    found = stack([(face, face_m), (core, core_m)])
    whole = np.block([[found.A, found.B], [found.B, found.D]])
    # In units of the thickness, so that stretch and bend are of one size.
    size = np.repeat([1.0, 1.0 / found.thickness_m], 3)
    scaled = whole * np.outer(size, size)
    np.testing.assert_array_equal(whole, whole.T)
    assert np.linalg.eigvalsh(scaled).min() > 0.0


def test_copper_on_fr4_by_hand() -> None:
    # By hand, without Poisson's difference: (E_c (t³ − c³) + E_f c³) / 12; c = 0.5, t = 0.57 mm.
    hand = (120e9 * (0.57e-3**3 - 0.5e-3**3) + 24e9 * 0.5e-3**3) / 12.0
    # That difference (0.34 against 0.136) stiffens by 1 %.
    assert CLAD.bending_per_width_nm == pytest.approx(hand, rel=0.015)
    assert CLAD.bending_per_width_nm > hand
    assert CLAD.density_kg_per_m3 == pytest.approx((70 * 8900 + 500 * 1850) / 570)  # analytic


def test_the_first_layer_at_its_limit_says_that_of_the_sheet() -> None:
    # Copper yields at 200 MPa / 120 GPa at the surface; FR-4 would break at 1.73 % × 570/500.
    assert CLAD.surface_limit() == pytest.approx(200e6 / 120e9, rel=1e-9)
    inside = stack([(FR4, 0.25e-3), (COPPER, 70e-6), (FR4, 0.25e-3)])
    assert inside.surface_limit() == pytest.approx(200e6 / 120e9 * 570 / 70, rel=1e-9)


def test_turning_the_stack_over_changes_the_sign_of_the_coupling_alone() -> None:
    one = stack([(COPPER, 35e-6), (FR4, 0.5e-3)])
    other = Laminate(one.layers[::-1])
    np.testing.assert_allclose(other.B, -one.B, rtol=1e-12)
    np.testing.assert_allclose(other.D, one.D, rtol=1e-12)
    assert other.bending_per_width_nm == pytest.approx(one.bending_per_width_nm, rel=1e-12)


def test_the_free_strip_bends_about_its_neutral_axis() -> None:
    # ν = 0: the beam of two materials, EI about the axis through Σ E z.
    stiff, soft = (
        Material(name=n, young_pa=E, poisson_ratio=0.0, density_kg_per_m3=1.0)
        for n, E in (("stiff", 100e9), ("soft", 10e9))
    )
    found = stack([(stiff, 1e-4), (soft, 9e-4)])
    E, t, z = np.array([100e9, 10e9]), np.array([1e-4, 9e-4]), np.array([-4.5e-4, 0.5e-4])
    axis = (E * t) @ z / (E @ t)
    wanted = float(E @ (t**3 / 12.0 + t * (z - axis) ** 2))
    assert found.bending_per_width_nm == pytest.approx(wanted, rel=1e-12)  # analytic
    assert found.free_neutral_axis_m == pytest.approx(axis, rel=1e-12)


def test_a_laminate_needs_layers_that_are_some() -> None:
    with pytest.raises(InputError, match="at least one"):
        Laminate(())
    with pytest.raises(InputError, match="thickness_m"):
        Layer(material=FR4, thickness_m=0.0)
