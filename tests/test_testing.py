"""The fixture for other repositories: cells on free ports, steered by the tested program."""

from pathlib import Path

import pytest

from support.served import CLIENT

pytest_plugins = ["pytester"]

TESTS = """
import subprocess
import sys

SETTINGS = {
    "path": {"end_rad": 0.2},
    "motion": {"speed_rad_per_s": 1.0, "settle_s": 0.2, "hold_s": 0.1},
    "serve": {"wait_s": 5.0},
}
CLIENT = "EXAMPLE"

def test_by_a_command(served_cell):
    record = served_cell("fig8", SETTINGS).run("{python} " + CLIENT)
    assert record.outcome == "completed", record.reason
    assert 0.2 < record.metrics["peak_moment"].value < 0.8

def test_two_cells_by_processes_of_the_test(served_cell):
    cells = [served_cell("fig8", SETTINGS) for _ in range(2)]
    ports = {cell.told[f"{side}_robot_port"] for cell in cells for side in ("left", "right")}
    assert len(ports) == 4
    moments = []
    for cell in cells:
        client = subprocess.Popen([sys.executable, CLIENT], env=cell.environment)
        record = cell.run()
        client.kill()
        client.wait()
        moments.append(record["left_true_moment_y"])
    assert (moments[0] == moments[1]).all()

def test_that_fails(served_cell):
    record = served_cell("fig8", SETTINGS).run("{python} -c 'print(1 + 41); import nowhere'")
    assert record.outcome == "completed", record.reason
"""


def test_a_repository_tests_its_controller_by_the_fixture(pytester: pytest.Pytester) -> None:
    pytester.makeconftest("from dualbend.testing import served_cell\n")  # as if not installed
    pytester.makepyfile(TESTS.replace("EXAMPLE", str(CLIENT)))
    result = pytester.runpytest_subprocess("-p", "no:cacheprovider", "-q")
    result.assert_outcomes(passed=2, failed=1)
    result.stdout.fnmatch_lines(["*the client ended with exit code 1: ModuleNotFoundError*", "42"])


def test_an_installed_package_brings_the_fixture() -> None:
    text = (Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8")
    assert '[project.entry-points.pytest11]\ndualbend = "dualbend.testing"' in text
