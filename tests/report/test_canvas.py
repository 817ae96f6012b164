"""Pictures are alike whatever the environment says of matplotlib."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

DRAW = """
import sys
from dualbend.report.canvas import Figure, own_style
with own_style():
    Figure().subplots().plot([0, 1], [0, 1], label="a")
    figure = Figure(figsize=(2.0, 2.0), layout="constrained")
    figure.add_subplot().plot([0, 1], [0, 1])
    figure.savefig(sys.argv[1], dpi=50, metadata={"Software": None})
"""


def drawn(folder: Path, **environment: str) -> tuple[bytes, str]:
    """Return a picture that a process of its own makes in a folder, and its messages."""
    path = folder / "made.png"
    done = subprocess.run(
        [sys.executable, "-c", DRAW, str(path)],
        cwd=folder,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=True,
    )
    return path.read_bytes(), done.stderr


@pytest.mark.parametrize(
    "backend", ["nonsense", "module://matplotlib_inline.backend_inline", "TkAgg"]
)
def test_a_picture_does_not_depend_on_the_environment(backend: str, tmp_path: Path) -> None:
    """Golden to the byte: a backend that is not there, a style of one's own, no home."""
    plain, _ = drawn(tmp_path)
    (tmp_path / "matplotlibrc").write_text("lines.linewidth: 9\nfont.size: 30\n", encoding="utf-8")
    own, said = drawn(tmp_path, MPLBACKEND=backend, HOME="/proc/none", XDG_CACHE_HOME="/proc/none")
    assert own == plain
    assert said == ""
