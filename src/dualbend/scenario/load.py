"""Loading a scenario: files that extend one another, settings, and what replaces what."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec

from dualbend.errors import InputError
from dualbend.resources import scenarios_dir
from dualbend.scenario.arm_change import without_other_arms
from dualbend.scenario.explain import UNSET, _fields_of, explain, refuse_absurd, refuse_unknown
from dualbend.scenario.scenario import Scenario
from dualbend.scenario.sheet import MATERIAL_KEYS, SheetConfig

_ALTERNATIVES = ("interval_rad", "pieces")
"""Keys of a path that say the same thing: giving one takes the other back."""


_REPLACES = (("sheet", "material"), ("sheet", "layers"))
"""Keys that take back what the section had, as any ``kind`` and all of the arms do."""


def list_scenarios() -> dict[str, Path]:
    """Return the shipped scenarios, by name."""
    return {path.stem: path for path in sorted(scenarios_dir().glob("*.toml"))}


def load_scenario(
    name_or_file: str, settings: Sequence[str] = (), seed: int | None = None
) -> Scenario:
    """Load a shipped scenario by name, or a file, with ``path.to.key=value`` settings applied."""
    path = _find(name_or_file)
    source = f"{path.name} with --set" if settings else path.name
    return resolve_scenario(_read(path, seen=()), source, settings, seed)


def read_scenario(name_or_file: str) -> dict[str, Any]:
    """Return the tables of a shipped scenario or a file, those that it extends merged in."""
    return _read(_find(name_or_file), seen=())


def resolve_scenario(
    tables: Mapping[str, Any], source: str, settings: Sequence[str] = (), seed: int | None = None
) -> Scenario:
    """Return the scenario of tables with settings applied; ``source`` is named in messages."""
    data = dict(tables)
    # A new kind, material or arm takes back what the one before had: it comes first, the others
    # stay, in the order given.
    given = [(setting, *_split(_table_of(setting))) for setting in settings]
    for setting, table in [
        *((setting, early) for setting, early, _ in given),
        *((setting, late) for setting, _, late in given),
    ]:
        if table:
            _refuse_values_as_sections(data, setting)
            data = _merge(data, table)
    if seed is not None:
        data["seed"] = seed
    return _convert(data, source)


def _split(
    table: Mapping[str, Any], path: tuple[str, ...] = ()
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return what of a setting takes back what a section had, and the rest."""
    early: dict[str, Any] = {}
    late: dict[str, Any] = {}
    for key, value in table.items():
        where = (*path, key)
        if path and (key == "kind" or path[0] == "arm" or where in _REPLACES):
            early[key] = value
        elif isinstance(value, dict) and value:
            for part, inner in zip((early, late), _split(value, where), strict=True):
                if inner:
                    part[key] = inner
        else:
            late[key] = value
    return early, late


def parse_scenario(text: str, source: str) -> Scenario:
    """Return the scenario that a resolved TOML text is; ``source`` is named in an error.

    Raises
    ------
    InputError
        It is no TOML, or no scenario.
    """
    try:
        data = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{source}: no valid TOML: {error}") from error
    return _convert(data, source)


def _find(name_or_file: str) -> Path:
    path = Path(name_or_file)
    try:
        is_file = path.is_file()
    except (OSError, ValueError) as error:  # too long, or with a NUL
        raise InputError(f"{name_or_file!r}: no such file: {error}") from error
    if path.suffix == ".toml" or is_file:
        if not is_file:
            raise InputError(f"{name_or_file}: no such file")
        return path
    shipped = list_scenarios()
    if name_or_file not in shipped:
        close = difflib.get_close_matches(name_or_file, shipped, n=1)
        hint = f"did you mean {close[0]!r}? " if close else ""
        raise InputError(
            f"scenario {name_or_file!r}: {hint}shipped are {', '.join(shipped)}; "
            "or give the path of a .toml file"
        )
    return shipped[name_or_file]


def _read(path: Path, seen: tuple[Path, ...]) -> dict[str, Any]:
    """Return the file's table merged over the one it extends."""
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read: {error}") from error
    except (ValueError, RecursionError) as error:  # also thousands of digits or brackets
        raise InputError(f"{path.name}: no valid TOML: {error}") from error
    base = data.pop("extends", None)
    # Here, so that the message names the file which holds the key.
    refuse_absurd(data, path.name, ())
    refuse_unknown(data, Scenario, path.name, ())
    if base is None:
        return data
    if not isinstance(base, str):
        raise InputError(f"{path.name}: extends = {base!r}: needs a scenario's name or file")
    if "\0" in base:
        raise InputError(f"{path.name}: extends = {base!r}: no file's name")
    try:
        base_path = path.parent / base if base.endswith(".toml") else _find(base)
    except InputError as error:
        raise InputError(f"{path.name}: extends = {base!r}: {error}") from error
    if base_path.resolve() in seen or base_path.resolve() == path.resolve():
        raise InputError(
            f"{path.name}: extends = {base!r}: the files extend each other in a circle"
        )
    parent = _read(base_path, (*seen, path.resolve()))
    parent.pop("description", None)
    return _merge(parent, data)


def _merge(
    base: dict[str, Any], over: Mapping[str, Any], kind: object = Scenario
) -> dict[str, Any]:
    """Return ``over`` laid upon ``base``; a section of another ``kind`` replaces it whole."""
    fields = _fields_of(kind)
    # A base that does not say its kind has the default one.
    default = fields["kind"].default if "kind" in fields else None
    if "kind" in over and over["kind"] != base.get("kind", default):
        base = {}
    merged = dict(base) if kind is not Scenario else without_other_arms(base, over)
    for key, value in over.items():
        if value == UNSET and key in fields and fields[key].default is None:
            merged.pop(key, None)
        elif isinstance(value, dict):
            # Also where the base has no such section: UNSET in it says nothing.
            below = merged.get(key)
            kind_below = fields[key].type if key in fields else None
            merged[key] = _merge(below if isinstance(below, dict) else {}, value, kind_below)
        else:
            merged[key] = value
    if kind is SheetConfig and any(over.get(k, UNSET) != UNSET for k in ("material", "layers")):
        # Another material: the numbers of the one before are none of its own.
        whole = MATERIAL_KEYS if "layers" not in over else (*MATERIAL_KEYS, "thickness_m")
        for key in set(whole) - over.keys():
            merged.pop(key, None)
    for given, other in (_ALTERNATIVES, _ALTERNATIVES[::-1]):
        if given in fields and given in over and other not in over:
            merged.pop(other, None)
    return merged


def _table_of(setting: str) -> dict[str, Any]:
    """Return the tables that ``path.to.key=value`` stands for."""
    names = _names_of(setting)
    _, equals, text = setting.partition("=")
    if not equals or not all(names) or len(names) > 10:
        raise InputError(f"--set {setting}: needs path.to.key=value, e.g. alter.delay_cycles=2")
    value: Any
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):
        value = _number_or_text(text.strip())
    for name in reversed(names[1:]):
        value = {name: value}
    return {names[0]: value}


def _names_of(setting: str) -> list[str]:
    return setting.partition("=")[0].strip().split(".")


def _refuse_values_as_sections(data: Mapping[str, Any], setting: str) -> None:
    table: object = data
    for name in _names_of(setting)[:-1]:
        table = table.get(name, {}) if isinstance(table, dict) else None
        if not isinstance(table, dict):
            raise InputError(f"--set {setting}: {name!r} is a value, not a section")


def _number_or_text(text: str) -> float | str:
    """Read what a shell user writes without TOML's strictness: .5 and bare words."""
    try:
        return float(text)
    except ValueError:
        return text


def _convert(data: dict[str, Any], source: str) -> Scenario:
    data = _merge({}, data)
    refuse_absurd(data, source, ())
    refuse_unknown(data, Scenario, source, ())
    try:
        return msgspec.convert(data, Scenario)
    except msgspec.ValidationError as error:
        raise InputError(f"{source}: {explain(data, str(error), Scenario)}") from error
