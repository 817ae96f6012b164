"""The sheet of strips against beam theory: mass, statics, modes, signs."""

import math

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import linalg

from dualbend.beam import elastica
from dualbend.beam.sheet import GRAVITY_M_PER_S2, Sheet
from dualbend.scene.sheet.strips import (
    CLAMPED_FIRST_ROOT,
    LEFT_END,
    RIGHT_END,
    StripConfig,
    add_sheet,
    bend_joint,
    damping_time,
    strip_body,
)

Array = NDArray[np.float64]
SHEET = Sheet(
    length_m=0.4,
    width_m=0.06,
    thickness_m=0.0005,
    young_pa=70e9,
    poisson_ratio=0.33,
    density_kg_per_m3=2700.0,
)
EI, GJ, L = SHEET.bending_stiffness_nm2, SHEET.torsional_stiffness_nm2, SHEET.length_m


def build(hinges: int, damping_ratio: float = 0.02) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    config = StripConfig(hinges=hinges, damping_ratio=damping_ratio)
    add_sheet(spec, SHEET, config, np.zeros(3))
    return spec.compile()


def dofs(model: mujoco.MjModel, names: list[str]) -> NDArray[np.int_]:
    return np.array([model.joint(name).dofadr[0] for name in names])


def bends(model: mujoco.MjModel, hinges: int) -> NDArray[np.int_]:
    return dofs(model, [bend_joint(i) for i in range(hinges)])


def joint_value(values: Array, model: mujoco.MjModel, name: str) -> float:
    """First coefficient of a joint's stiffness or damping (a polynomial's linear term)."""
    return float(np.ravel(values[model.joint(name).id])[0])


def mass_matrix(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    return full


# --- what is configured arrives -----------------------------------------------------------------


@pytest.mark.parametrize("hinges", [4, 20, 42])
def test_mass_and_inertia_are_the_plates(hinges: int) -> None:
    model = build(hinges)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    inertia = mass_matrix(model, data)[:6, :6]
    m, w, t = SHEET.mass_kg, SHEET.width_m, SHEET.thickness_m
    plate = m / 12 * np.array([w**2 + t**2, L**2 + t**2, L**2 + w**2])
    # Analytic: boxes that fill a box, rounding only.
    np.testing.assert_allclose(np.diag(inertia), [m, m, m, *plate], rtol=1e-10)
    np.testing.assert_allclose(inertia - np.diag(np.diag(inertia)), 0.0, atol=1e-12)
    assert float(model.body_mass.sum()) == pytest.approx(m, rel=1e-12)


@pytest.mark.parametrize("hinges", [4, 10, 20])
def test_every_hinge_has_the_stiffness_of_its_piece(hinges: int) -> None:
    model = build(hinges)
    names = [model.joint(i).name for i in range(model.njnt)]
    bends = [bend_joint(i) for i in range(hinges)]
    twists = [name for name in names if name.startswith("sheet_twist_")]
    assert sum(name.startswith("sheet_bend_") for name in names) == hinges
    assert len(twists) == 2 * math.ceil(hinges / 4)
    # Analytic: springs in series have the whole sheet's EI/L and GJ/L.
    for joints, whole in ((bends, EI / L), (twists, GJ / L)):
        stiffness = [joint_value(model.jnt_stiffness, model, name) for name in joints]
        assert 1.0 / sum(1.0 / k for k in stiffness) == pytest.approx(whole)
        assert max(stiffness) == pytest.approx(min(stiffness))
        for name, k in zip(joints, stiffness, strict=True):
            dof = model.joint(name).dofadr[0]
            damping = float(np.ravel(model.dof_damping[dof])[0])
            assert damping == pytest.approx(damping_time(SHEET, 0.02) * k)


def test_twist_hinges_are_the_same_in_both_halves() -> None:
    for hinges in (10, 20):
        model = build(hinges)
        names = [model.joint(i).name for i in range(model.njnt)]
        places = sorted(int(n[-2:]) for n in names if n.startswith("sheet_twist_"))
        assert places == sorted(hinges - 1 - place for place in places)  # analytic: mirrored


def test_hinges_stand_at_odd_halves_and_clamps_at_the_true_ends() -> None:
    hinges = 8
    model = build(hinges)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    h = L / hinges
    places = [data.joint(bend_joint(i)).xanchor[0] + L / 2 for i in range(hinges)]
    np.testing.assert_allclose(places, (np.arange(hinges) + 0.5) * h, atol=1e-14)  # analytic
    for name, x, inward in ((LEFT_END, -L / 2, 1.0), (RIGHT_END, L / 2, -1.0)):
        np.testing.assert_allclose(data.site(name).xpos, [x, 0.0, 0.0], atol=1e-14)
        axes = data.site(name).xmat.reshape(3, 3)
        # x into the sheet, z up: a turn by 0 or π about z.
        np.testing.assert_allclose(axes, np.diag([inward, inward, 1.0]), atol=1e-14)


# --- statics ------------------------------------------------------------------------------------


def set_slopes(model: mujoco.MjModel, data: mujoco.MjData, slopes: Array) -> None:
    """Bend to the slopes (N + 1,) of the strips, the middle one in the free joint."""
    n = len(slopes) - 1
    middle = slopes[n // 2]
    data.qpos[3:7] = [math.cos(middle / 2), 0.0, math.sin(middle / 2), 0.0]
    for i in range(n):
        data.joint(bend_joint(i)).qpos[0] = slopes[i + 1] - slopes[i]
    mujoco.mj_forward(model, data)


def test_a_positive_bend_turns_the_slope_down_along_the_arc() -> None:
    model = build(4)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for i in range(4):
        data.qpos[7:] = 0.0
        data.joint(bend_joint(i)).qpos[0] = 0.01
        mujoco.mj_kinematics(model, data)
        left = data.body(strip_body(i)).xmat.reshape(3, 3)
        right = data.body(strip_body(i + 1)).xmat.reshape(3, 3)
        turned = left.T @ right
        # Analytic: the right neighbour is turned by R_y(q) against the left one.
        assert math.atan2(turned[0, 2], turned[0, 0]) == pytest.approx(0.01, abs=1e-15)


def test_a_positive_twist_turns_the_right_neighbour_about_the_arc() -> None:
    model = build(4)
    data = mujoco.MjData(model)
    for i in (1, 2):  # the two of four places that have one
        data.qpos[7:] = 0.0
        data.qpos[3] = 1.0
        data.joint(f"sheet_twist_{i:02d}").qpos[0] = 0.01
        mujoco.mj_kinematics(model, data)
        left = data.body(strip_body(i)).xmat.reshape(3, 3)
        right = data.body(strip_body(i + 1)).xmat.reshape(3, 3)
        turned = left.T @ right
        # Analytic: R_x(q), on both sides of the middle.
        assert math.atan2(turned[2, 1], turned[1, 1]) == pytest.approx(0.01, abs=1e-15)


def test_the_bent_chain_is_the_elastica_to_second_order() -> None:
    alpha, errors = 0.8, []
    for hinges in (10, 20, 40):
        model = build(hinges)
        data = mujoco.MjData(model)
        arcs = np.linspace(0.0, L, hinges + 1)
        set_slopes(model, data, elastica.shape(alpha, L, arcs)[2])
        left, right = data.site(LEFT_END).xpos, data.site(RIGHT_END).xpos
        middle = data.body(strip_body(hinges // 2)).xpos
        assert abs(left[1]) < 1e-15
        np.testing.assert_allclose(left * [-1, 1, 1], right, atol=1e-14)  # symmetric: analytic
        half = elastica.half_distance(alpha, L)
        height = elastica.rise(alpha, L)
        errors.append(max(abs((right - left)[0] / 2 - half), abs(left[2] - middle[2] - height)))
        x_axis = data.site(LEFT_END).xmat[[0, 3, 6]]
        assert math.atan2(-x_axis[2], x_axis[0]) == pytest.approx(alpha, abs=1e-14)
    # Discretisation-limited, O(h²): a ratio of 4 for each halving.
    ratios = np.array(errors[:-1]) / errors[1:]
    np.testing.assert_allclose(ratios, 4.0, rtol=0.05)


def droop(hinges: int, scale: float = 1e-3) -> tuple[Array, float, Array]:
    """Clamp the middle in a weak gravity; return bends, mean end deflection, hinge arcs to the end.

    The bends are the root of the hinges' static residual; one Newton step is enough, and the
    second shows that it was.
    """
    model = build(hinges)
    model.opt.gravity[:] = [0.0, 0.0, -scale * GRAVITY_M_PER_S2]
    data = mujoco.MjData(model)
    index = bends(model, hinges)
    adr = np.array([model.joint(bend_joint(i)).qposadr[0] for i in range(hinges)])
    stiffness = np.array(
        [joint_value(model.jnt_stiffness, model, bend_joint(i)) for i in range(hinges)]
    )
    for _ in range(3):
        mujoco.mj_forward(model, data)
        residual = (data.qfrc_passive - data.qfrc_bias)[index]
        data.qpos[adr] += residual / stiffness
    mujoco.mj_forward(model, data)
    assert np.abs((data.qfrc_passive - data.qfrc_bias)[index]).max() < 1e-9 * stiffness[0]
    ends = (data.site(LEFT_END).xpos[2] + data.site(RIGHT_END).xpos[2]) / 2
    arcs = (np.arange(hinges) + 0.5) * L / hinges
    return data.qpos[adr].copy(), -float(ends), np.minimum(arcs, L - arcs)


def test_a_drooping_cantilever_carries_the_moment_of_its_weight() -> None:
    scale, hinges = 1e-3, 20
    angles, _, to_end = droop(hinges, scale)
    weight = scale * SHEET.weight_per_length_n_per_m
    # Statically determinate: M = q x²/2, exact at every hinge up to (end slope)² ≈ 1e-7. It is
    # positive: a sheet that droops to both sides of a support has θ growing along s.
    np.testing.assert_allclose(EI * hinges / L * angles, weight * to_end**2 / 2, rtol=1e-5)


def test_the_cantilevers_deflection_converges_to_second_order() -> None:
    scale, free = 1e-3, L / 2
    theory = scale * SHEET.weight_per_length_n_per_m * free**4 / (8 * EI)
    errors = [abs(droop(hinges, scale)[1] / theory - 1) for hinges in (8, 16, 32)]
    # Discretisation-limited, O(h²): q ℓ⁴/(8 EI) of linear beam theory.
    np.testing.assert_allclose(np.array(errors[:-1]) / errors[1:], 4.0, rtol=0.05)
    assert errors[-1] < 2e-3


@pytest.mark.parametrize("hinges", [4, 20])
def test_the_chain_twists_as_a_bar_of_gj(hinges: int) -> None:
    model = build(hinges)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    torque, turn = 1e-4, np.zeros((2, 3, model.nv))
    for k, name in enumerate((LEFT_END, RIGHT_END)):
        mujoco.mj_jacSite(model, data, None, turn[k], model.site(name).id)
    load = torque * (turn[1, 0] - turn[0, 0])
    for joint in range(1, model.njnt):
        dof, adr = model.jnt_dofadr[joint], model.jnt_qposadr[joint]
        data.qpos[adr] = load[dof] / joint_value(
            model.jnt_stiffness, model, model.joint(joint).name
        )
    mujoco.mj_kinematics(model, data)
    left, right = (data.site(name).xmat.reshape(3, 3) for name in (LEFT_END, RIGHT_END))
    # The right site looks the other way: turn it back by π about z.
    relative = left.T @ right @ np.diag([-1.0, -1.0, 1.0])
    twist = math.atan2(relative[2, 1], relative[1, 1])
    assert twist == pytest.approx(torque * L / GJ, rel=1e-9)  # analytic: springs in series


# --- modes --------------------------------------------------------------------------------------


def first_bending_mode(hinges: int, damping_ratio: float = 0.02) -> tuple[float, float]:
    """Return frequency [rad/s] and damping ratio of the flat free chain's first bending mode."""
    model = build(hinges, damping_ratio)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    stiffness, damping = np.zeros((2, model.nv))
    for i in range(hinges):
        dof = model.joint(bend_joint(i)).dofadr[0]
        stiffness[dof] = joint_value(model.jnt_stiffness, model, bend_joint(i))
        damping[dof] = float(np.ravel(model.dof_damping[dof])[0])
    # Bending in the plane alone: x, z, the turn about y and the bends.
    plane = np.array([0, 2, 4, *bends(model, hinges)])
    mass = mass_matrix(model, data)[np.ix_(plane, plane)]
    squares, modes = linalg.eigh(np.diag(stiffness[plane]), mass)
    omega, shape = math.sqrt(squares[3]), modes[:, 3]
    return omega, float(shape @ (damping[plane] * shape)) / (2 * omega)


def test_the_first_mode_is_that_of_the_beam() -> None:
    """A free-free beam has the clamped-clamped one's frequencies: cosh b cos b = 1."""
    beam = (CLAMPED_FIRST_ROOT / L) ** 2 * math.sqrt(EI / (SHEET.mass_kg / L))
    for hinges in (6, 10, 20):
        # Discretisation-limited and better than O(h²): 1.7e-4, 3.3e-5, 5.3e-6 were found, of which
        # 3.2e-6 is the rotary inertia of the thickness, which the beam's theory leaves out.
        error = abs(first_bending_mode(hinges)[0] / beam - 1)
        assert error < 0.01 / hinges**2, hinges


@pytest.mark.parametrize("ratio", [0.0, 0.02, 0.3])
def test_the_first_mode_has_the_configured_damping(ratio: float) -> None:
    # Discretisation-limited, as the frequency: ζ = β ω/2.
    assert first_bending_mode(40, ratio)[1] == pytest.approx(ratio, rel=2e-3, abs=1e-15)


def test_the_root_of_the_clamped_beam_is_one() -> None:
    b = CLAMPED_FIRST_ROOT
    assert math.cosh(b) * math.cos(b) == pytest.approx(1.0, abs=1e-12)  # analytic


@pytest.mark.parametrize("hinges", [5, 21])
def test_an_odd_number_of_hinges_has_no_middle_strip(hinges: int) -> None:
    with pytest.raises(ValueError, match=f"even.*{hinges}"):
        StripConfig(hinges=hinges)
