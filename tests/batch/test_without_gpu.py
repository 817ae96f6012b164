"""Without the extra, what needs a device names it."""

import sys

import pytest
from click.testing import CliRunner

from dualbend.cli import main


def test_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.startswith("dualbend.batch.gpu")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "warp", None)
    done = CliRunner().invoke(main, ["benchmark", "fig8", "--device", "cuda"])
    assert done.exit_code == 2
    assert "pip install 'dualbend[gpu]'" in done.output
