"""The whole motion from outside: a path that is streamed is the path that the cell would run."""

import math
import re

import numpy as np
import pytest

from dualbend import InputError, load_scenario, make_run
from dualbend.run.planar import PlanarRun
from dualbend.run.record import RunRecord
from dualbend.scenario.sections import ServedArmConfig
from dualbend.serve.cell import ServedCell
from dualbend.serve.robot.protobuf import double, doubles, fields, message
from dualbend.types import SIDES
from support.rtde import free_robot_port, steered
from support.served import Answer, controllers, free_ports, served

SHORT = (
    *("motion.speed_rad_per_s=1.0", "path.end_rad=0.2", "motion.settle_s=0.2"),
    *("motion.hold_s=0.1", "guard.after_stop_s=0.1", "imperfections=none"),
)
STEPS = {"step_m": 0.02, "step_rad": 0.1}
"""A bending speed of 1 rad/s, which goes further in a cycle than the bounds allow by default."""


@pytest.fixture(scope="module")
def run() -> PlanarRun:
    made = make_run(load_scenario("fig8", SHORT))
    assert isinstance(made, PlanarRun)
    return made


def ahead(run: PlanarRun, cycle: int) -> np.ndarray:
    """Return x, z, α of the path when an answer to a cycle acts."""
    delay = run.scenario.robot.delay_of("left")
    assert delay == run.scenario.robot.delay_of("right") > 0
    return run.nominal_poses[min(cycle + delay, run.cycles - 1)]


def by_rsi(run: PlanarRun) -> Answer:
    """Stream the path as what leads from its start to where it is."""

    def answer(told: bytes) -> list[bytes]:
        ipoc = int(told.partition(b"<IPOC>")[2].partition(b"<")[0])
        x, z, turn = ahead(run, ipoc // 28 - 1) - run.nominal_poses[0]
        korr = f'X="{1e3 * x:.12f}" Z="{1e3 * z:.12f}" B="{math.degrees(turn):.12f}"'
        return [f"<Sen><RKorr {korr}/><IPOC>{ipoc}</IPOC></Sen>".encode()]

    return answer


def cycle_of(told: bytes) -> int:
    (header,) = (value for number, value in fields(told) if number == 1)
    assert isinstance(header, bytes)
    return next(value for number, value in fields(header) if number == 1)  # type: ignore[return-value]


def by_egm(run: PlanarRun) -> Answer:
    """Stream the path as poses."""

    def answer(told: bytes) -> list[bytes]:
        x, z, alpha = ahead(run, cycle_of(told)).tolist()
        orient = doubles(math.cos(0.5 * alpha), 0.0, math.sin(0.5 * alpha), 0.0)
        pose = message(1, doubles(1e3 * x, 0.0, 1e3 * z)) + message(2, orient)
        return [message(2, message(2, pose))]

    return answer


def by_egm_joints(run: PlanarRun, setpoints: np.ndarray) -> Answer:
    """Stream the path as joint angles."""

    def answer(told: bytes) -> list[bytes]:
        cycle = cycle_of(told) + run.scenario.robot.delay_of("left")
        angles = np.degrees(setpoints[min(cycle, len(setpoints) - 1)]).tolist()
        return [message(2, message(1, *(double(1, angle) for angle in angles)))]

    return answer


@pytest.fixture(scope="module")
def inside(run: PlanarRun) -> RunRecord:
    """The cell runs its path and nobody corrects it."""

    def still(told: bytes) -> list[bytes]:
        ipoc = told.partition(b"<IPOC>")[2].partition(b"<")[0]
        return [b"<Sen><RKorr/><IPOC>" + ipoc + b"</IPOC></Sen>"]

    with served(run) as (cell, go), controllers(cell, still, still):
        return go()


def test_a_streamed_path_is_the_path(run: PlanarRun, inside: RunRecord) -> None:
    """Left by RSI, right by EGM in poses, ahead by the transport delay."""
    arms = [
        ServedArmConfig(robot=robot, robot_port=port, sensor="none")  # type: ignore[arg-type]
        for robot, port in zip(("rsi", "egm"), free_ports(2), strict=True)
    ]
    with (
        served(run, left=arms[0], right=arms[1], path="outside", **STEPS) as (cell, go),
        controllers(cell, by_rsi(run), by_egm(run)),
    ):
        record = go()
    assert record.outcome == "completed", record.reason
    same(record, inside, 1e-9)


def same(record: RunRecord, inside: RunRecord, near: float) -> None:
    for side in SIDES:
        for name in (f"{side}_grip_x", f"{side}_grip_alpha", f"{side}_command_alpha"):
            np.testing.assert_allclose(record[name], inside[name], atol=near, err_msg=name)
    assert np.ptp(record["left_grip_alpha"]) > 0.1


def test_joint_guidance_is_the_same_path(run: PlanarRun, inside: RunRecord) -> None:
    arms = [ServedArmConfig(robot="egm", robot_port=port, sensor="none") for port in free_ports(2)]
    angles = inside.trace.setpoints
    own = [angles[:, run.cell.arms.joints(side)] for side in SIDES]
    with (
        served(run, left=arms[0], right=arms[1], path="outside", **STEPS) as (cell, go),
        controllers(cell, *(by_egm_joints(run, part) for part in own)),
    ):
        record = go()
    assert record.outcome == "completed", record.reason
    same(record, inside, 1e-6)


def test_servo_l_streams_the_path(run: PlanarRun, inside: RunRecord) -> None:
    arms = [
        ServedArmConfig(
            robot="rtde", robot_port=free_robot_port(), robot_address="127.0.0.1", sensor="none"
        )
        for _ in SIDES
    ]

    def target(numbers: list[float]) -> list[float]:
        x, z, alpha = ahead(run, round(numbers[0] / run.scenario.period_s) - 1).tolist()
        return [x, 0.0, z, 0.0, alpha, 0.0]

    with (
        served(run, left=arms[0], right=arms[1], path="outside", **STEPS) as (cell, go),
        steered(cell, target, "timestamp"),
    ):
        record = go()
    assert record.outcome == "completed", record.reason
    same(record, inside, 1e-9)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({}, r"a step of 0\.\d+ m, beyond serve\.step_m = 0\.005"),
        ({**STEPS, "limit_rad": 0.05}, r"a deviation of 0\.0\d+ rad, beyond serve\.limit_rad"),
    ],
)
def test_a_motion_out_of_bounds_is_refused_before_the_arm_moves_there(
    run: PlanarRun, keys: dict[str, float], said: str
) -> None:
    """Bounds are those of a step, and of what lies between the motion and the scenario's path."""

    def off(told: bytes) -> list[bytes]:
        cycle = int(told.partition(b"<IPOC>")[2].partition(b"<")[0]) // 28
        korr = f'X="{10 * cycle}"' if not keys else f'B="{cycle}"'
        return [f"<Sen><RKorr {korr}/><IPOC>{28 * cycle}</IPOC></Sen>".encode()]

    with (
        served(run, path="outside", **keys) as (cell, go),
        controllers(cell, off, by_rsi(run)),
    ):
        record = go()
    assert record.outcome == "protective_stop"
    assert re.search(said, record.reason), record.reason


def test_a_streamed_motion_needs_the_worlds_axes() -> None:
    keys = ["serve.path=outside", "robot.alter.mode=tool"]
    with pytest.raises(InputError, match=r'serve.path = "outside" streams whole poses .*"world"'):
        ServedCell(make_run(load_scenario("fig8", [*SHORT, *keys])))
