"""The bent sheet against CalculiX: finite elements, plane strain or free edges."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cross_check_rows import Report
from cross_check_sheet import SHIPPED, WIDE, Points, exact, piecewise, poses, simulated, theory

from dualbend.beam.sheet import Sheet
from dualbend.validation.cases.sheet import first_peak_moment

CODE = "CalculiX"
FORCE_TOLERANCE, MOMENT_TOLERANCE = 0.02, 0.03
"""Asked for."""


def plate(sheet: Sheet) -> Sheet:
    """Return a strip whose EI is the plate's D: E / (1 − ν²) instead of E."""
    return replace(sheet, young_pa=sheet.young_pa / (1.0 - sheet.poisson_ratio**2))


@pytest.mark.parametrize("points", [piecewise, exact])
def test_cylindrical_bending_is_the_elastica_with_the_plate_s_rigidity(
    points: Callable[[Sheet], Points], calculix: str, report: Report, tmp_path: Path
) -> None:
    """Plane strain: the theory is the elastica with D, and so is the simulation given D."""
    from plate_fem import Mesh, clamped_loads

    given, stiff = points(WIDE), plate(WIDE)
    run = report.run(CODE, f"{given.name}, plane strain, all with D")
    project = run.timed("project", lambda: simulated(stiff, given, weight=False))
    wanted = run.timed("theory", lambda: theory(stiff, given, weight=False))
    mesh = Mesh(along=32, across=1, clamp_grading=30.0, plane_strain=True)
    found = run.timed("other", lambda: clamped_loads(WIDE, poses(given), mesh, tmp_path))
    peak = first_peak_moment(stiff)
    for i, alpha in enumerate(given.alphas.tolist()):
        where = f"{alpha:g} rad"
        force = run.row(
            "force",
            where,
            "N",
            found=found.force_n[i],
            project=project.force_n[i],
            theory=wanted.force_n[i],
            asked=FORCE_TOLERANCE,
        )
        # On the exact path theory's moment is 0: a part of the first peak there.
        zero = points is exact
        moment = run.row(
            "moment, over the first peak" if zero else "moment",
            where,
            "N m",
            found=found.moment_nm[i],
            project=project.moment_nm[i],
            theory=wanted.moment_nm[i],
            scale=peak if zero else None,
            asked=MOMENT_TOLERANCE,
        )
        assert force.within(FORCE_TOLERANCE)
        assert moment.within(MOMENT_TOLERANCE)


def test_plane_strain_converges(calculix: str, report: Report, tmp_path: Path) -> None:
    from plate_fem import Mesh, clamped_loads

    run = report.run(CODE, "0.2 rad path, 0.5 rad, plane strain: convergence")
    given = replace(piecewise(WIDE), alphas=np.array([0.5]))
    wanted = theory(plate(WIDE), given, weight=False)
    errors = []
    for along in (8, 16, 32):
        mesh = Mesh(along=along, across=1, clamp_grading=30.0, plane_strain=True)
        folder = tmp_path / str(along)
        found = run.timed("other", lambda m=mesh, f=folder: clamped_loads(WIDE, poses(given), m, f))
        row = run.row(
            f"force, {along} elements",
            "0.5 rad",
            "N",
            found=found.force_n[0],
            theory=wanted.force_n[0],
        )
        assert row.from_theory is not None
        errors.append(abs(row.from_theory))
    # Discretisation-limited: graded meshes, so only that it falls, by more than first order.
    assert errors[1] < errors[0] / 2.0
    assert errors[2] < errors[1] / 2.0


def _free_edges(
    sheet: Sheet, label: str, given: Points, report: Report, folder: Path, *, across: int
) -> None:
    """Compare with both bounds, EI and D, and with the theory of curling across between them."""
    import plate_theory
    from plate_fem import Mesh, clamped_loads

    run = report.run(CODE, f"{given.name}, {label}, free edges; project with EI")
    beam = run.timed("project", lambda: simulated(sheet, given, weight=False))
    low = theory(sheet, given, weight=False)
    high = theory(plate(sheet), given, weight=False)
    force_n, moment_nm = run.timed(
        "theory", lambda: plate_theory.clamped_loads(sheet, poses(given))
    )
    mesh = Mesh(along=20, across=across, clamp_grading=20.0)
    found = run.timed("other", lambda: clamped_loads(sheet, poses(given), mesh, folder))
    for i, alpha in enumerate(given.alphas.tolist()):
        where = f"{alpha:g} rad"
        force = run.row(
            "force; theory between beam and plate",
            where,
            "N",
            found=found.force_n[i],
            project=beam.force_n[i],
            theory=force_n[i],
        )
        moment = run.row(
            "moment, over the first peak",
            where,
            "N m",
            found=found.moment_nm[i],
            project=beam.moment_nm[i],
            theory=moment_nm[i],
            scale=first_peak_moment(sheet),
        )
        share = (found.force_n[i] - low.force_n[i]) / (high.force_n[i] - low.force_n[i])
        run.row("force, from EI (0) to D (1)", where, "1", found=share)
        # Both bounds hold for the force.
        assert 0.0 < share < 1.0
        # Of theory only; it neglects that the clamp does not let the sheet curl beside it.
        assert force.from_theory is not None
        assert moment.from_theory is not None
        assert abs(force.from_theory) < FORCE_TOLERANCE
        assert abs(moment.from_theory) < MOMENT_TOLERANCE


def test_a_wide_sheet_with_free_edges(calculix: str, report: Report, tmp_path: Path) -> None:
    """What the project's EI costs: a wide sheet is nearly the plate."""
    _free_edges(WIDE, "600 × 200 × 0.5 mm", piecewise(WIDE), report, tmp_path, across=6)


def test_the_shipped_sheet_with_free_edges(calculix: str, report: Report, tmp_path: Path) -> None:
    given = replace(piecewise(SHIPPED), alphas=np.array([0.1, 0.5, 0.9]))
    _free_edges(SHIPPED, "400 × 57 × 0.5 mm as shipped", given, report, tmp_path, across=4)
