"""The repository of ``docs/gate.md``: its files as they stand there, its workflow's own steps."""

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from support.served import CLIENT

PAGE = Path(__file__).parents[2] / "docs" / "gate.md"
FILE = re.compile(r"<!-- run: file (\S+) -->\n```\w*\n(.*?)```", re.DOTALL)
STEP = re.compile(r"<!-- run: shell -->\n```\n(dualbend.*?)\n")
INSTALL = "pip install "


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    for name, text in FILE.findall(PAGE.read_text(encoding="utf-8")):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    (tmp_path / "controller.py").write_text(CLIENT.read_text())
    # As if the package were installed: its command, and its plug-in for pytest.
    (tmp_path / "conftest.py").write_text("from dualbend.testing import served_cell\n")
    command = tmp_path / "bin" / "dualbend"
    command.parent.mkdir()
    command.write_text(f'#!/bin/sh\nexec {sys.executable} -m dualbend "$@"\n')
    command.chmod(0o755)
    return tmp_path


def shell(repository: Path, line: str) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join([str(repository / "bin"), str(Path(sys.executable).parent)])
    env = {**os.environ, "PATH": f"{path}{os.pathsep}{os.environ['PATH']}"}
    env["GITHUB_STEP_SUMMARY"] = str(repository / "summary.md")
    return subprocess.run(
        ["bash", "-e", "-c", line],
        check=False,
        cwd=repository,
        env=env,
        capture_output=True,
        text=True,
    )


@pytest.mark.slow
def test_the_workflow_passes_and_fails_as_its_page_says(repository: Path) -> None:
    yaml = pytest.importorskip("yaml")
    step = STEP.search(PAGE.read_text(encoding="utf-8"))
    assert step is not None
    made = shell(repository, step[1])
    assert made.returncode == 0, made.stderr
    workflow: dict[str, Any] = yaml.safe_load(
        (repository / ".github" / "workflows" / "gate.yml").read_text()
    )
    lines = [step["run"] for step in workflow["jobs"]["gate"]["steps"] if "run" in step]
    assert lines[0].startswith(INSTALL)
    for line in lines[1:]:
        done = shell(repository, line)
        assert done.returncode == 0, f"{line}\n{done.stdout}{done.stderr}"
    assert "dualbend check: passed" in (repository / "summary.md").read_text()
    assert (repository / "runs" / "bench" / "client" / "output.log").is_file()
    controller = repository / "controller.py"
    controller.write_text(CLIENT.read_text().replace("= 2.0, 1e6", "= 2.2, 1e6"))
    gated = shell(repository, lines[1])
    assert gated.returncode == 1
    assert "peak_deviation_alpha" in gated.stdout
    controller.write_text("import no_such_module\n")
    gated = shell(repository, lines[1])
    assert gated.returncode == 1
    assert "the client ended with exit code 1: ModuleNotFoundError" in gated.stderr
