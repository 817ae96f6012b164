"""One HTML page from the folders of runs: it opens offline and says everything of them."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from dualbend.errors import writing
from dualbend.evaluation.sheet import no_theory
from dualbend.files import write_whole
from dualbend.report.bokeh import library, plots_data
from dualbend.report.moment import (
    ANGLE,
    MOMENT,
    bending_rows,
    describe_peak,
    knots_of,
    moment_curves,
    moment_plot,
)
from dualbend.report.over_time import OverTime
from dualbend.report.plot import common, shared
from dualbend.report.section import Chapter, Figure, Panels, Section, Verdict, Warned
from dualbend.report.sections.summary import arms_section, sheet_section
from dualbend.report.sections.tables import (
    ended,
    metrics_section,
    origin_section,
    settings_section,
)
from dualbend.report.sections.time import phase_section, wrench_section
from dualbend.report.template import asset, inside, markdown, render
from dualbend.resources import limitations_file
from dualbend.run.disk.saved import load_run
from dualbend.run.record import RunRecord

PAPER_FIGURES = {"fig6": "Fig. 6", "fig8": "Fig. 8", "fig9": "Fig. 9"}
"""Shipped scenarios that are a figure of the paper."""

_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "img-src data: blob:; font-src data:"
)
"""The browser itself refuses whatever a page would fetch from outside."""


def write_report(folders: Sequence[Path], out: Path) -> None:
    """Write the report of the runs in ``folders``.

    Raises InputError where a folder is no run that can be read, or ``out`` cannot be written.
    """
    runs = [load_run(folder, unfinished=True) for folder in folders]
    text = report(runs)
    with writing(out, "--out"):
        out.parent.mkdir(parents=True, exist_ok=True)
        write_whole(out, text)


def report(runs: Sequence[RunRecord]) -> str:
    """Return the page."""
    names = run_names(runs)
    chapters = [chapter(run, name) for run, name in zip(runs, names, strict=True)]
    if len(runs) > 1:
        chapters.insert(0, Chapter("Side by side", [], _side_by_side(runs, names)))
    limitations = markdown(limitations_file().read_text(encoding="utf-8"))
    chapters.append(Chapter("Known limitations", [limitations], []))
    return page_of(", ".join(names), chapters)


def page_of(title: str, chapters: Sequence[Chapter]) -> str:
    """Return a page of its own with these chapters: styles, scripts and plots are in it."""
    figures = [figure for chapter in chapters for figure in chapter.figures]
    places = {figure: f"plot-{i}" for i, figure in enumerate(figures)}
    return render(
        "page.html.j2",
        title=title,
        version=importlib.metadata.version("dualbend"),
        policy=_POLICY,
        chapters=chapters,
        places=places,
        plots=plots_data({place: figure.plot for figure, place in places.items()}),
        style=asset("report.css", "style"),
        library=inside(library(), "script"),
        script=asset("report.js", "script"),
    )


def run_names(runs: Sequence[RunRecord]) -> list[str]:
    """Return the scenarios' names, with the folder where two runs have one name."""
    names = [run.scenario.name for run in runs]
    return [
        name if names.count(name) == 1 else f"{name} ({run.folder})"
        for name, run in zip(names, runs, strict=True)
    ]


def chapter(run: RunRecord, name: str) -> Chapter:
    """Return what the page says of one run."""
    verdict = Verdict(ended(run), run.expected, run.summary.seed)
    found = [
        *run.task.part("report")(run),
        *(sheet_section(run), arms_section(run), settings_section(run), origin_section(run)),
    ]
    sections = [section for section in found if section is not None]
    warned = [Warned(warning) for warning in run.summary.warnings]
    return Chapter(name, [run.scenario.description, verdict, *warned], sections)


def common_sections(run: RunRecord) -> list[Section | None]:
    """Return the sections of a task that has none of its own."""
    over_time = OverTime(run)
    metrics = metrics_section([run], ["value"], "over all phases")
    return [metrics, phase_section(over_time), wrench_section(over_time)]


def _side_by_side(runs: Sequence[RunRecord], names: Sequence[str]) -> list[Section]:
    """Return the moments of all runs, those of like size on one scale, and their metrics."""
    bent = [(run, name) for run, name in zip(runs, names, strict=True) if bending_rows(run).size]
    metrics = metrics_section(runs, names, "over the phases that each run's own table names")
    return [_moments(bent), metrics] if bent else [metrics]


def _moments(bent: Sequence[tuple[RunRecord, str]]) -> Section:
    curves = [moment_curves(run) for run, _ in bent]
    every = [curve for of_run in curves for curve in of_run]
    angle = replace(ANGLE, range=common([curve.x for curve in every], 0.01))
    scales = shared([common([curve.y for curve in of_run]) for of_run in curves])
    figures = []
    for (run, name), of_run, scale in zip(bent, curves, scales, strict=True):
        paper = PAPER_FIGURES.get(run.scenario.name)
        title = f"{name}, the paper's {paper}" if paper else name
        axes = (angle, replace(MOMENT, range=scale))
        figures.append(
            Figure(
                moment_plot(of_run, knots_of(run.scenario), axes=axes, title=title),
                f"{title}: {describe_peak(of_run[2])}{_by_piece(run)}.",
                f"Moment over bending angle of {name}. "
                + "; ".join(describe_peak(curve) for curve in of_run),
            )
        )
    words = (
        "Moment at the sensing gripper over the bending angle. Runs whose moments are of like size "
        "are on one scale, larger ones on another; zooming one zooms those of its scale. The "
        "reference solution does not comply: it is the moment on the nominal path. "
        + " ".join(
            f"{name}: {without}" for run, name in bent if (without := no_theory(run.scenario))
        )
    )
    return Section("Moment over bending angle", [words, Panels(figures)])


def _by_piece(run: RunRecord) -> str:
    metric = run.summary.metrics.get("peak_moment_by_piece")
    if metric is None or not isinstance(metric.value, list):
        return ""
    peaks = ["–" if peak is None else f"{1e3 * peak:.1f}" for peak in metric.value]
    return f"; by piece of the path {', '.join(peaks)} mN m"
