"""All six directions of a deviation are executed: as commanded, and where the grips then are."""

from typing import Any

import mink
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from dualbend import Observation, load_run, load_scenario, make_run, write_results
from dualbend.control.alter import AlterMode, PathModification, angles_of, turn
from dualbend.run.record import RunRecord
from dualbend.scenario.scenario import Scenario
from dualbend.scene.ik import carried_targets, grip_targets
from dualbend.types import PlanarPose, Vector

SMALL = arrays(np.float64, (2, 6), elements=st.floats(-0.3, 0.3))
ALPHAS = st.floats(0.0, 3.0)
TURN = np.diag([-1.0, -1.0, 1.0])


def about_y(angle: float) -> Vector:
    return np.asarray(Rotation.from_euler("y", angle).as_matrix())


# --- what is commanded -------------------------------------------------------------------------


@pytest.mark.parametrize("mode", ["world", "tool", "tool-frozen"])
@given(SMALL, ALPHAS, ALPHAS)
def test_a_target_is_the_nominal_pose_and_the_whole_deviation(
    mode: AlterMode, deviation: Vector, first: float, alpha: float
) -> None:
    """Analytic, with another program's rotations: p + R_y(φ) δp, R_y(φ) R(δ) R_y(α − φ)."""
    path = PathModification(mode)
    path.compose(PlanarPose(np.array([[-0.2, 0.7, first]] * 2)), np.zeros((2, 6)))
    nominal = PlanarPose(np.array([[-0.3, 0.6, alpha], [-0.25, 0.65, alpha]]))
    pose, aside = path.compose(nominal, deviation)
    phi = {"world": 0.0, "tool": alpha, "tool-frozen": first}[mode]
    for i, target in enumerate(grip_targets(pose.coordinates, aside)):
        to_world = TURN if i else np.eye(3)
        x, z, _ = nominal.coordinates[i]
        place = np.array([x, 0.0, z]) + about_y(phi) @ deviation[i, :3]
        roll, pitch, yaw = deviation[i, 3:]
        own = Rotation.from_euler("ZXY", [yaw, roll, pitch]).as_matrix()
        axes = about_y(phi) @ own @ about_y(alpha - phi)
        np.testing.assert_allclose(target.translation(), to_world @ place, atol=1e-12)
        np.testing.assert_allclose(target.rotation().as_matrix(), to_world @ axes, atol=1e-12)


@given(arrays(np.float64, (3,), elements=st.floats(-1.5, 1.5)))
def test_angles_and_axes_are_each_others_inverse(angles: Vector) -> None:
    np.testing.assert_allclose(angles_of(turn(angles)), angles, atol=1e-9)


@given(SMALL, arrays(np.float64, 4, elements=st.floats(-0.5, 0.5)))
def test_an_assembly_carries_the_deviated_grips(deviation: Vector, place: Vector) -> None:
    """Analytic: the frame of the place, times what would be commanded at none."""
    pose = np.array([[-0.2, 0.1, 0.2]] * 2) + deviation[:, ::2]
    x, y, z, yaw = place
    frame = mink.SE3.from_rotation_and_translation(
        mink.SO3.from_z_radians(yaw), np.array([x, y, z])
    )
    there = carried_targets(pose, place, deviation[:, 1::2])
    for found, target in zip(there, grip_targets(pose, deviation[:, 1::2]), strict=True):
        np.testing.assert_allclose(
            found.as_matrix(), frame.as_matrix() @ target.as_matrix(), atol=1e-12
        )


# --- where the grips are -----------------------------------------------------------------------

PERFECT = ("imperfections=none", "sensor.force_noise_n=0", "sensor.torque_noise_nm=0")
SHORT = ("path.end_rad=0.1", "motion.speed_rad_per_s=0.5", "motion.settle_s=0.2")
SETTINGS = [*PERFECT, *SHORT, "motion.hold_s=2.0", 'compliance.complying=["left","right"]']


def held(deviation: Vector, told: list[Observation] | None = None) -> RunRecord:
    """Return a run of the light strip in which a deviation (2, 6) comes in and stays."""

    def constant(_: Scenario) -> Any:
        def control(observation: Observation) -> Vector:
            if told is not None:
                told.append(observation)
            return deviation * min(observation.time_s, 1.0)

        return control

    result = make_run(load_scenario("exact", SETTINGS), compliance=constant).run()
    assert result.outcome == "completed", result.reason
    return result


def grips(run: RunRecord) -> Vector:
    """Return x, y, z, α of both grips (2, 4) at the end of a run."""
    parts = ("x", "y", "z", "alpha")
    return np.array([[run[f"{s}_grip_{p}"][-1] for p in parts] for s in ("left", "right")])


def test_the_grips_go_where_the_deviation_is() -> None:
    """Limited by the servos' stiffness under the sheet's load: 0.1 mm and 0.1 mrad.

    Both arms move the strip sideways, up, and about the vertical, as a whole.
    """
    still = grips(held(np.zeros((2, 6))))
    shift = np.array([[0, 4e-3, 3e-3, 0, 0, 0], [0, -4e-3, 3e-3, 0, 0, 0]])
    moved = grips(held(shift)) - still
    np.testing.assert_allclose(moved[:, 1], [4e-3, -4e-3], atol=1e-4)
    np.testing.assert_allclose(moved[:, 2], [3e-3, 3e-3], atol=1e-4)
    np.testing.assert_allclose(moved[:, [0, 3]], 0.0, atol=1e-4)


@pytest.mark.parametrize(
    "deviation",
    [
        [0, 2e-3, 0, 0, 0, 0],
        [0, 0, 0, 5e-3, 0, 0],
        [0, 0, 0, 0, 0, 3e-3],
        [0, 1e-3, 0, 2e-3, 0, 3e-3],
    ],
)
def test_the_encoders_tell_where_the_grips_have_gone(deviation: list[float]) -> None:
    """Limited by the servos' stiffness under the load of the sheet that is pulled askew: 5 %."""
    told: list[Observation] = []
    held(np.array([deviation] * 2), told)
    assert np.abs(told[0].aside).max() < 1e-4
    wanted = np.array([deviation[1], deviation[3], deviation[5]])
    np.testing.assert_allclose(told[-1].aside, [wanted] * 2, atol=0.05 * wanted.max())


def test_a_turn_about_the_vertical_is_felt_about_it() -> None:
    """A symmetry: opposite yaws of the grips make opposite moments about the vertical in the world.

    Both grips turn by the same yaw of their own, so the strip bends sideways; nothing is felt in
    its plane.
    """
    run, still = (held(yaw * np.array([[0, 0, 0, 0, 0, 1.0]] * 2)) for yaw in (2e-3, 0.0))
    moments = np.array(
        [run[f"{s}_true_moment_z"][-1] - still[f"{s}_true_moment_z"][-1] for s in ("left", "right")]
    )
    assert (moments < -1e-3).all()  # the strip resists
    assert moments[0] == pytest.approx(moments[1], rel=0.05)
    in_plane = run["left_true_moment_y"][-1] - still["left_true_moment_y"][-1]
    assert abs(in_plane) < 0.1 * abs(moments[0])


def test_no_deviation_out_of_the_plane_is_the_planar_run_to_the_bit() -> None:
    planar = np.array([[1e-3, 0, 1e-3, 0, 5e-3, 0]] * 2)
    run, still = held(planar), held(np.zeros((2, 6)))
    for name in ("left_grip_y", "right_grip_y"):
        assert np.abs(run[name] - still[name]).max() < 1e-6
    assert run["left_command_alpha"][-1] == run["nominal_alpha"][-1] + 5e-3


# --- the admittance in full, in a run -----------------------------------------------------------

BOTH = 'sensing=["left","right"],complying=["left","right"]'


def test_the_papers_admittance_is_a_case_of_it() -> None:
    """Exact: fig8 with the form "static", b and k in SI, as both kinds say it."""
    short = ("path.end_rad=0.4", "motion.speed_rad_per_s=1.0", "motion.settle_s=0.2")
    b, k = 28.0, 20.0
    paper = f'compliance={{units="si",{BOTH},rotation={{b={b},k={k},form="static"}}}}'
    full = f'compliance={{kind="mass-spring-damper",{BOTH},pitch={{b={b},k={k}}}}}'
    one, other = (make_run(load_scenario("fig8", [*short, c])).run() for c in (paper, full))
    assert one.trace.columns == other.trace.columns
    assert np.abs(one["left_deviation_alpha"]).max() > 1e-3
    for name, _ in one.trace.columns:
        if name != "wall_s":
            np.testing.assert_allclose(one[name], other[name], rtol=1e-9, atol=1e-12, err_msg=name)


def test_a_trace_has_all_directions_where_they_may_deviate(tmp_path: Any) -> None:
    parts = "y={m=5,b=2000,k=8000},z={b=4000,k=20000}"
    scenario = load_scenario(
        "exact", [*SHORT, f'compliance={{kind="mass-spring-damper",{BOTH},{parts}}}']
    )
    result = make_run(scenario).run()
    assert result.outcome == "completed"
    for part in ("y", "z", "roll", "yaw"):
        assert (np.abs(result[f"left_deviation_{part}"]).max() > 0.0) == (part in "yz")
    assert write_results(result, tmp_path, record=False) == []
    assert load_run(tmp_path).trace.equals(result.trace)


def test_the_trace_has_each_direction_under_its_name() -> None:
    """Exact."""
    given = [1e-4, 2e-4, 3e-4, 4e-4, 5e-4, 6e-4]
    own = f"compliance={{kind='support.controllers:Constant',options={{deviation={given}}}}}"
    result = make_run(load_scenario("exact", [*SHORT, own])).run()
    assert result.outcome == "completed"
    for part, value in zip(("x", "y", "z", "roll", "alpha", "yaw"), given, strict=True):
        assert result[f"left_deviation_{part}"][5] == value
        assert result[f"right_deviation_{part}"][5] == 0.0


@pytest.mark.slow
def test_yielding_sideways_relieves_a_sheet_that_is_held_askew() -> None:
    """Golden, the table of docs/your-controller.md: half the lateral force, the yaw moment too."""
    askew = [f"task.misalignment.right.{key}" for key in ("lateral_m=5e-4", "yaw_rad=2e-3")]
    askew.append("task.misalignment.right.roll_rad=0.02")
    soft = "pitch={m=0.05,b=10,k=5,dead_zone=0.05},y={m=5,b=2000,k=200}"
    kinds = (f'kind="none",{BOTH}', f'kind="mass-spring-damper",{BOTH},{soft}')
    names = ("peak_moment", "peak_lateral_force", "peak_yaw_moment")
    found = []
    for kind in kinds:
        result = make_run(load_scenario("fig6", [*askew, f"compliance={{{kind}}}"])).run()
        assert result.outcome == "completed"
        found.append([result.metrics[name].value for name in names])
    np.testing.assert_allclose(found, [[0.908, 1.156, 0.476], [0.464, 0.532, 0.226]], atol=2e-3)


def test_a_base_that_is_tilted_unknown_is_not_told() -> None:
    """Encoders know nothing of it: the grips are tilted, and told to be straight."""
    settings = [*SETTINGS, "imperfections.robot.base_roll_rad=0.01"]
    run = make_run(load_scenario("exact", settings))
    seen = run.cell.simulation.observe()
    true = run.cell.simulation.observer.roll_and_yaw(run.cell.simulation.data)[0, :, 0]
    assert np.abs(true).max() > 5e-3
    assert np.abs(run.cell.measured.aside(seen)[:, 1]).max() < 1e-3
