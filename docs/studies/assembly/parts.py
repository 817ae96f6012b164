"""The parts of the study: which runs each is of, and how they must end."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import product

import msgspec
import numpy as np

from assembly.case import Case
from dualbend.errors import InputError
from dualbend.planning.plan import plan_assembly
from dualbend.scenario.load import load_scenario
from dualbend.scene.bed.config import HOLES
from dualbend.task.assembly.config import assembly_of
from dualbend.types import SIDES, Vector

LARGEST_M, LARGEST_RAD = 0.02, 0.3
"""Gross pick-up errors, along and across, and about the vertical."""

THICKNESSES_M = (0.2e-3, 0.3e-3, 0.5e-3, 0.8e-3, 1e-3, 1.5e-3)
CLEARANCES_M = (0.05e-3, 0.1e-3, 0.2e-3, 0.3e-3)
DIAMETERS_M = (3e-3, 4.76e-3, 6.35e-3)

ARMS = ("puma560", "ur5", "ur10", "panda", "xarm7")
TURNS_DEG = (0, 45, 137)
"""Of both arms' bases about the vertical: each arm sees the bed in another direction."""

FRICTIONS = {f"1/{over}": 1.0 / over for over in (0.6, 0.8, 1.0, 1.2, 1.4)}
"""True Coulomb friction over the fed forward one."""


class Part(msgspec.Struct, frozen=True, kw_only=True):
    """A part of the study: ``design`` of so many runs each; ``lays``: every sheet must be laid."""

    about: str
    count: int
    design: Callable[[int], Iterator[Case]]
    lays: bool = False


def pickup(x_m: float, y_m: float, yaw_rad: float) -> tuple[str, ...]:
    """Return the settings of a sheet that lies off."""
    values = {"x_m": x_m, "y_m": y_m, "yaw_rad": yaw_rad}
    return tuple(f"task.errors.pickup_{key}={value:.6g}" for key, value in values.items())


def _draws(part: int, index: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(part, spawn_key=(index,)))


def gross(draws: int) -> Iterator[Case]:
    """Yield sheets that lie anywhere within ±20 mm and ±0.3 rad."""
    most = np.array([LARGEST_M, LARGEST_M, LARGEST_RAD])
    for index in range(draws):
        off = most * _draws(1, index).uniform(-1.0, 1.0, 3)
        yield Case("±20 mm along and across, ±0.3 rad", index + 1, pickup(*off.tolist()))


def seats(draws: int) -> Iterator[Case]:
    """Yield sheets of 0.2 to 1.5 mm: every other one as it should be, the others cannot seat."""
    for index in range(draws):
        rng = _draws(2, index)
        thickness = f"sheet.thickness_m={rng.uniform(THICKNESSES_M[0], THICKNESSES_M[-1]):.6g}"
        if index % 2 == 0:
            yield Case("can be seated", index + 1, (thickness,))
        else:
            name, make = OBSTACLES[index // 2 % len(OBSTACLES)]
            yield Case(name, index + 1, (thickness, *make(rng)))


def _direction(rng: np.random.Generator, length_m: float) -> Vector:
    turn = rng.uniform(0.0, 2.0 * math.pi)
    return length_m * np.array([math.cos(turn), math.sin(turn)])


def _beyond(rng: np.random.Generator) -> tuple[str, ...]:
    x, y = _direction(rng, rng.uniform(6e-3, 9e-3)).tolist()
    return pickup(x, y, 0.0)


def _holes(offsets: Vector) -> tuple[str, ...]:
    return (f"task.layout.holes.errors_m={np.round(offsets, 7).tolist()}",)


def _all_holes_off(rng: np.random.Generator) -> tuple[str, ...]:
    return _holes(np.tile(_direction(rng, 12e-3), (len(HOLES), 1)))


def _outer_holes_off(rng: np.random.Generator) -> tuple[str, ...]:
    offsets = np.zeros((len(HOLES), 2))
    for side in range(len(SIDES)) if rng.random() < 0.5 else [rng.integers(len(SIDES))]:
        offsets[len(SIDES) + side] = _direction(rng, rng.uniform(0.6e-3, 3e-3))
    return _holes(offsets)


def _thick_pin(rng: np.random.Generator) -> tuple[str, ...]:
    return thick_pin(int(rng.integers(len(HOLES))), float(rng.uniform(0.25e-3, 0.6e-3)))


def thick_pin(which: int, thicker_m: float) -> tuple[str, ...]:
    """Return the settings of a pin that is thicker than drawn."""
    thicker = [round(thicker_m, 7) if i == which else 0.0 for i in range(len(HOLES))]
    return (f"task.layout.pins.thicker_m={thicker}",)


OBSTACLES: tuple[tuple[str, Callable[[np.random.Generator], tuple[str, ...]]], ...] = (
    ("picked up 6-9 mm off", _beyond),
    ("all holes 12 mm off", _all_holes_off),
    ("outer holes 0.6-3 mm off", _outer_holes_off),
    ("a pin 0.25-0.6 mm too thick", _thick_pin),
)


def layouts(seeds: int) -> Iterator[Case]:
    """Yield sheets, clearances and pins, bent as shipped where possible, else best."""
    for thickness, clearance, diameter in product(THICKNESSES_M, CLEARANCES_M, DIAMETERS_M):
        settings = (
            f"sheet.thickness_m={thickness!r}",
            f"task.layout.holes.clearance_m={clearance!r}",
            f"task.layout.pins.diameter_m={diameter!r}",
        )
        name = (
            f"sheet {1e3 * thickness:g} mm, clearance {1e3 * clearance:g} mm, "
            f"pins {1e3 * diameter:g} mm"
        )
        for seed in range(1, seeds + 1):
            yield Case(name, seed, (*settings, *_bend(settings)))


def _bend(settings: tuple[str, ...]) -> tuple[str, ...]:
    """Return the best bending angle where the shipped one is none at which the sheet goes on."""
    scenario = load_scenario("pwb", settings)
    layout = assembly_of(scenario).layout
    try:
        plan = plan_assembly(
            *(scenario.sheet.sheet(), layout.holes, layout.pins),
            yield_strain=scenario.limit_strain,
        )
    except InputError:
        return ()
    low, high = plan.range.clear_rad, plan.range.highest_rad
    if low <= scenario.path.end_rad <= high:
        return ()
    return (f"path.end_rad={plan.bend_rad!r}",)


def arms(seeds: int) -> Iterator[Case]:
    """Yield other arms, and arms that see the bed in another direction."""
    for arm, degrees, scenario in product(ARMS, TURNS_DEG, ("pwb", "pwb-misaligned")):
        turned = f"cell.base_yaw_rad={math.radians(degrees):.6g}"
        settings = (f"robot.model={arm}", *((turned,) if degrees else ()))
        for seed in range(1, seeds + 1):
            yield Case(f"{arm}, bases turned by {degrees}°, {scenario}", seed, settings, scenario)


def corners(seeds: int) -> Iterator[Case]:
    """Yield sheets 2 mm off along and across and turned by 1°, in all combinations of signs."""
    for x, y, yaw in product((-1, 1), repeat=3):
        for seed in range(1, seeds + 1):
            name = f"{2 * x:+d} mm, {2 * y:+d} mm, {yaw:+d}°"
            yield Case(name, seed, pickup(2e-3 * x, 2e-3 * y, math.radians(yaw)))


def friction(seeds: int) -> Iterator[Case]:
    """Yield arms of another friction than is fed forward, which they learn or do not."""
    for said, ratio in FRICTIONS.items():
        for learnt, scenario in product((True, False), ("pwb", "pwb-misaligned")):
            settings = (
                f"imperfections.robot.coulomb_ratio={ratio:.6g}",
                *(() if learnt else ("robot.servo.friction_estimate=none",)),
            )
            name = f"friction {said}, {'learnt' if learnt else 'not learnt'}, {scenario}"
            for seed in range(1, seeds + 1):
                yield Case(name, seed, settings, scenario)


PARTS = {
    "gross": Part(about="gross pick-up errors", count=1000, design=gross),
    "seats": Part(about="seated or not", count=1000, design=seats),
    "layouts": Part(about="sheets, clearances, pins", count=2, design=layouts, lays=True),
    "arms": Part(about="other arms, turned", count=2, design=arms, lays=True),
    "corners": Part(about="2 mm, 2 mm, 1°", count=5, design=corners, lays=True),
    "friction": Part(about="friction fed forward wrongly", count=8, design=friction, lays=True),
}
