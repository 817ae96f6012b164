"""What studies of many runs share: processes, a folder that a study goes on in, a line a run.

A study's folder holds ``study.json`` (what the study is) and ``runs.jsonl`` (one run a line, in the
order in which they ended). A run's line is on disk before the next run is waited for.
"""

from __future__ import annotations

import itertools
import json
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Generator, Hashable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import IO, Any, Generic, TypeVar, TypeVarTuple

import msgspec

from dualbend.errors import DualbendError, InputError
from dualbend.run.output import prepare_folder, uninterrupted

STUDY, RUNS, LOCK = "study.json", "runs.jsonl", ".lock"

_THREADS = (
    *("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS"),
    *("VECLIB_MAXIMUM_THREADS", "NUMEXPR_NUM_THREADS"),
)

Result = TypeVar("Result")
Line = TypeVar("Line", bound=msgspec.Struct)
Task = TypeVarTuple("Task")


class WorkerDiedError(DualbendError):
    """A worker process ended with ``running`` tasks that nobody has a result of."""

    def __init__(self, running: Sequence[tuple[Any, ...]]) -> None:
        super().__init__(
            "a worker process died, out of memory perhaps; the runs that were done are kept, "
            "the same command goes on"
        )
        self.running = list(running)


def in_processes(
    tasks: Sequence[tuple[*Task]],
    run: Callable[[*Task], Result],
    workers: int,
    pool: Callable[..., Executor] = ProcessPoolExecutor,
) -> Generator[Result]:
    """Yield ``run(*task)`` of each as it ends; each process computes in one thread.

    ``run`` must be importable in another process. A generator that is closed ends its processes.

    Raises
    ------
    WorkerDiedError
        A process ended before its task did.
    """
    if not tasks:
        return
    strangers = set(multiprocessing.active_children())
    processes = pool(
        min(workers, len(tasks)),
        multiprocessing.get_context("spawn"),
        initializer=_belong_to_the_parent,
    )
    left = iter(tasks)
    running: dict[Future[Result], tuple[*Task]] = {}

    def submit(count: int) -> None:
        # A new process must not be interrupted before it can say that it is not to be.
        with uninterrupted():
            for task in itertools.islice(left, count):
                running[processes.submit(run, *task)] = task

    with one_thread_each():
        try:
            # One waits for each that runs, so that no process does; no more, since what waits in
            # the pool's queue cannot be called back.
            submit(2 * min(workers, len(tasks)))
            while running:
                ended, _ = wait(running, return_when=FIRST_COMPLETED)
                whole = [f for f in running if f in ended and not _lost(f)]
                if len(whole) == len(ended):
                    submit(len(ended))
                for future in whole:
                    running.pop(future)
                    yield future.result()
                if len(whole) < len(ended):
                    raise WorkerDiedError(list(running.values()))
        except BrokenProcessPool as error:  # at a submission
            raise WorkerDiedError(list(running.values())) from error
        finally:
            if running:  # interrupted, or given up
                for process in set(multiprocessing.active_children()) - strangers:
                    process.terminate()
            processes.shutdown(cancel_futures=True)


def _lost(future: Future[Any]) -> bool:
    return isinstance(future.exception(), BrokenProcessPool)


def _belong_to_the_parent() -> None:
    """Leave interrupts to the parent, and end when it does, also where it is killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
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


class StudyFolder(Generic[Line]):
    """A study's folder, which one process at a time writes.

    ``kind`` is what a line of ``runs.jsonl`` holds, ``noun`` its name in a message, and ``key``
    what tells one from another.
    """

    def __init__(
        self, folder: Path, kind: type[Line], noun: str, key: Callable[[Line], Hashable]
    ) -> None:
        self.folder = folder
        self._kind, self._noun, self._key = kind, noun, key

    @contextmanager
    def opened(
        self, study: Mapping[str, Any], files: Mapping[str, str], name: str = "study"
    ) -> Iterator[tuple[dict[Hashable, Line], Callable[[Line], None]]]:
        """Make the folder or go on with it; give the lines that it has and what adds one.

        ``study`` is what the folder is of; ``files`` are texts to write into a new one.

        Raises
        ------
        InputError
            It holds another study, is in use or cannot be used, or a line is none of its kind.
        """
        prepare_folder(self.folder)
        with self._locked():
            try:
                self._make(study, files, name)
                done = self._read()
                file = (self.folder / RUNS).open("ab")
            except OSError as error:
                raise InputError(f"--out {self.folder}: {error.strerror or error}") from error
            with file:
                yield done, lambda line: _append(file, line)

    def _make(self, study: Mapping[str, Any], files: Mapping[str, str], name: str) -> None:
        path = self.folder / STUDY
        if path.exists():
            try:
                found = json.loads(path.read_text(encoding="utf-8"))
            except ValueError as error:
                raise InputError(f"{path}: no valid JSON: {error}") from error
            self._refuse_other(study, found, name)
            return
        if (self.folder / RUNS).exists():
            raise InputError(
                f"--out {self.folder}: has {RUNS} but no {STUDY}: whose runs are they?"
            )
        for file, text in files.items():
            (self.folder / file).write_text(text, encoding="utf-8")
        part = path.with_suffix(".part")
        part.write_text(json.dumps(study, indent=2) + "\n", encoding="utf-8")
        part.replace(path)

    def _refuse_other(self, study: Mapping[str, Any], found: object, name: str) -> None:
        for key, value in study.items():
            other = found.get(key) if isinstance(found, dict) else None
            if other != value:
                short = not any(isinstance(v, str) and "\n" in v for v in (value, other))
                change = f" ({key} = {other!r}, now {value!r})" if short else ""
                raise InputError(
                    f"--out {self.folder}: holds a {name} of another {key}{change}; "
                    "give another folder, or remove this one"
                )

    def _read(self) -> dict[Hashable, Line]:
        """Read the lines; cut off a last one that was not written to its end."""
        path = self.folder / RUNS
        if not path.exists():
            return {}
        data = path.read_bytes()
        whole = data.rfind(b"\n") + 1
        if whole < len(data):
            os.truncate(path, whole)
        lines = {}
        for number, text in enumerate(data[:whole].splitlines(), start=1):
            try:
                line = msgspec.json.decode(text, type=self._kind)
            except msgspec.DecodeError as error:
                raise InputError(f"{path}: line {number} is no {self._noun}: {error}") from error
            lines[self._key(line)] = line
        return lines

    @contextmanager
    def _locked(self) -> Iterator[None]:
        """Keep other processes out; the system takes the lock back whatever ends this one."""
        with (self.folder / LOCK).open("ab") as file:
            try:
                _lock(file)
            except OSError as error:
                raise InputError(
                    f"--out {self.folder}: another process is writing to it; "
                    "wait for its end, or give another folder"
                ) from error
            yield


def _append(file: IO[bytes], line: msgspec.Struct) -> None:
    with uninterrupted():
        file.write(msgspec.json.encode(line) + b"\n")
        file.flush()
        os.fsync(file.fileno())


if sys.platform == "win32":
    import msvcrt

    def _lock(file: IO[bytes]) -> None:
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)

else:
    import fcntl

    def _lock(file: IO[bytes]) -> None:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
