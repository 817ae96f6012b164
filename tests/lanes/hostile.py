"""Wrong input on purpose: mutated scenarios and sweeps, arguments and environments of a command.

    python tests/lanes/hostile.py scenarios --count 2000 --seed 1
    python tests/lanes/hostile.py sweeps --count 2000 --seed 1
    python tests/lanes/hostile.py arguments --count 300 --seed 1

Judged, of every case: no traceback, no hang, an exit code that is documented, and a message of one
line of bounded length where the input is refused. A case depends on the seed and its number alone;
what fails is printed with the command that makes it again.
"""

from __future__ import annotations

import argparse
import collections
import multiprocessing
import os
import random
import re
import subprocess
import sys
import tempfile
import traceback
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TypeAlias

from wrong_commands import Case, case_of
from wrong_scenarios import mutated, mutated_sweep

Mutate: TypeAlias = Callable[[random.Random], tuple[str, bytes]]
EndOf: TypeAlias = Callable[[Path, str], tuple[str, str]]

LONGEST_MESSAGE = 600
CYCLES = 5
"""Of a scenario that is accepted: it is made ready, begun, interrupted, and summed up."""
SCENARIO_S, COMMAND_S = 90.0, 120.0
"""A case that takes longer hangs: the slowest shipped scenario needs a tenth of it."""
CODES = {0, 1, 2, 3, 129, 130, 143}


def main() -> int:
    """Make the cases that the command line asks for; the exit code is 1 where one fails."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("kind", choices=["scenarios", "sweeps", "arguments"])
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--only", type=int, help="Number of the one case to make.")
    given = parser.parse_args()
    judge = {"scenarios": judge_scenario, "sweeps": judge_sweep, "arguments": judge_command}[
        given.kind
    ]
    numbers = range(given.count) if given.only is None else [given.only]
    ends: collections.Counter[str] = collections.Counter()
    failed = 0
    with ThreadPoolExecutor(given.workers) as pool:
        judged = pool.map(lambda number: judge(given.seed, number), numbers)
        for number, (end, wrong) in zip(numbers, judged, strict=True):
            ends[end] += 1
            if wrong or given.only is not None:
                print(f"{number}: {end}: {wrong or 'as it should'}", flush=True)
            if wrong:
                failed += 1
                again = f"{given.kind} --seed {given.seed} --only {number}"
                print(f"    again: python tests/lanes/hostile.py {again}", flush=True)
    print(", ".join(f"{count} {end}" for end, count in ends.most_common()))
    print(f"{len(numbers)} {given.kind}, seed {given.seed}: {failed} failed")
    return int(failed > 0)


def generator(seed: int, number: int) -> random.Random:
    """Return the source of a case's chance."""
    return random.Random(f"{seed}-{number}")


# -- scenarios -------------------------------------------------------------------------------------


def judge_scenario(seed: int, number: int) -> tuple[str, str]:
    """Return how a mutated scenario ended, and what is wrong with that, "" where nothing is."""
    return _judged(mutated, _end_of, seed, number)


def judge_sweep(seed: int, number: int) -> tuple[str, str]:
    """Return whether a mutated sweep's file is refused, and what is wrong with that."""
    return _judged(mutated_sweep, _end_of_sweep, seed, number)


def _judged(mutate: Mutate, end_of: EndOf, seed: int, number: int) -> tuple[str, str]:
    ours, theirs = FORK.Pipe(duplex=False)
    process = FORK.Process(target=_tell_end, args=(mutate, end_of, seed, number, theirs))
    process.start()
    theirs.close()
    try:
        if not ours.poll(SCENARIO_S):
            process.kill()
            return "hang", f"longer than {SCENARIO_S:g} s: {mutate(generator(seed, number))[0]}"
        end, wrong = ours.recv()
    except EOFError:
        process.join()
        return "died", f"exit code {process.exitcode}: {mutate(generator(seed, number))[0]}"
    process.join()
    return end, wrong


def _tell_end(
    mutate: Mutate, end_of: EndOf, seed: int, number: int, to: multiprocessing.connection.Connection
) -> None:
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # what MuJoCo and NumPy warn of
    said, content = mutate(generator(seed, number))
    try:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "case.toml"
            path.write_bytes(content)
            to.send(end_of(path, said))
    except BaseException:
        to.send(("traceback", f"{said}\n{traceback.format_exc()}"))


def _end_of(path: Path, said: str) -> tuple[str, str]:
    """Load, make ready, run some cycles and sum up."""
    from dualbend import InputError, load_scenario, make_run

    def stop(cycles: int) -> None:
        if cycles == CYCLES:
            raise KeyboardInterrupt

    end = "refused when loaded"
    try:
        scenario = load_scenario(str(path))
        path.write_text(scenario.to_toml(), encoding="utf-8")
        if load_scenario(str(path)) != scenario:
            return "another when read again", said
        end = "refused when made ready"
        result = make_run(scenario).run(on_cycle=stop)
        result.summary.to_json()
    except InputError as error:
        return end, _wrong_message(str(error), said)
    return result.outcome, _wrong_message(result.reason, said)


def _end_of_sweep(path: Path, said: str) -> tuple[str, str]:
    """Load, and put the runs together."""
    from dualbend import InputError
    from dualbend.study.sweep.design import make_design
    from dualbend.study.sweep.file import load_sweep

    try:
        sweep = load_sweep(path)
        make_design(sweep)
        sweep.to_toml()
    except InputError as error:
        return "refused", _wrong_message(str(error), said)
    return "accepted", ""


def _wrong_message(message: str, said: str) -> str:
    if len(message) > LONGEST_MESSAGE or "\n" in message:
        return f"{said}: {len(message)} characters, {message.count(chr(10)) + 1} lines: {message}"
    return ""


# -- arguments and environment ---------------------------------------------------------------------


def judge_command(seed: int, number: int) -> tuple[str, str]:
    """Return how a command ended, and what is wrong with that."""
    with tempfile.TemporaryDirectory() as folder:
        case = case_of(generator(seed, number), Path(folder))
        try:
            done = subprocess.run(
                case.shell(),
                shell=True,
                check=False,
                executable="/bin/bash",
                cwd=folder,
                env=case.environment,
                capture_output=True,
                timeout=COMMAND_S,
            )
        except subprocess.TimeoutExpired:
            return "hang", f"longer than {COMMAND_S:g} s: {case}"
        wrong = list(_wrong_end(case, done, Path(folder)))
    shown = f"exit code {done.returncode}"
    return shown, f"{'; '.join(wrong)}: {case}\n{_text(done.stderr)[-2000:]}" if wrong else ""


def _wrong_end(case: Case, done: subprocess.CompletedProcess[bytes], folder: Path) -> Iterator[str]:
    said = _text(done.stderr)
    if "Traceback" in said + _text(done.stdout) or "Exception ignored" in said:
        yield "a traceback"
    if done.returncode not in CODES:
        yield f"exit code {done.returncode}"
    if done.returncode == 1 and case.arguments[:1] not in (("check",), ("validate",), ("tune",)):
        yield "exit code 1 without a check"
    if case.codes and done.returncode not in case.codes:
        yield f"exit code {done.returncode}, not of {sorted(case.codes)}"
    messages = re.findall(r"^(?:dualbend|Error): .*$", said, re.MULTILINE)
    if len(messages) > 1:
        yield f"{len(messages)} messages"
    if done.returncode == 2 and case.hears and not messages:
        yield "no message"
    if messages and max(map(len, messages)) > LONGEST_MESSAGE:
        yield f"a message of {max(map(len, messages))} characters"
    for name in case.leaves:
        if not (folder / name).is_file():
            yield f"no {name}"


def _text(said: bytes) -> str:
    return said.decode("utf-8", "replace")


FORK = multiprocessing.get_context("fork")

if __name__ == "__main__":
    # Imported before the processes that are forked for each case.
    import dualbend.run.make
    import dualbend.study.sweep.design
    import dualbend.task.assembly.run
    import dualbend.task.bending.run  # noqa: F401

    sys.exit(main())
