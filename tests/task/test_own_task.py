"""A third task, from outside the package: it runs, is recorded, reported, read back and gated."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from dualbend import TASKS, RunRecord, load_run, load_scenario, make_run, write_results
from dualbend.check import check as checking
from dualbend.check.measure import Measured, measure
from dualbend.cli import main
from dualbend.errors import InputError
from support.scripts import load_script

EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "own_task.py"
SHORT = ("task.kind=weigh", "motion.settle_s=0.3", "task.weigh_s=0.3")
SCENARIO = 'extends = "exact"\nname = "mine"\n[task]\nkind = "weigh"\nweigh_s = 0.2\n'


@pytest.fixture(scope="module", autouse=True)
def weigh() -> Iterator[Any]:
    """Register the task of the example, and take it back."""
    module = load_script(EXAMPLE)
    yield module
    TASKS.remove("weigh")


@pytest.fixture(scope="module")
def result(weigh: Any) -> RunRecord:
    return make_run(load_scenario("exact", [*SHORT])).run()


def test_the_sheet_weighs_what_it_is_made_of(result: RunRecord) -> None:
    assert result.outcome == "completed"
    expected = 9.80665 * result.scenario.sheet.sheet().mass_kg
    # Discretisation-limited: what swings when the weight comes onto the grips has not died out.
    assert result.metrics["weight"].value == pytest.approx(expected, rel=0.03)


def test_it_is_written_read_back_and_reported(result: RunRecord, tmp_path: Path) -> None:
    assert write_results(result, tmp_path) == []
    again = load_run(tmp_path)
    assert again.phases == ("settle", "weigh", "stopped")
    assert again.metrics == result.metrics
    assert again.scenario == result.scenario
    assert (tmp_path / "run.rrd").stat().st_size > 100_000
    assert CliRunner().invoke(main, ["report", str(tmp_path)]).exit_code == 0
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "weight error" in page
    assert "weigh_s" in page


def test_its_numbers_are_gated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The check runs scenarios in processes of its own; here in this one, which knows the task."""

    def here(sources: Any, *_: Any) -> list[Measured]:
        return [measure(source) for source in sources]

    monkeypatch.setattr(checking, "measure_all", here)
    monkeypatch.chdir(tmp_path)
    Path("mine.toml").write_text(SCENARIO)
    assert CliRunner().invoke(main, ["check", "mine.toml", "--update"]).exit_code == 0
    assert CliRunner().invoke(main, ["check"]).exit_code == 0
    Path("mine.toml").write_text(f"{SCENARIO}[sheet]\nwidth_m = 0.06\n")
    moved = CliRunner().invoke(main, ["check"])
    assert moved.exit_code == 1
    assert "weight" in moved.output


def test_its_keys_are_checked_like_any_others() -> None:
    with pytest.raises(InputError, match=r"task\.hold_rad = 2\.0: must be a number.* < 1 \[rad\]"):
        load_scenario("exact", ["task.kind=weigh", "task.hold_rad=2.0"])
    with pytest.raises(InputError, match=r'task\.hold_rad = 0\.2: belongs to kind = "weigh"'):
        load_scenario("exact", ["task.hold_rad=0.2"])
    with pytest.raises(InputError, match=r"task\.kind = 'weight': must be one of .*'weigh'"):
        load_scenario("exact", ["task.kind=weight"])
