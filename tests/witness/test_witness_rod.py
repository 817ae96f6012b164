"""The bent strip against PyElastica: a Cosserat rod between clamps, damped to rest."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from witness_rows import Report
from witness_sheet import WIDE, exact, piecewise, poses, simulated, theory

from dualbend.analysis.validation_sheet import first_peak_moment

WITNESS = "PyElastica"
ELEMENTS = 20
FORCE_TOLERANCE = 0.02
"""Asked for; what is left is discretisation, second order in both codes."""


@pytest.fixture(scope="module")
def compiled(pyelastica: Any, report: Report) -> None:
    """Let Numba compile before anything is timed."""
    from rod_cosserat import clamped_loads

    start = [(0.2, exact(WIDE)[1].at(0.2)[0])]
    report.timed(
        WITNESS,
        "compilation and first pose",
        lambda: clamped_loads(WIDE, start, 6, weight=True),
    )


@pytest.mark.parametrize("weight", [False, True], ids=["weightless", "heavy"])
@pytest.mark.parametrize("points", [piecewise, exact])
def test_force_and_moment_at_the_clamps(
    points: Any, weight: bool, compiled: None, report: Report
) -> None:
    from rod_cosserat import clamped_loads

    name, path, alphas = points(WIDE)
    project = report.timed(
        WITNESS, "project", lambda: simulated(WIDE, path, alphas, weight=weight)
    )
    wanted = report.timed(WITNESS, "theory", lambda: theory(WIDE, path, alphas, weight=weight))
    found = report.timed(
        WITNESS,
        "witness",
        lambda: clamped_loads(WIDE, poses(path, alphas), ELEMENTS, weight=weight),
    )
    assert found.unrest < 1e-5
    peak = first_peak_moment(WIDE)
    load = "with weight" if weight else "no weight"
    for i, alpha in enumerate(alphas.tolist()):
        where = f"{name}, {load}, {alpha:g} rad"
        force = report.row(
            WITNESS,
            f"force, {where}",
            "N",
            found=found.force_n[i],
            project=project.force_n[i],
            theory=wanted.force_n[i],
        )
        moment = report.row(
            WITNESS,
            f"moment, {where}; over the first peak",
            "N m",
            found=found.moment_nm[i],
            project=project.moment_nm[i],
            theory=wanted.moment_nm[i],
            scale=peak,
        )
        assert force.difference is not None
        assert force.from_theory is not None
        assert moment.from_theory is not None
        assert abs(force.difference) < FORCE_TOLERANCE
        assert abs(force.from_theory) < FORCE_TOLERANCE
        # Discretisation-limited, second order; nothing is asked of the moment.
        assert abs(moment.from_theory) < 0.01


def test_the_rod_converges_to_the_oracle(compiled: None, report: Report) -> None:
    from rod_cosserat import clamped_loads

    name, path, _ = exact(WIDE)
    alphas = np.array([1.0])
    wanted = theory(WIDE, path, alphas, weight=False).force_n[0]
    counts = (10, 20, 40)
    forces = [
        report.timed(
            WITNESS,
            "witness",
            lambda n=n: clamped_loads(WIDE, poses(path, alphas), n, weight=False).force_n[0],
        )
        for n in counts
    ]
    order = -float(np.polyfit(np.log(counts), np.log(np.abs(np.array(forces) - wanted)), 1)[0])
    for n, force in zip(counts, forces, strict=True):
        report.row(
            WITNESS, f"force, {name}, 1 rad, {n} elements", "N", found=force, theory=wanted
        )
    report.row(
        WITNESS, f"force, {name}, 1 rad: order of convergence", "1", found=order, theory=2.0
    )
    # The middle of the outermost elements is clamped: second order.
    assert order == pytest.approx(2.0, abs=0.2)
    # Richardson's limit of the two finest.
    limit = forces[2] + (forces[2] - forces[1]) / 3.0
    report.row(
        WITNESS, f"force, {name}, 1 rad, extrapolated", "N", found=limit, theory=wanted
    )
    # Stretch and shear, which the oracle leaves out, are below.
    assert limit == pytest.approx(wanted, rel=2e-4)
