"""The settings of a run as a report lists them: each key's value, unit, default and meaning."""

from __future__ import annotations

import msgspec

from dualbend.control.compliance.admittance import ComplianceConfig
from dualbend.scenario.keys import REQUIRED, Section, sections
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
    default: str
    description: str
    changed: bool


def settings_of(scenario: Scenario) -> list[Setting]:
    """Return every key that a scenario sets or inherits; of sections that are off, none."""
    units = _gain_units(scenario.compliance)
    return [
        msgspec.structs.replace(setting, unit=units.get(setting.key, setting.unit))
        for section in sections()
        for setting in _of_section(section, section.of(scenario))
    ]


def _gain_units(config: ComplianceConfig) -> dict[str, str]:
    """Return the units of the gains, which ``compliance.units`` chooses."""
    return {
        f"compliance.{axis}.{gain}": unit
        for axis in SINGLE_AXES
        for gain, unit in zip("bk", gain_units(config, axis), strict=True)
    }


def _of_section(section: Section, values: object) -> list[Setting]:
    if values is None:
        return []
    found = []
    for key in section.keys:
        if not section.path and key.name in _NAMES_OF_THE_RUN:
            continue
        value = msgspec.to_builtins(getattr(values, key.name))
        default = msgspec.to_builtins(_default(key.in_section))
        found.append(
            Setting(
                key=".".join((*section.path, key.name)),
                value=_shown(value),
                unit=key.unit,
                default="required" if key.in_section is REQUIRED else _shown(default),
                description=key.description,
                changed=key.in_section is REQUIRED or _plain(value) != _plain(default),
            )
        )
    return found


def _default(value: object) -> object:
    return None if value is REQUIRED else value


def _plain(value: object) -> object:
    """Return a value in which a list and a tuple of the same items are equal."""
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value


def _shown(value: object) -> str:
    return "none" if value is None else toml(value)
