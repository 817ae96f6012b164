"""Pytest's fixture ``served_cell``: cells on free ports for the controller that is tested.

An installed package brings it (entry point ``pytest11``). Heavy imports happen in the fixture: this
module is loaded by every pytest beside it.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import pytest

if TYPE_CHECKING:
    from dualbend.run.record import RunRecord
    from dualbend.scenario.load import Settings
    from dualbend.serve.cell import ServedCell
    from dualbend.serve.lockstep import LockStep


class CellUnderTest:
    """A served cell with open ports, which waits for its controller.

    Attributes
    ----------
    told
        What a client is told, by name: ``left_robot_port``, ``left_sensor_port``,
        ``left_http_port``, ``left_tool``, the same of the right arm, and ``folder``.
    environment
        That as variables, ``DUALBEND_LEFT_ROBOT_PORT``, beside those of this process.
    """

    def __init__(self, cell: ServedCell, lockstep: LockStep, folder: Path) -> None:
        from dualbend.serve.client import environment, told_to  # noqa: PLC0415 - heavy

        self._cell, self._lockstep, self._folder = cell, lockstep, folder
        self.told = told_to(cell, folder)
        self.environment = {**os.environ, **environment(self.told)}

    def run(self, client: str | None = None) -> RunRecord:
        """Run to the end, whatever ends it, by the answers that come to the ports.

        ``client``: a command that starts the controller, as ``serve.client``; what it prints is
        printed here. None: it was started by the test.
        """
        from dualbend.serve.client import OUTPUT, run_by_client  # noqa: PLC0415 - heavy

        if client is None:
            return self._lockstep.run()
        try:
            return run_by_client(self._cell, self._lockstep, client, self._folder)
        finally:
            output = self._folder / OUTPUT
            if output.is_file():
                print(output.read_text(encoding="utf-8", errors="replace"), end="")


class OpenCell(Protocol):
    """What the fixture gives."""

    def __call__(
        self, scenario: str, settings: Settings = (), seed: int | None = None
    ) -> CellUnderTest:
        """Open a scenario, a shipped one by name or a file; the arguments of ``load_scenario``."""


@pytest.fixture
def served_cell(tmp_path: Path) -> Iterator[OpenCell]:
    """Give what opens a scenario's ports; they are closed when the test ends."""
    from dualbend.run.make import make_run  # noqa: PLC0415 - heavy
    from dualbend.scenario.load import load_scenario  # noqa: PLC0415 - heavy
    from dualbend.serve.cell import ServedCell  # noqa: PLC0415 - heavy

    with ExitStack() as stack:
        folders = iter(tmp_path / f"client{i or ''}" for i in range(1000))

        def opened(
            scenario: str, settings: Settings = (), seed: int | None = None
        ) -> CellUnderTest:
            run = make_run(load_scenario(scenario, settings, seed))
            cell = ServedCell(run, own_ports=True)
            return CellUnderTest(cell, stack.enter_context(cell.open()), next(folders))

        yield opened
