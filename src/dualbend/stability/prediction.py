"""Stability predicted before a run: the verdict on the admittance loop along a scenario's path."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from itertools import groupby, pairwise
from typing import Literal

import msgspec
import numpy as np

from dualbend.control.compliance.admittance import Admittance
from dualbend.mechanics.coupling import ModeName
from dualbend.scenario.scenario import Scenario
from dualbend.stability.continuous import delayed_loop, paper_loop
from dualbend.stability.margins import hunting_amplitude, jitter_cycles, loop_margins
from dualbend.stability.plant.environment import Environment, environments
from dualbend.stability.sampled import AxisName, LoopElements, environment_loops

STEP_RAD = 0.05
"""Distance of the bending angles that are evaluated [rad]."""

SINGLE_AXES: tuple[Literal["x", "rotation"], ...] = ("x", "rotation")

_ALONE = {"x": (True, False), "rotation": (False, True)}


class Row(msgspec.Struct, frozen=True, kw_only=True):
    """The loop at one bending angle; null in JSON is an infinite margin or what does not apply.

    ``moving``: the least stable of the modes in which the arms can move. ``stiffness_*``: between
    command and reading; ``inertia_*``: the tool's; ``softening_*``: by which part arms and grasps
    in series lowered the stiffness. ``at_rest``: linearised about the compliance's own equilibrium,
    not the path's pose. ``jitter_cycles``: by how many cycles commands may be late, in any order;
    sufficient, and 0 of an unstable loop. ``hunting_*``: the grip's amplitude at which dry
    friction of which nothing is fed forward keeps a stable loop moving, in proportion smaller where
    more is; of each axis by itself. ``paper_*``: (23), continuous without delay; ``delayed_*``:
    continuous with the dead time and the true static compliance; both of each axis by itself, the
    worse one where axes are coupled; None of a controller that is not of b and k.
    """

    alpha_rad: float
    moving: ModeName
    axes: tuple[Literal["x", "rotation"], ...]
    at_rest: bool
    stiffness_x_n_per_m: float
    stiffness_rotation_nm_per_rad: float
    inertia_x_kg: float
    inertia_rotation_kg_m2: float
    softening_x: float
    softening_rotation: float
    stable: bool
    spectral_radius: float
    growth_per_s: float
    frequency_hz: float
    damping_ratio: float
    gain_margin_db: float
    phase_margin_deg: float
    delay_margin_s: float
    crossover_hz: float
    jitter_cycles: float
    hunting_x_m: float
    hunting_rotation_rad: float
    paper_stable: bool | None
    delayed_stable: bool | None
    delayed_gain_margin_db: float | None


class Prediction(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """The verdict on a scenario: ``stable``, ``unstable`` or ``no compliance``.

    ``unstable_rad``: the ranges of the bending angle predicted unstable, ends interpolated.
    ``not_covered``: what of the compliance is no part of it, "" where that is not known.
    """

    scenario: str
    axis: AxisName
    verdict: Literal["stable", "unstable", "no compliance"]
    reason: str
    unstable_rad: tuple[tuple[float, float], ...]
    rows: tuple[Row, ...]
    not_covered: str = ""


def predict(scenario: Scenario, axis: AxisName = "coupled") -> Prediction:
    """Predict the stability of the loop along the scenario's path.

    Raises InputError where a pose is out of reach or the sheet's state is not found.
    """
    elements = LoopElements.from_scenario(scenario)
    alphas, reason = acting_angles(scenario, elements, axis)
    if not alphas:
        return Prediction(
            scenario=scenario.name,
            axis=axis,
            verdict="no compliance",
            reason=f"{reason}: nothing to be unstable",
            unstable_rad=(),
            rows=(),
            not_covered=scenario.compliance.not_predicted,
        )
    rows = tuple(evaluate(elements, e, axis) for e in environments(scenario, alphas))
    ranges = unstable_ranges([r.alpha_rad for r in rows], [r.growth_per_s for r in rows])
    worst = max(rows, key=lambda row: row.spectral_radius)
    rate = "decay" if worst.stable else "growth"
    return Prediction(
        scenario=scenario.name,
        axis=axis,
        verdict="unstable" if ranges else "stable",
        reason=(
            f"worst at {worst.alpha_rad:.2f} rad: {worst.frequency_hz:.2f} Hz, {rate} rate "
            f"{abs(worst.growth_per_s):.2f} 1/s, gain margin {worst.gain_margin_db:.1f} dB"
        ),
        unstable_rad=ranges,
        rows=rows,
        not_covered=scenario.compliance.not_predicted,
    )


def acting_angles(
    scenario: Scenario, elements: LoopElements, axis: AxisName
) -> tuple[list[float], str]:
    """Return the angles to evaluate: every 0.05 rad from where an axis acts to the path's end.

    None, and the reason, where no axis ever acts.
    """
    names = [name for name in SINGLE_AXES if axis in (name, "coupled")]
    start, end = scenario.path.start_rad, scenario.path.end_rad
    given = elements.admittance
    if isinstance(given, Admittance):
        parts = [part for name in names if (part := getattr(given, name)) is not None]
        switches = [max(part.from_alpha_rad, start) for part in parts]
    else:
        tried = (*np.arange(start, end, STEP_RAD).tolist(), end)
        switches = [alpha for alpha in tried if any(elements.acting(axis, alpha))][:1]
    if not scenario.compliance.complying or not switches:
        of = {"coupled": "", "rotation": " about rotation", "x": " along x"}[axis]
        if not of and scenario.compliance.not_predicted and scenario.compliance.complying:
            of = " along x of the world or in pitch"
        return [], f"no compliance{of}"
    if min(switches) > end:
        first = min(switches)
        return [], f"no compliance: it acts from {first:g} rad on and the path ends at {end:g}"
    count = math.ceil((end - min(switches)) / STEP_RAD - 1e-9)
    grid = {round(min(switches) + i * STEP_RAD, 12) for i in range(count)}
    return sorted(grid | {end} | {s for s in switches if s <= end}), ""


def evaluate(elements: LoopElements, at: Environment, axis: AxisName) -> Row:
    """Evaluate one bending angle by the least stable mode in which the arms can move."""
    acting = elements.acting(axis, at.alpha_rad)
    loops = environment_loops(elements, at, acting)
    modes = {name: loop.mode() for name, loop in loops.items()}
    least = max(modes, key=lambda name: modes[name].spectral_radius)
    mode, stiffness, rigid = modes[least], np.diag(at.loops[least]), np.diag(at.rigid_loops[least])
    found = loop_margins(loops[least], stable=mode.stable)
    every = zip(SINGLE_AXES, stiffness.tolist(), acting, strict=True)
    each = {name: k for name, k, acts in every if acts}
    plain = elements.plain(at.alpha_rad)
    classic = each if isinstance(plain.admittance, Admittance) else {}
    delayed = [
        delayed_loop(plain, name, k, max(mode.frequency_hz, 0.1)).margins().gain_db
        for name, k in classic.items()
    ]
    stable = all(other.stable for other in modes.values())
    behind = np.abs(at.arms[least].friction_lag()).tolist()
    hunting = {
        name: hunting_amplitude(environment_loops(plain, at, _ALONE[name])[least], h)
        for name, h in zip(SINGLE_AXES, behind, strict=True)
        if name in each
    }
    # An axis without any stiffness of the sheet has nothing to be softened.
    softening = 1.0 - np.divide(stiffness, rigid, out=np.ones_like(rigid), where=rigid != 0.0)
    return Row(
        alpha_rad=at.alpha_rad,
        moving=least,
        axes=tuple(each),
        at_rest=at.settled,
        stiffness_x_n_per_m=float(stiffness[0]),
        stiffness_rotation_nm_per_rad=float(stiffness[1]),
        inertia_x_kg=float(at.inertia[0, 0]),
        inertia_rotation_kg_m2=float(at.inertia[1, 1]),
        softening_x=float(softening[0]),
        softening_rotation=float(softening[1]),
        stable=mode.stable,
        **asdict(mode),
        gain_margin_db=found.gain_db,
        phase_margin_deg=math.degrees(found.phase_rad),
        delay_margin_s=found.delay_s,
        crossover_hz=found.crossover_hz,
        jitter_cycles=min(map(jitter_cycles, loops.values())) if stable else 0.0,
        hunting_x_m=hunting.get("x", 0.0),
        hunting_rotation_rad=hunting.get("rotation", 0.0),
        paper_stable=all(paper_loop(plain, name, k).routh_stable for name, k in each.items())
        if classic
        else None,
        delayed_stable=min(delayed) > 0.0 if delayed else None,
        delayed_gain_margin_db=min(delayed, default=None),
    )


def unstable_ranges(
    alphas_rad: Sequence[float], growth_per_s: Sequence[float]
) -> tuple[tuple[float, float], ...]:
    """Return where the growth rate is not negative, with the ends interpolated linearly."""
    points = [(alphas_rad[0], growth_per_s[0])]
    for (a, g), (b, h) in pairwise(zip(alphas_rad, growth_per_s, strict=True)):
        if (g < 0.0) != (h < 0.0):
            points.append((a + (b - a) * g / (g - h), 0.0))
        points.append((b, h))
    unstable = [
        [alpha for alpha, _ in group]
        for grows, group in groupby(points, key=lambda point: point[1] >= 0.0)
        if grows
    ]
    return tuple((alphas[0], alphas[-1]) for alphas in unstable)
