"""Compliance of end points and of springs in series."""

import numpy as np
import pytest

from dualbend.errors import InputError
from dualbend.mechanics.compliance import endpoint_compliance, grasp_compliance, series_stiffness
from dualbend.types import Vector


def test_the_energy_of_a_load_is_that_of_the_joints() -> None:
    rng = np.random.default_rng(1)
    jacobian, stiffness = rng.normal(size=(3, 6)), rng.uniform(1.0, 5.0, 6)
    load = rng.normal(size=3)
    torque = jacobian.T @ load
    compliance = endpoint_compliance(jacobian, stiffness)
    # Analytic: f C f = τ Kq⁻¹ τ with τ = Jᵀ f.
    assert load @ compliance @ load == pytest.approx(torque @ (torque / stiffness), rel=1e-12)


def test_springs_one_behind_the_other_add_their_compliances() -> None:
    lever = np.array([[1.0, 0.4], [0.0, 1.0]])
    whole = endpoint_compliance(np.hstack([np.eye(2), lever]), [4.0, 2.0, 5.0, 3.0])
    parts = endpoint_compliance(np.eye(2), [4.0, 2.0]) + endpoint_compliance(lever, [5.0, 3.0])
    np.testing.assert_allclose(whole, parts, rtol=1e-14)  # analytic
    np.testing.assert_allclose(grasp_compliance(4.0, 2.0), np.diag([0.25, 0.25, 0.5]))  # analytic


def test_series_is_the_inverse_of_summed_compliances() -> None:
    stiffness = np.array([[3.0, 1.0], [1.0, 2.0]])
    compliance = np.diag([0.5, 0.1])
    expected = np.linalg.inv(np.linalg.inv(stiffness) + compliance)
    # Analytic.
    np.testing.assert_allclose(series_stiffness(stiffness, compliance), expected, rtol=1e-12)
    rigid = np.array([[1.0, -1.0], [-1.0, 1.0]])
    np.testing.assert_allclose(series_stiffness(rigid, np.eye(2)), rigid / 3.0, rtol=1e-12)


@pytest.mark.parametrize("scale", [1e-6, 0.5, 1e6])
def test_a_softer_arm_yields_more_in_proportion_however_soft(scale: float) -> None:
    jacobian, stiffness = np.array([[1.0, 0.4], [0.2, 1.0]]), np.array([3.0, 5.0])
    # Analytic: no scale of stiffness is special, so the units do not matter.
    np.testing.assert_allclose(
        endpoint_compliance(jacobian, scale * stiffness),
        endpoint_compliance(jacobian, stiffness) / scale,
        rtol=1e-14,
    )


@pytest.mark.parametrize(
    ("jacobian", "stiffness", "says"),
    [
        (np.eye(3), np.ones(4), r"needs stiffness \(n,\)"),
        (np.ones(3), np.ones(3), r"jacobian \(m, n\)"),
        (np.eye(3), np.array([1.0, 0.0, 1.0]), "positive"),
        (np.eye(3), np.array([1.0, 1.0, np.nan]), "positive"),
    ],
)
def test_what_is_no_spring_is_refused(jacobian: Vector, stiffness: Vector, says: str) -> None:
    with pytest.raises(InputError, match=says):
        endpoint_compliance(jacobian, stiffness)
