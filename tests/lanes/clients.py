"""Programs of other people, unmodified, bend the sheet over ``dualbend serve``.

``python tests/lanes/clients.py --python ENV/bin/python``, where ENV has ``RSIPI==0.3.0
pynetft==2.1.3 netft==2.0.1 ABBRobotEGM==1.0.7 ur_rtde==1.6.5``; what runs there imports nothing of
this package.

* RSIPI moves the left arm by what it is told, and pynetft reads what the trace has;
* NetFT reads what the trace has, one record by request, beside an RSI socket;
* ABBRobotEGM with the paper's admittance makes the built-in controller's trace;
* with joint angles of the start it holds the arms there, whatever the scenario's path;
* ur_rtde, which receives both arms' forces and moves them by servoL, makes the built-in trace.

A line each; the exit code is 1 where a statement is not true.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from dualbend import load_run
from dualbend.run.record import RunRecord
from dualbend.types import SIDES

PERFECT = ("--set", "imperfections=none", "--no-record")
EGM = [
    *("--set", "serve.left.robot=egm", "--set", "serve.right.robot=egm"),
    *("--set", "serve.left.sensor=none", "--set", "serve.right.sensor=none"),
]
ALLOWED_NM, READ_NM, NEAR_RAD, TURN_DEG = 0.05e-3, 1e-9, 1e-7, 0.3
RTDE = [
    *("--set", "serve.left.robot=rtde", "--set", "serve.right.robot=rtde"),
    *("--set", "serve.left.sensor=none", "--set", "serve.right.sensor=none"),
]
OUTSIDE = [
    *("--set", "serve.path=outside", "--set", "serve.limit_m=1", "--set", "serve.limit_rad=1"),
]
NETFT_PORTS = [
    *("--set", "serve.left.robot_port=49154", "--set", "serve.left.sensor_port=49152"),
    *("--set", "serve.right.robot=none", "--set", "serve.right.sensor=none"),
]
AXES = ("force_x", "force_y", "force_z", "moment_x", "moment_y", "moment_z")

RSIPI = """
import json, time
import pynetft
from RSIPI.rsi_api import RSIAPI

if __name__ == "__main__":
    arms = [RSIAPI(f"rsi_{side}.xml", rsi_mode="absolute") for side in ("left", "right")]
    for arm in arms:
        arm.start()
    read, clients = {"left": {}, "right": {}}, []
    for side, port in (("left", 49162), ("right", 49163)):
        at = pynetft.Config(sensor_host="127.0.0.1", rdt_port=port, http_port=port + 10)
        note = lambda sample, side=side: read[side].setdefault(sample.ft_sequence, sample.wrench)
        clients.append(pynetft.Client(at, queue_size=1000, callback=note))
    for client in clients:
        client.start()
    for arm in arms:
        arm.wait_for_connection()
    arms[0].motion.update_cartesian(B=0.3)
    count = -1
    while count != len(read["left"]) or not count:
        count = len(read["left"])
        time.sleep(1.0)
    json.dump(read, open("read.json", "w"))
    for client in clients:
        client.stop()
    for arm in arms:
        arm.stop()
"""

EGM_START = """
import math
from ABBRobotEGM import EGM

arms = [EGM(6510), EGM(6511)]

def cycles():
    wait_s = 30.0
    while True:
        told = [arm.receive_from_robot(wait_s) for arm in arms]
        if not all(ok for ok, _ in told):
            return
        wait_s = 8.0
        yield [state for _, state in told]
"""

ABB = f"""{EGM_START}
AGE, MASS, X = 10.5 / 28.0, 0.61, 0.0478689
last = [None, None]
for told in cycles():
    for i, state in enumerate(told):
        slope = 2.0 * math.atan2(state.cartesian.orient[2], state.cartesian.orient[0])
        before, moment = last[i] or (slope, None)
        then, force = slope - AGE * (slope - before), state.measured_force
        weight = -MASS * 9.81 * math.cos(then)
        now = force[4] + X * weight + 0.12 * (force[2] - weight)
        mean = now if moment is None else (now + moment) / 2.0
        last[i], planned = (slope, now), state.cartesian_planned
        turn = math.radians(2.0 * mean)
        half = math.atan2(planned.orient[2], planned.orient[0]) + turn / 2.0
        arms[i].send_to_robot_cart(planned.pos, (math.cos(half), 0.0, math.sin(half), 0.0))
"""

HOLD = f"""{EGM_START}
first = None
for told in cycles():
    first = first or [state.joint_angles_planned for state in told]
    for arm, joints in zip(arms, first):
        arm.send_to_robot(joints)
"""

NETFT = """
import json, re, socket
from NetFT import Sensor

robot, sensor, read = socket.socket(socket.AF_INET, socket.SOCK_DGRAM), Sensor("127.0.0.1"), []
robot.bind(("127.0.0.1", 49154))
robot.settimeout(30.0)
while True:
    try:
        telegram, at = robot.recvfrom(8192)
    except TimeoutError:
        break
    robot.settimeout(8.0)
    read.append([count / 1e6 for count in sensor.getMeasurement()])
    ipoc = re.search(rb"<IPOC>.*</IPOC>", telegram)[0]
    robot.sendto(b"<Sen><RKorr/>" + ipoc + b"</Sen>", at)
json.dump(read, open("read.json", "w"))
"""

UR = """
import math, os
from rtde_control import RTDEControlInterface
from rtde_receive import RTDEReceiveInterface

NAMES = ["timestamp", "target_TCP_pose", "actual_TCP_force"]
hosts, arms, last, moments = ("127.0.0.1", "127.0.0.2"), [], 0.0, [None, None]
for host in hosts:
    arms.append((RTDEReceiveInterface(host, -1.0, NAMES), RTDEControlInterface(host)))
while True:
    for told, _ in arms:
        while told.getTimestamp() == last:
            if not told.isConnected():
                os._exit(0)  # its destructors connect again, to a robot that has gone
    last = arms[0][0].getTimestamp()
    for i, (told, commands) in enumerate(arms):
        now = told.getActualTCPForce()[4]
        mean = now if moments[i] is None else (now + moments[i]) / 2.0
        moments[i], target = now, told.getTargetTCPPose()
        target[4] += math.radians(2.0 * mean)
        commands.servoL(target, 0.5, 0.5, 0.002, 0.1, 300)
"""


@contextmanager
def serving(folder: Path, *arguments: str) -> Iterator[None]:
    """Serve ``fig8`` into ``folder/run``, and wait for its end."""
    command = [sys.executable, "-m", "dualbend", "serve", "fig8", "--out", "run", *PERFECT]
    with subprocess.Popen(
        [*command, *arguments], cwd=folder, stdout=subprocess.PIPE, text=True
    ) as cell:
        assert cell.stdout is not None
        for line in cell.stdout:
            if line.startswith("start your controller"):
                break
        yield
        cell.communicate(timeout=120.0)


def client(python: str, folder: Path, code: str) -> None:
    """Run a program of the other environment."""
    (folder / "client.py").write_text(code, encoding="utf-8")
    done = subprocess.run(
        [python, "client.py"], cwd=folder, timeout=120.0, env={}, capture_output=True, check=False
    )
    if done.returncode:
        sys.exit(done.stderr.decode()[-2000:])


def served(folder: Path) -> RunRecord:
    """Return the run that was served; it has to have gone to its end."""
    run = load_run(folder / "run")
    if run.outcome != "completed":
        sys.exit(f"{run.outcome}: {run.reason}")
    return run


def rsipi(python: str, folder: Path) -> dict[str, float]:
    """Return how far the arm's turn and the readings are from what was sent and recorded."""
    with serving(folder, "--configs", "."):
        client(python, folder, RSIPI)
    run, read = served(folder), json.loads((folder / "read.json").read_text())
    turns = np.unique(run["left_deviation_alpha"])
    worst = max(
        abs(value - run[f"{side}_sensor_{axis}"][int(number) - 1])
        for side in SIDES
        for number, wrench in read[side].items()
        for axis, value in zip(AXES, wrench, strict=True)
    )
    missed = float(np.abs(turns - np.radians([0.0, TURN_DEG])).max()) if len(turns) == 2 else np.inf
    return {"RSIPI, turn [rad]": missed, "pynetft, reading [N, N m]": worst}


def netft(python: str, folder: Path) -> dict[str, float]:
    """Return how far the readings are from what was recorded, one a cycle."""
    with serving(folder, *NETFT_PORTS):
        client(python, folder, NETFT)
    run, read = served(folder), json.loads((folder / "read.json").read_text())
    recorded = np.stack([run[f"left_sensor_{axis}"] for axis in AXES], axis=1)
    worst = np.abs(np.array(read) - recorded).max() if len(read) == len(recorded) else np.inf
    return {"NetFT, reading [N, N m]": float(worst)}


def abb(python: str, folder: Path) -> dict[str, float]:
    """Return how far the trace is from the built-in controller's."""
    with serving(folder, *EGM):
        client(python, folder, ABB)
    return {"ABBRobotEGM, moment [N m]": from_built_in(folder)}


def hold(python: str, folder: Path) -> dict[str, float]:
    """Return how far the commands are from the start, in joint guidance."""
    with serving(folder, *EGM, *OUTSIDE):
        client(python, folder, HOLD)
    run = served(folder)
    turns = np.stack([run[f"{side}_command_alpha"] for side in SIDES])
    there = float(np.abs(turns - run["nominal_alpha"][0]).max())
    return {"ABBRobotEGM, joints, turn [rad]": there}


def ur(python: str, folder: Path) -> dict[str, float]:
    """Return the same of ur_rtde."""
    with serving(folder, *RTDE):
        client(python, folder, UR)
    return {"ur_rtde, moment [N m]": from_built_in(folder)}


def from_built_in(folder: Path) -> float:
    """Return the largest difference of the moments of ``folder/run`` from the built-in ones."""
    command = [sys.executable, "-m", "dualbend", "run", "fig8", "--out", "built-in", *PERFECT]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    run, built_in = served(folder), load_run(folder / "built-in")
    names = [f"{side}_true_moment_y" for side in SIDES]
    return float(max(np.abs(run[name] - built_in[name]).max() for name in names))


def main() -> int:
    """Run all and compare with what is allowed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--python", required=True, help="interpreter that has the clients")
    python, failed = parser.parse_args().python, False
    for case in (rsipi, netft, abb, hold, ur):
        with tempfile.TemporaryDirectory() as folder:
            for name, value in case(python, Path(folder)).items():
                allowed = ALLOWED_NM if "moment" in name else READ_NM
                allowed = NEAR_RAD if "joints" in name else allowed
                failed |= not value <= allowed
                print(f"{name}: {value:.3g} of {allowed:g}")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
