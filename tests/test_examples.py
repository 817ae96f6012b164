"""The programs of docs/examples run and do what their first lines say."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from dualbend import TASKS
from support.scripts import load_script

EXAMPLES = Path(__file__).parents[1] / "docs" / "examples"


def own_path(found: dict[str, float]) -> None:
    assert found["ExactPath"] < 1e-6  # analytic: no end moment, to the optimiser's tolerance
    assert found["SeriesPath"] == pytest.approx(0.813e-3, rel=1e-3)  # golden
    # The weight of the flat sheet alone, as on the exact path; in pieces it is 38.7 mN m. Golden.
    assert found["simulated"] == pytest.approx(9.4e-3, abs=0.1e-3)


def own_compliance(found: dict[str, float]) -> None:
    assert found["without"] == pytest.approx(38.7e-3, abs=0.1e-3)  # golden: the tutorial
    assert found["with"] == pytest.approx(32.8e-3, abs=0.1e-3)  # golden


def own_arm(found: dict[str, float]) -> None:
    assert found["distance_m"] == 0.827  # golden
    assert found["peak_moment_nm"] == pytest.approx(34.2e-3, abs=0.1e-3)  # golden


def own_task(found: dict[str, float]) -> None:
    assert abs(found["weight_error"]) < 1e-3  # the swing after the weight came onto the grips
    TASKS.remove("weigh")


def own_loop(found: dict[str, float]) -> None:
    assert found["without"] == pytest.approx(38.7e-3, abs=0.1e-3)  # golden: as own_compliance
    assert found["with"] == pytest.approx(27.3e-3, abs=0.1e-3)  # golden


def own_learner(found: dict[str, float]) -> None:
    assert found["without"] == pytest.approx(-92.9, abs=0.5)  # golden
    assert found["learned"] == pytest.approx(-22.4, abs=1.0)  # golden
    assert found["b"] == pytest.approx(4.1, abs=0.5)  # golden


CHECKS: dict[str, Callable[[Any], None]] = {
    check.__name__: check
    for check in (own_path, own_compliance, own_arm, own_task, own_loop, own_learner)
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CHECKS)
def test_the_example_does_what_it_says(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    CHECKS[name](load_script(EXAMPLES / f"{name}.py").main())
    assert capsys.readouterr().out


def test_every_example_is_run() -> None:
    assert {path.stem for path in EXAMPLES.glob("*.py")} == set(CHECKS)
