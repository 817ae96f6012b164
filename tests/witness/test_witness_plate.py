"""The bent sheet against CalculiX: finite elements, large deflections, plane strain or free edges."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from witness_rows import Report
from witness_sheet import SHIPPED, WIDE, Vector, exact, piecewise, poses, simulated, theory

from dualbend.analysis.validation_sheet import first_peak_moment
from dualbend.beam.path import BendingPath
from dualbend.beam.sheet import Sheet

WITNESS = "CalculiX"
FORCE_TOLERANCE, MOMENT_TOLERANCE = 0.02, 0.03
"""Asked for."""


def plate(sheet: Sheet) -> Sheet:
    """Return a strip whose EI is the plate's D: E / (1 − ν²) instead of E."""
    return replace(sheet, young_pa=sheet.young_pa / (1.0 - sheet.poisson_ratio**2))


@pytest.mark.parametrize("points", [piecewise, exact])
def test_cylindrical_bending_is_the_elastica_with_the_plate_s_rigidity(
    points: object, calculix: str, report: Report, tmp_path: Path
) -> None:
    """Plane strain: the theory is the elastica with D, and so is the simulation given D."""
    from plate_fem import Mesh, clamped_loads

    name, path, alphas = points(WIDE)  # type: ignore[operator]
    stiff = plate(WIDE)
    project = report.timed(
        WITNESS, "project", lambda: simulated(stiff, path, alphas, weight=False)
    )
    wanted = report.timed(WITNESS, "theory", lambda: theory(stiff, path, alphas, weight=False))
    mesh = Mesh(along=32, across=1, clamp_grading=30.0, plane_strain=True)
    found = report.timed(
        WITNESS, "witness", lambda: clamped_loads(WIDE, poses(path, alphas), mesh, tmp_path)
    )
    peak = first_peak_moment(stiff)
    for i, alpha in enumerate(alphas.tolist()):
        where = f"{name}, {alpha:g} rad, plane strain, all with D"
        force = report.row(
            WITNESS,
            f"force, {where}",
            "N",
            found=found.force_n[i],
            project=project.force_n[i],
            theory=wanted.force_n[i],
        )
        # On the exact path theory's moment is 0: a part of the first peak there.
        zero = points is exact
        moment = report.row(
            WITNESS,
            f"moment, {where}" + ("; over the first peak" if zero else ""),
            "N m",
            found=found.moment_nm[i],
            project=project.moment_nm[i],
            theory=wanted.moment_nm[i],
            scale=peak if zero else None,
        )
        assert force.difference is not None
        assert force.from_theory is not None
        assert moment.difference is not None
        assert moment.from_theory is not None
        assert abs(force.difference) < FORCE_TOLERANCE
        assert abs(force.from_theory) < FORCE_TOLERANCE
        assert abs(moment.difference) < MOMENT_TOLERANCE
        assert abs(moment.from_theory) < MOMENT_TOLERANCE


def test_plane_strain_converges(calculix: str, report: Report, tmp_path: Path) -> None:
    from plate_fem import Mesh, clamped_loads

    name, path, _ = piecewise(WIDE)
    alphas = np.array([0.5])
    wanted = theory(plate(WIDE), path, alphas, weight=False)
    errors = []
    for along in (8, 16, 32):
        mesh = Mesh(along=along, across=1, clamp_grading=30.0, plane_strain=True)
        found = clamped_loads(WIDE, poses(path, alphas), mesh, tmp_path / str(along))
        row = report.row(
            WITNESS,
            f"force, {name}, 0.5 rad, plane strain, {along} elements",
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
    sheet: Sheet,
    label: str,
    given: tuple[str, BendingPath, Vector],
    report: Report,
    folder: Path,
    *,
    across: int,
) -> None:
    """Compare with both bounds, EI and D, and with the theory of curling across between them."""
    import plate_theory
    from plate_fem import Mesh, clamped_loads

    name, path, alphas = given
    beam = report.timed(WITNESS, "project", lambda: simulated(sheet, path, alphas, weight=False))
    low = theory(sheet, path, alphas, weight=False)
    high = theory(plate(sheet), path, alphas, weight=False)
    between = report.timed(
        WITNESS, "theory", lambda: plate_theory.clamped_loads(sheet, poses(path, alphas))
    )
    mesh = Mesh(along=20, across=across, clamp_grading=20.0)
    found = report.timed(
        WITNESS, "witness", lambda: clamped_loads(sheet, poses(path, alphas), mesh, folder)
    )
    peak = first_peak_moment(sheet)
    for i, alpha in enumerate(alphas.tolist()):
        where = f"{label}, free edges, {name}, {alpha:g} rad"
        force = report.row(
            WITNESS,
            f"force, {where}; theory: between beam and plate",
            "N",
            found=found.force_n[i],
            project=beam.force_n[i],
            theory=between[0][i],
        )
        moment = report.row(
            WITNESS,
            f"moment, {where}; over the first peak",
            "N m",
            found=found.moment_nm[i],
            project=beam.moment_nm[i],
            theory=between[1][i],
            scale=peak,
        )
        share = (found.force_n[i] - low.force_n[i]) / (high.force_n[i] - low.force_n[i])
        report.row(
            WITNESS, f"force, {where}: from EI (0) to D (1)", "1", found=share
        )
        assert force.from_theory is not None
        assert moment.from_theory is not None
        # Both bounds hold for the force; to the mesh, which is within 0.2 % in plane strain.
        assert -0.02 < share < 1.02
        # Theory neglects that the clamp does not let the sheet curl beside it.
        assert abs(force.from_theory) < FORCE_TOLERANCE
        assert abs(moment.from_theory) < MOMENT_TOLERANCE


def test_a_wide_sheet_with_free_edges(calculix: str, report: Report, tmp_path: Path) -> None:
    """What the project's EI costs: a wide sheet is nearly the plate."""
    _free_edges(WIDE, "600 × 200 × 0.5 mm", piecewise(WIDE), report, tmp_path, across=6)


def test_the_shipped_sheet_with_free_edges(
    calculix: str, report: Report, tmp_path: Path
) -> None:
    name, path, _ = piecewise(SHIPPED)
    few = np.array([0.1, 0.5, 0.9])
    _free_edges(
        SHIPPED, "400 × 57 × 0.5 mm, as shipped", (name, path, few), report, tmp_path, across=4
    )
