"""The page of a report without a browser: what it computes, says, escapes and refuses."""

import html
import json
import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result
from markupsafe import escape

from dualbend.cli import main
from dualbend.report.canvas import Figure as Canvas
from dualbend.report.figures import draw
from dualbend.report.moment import (
    bending_rows,
    moment_curves,
    recorded_moments,
    reference_at_ends,
)
from dualbend.report.over_time import OverTime
from dualbend.report.page import chapter, common_sections, page_of, report, write_report
from dualbend.report.plot import Axis, Curve, Plot
from dualbend.report.section import Chapter, Details, Figure, Section, Verdict
from dualbend.report.sections.settings import settings_of
from dualbend.report.shape import shapes, sheet_points
from dualbend.report.template import markdown
from dualbend.resources import limitations_file
from dualbend.run.disk.folder import run_folder
from dualbend.run.disk.saved import ENDED_FROM_OUTSIDE, load_run
from dualbend.run.make import make_run
from dualbend.run.record import Metric, RunRecord
from dualbend.scenario.load import load_scenario
from dualbend.study.paper_figures import FORMATS, write_pictures
from dualbend.table import Code, Column, Table
from dualbend.task.assembly.report import sheets_section
from support.left_runs import copied, leave
from support.made_up_book import make_book
from support.strip import STRIP8

SHORT = ("path.end_rad=0.4", "motion.speed_rad_per_s=0.4", "motion.settle_s=0.1")
EVIL = "<script>alert('x')</script> & \"quotes\""


@pytest.fixture(scope="module")
def top(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs")
    # The rod of the believed sheet, between arms that keep to its plane, describes the run.
    perfect = (*SHORT, "imperfections=none")
    leave(folder / "fig8", "fig8", *perfect, f"description={EVIL}")
    leave(folder / "fig6", "fig6", *perfect)
    leave(folder / "stopped", "fig8", *SHORT, "motion.settle_s=1", until=10)
    leave(folder / "pwb", "pwb", until=120)
    return folder


@pytest.fixture(scope="module")
def fig8(top: Path) -> RunRecord:
    return load_run(top / "fig8")


def call(*arguments: str) -> Result:
    return CliRunner().invoke(main, list(arguments))


def plots_of(page: str) -> dict[str, Any]:
    """Return the data of a page's plots."""
    text = re.search(r'<script id="plots"[^>]*>(.*?)</script>', page, re.DOTALL)
    assert text is not None
    found: dict[str, Any] = json.loads(text[1])
    return found


def test_the_hinges_lead_from_one_edge_to_the_other(fig8: RunRecord) -> None:
    """Analytic: a chain of rigid strips closes, to the rounding of its 22 joints."""
    for row in bending_rows(fig8)[::7].tolist():
        _, x, z = sheet_points(fig8, row)
        assert x[-1] == pytest.approx(-fig8["right_edge_x"][row], abs=1e-10)
        assert z[-1] == pytest.approx(fig8["right_edge_z"][row], abs=1e-10)


def test_the_sheet_lies_on_the_rod_between_its_own_ends(fig8: RunRecord) -> None:
    """Discretisation-limited, O(h²), 0.05 mm with 20 hinges; the motion adds to it."""
    found = shapes(fig8)
    assert [shape.alpha_rad for shape in found] == sorted(shape.alpha_rad for shape in found)
    assert found[-1].alpha_rad == pytest.approx(fig8["nominal_alpha"][bending_rows(fig8)].max())
    assert max(shape.off_rod_m for shape in found) < 3e-4


def test_a_plate_has_its_shape_too(tmp_path: Path) -> None:
    """The plate's mid-line leads from edge to edge, with other places of bending than the strips'.

    Analytic but for its stretch and the widthwise curvature: 1e-6 m is found.
    """
    brief = ("path.end_rad=0.4", "motion.speed_rad_per_s=1.0")
    pauses = ("motion.settle_s=0.1", "motion.hold_s=0.1", "sheet.model=shell")
    cells = ("sheet.model.cells_along=8", "sheet.model.cells_across=2")
    run = load_run(leave(tmp_path / "plate", "fig8", *brief, *pauses, *cells))
    assert run.scenario.sheet.model.sections == 8
    for row in bending_rows(run)[::3].tolist():
        s, x, z = sheet_points(run, row)
        assert s.shape == x.shape == z.shape == (10,)
        assert x[-1] == pytest.approx(-run["right_edge_x"][row], abs=1e-5)
        assert z[-1] == pytest.approx(run["right_edge_z"][row], abs=1e-5)
    page = report([run])
    assert "the simulated plate along its mid-line" in page
    assert "the simulated strips" not in page


def test_the_reference_at_the_recorded_poses_is_the_true_moment(fig8: RunRecord) -> None:
    """Discretisation-limited, 1 % of the peak at 0.1 rad/s; four times as fast here.

    Before 0.1 rad the sheet still swings from its settling, which is short here.
    """
    true = recorded_moments(fig8, bending_rows(fig8))[2]
    reference = reference_at_ends(fig8)
    assert true.name == "true"
    error = np.abs(np.interp(reference.x, true.x, true.y) - reference.y)
    assert np.nanmax(error[reference.x > 0.1]) < 0.03 * np.abs(true.y).max()


def test_a_sheet_that_yields_has_no_elastic_prediction(tmp_path: Path) -> None:
    """Unbent, the sheet turns the grip the other way than an elastic one: that is not shown."""
    brief = ("motion.speed_rad_per_s=0.7", "motion.settle_s=0.1", "motion.hold_s=0.1")
    run = load_run(leave(tmp_path / "set", "springback", *brief, "motion.return_rad=0.8"))
    assert run.outcome == "completed"
    assert [curve.name for curve in moment_curves(run)] == ["raw", "filtered", "true"]
    assert all(np.isnan(shape.off_rod_m) for shape in shapes(run))
    page = report([run, run])
    assert "reference, nominal" not in page
    assert "reference, recorded" not in page
    assert "off the rod with weight" not in page
    assert "No moment is predicted: the elastic theory does not apply" in page


def test_phases_follow_each_other_without_a_gap(top: Path) -> None:
    for name in ("fig8", "pwb"):
        run = load_run(top / name)
        found = OverTime(run).phases
        assert [p.name for p in found] == list(run.phases[: len(found)])
        assert found[0].start_s == 0.0
        for before, after in pairwise(found):
            assert after.start_s == pytest.approx(before.end_s, abs=1e-9)  # exact but for rounding


def test_settings_tell_what_differs_from_the_defaults() -> None:
    found = {s.key: s for s in settings_of(load_scenario(STRIP8, ["sensor.latency_ms=0"]))}
    assert found["robot.alter.delay_cycles"].changed
    assert (found["robot.alter.delay_cycles"].value, found["robot.alter.delay_cycles"].default) == (
        "2",
        "1",
    )
    assert not found["sensor.latency_ms"].changed
    assert found["sheet.length_m"].default is None  # it is required
    # Units that another key chooses.
    assert found["compliance.x.k"].unit == "N/mm"
    assert found["compliance.rotation.b"].unit == "N m s/deg"


def test_what_a_scenario_says_is_text(top: Path) -> None:
    folder = top / "fig8"
    said = load_run(folder).summary
    evil = copied(
        folder,
        top / "evil",
        reason=EVIL,
        metrics={**said.metrics, EVIL: Metric(1.0, EVIL)},
        versions={**said.versions, EVIL: EVIL},
    )
    page = report([load_run(evil), load_run(folder)])
    assert page.count(str(escape(EVIL))) >= 5
    assert EVIL not in page
    assert "<script>alert" not in page


def test_every_kind_of_block_is_escaped() -> None:
    named = Curve(name=EVIL, x=np.zeros(1), y=np.zeros(1))
    drawn = Plot(x=Axis(EVIL, EVIL), y=Axis(EVIL, EVIL), curves=[named], title=EVIL)
    table = Table([Column(EVIL, EVIL)], [(Code(EVIL),), (EVIL,)], EVIL)
    blocks = [EVIL, Verdict(EVIL, True, 1), table, Details(EVIL, table), Figure(drawn, EVIL, EVIL)]
    page = page_of(EVIL, [Chapter(EVIL, blocks, [Section(EVIL, blocks[:3])])])
    assert "<script>alert" not in page
    # Title, chapter and section twice each; a table six times.
    assert page.count(str(escape(EVIL))) == 3 * 2 + (2 + 6 + 7 + 2) + (2 + 6)
    assert plots_of(page)["plots"]["plot-0"]["curves"][0]["name"] == EVIL
    assert "<script>" not in markdown(EVIL)


def test_limitations_are_those_of_the_documentation(fig8: RunRecord) -> None:
    text = limitations_file().read_text(encoding="utf-8")
    shown = str(markdown(text))
    assert shown.count("<li>") == len(re.findall(r"^\* ", text, re.MULTILINE)) > 5
    assert "**" not in shown
    assert "](" not in shown
    assert shown in report([fig8])


def test_a_page_has_nothing_from_outside(top: Path) -> None:
    page = report([load_run(top / name) for name in ("fig6", "fig8", "pwb")])
    own = re.sub(r"<script>.*?</script>", "", page, flags=re.DOTALL)
    assert not re.findall(r"\bsrc=|<link|@import|url\(", own)
    targets = re.findall(r'href="([^"]*)"', own)
    assert all(target.startswith("#") for target in targets)
    assert {target[1:] for target in targets} <= set(re.findall(r'id="([^"]*)"', own))
    assert "default-src 'none'" in html.unescape(own)
    assert len(page.encode()) < 5e6


def test_every_picture_has_its_words(top: Path) -> None:
    page = report([load_run(top / "fig8"), load_run(top / "pwb")])
    plots = plots_of(page)["plots"]
    alts = re.findall(r'<div id="(plot-\d+)" class="plot" role="img" aria-label="([^"]+)"', page)
    assert {name for name, _ in alts} == set(plots)
    assert all(len(alt) > 20 for _, alt in alts)
    assert page.count("<figcaption>") == len(plots)


@pytest.mark.parametrize("name", ["fig8", "pwb"])
def test_matplotlib_draws_what_the_page_shows(top: Path, name: str) -> None:
    """Exact: every curve of every plot, its values, and the axes with their units."""
    figures = chapter(load_run(top / name), name).figures
    assert len(figures) > 8
    for shown in (figure.plot for figure in figures):
        axes = Canvas().add_subplot()
        draw(axes, shown)
        for line, curve in zip(axes.lines, shown.curves, strict=False):
            assert np.array_equal(line.get_xydata().T, [curve.x, curve.y], equal_nan=True)
        assert len(axes.lines) == len(shown.curves) + len(shown.knots) + len(shown.levels)
        assert len(axes.patches) == len(shown.bars) + len(shown.bands) + len(shown.areas)
        assert axes.get_xlabel() == f"{shown.x.label} [{shown.x.unit}]"
        assert (axes.get_xscale(), axes.get_title("left")) == (shown.x.scale, shown.title)
        if shown.x.range is not None:
            assert axes.get_xlim() == (shown.x.range.low, shown.x.range.high)


def test_runs_beside_each_other_have_one_scale(top: Path) -> None:
    page = report([load_run(top / "fig6"), load_run(top / "fig8")])
    shown = plots_of(page)
    panels = [p for p in shown["plots"].values() if "the paper's Fig." in p["title"]]
    assert len(panels) == 2
    assert panels[0]["x"]["range"] == panels[1]["x"]["range"]
    assert panels[0]["y"]["range"] == panels[1]["y"]["range"]


def test_a_task_without_sections_has_the_common_ones(fig8: RunRecord) -> None:
    titles = [section.title for section in common_sections(fig8) if section is not None]
    assert titles == ["Metrics", "Phases", "Wrench on both arms"]


def test_an_assembly_has_its_own_sections(top: Path) -> None:
    page = report([load_run(top / "pwb")])
    for title in ("Holes over pins", "Forces on the pins", "Phases", "Wrench on both arms"):
        assert f">{title}</h3>" in page
    assert "interrupted by the user" in page


def test_a_stack_shows_how_each_sheet_went_and_what_was_learned() -> None:
    _, run = make_book()
    place = {f"{which}_{axis}_m": 1e-3 for which in ("start", "found") for axis in "xy"}
    lesson = {**place, "found_yaw_rad": 2e-3, "found_left_level_m": 3e-4, "learned": False}
    section = sheets_section(replace(run, lessons=(lesson,)))
    assert section is not None
    (table,) = section.blocks
    assert isinstance(table, Table)
    names = [c if isinstance(c, str) else c.name for c in table.columns]
    cells = dict(zip(names, table.rows[0], strict=True))
    assert (cells["sheet"], cells["retries"], cells["learned from"]) == ("1", 1, False)
    assert (cells["found at x"], cells["turned"], cells["raised left"]) == (1.0, 2.0, 0.3)
    assert table.rows[1][-1] is None  # of the second sheet nothing was found


def test_a_run_that_ended_before_it_bent_still_has_its_report(top: Path) -> None:
    page = report([load_run(top / "stopped")])
    assert "The run ended before it bent the sheet." in page
    assert "interrupted by the user" in page
    assert "(unexpected)" in page


def test_a_killed_run_still_has_its_report(tmp_path: Path) -> None:
    """What is on disk after a kill: the stream alone, up to its last second."""
    run = make_run(load_scenario("fig8", SHORT))
    with run_folder(tmp_path) as kept, kept.log(run) as keep:

        def on_cycle(done: int) -> None:
            keep()
            if done == 40:
                raise KeyboardInterrupt

        run.run(on_cycle)
    saved = load_run(tmp_path, unfinished=True)
    assert saved.summary.outcome == ENDED_FROM_OUTSIDE
    assert saved.scenario == run.scenario  # exact
    result = call("report", str(tmp_path))
    assert result.exit_code == 0, result.output
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert ENDED_FROM_OUTSIDE in page
    assert "The run left no metrics." in page


def test_what_is_no_run_is_one_message_and_exit_2(top: Path, tmp_path: Path) -> None:
    def copy(name: str, *files: str) -> Path:
        folder = tmp_path / name
        folder.mkdir()
        for file in files:
            (folder / file).write_bytes((top / "fig8" / file).read_bytes())
        return folder

    untraced = copy("untraced", "scenario.toml", "summary.json")
    old = copied(top / "fig8", tmp_path / "old", versions={"dualbend": "0.0.1"})
    (old / "scenario.toml").write_text('name = "x"\nspeed = 1\n')
    cut = copy("cut", "scenario.toml", "summary.json")
    (cut / "trace.parquet").write_bytes((top / "fig8" / "trace.parquet").read_bytes()[:1000])
    for folder, words in (
        (tmp_path / "nowhere", "no such folder"),
        (copy("empty"), "no folder of a run"),
        (untraced, "there is no trace.parquet"),
        (cut, "no trace of a run"),
        (old, "made by dualbend 0.0.1"),
    ):
        result = call("report", str(folder), "--out", str(tmp_path / "x.html"))
        assert result.exit_code == 2, folder
        assert isinstance(result.exception, SystemExit)
        assert words in result.output
        assert len(result.output.strip().splitlines()) == 1
        assert not (tmp_path / "x.html").exists()


def test_a_readable_run_of_another_version_says_so(top: Path, tmp_path: Path) -> None:
    copied(top / "fig8", tmp_path, versions={"dualbend": "0.0.1"})
    assert "The run was made by dualbend 0.0.1" in report([load_run(tmp_path)])


def test_an_unwritable_page_is_said(top: Path) -> None:
    result = call("report", str(top / "fig8"), "--out", "/proc/none/x.html")
    assert result.exit_code == 2
    assert "--out /proc/none/x.html: cannot be written" in result.output


def test_a_compliance_brought_along_is_named_and_not_predicted(top: Path, tmp_path: Path) -> None:
    copied(top / "fig8", tmp_path, controller="mine.Still")
    own, other = report([load_run(top / "fig8")]), report([load_run(tmp_path)])
    assert "the run's compliance was mine.Still" in html.unescape(other)
    assert '<th scope="row">controller</th><td>mine.Still</td>' in other
    assert "growth rate over bending angle" in own
    assert "growth rate over bending angle" not in other
    assert '<th scope="row">controller</th><td>the scenario&#39;s own</td>' in own


def test_the_summarys_sheet_and_arms_are_shown(fig8: RunRecord, tmp_path: Path) -> None:
    page, sheet, arms = report([fig8]), fig8.summary.sheet, fig8.summary.arms
    raw = json.loads((fig8.folder / "summary.json").read_text())
    assert (sheet, arms) == (raw["sheet"], raw["arms"])  # exact
    assert sheet["rigidity"] == "width"
    taken = sheet["choices"]["width"]["bending_stiffness_nm2"]
    assert f'<th scope="row">width (taken)</th><td class="num">{taken:.4g}</td>' in page
    left = arms["left"]
    assert f'<td class="num">{left["manipulability"]:.4g}</td>' in page
    assert f'<td class="num">{left["room_deg"]:.4g}</td><td>{left["joint"]}</td>' in page
    # A summary of a version that did not have them is still one.
    for old in ({}, {"sheet": {"material": "x"}, "arms": {"left": {"arm": "x"}}}):
        copied(fig8.folder, tmp_path, **{"sheet": {}, "arms": {}, **old})
        without = report([load_run(tmp_path)])
        assert "width (taken)" not in without
        assert ("not readable" in without) == bool(old)


def test_misaligned_grips_show_what_leaves_the_plane(top: Path, tmp_path: Path) -> None:
    brief = ("path.end_rad=0.2", "motion.speed_rad_per_s=0.4", "motion.hold_s=0.1")
    error = ("motion.settle_s=0.3", "task.misalignment.right.roll_rad=0.02")
    run = load_run(leave(tmp_path / "rolled", "fig6", *brief, *error))
    page = report([run])
    assert ">Misaligned grips</h3>" in page
    assert "lateral force over time. left across: " in page
    assert "left about z (yaw): " in page
    assert "peak twist moment" in page
    plane = report([load_run(top / "fig6")])
    assert "Misaligned grips" not in plane
    assert "peak twist moment" not in plane


def test_the_same_runs_make_the_same_page(top: Path, tmp_path: Path) -> None:
    for name in ("a.html", "b.html"):
        write_report([top / "fig8"], tmp_path / name)
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()  # exact


@pytest.mark.slow
def test_pictures_of_the_paper_are_written_alike(top: Path, tmp_path: Path) -> None:
    runs = [load_run(top / name) for name in ("fig6", "fig8")]
    for again in ("one", "two"):
        (tmp_path / again).mkdir()
        write_pictures(runs, tmp_path / again)
    names = {f"{stem}.{kind}" for stem in ("fig6", "fig8", "figures") for kind in FORMATS}
    assert {path.name for path in (tmp_path / "one").iterdir()} == names
    for name in names:
        written = (tmp_path / "one" / name).read_bytes()
        assert written == (tmp_path / "two" / name).read_bytes()  # exact
        assert b"<svg" in written or written.startswith(b"\x89PNG")


@pytest.mark.slow
def test_figures_are_made_from_nothing(tmp_path: Path) -> None:
    settings = [part for setting in SHORT for part in ("--set", setting)]
    result = call("figures", "--out", str(tmp_path / "out"), *settings)
    assert result.exit_code == 0, result.output
    for name in ("fig6", "fig8", "fig9"):
        peak = load_run(tmp_path / "out" / name).summary.metrics["peak_moment"].value
        assert isinstance(peak, float)
        assert re.search(rf"{name} +{1e3 * peak:.1f} ", result.output)
    assert (tmp_path / "out" / "report.html").stat().st_size > 1e6
    assert (tmp_path / "out" / "figures.svg").is_file()
