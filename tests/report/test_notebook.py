"""A run in a notebook: what it shows of itself, in memory and read back, and what that loads."""

import base64
import html.parser
import io
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from dualbend.report.moment import knots_of
from dualbend.report.notebook import moment_over_time, piece_starts
from dualbend.run.disk.saved import load_run
from dualbend.run.make import make_run
from dualbend.run.record import RunRecord
from dualbend.scenario.load import load_scenario
from support.left_runs import leave
from support.short_bend import SHORT

EVIL = "<script>alert('x')</script>"
PIECES = (*SHORT, "imperfections=none", "path=pieces", "path.pieces=3")


class Page(html.parser.HTMLParser):
    """The tags of a text, each closed by its own."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self._open: list[str] = []
        self.feed(text)
        assert not self._open

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self.tags.append(tag)
        if tag not in ("img", "br"):
            self._open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return leave(tmp_path_factory.mktemp("runs") / "fig8", "fig8", *PIECES, f"description={EVIL}")


@pytest.fixture(scope="module")
def run(folder: Path) -> RunRecord:
    return load_run(folder)


def test_a_run_shows_its_end_its_picture_and_every_metric(run: RunRecord) -> None:
    text = run._repr_html_()
    page = Page(text)
    assert page.tags.count("img") == page.tags.count("table") == 1
    assert "script" not in page.tags  # what a scenario says of itself is no markup
    assert "completed" in text
    for name, metric in run.metrics.items():
        assert name.replace("_", " ") in text
        if isinstance(metric.value, float):
            assert f"{metric.value:.4g}" in text
    data = re.search(r'src="data:image/png;base64,([^"]*)"', text)
    assert data is not None
    with Image.open(io.BytesIO(base64.b64decode(data[1]))) as picture:
        assert picture.format == "PNG"
        assert np.ptp(np.asarray(picture.convert("L"))) > 100  # curves, no empty frame


def test_a_run_in_memory_and_read_back_show_the_same(folder: Path, run: RunRecord) -> None:
    made = make_run(load_scenario(str(folder / "scenario.toml"))).run()

    def told(shown: str) -> list[str]:
        found = re.sub('base64,[^"]*', "", shown).splitlines()
        return [line for line in found if "wall time" not in line and "realtime" not in line]

    assert told(made._repr_html_()) == told(run._repr_html_())


def test_the_picture_has_the_moment_the_phases_and_the_pieces(run: RunRecord) -> None:
    figure = moment_over_time(run)
    measured, left, right = figure.plot.curves
    np.testing.assert_array_equal(left.y, 1e3 * run["left_true_moment_y"])
    np.testing.assert_array_equal(right.y, 1e3 * run["right_true_moment_y"])
    np.testing.assert_array_equal(measured.y, 1e3 * run[f"{run.sensing_side}_filtered_moment_y"])
    starts = piece_starts(run)
    assert figure.plot.knots == starts.tolist()
    assert figure.plot.bands
    for phase in run.task.phases:
        assert (phase in figure.caption) == (run.phases.index(phase) in run["phase"])
    # The first row beyond a knot: within a command period of where the path crosses it.
    inner = knots_of(run.scenario)[1:-1]
    assert len(starts) == len(inner) == 2
    for knot, start in zip(inner, starts, strict=True):
        row = int(np.flatnonzero(run["time"] == start)[0])
        assert run["nominal_alpha"][row - 1] < knot <= run["nominal_alpha"][row]


def test_a_run_that_was_stopped_says_why() -> None:
    ready = make_run(load_scenario("fig8", PIECES))

    def on_cycle(done: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    stopped = ready.run(on_cycle)
    text = stopped._repr_html_()
    assert stopped.reason in text
    assert "unexpected" in text
    assert "img" in Page(text).tags


def test_an_assembly_shows_itself() -> None:
    ready = make_run(load_scenario("pwb"))

    def on_cycle(done: int) -> None:
        if done == 60:
            raise KeyboardInterrupt

    left = ready.run(on_cycle)
    text = left._repr_html_()
    assert "img" in Page(text).tags
    assert all(name.replace("_", " ") in text for name in left.metrics)
    assert not piece_starts(left).size  # it has not bent yet


def test_a_run_draws_nothing_before_it_is_shown() -> None:
    code = """
import sys
from dualbend import load_scenario, make_run
from dualbend.run.record import RunRecord
assert callable(RunRecord._repr_html_)
print([m for m in ('matplotlib', 'bokeh', 'jinja2', 'dualbend.report') if m in sys.modules])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
