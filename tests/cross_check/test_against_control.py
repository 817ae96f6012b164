"""The sampled admittance loop against python-control: poles, gain and phase margin, crossover."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from cross_check_rows import Report
from numpy.typing import NDArray

from dualbend.control.clock import COMMAND_PERIOD_S
from dualbend.control.compliance.admittance import si_per_unit
from dualbend.scenario.load import load_scenario
from dualbend.scenario.scenario import Scenario
from dualbend.stability.margins import eigenloci, loop_margins
from dualbend.stability.plant.environment import Environment, environments
from dualbend.stability.prediction import evaluate
from dualbend.stability.sampled import LoopElements, SampledLoop, environment_loops
from support.strip import STRIP8, STRIP9

Vector = NDArray[np.float64]
ComplexVector = NDArray[np.complex128]
AxisName = Literal["x", "rotation"]

CODE = "python-control"
ALPHAS = (0.2, 0.5, 0.9)
OMEGA = 2.0 * math.pi * np.geomspace(0.015, 0.5 / COMMAND_PERIOD_S * (1.0 - 1e-9), 4000)
"""Where control looks at a loop [rad/s]: another grid than the project's own."""


@cache
def _met(name: str) -> tuple[Scenario, LoopElements, tuple[Environment, ...]]:
    """Return a shipped scenario, its loop and what that meets at the angles."""
    scenario = load_scenario(name)
    return scenario, LoopElements.from_scenario(scenario), tuple(environments(scenario, ALPHAS))


def _robot(control: Any, scenario: Scenario, age_steps: int, steps: int) -> Any:
    """Return set-point → position of one axis, read ``age_steps`` before a cycle, by control.

    ω²/(s² + 2ξω s + ω²) is sampled at the physics step by control's first-order hold, which is
    exact for a ramp, and 16 such steps in a row are one cycle.
    """
    omega = 2.0 * math.pi * scenario.robot.response.natural_frequency_hz
    damping = 2.0 * scenario.robot.response.damping_ratio * omega
    continuous = control.tf([omega**2], [1.0, damping, omega**2])
    fine = control.sample_system(control.ss(continuous), COMMAND_PERIOD_S / steps, "foh")
    n = fine.nstates
    # Columns: fine states and the last set-point at the cycle's start, then the new set-point.
    states = np.eye(n, n + 2)
    position = np.zeros((1, n + 2))
    for step in range(steps):
        part = step / steps
        ramp = np.concatenate([np.zeros(n), [1.0 - part, part]])[np.newaxis]
        if step == steps - age_steps:
            position = fine.C @ states + fine.D @ ramp
        states = fine.A @ states + fine.B @ ramp
    end = np.vstack([states, np.eye(1, n + 2, n + 1)])
    a, b = np.split(end, [n + 1], axis=1)
    c, d = np.split(position, [n + 1], axis=1)
    cycle = control.ss(a, b, c, d, COMMAND_PERIOD_S)
    # A reading during the last cycle.
    return cycle * _delay(control, 1)


def _delay(control: Any, cycles: int) -> Any:
    return control.tf([1.0], [1.0, *[0.0] * cycles], COMMAND_PERIOD_S)


def _loop(control: Any, name: str, axis: AxisName, stiffness: float) -> Any:
    """Return the open loop of one axis from the scenario's physical parameters."""
    scenario, elements, _ = _met(name)
    given = scenario.compliance.x if axis == "x" else scenario.compliance.rotation
    assert given is not None
    assert given.form == "printed"
    b, k = (value * si_per_unit(scenario.compliance.units, axis) for value in (given.b, given.k))
    # The paper's (15) as printed: z/(z − a) / b.
    pole = math.exp(-k * COMMAND_PERIOD_S / b)
    admittance = control.tf([1.0 / b, 0.0], [1.0, -pole], COMMAND_PERIOD_S)
    taps, _ = elements.low_pass.transfer_function()
    low_pass = control.tf(taps, [1.0, *[0.0] * (taps.size - 1)], COMMAND_PERIOD_S)
    robot = _robot(control, scenario, elements.age_steps, elements.response.steps)
    late = _delay(control, scenario.robot.alter.delay_cycles)
    return control.ss(admittance) * control.ss(low_pass) * control.ss(late) * robot * stiffness


@pytest.mark.parametrize("axis", ["x", "rotation"])
@pytest.mark.parametrize("name", [STRIP8, STRIP9])
def test_one_axis_from_physical_parameters(
    name: str, axis: AxisName, control: Any, report: Report
) -> None:
    """A rigid arm without tool: nothing is asked of this project but K and the filter's taps."""
    _, elements, met = _met(name)
    acting, index = (axis == "x", axis == "rotation"), int(axis == "rotation")
    run = report.run(CODE, f"{Path(name).stem}, {axis} alone, rigid arm")
    for at in met:
        way = next(iter(at.loops))
        stiffness = float(at.loops[way][index, index])

        def project(k: Vector = at.loops[way]) -> tuple[Any, Any]:
            loop = SampledLoop(elements, k, acting)
            mode = loop.mode()
            return mode, loop_margins(loop, stable=mode.stable)

        def other(k: float = stiffness) -> tuple[Vector, Any]:
            opened = _loop(control, name, axis, k)
            # From the response: by its polynomials, badly conditioned by the many roots at the
            # origin, control finds no crossing in one of these loops, and warns.
            data = control.frd(opened, OMEGA, smooth=True)
            found = control.stability_margins(data, returnall=True)
            return control.feedback(opened, 1).poles(), found

        mode, margins = run.timed("project", project)
        poles, (gains, phases, _, turns, *_) = run.timed("other", other)
        first = int(np.argmin(gains))
        label = f"{at.alpha_rad:g} rad"
        assert (np.abs(poles).max() < 1.0) == mode.stable
        radius = run.row(
            "largest magnitude of a pole",
            label,
            "1",
            found=np.abs(poles).max(),
            project=mode.spectral_radius,
        )
        of_gain = run.row(
            "factor on the gain", label, "1", found=gains[first], project=margins.gain
        )
        crossing = run.row(
            "where the gain margin is",
            label,
            "Hz",
            found=turns[first] / (2.0 * math.pi),
            project=margins.crossover_hz,
        )
        # Analytic but for the eigenvalues' conditioning; the margins to the sweep's interpolation.
        assert radius.within(1e-6)
        assert of_gain.within(1e-4)
        assert crossing.within(1e-3)
        if mode.stable and math.isfinite(margins.phase_rad):
            of_phase = run.row(
                "phase margin",
                label,
                "deg",
                found=np.abs(phases).min(),
                project=math.degrees(margins.phase_rad),
            )
            assert of_phase.within(1e-3)


def _encirclements(control: Any, locus: Any) -> int:
    """Return how often a locus goes round −1 clockwise: how many poles of the closed loop grow."""
    return int(control.nyquist_response(locus, omega=OMEGA, warn_encirclements=False).count)


@pytest.mark.parametrize("name", ["fig8", "fig9", STRIP8, STRIP9, "tuned"])
def test_the_loop_that_runs(name: str, control: Any, report: Report) -> None:
    """Arm, tool and both axes: the project's frequency response, judged by control."""
    _, elements, met = _met(name)
    run = report.run(CODE, f"{Path(name).stem}, as it runs")
    for at in met:
        row = run.timed("project", lambda e=at: evaluate(elements, e, "coupled"))
        acting = elements.acting("coupled", at.alpha_rad)
        loop = environment_loops(elements, at, acting)[row.moving]
        loci = eigenloci(loop.open_loop(np.exp(-1j * OMEGA * COMMAND_PERIOD_S)))

        def other(parts: ComplexVector = loci) -> tuple[list[Any], int]:
            data = [control.frd(part, OMEGA, smooth=True) for part in parts.T]
            turns = sum(_encirclements(control, d) for d in data)
            return [control.stability_margins(d, returnall=True) for d in data], turns

        found, turns = run.timed("other", other)
        grows = int((np.abs(np.linalg.eigvals(loop.closed.a)) >= 1.0).sum())
        run.row(
            "unstable poles, counted by Nyquist",
            f"{at.alpha_rad:g} rad",
            "1",
            found=turns,
            project=grows,
            scale=1.0,
        )
        # Analytic: no part of the loop is unstable by itself.
        assert turns == grows
        gains = np.concatenate([f[0] for f in found])
        phases = np.concatenate([f[1] for f in found])
        label = f"{at.alpha_rad:g} rad"
        of_gain = run.row(
            "factor on the gain",
            label,
            "1",
            found=gains.min(),
            project=10.0 ** (row.gain_margin_db / 20.0),
        )
        # Both interpolate in a sweep.
        assert of_gain.within(1e-3)
        assert (gains.min() > 1.0) == row.stable
        if row.stable and phases.size and math.isfinite(row.phase_margin_deg):
            of_phase = run.row(
                "phase margin",
                label,
                "deg",
                found=np.abs(phases).min(),
                project=row.phase_margin_deg,
            )
            assert of_phase.within(1e-3)
