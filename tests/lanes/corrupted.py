"""Folders that are corrupted, and the readers of them: ``python tests/lanes/corrupted.py``.

Makes a few small real folders (bending, assemblies that stop, a killed run, a sweep, a study of
robustness, one of the onset with made-up cases, a baseline), corrupts a copy of one a case, in
seeded ways, and lets a command read it: in a fork with a time limit, every twentieth case as a
process of its own. Fixed before any case is looked at, a case is wrong that

* ends in a traceback, a signal, after the limit, or with another exit code than 0 and 2 (and 1 of
  ``check``, where a value differs);
* is refused in more than one line, or 2000 characters, or without the name of the corrupted file;
* is accepted and reads otherwise than the folder did before it was corrupted.

The last is counted apart where nothing could contradict it: a row of a study, or a value of a
baseline, that is another plausible number; a run of version 0.1.0, whose files carry no check.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path[:0] = [str(Path(__file__).parents[1]), str(Path(__file__).parent)]

import msgspec  # noqa: E402
import pyarrow.parquet as pq  # noqa: E402
from click.testing import CliRunner  # noqa: E402
from corruptions import swapped, ways_for  # noqa: E402

from dualbend.check import check as checking  # noqa: E402
from dualbend.check.measure import Measured, measure  # noqa: E402
from dualbend.cli import main as cli  # noqa: E402
from dualbend.report import page  # noqa: E402, F401 - imported once, before the forks
from dualbend.report.results import write_results  # noqa: E402
from dualbend.run.disk.saved import load_run  # noqa: E402
from dualbend.run.make import make_run  # noqa: E402
from dualbend.scenario.load import load_scenario  # noqa: E402
from dualbend.study.folder import RUNS, STUDY, StudyFolder  # noqa: E402
from dualbend.study.onset import study as onsets  # noqa: E402
from dualbend.study.onset.design import grid  # noqa: E402
from dualbend.study.onset.results import Case, Rate, Simulated  # noqa: E402

LIMIT_S = 60.0
LONGEST_MESSAGE = 2000
AS_PROCESS = 20
"""Every so many cases the command is a process of its own."""

FILES = ("scenario.toml", "summary.json", "trace.parquet")
SHORT = ("path.end_rad=0.3", "motion.speed_rad_per_s=1.0", "motion.settle_s=0.3")
BRIEF = (*SHORT, "motion.hold_s=0.3")
OFF = ("task.errors.pickup_x_m=0.03",)
"""A jaw does not reach the sheet: the assembly is given up after two seconds."""

SWEEP = """
scenario = "bent.toml"
name = "swept"
[sample]
kind = "grid"
[keys.sheet.width_m]
values = [0.05, 0.06]
[keys.sensor.latency_ms]
values = [0, 4]
"""


@dataclass(frozen=True)
class Original:
    """A folder, the files in it that are corrupted, and the commands that read it ({} is it).

    ``weight``: of how often it is chosen; ``unchecked``: its values may be others unseen.
    """

    name: str
    files: tuple[str, ...]
    commands: tuple[tuple[str, ...], ...]
    weight: int = 2
    unchecked: bool = False


@dataclass
class Tally:
    """What became of the cases."""

    ended: Counter[str] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)
    unseen: list[str] = field(default_factory=list)


# -- the originals -------------------------------------------------------------------------------


def leave(folder: Path, scenario: str, settings: tuple[str, ...], until: int | None = None) -> None:
    """Run a scenario, stopped by the user after ``until`` cycles, and leave its numbers."""
    run = make_run(load_scenario(scenario, settings))

    def on_cycle(done: int) -> None:
        if done == until:
            raise KeyboardInterrupt

    assert write_results(run.run(on_cycle), folder, record=False) == []


def of_version_0_1_0(folder: Path, new: Path) -> None:
    """Leave a run as version 0.1.0 did: no file names it."""
    new.mkdir()
    text = (folder / "scenario.toml").read_text()
    (new / "scenario.toml").write_text(text.split("\n", 1)[1] if text[0] == "#" else text)
    raw = json.loads((folder / "summary.json").read_text())
    kept = {key: value for key, value in raw.items() if key not in ("run", "sha256")}
    (new / "summary.json").write_text(json.dumps(kept, indent=2) + "\n")
    table = pq.read_table(folder / "trace.parquet")
    about = json.loads(table.schema.metadata[b"dualbend"])
    kept = {
        k: v for k, v in about.items() if k not in ("run_id", "scenario_sha256", "values_sha256")
    }
    table = table.replace_schema_metadata({"dualbend": json.dumps(kept)})
    pq.write_table(table, new / "trace.parquet")


def killed(folder: Path) -> None:
    """Leave what a killed run does: its log alone."""
    code = (
        "import os, sys; from dualbend.cli import main; import dualbend.run.loop as loop\n"
        "send = loop.Run.send\n"
        "def dying(run, *a):\n"
        "    send(run, *a)\n"
        "    if run.trace.rows == 45: os.kill(os.getpid(), 9)\n"
        "loop.Run.send = dying; main()"
    )
    settings = [part for text in SHORT for part in ("--set", text)]
    words = ["run", "fig8", "--out", str(folder), "--no-record", *settings]
    subprocess.run([sys.executable, "-c", code, *words], capture_output=True, check=False)


def made_up_case(key: str, axis: Any, alpha: float, ray: float) -> Case:
    rates = (Rate(b=0.9, predicted_per_s=1.0, simulated_per_s=1.1),) * 2
    found = Simulated(
        b=1.0,
        unstable_b=0.995,
        stable_b=1.005,
        growing_b=0.995,
        frequency_hz=2.0,
        residual=1e-6,
        rates=rates,
        runs=9,
    )
    return Case(
        key=key,
        axis=axis,
        alpha_rad=alpha,
        ratio_per_s=ray,
        paper_b=0.5,
        delayed_b=0.9,
        sampled_b=1.01,
        sampled_hz=2.0,
        same_gains_hz=2.0,
        simulated=found,
        frictionless=found,
    )


def make_onset(folder: Path) -> None:
    """Leave an onset study whose cases are made up: a real one takes minutes."""
    folder.mkdir()
    tasks = onsets._tasks(load_scenario("fig8"), grid(("rotation",)))
    cases = [made_up_case(key, *task[2:]) for key, task in tasks.items()]
    study = StudyFolder(folder=folder, row=Case, study={"kind": "onset"})
    (folder / STUDY).write_text(json.dumps(study.study))
    (folder / RUNS).write_bytes(b"".join(study.line(case) for case in cases))


def call(*words: str) -> None:
    """Run a command that must succeed."""
    result = CliRunner().invoke(cli, list(words))
    assert result.exit_code == 0, (words, result.output)


def make_originals(top: Path) -> None:
    """Make the folders below ``top``."""
    for name, scenario, settings, until in (
        ("bent", "fig8", BRIEF, None),
        ("bent-seed", "fig8", (*BRIEF, "seed=2"), None),
        ("bent-set", "fig8", (*BRIEF, "sensor.latency_ms=4"), None),
        ("bent-few", "fig8", (*BRIEF, "sheet.model.hinges=10"), None),
        ("bent-fig6", "fig6", BRIEF, None),
        ("stopped", "fig8", BRIEF, 15),
        ("aborted", "pwb", OFF, None),
        ("laying", "pwb", (), 100),
    ):
        leave(top / name, scenario, settings, until)
    of_version_0_1_0(top / "bent", top / "old")
    of_version_0_1_0(top / "bent-seed", top / "old-seed")
    killed(top / "killed")
    (top / "bent.toml").write_text(load_scenario("fig8", BRIEF).to_toml())
    (top / "off.toml").write_text(load_scenario("pwb", OFF).to_toml())
    (top / "swept.toml").write_text(SWEEP)
    make_onset(top / "onset")
    call("sweep", str(top / "swept.toml"), "--out", str(top / "swept"), "--workers", "1")
    call(*robustness(top), str(top / "robust"))
    (top / "checked").mkdir()
    shutil.copy(top / "bent.toml", top / "checked" / "bent.toml")
    os.chdir(top / "checked")
    call("check", "bent.toml", "--baseline", "baseline.json", "--update")
    os.chdir("/")


def robustness(top: Path) -> tuple[str, ...]:
    """Return the command of the study of robustness, without its folder."""
    return ("robustness", str(top / "off.toml"), "--runs", "2", "--workers", "1", "--out")


def originals_in(top: Path) -> list[Original]:
    """Return the folders below ``top``, and who reads them."""
    good, html = str(top / "bent"), ("--out", "{}.html")
    run = (
        ("report", "{}", *html),
        ("report", "{}", good, *html),
        ("compare", "{}", good),
        ("compare", good, "{}"),
        ("compare", good, "{}", "--out", "{}-compared", "--no-record"),
        ("compare", "{}", good, "--out", "{}-compared"),
    )
    log = next((top / "killed").rglob("trace.arrow")).relative_to(top / "killed")
    onset = ("stability", "fig8", "--validate", "--axis", "rotation", "--out", "{}")
    return [
        *(Original(n, FILES, run, 4) for n in ("bent", "bent-seed", "bent-few", "aborted")),
        *(Original(name, FILES, run, 3) for name in ("stopped", "laying")),
        *(Original(name, FILES, run, 3, unchecked=True) for name in ("old", "old-seed")),
        Original("killed", (str(log),), (("report", "{}", *html),), 3, unchecked=True),
        Original(
            "swept",
            (STUDY, RUNS, RUNS, "sweep.toml", "scenario.toml"),
            (("sweep", "{}", "--workers", "1"),),
            unchecked=True,
        ),
        Original("robust", (STUDY, RUNS, RUNS), ((*robustness(top), "{}"),), unchecked=True),
        Original("onset", (STUDY, RUNS, RUNS), (onset,), unchecked=True),
        Original(
            "checked",
            ("baseline.json",),
            (("check", "--baseline", "{}/baseline.json", "--workers", "1"),),
            unchecked=True,
        ),
    ]


# -- one case ------------------------------------------------------------------------------------


def corrupt(folder: Path, original: Original, top: Path, rng: random.Random) -> tuple[str, str]:
    """Corrupt a file of a folder; return its name and what was done."""
    while True:
        name = rng.choice(original.files)
        path = folder / name
        others = sorted(p for p in top.glob(f"*/{name}") if p.parent.name != original.name)
        if others and rng.random() < 0.12:
            way, said = "swapped", swapped(path, rng.choice(others))
        else:
            chosen = rng.choice(ways_for(path))
            way = chosen.__name__
            try:
                said = chosen(path, rng)
            except (IndexError, ValueError, OverflowError):
                said = ""  # nothing there that could be corrupted so
        if said and not same_bytes(path, top / original.name / name):
            return name, f"{way}: {said}"
        shutil.rmtree(folder)
        shutil.copytree(top / original.name, folder)


def same_bytes(path: Path, other: Path) -> bool:
    return path.is_file() and os.access(path, os.R_OK) and path.read_bytes() == other.read_bytes()


def read_back(original: Original, folder: Path) -> Any:
    """Return what the folder says, to be compared with what it said before."""
    if original.name == "checked":
        return json.loads((folder / "baseline.json").read_text())
    if (folder / STUDY).exists():
        rows = [json.loads(line) for line in (folder / RUNS).read_text().splitlines()]
        return sorted(rows, key=lambda row: json.dumps(row, sort_keys=True))
    run = load_run(folder, unfinished=True)
    values = [(name, unit, run[name].tobytes().hex()) for name, unit in run.trace.columns]
    scenario = run.scenario.to_toml()
    summary = msgspec.to_builtins(run.summary)
    return [scenario, summary, run.outcome, run.model_sha256, values]


def invoke(words: list[str]) -> dict[str, Any]:
    """Call the command line in this process."""
    result = CliRunner().invoke(cli, words)
    broken = result.exception is not None and not isinstance(result.exception, SystemExit)
    return {
        "code": result.exit_code,
        "said": result.stderr,
        "traceback": repr(result.exception) if broken else "",
    }


def in_fork(work: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """Return what a function returns in a process that is ended after the limit."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reading)
        with os.fdopen(writing, "w") as file:
            json.dump(work(), file)
        os._exit(0)
    os.close(writing)
    until, text = time.monotonic() + LIMIT_S, b""
    while time.monotonic() < until:
        if select.select([reading], [], [], until - time.monotonic())[0]:
            part = os.read(reading, 1 << 20)
            if not part:
                break
            text += part
    else:
        os.kill(child, signal.SIGKILL)
    os.close(reading)
    _, status = os.waitpid(child, 0)
    if text:
        found: dict[str, Any] = json.loads(text)
        return found
    return {"code": -os.WTERMSIG(status), "said": "", "traceback": "", "hang": not text}


def as_process(words: list[str]) -> dict[str, Any]:
    """Call the command line as a process of its own."""
    try:
        done = subprocess.run(
            [sys.executable, "-m", "dualbend", *words],
            capture_output=True,
            text=True,
            timeout=LIMIT_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return {"code": 0, "said": "", "traceback": "", "hang": True}
    broken = done.stderr if "Traceback" in done.stderr else ""
    return {"code": done.returncode, "said": done.stderr, "traceback": broken}


def judge(original: Original, name: str, words: list[str], found: dict[str, Any]) -> str:
    """Return what is wrong with how a command ended; "" where nothing is."""
    code, said = found["code"], found["said"].strip()
    # A study says on standard error how far it is, before it refuses.
    message = said[said.rfind("dualbend: ") :]
    problems = (
        (found["traceback"], f"traceback: {found['traceback'][-300:]}"),
        (found.get("hang"), f"hang, or died by signal {-code}"),
        (code not in ({0, 1, 2} if words[0] == "check" else {0, 2}), f"exit code {code}: {said}"),
        (code == 2 and (len(message.splitlines()) != 1), f"not one line: {said}"),
        (code == 2 and len(message) > LONGEST_MESSAGE, f"{len(message)} characters: {message}"),
        (code == 2 and not names(message, name), f"no word of {name}: {message}"),
    )
    return next((words[:400] for wrong, words in problems if wrong), "")


def names(message: str, name: str) -> bool:
    """Tell whether a message speaks of a file; a log that is gone leaves no folder of a run."""
    return Path(name).name in message or ("unfinished/" in name and "no folder of a run" in message)


def run_case(number: int, seed: int, originals: list[Original], top: Path, tally: Tally) -> None:
    """Corrupt, read, judge."""
    rng = random.Random(f"{seed}/{number}")
    original = rng.choices(originals, [one.weight for one in originals])[0]
    folder = top / "cases" / original.name
    shutil.copytree(top / original.name, folder)
    name, said = corrupt(folder, original, top, rng)
    words = [word.format(folder) for word in rng.choice(original.commands)]
    # Those two have runs that are made up, in this process.
    if number % AS_PROCESS == 0 and original.name not in ("checked", "onset"):
        found = as_process(words)
    else:
        found = in_fork(lambda: invoke(words))
    label = f"{number}: {original.name}/{name} {said}: {' '.join(words[:2])}"
    wrong = judge(original, name, words, found)
    if wrong:
        tally.wrong.append(f"{label}: {wrong}")
    elif found["code"] == 2:
        tally.ended["refused"] += 1
    else:
        # A folder that the command wrote into says now what it read.
        other = in_fork(lambda: {"same": read_back(original, folder) == BEFORE[original.name]})
        if other.get("same"):
            tally.ended["accepted, reads as before"] += 1
        elif original.unchecked:
            tally.ended["accepted, nothing contradicts it"] += 1
            tally.unseen.append(label)
        else:
            tally.wrong.append(f"{label}: accepted, and reads otherwise")
    shutil.rmtree(top / "cases")


BEFORE: dict[str, Any] = {}
"""What each original says."""


def main() -> int:
    """Make, corrupt, read, judge, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=500)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=int, help="this case alone, and print what was said")
    parser.add_argument("--folder", type=Path, help="of the originals, kept for the next time")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        top, tally, began = asked.folder or Path(temporary), Tally(), time.monotonic()
        top.mkdir(exist_ok=True)
        if not (top / "checked" / "baseline.json").exists():
            make_originals(top)
        originals = originals_in(top)
        BEFORE.update({one.name: read_back(one, top / one.name) for one in originals})
        known: dict[Path, Measured] = {}

        def measured(sources: Any, workers: Any, on_done: Any) -> list[Measured]:
            """Measure here, once: a check that is corrupted runs what it ran before."""
            for source in sources:
                load_scenario(source)
                one = known.setdefault(Path(source).name, measure(str(top / "bent.toml")))
                on_done(one)
            return list(known.values())

        def in_turn(_: int | None) -> Any:
            return lambda tasks, run_one: ((key, run_one(*task)) for key, task in tasks.items())

        onsets.in_processes = in_turn
        onsets.work = lambda key, _, *case: made_up_case(key, *case)
        measured([str(top / "bent.toml")], None, lambda _: None)
        checking.measure_all = measured  # type: ignore[assignment]
        for number in [asked.only] if asked.only is not None else range(asked.count):
            run_case(number, asked.seed, originals, top, tally)
        print(f"{asked.count} cases, seed {asked.seed}, {time.monotonic() - began:.0f} s")
        for what, count in tally.ended.most_common():
            print(f"  {count:5} {what}")
        print(f"  {len(tally.wrong):5} wrong")
        for line in [*tally.wrong, "", "nothing contradicts:", *tally.unseen]:
            print(line)
    return bool(tally.wrong)


if __name__ == "__main__":
    sys.exit(main())
