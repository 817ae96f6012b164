"""How many small faults in a package its tests find: ``python tests/lanes/mutation.py``.

A seeded draw of the mutants of a package (`mutants.py`) is put into the running code one by one,
and the tests that run the mutated line are run, the fastest first, until one fails. One process
collects the tests, finds out in a fork of its own for each which lines it runs, and forks for each
mutant: in the fork the code of the mutated function is replaced, or, where the line runs on import,
the package is imported again from the mutated text.

Results go to ``--out``, a line for each mutant; a second call goes on where the first ended, and
runs again what survived and has new tests. Killed: a test fails, the import fails or the CPU time
is beyond three times that of the tests. A mutant whose tests need more than `BUDGET_S` gets the
fastest of them only, which can only lower the score.
"""

from __future__ import annotations

import argparse
import ast
import gc
import hashlib
import importlib.abc
import importlib.machinery
import importlib.util
import json
import math
import os
import pickle
import resource
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from types import CodeType, FrameType, FunctionType, ModuleType
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")  # a fork has one thread
os.environ.setdefault("MUJOCO_GL", "egl")

import pytest
from hypothesis import Phase, settings
from mutants import Mutant, mutants, mutated

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "src" / "dualbend"
PACKAGES = {
    "beam": ("beam/**/*.py",),
    "control": ("control/**/*.py",),
    "mechanics": ("mechanics/**/*.py",),
    "scene": ("scene/**/*.py",),
    "metrics": ("evaluation/**/*.py", "task/*/metrics.py"),
}
"""Files of each package that has a score; the metrics are those of every run and of each task."""

TESTS = ("arm", "beam", "control", "evaluation", "mechanics", "planning", "run", "scene")
TESTS += ("stability", "task")
REFERENCE = "scenario/test_keys.py::test_the_committed_reference_is_current"
"""The test that sees every default of a scenario's key, on the page that lists them."""
LAST = (REFERENCE, "scene/test_models_on_record.py")
"""Tests that see all of a kind: whatever they cost, a mutant that they can see gets them, last."""
PRELOADED = ("mujoco", "scipy.signal", "scipy.optimize", "scipy.integrate", "mink", "pyarrow")
"""What the tests import while they run, imported once instead of once for each mutant."""
BUDGET_S = 3.0
"""CPU time of all tests that one mutant gets [s]."""
SLOWEST_S = 6.0
"""A test that needs more is not used."""


def wilson(killed: int, drawn: int, z: float = 1.96) -> tuple[float, float]:
    """Return the 95 % interval of a share, after Wilson (1927)."""
    share, spread = killed / drawn, z * z / drawn
    middle = (share + spread / 2) / (1 + spread)
    half = z / (1 + spread) * math.sqrt(share * (1 - share) / drawn + spread / (4 * drawn))
    return middle - half, middle + half


def files_of(package: str) -> list[Path]:
    """Return the source files of a package."""
    return sorted(path for glob in PACKAGES[package] for path in SOURCE.glob(glob))


def module_of(path: Path) -> str:
    """Return the name under which a source file is imported."""
    parts = path.relative_to(SOURCE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def drawn(package: str, count: int, seed: int) -> list[tuple[Mutant, Path, int]]:
    """Return the first mutants of a package in the order that the seed gives them."""
    every = [
        (mutant, path, number)
        for path in files_of(package)
        for number, mutant in enumerate(mutants(module_of(path), path))
    ]
    return sorted(every, key=lambda one: one[0].rank(seed))[:count]


def forked(task: Callable[[], Any], cpu_s: float) -> Any:
    """Return what a task returns in a process of its own; None where it died or took too long."""
    read, write = os.pipe()
    child = os.fork()
    if not child:
        os.close(read)
        try:
            quiet = os.open(os.devnull, os.O_RDWR)
            for stream in (0, 1, 2):
                os.dup2(quiet, stream)
            limit = math.ceil(cpu_s)
            resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 1))
            resource.setrlimit(resource.RLIMIT_AS, (16 << 30, 16 << 30))
            with os.fdopen(write, "wb") as stream:
                pickle.dump(task(), stream)
        finally:
            os._exit(0)
    os.close(write)
    with os.fdopen(read, "rb") as stream:
        data = stream.read()
    os.waitpid(child, 0)
    return pickle.loads(data) if data else None


class Lines:
    """The lines of some files that run while it is set."""

    def __init__(self, files: list[Path]) -> None:
        self.run: dict[str, set[int]] = {str(path): set() for path in files}

    def __enter__(self) -> dict[str, set[int]]:
        sys.settrace(self._call)
        return self.run

    def __exit__(self, *_: object) -> None:
        sys.settrace(None)

    def _call(self, frame: FrameType, event: str, _: object) -> Any:
        lines = self.run.get(frame.f_code.co_filename)
        if lines is None:
            return None

        def local(frame: FrameType, event: str, _: object) -> Any:
            if event == "line":
                lines.add(frame.f_lineno)
            return local

        return local


class Lane:
    """A plugin of pytest that runs mutants instead of the collected tests."""

    def __init__(self, options: argparse.Namespace) -> None:
        self.options = options
        self.files = [path for package in PACKAGES for path in files_of(package)]
        self.imported = Lines(self.files)
        self.out = Path(options.out)
        self.out.mkdir(parents=True, exist_ok=True)

    def pytest_sessionstart(self) -> None:
        """Let a property test end at the first example that fails, however large."""
        phases = (Phase.explicit, Phase.generate)
        settings.register_profile("lane", settings.get_profile("dualbend"), phases=phases)
        settings.load_profile("lane")

    def pytest_collection(self) -> None:
        """Record what runs on import."""
        sys.settrace(self.imported._call)

    def pytest_collection_finish(self) -> None:
        """End the record, with all files that are imported on use only."""
        for path in self.files:
            importlib.import_module(module_of(path))
        sys.settrace(None)
        for name in PRELOADED:
            importlib.import_module(name)

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Run the mutants."""
        if session.testsfailed:
            raise session.Interrupted("the tests cannot be collected")
        self.functions = functions_of(self.files)
        gc.freeze()
        ran = self.map(session)
        chosen = drawn(self.options.package, self.options.count, self.options.seed)
        path = self.out / f"{self.options.package}-{self.options.seed}.jsonl"
        known = {row["key"]: row for row in _rows(path)}
        items = {item.nodeid: item for item in session.items}
        with path.open("a", encoding="utf-8") as stream:
            for mutant, file, number in chosen:
                tests, costs = self.tests_of(mutant, file, ran)
                before = known.get(mutant.key)
                state = _state([items[test] for test in tests])
                if before and (before["by"] or before["state"] == state):
                    continue
                by = self.result(session, mutant, file, number, [items[t] for t in tests], costs)
                row = {**vars(mutant), "by": by, "tests": tests, "state": state}
                stream.write(json.dumps(row) + "\n")
                stream.flush()
        return True

    def map(self, session: pytest.Session) -> dict[str, Any]:
        """Return for each test its CPU time and the lines that it runs.

        Of an earlier call where the test's file and the source files that it runs are the same.
        """
        path = self.out / "tests.pickle"
        known = pickle.loads(path.read_bytes()) if path.exists() else {}
        now = {_relative(file): _digest(file) for file in self.files}
        for count, item in enumerate(session.items):
            key = item.nodeid, _digest(item.path)
            _, lines, then = known.get(key) or (0.0, {}, None)
            if then is None or any(now.get(file) != then.get(file) for file in lines):
                known[key] = *(forked(partial(self.one, item), SLOWEST_S) or (0.0, {})), now
                if count % 50 == 0:
                    _replace(path, known)
        _replace(path, known)
        chosen = {item.nodeid: known[item.nodeid, _digest(item.path)] for item in session.items}
        return {test: (cost, lines) for test, (cost, lines, _) in chosen.items() if cost}

    def one(self, item: pytest.Item) -> tuple[float, dict[str, set[int]]] | None:
        """Run a test alone; None where it fails without a mutant."""
        start = time.process_time()
        with Lines(self.files) as run:
            failed = _first_failure([item])
        lines = {_relative(Path(file)): numbers for file, numbers in run.items() if numbers}
        return None if failed else (time.process_time() - start, lines)

    def tests_of(self, mutant: Mutant, file: Path, ran: dict[str, Any]) -> tuple[list[str], float]:
        """Return the tests that a mutant gets, the fastest first, and their CPU time."""
        name, lines = _relative(file), set(range(mutant.first, mutant.last + 1))
        if self.on_import(mutant, file):
            own = (f"tests/{self.options.package}/", f"tests/{REFERENCE}")
            covering = [t for t in ran if ran[t][1].get(name) or t.startswith(own)]
        else:
            covering = [t for t in ran if not lines.isdisjoint(ran[t][1].get(name, ()))]
        total, tests = 0.0, []
        for test in sorted(covering, key=lambda t: (not ran[t][1].get(name), ran[t][0])):
            total += ran[test][0]
            if total > BUDGET_S and len(tests) >= 10:
                break
            tests.append(test)
        last = [test for test in covering if any(name in test for name in LAST)]
        tests += [test for test in last if test not in tests]
        return tests, sum(ran[test][0] for test in tests)

    def on_import(self, mutant: Mutant, file: Path) -> bool:
        """Tell whether the line of a mutant runs when its module is imported."""
        at_import = self.imported.run[str(file)]
        return not mutant.function or any(
            line in at_import for line in range(mutant.first, mutant.last + 1)
        )

    def result(
        self,
        session: pytest.Session,
        mutant: Mutant,
        file: Path,
        number: int,
        items: list[pytest.Item],
        costs: float,
    ) -> str | None:
        """Return the test that finds a mutant; None where none does."""
        if not items:
            return None
        tree = mutated(file, number)
        limit = 10.0 + 3.0 * costs

        def swapped() -> str:
            for code in _codes(compile(tree, str(file), "exec")):
                for function in self.functions.get(_name(code), ()):
                    function.__code__ = code
            return _first_failure(items)

        def imported() -> str:
            return _again(mutant.module, file, tree, [item.nodeid for item in items])

        task = imported if self.on_import(mutant, file) else swapped
        found = forked(task, limit)
        return "time or crash" if found is None else found or None


def functions_of(files: list[Path]) -> dict[tuple[str, int, str], list[FunctionType]]:
    """Return all functions that live and were made from some files, by where their code is."""
    wanted = {str(file) for file in files}
    found: dict[tuple[str, int, str], list[FunctionType]] = {}
    for each in gc.get_objects():
        if type(each) is FunctionType and each.__code__.co_filename in wanted:
            found.setdefault(_name(each.__code__), []).append(each)
    return found


def _name(code: CodeType) -> tuple[str, int, str]:
    return code.co_filename, code.co_firstlineno, code.co_qualname


def _codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


def _first_failure(items: list[pytest.Item]) -> str:
    """Run tests until one fails; return its name, or nothing."""
    session = items[0].session
    for item, after in zip(items, [*items[1:], None], strict=True):
        item.config.hook.pytest_runtest_protocol(item=item, nextitem=after)
        if session.testsfailed:
            return item.nodeid
    return ""


class _Finder(importlib.abc.MetaPathFinder, importlib.machinery.SourceFileLoader):
    """Imports one module from a tree that was mutated."""

    def __init__(self, module: str, file: Path, tree: ast.Module) -> None:
        super().__init__(module, str(file))
        self.tree = tree

    def find_spec(self, fullname: str, path: object, target: ModuleType | None = None) -> Any:
        if fullname != self.name:
            return None
        return importlib.util.spec_from_file_location(fullname, self.path, loader=self)

    def get_code(self, fullname: str) -> CodeType:
        return compile(self.tree, self.path, "exec")


class _Names:
    """A plugin that notes the first test that fails."""

    failed = ""

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed and not self.failed:
            self.failed = report.nodeid


def _again(module: str, file: Path, tree: ast.Module, tests: list[str]) -> str:
    """Import all that is of this repository again, one module mutated, and run tests."""
    for name, each in list(sys.modules.items()):
        where = getattr(each, "__file__", None) or ""
        if where.startswith(str(ROOT)) and not where.startswith(str(Path(__file__).parent)):
            del sys.modules[name]
    sys.meta_path.insert(0, _Finder(module, file, tree))
    names = _Names()
    code = pytest.main([*ARGUMENTS, "-x", *tests], plugins=[names])
    return names.failed or ("import" if code else "")


ARGUMENTS = (
    "-q",
    "-s",
    "-p",
    "no:cacheprovider",
    "-p",
    "no:xdist",
    "--tb=native",
    f"--rootdir={ROOT}",
)


def _relative(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _state(items: list[pytest.Item]) -> str:
    """Return what tells these tests, as their files are now, from others."""
    told = "".join(item.nodeid + _digest(item.path) for item in items)
    return hashlib.sha256(told.encode()).hexdigest()


def _replace(path: Path, what: object) -> None:
    """Write beside and swap in: another package's call may read it meanwhile."""
    beside = path.with_suffix(f".{os.getpid()}")
    beside.write_bytes(pickle.dumps(what))
    beside.replace(path)


def _rows(path: Path) -> list[dict[str, Any]]:
    if not path.exists():
        return []
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def table(options: argparse.Namespace) -> Iterator[str]:
    """Yield the scores of the results as a Markdown table."""
    yield "| package | mutants | drawn and run | killed | score | 95 % interval |"
    yield "|---|---|---|---|---|---|"
    for package in PACKAGES:
        every = drawn(package, sys.maxsize, options.seed)
        path = Path(options.out) / f"{package}-{options.seed}.jsonl"
        rows = {row["key"]: row for row in _rows(path)}
        run = [rows[m.key] for m, _, _ in every[: options.count] if m.key in rows]
        if not run:
            continue
        killed = sum(bool(row["by"]) for row in run)
        low, high = (100.0 * end for end in wilson(killed, len(run)))
        yield (
            f"| {package} | {len(every)} | {len(run)} | {killed} | "
            f"{100.0 * killed / len(run):.1f} % | {low:.1f} … {high:.1f} % |"
        )


def survivors(options: argparse.Namespace) -> Iterator[str]:
    """Yield the mutants that no test found."""
    path = Path(options.out) / f"{options.package}-{options.seed}.jsonl"
    rows = {row["key"]: row for row in _rows(path)}
    for mutant, file, _ in drawn(options.package, options.count, options.seed):
        row = rows.get(mutant.key)
        if row and not row["by"]:
            where = f"{file.relative_to(ROOT)}:{mutant.line}"
            yield f"{where} {mutant.before} -> {mutant.after} ({len(row['tests'])} tests)"


def main() -> int:
    """Run the mutants of a package and print the scores of all that were run."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--package", choices=PACKAGES, help="run this one; without: print scores")
    parser.add_argument("--count", type=int, default=400, help="mutants that are drawn (400)")
    parser.add_argument("--seed", type=int, default=1, help="of the draw (1)")
    parser.add_argument("--out", default="runs/mutation", help="folder of the results")
    parser.add_argument("--tests", nargs="*", default=TESTS, help="folders of tests that may kill")
    options = parser.parse_args()
    if options.package:
        folders = [str(ROOT / "tests" / name) for name in (*options.tests, REFERENCE)]
        code = pytest.main([*ARGUMENTS, *folders], plugins=[Lane(options)])
        if code:
            return int(code)
        print("\n".join(survivors(options)))
    print("\n".join(table(options)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
