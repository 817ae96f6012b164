"""The plate's forms: what its hinges and cells store, against Kirchhoff and plane stress."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from dualbend.beam import elastica
from dualbend.beam.rod import planar as rod
from dualbend.errors import InputError
from dualbend.scenario.load import load_scenario
from dualbend.scene.sheet.shell import (
    ShellConfig,
    add_shell,
    column_arcs,
    hinges,
    membrane_form,
    row_places,
    row_shares,
    set_elasticity,
)
from dualbend.validation.cases.shell import settle, shell_config
from support.sheets import STRIP

CONFIG = ShellConfig(cells_along=12, cells_across=5)
NU = STRIP.poisson_ratio
D = STRIP.bending_stiffness_nm2 / STRIP.width_m / (1 - NU**2)


@pytest.mark.parametrize(
    ("x", "y", "xy"), [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, -NU, 0), (1, 1, 0.5)]
)
def test_the_hinges_store_the_energy_of_kirchhoffs_plate(x: float, y: float, xy: float) -> None:
    s, rows = column_arcs(STRIP, CONFIG), row_places(STRIP, CONFIG)
    X, Y = np.meshgrid(s - STRIP.length_m / 2, rows, indexing="ij")
    # Across, as a chain that folds by κ_y times a cell at each inner row.
    cell = STRIP.width_m / CONFIG.cells_across
    slopes = y * (cell * np.arange(len(rows) - 1) - STRIP.width_m / 2)
    across = np.concatenate(([0.0], np.cumsum(slopes * np.diff(rows))))
    z = 0.5 * x * X**2 + across + xy * X * Y
    energy = sum(
        0.5 * h.stiffness * sum(w * z[v] for w, v in zip(h.weights, h.vertices, strict=True)) ** 2
        for h in hinges(STRIP, CONFIG)
    )
    area = STRIP.length_m * STRIP.width_m
    bending = 0.5 * D * (x**2 + y**2 + 2 * NU * x * y) * area
    # The twist cells end at the grips' columns; the outermost two stand for half a cell more,
    # which a uniform twist fills only in part: (N - 1) - 2 + 2 / 1.5 of N cells.
    filled = (CONFIG.cells_along - 3 + 2 / 1.5) / CONFIG.cells_along
    # Analytic: second differences are exact on quadratics.
    assert energy == pytest.approx(bending + D * (1 - NU) * xy**2 * area * filled, rel=1e-9)


def test_the_hinges_do_not_resist_a_plane() -> None:
    s, rows = column_arcs(STRIP, CONFIG), row_places(STRIP, CONFIG)
    X, Y = np.meshgrid(s, rows, indexing="ij")
    z = 0.3 + 2.0 * X - 5.0 * Y
    for h in hinges(STRIP, CONFIG):
        folded = sum(w * z[v] for w, v in zip(h.weights, h.vertices, strict=True))
        # Analytic: rounding, of weights up to 1e5.
        assert folded == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("strain", [(1e-6, 0, 0), (0, 1e-6, 0), (0, 0, 1e-6), (2e-6, -1e-6, 3e-6)])
def test_a_cell_stores_the_energy_of_plane_stress(strain: tuple[float, float, float]) -> None:
    hx, hy, (x, y, shear) = 0.02, 0.01, strain
    corners = np.array([[0, 0], [hx, 0], [hx, hy], [0, hy]], dtype=float)
    moved = corners @ (np.eye(2) + np.array([[x, shear / 2], [shear / 2, y]]))
    pairs = [(0, 1), (1, 2), (0, 2), (2, 3), (0, 3), (1, 3)]
    growth = np.array(
        [
            np.sum((moved[a] - moved[b]) ** 2) - np.sum((corners[a] - corners[b]) ** 2)
            for a, b in pairs
        ]
    )
    energy = 0.5 * growth @ membrane_form(STRIP, hx, hy) @ growth
    E, t = STRIP.young_pa, STRIP.thickness_m
    plane = E / (1 - NU**2) * (x**2 + y**2 + 2 * NU * x * y) + E / (2 * (1 + NU)) * shear**2
    # Analytic, for small strain: the next terms are of relative size 1e-6.
    assert energy == pytest.approx(0.5 * plane * t * hx * hy, rel=1e-5)


def test_what_the_compiled_model_feels_is_what_was_written() -> None:
    spec = mujoco.MjSpec()
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    add_shell(spec, STRIP, CONFIG, np.zeros(3))
    model = spec.compile()
    set_elasticity(model, STRIP, CONFIG)
    data = mujoco.MjData(model)
    columns, rows = CONFIG.cells_along, CONFIG.cells_across + 2
    first = model.joint("sheet_vertex_002_00_x").qposadr[0]
    z = np.zeros((columns + 2, rows))
    # Two hinges from a grip's column on, so that nothing else has a force there.
    z[5, 3] = 1e-5
    free = data.qpos[first:].reshape(columns - 2, rows, 3)
    free[..., 2] = z[2:-2]
    mujoco.mj_forward(model, data)
    force = np.zeros_like(z)
    for h in hinges(STRIP, CONFIG):
        at = tuple(np.array(h.vertices).T)
        np.add.at(
            force, at, -h.stiffness * float(np.array(h.weights) @ z[at]) * np.array(h.weights)
        )
    dof = model.joint("sheet_vertex_002_00_x").dofadr[0]
    found = data.qfrc_passive[dof:].reshape(columns - 2, rows, 3)[..., 2]
    # Analytic but for the membrane, cubic in z: (1e-5)² E t / D h² is 1e-4 of it.
    assert found == pytest.approx(force[2:-2], abs=1e-3 * np.abs(force).max())
    assert np.isfinite(model.flex_stiffness[: model.flex_elemnum[0] * 24]).all()


def test_the_vertices_stand_for_the_whole_sheet() -> None:
    spec = mujoco.MjSpec()
    add_shell(spec, STRIP, CONFIG, np.zeros(3))
    model = spec.compile()
    # Analytic.
    assert model.body_mass.sum() == pytest.approx(STRIP.mass_kg, rel=1e-12)
    assert row_shares(STRIP, CONFIG).sum() == pytest.approx(STRIP.width_m, rel=1e-12)


def test_bent_to_a_cylinder_it_is_the_plate() -> None:
    sheet = replace(STRIP, poisson_ratio=0.0)
    half = float(elastica.half_distance(0.6, sheet.length_m)) + 1e-3
    found = settle(sheet, shell_config(20, 2), 0.6, half)
    wanted = rod.solve_symmetric(sheet.bending_stiffness_nm2, sheet.length_m, 0.6, half)
    # Discretisation-limited: second order, 20 cells.
    assert found.force_n == pytest.approx(wanted.end_force_n, rel=0.01)
    assert found.moment_nm == pytest.approx(wanted.end_moment_nm, rel=0.02)


@pytest.mark.parametrize(
    ("scenario", "settings", "reason"),
    [
        ("fig6", ["sheet.model=shell", "sheet.model.cells_along=21"], "cells_along must be even"),
        ("fig6", ["sheet.model=plate"], "'strips', 'shell'"),
        ("pwb", ["sheet.model=shell"], "an assembly needs"),
    ],
)
def test_what_cannot_be_is_refused_with_the_reason(
    scenario: str, settings: list[str], reason: str
) -> None:
    with pytest.raises(InputError, match=reason):
        load_scenario(scenario, settings)
