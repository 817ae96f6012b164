"""Simulations that are no longer valid, by MuJoCo's warning counters."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import mujoco
import numpy as np
from numpy.typing import NDArray


class SimulationFailed(Exception):  # noqa: N818 - an outcome of a run
    """The simulation is no longer valid; the message says why."""


@contextmanager
def warnings_counted_only() -> Iterator[None]:
    """Keep MuJoCo from writing its warnings into a log file of the user's folder.

    They are counted in the data, and :func:`refuse_warnings` reads the counters.
    """
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda _: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


def refuse_warnings(counts: NDArray[np.int_]) -> None:
    """Raise SimulationFailed where any of MuJoCo's warning counters is above zero."""
    if np.count_nonzero(counts):
        kind = int(np.argmax(counts))
        name = mujoco.mjtWarning(kind).name.removeprefix("mjWARN_")
        raise SimulationFailed(f"MuJoCo warning {name} (counted {counts[kind]})")
