"""Two arms coupled by a controller: directions, who follows whom, modes."""

import math

import numpy as np
import pytest

from dualbend.mechanics.coupling import (
    Coupling,
    deviation_angle,
    deviation_jacobian,
    wrench_response,
)
from dualbend.types import SIDES, Vector

STIFFNESS = np.random.default_rng(3).normal(size=(6, 6))


def mirror_symmetric() -> Vector:
    """Return a stiffness that exchanging the arms does not change."""
    own, other = STIFFNESS[:3, :3], STIFFNESS[:3, 3:]
    return np.block([[own, other], [other, own]])


def test_a_deviation_is_executed_along_the_axes_of_its_mode() -> None:
    angles = [deviation_angle(mode, 0.5, 0.2) for mode in ("world", "tool", "tool-frozen")]
    assert angles == [0.0, 0.5, 0.2]
    # Analytic: a turn about y takes x to (cos φ, −sin φ) in x, z.
    np.testing.assert_allclose(
        deviation_jacobian(0.5), [[math.cos(0.5), 0.0], [-math.sin(0.5), 0.0], [0.0, 1.0]]
    )


def test_an_arm_without_a_sensor_follows_the_first_that_has_one() -> None:
    assert Coupling.between(["right"], SIDES, 0.0).source == {0: 1, 1: 1}
    assert Coupling.between(SIDES, SIDES, 0.0).source == {0: 0, 1: 1}
    led = Coupling.between(["left"], ["right"], 0.0)
    assert led.source == {1: 0}
    assert not led.moves_its_sensor
    assert not led.tool(np.eye(3)).any()


def test_where_no_arm_complies_there_is_no_loop() -> None:
    still = Coupling.between(["left"], [], 0.0)
    assert still.modes(STIFFNESS) == {}
    assert still.loops(STIFFNESS) == {}
    assert not still.admittance_compliance(np.eye(2)).any()


def test_the_modes_of_two_arms_are_the_whole_motion() -> None:
    """Analytic: the eigenvalues of both modes are those of both arms' stiffness."""
    stiffness = mirror_symmetric()
    modes = Coupling.between(SIDES, SIDES, 0.0).modes(stiffness)
    assert list(modes) == ["symmetric", "antisymmetric"]
    found = np.concatenate([np.linalg.eigvals(own) for own, _ in modes.values()])
    expected = np.linalg.eigvals(stiffness)
    np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(expected), rtol=1e-9)


def test_followers_move_in_the_symmetric_mode_alone() -> None:
    stiffness = mirror_symmetric()
    (mode,) = Coupling.between(["left"], SIDES, 0.0).modes(stiffness).items()
    symmetric = Coupling.between(SIDES, SIDES, 0.0).modes(stiffness)["symmetric"]
    assert mode[0] == "symmetric"
    np.testing.assert_allclose(mode[1], symmetric, rtol=1e-14)  # analytic
    # Analytic: the response to both is that to a motion of both by the same coordinates.
    moved = wrench_response(STIFFNESS, 1, (0, 1)) @ [1.0, 2.0, 3.0]
    np.testing.assert_allclose(moved, (STIFFNESS @ np.tile([1.0, 2.0, 3.0], 2))[3:])


def test_compliance_at_rest_is_put_between_reader_and_mover() -> None:
    coupling = Coupling.between(["left"], ["right"], 0.0)
    compliance = coupling.admittance_compliance(np.array([[2.0, 0.0], [0.0, 5.0]]))
    load = np.array([1.0, 7.0, 3.0, 0.0, 0.0, 0.0])
    # Analytic: the right arm yields to the left one's force x and moment.
    assert (compliance @ load).tolist() == [0.0, 0.0, 0.0, 2.0, 0.0, 15.0]


def test_dry_friction_holds_an_arm_that_nothing_commands() -> None:
    arm, grasp = 3.0 * np.eye(3), np.eye(3)
    held = Coupling.between(["left"], ["left"], 0.0).arm_compliance(arm, grasp)
    assert np.diag(held) == pytest.approx([4.0, 4.0, 4.0, 1.0, 1.0, 1.0])  # analytic
