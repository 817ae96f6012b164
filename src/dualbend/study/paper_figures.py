"""The paper's Figs. 6, 8 and 9 from scratch: run, draw in its layout, put on one page."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from dualbend.report.canvas import Figure, mpl, own_style
from dualbend.report.figures import ANGLE, draw, legend_below, save
from dualbend.report.moment import knots_of, moment_curves, moment_plot
from dualbend.report.page import PAPER_FIGURES, write_report
from dualbend.report.plot import Axis, Plot, common, shared
from dualbend.run.disk.folder import run_folder
from dualbend.run.disk.output import write_numbers
from dualbend.run.disk.saved import load_run
from dualbend.run.make import make_run
from dualbend.run.record import RunRecord
from dualbend.scenario.load import load_scenario
from dualbend.study.engine import Study
from dualbend.study.processes import in_processes

PROCESSES = 2
FORMATS = ("png", "svg")

MOMENT = Axis("moment at the gripper", "mN m")


def make_figures(
    out: Path,
    settings: Sequence[str] = (),
    on_done: Callable[[RunRecord], None] = lambda _: None,
) -> list[RunRecord]:
    """Run the three scenarios into ``out`` and write pictures and page; return the runs.

    ``settings``: what is set otherwise in all three, as ``--set`` has it. ``out`` gets a folder for
    each run, ``fig6``, ``fig8``, ``fig9`` and ``figures`` as PNG and SVG, and ``report.html``.
    ``on_done`` is called with each run as it is done. Raises InputError where ``out`` cannot be
    written to, or a process died.
    """
    folders = {name: out / name for name in PAPER_FIGURES}
    for name, folder in folders.items():
        load_scenario(name, settings)
        with run_folder(folder):
            pass
    study = Study(
        design=list(folders),
        task=lambda name: (name, tuple(settings), folders[name]),
        run_one=_run,
        key=str,
    )

    def tell(_: int, __: int, name: str | None) -> None:
        if name is not None:
            on_done(load_run(folders[name]))

    names = study.run(in_processes(PROCESSES), on_run=tell)
    runs = [load_run(folders[name]) for name in names]
    write_pictures(runs, out)
    write_report(list(folders.values()), out / "report.html")
    return runs


def _run(name: str, settings: Sequence[str], folder: Path) -> str:
    """Run a scenario, leave what a report is made from, and return its name."""
    result = make_run(load_scenario(name, settings)).run()
    with run_folder(folder) as kept:
        write_numbers(result, kept)
    return name


@own_style()
def write_pictures(runs: Sequence[RunRecord], out: Path) -> None:
    """Write each run's figure and all beside each other as PNG and SVG.

    Beside each other, runs of like size are on one scale: Figs. 6 and 8, without what oscillates.

    Raises InputError where a file cannot be written.
    """
    mpl.rcParams["svg.hashsalt"] = "dualbend"  # the same file from the same run
    plots = [_plot(run) for run in runs]
    for run, plot in zip(runs, plots, strict=True):
        figure = Figure(figsize=(5.6, 3.8), layout="constrained")
        axes = figure.add_subplot()
        draw(axes, plot)
        legend_below(figure, axes, 4)
        _save(figure, out / run.scenario.name)
    figure = Figure(figsize=(12.0, 4.2), layout="constrained")
    panels = figure.subplots(1, len(runs), sharex=True, squeeze=False)[0]
    scales = shared([common([curve.y for curve in plot.curves]) for plot in plots])
    for axes, plot, scale in zip(panels, plots, scales, strict=True):
        draw(axes, replace(plot, y=replace(plot.y, range=scale)))
    for axes in panels[1:]:
        axes.set_ylabel("")
    legend_below(figure, panels[0], 4)
    _save(figure, out / "figures")


def _plot(run: RunRecord) -> Plot:
    name = run.scenario.name
    paper = PAPER_FIGURES.get(name)
    return moment_plot(
        moment_curves(run),
        knots_of(run.scenario),
        axes=(ANGLE, MOMENT),
        title=f"{paper}: {name}" if paper else name,
    )


def _save(figure: Figure, stem: Path) -> None:
    for kind in FORMATS:
        # No date: the same run leaves the same bytes.
        metadata = {"Date": None} if kind == "svg" else None
        save(figure, stem.with_name(f"{stem.name}.{kind}"), metadata=metadata)
