"""The rod in space: closed forms, the plane rod, collocation of its own equations, equilibrium."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_bvp
from scipy.spatial.transform import Rotation

from dualbend.beam import elastica
from dualbend.beam.rod import planar as rod
from dualbend.beam.rod.space import (
    RodStiffness,
    SpaceGrip,
    SpaceState,
    _Problem,
    solve_space,
)
from dualbend.errors import InputError
from support.sheets import STRIP

L, WEIGHT = STRIP.length_m, STRIP.weight_per_length_n_per_m
GIVING, STRIPS = RodStiffness.of(STRIP), RodStiffness.of(STRIP, in_plane=False)


def grip(x: float, y: float, pitch: float, roll: float = 0.0, yaw: float = 0.0) -> SpaceGrip:
    axes = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()
    return SpaceGrip(np.array([x, y, 0.0]), axes)


def bent(alpha: float, roll: float = 0.0, yaw: float = 0.0, y: float = 0.0) -> SpaceState:
    x = float(elastica.half_distance(alpha, L))
    plane = rod.solve_symmetric(STRIP.bending_stiffness_nm2, L, alpha, x, WEIGHT)
    guess = np.array([-plane.end_force_n, 0, plane.left.force_z_n, 0, plane.end_moment_nm, 0])
    return solve_space(STRIPS, L, grip(-x, 0, alpha), grip(x, y, -alpha, roll, yaw), guess, WEIGHT)


@pytest.mark.parametrize("alpha", [0.1, 0.5, 1.0])
def test_between_grips_in_a_plane_it_is_the_plane_rod(alpha: float) -> None:
    x = float(elastica.half_distance(alpha, L)) + 0.0002
    plane = rod.solve_symmetric(STRIP.bending_stiffness_nm2, L, alpha, x, WEIGHT)
    # From a guess that is 5 % off.
    guess = 1.05 * np.array(
        [-plane.end_force_n, 0, plane.left.force_z_n, 0, plane.end_moment_nm, 0]
    )
    space = solve_space(STRIPS, L, grip(-x, 0, alpha), grip(x, 0, -alpha), guess, WEIGHT)
    # Discretisation-limited: fourth order, 100 steps.
    assert space.converged
    expected = [-plane.end_force_n, 0, plane.left.force_z_n, 0, plane.end_moment_nm, 0]
    assert space.left == pytest.approx(expected, rel=1e-5, abs=1e-7)
    assert -space.middle_m[2] == pytest.approx(plane.rise_m, abs=1e-8)


def test_a_straight_rod_has_the_textbook_stiffnesses() -> None:
    turned, shifted, yawed = 0.01, 1e-6, 1e-6
    flat = grip(-L / 2, 0, 0)
    loads = [
        solve_space(GIVING, L, flat, far, np.zeros(6)).left
        for far in (
            grip(L / 2, 0, 0, roll=turned),
            grip(L / 2, shifted, 0),
            grip(L / 2, 0, 0, yaw=yawed),
        )
    ]
    lateral = GIVING.lateral_nm2
    # Analytic, for small angles: the next terms are of relative size 1e-6 here.
    assert loads[0][3] == pytest.approx(STRIP.torsional_stiffness_nm2 * turned / L, rel=1e-5)
    assert loads[1][1] == pytest.approx(12 * lateral / L**3 * shifted, rel=1e-5)
    assert loads[1][5] == pytest.approx(6 * lateral / L**2 * shifted, rel=1e-5)
    assert loads[2][1] == pytest.approx(-6 * lateral / L**2 * yawed, rel=1e-5)
    assert loads[2][5] == pytest.approx(-2 * lateral / L * yawed, rel=1e-5)


def test_the_loads_on_both_grippers_carry_the_weight_and_balance() -> None:
    alpha, y = 0.6, 0.004
    x = float(elastica.half_distance(alpha, L))
    state = bent(alpha, roll=0.1, yaw=0.05, y=y)
    assert state.converged
    # Analytic: statics of the whole sheet.
    assert state.left[:3] + state.right[:3] == pytest.approx([0, 0, -WEIGHT * L], abs=1e-9)
    # The weight's own moment needs its centre, which only its part about z does not.
    about_left = state.left[3:] + state.right[3:] + np.cross([2 * x, y, 0], state.right[:3])
    assert about_left[2] == pytest.approx(0.0, abs=1e-6)


def test_it_is_what_collocation_makes_of_the_same_equations() -> None:
    alpha, roll, yaw, y = 0.5, 0.1, 0.05, 0.003
    x = float(elastica.half_distance(alpha, L))
    state = bent(alpha, roll, yaw, y)
    _, twist, bend, _ = STRIPS

    def rates(s: np.ndarray, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Quaternion, place and moment; the forces at the left end are the parameters."""
        w, i, j, k = u[3:7]
        axes = Rotation.from_quat(u[[4, 5, 6, 3]].T).as_matrix()
        m = np.einsum("kij,ik->jk", axes, u[7:])
        a, b = m[0] / twist, m[1] / bend
        n = np.tile(p[:, np.newaxis], (1, len(s)))
        n[2] += WEIGHT * s
        tangent = axes[:, :, 0].T
        # q' = q ∘ (0, κ) / 2, with κ₃ = 0: the strips do not bend in their plane.
        q = 0.5 * np.array([-i * a - j * b, w * a - k * b, w * b + k * a, j * -a + i * b])
        return np.vstack([tangent, q, -np.cross(tangent, n, axis=0)])

    def ends(first: np.ndarray, last: np.ndarray, p: np.ndarray) -> np.ndarray:
        left, right = grip(-x, 0, alpha), grip(x, y, -alpha, roll, yaw)
        q0 = Rotation.from_matrix(left.axes).as_quat()[[3, 0, 1, 2]]
        miss = Rotation.from_matrix(right.axes).inv() * Rotation.from_quat(last[[4, 5, 6, 3]])
        return np.concatenate(
            [
                first[:3] - left.position_m,
                first[3:7] - q0,
                last[:3] - right.position_m,
                miss.as_rotvec(),
            ]
        )

    s = np.linspace(0, L, 81)
    _, _, slope = elastica.shape(alpha, L, s)
    px, pz, _ = elastica.shape(alpha, L, s)
    start = np.zeros((10, len(s)))
    start[0], start[2] = px - px.mean(), pz - pz[0]
    start[3], start[5] = np.cos(slope / 2), np.sin(slope / 2)
    start[7:] = state.left[3:, np.newaxis] * 0.8
    found = solve_bvp(rates, ends, s, start, p=0.8 * state.left[:3], tol=1e-8, max_nodes=5000)
    assert found.success, found.message
    # Discretisation-limited: both solvers to 1e-6 of the largest load.
    assert state.left[:3] == pytest.approx(found.p, abs=1e-5)
    assert state.left[3:] == pytest.approx(found.y[7:, 0], abs=1e-6)


def test_the_stiffness_of_the_strip_by_hand() -> None:
    # Written down: 57 × 0.5 mm of E = 70.3 GPa; EI_z = E t w³/12, (w/t)² = 12 996 times EI.
    assert GIVING.lateral_nm2 == pytest.approx(70.3e9 * 0.0005 * 1.85193e-4 / 12, rel=1e-6)
    assert GIVING.lateral_nm2 / GIVING.bend_nm2 == pytest.approx(12996.0, rel=1e-12)
    assert GIVING.axial_n == pytest.approx(70.3e9 * 28.5e-6, rel=1e-12)
    assert GIVING._replace(axial_n=math.inf, lateral_nm2=math.inf) == STRIPS


def test_a_grip_out_of_reach_is_missed_by_lengths() -> None:
    far = grip(0.7 * L, 0, 0)
    state = solve_space(STRIPS, L, grip(-L / 2, 0, 0), far, np.zeros(6))
    assert not state.converged
    # Analytic bound: the rod cannot stretch, and the grips are 1.2 lengths apart.
    assert state.miss >= 0.2 - 1e-9
    # As given by shooting one rod that no load bends.
    units = np.ones(6)
    problem = _Problem(np.reciprocal(STRIPS), L, grip(-L / 2, 0, 0), far, 0.0, units)
    r, axes, _, middle = problem.shoot(np.zeros((1, 6)))
    # Analytic: straight ahead; 0.2 lengths short, along the first axis.
    np.testing.assert_allclose(r[0], [L / 2, 0, 0], atol=1e-14)
    np.testing.assert_allclose(middle[0], 0.0, atol=1e-14)
    np.testing.assert_allclose(problem.miss(r, axes)[0], [0.2, 0, 0, 0, 0, 0], atol=1e-14)
    turned = _Problem(*problem[:3], grip(L / 2, 0, 0.0, roll=0.02, yaw=-0.03), 0.0, units)
    # Analytic: angles of a small rotation vector, to their third power.
    np.testing.assert_allclose(turned.miss(r, axes)[0, 3:], [0.02, 0.0, -0.03], atol=5e-4)


def test_what_is_no_rod_is_refused() -> None:
    flat = grip(-L / 2, 0, 0), grip(L / 2, 0, 0)
    with pytest.raises(InputError, match="stiffness must be above zero"):
        solve_space(STRIPS._replace(twist_nm2=0.0), L, *flat, np.zeros(6))
    with pytest.raises(InputError, match="length_m"):
        solve_space(STRIPS, math.nan, *flat, np.zeros(6))
