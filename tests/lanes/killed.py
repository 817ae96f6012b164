"""Kill the program at random moments of its work: nothing that was there may be lost or mixed.

    python tests/lanes/killed.py --count 200 --seed 1

Each case does some work in a folder, is killed (SIGKILL) somewhere in it, and the folder is read
again. Half of the moments are a call of the file system that the work makes, drawn uniformly of all
of them; the others are a time, drawn uniformly of the time that the work takes. The work: a first
run, a run over an earlier one, a sweep, a robustness study, ``check --update``. Exit code 1 where
a case failed; the line that says so names the case, which ``--only`` repeats.
"""

from __future__ import annotations

import argparse
import json
import mmap
import os
import random
import shutil
import signal
import struct
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from PIL import Image

from dualbend.cli import main
from dualbend.errors import InputError
from dualbend.run.disk.saved import load_run
from dualbend.run.disk.stream import TraceStream, read_trace

SHORT = ("path.end_rad=0.4", "motion.speed_rad_per_s=0.08", "motion.settle_s=0.1")
"""Some six seconds of simulated time."""

SLOW = ("--set", "guard.speed_fraction=0.001")
"""Ends an assembly at once."""

EVENTS = {"open", "os.rename", "os.remove", "os.rmdir", "os.mkdir", "os.truncate"}
SECOND_ROWS = TraceStream._BATCH_ROWS
TIME_LIMIT_S = 300.0
KINDS = {"run": 0.25, "rerun": 0.5, "sweep": 0.1, "robustness": 0.05, "update": 0.1}
"""Work and its share of the cases."""

SWEEP = """
scenario = "fig6"
[set]
path.end_rad = 0.2
motion = { speed_rad_per_s = 0.4, settle_s = 0.1, hold_s = 0.1 }
[sample]
kind = "grid"
[keys]
sheet.thickness_m = { values = [0.0004, 0.0005, 0.0006] }
"""
OLD_BASELINE = '{"format": 1, "scenarios": {}}\n'


class Progress:
    """Numbers that a killed child has left: rows of the trace, calls of the file system."""

    def __init__(self) -> None:
        self._memory = mmap.mmap(-1, 16)

    def __getitem__(self, place: int) -> int:
        return int(struct.unpack_from("q", self._memory, 8 * place)[0])

    def __setitem__(self, place: int, value: int) -> None:
        struct.pack_into("q", self._memory, 8 * place, value)


ROWS, CALLS = 0, 1


def child(arguments: list[str], folder: Path, progress: Progress, call: int | None) -> int:
    """Start the command line in a process of its own, which kills itself at a call; return it."""
    pid = os.fork()
    if pid:
        return pid
    null = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(null, stream)
    update = TraceStream.update

    def counted(stream: TraceStream, trace: object) -> None:
        update(stream, trace)
        progress[ROWS] = trace.rows

    TraceStream.update = counted
    own, inside = os.getpid(), str(folder)

    def watch(event: str, args: tuple[object, ...]) -> None:
        if event in EVENTS and os.getpid() == own and str(args[0]).startswith(inside):
            if progress[CALLS] == call:
                os.kill(own, signal.SIGKILL)
            progress[CALLS] += 1

    sys.addaudithook(watch)
    try:
        main(arguments)
    except SystemExit as end:
        os._exit(int(end.code or 0))
    os._exit(70)


def wait(pid: int, until_s: float) -> int | None:
    """Wait for a process; return its status, None where it still runs after so many seconds."""
    end = time.monotonic() + until_s
    while True:
        done, status = os.waitpid(pid, os.WNOHANG)
        if done:
            return status
        if time.monotonic() > end:
            return None
        time.sleep(0.002)


class Work:
    """A kind of work in a folder: how it is prepared and what must be true after it was killed."""

    def __init__(self, kind: str, folder: Path) -> None:
        self.kind, self.folder = kind, folder

    @property
    def arguments(self) -> list[str]:
        """The command line."""
        out = str(self.folder / "out")
        if self.kind in ("run", "rerun"):
            settings = [word for setting in SHORT for word in ("--set", setting)]
            return ["run", "fig6", *settings, "--seed", "2", "--out", out]
        if self.kind == "sweep":
            return ["sweep", str(self.folder / "sweep.toml"), "--out", out, "--workers", "2"]
        if self.kind == "robustness":
            return ["robustness", "pwb", "--runs", "1", "--out", out, "--workers", "1", *SLOW]
        return ["check", str(self.folder / "small.toml"), "--update", "--baseline", out]

    def prepare(self, earlier: Path) -> None:
        """Put into the folder what is there before the work."""
        if self.kind == "rerun":
            shutil.copytree(earlier, self.folder / "out")
            (self.folder / "out" / "notes.txt").write_text("the user's")
        elif self.kind == "sweep":
            (self.folder / "sweep.toml").write_text(SWEEP)
        elif self.kind == "update":
            settings = 'extends = "fig6"\nname = "small"\n[path]\nend_rad = 0.3\n'
            (self.folder / "small.toml").write_text(settings)
            (self.folder / "out").write_text(OLD_BASELINE)

    def faults(self, earlier_id: str, rows: int) -> list[str]:
        """Return what is wrong with the folder."""
        out = self.folder / "out"
        if self.kind == "update":
            text = out.read_text()
            whole = text == OLD_BASELINE or "small" in json.loads(text)["scenarios"]
            return [] if whole else ["neither the old baseline nor the new one"]
        if self.kind in ("sweep", "robustness"):
            return self._study_faults(out)
        faults = []
        try:
            run = load_run(out)
        except InputError as error:
            if self.kind == "rerun":
                return [f"the earlier run is lost: {error}"]
            run = None
        except FileNotFoundError:
            run = None
        run_id = "" if run is None else identity_of(out)
        if run is not None:
            if self.kind == "rerun" and not (out / "notes.txt").is_file():
                faults.append("a file of the user's is gone")
            picture = out / "moment.png"
            if picture.is_file() and run_id not in Image.open(picture).text["Description"]:
                faults.append("the picture is of another run")
        if run_id in ("", earlier_id) and rows >= SECOND_ROWS:
            log = out / "unfinished" / "trace.arrow"
            kept = read_trace(log).num_rows if log.is_file() else 0
            if rows - kept > SECOND_ROWS:
                faults.append(f"the log has {kept} of {rows} rows")
        return faults

    def _study_faults(self, out: Path) -> list[str]:
        """Go on with a study: what was complete is not done again, and it comes to its end."""
        lines = out / "runs.jsonl"
        before = lines.read_bytes() if lines.is_file() else b""
        whole = before[: before.rfind(b"\n") + 1]
        status = wait(child(self.arguments, self.folder / "none", Progress(), None), TIME_LIMIT_S)
        if status != 0:
            return [f"it does not go on: status {status}"]
        return [] if lines.read_bytes().startswith(whole) else ["what was done is lost"]


def one(
    case: int, seed: int, top: Path, earlier: Path, full: dict[str, tuple[int, float]]
) -> tuple[str, list[str]]:
    """Make one case; return its kind and what went wrong."""
    draw = random.Random(f"{seed} {case}")
    kind = draw.choices(list(KINDS), list(KINDS.values()))[0]
    folder = top / f"case-{case}"
    folder.mkdir()
    work, progress = Work(kind, folder), Progress()
    work.prepare(earlier)
    calls, duration_s = full[kind]
    call = draw.randrange(calls) if draw.random() < 0.5 else None
    after_s = draw.uniform(0.0, duration_s)
    pid = child(work.arguments, folder, progress, call)
    if wait(pid, TIME_LIMIT_S if call is not None else after_s) is None:
        os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)
    faults = work.faults(identity_of(earlier), progress[ROWS])
    if not faults:
        shutil.rmtree(folder)
    return kind, faults


def identity_of(folder: Path) -> str:
    """Return the id of a run."""
    return str(json.loads((folder / "summary.json").read_bytes())["run"]["id"])


def measure(kind: str, top: Path, earlier: Path) -> tuple[int, float]:
    """Do the work to its end; return the number of its calls and its time [s]."""
    folder = top / f"full-{kind}"
    folder.mkdir()
    work, progress = Work(kind, folder), Progress()
    work.prepare(earlier)
    began = time.monotonic()
    status = wait(child(work.arguments, folder, progress, None), TIME_LIMIT_S)
    if status not in (0, 3 << 8):
        raise SystemExit(f"{kind}: ended with status {status}: {' '.join(work.arguments)}")
    return progress[CALLS], time.monotonic() - began


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=int, help="number of the case to repeat")
    return parser.parse_args()


def run(asked: argparse.Namespace) -> int:
    """Make the cases; return the exit code."""
    top = Path(tempfile.mkdtemp(prefix="killed-"))
    earlier = top / "earlier"
    settings = [word for setting in SHORT for word in ("--set", setting)]
    first = child(["run", "fig6", *settings, "--out", str(earlier)], top / "none", Progress(), None)
    if wait(first, TIME_LIMIT_S) != 0:
        raise SystemExit("the first run failed")
    full = {kind: measure(kind, top, earlier) for kind in KINDS}
    for kind, (calls, duration_s) in full.items():
        print(f"{kind}: {calls} calls, {duration_s:.1f} s", flush=True)
    made: Counter[str] = Counter()
    failed: Counter[str] = Counter()
    for case in range(asked.count) if asked.only is None else [asked.only]:
        kind, faults = one(case, asked.seed, top, earlier, full)
        made[kind] += 1
        failed[kind] += bool(faults)
        for fault in faults:
            print(f"case {case}, {kind}: {fault}; see {top / f'case-{case}'}", flush=True)
    for kind, number in made.items():
        print(f"{kind}: killed {number} times, {failed[kind]} with a fault")
    if not failed.total():
        shutil.rmtree(top)
    return 1 if failed.total() else 0


if __name__ == "__main__":
    sys.exit(run(parse()))
