"""A sweep's runs on a Dask cluster; a worker that is lost on the way costs time and no result."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from typing import TYPE_CHECKING

from dualbend.errors import DualbendError, InputError
from dualbend.scenario.scenario import Scenario
from dualbend.study.sweep.row import RAISED, RunRow, result_versions
from dualbend.study.sweep.run import RunOne, Runs, Task

if TYPE_CHECKING:
    from distributed import Client, Future

EXTRA = "a cluster needs dask.distributed: pip install 'dualbend[dask]'"
KILLED = "its workers died, one after the other"
CONNECT_S = 10.0
"""How long to try to reach a scheduler."""

_ONE_AT_A_TIME = threading.Lock()
"""MuJoCo's warning hook is of the process, whatever number of threads a worker has."""


def on_cluster(address: str, on_note: Callable[[str], None] = lambda _: None) -> Runs:
    """Return what makes the runs at a scheduler's address, ``tcp://HOST:PORT``.

    ``on_note`` is told what the user should know while waiting.

    Raises
    ------
    InputError
        dask.distributed is not installed, or nothing answers there.
    """
    client = _connect(address)

    def runs(tasks: Sequence[Task], run: RunOne) -> Generator[RunRow]:
        with closing(client):
            if not tasks:
                return
            if not client.scheduler_info(n_workers=-1)["workers"]:
                on_note(f"no workers at {address} yet: dask worker {address}")
            yield from _rows(client, tasks, run)

    return runs


def _connect(address: str) -> Client:
    try:
        from distributed import Client  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise InputError(f"--scheduler {address}: {EXTRA}") from error
    # A lost connection is one message of ours, and not its traceback as well.
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
    try:
        return Client(address, timeout=CONNECT_S, name="dualbend-sweep")
    except (OSError, ValueError, TypeError) as error:
        raise InputError(
            f"--scheduler {address}: no scheduler answers; needs tcp://HOST:PORT of one that runs "
            f"(dask scheduler): {error}"
        ) from error


def _rows(client: Client, tasks: Sequence[Task], run: RunOne) -> Generator[RunRow]:
    from distributed import as_completed  # noqa: PLC0415 - an extra

    expected = result_versions()
    # Not pure: the same scenario twice in a list is two runs.
    futures = {
        client.submit(run_there, run, index, scenario, expected, pure=False): index
        for index, scenario in tasks
    }
    try:
        for future in as_completed(list(futures)):
            yield _row(future, futures[future])
            futures.pop(future)
    finally:
        if futures and client.status == "running":  # interrupted, or given up
            client.cancel(list(futures))


def _row(future: Future, index: int) -> RunRow:
    from distributed import KilledWorker  # noqa: PLC0415 - an extra

    if future.status == "finished":
        row: RunRow = future.result()
        return row
    if future.status != "error":
        raise DualbendError(
            "the scheduler is gone; the runs that were done are kept, the same command goes on"
        )
    error = future.exception()
    if isinstance(error, KilledWorker):
        return RunRow(index=index, outcome=RAISED, reason=KILLED)
    if isinstance(error, DualbendError):
        raise error
    raise DualbendError(
        f"a worker cannot run it: {type(error).__name__}: {error}; "
        "is the same dualbend installed there?"
    )


def run_there(run: RunOne, index: int, scenario: Scenario, expected: dict[str, str]) -> RunRow:
    """Make a run in a worker, in one thread; DualbendError where its versions are others."""
    found = result_versions()
    for name, version in expected.items():
        if found.get(name) != version:
            raise DualbendError(
                f"a worker has {name} {found.get(name)}, this sweep {version}: "
                "install the same there"
            )
    from threadpoolctl import threadpool_limits  # noqa: PLC0415 - an extra

    with _ONE_AT_A_TIME, threadpool_limits(1):
        return run(index, scenario)
