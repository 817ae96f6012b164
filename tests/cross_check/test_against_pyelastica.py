"""The bent strip against PyElastica: a Cosserat rod between clamps, damped to rest."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from cross_check_rows import Report
from cross_check_sheet import WIDE, Points, exact, piecewise, poses, simulated, theory

from dualbend.beam.sheet import Sheet
from dualbend.validation.cases.sheet import first_peak_moment

CODE = "PyElastica"
ELEMENTS = 20
FORCE_TOLERANCE = 0.02
"""Asked for; what is left is discretisation, second order in both codes."""


@pytest.fixture(scope="module")
def compiled(pyelastica: Any, report: Report) -> None:
    """Let Numba compile before anything is timed."""
    from rod_cosserat import clamped_loads

    start = [(0.2, exact(WIDE).path.at(0.2)[0])]
    run = report.run(CODE, "import, compilation and a first pose of 6 elements")
    run.timed("other", lambda: clamped_loads(WIDE, start, 6, weight=True))


@pytest.mark.parametrize("weight", [False, True], ids=["weightless", "heavy"])
@pytest.mark.parametrize("points", [piecewise, exact])
def test_force_and_moment_at_the_clamps(
    points: Callable[[Sheet], Points], weight: bool, compiled: None, report: Report
) -> None:
    from rod_cosserat import clamped_loads

    given = points(WIDE)
    run = report.run(CODE, f"{given.name}, {'with' if weight else 'no'} weight")
    project = run.timed("project", lambda: simulated(WIDE, given, weight=weight))
    wanted = run.timed("theory", lambda: theory(WIDE, given, weight=weight))
    found = run.timed("other", lambda: clamped_loads(WIDE, poses(given), ELEMENTS, weight=weight))
    # At rest to a thousandth of what is asked for.
    assert found.unrest < 2e-5
    peak = first_peak_moment(WIDE)
    for i, alpha in enumerate(given.alphas.tolist()):
        force = run.row(
            "force",
            f"{alpha:g} rad",
            "N",
            found=found.force_n[i],
            project=project.force_n[i],
            theory=wanted.force_n[i],
            asked=FORCE_TOLERANCE,
        )
        moment = run.row(
            "moment, over the first peak",
            f"{alpha:g} rad",
            "N m",
            found=found.moment_nm[i],
            project=project.moment_nm[i],
            theory=wanted.moment_nm[i],
            scale=peak,
        )
        assert force.within(FORCE_TOLERANCE)
        # Discretisation-limited, second order; nothing is asked of the moment.
        assert moment.within(0.01)


def test_the_rod_converges_to_the_reference(compiled: None, report: Report) -> None:
    from rod_cosserat import clamped_loads

    run = report.run(CODE, "exact path, 1 rad, no weight: convergence")
    given = Points(name="exact path", path=exact(WIDE).path, alphas=np.array([1.0]))
    wanted = theory(WIDE, given, weight=False).force_n[0]
    counts = (10, 20, 40)
    forces = [
        run.timed(
            "other", lambda n=n: clamped_loads(WIDE, poses(given), n, weight=False).force_n[0]
        )
        for n in counts
    ]
    for n, force in zip(counts, forces, strict=True):
        run.row(f"force, {n} elements", "1 rad", "N", found=force, theory=wanted)
    errors = np.abs(np.array(forces) - wanted)
    order = -float(np.polyfit(np.log(counts), np.log(errors), 1)[0])
    run.row("order of convergence", "1 rad", "1", found=order, theory=2.0)
    # The middle of the outermost elements is clamped: second order.
    assert order == pytest.approx(2.0, abs=0.2)
    # Richardson's limit of the two finest; stretch and shear, not in the reference, are below.
    limit = forces[2] + (forces[2] - forces[1]) / 3.0
    row = run.row("force, extrapolated", "1 rad", "N", found=limit, theory=wanted)
    assert row.within(2e-4)
