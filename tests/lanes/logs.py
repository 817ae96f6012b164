"""Other people's programs read what ``dualbend export --mcap`` writes, value for value.

``python tests/lanes/logs.py --python ENV/bin/python --node FOLDER``, where ENV has ``mcap==1.6.0
mcap-ros2-support==0.6.0 rosbags==0.11.9 pybag-sdk==0.13.0`` and FOLDER the npm packages
``@mcap/core @mcap/nodejs @mcap/support @foxglove/rosmsg @foxglove/rosmsg2-serialization``.

Of each reader: how many numbers of which it read the trace's own, to the last bit, and how many
others, poses' quaternions and places in the world, are those that it must have, to 1e-12. A line
each; the exit code is 1 where one differs.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from dualbend import RunRecord, load_run
from dualbend.types import SIDES, Vector

HERE = Path(__file__).parent
READERS = ("mcap_ros2", "rosbags", "pybag")
WRENCH = [f"{part}_{axis}" for part in ("force", "moment") for axis in "xyz"]
JOINTS = [f"joint{i}" for i in range(1, 7)]
CLOSE = 1e-12


def expected(run: RunRecord) -> tuple[dict[str, Vector], dict[str, Vector]]:
    """Return what must be read of each topic (rows, n): to the bit, and by other formulas."""

    def columns(*names: str) -> Vector:
        return np.column_stack([run[name] for name in names])

    joints = [(side, joint) for side in SIDES for joint in JOINTS]
    kinds = {kind: [f"{s}_{kind}_{j}" for s, j in joints] for kind in ("q", "torque", "setpoint")}
    exact = {
        "/joint_states": columns(*kinds["q"], *kinds["torque"]),
        "/joint_setpoints": columns(*kinds["setpoint"]),
        "/deviation": columns(*(f"{s}_deviation_{axis}" for s in SIDES for axis in ("x", "alpha"))),
    }
    close = {}
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        exact[f"/{side}/true_wrench"] = columns(*(f"{side}_true_{part}" for part in WRENCH))
        exact[f"/{side}/sensor_wrench"] = columns(*(f"{side}_sensor_{part}" for part in WRENCH))
        turned = 0.0 if side == "left" else np.pi
        alpha, yaw = run[f"{side}_grip_alpha"], run[f"{side}_grip_yaw"]
        pitch = np.arctan(np.tan(alpha) * np.cos(yaw))
        angles = np.column_stack((yaw + turned, pitch, run[f"{side}_grip_roll"]))
        place = columns(*(f"{side}_grip_{axis}" for axis in "xyz")) * (sign, sign, 1.0)
        axes = Rotation.from_euler("ZYX", angles).as_quat(canonical=False)
        close[f"/{side}/grip_pose"] = np.column_stack((place, axes))
        path = np.column_stack(
            (-sign * run["nominal_half_distance"], 0.0 * pitch, run["nominal_z"])
        )
        angles = np.column_stack((0.0 * pitch + turned, run["nominal_alpha"]))
        axes = Rotation.from_euler("ZY", angles).as_quat(canonical=False)
        close[f"/{side}/nominal_pose"] = np.column_stack((path, axes))
    return exact, close


def compare(run: RunRecord, read: Mapping[str, list[list[float]]]) -> tuple[int, int, float]:
    """Return how many numbers are exact, how many close, and how far the worst of all is off."""
    exact, close = expected(run)
    times = np.rint(1e9 * run["time"])
    counts, worst = [0, 0], 0.0
    for i, (wanted, allowed) in enumerate(((exact, 0.0), (close, CLOSE))):
        for topic, values in wanted.items():
            if topic not in read:
                continue
            found = np.array(read[topic])
            off = np.abs(found[:, 2:] - values).max()
            if not (found[:, :2] == times[:, np.newaxis]).all() or not off <= allowed:
                worst = max(worst, off, 1.0)
            counts[i] += values.size
    return counts[0], counts[1], worst


def main() -> int:
    """Export a run of ``fig8``, have it read, and compare."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--python", required=True, help="interpreter that has the readers")
    parser.add_argument("--node", help="folder with Foxglove's readers")
    given, failed = parser.parse_args(), False
    with tempfile.TemporaryDirectory() as folder:
        for command in (["run", "fig8", "--out", "run"], ["export", "run", "--mcap", "run.mcap"]):
            program = [sys.executable, "-m", "dualbend", *command]
            subprocess.run(program, cwd=folder, check=True, capture_output=True)
        log, run = str(Path(folder) / "run.mcap"), load_run(Path(folder) / "run")
        commands = {one: [given.python, str(HERE / "read_log.py"), one, log] for one in READERS}
        if given.node is not None:
            commands["Foxglove"] = ["node", str(HERE / "read_log.mjs"), log]
        for name, command in commands.items():
            cwd = given.node if name == "Foxglove" else folder
            told = subprocess.run(command, cwd=cwd, check=True, stdout=subprocess.PIPE, text=True)
            read = json.loads(told.stdout)
            exact, close, worst = compare(run, read)
            failed |= worst > 0.0
            print(
                f"{name}: {len(read)} topics, {exact} numbers to the bit, {close} to {CLOSE:g}"
                f"{'' if not worst else f'; WRONG by {worst:g}'}"
            )
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
