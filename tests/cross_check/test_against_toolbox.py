"""The PUMA 560 against the Robotics Toolbox: kinematics, mass matrix, gravity, velocity torques."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pytest
from cross_check_rows import Report
from numpy.typing import NDArray

from dualbend.arm import mjcf as arm
from dualbend.beam.sheet import GRAVITY_M_PER_S2
from dualbend.validation import dh

Vector = NDArray[np.float64]

CODE = "Robotics Toolbox"
CONFIGURATIONS = 40
TOLERANCE = 1e-6
"""Asked for."""
GRAVITY = [0.0, 0.0, -GRAVITY_M_PER_S2]
"""In RTB 1.5 the acceleration of a falling body, upwards in earlier releases."""


@pytest.fixture(scope="module")
def fed(roboticstoolbox: Any) -> Any:
    """RTB's robot with the parameters of models/puma560, armature as motor inertia at gear 1."""
    links = [
        roboticstoolbox.RevoluteDH(
            d=link.d_m,
            a=link.a_m,
            alpha=link.alpha_rad,
            m=link.mass_kg,
            r=link.com_m,
            I=[*link.inertia_kg_m2, 0.0, 0.0, 0.0],
            Jm=link.armature_kg_m2,
            G=1.0,
        )
        for link in dh.PUMA560
    ]
    robot = roboticstoolbox.DHRobot(links, name="fed", gravity=GRAVITY)
    robot.tool = _along_z(dh.FLANGE_OFFSET_M)
    return robot


def _along_z(distance: float) -> Any:
    from spatialmath import SE3

    return SE3(0.0, 0.0, distance)


def _states() -> tuple[Vector, Vector]:
    rng = np.random.default_rng(31)
    ranges = np.array([link.range_rad for link in dh.PUMA560])
    angles = rng.uniform(ranges[:, 0], ranges[:, 1], (CONFIGURATIONS, 6))
    return angles, rng.uniform(-2.0, 2.0, (CONFIGURATIONS, 6))


def _mujoco(angles: Vector, rates: Vector) -> dict[str, Vector]:
    """Return what the simulated arm has: flange pose, gravity and velocity torques, mass matrix."""
    spec = arm.load_puma()
    spec.option.gravity = [0.0, 0.0, -GRAVITY_M_PER_S2]
    model = spec.compile()
    data, inertia = mujoco.MjData(model), np.zeros((6, 6))
    found: dict[str, list[Vector]] = {k: [] for k in ("pose", "gravity", "mass", "velocity")}
    for q, qd in zip(angles, rates, strict=True):
        data.qpos[:], data.qvel[:] = q, 0.0
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, inertia)
        flange = data.site(arm.FLANGE_SITE)
        found["pose"].append(np.column_stack([flange.xmat.reshape(3, 3), flange.xpos]))
        rest = data.qfrc_bias.copy()
        data.qvel[:] = qd
        mujoco.mj_forward(model, data)
        found["gravity"].append(rest)
        found["mass"].append(inertia.copy())
        found["velocity"].append(data.qfrc_bias - rest)
    return {name: np.array(values) for name, values in found.items()}


def _toolbox(robot: Any, angles: Vector, rates: Vector) -> dict[str, Vector]:
    pairs = list(zip(angles, rates, strict=True))
    return {
        "pose": np.array([robot.fkine(q).A[:3] for q in angles]),
        "gravity": np.array([robot.gravload(q) for q in angles]),
        "mass": np.array([robot.inertia(q) for q in angles]),
        "velocity": np.array([robot.coriolis(q, qd) @ qd for q, qd in pairs]),
    }


def _theory(angles: Vector, rates: Vector) -> dict[str, Vector]:
    table, armature = dh.puma(), np.diag([link.armature_kg_m2 for link in dh.PUMA560])
    pairs = zip(angles, rates, strict=True)
    return {
        "pose": np.array([table.flange_pose(q)[:3] for q in angles]),
        "gravity": np.array([table.gravity_torque(q) for q in angles]),
        "mass": np.array([table.mass_matrix(q) + armature for q in angles]),
        "velocity": np.array([table.velocity_torque(q, qd) for q, qd in pairs]),
    }


NAMES = {
    "pose": ("flange pose", "1, m"),
    "gravity": ("gravity torque", "N m"),
    "mass": ("mass matrix", "kg m²"),
    "velocity": ("Coriolis and centrifugal torque", "N m"),
}


def _far(found: Vector, wanted: Vector) -> tuple[int, ...]:
    """Return where two arrays are furthest apart."""
    return tuple(np.unravel_index(np.argmax(np.abs(found - wanted)), found.shape))


def test_the_arm_fed_with_the_same_parameters(fed: Any, report: Report) -> None:
    angles, rates = _states()
    run = report.run(CODE, f"fed with the same parameters, {CONFIGURATIONS} random poses")
    project = run.timed("project", lambda: _mujoco(angles, rates))
    theory = run.timed("theory", lambda: _theory(angles, rates))
    other = run.timed("other", lambda: _toolbox(fed, angles, rates))
    for name, (label, unit) in NAMES.items():
        at = _far(other[name], project[name])
        scale = float(np.abs(theory[name]).max())
        row = run.row(
            f"{label}, over the largest",
            "where they differ most",
            unit,
            found=other[name][at],
            project=project[name][at],
            theory=theory[name][at],
            scale=scale,
            asked=TOLERANCE,
        )
        # Asked for: 1e-6. Analytic, three recursions of one table: rounding only.
        assert row.within(1e-9)
        np.testing.assert_allclose(other[name], theory[name], rtol=0.0, atol=1e-9 * scale)


def test_the_toolbox_own_table_but_for_stated_differences(
    roboticstoolbox: Any, report: Report
) -> None:
    """RTB's Puma560 as shipped; three numbers of models/puma560 are not RTB's (its README)."""
    angles, rates = _states()
    project, theory = _mujoco(angles, rates), _theory(angles, rates)
    own = roboticstoolbox.models.DH.Puma560()
    own.gravity = GRAVITY
    # 1. RTB's frame 0 is on the floor, 0.67183 m below; 2. it ends at the wrist centre.
    floor = np.array([0.0, 0.0, 0.67183])
    wrist = np.array([own.fkine(q).A[:3] for q in angles])
    wrist[:, :, 3] += dh.FLANGE_OFFSET_M * wrist[:, :, 2] - floor
    # Analytic.
    np.testing.assert_allclose(wrist, project["pose"], atol=1e-9)
    run = report.run(CODE, "the toolbox's own table, differences stated")
    gravity = np.array([own.gravload(q) for q in angles])
    scale = float(np.abs(theory["gravity"]).max())
    at = _far(gravity, project["gravity"])
    row = run.row(
        "gravity torque, over the largest",
        "where they differ most",
        "N m",
        found=gravity[at],
        project=project["gravity"][at],
        theory=theory["gravity"][at],
        scale=scale,
        asked=TOLERANCE,
    )
    assert row.within(1e-9)
    at = (0, 1, 1)
    run.row(
        "mass matrix (2, 2): its Jm G² and Iyy of link 3 are others",
        "first pose",
        "kg m²",
        found=own.inertia(angles[0])[1, 1],
        project=project["mass"][at],
        theory=theory["mass"][at],
    )
    # 3. Motor inertia Jm G² for AKB's measured armature; 4. the repaired Iyy of link 3.
    for link, given in zip(own.links, dh.PUMA560, strict=True):
        link.Jm, link.G, link.B, link.Tc = given.armature_kg_m2, 1.0, 0.0, [0.0, 0.0]
    own.links[2].I = [*dh.PUMA560[2].inertia_kg_m2, 0.0, 0.0, 0.0]
    changed = _toolbox(own, angles, rates)
    for name in ("mass", "velocity"):
        at = _far(changed[name], project[name])
        row = run.row(
            f"{NAMES[name][0]} after exchanging these two, over the largest",
            "where they differ most",
            NAMES[name][1],
            found=changed[name][at],
            project=project[name][at],
            theory=theory[name][at],
            scale=float(np.abs(theory[name]).max()),
            asked=TOLERANCE,
        )
        assert row.within(1e-9)
