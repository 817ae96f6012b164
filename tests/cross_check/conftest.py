"""The lane of the cross-checks: its marker, its report, and what a missing code means."""

from __future__ import annotations

import importlib
import importlib.metadata
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NoReturn

import pytest
from cross_check_rows import Report

REQUIRE = "DUALBEND_REQUIRE_CROSS_CHECKS"
HERE = Path(__file__).parent


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark every test of this folder."""
    for item in items:
        if HERE in item.path.parents:
            item.add_marker(pytest.mark.cross_check)


def missing(what: str, remedy: str) -> NoReturn:
    """Skip where another code is not installed, or fail where it is required."""
    message = f"{what} is not installed: {remedy}"
    if os.environ.get(REQUIRE) == "1":
        pytest.fail(message)
    pytest.skip(message)


def library(module: str, distribution: str, report: Report) -> Any:
    """Return another code's module and note its version."""
    try:
        found = importlib.import_module(module)
    except ImportError:
        missing(distribution, "pip install 'dualbend[cross-check]'")
    report.versions[distribution] = importlib.metadata.version(distribution)
    return found


@pytest.fixture(scope="session")
def report() -> Iterator[Report]:
    """Collect the rows of this session and save them at its end."""
    found = Report()
    yield found
    if found.runs:
        found.save()


@pytest.fixture(scope="module")
def pyelastica(report: Report) -> Any:
    """PyElastica, or a skip."""
    return library("elastica", "pyelastica", report)


@pytest.fixture(scope="module")
def control(report: Report) -> Any:
    """python-control, or a skip."""
    return library("control", "control", report)


@pytest.fixture(scope="module")
def roboticstoolbox(report: Report) -> Any:
    """Robotics Toolbox for Python, or a skip."""
    return library("roboticstoolbox", "roboticstoolbox-python", report)


@pytest.fixture(scope="module")
def calculix(report: Report) -> str:
    """CalculiX's solver, or a skip."""
    from plate_fem import executable

    solver = executable()
    if solver is None:
        missing("CalculiX", "apt-get install calculix-ccx")
    told = subprocess.run([solver, "-v"], capture_output=True, text=True, check=False)
    report.versions["CalculiX"] = told.stdout.strip().removeprefix("This is Version ").strip()
    return solver
