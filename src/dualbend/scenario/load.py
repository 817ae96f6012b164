"""Loading a scenario: files that extend one another, settings, and what replaces what."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import msgspec

from dualbend.beam.material import Material, materials_of
from dualbend.control.compliance.own import OwnComplianceConfig, checked_options, option_struct
from dualbend.errors import InputError, brief, refusing, shortened
from dualbend.imperfection.config import with_preset
from dualbend.registry import holds, own_names
from dualbend.resources import scenarios_dir
from dualbend.scenario.explain import UNSET, converted, nearest, refuse_absurd, refuse_unknown
from dualbend.scenario.scenario import Scenario
from dualbend.scenario.sections import with_arm_files, without_other_arms
from dualbend.scenario.sheet import MaterialConfig, own_material
from dualbend.scenario.structs import KIND, Kinds, fields_in, has_kinds
from dualbend.scenario.toml_text import parse_toml, read_toml

Settings: TypeAlias = Sequence[str] | Mapping[str, Any]
"""Texts ``path.to.key=value``, or the tables of a scenario as a dictionary."""

_SCENARIO: Kinds = {"": Scenario}

_LONGEST_CHAIN = 20
"""Files that extend one another: more is a mistake."""


_IMPERFECTIONS, _COMPLIANCE = "imperfections", "compliance"
_OWN, _CONTROLLER = "own", "controller"


def list_scenarios() -> dict[str, Path]:
    """Return the shipped scenarios, by name."""
    return {path.stem: path for path in sorted(scenarios_dir().glob("*.toml"))}


def load_scenario(name_or_file: str, settings: Settings = (), seed: int | None = None) -> Scenario:
    """Load a shipped scenario by name, or a file, with settings laid over it.

    Settings are texts, ``["sheet.width_m=0.06"]``, or tables, ``{"sheet": {"width_m": 0.06}}``.

    Raises
    ------
    InputError
        There is no such scenario, or something in it or in the settings is wrong: the message has
        file, key, value and what would be right.
    """
    path = _find(name_or_file)
    over = "settings" if isinstance(settings, Mapping) else "--set"
    source = f"{path.name} with {over}" if settings else path.name
    return resolve_scenario(_read(path, seen=()), source, settings, seed)


def read_scenario(name_or_file: str) -> dict[str, Any]:
    """Return the tables of a shipped scenario or a file, those that it extends merged in."""
    return _read(_find(name_or_file), seen=())


def resolve_scenario(
    tables: Mapping[str, Any],
    source: str,
    settings: Settings = (),
    seed: int | None = None,
    *,
    to_run: bool = True,
) -> Scenario:
    """Return the scenario of tables with settings applied; ``source`` is named in messages.

    ``to_run``: a class of the user's in it is imported, and its options are checked.
    """
    data = _laid_over({}, _short_forms(tables))
    # A module that a setting names is in the working folder, or beside that of the scenario.
    folders = [Path.cwd(), *_folder_of(data)]
    given: list[tuple[str, Mapping[str, Any]]] = (
        [("settings", _tables_of(settings))]
        if isinstance(settings, Mapping)
        else [(f"--set {shortened(text, 80)}", _table_of(text)) for text in settings]
    )
    parts = []
    for said, table in given:
        with refusing(said):
            own = _with_files(_short_forms(table, *folders), Path())
        parts.append((said, *_split(own, _SCENARIO)))
    # What replaces other keys (a new kind, material or arm) comes first, the others stay, in the
    # order given.
    for said, table in (
        *((said, first) for said, first, _ in parts),
        *((said, rest) for said, _, rest in parts),
    ):
        _refuse_values_as_sections(data, table, said)
        data = _laid_over(data, table)
    if seed is not None:
        data["seed"] = seed
    if isinstance(data.get(_IMPERFECTIONS), dict):
        data[_IMPERFECTIONS] = with_preset(data[_IMPERFECTIONS])
    scenario = converted(data, Scenario, source)
    return _with_options(scenario, source) if to_run else scenario


def parse_scenario(text: str, source: str) -> Scenario:
    """Return the scenario of a resolved TOML text; InputError with ``source`` where it is none.

    No code of a user's is run, nor need it be there: it may be of a run that is long over.
    """
    return resolve_scenario(parse_toml(text, source), source, to_run=False)


def _find(name_or_file: str) -> Path:
    path = Path(name_or_file)
    # A name may be too long, or have a NUL.
    with refusing(f"{brief(name_or_file)}: no such file", OSError, ValueError):
        exists, is_file = path.exists(), path.is_file()
    shipped = list_scenarios()
    if name_or_file in shipped and not is_file:
        return shipped[name_or_file]
    if path.suffix == ".rrd":
        raise InputError(f"{path}: is a recording, which rerun shows; this needs a scenario, .toml")
    if path.suffix == ".toml" and not exists:
        raise InputError(f"{name_or_file}: no such file")
    if not exists or not name_or_file:
        raise InputError(
            f"scenario {brief(name_or_file)}: "
            f"{nearest(repr(name_or_file), map(repr, shipped), 1)}"
            f"shipped are {', '.join(shipped)}; or give the path of a .toml file"
        )
    return path


def _read(path: Path, seen: tuple[Path, ...]) -> dict[str, Any]:
    """Return the file's table merged over the one it extends."""
    tables = _with_files(_short_forms(read_toml(path), path.parent), path.parent)
    data = _learned_from(path.parent, tables)
    base = data.pop("extends", None)
    # Here, so that the message names the file which holds the key.
    refuse_absurd(data, path.name, ())
    refuse_unknown(data, _SCENARIO, path.name, ())
    if base is None:
        return data
    said = f"{path.name}: extends = {brief(base)}"
    if not isinstance(base, str):
        raise InputError(f"{said}: needs a scenario's name or file")
    if "\0" in base:
        raise InputError(f"{said}: no file's name")
    with refusing(said, InputError, OSError, RuntimeError):  # a link to itself
        base_path = path.parent / base if base.endswith(".toml") else _find(base)
        here = path.resolve()
        if base_path.resolve() in (*seen, here):
            raise InputError("the files extend each other in a circle")
        if len(seen) == _LONGEST_CHAIN:
            raise InputError(f"more than {_LONGEST_CHAIN} files extend one another")
    parent = _read(base_path, (*seen, here))
    parent.pop("description", None)
    return _laid_over(parent, data)


def _learned_from(folder: Path, tables: dict[str, Any]) -> dict[str, Any]:
    """Return tables in which the file ``path.learned`` is found from the scenario's own folder."""
    path = tables.get("path")
    name = path.get("learned", UNSET) if isinstance(path, dict) else UNSET
    if not isinstance(name, str) or name == UNSET:
        return tables
    return {**tables, "path": {**tables["path"], "learned": str(folder / name)}}


def _short_forms(tables: Mapping[str, Any], *folders: Path) -> dict[str, Any]:
    """Return tables in which what a file may say in short is the section that it stands for.

    ``imperfections = "typical"`` is a preset; ``compliance.kind = "module:Class"``, or the name of
    a controller that a package brings, a class, whose module is looked for in the folders.
    """
    found = dict(tables)
    if isinstance(preset := found.get(_IMPERFECTIONS), str):
        found[_IMPERFECTIONS] = {"preset": preset}
    said = found.get(_COMPLIANCE)
    table = {KIND: said} if isinstance(said, str) else dict(said) if isinstance(said, dict) else {}
    if isinstance(kind := table.get(KIND), str) and (":" in kind or kind in own_names()):
        table = {**table, KIND: _OWN, _CONTROLLER: kind}
    name, given = table.get(_CONTROLLER), table.get("folder")
    if isinstance(name, str) and (given is None or isinstance(given, str)):
        # A folder that a run's scenario names may be gone: then the file's own will do.
        places = [*([] if given is None else [Path(given)]), *folders]
        at = next((folder.resolve() for folder in places if holds(folder, name)), None)
        table |= {} if at is None else {"folder": str(at)}
    return {**found, _COMPLIANCE: table} if _CONTROLLER in table else found


def _folder_of(tables: Mapping[str, Any]) -> list[Path]:
    said = tables.get(_COMPLIANCE)
    folder = said.get("folder") if isinstance(said, dict) else None
    return [Path(folder)] if isinstance(folder, str) else []


def _with_options(scenario: Scenario, source: str) -> Scenario:
    """Return a scenario whose own controller's options are complete, as its class has them."""
    config = scenario.compliance
    if not isinstance(config, OwnComplianceConfig):
        return scenario
    with refusing(f"{source}: {_COMPLIANCE}.{KIND} = {brief(config.controller)}"):
        struct = option_struct(config.made_by())
    given = checked_options(struct, config.options)
    options = converted(given, struct, source, (_COMPLIANCE, "options"))
    plain = {
        name: value
        for name, value in msgspec.structs.asdict(options).items()
        if name not in config.options and isinstance(value, bool | int | float | str)
    }
    config = msgspec.structs.replace(config, options={**config.options, **plain})
    return msgspec.structs.replace(scenario, compliance=config)


def _with_files(tables: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Return tables in which arms and materials are found from a folder."""
    if "robot" in tables:
        tables = {**tables, "robot": with_arm_files(tables["robot"], folder)}
    return _with_materials(tables, folder)


def read_materials(path: Path) -> dict[str, Material]:
    """Return the materials of a file like the library's, by name; InputError where it is none."""
    tables = read_toml(path)
    with refusing(str(path)):
        refuse_absurd(tables, "", ())
        return materials_of(tables)


def _with_materials(tables: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Return tables in which the file of a material has become its numbers and its name.

    So that a record needs no file beside it. ``own.toml`` is the only material of that file, found
    from ``folder``; ``own.toml:NAME`` one of several.
    """
    sheet, found = tables.get("sheet"), dict[str, Any]()
    if not isinstance(sheet, dict):
        return tables

    def named(key: str, value: object) -> object:
        if not isinstance(value, str) or ".toml" not in value:
            return value
        with refusing(f"sheet.{key} = {brief(value)}"):
            own = own_material(_material_of(value, folder))
            converted(own, MaterialConfig, f"[{own['name']}]")  # refuses what is out of bounds
        found[own["name"]] = own
        return own["name"]

    own = {**sheet}
    if "material" in sheet:
        own["material"] = named("material", sheet["material"])
    if isinstance(layers := sheet.get("layers"), list):
        own["layers"] = [
            {**layer, "material": named(f"layers[{i}].material", layer["material"])}
            if isinstance(layer, dict) and "material" in layer
            else layer
            for i, layer in enumerate(layers)
        ]
    if not found:
        return tables
    kept = own.get("materials")
    others = kept if isinstance(kept, list) else []
    return {**tables, "sheet": {**own, "materials": [*others, *found.values()]}}


def _material_of(said: str, folder: Path) -> Material:
    """Return the material that ``file.toml`` or ``file.toml:NAME`` means."""
    file, _, name = said.partition(".toml:")
    path = folder / (file if not name else f"{file}.toml")
    materials = read_materials(path)
    if not name and len(materials) != 1:
        raise InputError(
            f"{path} holds {len(materials)} materials: add the name of one after a colon, "
            f"{path.name}:{next(iter(materials), 'NAME')}"
        )
    name = name or next(iter(materials))
    if name not in materials:
        raise InputError(f"{path} holds {', '.join(materials) or 'no material'}, not {brief(name)}")
    return materials[name]


def _laid_over(base: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """Return the tables of a scenario ``over`` laid upon those of another, ``base``."""
    return _merge(without_other_arms(base, over), over, _SCENARIO)


def _merge(base: Mapping[str, Any], over: Mapping[str, Any], kinds: Kinds) -> dict[str, Any]:
    """Return the table ``over`` laid upon ``base``; one of another kind replaces it whole.

    So does one of another class.
    """
    merged = dict(base)
    if has_kinds(kinds):
        kind = base.get(KIND, next(iter(kinds)))
        another = over.get(_CONTROLLER, UNSET) not in (UNSET, base.get(_CONTROLLER, UNSET))
        if over.get(KIND, kind) != kind or another:
            merged = {}
        merged.setdefault(KIND, over.get(KIND, kind))
    fields = fields_in(kinds, merged)
    for key, value in over.items():
        field = fields.get(key)
        below = field.kinds if field else {}
        if field and field.default is None and value in (None, UNSET) and UNSET not in below:
            merged.pop(key, None)
            continue
        for other in (field.replaces or ()) if field else ():
            if other not in over:
                merged.pop(other, None)
        table = {KIND: value} if isinstance(value, str) and has_kinds(below) else value
        if isinstance(table, dict):
            # Also where the base has no such section: UNSET in it says nothing.
            under = merged.get(key)
            table = _merge(under if isinstance(under, dict) else {}, table, below)
        merged[key] = table
    return merged


def _split(table: Mapping[str, Any], kinds: Kinds) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return what of a setting replaces what a section had, and the rest."""
    first: dict[str, Any] = {}
    rest: dict[str, Any] = {}
    fields = fields_in(kinds, table)
    for key, value in table.items():
        field = fields.get(key)
        below = field.kinds if field else {}
        short = has_kinds(below) and isinstance(value, str)
        names = has_kinds(kinds) and key in (KIND, _CONTROLLER)
        if short or names or (field and field.replaces is not None):
            first[key] = value
        elif isinstance(value, dict) and value:
            for part, inner in zip((first, rest), _split(value, below), strict=True):
                if inner:
                    part[key] = inner
        else:
            rest[key] = value
    return first, rest


def _tables_of(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return tables with plain numbers and lists, also of NumPy's and of sections' structs."""
    with refusing(
        "settings: need numbers, texts, lists and tables",
        *(TypeError, AttributeError, RecursionError),
    ):
        tables: dict[str, Any] = msgspec.to_builtins(
            settings, str_keys=True, enc_hook=lambda value: value.tolist()
        )
    return tables


def _table_of(setting: str) -> dict[str, Any]:
    """Return the tables that ``path.to.key=value`` stands for."""
    name, equals, text = setting.partition("=")
    names = name.strip().split(".")
    if not equals or not all(names) or len(names) > 10:
        raise InputError(
            f"--set {shortened(setting, 80)}: needs path.to.key=value, "
            "e.g. robot.alter.delay_cycles=2"
        )
    value: Any
    try:
        (value,) = parse_toml(f"value = {text}", name).values()
    except ValueError:  # no TOML, or several lines of it
        value = _number_or_text(text.strip())
    for name in reversed(names):
        value = {name: value}
    table: dict[str, Any] = value
    return table


def _number_or_text(text: str) -> float | str:
    """Read what a shell user writes without TOML's strictness: .5 and bare words."""
    try:
        return float(text)
    except ValueError:
        return text


def _refuse_values_as_sections(data: object, table: Mapping[str, Any], said: str) -> None:
    for name, value in table.items():
        if isinstance(value, dict) and isinstance(data, dict) and name in data:
            if not isinstance(data[name], dict):
                raise InputError(f"{said}: {brief(name)} is a value, not a section")
            _refuse_values_as_sections(data[name], value, said)
