"""The section ``[imperfections]``: what the cell does wrong that nobody in it knows of.

``imperfections = "typical"`` takes the numbers of a preset; keys of its sections stand before the
preset's. What is drawn is drawn from the scenario's seed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal

import msgspec

from dualbend.imperfection.events import EventsConfig
from dualbend.imperfection.link import LinkConfig
from dualbend.imperfection.robot import RobotErrors
from dualbend.imperfection.sensor import SensorErrors
from dualbend.imperfection.sheet import SheetErrors
from dualbend.types import Config, said

PresetName = Literal["none", "typical", "worst"]

SECTIONS: Final = ("robot", "sensor", "link", "sheet", "events")


class ImperfectionsConfig(Config):
    """What robots, sensors, link and sheet do wrong, and what happens to them during a run."""

    preset: Annotated[
        PresetName,
        said("numbers of what is not given; docs/imperfections.md", extra={"replaces": SECTIONS}),
    ] = "none"
    robot: RobotErrors = RobotErrors()
    sensor: SensorErrors = SensorErrors()
    link: LinkConfig = LinkConfig()
    sheet: SheetErrors = SheetErrors()
    events: EventsConfig = EventsConfig()


Numbers = Mapping[str, Mapping[str, Any]]
"""Keys and values of some sections of the imperfections."""

PRESETS: Final[Mapping[PresetName, Mapping[str, Numbers]]] = {
    "none": {},
    "typical": {},
    "worst": {},
}
"""Numbers of each preset by imperfection; their sources: docs/imperfections.md."""


def with_preset(table: Mapping[str, Any]) -> dict[str, Any]:
    """Return a section's table with the numbers of its preset where it gives none."""
    resolved = dict(table)
    for numbers in PRESETS.get(resolved.get("preset", "none"), {}).values():
        for section, values in numbers.items():
            given = resolved.get(section, {})
            if isinstance(given, Mapping):
                resolved[section] = {**values, **given}
    return resolved


def alone(name: PresetName) -> dict[str, ImperfectionsConfig]:
    """Return no imperfection ("none"), each of a preset by itself, and "all" of them."""
    every = with_preset({"preset": name})
    del every["preset"]
    tables: dict[str, Numbers] = {"none": {}, **PRESETS[name], "all": every}
    return {part: msgspec.convert(table, ImperfectionsConfig) for part, table in tables.items()}
