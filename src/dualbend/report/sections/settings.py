"""The settings of a run as a report lists them: each key's value, unit, default and meaning."""

from __future__ import annotations

import msgspec

from dualbend.scenario.keys import REQUIRED, sections
from dualbend.scenario.scenario import Scenario
from dualbend.scenario.toml_text import toml
from dualbend.stability.map import gain_units
from dualbend.stability.prediction import SINGLE_AXES

_NAMES_OF_THE_RUN = frozenset({"name", "description"})


class Setting(msgspec.Struct, frozen=True, kw_only=True):
    """One key of a resolved scenario, as texts; ``changed``: it has no default, or another one."""

    key: str
    value: str
    unit: str
    default: str | None
    description: str
    changed: bool


def settings_of(scenario: Scenario) -> list[Setting]:
    """Return every key that a scenario sets or inherits; of sections that are off, none."""
    units = {
        f"compliance.{axis}.{gain}": unit  # which compliance.units chooses
        for axis in SINGLE_AXES
        for gain, unit in zip("bk", gain_units(scenario.compliance, axis), strict=True)
    }
    found = []
    for section in sections():
        values = section.of(scenario)
        for key in section.keys if values is not None else ():
            name = ".".join((*section.path, key.name))
            if name in _NAMES_OF_THE_RUN:
                continue
            value = msgspec.to_builtins(getattr(values, key.name))
            required = key.in_section is REQUIRED
            default = None if required else msgspec.to_builtins(key.in_section)
            found.append(
                Setting(
                    key=name,
                    value=_shown(value),
                    unit=units.get(name, key.unit),
                    default=None if required else _shown(default),
                    description=key.description,
                    changed=required or _plain(value) != _plain(default),
                )
            )
    return found


def _plain(value: object) -> object:
    """Return a value in which a list and a tuple of the same items are equal."""
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value


def _shown(value: object) -> str:
    return "none" if value is None else toml(value)
