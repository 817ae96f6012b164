"""The section ``[imperfections]``: what the cell does wrong that nobody in it knows of.

``imperfections = "typical"`` takes the numbers of a preset; keys of its sections stand before the
preset's. What is drawn is drawn from the scenario's seed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal

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


PRESETS: Final[Mapping[str, Mapping[str, Mapping[str, Any]]]] = {
    "none": {},
    "typical": {},
    "worst": {},
}
"""Numbers of each preset, by section and key; their sources: docs/imperfections.md."""


def with_preset(table: Mapping[str, Any]) -> dict[str, Any]:
    """Return a section's table with the numbers of its preset where it gives none."""
    preset = PRESETS.get(str(table.get("preset", "none")), {})
    resolved = dict(table)
    for section, numbers in preset.items():
        given = resolved.get(section, {})
        if isinstance(given, Mapping):
            resolved[section] = {**numbers, **given}
    return resolved


def alone(name: PresetName) -> dict[str, dict[str, dict[str, Any]]]:
    """Return a preset's imperfections one by one: tables of sections, by what each is called.

    Keys of a section that begin with the same word are one imperfection: ``coulomb_ratio`` and
    ``coulomb_spread`` are "robot coulomb".
    """
    parts: dict[str, dict[str, dict[str, Any]]] = {}
    for section, numbers in PRESETS[name].items():
        for key, value in numbers.items():
            part = parts.setdefault(f"{section} {key.split('_')[0]}", {section: {}})
            part[section][key] = value
    return parts
