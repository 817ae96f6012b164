"""Runs in processes of this machine, each of which computes in one thread."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Generator, Iterator, Mapping
from concurrent.futures import Executor, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from multiprocessing.process import BaseProcess

from dualbend.errors import refuse_below_one
from dualbend.interrupts import ENDING_SIGNALS, uninterrupted
from dualbend.resources import usable_cores
from dualbend.study.engine import Arguments, Key, Lost, Place, Row, WorkerDiedError, as_they_end

DIED = "the process that ran it died, also when it ran alone"

_THREADS = (
    *("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS"),
    *("VECLIB_MAXIMUM_THREADS", "NUMEXPR_NUM_THREADS"),
)


def in_processes(workers: int | None = None) -> Place:
    """Return what makes runs in so many processes at most, by default one for each core.

    A run whose process dies is tried once more, alone; one that dies again is lost. Raises
    InputError for less than one, and WorkerDiedError, when runs are made, where not even a process
    that does next to nothing lives.
    """
    if workers is not None:
        refuse_below_one(workers=workers)

    def ended(
        tasks: Mapping[Key, tuple[*Arguments]], run_one: Callable[[*Arguments], Row]
    ) -> Generator[tuple[Key, Row | Lost]]:
        left = dict(tasks)
        while left:
            count, died = min(workers or usable_cores(), len(left)), []
            with _pool(count) as pool:
                # One waits for each that runs, so that no process does; no more, since what waits
                # in the pool's queue cannot be called back.
                for key, future in as_they_end(pool, left, run_one, 2 * count):
                    if isinstance(future.exception(), BrokenProcessPool):
                        died.append(key)
                    else:
                        yield key, future.result()
                        del left[key]
            for key in died:
                yield key, _alone(left.pop(key), run_one)

    return ended


def _alone(task: tuple[*Arguments], run_one: Callable[[*Arguments], Row]) -> Row | Lost:
    with suppress(BrokenProcessPool):
        return _one(run_one, task)
    try:
        _one(os.getpid, ())
    except BrokenProcessPool as error:
        raise WorkerDiedError from error
    return Lost(DIED)


def _one(function: Callable[[*Arguments], Row], arguments: tuple[*Arguments]) -> Row:
    with _pool(1) as pool:
        ((_, future),) = as_they_end(pool, {None: arguments}, function, 1)
        return future.result()


@contextmanager
def _pool(count: int) -> Iterator[Executor]:
    """Give processes that end with the block, at once where it is left by an exception."""
    strangers = set(multiprocessing.active_children())
    if os.name == "posix":
        # Starting it unblocks interrupts; new processes are to have them blocked. It itself knows
        # of Ctrl-C, but not of a terminal that is closed: SIGHUP would end it before its time.
        with uninterrupted():
            resource_tracker.ensure_running()
    pool = ProcessPoolExecutor(
        count, multiprocessing.get_context("spawn"), initializer=_belong_to_the_parent
    )
    with one_thread_each():
        try:
            yield pool
        except BaseException:  # interrupted, or given up
            for process in set(multiprocessing.active_children()) - strangers:
                process.terminate()
            raise
        finally:
            pool.shutdown(cancel_futures=True)


def _belong_to_the_parent() -> None:
    """Leave interrupts to the parent, and end when it does, also where it is killed."""
    for number in ENDING_SIGNALS:
        signal.signal(number, signal.SIG_DFL if number == signal.SIGTERM else signal.SIG_IGN)
    if os.name == "posix":
        # Blocked while the process began; the parent ends it by this.
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_follow, args=(parent,), daemon=True).start()


def _follow(parent: BaseProcess) -> None:
    parent.join()
    os._exit(1)


@contextmanager
def one_thread_each() -> Iterator[None]:
    """Let the processes that are started meanwhile compute in one thread each."""
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
