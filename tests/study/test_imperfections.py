"""The study of imperfections: every one alone and all of them, kept, gone on with and compared."""

from __future__ import annotations

from pathlib import Path

import pytest

from dualbend.errors import InputError
from dualbend.run.record import Metric
from dualbend.scenario.load import load_scenario
from dualbend.scenario.scenario import variants
from dualbend.study import imperfections
from dualbend.study.imperfections import NONE, PartRow, run_part, run_study, table

SHORT = ("path.end_rad=0.2", "motion.speed_rad_per_s=1.0", "motion.hold_s=0.1")


def row(part: str, seed: int, peak: float, outcome: str = "completed") -> PartRow:
    return PartRow(
        part=part,
        seed=seed,
        outcome=outcome,
        metrics={
            "peak_moment": Metric(value=peak, unit="N m"),
            "mean_moment_hold": Metric(value=None, unit="N m", note="too short"),
        },
    )


def test_a_ratio_is_the_median_of_each_seed_over_the_same_one_without() -> None:
    """Exact: 2, 1.5 and 4 times; those that did not complete do not count."""
    rows = [
        *(row(NONE, seed, peak) for seed, peak in ((1, 1.0), (2, 2.0), (3, 0.5))),
        *(row("bases", seed, peak) for seed, peak in ((1, 2.0), (2, 3.0), (3, 2.0))),
        *(row("all", seed, peak) for seed, peak in ((1, 3.0), (2, 2.0))),
        row("all", 3, 9.0, "protective_stop"),
    ]
    none, bases, every = table(rows).rows
    assert none[:4] == ["none", "3/3", 1.0, 1.0]
    assert bases[:4] == ["bases", "3/3", 2.0, 2.0]
    assert every[:4] == ["all", "2/3", 2.5, 2.0]
    assert bases[4:] == [None, None]


def test_every_imperfection_is_run_with_every_seed_and_none_twice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[tuple[str, int]] = []

    def here(tasks: dict, run_one: object) -> object:
        for key, (part, scenario) in tasks.items():
            made.append((part, scenario.seed))
            yield key, row(part, scenario.seed, 1.0)

    monkeypatch.setattr(imperfections, "in_batches", lambda _: here)
    scenario = load_scenario("fig8", SHORT)
    parts = list(variants(scenario, "typical"))
    rows = run_study(scenario, "typical", tmp_path / "study", seeds=2)
    assert [(one.part, one.seed) for one in rows] == [(part, k) for part in parts for k in (1, 2)]
    assert sorted(made) == sorted((part, k) for part in parts for k in (1, 2))
    made.clear()
    assert len(run_study(scenario, "typical", tmp_path / "study", seeds=2)) == 2 * len(parts)
    assert made == []
    with pytest.raises(InputError):
        run_study(scenario, "worst", tmp_path / "study", seeds=2)


def test_a_run_that_is_refused_is_a_row_that_says_why() -> None:
    refused = run_part("all", load_scenario("fig8", [*SHORT, "sheet.thickness_m=0.003"]))
    assert refused.outcome == "refused"
    assert refused.reason
    done = run_part(NONE, load_scenario("fig8", [*SHORT, "imperfections=none"]))
    assert done.outcome == "completed"
    assert done.metrics["peak_moment"].value
