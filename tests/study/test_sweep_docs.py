"""The examples of docs/sweeps.md are sweeps, of as many runs as the page says."""

import re
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from dualbend.study.sweep.design import make_design
from dualbend.study.sweep.file import load_sweep

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


def test_the_table_is_read_as_the_page_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    code = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    (tmp_path / "runs" / "gains").mkdir(parents=True)
    damping = [float(b) for b in range(8)]
    columns = {
        "robot.alter.delay_cycles": damping,
        "compliance.rotation.b": damping,
        "rms_moment": [abs(b - 3.0) for b in damping],
    }
    pq.write_table(pa.table(columns), tmp_path / "runs" / "gains" / "table.parquet")
    monkeypatch.chdir(tmp_path)
    for block in code:
        exec(compile(block, "sweeps.md", "exec"), {})
    shown = capsys.readouterr().out.splitlines()
    assert len(shown) == 5
    assert "'robot.alter.delay_cycles': 3.0" in shown[0]
