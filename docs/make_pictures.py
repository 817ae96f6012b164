"""Make the pictures of the README: the cell during ``fig8`` and the three figures of the paper.

Needs a GPU or Mesa's software renderer (``MUJOCO_GL=egl``). Run: ``python docs/make_pictures.py``.
"""

import os
from pathlib import Path

os.environ.setdefault("MUJOCO_GL", "egl")

import matplotlib as mpl
import mujoco
import numpy as np
from matplotlib.figure import Figure

from dualbend import RunRecord, load_scenario, make_run

mpl.use("Agg")
FOLDER = Path(__file__).parent / "images"


def run(name: str) -> RunRecord:
    """Run a shipped scenario."""
    return make_run(load_scenario(name)).run()


def picture_of_cell(result: RunRecord, alpha_rad: float, width: int, height: int) -> np.ndarray:
    """Render the cell at the first cycle whose nominal angle is ``alpha_rad``."""
    row = int(np.searchsorted(result.trace["nominal_alpha"], alpha_rad))
    data = mujoco.MjData(result.model)
    data.qpos[:] = result.trace.qpos[row]
    mujoco.mj_forward(result.model, data)
    option = mujoco.MjvOption()
    option.geomgroup[:] = (1, 1, 1, 0, 0, 0)
    option.sitegroup[:] = (0, 0, 0, 0, 0, 0)
    with mujoco.Renderer(result.model, height, width) as renderer:
        renderer.update_scene(data, camera="front", scene_option=option)
        return np.asarray(renderer.render())


def main() -> None:
    """Write ``docs/images/dualbend.png``."""
    results = {name: run(name) for name in ("fig6", "fig8", "fig9")}
    figure = Figure(figsize=(12.0, 7.4), layout="constrained")
    top, bottom = figure.subfigures(2, 1, height_ratios=(1.2, 1.0))
    for axes, alpha in zip(top.subplots(1, 2), (0.05, 0.95), strict=True):
        axes.imshow(picture_of_cell(results["fig8"], alpha, 1400, 860))
        axes.set_axis_off()
    titles = {
        "fig6": "no compliance (Fig. 6)",
        "fig8": "compliance (Fig. 8)",
        "fig9": "B/20 (Fig. 9)",
    }
    for axes, (name, title) in zip(bottom.subplots(1, 3), titles.items(), strict=True):
        trace = results[name].trace
        rows = trace["phase"] == results[name].phases.index("bend")
        alpha = trace["nominal_alpha"][rows]
        axes.plot(alpha, 1e3 * trace["left_measured_moment_y"][rows], color="0.8", linewidth=0.6)
        axes.plot(alpha, 1e3 * trace["left_true_moment_y"][rows], color="tab:blue")
        axes.set_title(title)
        axes.set_xlabel("bending angle [rad]")
        axes.grid(color="0.92")
        if name == "fig6":
            axes.set_ylabel("moment at the gripper [mN m]")
        if name != "fig9":
            axes.set_ylim(-20, 55)
    FOLDER.mkdir(exist_ok=True)
    figure.savefig(FOLDER / "dualbend.png", dpi=90)


if __name__ == "__main__":
    main()
