"""A client that the cell starts: told its ports, its output kept, ended with the run."""

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner

from dualbend import InputError, load_run, load_scenario, make_run
from dualbend.check.baseline import CRASHED, Baseline
from dualbend.check.check import updated
from dualbend.check.measure import measure
from dualbend.check.verdict import compare
from dualbend.cli import main
from dualbend.run.loop import Run
from dualbend.run.record import RunRecord
from dualbend.serve.cell import ServedCell
from dualbend.serve.client import run_by_client
from support.served import CLIENT

SHORT = """
extends = "fig8"
name = "{name}"
[path]
end_rad = 0.2
[motion]
speed_rad_per_s = 1.0
settle_s = 0.2
hold_s = 0.1
[serve]
wait_s = 2.0
timeout_s = 1.0
"""
EXAMPLE = f"{sys.executable} {CLIENT}"

Written = Callable[..., Path]


@pytest.fixture
def written(tmp_path: Path) -> Written:
    """Write a scenario whose client is a command, or a Python program of these lines."""

    def write(client: str, name: str = "mine") -> Path:
        if "\n" in client:
            (tmp_path / "client.py").write_text(client)
            client = f"{sys.executable} {tmp_path}/client.py"
        path = tmp_path / f"{name}.toml"
        path.write_text(f"{SHORT.format(name=name)}client = '''{client}'''\n")
        return path

    return write


ONE_ANSWER = """
import os, re, socket, sys, time
arms = []
for side in ("LEFT", "RIGHT"):
    arms.append(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
    arms[-1].bind(("127.0.0.1", int(os.environ[f"DUALBEND_{side}_ROBOT_PORT"])))
for arm in arms:
    told, robot = arm.recvfrom(8192)
    ipoc = re.search(rb"<IPOC>.*</IPOC>", told)[0]
    arm.sendto(b"<Sen><RKorr/>" + ipoc + b"</Sen>", robot)
"""


def by_client(scenario: Path, folder: Path, *settings: str) -> tuple[RunRecord, str]:
    run: Run = make_run(load_scenario(str(scenario), settings))
    cell = ServedCell(run, own_ports=True)
    assert cell.config.client is not None
    with cell.open() as lockstep:
        return run_by_client(cell, lockstep, cell.config.client, folder), lockstep.failure


def test_a_scenario_is_gated_by_the_controller_that_it_names(
    written: Written, tmp_path: Path
) -> None:
    """The same client is the baseline's, bit for bit; one of 10 % more gain is not."""
    file = str(written(EXAMPLE))
    first = measure(file)
    baseline = updated(Baseline(), [first], tmp_path / "baseline.json")
    assert first.outcome == "completed"
    assert measure(file).metrics == first.metrics
    more = CLIENT.read_text().replace("= 2.0, 1e6", "= 2.2, 1e6")
    written(more)
    failures = compare(baseline, [measure(file, tmp_path / "runs")]).failures
    assert "peak_deviation_alpha" in {finding.metric for finding in failures}
    assert (tmp_path / "runs" / "mine" / "summary.json").is_file()
    assert (tmp_path / "runs" / "mine" / "client" / "output.log").is_file()


@pytest.mark.parametrize(
    ("client", "said"),
    [
        ("import no_such_module\n", "ended with exit code 1: ModuleNotFoundError: No module"),
        (f"{ONE_ANSWER}sys.exit('that is all')\n", "ended with exit code 1: that is all"),
        (f"{ONE_ANSWER}os.kill(os.getpid(), 9)\n", "ended by signal 9"),
        (f"{ONE_ANSWER}time.sleep(60.0)\n", "in cycle 1 for 1 s (serve.timeout_s)"),
        ("import time\ntime.sleep(60.0)\n", "in cycle 0 for 2 s (serve.wait_s)"),
    ],
    ids=["import", "exit", "killed", "hangs", "never"],
)
def test_a_client_that_fails_is_a_crash_with_its_reason(
    written: Written, client: str, said: str
) -> None:
    began = time.monotonic()
    found = measure(str(written(client)))
    assert time.monotonic() - began < 30.0
    assert found.outcome == CRASHED
    assert said in found.reason


@pytest.mark.parametrize(
    ("client", "said"),
    [
        ("no-such-program x", "serve.client: 'no-such-program' cannot be started: No such file"),
        ("python 'x", 'serve.client = "python \'x": No closing quotation'),
        ("  ", "names no program"),
        ("x --port {left_port}", "{left_port} is not known; there are {left_robot_port}, "),
    ],
)
def test_a_command_that_is_none_is_refused_by_its_key(
    written: Written, tmp_path: Path, client: str, said: str
) -> None:
    with pytest.raises(InputError) as refused:
        by_client(written(client), tmp_path / "client")
    assert said in str(refused.value)


def test_a_client_is_told_its_ports_and_ended_with_all_that_it_started(
    written: Written, tmp_path: Path
) -> None:
    """In words and variables; a port that the scenario gives stays."""
    lines = """
        import os, subprocess, sys
        child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60.0)"])
        print(*sys.argv[1:], os.environ["DUALBEND_RIGHT_HTTP_PORT"], child.pid)
        {answer}
        child.wait()
    """
    code = "\n".join(line.strip() for line in lines.splitlines()).format(answer=ONE_ANSWER)
    file = written(code)
    text = file.read_text().replace("client.py", "client.py {left_robot_port} {folder}")
    file.write_text(text)
    _, failure = by_client(file, tmp_path / "client", "serve.right.http_port=29876")
    assert "serve.timeout_s" in failure
    port, folder, http, child = (tmp_path / "client" / "output.log").read_text().split()
    assert folder == str(tmp_path / "client")
    assert http == "29876"
    assert f"<PORT>{port}</PORT>" in (tmp_path / "client" / "rsi_left.xml").read_text()
    assert not alive(int(child))


def test_the_command_starts_the_client_and_ends_with_3_and_its_reason(
    written: Written, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The option stands above the scenario's own key."""
    monkeypatch.chdir(tmp_path)
    client = ["--client", "{python} -c 'import nowhere'", "--no-record", "--out", "run"]
    done = CliRunner().invoke(main, ["serve", str(written(EXAMPLE)), *client])
    assert done.exit_code == 3
    assert "aborted (the client ended with exit code 1: ModuleNotFoundError" in done.output
    assert "nowhere" in (tmp_path / "run" / "client" / "output.log").read_text()
    assert load_run(tmp_path / "run").scenario.serve.client == client[1]


@pytest.mark.slow
def test_a_client_ends_with_a_cell_that_is_killed(written: Written, tmp_path: Path) -> None:
    file = written(f"import os\nprint(os.getpid())\n{ONE_ANSWER}time.sleep(60.0)\n")
    command = [sys.executable, "-m", "dualbend", "serve", str(file), "--out", "run"]
    output = tmp_path / "run" / "client" / "output.log"
    with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.DEVNULL) as cell:
        wait(lambda: output.is_file() and output.read_text().endswith("\n"))
        cell.kill()
    client = int(output.read_text())
    wait(lambda: not alive(client))


def wait(until: Callable[[], bool]) -> None:
    end = time.monotonic() + 20.0
    while not until():
        assert time.monotonic() < end
        time.sleep(0.02)


def alive(process: int) -> bool:
    """Tell whether a process runs; one that nobody has waited for does not."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    status = Path(f"/proc/{process}/stat")
    return not status.is_file() or status.read_text().rpartition(")")[2].split()[0] != "Z"
