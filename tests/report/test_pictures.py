"""What pictures show beside and over each other: scales, legends, both arms."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from dualbend.report.figures import plot_compared_moments, plot_moment, plot_stability_map
from dualbend.report.over_time import OverTime
from dualbend.report.plot import LEFT_RIGHT, Range, shared
from dualbend.report.sections.time import wrench_section
from dualbend.run.disk.saved import load_run
from dualbend.run.record import RunRecord
from dualbend.scenario.load import load_scenario
from dualbend.stability.map import stability_map
from dualbend.stability.prediction import predict
from dualbend.study.onset.figure import plot_onsets
from dualbend.study.onset.results import Case, OnsetStudy, Simulated
from dualbend.study.paper_figures import write_pictures
from support.left_runs import leave
from support.pictures import kept_figures
from support.strip import STRIP6, STRIP8, STRIP9

SHORT = ("path.end_rad=0.4", "motion.speed_rad_per_s=0.4", "motion.settle_s=0.1")
FIG9 = load_scenario(STRIP9)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[RunRecord]:
    top = tmp_path_factory.mktemp("runs")
    strips = {"fig6": STRIP6, "fig8": STRIP8, "fig9": STRIP9}
    return [load_run(leave(top / name, strip, *SHORT)) for name, strip in strips.items()]


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    return kept_figures(monkeypatch)


def test_a_long_reason_is_beside_the_largest_moment_and_not_over_it(
    runs: list[RunRecord], drawn: list[Figure], tmp_path: Path
) -> None:
    words = "the outer right pin is not felt: turned one way and the other, the sheet is pushed"
    ended = dataclasses.replace(runs[1], outcome="aborted", reason=f"check seats: {words} across")
    plot_moment(ended, tmp_path / "moment.png")
    axes = drawn[-1].axes[0]
    drawn[-1].draw_without_rendering()
    (largest,) = axes.texts
    (left,) = (one for one in axes.findobj(Text) if "pushed" in one.get_text())
    assert not left.get_window_extent().overlaps(largest.get_window_extent())


def test_ranges_of_like_size_are_joined() -> None:
    """Analytic: lengths 2, 5, 6 and 7: three times 2 is 6."""
    given = [Range(low=0.0, high=7.0), *(Range(low=-1.0, high=h) for h in (1.0, 4.0, 5.0))]
    ends = [(found.low, found.high) for found in shared(given)]
    assert ends == [(0.0, 7.0), *3 * [(-1.0, 5.0)]]
    assert shared([]) == []


def test_figs_6_and_8_are_on_one_scale_and_fig_9_on_its_own(
    runs: list[RunRecord], drawn: list[Figure], tmp_path: Path
) -> None:
    write_pictures(runs, tmp_path)
    six, eight, nine = (axes.get_ylim() for axes in drawn[-1].axes)
    assert six == eight
    # Analytic: a curve of a third of the scale at least, wherever it is shown.
    assert six[1] - six[0] <= (nine[1] - nine[0]) / 3.0
    for axes in drawn[-1].axes:
        values = np.concatenate([np.asarray(line.get_ydata(), float) for line in axes.lines[:4]])
        shown = axes.get_ylim()
        assert shown[0] < np.nanmin(values) < np.nanmax(values) < shown[1]


def a_case(alpha_rad: float) -> Case:
    found = Simulated(
        **dict.fromkeys(("b", "unstable_b", "stable_b", "growing_b", "frequency_hz"), 0.1),
        residual=None,
        rates=(),
        runs=1,
    )
    gains: dict[str, Any] = {f"{name}_b": 0.1 for name in ("paper", "delayed", "sampled")}
    hz: dict[str, Any] = {"sampled_hz": 2.0, "same_gains_hz": 2.0}
    at: dict[str, Any] = {"key": "", "axis": "x", "alpha_rad": alpha_rad, "ratio_per_s": 80.0}
    return Case(**gains, **hz, **at, simulated=found, frictionless=found)


@pytest.mark.slow
def test_no_legend_lies_over_what_it_names(
    runs: list[RunRecord], drawn: list[Figure], tmp_path: Path
) -> None:
    path = tmp_path / "picture.png"
    plot_moment(runs[1], path)
    plot_compared_moments((runs[0], runs[1]), ("a", "b"), path)
    write_pictures(runs, tmp_path)
    plot_stability_map(stability_map(FIG9, predict(FIG9)), "fig9", path)
    cases = tuple(a_case(alpha) for alpha in (0.3, 0.35, 0.42, 0.5, 0.57, 0.66))
    plot_onsets(FIG9, OnsetStudy(scenario="fig9", cases=cases), path)
    assert len(drawn) == 2 + 2 * 4 + 2
    for figure in drawn:
        legends = figure.findobj(Legend)
        assert legends
        frames = [axes.get_window_extent() for axes in figure.axes]
        for legend in legends:
            assert isinstance(legend, Legend)
            place = legend.get_window_extent()
            assert not [frame for frame in frames if Bbox.intersection(frame, place)]
            # Nor is it cut off.
            assert figure.bbox.x0 <= place.x0 < place.x1 <= figure.bbox.x1
            assert figure.bbox.y0 <= place.y0 < place.y1 <= figure.bbox.y1


def test_two_arms_that_do_the_same_are_both_seen(runs: list[RunRecord]) -> None:
    """The right arm's curve is drawn after the left one's, and is narrower and opaque."""
    (left_width, left_opacity), (right_width, right_opacity) = LEFT_RIGHT
    # Ink of the left arm is left on both sides, and what lies in it is not blended with it.
    assert left_width >= 3.0 * right_width
    assert left_opacity < right_opacity == 1.0
    for panel in wrench_section(OverTime(runs[0])).blocks[0].figures:  # type: ignore[union-attr]
        curves = panel.plot.curves
        half = len(curves) // 2
        assert [curve.name.split()[0] for curve in curves] == half * ["left"] + half * ["right"]
        for left, right in zip(curves[:half], curves[half:], strict=True):
            assert (left.width, left.opacity, right.width, right.opacity) == (
                *LEFT_RIGHT[0],
                *LEFT_RIGHT[1],
            )
            assert left.colour != right.colour
