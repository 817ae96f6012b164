"""The user's controller as a process: started with its ports at hand, watched, and ended."""

from __future__ import annotations

import os
import re
import shlex
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from dualbend.errors import InputError, brief, refusing, shortened, writing
from dualbend.files import write_whole
from dualbend.run.record import RunRecord
from dualbend.serve.cell import ServedCell
from dualbend.serve.lockstep import LockStep
from dualbend.serve.ports import ports_of
from dualbend.types import SIDES

PREFIX = "DUALBEND_"
FOLDER, OUTPUT = "client", "output.log"
"""Of a client, beside its run; and what it printed, in there."""

_KEY = "serve.client"
_END_S = 2.0
"""From the request to end, SIGTERM, to the end, SIGKILL."""
_LAST_BYTES = 2000

_GUARD = """\
import os, signal, sys
sys.stdin.read()
os.killpg(int(sys.argv[1]), signal.SIGKILL)
"""
"""Ends a client when its cell's process is there no more, whatever ended that."""


def told_to(cell: ServedCell, folder: Path) -> dict[str, str]:
    """Return what a client is told, by name: ports, tools, its folder and this interpreter."""
    told = {**ports_of(cell.config), "folder": str(folder.resolve()), "python": sys.executable}
    for side in SIDES:
        told[f"{side}_robot_address"] = cell.robot_address(side)
        mass_kg, centre_m = cell.tool(side)
        told[f"{side}_tool"] = " ".join(map(repr, (mass_kg, *centre_m.tolist())))
    return told


def environment(told: Mapping[str, str]) -> dict[str, str]:
    """Return what a client is told as variables: ``DUALBEND_LEFT_ROBOT_PORT`` and so on."""
    return {PREFIX + name.upper(): value for name, value in told.items()}


def run_by_client(
    cell: ServedCell,
    lockstep: LockStep,
    command: str,
    folder: Path,
    on_cycle: Callable[[int], None] | None = None,
) -> RunRecord:
    """Run to the end by the client that a command starts; it is ended with the run.

    ``folder``: where it finds RSI configurations and its output is kept, made if need be.

    Raises InputError where the command is none, cannot be started, or the folder not be written.
    """
    told = told_to(cell, folder)
    words = _words(command, told)
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in cell.configurations().items():
            write_whole(folder / name, text)
    with _started(words, environment(told), folder / OUTPUT) as ended:
        lockstep.client_ended = ended
        return lockstep.run(on_cycle)


def _words(command: str, told: Mapping[str, str]) -> list[str]:
    """Return the words of a command, as a shell has them, with what is told in its place."""
    with refusing(f"{_KEY} = {brief(command)}", ValueError):
        words = shlex.split(command)
    if not words:
        raise InputError(f"{_KEY} = {brief(command)}: names no program")

    def value(found: re.Match[str]) -> str:
        if found[1] not in told:
            raise InputError(
                f"{_KEY} = {brief(command)}: {found[0]} is not known; there are "
                + ", ".join(f"{{{name}}}" for name in told)
            )
        return told[found[1]]

    return [re.sub(r"\{([a-z]\w*)\}", value, word) for word in words]


@contextmanager
def _started(
    words: list[str], variables: Mapping[str, str], output: Path
) -> Iterator[Callable[[], str]]:
    """Start a program, and end it with all that it has started; give what says how it ended."""
    # A program that is ended from outside writes what it has printed only where it does so at once.
    told = {"PYTHONUNBUFFERED": "1", **os.environ, **variables}
    with writing(output):
        file = output.open("wb")
    with file, refusing(f"{_KEY}: {brief(words[0])} cannot be started", OSError, ValueError):
        client = subprocess.Popen(
            words,
            env=told,
            stdin=subprocess.DEVNULL,
            stdout=file,
            stderr=subprocess.STDOUT,
            start_new_session=True,  # a group of its own, which is ended as one
        )
    guard = _guarded(client)
    try:
        yield lambda: _said_of(client, output)
    finally:
        if guard is not None:
            guard.kill()
            guard.communicate()
        _end(client)


def _guarded(client: subprocess.Popen[bytes]) -> subprocess.Popen[bytes] | None:
    if os.name != "posix":
        return None
    return subprocess.Popen(
        [sys.executable, "-S", "-E", "-c", _GUARD, str(client.pid)],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


def _said_of(client: subprocess.Popen[bytes], output: Path) -> str:
    """Return how a client ended by itself, with its last line; "" of one that runs."""
    code = client.poll()
    if code is None:
        return ""
    text = output.read_bytes()[-_LAST_BYTES:].decode(errors="replace")
    last = next((line.strip() for line in reversed(text.split("\n")) if line.strip()), "")
    how = f"with exit code {code}" if code >= 0 else f"by signal {-code}"
    return f"the client ended {how}" + (f": {shortened(last, 200)}" if last else "")


def _end(client: subprocess.Popen[bytes]) -> None:
    if os.name != "posix":
        client.terminate()
        client.wait()
        return
    with suppress(ProcessLookupError):
        os.killpg(client.pid, signal.SIGTERM)
    with suppress(subprocess.TimeoutExpired):
        client.wait(_END_S)
    with suppress(ProcessLookupError):  # also what it has started and left
        os.killpg(client.pid, signal.SIGKILL)
    client.wait()
