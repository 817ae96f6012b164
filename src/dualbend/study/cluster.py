"""Runs on a Dask cluster; a worker that is lost on the way costs time and no result."""

from __future__ import annotations

import ctypes
import logging
import threading
from collections.abc import Callable, Generator, Mapping
from concurrent.futures import Future
from contextlib import closing, suppress
from typing import TYPE_CHECKING

from dualbend.errors import DualbendError, InputError
from dualbend.evaluation.metrics import versions
from dualbend.study.engine import Arguments, Key, Lost, Place, Row, as_they_end

if TYPE_CHECKING:
    from distributed import Client

EXTRA = "a cluster needs dask.distributed: pip install 'dualbend[dask]'"
KILLED = "its workers died, one after the other"
CONNECT_S = 10.0
"""How long to try to reach a scheduler."""

_AT_ONCE = 10_000
"""Runs that a scheduler is given ahead: more than any cluster works on."""

_MAY_DIFFER = ("python", "rerun-sdk")

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _KEPT_BYTES = -1, -3, 64 << 20

_ONE_AT_A_TIME = threading.Lock()
"""MuJoCo's warning hook is of the process, whatever number of threads a worker has."""


def on_cluster(address: str, on_note: Callable[[str], None] = lambda _: None) -> Place:
    """Return what makes runs at a scheduler's address, ``tcp://HOST:PORT``.

    ``on_note`` is called with what the user should know while waiting. Raises InputError where
    dask.distributed is not installed, or nothing answers there.
    """
    client = _connect(address)

    def ended(
        tasks: Mapping[Key, tuple[*Arguments]], run_one: Callable[[*Arguments], Row]
    ) -> Generator[tuple[Key, Row | Lost]]:
        with closing(client):
            if tasks and not client.scheduler_info(n_workers=-1)["workers"]:
                on_note(f"no workers at {address} yet: dask worker {address}")
            # Not pure: the same scenario twice in a list is two runs.
            executor = client.get_executor(pure=False)
            expected = result_versions()
            calls = {key: (expected, run_one, *task) for key, task in tasks.items()}
            try:
                for key, future in as_they_end(executor, calls, run_there, _AT_ONCE):
                    row = _row(future)
                    yield key, row
            finally:
                if client.status == "running":  # else there is nobody to ask
                    executor.shutdown(wait=False)

    return ended


def _connect(address: str) -> Client:
    try:
        from distributed import Client  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise InputError(f"--scheduler {address}: {EXTRA}") from error
    # A lost connection is one message of ours, and not its traceback as well.
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
    try:
        return Client(address, timeout=CONNECT_S, name="dualbend-sweep")
    # An assertion of its own fails where its time is over while it connects, on a busy machine.
    except (OSError, ValueError, TypeError, AssertionError) as error:
        raise InputError(
            f"--scheduler {address}: no scheduler answers; needs tcp://HOST:PORT of one that runs "
            f"(dask scheduler): {error}"
        ) from error


def _row(future: Future[Row]) -> Row | Lost:
    from distributed import KilledWorker  # noqa: PLC0415 - an extra

    if future.cancelled():
        raise DualbendError(
            "the scheduler is gone; the runs that were done are kept, the same command goes on"
        )
    error = future.exception()
    if error is None:
        return future.result()
    if isinstance(error, KilledWorker):
        return Lost(KILLED)
    if isinstance(error, DualbendError):
        raise error
    raise DualbendError(
        f"a worker cannot run it: {type(error).__name__}: {error}; "
        "is the same dualbend installed there?"
    )


def run_there(
    expected: dict[str, str], run_one: Callable[[*Arguments], Row], *arguments: *Arguments
) -> Row:
    """Make a run in a worker, in one thread; DualbendError where its versions are others."""
    found = result_versions()
    for name, version in expected.items():
        if found.get(name) != version:
            raise DualbendError(
                f"a worker has {name} {found.get(name)}, this sweep {version}: "
                "install the same there"
            )
    from threadpoolctl import threadpool_limits  # noqa: PLC0415 - an extra

    _keep_memory()
    with _ONE_AT_A_TIME, threadpool_limits(1):
        return run_one(*arguments)


def _keep_memory() -> None:
    """Let glibc keep what is freed, as it does by default: by Dask's it faults 20 times as often.

    Dask starts its workers with MALLOC_TRIM_THRESHOLD_ = 64 KiB; a batch frees as much in each
    cycle. With other libraries there is nothing to set.
    """
    with suppress(OSError, AttributeError, TypeError):
        c_library = ctypes.CDLL(None)
        c_library.mallopt(_M_MMAP_THRESHOLD, _KEPT_BYTES // 2)
        c_library.mallopt(_M_TRIM_THRESHOLD, _KEPT_BYTES)


def result_versions() -> dict[str, str]:
    """Return the versions that must be the same wherever a study's runs are made."""
    return {name: v for name, v in versions().items() if name not in _MAY_DIFFER}
