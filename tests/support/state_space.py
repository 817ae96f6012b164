"""Discrete linear systems, simulated."""

import numpy as np

from dualbend.stability.state_space import StateSpace
from dualbend.types import Vector


def simulate(system: StateSpace, inputs: Vector) -> Vector:
    """Return the outputs (n, outputs) to inputs (n, inputs) from rest, cycle by cycle."""
    state, out = np.zeros(system.a.shape[0]), np.empty((len(inputs), system.c.shape[0]))
    for cycle, given in enumerate(inputs):
        out[cycle] = system.c @ state + system.d @ given
        state = system.a @ state + system.b @ given
    return out
