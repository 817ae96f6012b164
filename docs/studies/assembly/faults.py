"""Faults: those that happen at a time, in the middle of each phase, and those that are there."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import product

import msgspec

from assembly.case import Case, Ran
from assembly.parts import thick_pin
from dualbend.scene.bed.config import HOLES
from dualbend.task.assembly.program.motions import PHASES
from dualbend.types import SIDES

Settings = tuple[str, ...]

FAULT_FREE = "fault-free"
SCENARIOS = ("pwb", "pwb-misaligned")
"""In the first, hardly anything touches a pin before the seats are checked."""


class Event(msgspec.Struct, frozen=True):
    """A fault at a time [s] on a side; ``always``: what the run without it has, too."""

    name: str
    settings: Callable[[float, str], Settings]
    always: Settings = ()


def _dropped(at_s: float, side: str) -> Settings:
    key = "imperfections.events.power_failure"
    return f"{key}.at_s={at_s:.4f}", f"{key}.side={side}"


def _lost(at_s: float, side: str) -> Settings:
    key = "imperfections.sensor.stuck"
    return f'{key}=["{side}"]', f"{key}_from_s={at_s:.4f}"


def _stopped(at_s: float, side: str) -> Settings:
    key = "imperfections.events.arm_stop"
    return f"{key}.at_s={at_s:.4f}", f"{key}.side={side}"


EVENTS = (
    # A grip without friction does not slide; one of 1 holds the sheet in all phases.
    Event("dropped sheet", _dropped, ("grasp.friction=1.0",)),
    Event("lost sensor", _lost),
    Event("stopped arm", _stopped),
)


def _sign(seed: int) -> int:
    return 1 if seed % 2 else -1


STANDING: dict[str, Callable[[int], Settings]] = {
    "missed grasp": lambda seed: (f"task.errors.pickup_x_m={0.012 * _sign(seed):g}",),
    "bent sheet": lambda seed: (f"imperfections.sheet.curvature_per_m={0.5 * _sign(seed):g}",),
    "missing pin": lambda seed: (f'task.layout.pins.missing=["{HOLES[seed % len(HOLES)]}"]',),
    "thick pin": lambda seed: thick_pin(seed % len(HOLES), 0.3e-3),
}
"""Faults that are there from the start, by seed: both signs, and every pin in turn.

0.5 1/m is 10 mm high over the sheet; a pin 0.3 mm thicker is 0.1 mm thicker than its hole.
"""


KINDS = (*(event.name for event in EVENTS), *STANDING)
"""What all faults are called."""


def fault_free(seeds: int, kinds: Sequence[str] = KINDS) -> Iterator[Case]:
    """Yield the runs that tell when each phase begins and ends."""
    each = dict.fromkeys(event.always for event in EVENTS if event.name in kinds)
    for always, scenario, seed in product(each, SCENARIOS, range(1, seeds + 1)):
        yield Case(FAULT_FREE, seed, always, scenario)


def faults(seeds: int, fault_free: Sequence[Ran], kinds: Sequence[str] = KINDS) -> Iterator[Case]:
    """Yield every fault of these kinds: events in the middle of each phase of the run without them.

    On the left for even seeds, on the right for odd ones.
    """
    told = {run.case: run.phases for run in fault_free}
    runs = list(product(SCENARIOS, range(1, seeds + 1)))
    events = [event for event in EVENTS if event.name in kinds]
    for event, phase, (scenario, seed) in product(events, PHASES, runs):
        phases = told[Case(FAULT_FREE, seed, event.always, scenario)]
        if phase in phases:
            at_s, side = sum(phases[phase]) / 2.0, SIDES[seed % len(SIDES)]
            settings = (*event.always, *event.settings(at_s, side))
            yield Case(f"{event.name} in {phase}", seed, settings, scenario)
    for name, (scenario, seed) in product([name for name in STANDING if name in kinds], runs):
        yield Case(name, seed, STANDING[name](seed), scenario)
