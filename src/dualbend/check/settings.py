"""The settings of a run as a baseline keeps them, and which of them are no longer the same."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec

from dualbend.scenario.scenario import Scenario
from dualbend.scenario.toml_text import toml

Settings = dict[str, Any]
"""Keys of a resolved scenario at the top; its tables, each by its dotted name with its own keys."""


def settings_of(scenario: Scenario) -> Settings:
    """Return what a resolved scenario asks for, its description apart; what is not set is left out.

    As JSON gives them back: ``{"seed": 1, "sheet": {...}, "sheet.model": {...}}``. A file has its
    name alone, since a baseline is of every machine.
    """
    plain: dict[str, Any] = msgspec.json.decode(msgspec.json.encode(scenario))
    del plain["description"]
    tables = dict(_tables(plain))
    return tables.pop("") | tables


def _tables(table: dict[str, Any], name: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield a table's own keys, then the tables inside it."""
    plain = {k: v for k, v in table.items() if v is not None and not isinstance(v, dict)}
    own = {key: _without_folder(value) for key, value in plain.items()}
    if own:
        yield name, own
    for key, inner in table.items():
        if isinstance(inner, dict):
            yield from _tables(inner, f"{name}.{key}" if name else key)


def _without_folder(value: Any) -> Any:  # noqa: ANN401 - JSON's values
    return Path(value).name if isinstance(value, str) and Path(value).is_absolute() else value


def changed_settings(old: Settings, new: Settings) -> list[str]:
    """Return each key whose value is another one, with both: ``sheet.width_m 0.06 → 0.063``."""
    before, now = _by_key(old), _by_key(new)
    return [
        f"{key} {_shown(before.get(key))} → {_shown(now.get(key))}"
        for key in sorted({*before, *now})
        if before.get(key) != now.get(key)
    ]


def _by_key(settings: Settings) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in settings.items():
        inner = value if isinstance(value, dict) else {"": value}
        found |= {f"{name}.{key}" if key else name: item for key, item in inner.items()}
    return found


def _shown(value: object) -> str:
    return "none" if value is None else toml(value)
