"""The examples of docs/sweeps.md are sweeps, of as many runs as the page says."""

import re
from pathlib import Path

import pytest

from dualbend.analysis.sweep_design import make_design
from dualbend.analysis.sweep_file import load_sweep

PAGE = Path(__file__).parents[2] / "docs" / "sweeps.md"


@pytest.mark.parametrize(("which", "runs"), [(0, 64), (1, 80)])
def test_an_example_is_a_sweep_none_of_whose_runs_is_refused(
    which: int, runs: int, tmp_path: Path
) -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert str(runs) in text
    file = tmp_path / "example.toml"
    file.write_text(re.findall(r"```toml\n(.*?)```", text, re.DOTALL)[which], encoding="utf-8")
    sweep = load_sweep(file)
    design = make_design(sweep)
    assert len(design.rows) == runs
    for index in range(runs):
        sweep.resolve(design.settings(index))
