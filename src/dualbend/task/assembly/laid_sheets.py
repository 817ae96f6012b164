"""Where the sheets of a book lie, read from the trace: what was laid does not move any more."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from dualbend.run.loop import RunResult
from dualbend.scene.bed.mjcf import laid_body
from dualbend.scene.sheet.strips import strip_body


def supply_rows(result: RunResult) -> NDArray[np.intp]:
    """Return the rows in which the next sheet is on the stand: one fewer than sheets were laid.

    In the row before each of them the sheet is where it stays.
    """
    if result.scenario.assembly is None:
        return np.array([], dtype=np.intp)
    return 1 + np.flatnonzero(np.diff(result.trace["sheet"]) > 0.0)


def show_laid(model: mujoco.MjModel, data: mujoco.MjData, result: RunResult, row: int) -> None:
    """Put the plates of the sheets that are laid by ``row`` where they rest; ``data`` is forwarded.

    ``data.qpos`` is changed.
    """
    if result.scenario.assembly is None:
        return
    for number, supplied in enumerate(supply_rows(result)):
        if supplied > row:
            return
        data.qpos[:] = result.trace.qpos[supplied - 1]
        mujoco.mj_kinematics(model, data)
        for i in range(result.scenario.sheet.model.sections + 1):
            mocap = model.body_mocapid[model.body(laid_body(number, i)).id]
            strip = model.body(strip_body(i)).id
            # A strip's centre of mass is its plate's middle.
            data.mocap_pos[mocap] = data.xipos[strip]
            data.mocap_quat[mocap] = data.xquat[strip]
