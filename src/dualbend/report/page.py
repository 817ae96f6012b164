"""One HTML page from the folders of runs: it opens offline and says everything of them."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path

from dualbend.errors import InputError
from dualbend.evaluation.sheet import no_theory
from dualbend.report.assembly import holes_section, object_section, pins_section
from dualbend.report.bending import (
    describe_peak,
    moment_plot,
    moment_section,
    path_section,
    shape_section,
)
from dualbend.report.data import bending_rows, nominal_lines
from dualbend.report.html import Html, element, join, markdown
from dualbend.report.parts import Pictures, Section, note, side_by_side
from dualbend.report.plots import Plot, Ranges, common, library, plots_json
from dualbend.report.stability import own_compliance_section, stability_section
from dualbend.report.summary import arms_section, sheet_section
from dualbend.report.tables import ended, metrics_table, origin_section, settings_section
from dualbend.report.time import (
    deviation_section,
    misalignment_section,
    phase_section,
    time_range,
    wrench_section,
)
from dualbend.resources import limitations_file
from dualbend.run.record import RunRecord
from dualbend.run.saved import load_run

PAPER_FIGURES = {"fig6": "Fig. 6", "fig8": "Fig. 8", "fig9": "Fig. 9"}
"""Shipped scenarios that are a figure of the paper."""

_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "img-src data: blob:; font-src data:"
)
"""The browser itself refuses whatever a page would fetch from outside."""


def write_report(folders: Sequence[Path], out: Path) -> None:
    """Write the report of the runs in ``folders``.

    Raises
    ------
    InputError
        A folder is no run that can be read, or ``out`` cannot be written.
    """
    runs = [load_run(folder, unfinished=True) for folder in folders]
    text = report(runs)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"--out {out}: cannot be written: {error.strerror or error}") from error


def report(runs: Sequence[RunRecord]) -> str:
    """Return the page."""
    pictures, names = Pictures(), run_names(runs)
    chapters = [(name, _chapter(run, pictures)) for name, run in zip(names, runs, strict=True)]
    if len(runs) > 1:
        chapters.insert(0, ("Side by side", _side_by_side(runs, names, pictures)))
    chapters.append(("Known limitations", [_limitations()]))
    return _document(", ".join(names), _body(chapters), pictures.plots)


def run_names(runs: Sequence[RunRecord]) -> list[str]:
    """Return the scenarios' names, with the folder where two runs have one name."""
    names = [run.scenario.name for run in runs]
    return [
        name if names.count(name) == 1 else f"{name} ({run.folder})"
        for name, run in zip(names, runs, strict=True)
    ]


def _chapter(run: RunRecord, pictures: Pictures) -> list[Section]:
    shared = time_range(run)
    lead = Section(title="", body=join([note(run.scenario.description), _verdict(run)]))
    metrics = Section(title="Metrics", body=metrics_table([run], ["value"]))
    found: list[Section | None] = [lead]
    if run.scenario.assembly is None:
        found += [
            moment_section(run, pictures),
            metrics,
            path_section(run, pictures),
            shape_section(run, pictures),
            wrench_section(run, pictures, shared),
            misalignment_section(run, pictures, shared),
            deviation_section(run, pictures, shared),
            phase_section(run, pictures, shared),
            own_compliance_section(run.controller)
            if run.controller
            else stability_section(run.scenario, pictures),
        ]
    else:
        found += [
            holes_section(run, pictures, shared),
            metrics,
            pins_section(run, pictures, shared),
            phase_section(run, pictures, shared),
            wrench_section(run, pictures, shared),
            object_section(run, pictures, shared),
            moment_section(run, pictures),
            path_section(run, pictures),
            shape_section(run, pictures),
        ]
    found += [sheet_section(run), arms_section(run), settings_section(run), origin_section(run)]
    return [section for section in found if section is not None]


def _verdict(run: RunRecord) -> Html:
    expected = run.outcome in run.scenario.expect.outcome
    mark = "expected" if expected else "unexpected"
    text = join([element("strong", ended(run)), f" ({mark}), seed {run.summary.seed}"])
    return element("p", text, class_=f"verdict {mark}")


def _side_by_side(
    runs: Sequence[RunRecord], names: Sequence[str], pictures: Pictures
) -> list[Section]:
    """Return the paper's figures on one scale and the metrics of all runs."""
    bent = [(run, name) for run, name in zip(runs, names, strict=True) if bending_rows(run).size]
    lines = [nominal_lines(run) for run, _ in bent]
    sections = []
    if bent:
        every = [line for of_run in lines for line in of_run]
        ranges = Ranges(
            x=common([line.x for line in every], 0.01), y=common([line.y for line in every])
        )
        figures = [
            pictures.add(
                moment_plot(of_run, run, ranges, title=_panel_title(run, name)),
                f"{_panel_title(run, name)}: {describe_peak(of_run[2])}{_by_piece(run)}.",
                f"Moment over bending angle of {name}. "
                + "; ".join(describe_peak(line) for line in of_run),
            )
            for (run, name), of_run in zip(bent, lines, strict=True)
        ]
        words = note(
            "Moment at the sensing gripper over the bending angle, all on one scale; zooming one "
            "zooms all. The oracle knows no compliance: it is the moment on the nominal path. "
            + " ".join(
                f"{name}: {without}" for run, name in bent if (without := no_theory(run.scenario))
            )
        )
        sections.append(
            Section(title="Moment over bending angle", body=join([words, side_by_side(*figures)]))
        )
    sections.append(Section(title="Metrics", body=metrics_table(runs, names)))
    return sections


def _by_piece(run: RunRecord) -> str:
    metric = run.summary.metrics.get("peak_moment_by_piece")
    if metric is None or not isinstance(metric.value, list):
        return ""
    peaks = ["–" if peak is None else f"{1e3 * peak:.1f}" for peak in metric.value]
    return f"; by piece of the path {', '.join(peaks)} mN m"


def _panel_title(run: RunRecord, name: str) -> str:
    paper = PAPER_FIGURES.get(run.scenario.name)
    return f"{name}, the paper's {paper}" if paper else name


def _limitations() -> Section:
    return Section(title="", body=markdown(limitations_file().read_text(encoding="utf-8")))


def _body(chapters: Sequence[tuple[str, list[Section]]]) -> Html:
    """Return contents and chapters; a section without a title belongs to its chapter's head."""
    contents, parts = [], []
    for i, (title, sections) in enumerate(chapters):
        inner, below = [], []
        for j, section in enumerate(sections):
            at = f"part-{i}-{j}"
            if not section.title:
                inner.append(section.body)
                continue
            heading = element("h3", section.title, id=f"{at}-title")
            inner.append(
                element("section", heading, section.body, id=at, aria_labelledby=f"{at}-title")
            )
            below.append(element("li", element("a", section.title, href=f"#{at}")))
        heading = element("h2", title, id=f"part-{i}-title")
        parts.append(
            element("section", heading, *inner, id=f"part-{i}", aria_labelledby=f"part-{i}-title")
        )
        link = element("a", title, href=f"#part-{i}")
        contents.append(element("li", link, *([element("ul", *below)] if below else [])))
    nav = element("nav", element("h2", "Contents"), element("ul", *contents), aria_label="Contents")
    return join([nav, element("main", *parts)])


def _document(title: str, body: Html, plots: Mapping[str, Plot]) -> str:
    version = importlib.metadata.version("dualbend")
    head = join(
        [
            element("meta", charset="utf-8"),
            element("meta", http_equiv="Content-Security-Policy", content=_POLICY),
            element("meta", name="viewport", content="width=device-width, initial-scale=1"),
            element("meta", name="color-scheme", content="light dark"),
            element("meta", name="generator", content=f"dualbend {version}"),
            element("title", f"{title}: dualbend report"),
            _raw("style", _asset("report.css")),
        ]
    )
    page = element(
        "body",
        element("header", element("h1", title)),
        element("noscript", note("The plots need JavaScript; tables and texts do not.")),
        body,
        element("footer", note(f"Made by dualbend {version}. All quantities are simulated.")),
        *(_drawn(plots) if plots else ()),
    )
    return f"<!doctype html>\n{element('html', element('head', head), page, lang='en')}\n"


def _drawn(plots: Mapping[str, Plot]) -> tuple[Html, ...]:
    return (
        _raw("script", plots_json(plots), ' id="plots" type="application/json"'),
        _raw("script", library()),
        _raw("script", _asset("report.js")),
    )


def _raw(tag: str, text: str, attributes: str = "") -> Html:
    """Return a style or script; what would end it early is broken up."""
    whole = text.replace(f"</{tag}", f"<\\/{tag}")
    return Html(f"<{tag}{attributes}>\n{whole}\n</{tag}>")


def _asset(name: str) -> str:
    return files("dualbend.report").joinpath(name).read_text(encoding="utf-8")
