"""Results are written whole, whoever interrupts."""

import os
import signal
import subprocess
import sys

import pytest

from dualbend.interrupts import uninterrupted


def test_an_interrupt_waits_until_results_are_written() -> None:
    """Analytic: it is neither heard inside the block nor lost, and comes once."""
    written = False
    with pytest.raises(KeyboardInterrupt), uninterrupted():
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)
        written = True
    assert written
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


@pytest.mark.skipif(os.name == "nt", reason="blocks a POSIX signal")
def test_a_process_that_is_started_meanwhile_is_not_interrupted() -> None:
    code = "import os, signal; os.kill(os.getpid(), signal.SIGINT); print('lived')"
    command = [sys.executable, "-c", code]
    with uninterrupted():
        assert subprocess.run(command, check=False, capture_output=True).stdout == b"lived\n"
    assert subprocess.run(command, check=False, capture_output=True).returncode == -signal.SIGINT
