"""The same sweep on a real Dask scheduler with two workers on the loopback address."""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from click.testing import CliRunner

from dualbend.cli import main
from dualbend.errors import DualbendError, InputError
from dualbend.study import cluster
from dualbend.study.cluster import KILLED, on_cluster, result_versions, run_there
from dualbend.study.engine import Lost
from dualbend.study.processes import in_processes
from dualbend.study.sweep.design import make_design
from dualbend.study.sweep.file import load_sweep
from dualbend.study.sweep.report import write_report
from dualbend.study.sweep.run import RunRow, run_row, run_sweep
from dualbend.study.sweep.table import TABLE

distributed = pytest.importorskip("distributed")
threadpoolctl = pytest.importorskip("threadpoolctl")

TEXT = """
scenario = "fig8"
[set]
path.end_rad = 0.3
motion = { speed_rad_per_s = 0.5, settle_s = 0.2, hold_s = 0.2 }
[sample]
kind = "grid"
[keys]
compliance.rotation.b = { values = [5.0, 7.0, 9.0] }
robot.alter.delay_cycles = { values = [1, 2, 3, -1] }
"""


@contextmanager
def started(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Start ``dask`` with these arguments; end it, whatever happens."""
    process = subprocess.Popen(
        [sys.executable, "-m", "dask", *arguments],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate(timeout=30)


@pytest.fixture
def scheduler() -> Iterator[str]:
    with started("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard") as process:
        assert process.stderr is not None
        for line in process.stderr:
            found = re.search(r"Scheduler at:\s+(tcp://\S+)", line)
            if found:
                yield found.group(1)
                return
    pytest.fail("the scheduler did not start")


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="sends a POSIX signal")
@pytest.mark.usefixtures("in_process")
def test_a_cluster_that_loses_a_worker_makes_the_local_table(
    scheduler: str, tmp_path: Path
) -> None:
    """Analytic: byte for byte that of this process in one thread; refused runs are in it as well.

    Of two workers one is killed when three runs are done, while it has others in hand.
    """
    (tmp_path / "s.toml").write_text(TEXT)
    sweep = load_sweep(tmp_path / "s.toml")
    design = make_design(sweep)
    worker = ("worker", scheduler, "--nthreads", "1", "--no-nanny", "--no-dashboard")
    worker = (*worker, "--local-directory", str(tmp_path))
    killed: list[int] = []
    with started(*worker) as first, started(*worker) as second:
        with distributed.Client(scheduler) as client:
            client.wait_for_workers(2, timeout=60)

        def kill(done: int, total: int, row: RunRow | None) -> None:
            # Three of the twelve are refused before any worker is asked.
            if done == 6:
                first.send_signal(signal.SIGKILL)
                killed.append(first.wait(timeout=30))

        rows = run_sweep(sweep, design, tmp_path / "dask", on_cluster(scheduler), on_run=kill)
        assert killed == [-signal.SIGKILL]
        assert second.poll() is None
    write_report(sweep, design, rows, tmp_path / "dask")
    assert [row.outcome for row in rows] == [*3 * ["completed"], "refused"] * 3

    with threadpoolctl.threadpool_limits(1):
        local = run_sweep(sweep, design, tmp_path / "local", in_processes(1))
    write_report(sweep, design, local, tmp_path / "local")
    assert (tmp_path / "dask" / TABLE).read_bytes() == (tmp_path / "local" / TABLE).read_bytes()


@pytest.mark.slow
def test_a_cluster_runs_a_class_that_is_beside_the_scenario(scheduler: str, tmp_path: Path) -> None:
    """Exact: the row that a process of this machine makes."""
    (tmp_path / "turning.py").write_text(
        "import numpy as np\n\nclass Turn:\n"
        "    def __init__(self, scenario, b): self.b = b\n"
        "    def __call__(self, observation):\n"
        "        return np.array([0, 0, 0, 0, observation.filtered.torque_nm[0, 1] / self.b, 0])\n"
    )
    (tmp_path / "turning.toml").write_text(
        'extends = "fig6"\nname = "turning"\ncompliance = "turning:Turn"\n'
    )
    text = TEXT.replace('"fig8"', '"turning.toml"').partition("[keys]")[0]
    (tmp_path / "s.toml").write_text(
        f'{text}[keys]\n"compliance.options.b" = {{ values = [50.0, 100.0] }}\n'
    )
    with pytest.raises(InputError, match="missing required field `b`"):
        load_sweep(tmp_path / "s.toml")
    (tmp_path / "turning.toml").write_text(
        'extends = "fig6"\nname = "turning"\n[compliance]\nkind = "turning:Turn"\n'
        "options = { b = 50.0 }\n"
    )
    sweep = load_sweep(tmp_path / "s.toml")
    design = make_design(sweep)
    worker = ("worker", scheduler, "--nthreads", "1", "--no-nanny", "--no-dashboard")
    with started(*worker, "--local-directory", str(tmp_path)):
        rows = run_sweep(sweep, design, tmp_path / "dask", on_cluster(scheduler))
    with threadpoolctl.threadpool_limits(1):
        local = run_sweep(sweep, design, tmp_path / "local", in_processes(1))
    assert [row.outcome for row in rows] == 2 * ["completed"]
    assert rows == local
    assert rows[0].metrics != rows[1].metrics


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "udp://127.0.0.1:1", "nowhere"])
def test_a_scheduler_that_does_not_answer_is_one_message(
    address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "CONNECT_S", 0.5)
    (tmp_path / "s.toml").write_text(TEXT)
    result = CliRunner().invoke(main, ["sweep", str(tmp_path / "s.toml"), "--scheduler", address])
    assert result.exit_code == 2
    assert f"--scheduler {address}: no scheduler answers" in result.stderr
    assert result.stderr.count("\n") == 1


def test_a_connection_that_breaks_off_is_one_message(monkeypatch: pytest.MonkeyPatch) -> None:
    def breaks(*_: object, **__: object) -> None:
        raise AssertionError

    monkeypatch.setattr("distributed.Client", breaks)
    with pytest.raises(InputError, match="no scheduler answers"):
        on_cluster("tcp://127.0.0.1:1")


def test_without_the_extra_it_is_said_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"pip install 'dualbend\[dask\]'"):
        on_cluster("tcp://127.0.0.1:8786")


def ended(error: Exception) -> Future[Any]:
    future: Future[Any] = Future()
    future.set_exception(error)
    return future


def test_what_a_cluster_may_do_to_a_run_is_lost_or_one_message() -> None:
    """Analytic: only a run that kills its workers is a row; it is kept from killing the next."""
    dead = SimpleNamespace(address="tcp://127.0.0.1:1")
    assert cluster._row(ended(distributed.KilledWorker("run_there", dead, 3))) == Lost(KILLED)
    cancelled: Future[Any] = Future()
    cancelled.cancel()
    with pytest.raises(DualbendError, match=r"scheduler is gone.*the same command goes on"):
        cluster._row(cancelled)
    with pytest.raises(DualbendError, match=r"ModuleNotFoundError: dualbend.*installed there"):
        cluster._row(ended(ModuleNotFoundError("dualbend")))


def test_a_worker_with_other_versions_makes_no_run(tmp_path: Path) -> None:
    """Its numbers would be others, and the table would not say so."""
    (tmp_path / "s.toml").write_text(TEXT)
    expected = {**result_versions(), "mujoco": "3.9.0"}
    with pytest.raises(DualbendError, match=r"a worker has mujoco .*, this sweep 3\.9\.0"):
        run_there(expected, run_row, 0, load_sweep(tmp_path / "s.toml").resolve())
