"""``fig6`` bent to each knot and held there: what the weight and what the imperfections leave."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Literal

import msgspec
import numpy as np

from dualbend.evaluation.metrics import held_rows, versions
from dualbend.evaluation.recorded_rod import recorded_rods
from dualbend.run.make import make_run
from dualbend.scenario.load import load_scenario
from dualbend.study.engine import Study
from dualbend.study.folder import StudyFolder
from dualbend.study.processes import in_processes
from dualbend.table import Table, quantity

KNOTS_RAD = (0.2, 0.4, 0.6, 0.8, 1.0)
_HOLD_S = 6.0

Preset = Literal["none", "typical"]
Key = tuple[float, Preset, int]
"""Knot, imperfections, seed."""


class Held(msgspec.Struct, frozen=True):
    """Mean moment on the left gripper over the hold's second half, and the rod's there [N m].

    ``rod_nm``: of the rod with weight between the recorded ends of the sheet; ``fixed_end_nm``:
    q L²/12, what the weight alone does at the grips of a flat sheet.
    """

    knot_rad: float
    preset: Preset
    seed: int
    moment_nm: float
    rod_nm: float
    fixed_end_nm: float

    @property
    def key(self) -> Key:
        """What the run is of."""
        return self.knot_rad, self.preset, self.seed


def hold_one(knot_rad: float, preset: Preset, seed: int) -> Held:
    """Bend to a knot and hold."""
    settings = (
        *(f"path.end_rad={knot_rad!r}", f"motion.hold_s={_HOLD_S!r}"),
        f"imperfections={preset}",
    )
    scenario = load_scenario("fig6", settings, seed)
    run = make_run(scenario).run()
    late = np.flatnonzero(held_rows(run))
    rods = recorded_rods(run, "edge", late[:: max(1, late.size // 8)])
    sheet = scenario.sheet.sheet()
    return Held(
        knot_rad=knot_rad,
        preset=preset,
        seed=seed,
        moment_nm=float(run["left_true_moment_y"][late].mean()),
        rod_nm=float(np.mean([rod.left.moment_nm for rod in rods])),
        fixed_end_nm=sheet.weight_per_length_n_per_m * sheet.length_m**2 / 12.0,
    )


def _design(seeds: int) -> Iterator[Key]:
    for knot in KNOTS_RAD:
        yield knot, "none", 1
        yield from ((knot, "typical", seed) for seed in range(1, seeds + 1))


def run_held(
    folder: Path,
    *,
    seeds: int,
    workers: int | None = None,
    on_run: Callable[[int, int, Held | None], None] = lambda *_: None,
) -> list[Held]:
    """Make the runs that the folder does not have yet; return all in order.

    Raises InputError where the folder is another study's or cannot be used.
    """
    study = Study(
        design=list(_design(seeds)), task=lambda key: key, run_one=hold_one, key=lambda row: row.key
    )
    about = {"versions": versions(), "fig6": load_scenario("fig6").to_toml()}
    return study.run(
        in_processes(workers), StudyFolder(folder=folder, row=Held, study=about), on_run
    )


def held_table(runs: list[Held]) -> Table:
    """Return each knot's moment in the perfect cell beside the rod's, and over seeds of typical."""
    columns = [
        quantity("knot", "rad", "g"),
        *(quantity(name, "mN m", ".1f") for name in ("rod with weight", "perfect cell")),
        *(quantity(name, "%", ".1f") for name in ("off", "off, of q L²/12")),
        *(
            quantity(f"typical, {said}", "mN m", ".0f")
            for said in ("smallest", "median", "largest")
        ),
    ]
    rows = []
    for knot in KNOTS_RAD:
        perfect = next(run for run in runs if run.key == (knot, "none", 1))
        typical = [
            1e3 * run.moment_nm for run in runs if (run.knot_rad, run.preset) == (knot, "typical")
        ]
        off = perfect.moment_nm - perfect.rod_nm
        rows.append(
            (
                *(knot, 1e3 * perfect.rod_nm, 1e3 * perfect.moment_nm),
                *(100.0 * off / abs(of) for of in (perfect.rod_nm, perfect.fixed_end_nm)),
                *np.quantile(typical, (0.0, 0.5, 1.0)).tolist(),
            )
        )
    return Table(columns, rows)
