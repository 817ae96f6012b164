"""The programs and notebooks of docs/examples run and do what their first lines say."""

import ast
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from dualbend import TASKS, RunRecord
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


def own_admittance(found: dict[str, float]) -> None:
    assert found["difference"] == 0.0  # exact: the same products in the same order
    assert found["own"] == found["built_in"] == pytest.approx(0.614, abs=1e-3)  # golden


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


def own_sheet(found: dict[str, float]) -> None:
    assert found["elastica"] == pytest.approx(28.1e-3, abs=0.2e-3)  # golden
    # On its own path what is left is what pads and strips yield: no tenth of it.
    assert found["own"] < 0.1 * found["elastica"]


CHECKS: dict[str, Callable[[Any], None]] = {
    check.__name__: check
    for check in (
        *(
            own_path,
            own_compliance,
            own_admittance,
            own_arm,
            own_task,
            own_loop,
            own_learner,
            own_sheet,
        ),
    )
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CHECKS)
def test_the_example_does_what_it_says(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    CHECKS[name](load_script(EXAMPLES / f"{name}.py").main())
    assert capsys.readouterr().out


def fig8(shown: list[Any]) -> None:
    (verdict, _), with_compliance, peaks, begun = shown
    assert verdict == "stable"
    assert peaks["fig8"] == with_compliance.metrics["peak_moment"].value
    assert peaks["fig8"] < peaks["fig6"]
    assert (begun.outcome, begun.trace.rows) == ("aborted", 400)
    for run in shown[1::2]:
        assert isinstance(run, RunRecord)
        assert "<img" in run._repr_html_()  # what a notebook shows


NOTEBOOKS = {fig8.__name__: fig8}


@pytest.mark.slow
@pytest.mark.parametrize("name", NOTEBOOKS)
def test_the_notebooks_cells_run_one_after_the_other(name: str) -> None:
    """Each as a notebook does, whose last line, where it is a value, is shown."""
    names: dict[str, Any] = {}
    shown = []
    for cell in notebook(name):
        if cell["cell_type"] == "code":
            tree = ast.parse("".join(cell["source"]))
            last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
            exec(compile(tree, name, "exec"), names)
            if last is not None:
                value = ast.Expression(last.value)  # type: ignore[attr-defined]
                shown.append(eval(compile(value, name, "eval"), names))
    NOTEBOOKS[name](shown)


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_notebooks_are_kept_without_what_they_showed(name: str) -> None:
    for cell in notebook(name):
        if cell["cell_type"] == "code":
            assert not cell["outputs"]
            assert cell["execution_count"] is None


def notebook(name: str) -> list[dict[str, Any]]:
    found = json.loads((EXAMPLES / f"{name}.ipynb").read_text(encoding="utf-8"))
    assert (found["nbformat"], found["nbformat_minor"]) == (4, 5)  # cells have names
    cells: list[dict[str, Any]] = found["cells"]
    assert len({cell["id"] for cell in cells}) == len(cells)
    return cells


CLIENTS = {"own_client"}
"""Programs that need a served cell beside them: tests/serve runs them."""


def test_every_example_is_run() -> None:
    assert {path.stem for path in EXAMPLES.glob("*.py")} == {*CHECKS, *CLIENTS}
    assert {path.stem for path in EXAMPLES.glob("*.ipynb")} == set(NOTEBOOKS)
