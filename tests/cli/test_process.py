"""The command line as a process: its streams, its environment, signals; exit codes and messages."""

import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

RUN = (
    "run exact --no-record --out r --set path.end_rad=0.05 --set motion.speed_rad_per_s=0.5 "
    "--set motion.settle_s=0.1 --set motion.hold_s=0.1"
)
FAILING = f"{RUN} --set guard.following_error_rad=1e-9"
FILES = ("summary.json", "scenario.toml", "trace.parquet", "moment.png")
FULL = "dualbend: standard output: No space left on device\n"


def shell(
    line: str, folder: Path, before: str = "", **environment: str
) -> subprocess.CompletedProcess[str]:
    """Run ``dualbend LINE`` by bash in a folder."""
    command = f"{before}{shlex.quote(sys.executable)} -m dualbend {line}"
    return subprocess.run(
        ["bash", "-c", command],
        cwd=folder,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("streams", "code", "said"),
    [
        (">&-", 0, None),
        ("2>&-", 0, ""),
        ("<&- >&- 2>&-", 0, ""),
        (">/dev/full", 2, FULL),
        ("2>/dev/full", 0, ""),
        ("| true; exit ${PIPESTATUS[0]}", 0, None),
    ],
)
def test_a_run_keeps_its_results_whatever_becomes_of_its_output(
    streams: str, code: int, said: str | None, tmp_path: Path
) -> None:
    done = shell(f"{RUN} {streams}", tmp_path)
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr
    if said is not None:
        assert done.stderr.endswith(said)
    for name in FILES:
        assert (tmp_path / "r" / name).stat().st_size > 0


@pytest.mark.slow
def test_a_broken_output_does_not_hide_how_a_run_ended(tmp_path: Path) -> None:
    for streams in ("| true; exit ${PIPESTATUS[0]}", ">/dev/full", "2>&-"):
        assert shell(f"{FAILING} {streams}", tmp_path).returncode == 3


@pytest.mark.slow
def test_output_without_room_is_told_once(tmp_path: Path) -> None:
    done = shell("list >/dev/full", tmp_path)
    assert (done.returncode, done.stderr) == (2, FULL)
    done = shell("list | head -c 1; exit ${PIPESTATUS[0]}", tmp_path)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    "environment",
    [
        {"PYTHONIOENCODING": "ascii"},
        {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
        {"TERM": "dumb", "COLUMNS": "1", "HOME": "/proc/none", "TMPDIR": "/proc/none"},
    ],
    ids=str,
)
def test_a_text_is_printed_in_any_environment(environment: dict[str, str], tmp_path: Path) -> None:
    """The materials have a ν and a ³; what a terminal cannot show is written as an escape."""
    done = shell("materials 6061-T6", tmp_path, **environment)
    assert (done.returncode, done.stderr) == (0, "")
    assert len(done.stdout.splitlines()) == len(
        shell("materials 6061-T6", tmp_path).stdout.splitlines()
    )


def test_a_folder_that_is_gone_is_one_message_at_most(tmp_path: Path) -> None:
    before = "mkdir gone; cd gone; rmdir ../gone; "
    assert shell("list", tmp_path, before).returncode == 0
    done = shell(RUN, tmp_path, before)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    "arguments",
    [f"{'a' * 9**5}", f"--{'a' * 9**5}", f"run exact --seed {'9x' * 9**5}", f"run {'a' * 9**5}"],
    ids=["command", "option", "value", "scenario"],
)  # fmt: skip
def test_a_long_argument_is_echoed_short(arguments: str, tmp_path: Path) -> None:
    (tmp_path / "line").write_text(arguments, encoding="utf-8")
    done = shell("$(cat line)", tmp_path)
    assert done.returncode == 2
    assert len(done.stderr) < 600


@pytest.mark.slow
@pytest.mark.parametrize("sent", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
def test_a_signal_ends_a_run_and_keeps_it(sent: signal.Signals, tmp_path: Path) -> None:
    """The exit code is 128 + the signal's number, as the shell counts."""
    command = [sys.executable, "-m", "dualbend", "run", "fig6", "--no-record", "--out", "r"]
    with subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        while not list(tmp_path.rglob("trace.arrow")):
            assert process.poll() is None
            time.sleep(0.01)
        time.sleep(0.2)
        process.send_signal(sent)
        out, said = process.communicate()
    assert process.returncode == 128 + sent
    assert "interrupted by the user" in out
    assert said.count("interrupted") == 0
    for name in FILES:
        assert (tmp_path / "r" / name).stat().st_size > 0


def test_a_signal_before_there_is_a_run_is_one_message(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "wait")
    # The module is imported, its command begins, and waits for the pipe that it is to write.
    command = [sys.executable, "-m", "dualbend", "schema", "--out", "wait"]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as process:
        time.sleep(4.0)
        process.send_signal(signal.SIGTERM)
        _, said = process.communicate()
    assert process.returncode == 128 + signal.SIGTERM
    assert said == "dualbend: interrupted\n"


def test_ctrl_c_while_the_program_is_imported_is_silent(tmp_path: Path) -> None:
    """Python's own handler would raise in the middle of an import."""
    slow = "import time\nprint('importing', flush=True)\ntime.sleep(60.0)\n"
    (tmp_path / "click.py").write_text(slow, encoding="utf-8")
    path = os.pathsep.join((str(tmp_path), *filter(None, (os.environ.get("PYTHONPATH"),))))
    with subprocess.Popen(
        [sys.executable, "-m", "dualbend", "list"],
        env={**os.environ, "PYTHONPATH": path},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "importing\n"
        process.send_signal(signal.SIGINT)
        _, said = process.communicate()
    assert (process.returncode, said) == (-signal.SIGINT, "")


@pytest.mark.slow
def test_a_signal_after_the_results_are_whole_does_not_deny_them(tmp_path: Path) -> None:
    """It waits until they are written; the program says that it was interrupted, no more."""
    command = [sys.executable, "-m", "dualbend", *shlex.split(RUN)]
    with subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        while not list(tmp_path.rglob("summary.json")):
            assert process.poll() is None
            time.sleep(0.001)
        process.send_signal(signal.SIGTERM)
        out, said = process.communicate()
    assert process.returncode == 128 + signal.SIGTERM
    assert "results in r" in out
    assert said.endswith("dualbend: interrupted\n")
    for name in FILES:
        assert (tmp_path / "r" / name).stat().st_size > 0


def test_what_the_caller_ignores_stays_ignored(tmp_path: Path) -> None:
    """As ``nohup`` does it."""
    line = f"{RUN} & sleep 0.1; while [ ! -e r/summary.json ] && kill -HUP $!; do sleep 0.05; done"
    done = shell(f"{line}; wait $!", tmp_path, "trap '' HUP; ")
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("render exact --out x.png --at nan", "nan must be a finite number"),
        ("render exact --out x.gif --fps inf", "inf must be a finite number"),
        ("render exact --out x.gif --speed nan", "nan must be a finite number"),
        ("beam --length nan --width 1 --thickness 1 --young 1 --alpha 1", "finite number"),
        ("stability fig8 --map m.png --map-b nan 1", "finite number"),
        ("tune fig8 --gain-margin inf", "inf is not in the range"),
        ("run exact --out ''", "is empty; give a path"),
        ("arms --for fig66", "scenario 'fig66': did you mean"),
        ("report r --out ''", "is empty; give a path"),
        ("figures --out ''", "is empty; give a path"),
        ("beam --length 0.4 --width 57 --thickness 0.0005 --young 70.3e9 --alpha 1",
         "width_m = 57.0: must be a number ≥ 0.005, ≤ 3 [m]"),
        ("beam --length 0.4 --width 0.06 --thickness 0.0005 --young 70300 --alpha 1",
         "young_pa = 70300.0: must be a number ≥ 100e6, ≤ 1e12 [Pa]"),
    ],
)  # fmt: skip
def test_a_number_that_is_none_is_refused(line: str, words: str, tmp_path: Path) -> None:
    done = shell(line, tmp_path)
    assert done.returncode == 2
    assert words in done.stderr
    assert list(tmp_path.iterdir()) == []
