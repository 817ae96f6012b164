"""Nominal set-points of a motion, solved by mink before it runs, and kept for motions alike."""

from __future__ import annotations

import hashlib
from collections import OrderedDict

import mujoco
import numpy as np

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.errors import InputError
from dualbend.scene.ik import InverseKinematics, grip_targets
from dualbend.types import SIDES, Vector

_KNOT_S = COMMAND_PERIOD_S
"""Longest time between two poses that mink solves; cycles between them lie on straight lines."""

_KEPT = 16
_solved: OrderedDict[bytes, Vector] = OrderedDict()


class OutOfReachError(InputError):
    """A pose of a motion has no joint angles; ``cycle`` is the first one of which that is so."""

    def __init__(self, cycle: int, why: str) -> None:
        super().__init__(why)
        self.cycle = cycle


def nominal_setpoints(
    ik: InverseKinematics, poses: Vector, home: Vector, period_s: float
) -> Vector:
    """Return the joint angles (cycles, n) of both grips at poses (cycles, 3), mirrored.

    Poses are x, z [m] and α [rad] in the bending frames; ``home`` are angles of the first one.
    Solved once in a process for the same robots and poses, every cycle of 28 ms; of shorter ones
    every few, with straight lines between.

    Raises
    ------
    OutOfReachError
        A pose cannot be reached.
    """
    model = np.empty(mujoco.mj_sizeModel(ik.model), dtype=np.uint8)
    mujoco.mj_saveModel(ik.model, None, model)
    named = (model, poses, home, np.array(period_s))
    key = hashlib.sha256(b"".join(array.tobytes() for array in named)).digest()
    if key not in _solved:
        every = max(int(_KNOT_S / period_s + 1e-9), 1)
        knots = np.unique([*range(0, len(poses), every), len(poses) - 1])
        solved, cycles = _solve(ik, poses, home, knots.tolist()), np.arange(len(poses))
        _solved[key] = np.column_stack([np.interp(cycles, knots, q) for q in solved.T])
        _solved[key].flags.writeable = False
    _solved.move_to_end(key)
    while len(_solved) > _KEPT:
        _solved.popitem(last=False)
    return _solved[key]


def _solve(ik: InverseKinematics, poses: Vector, home: Vector, knots: list[int]) -> Vector:
    found: list[Vector] = []
    last = before = home
    at = None
    for cycle in knots:
        if at is None or not np.array_equal(poses[cycle], poses[at]):
            targets = grip_targets(np.tile(poses[cycle], (len(SIDES), 1)))
            solution = ik.solve(targets, 2.0 * last - before)
            if not solution.reached:
                raise OutOfReachError(cycle, ik.describe_miss(solution))
            before, last, at = last, solution.q, cycle
        found.append(last)
    return np.array(found)
