"""Assemblies that differ: the errors of one are drawn, what the robots believe stays.

Only the truth is drawn: the robots believe in the scenario's sheet, holes and stand.
"""

from __future__ import annotations

import math

import msgspec
import numpy as np

from dualbend.scenario.scenario import Scenario
from dualbend.scene.bed.config import hole_places
from dualbend.task.assembly.config import assembly_of


def draw(scenario: Scenario, seed: int, index: int) -> Scenario:
    """Return the scenario with the errors of draw ``index``, added to those that it has.

    Of SeedSequence(seed)'s child ``index``: it depends on no other draw. Lengths and angles are
    normal with the standard deviations of ``task.spread``. Relative ones multiply by
    exp(σ z − σ²/2), σ² = ln(1 + s²): log-normal, of mean 1 and standard deviation s, above zero.
    What is fed forward of the joints' friction is uniform in its range. The seed of the sensors'
    noise is drawn as well. InputError without an assembly.
    """
    config = assembly_of(scenario)
    spread, errors, holes = config.spread, config.errors, config.layout.holes
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(index,)))
    # All of them, always: a width that is changed leaves the other draws as they are.
    x, y, yaw, thickness, modulus, friction = rng.standard_normal(6).tolist()
    off = spread.hole_m * rng.standard_normal((len(holes.names), 2)) + holes.offsets_m
    drawn = msgspec.structs.replace(
        errors,
        pickup_x_m=errors.pickup_x_m + spread.pickup_x_m * x,
        pickup_y_m=errors.pickup_y_m + spread.pickup_y_m * y,
        pickup_yaw_rad=errors.pickup_yaw_rad + spread.pickup_yaw_rad * yaw,
        thickness_factor=errors.thickness_factor * _factor(spread.thickness, thickness),
        modulus_factor=errors.modulus_factor * _factor(spread.modulus, modulus),
        friction_factor=errors.friction_factor * _factor(spread.friction, friction),
    )
    places = tuple((float(along), float(across)) for along, across in off)
    replace = msgspec.structs.replace
    layout = replace(config.layout, holes=replace(holes, errors_m=places))
    task = replace(config, errors=drawn, layout=layout)
    noise, imperfections = int(rng.integers(2**31)), scenario.imperfections
    ratio = imperfections.robot.coulomb_ratio / float(rng.uniform(*spread.fed_forward))
    robot = replace(imperfections.robot, coulomb_ratio=ratio)
    return replace(
        scenario, task=task, imperfections=replace(imperfections, robot=robot), seed=noise
    )


def _factor(relative: float, z: float) -> float:
    variance = math.log1p(relative**2)
    return math.exp(math.sqrt(variance) * z - 0.5 * variance)


def without_compliance(scenario: Scenario) -> Scenario:
    """Return the scenario with arms that go where they are sent."""
    rigid = msgspec.structs.replace(assembly_of(scenario), compliance=None)
    return msgspec.structs.replace(scenario, task=rigid)


def misalignment(scenario: Scenario) -> float:
    """Return how far the worst hole would be from its pin if nothing yielded [m].

    max over the holes of |R(ψ) (p + e) + d − p|: p the pin's place, e the hole's error, d and ψ
    the pick-up's, of a flat sheet laid where the robots believe to lay it.
    """
    config = assembly_of(scenario)
    errors, pins = config.errors, hole_places(config.layout.holes)
    c, s = math.cos(errors.pickup_yaw_rad), math.sin(errors.pickup_yaw_rad)
    holes = (pins + config.layout.holes.offsets_m) @ np.array([[c, s], [-s, c]])
    off = holes + np.array([errors.pickup_x_m, errors.pickup_y_m]) - pins
    return float(np.linalg.norm(off, axis=1).max())


def play(scenario: Scenario) -> float:
    """Return how far a hole may be from its pin without touching it [m]: half the clearance."""
    return 0.5 * assembly_of(scenario).layout.holes.clearance_m
