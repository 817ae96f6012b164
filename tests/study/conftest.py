"""What the tests of studies share: runs in this process, and a file that counts them."""

from pathlib import Path

import pytest

from dualbend.study import processes
from support.small_runs import CALLS
from support.stand_in import InProcess


@pytest.fixture
def in_process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(processes, "ProcessPoolExecutor", InProcess)


@pytest.fixture
def calls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    path = tmp_path / "calls"
    monkeypatch.setenv(CALLS, str(path))
    return path
