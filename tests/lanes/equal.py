"""How close a foreign controller comes to the built-in one on ``fig8``, and what that hangs on.

``python tests/lanes/equal.py --seeds 10``: largest difference of the true moments at the grips from
the built-in controller's, cycle by cycle, of every seed, by

* served: ``docs/examples/own_client.py`` over RSI and Net F/T, in a process of its own;
* built-in's moment: the paper's law on the built-in chain's own moment, which must be 0; and with a
  noise of 1e-8 rad on its answer;
* the same law on the raw reading, its tool's weight taken off by the measured pose of the cycle's
  start; of the reading's time, interpolated between two cycles; between three.

The exit code is 1 where served is beyond 0.05 mN m.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from dualbend import Observation, RunRecord, load_scenario, make_run
from dualbend.control.alter import turn
from dualbend.run.cell import believed_tool
from dualbend.run.loop import Run
from dualbend.scene.warnings import warnings_counted_only
from dualbend.serve.cell import ServedCell
from dualbend.serve.client import run_by_client
from dualbend.types import SIDES, Vector

CLIENT = Path(__file__).parents[2] / "docs" / "examples" / "own_client.py"
ALLOWED_NM, GRAVITY, LEVER_M, GAIN = 0.05e-3, 9.81, 0.12, 2.0 * np.pi / 180.0
AGE = 10.5 / 28.0
BACK = (
    [1.0],
    [1.0 - AGE, AGE],
    [(1.0 - AGE) * (2.0 - AGE) / 2.0, AGE * (2.0 - AGE), -AGE * (1.0 - AGE) / 2.0],
)
"""Weights of the last cycles' angles for the angle at a reading's time."""

Moment = Callable[[Observation], Vector]


def by_law(run: Run, moment: Moment, noise_rad: float = 0.0) -> RunRecord:
    """Run by the mean of the last two moments (2,), 2 degrees per N m."""
    rng, last = np.random.default_rng(1), list[Vector]()
    walk = run.walk()
    with warnings_counted_only():
        try:
            observed = next(walk)
            while True:
                last = [*last, moment(observed)][-2:]
                deviation = np.zeros((2, 6))
                deviation[:, 4] = GAIN * np.mean(last, axis=0) + noise_rad * rng.uniform(-1, 1, 2)
                observed = walk.send(deviation)
        except StopIteration as end:
            record: RunRecord = end.value
    return record


def from_reading(run: Run, cycles: int) -> Moment:
    """Return the moment from the raw reading and the measured angles of the last cycles."""
    tools = [believed_tool(run.scenario, run.cell.simulation.model, side) for side in SIDES]
    past: list[Vector] = []

    def moment(observed: Observation) -> Vector:
        angles = np.insert(observed.aside[:, 1:], 1, observed.measured.alpha_rad, axis=1)
        past.insert(0, angles)
        weights = BACK[min(cycles, len(past)) - 1]
        then = np.tensordot(weights, np.array(past[: len(weights)]), 1)
        found = np.empty(2)
        for i, (mass_kg, centre) in enumerate(tools):
            weight = -mass_kg * GRAVITY * turn(then[i])[2]
            force, torque = np.split(run.reading.sensor.components[i], 2)
            torque = torque - np.cross(centre, weight)
            found[i] = torque[1] + LEVER_M * (force - weight)[2]
        return found

    return moment


def own(observed: Observation) -> Vector:
    """Return the built-in chain's moments before the filter."""
    moments: Vector = observed.raw.components[:, 4]
    return moments


def served(run: Run) -> RunRecord:
    """Run by the example, over sockets."""
    cell = ServedCell(run, own_ports=True)
    with tempfile.TemporaryDirectory() as folder, cell.open() as lockstep:
        return run_by_client(cell, lockstep, f"{{python}} {CLIENT}", Path(folder))


def main() -> int:
    """Print a line each seed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=10)
    seeds, worst = range(1, parser.parse_args().seeds + 1), 0.0
    print("[mN m]    served built-in  + noise  1 cycle 2 cycles 3 cycles")
    for seed in seeds:
        run = make_run(load_scenario("fig8", seed=seed))
        before = run.run()
        records = [
            served(run),
            *(by_law(run, own, noise) for noise in (0.0, 1e-8)),
            *(by_law(run, from_reading(run, cycles)) for cycles in (1, 2, 3)),
        ]
        names = [f"{side}_true_moment_y" for side in SIDES]
        off = [max(np.abs(r[n] - before[n]).max() for n in names) for r in records]
        worst = max(worst, off[0])
        print(f"seed {seed:2}", *(f"{1e3 * value:8.2g}" for value in off), flush=True)
    return int(not worst <= ALLOWED_NM)


if __name__ == "__main__":
    sys.exit(main())
