"""How far single precision alone leads a run away: MuJoCo against itself, its state rounded.

``python tests/lanes/single_precision.py fig8 --set imperfections=none`` replays what the drives of
a run were sent, with positions and speeds rounded to 24 bits after each physics step. It is the
control of ``dualbend benchmark fig8 --device cpu``, which prints the same deviations of MuJoCo Warp
(needs the extra ``gpu``, too).
"""

import argparse

import mujoco
import numpy as np

from dualbend.batch.gpu.benchmark import Played, deviations
from dualbend.batch.gpu.cycle import sampled
from dualbend.run.make import make_run
from dualbend.scenario.load import load_scenario


def main() -> None:
    """Print the deviations from the run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenario")
    parser.add_argument("--set", action="append", default=[], dest="settings")
    given = parser.parse_args()
    scenario = load_scenario(given.scenario, given.settings)
    played, run, found = Played(make_run(scenario)), make_run(scenario), []
    run.begin()
    simulation = run.cell.simulation
    model, data = simulation.model, simulation.data
    sensors = sampled(model)["sensordata"]
    for cycle, drives in enumerate(played.drives):
        if cycle in played.displaced:
            model.site_pos[:], model.site_quat[:] = played.displaced[cycle]
        for row in drives:
            data.ctrl[: len(row)] = row
            mujoco.mj_step(model, data)
            for act in simulation.on_step:
                act()
            data.qpos[:], data.qvel[:] = data.qpos.astype("f4"), data.qvel.astype("f4")
        found.append(-data.sensordata[sensors].reshape(2, 6))
    for name, value in deviations(np.array(found), played).items():
        print(f"{name:<28}{value:12.4g}")


if __name__ == "__main__":
    main()
