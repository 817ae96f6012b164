"""The JSON schema of a scenario file, with which an editor completes and checks the TOML.

Made from the structs. Draft 7, which every TOML language server reads. What a file may do and a
struct cannot say is put in: ``extends`` makes every key optional, "none" takes an optional key back
(TOML has no null). Rules between keys (a step that divides the period) are the loader's alone.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec

from dualbend.control.compliance.own import OwnComplianceConfig
from dualbend.imperfection.config import PRESETS
from dualbend.scenario.explain import UNSET
from dualbend.scenario.keys import Section, listed, sections
from dualbend.scenario.scenario import Scenario
from dualbend.scenario.structs import KIND, Kinds, Struct, fields_of, has_kinds
from dualbend.scenario.task import TaskKinds

Schema = dict[str, Any]

_MOVED = ("prefixItems", "description", "default")
_DEFINITIONS = "#/definitions/"
_DRAFT = "http://json-schema.org/draft-07/schema#"
_CLASS = {"type": "string", "pattern": ".:."}
_EXTENDS = {
    "description": "a shipped scenario's name or a .toml file; this file says what differs from it",
    "type": "string",
    "minLength": 1,
}


def shipped_schema() -> Path:
    """Return the file of the installed package that holds :func:`schema_text`."""
    return Path(__file__).resolve().parent / "scenario.schema.json"


def schema_text() -> str:
    """Return the schema as JSON text, the same for the same code."""
    return msgspec.json.format(msgspec.json.encode(scenario_schema()), indent=2).decode() + "\n"


def scenario_schema() -> Schema:
    """Return the JSON schema (draft 7) of a scenario file."""
    _, components = msgspec.json.schema_components(
        [Scenario, *TaskKinds().values()],
        ref_template=f"{_DEFINITIONS}{{name}}",
        schema_hook=_any_task,
    )
    found = {section.struct.__name__: section for section in (*sections(), *listed())}
    definitions = {name: _definition(schema, found[name]) for name, schema in components.items()}
    top = definitions.pop("Scenario")
    # A class's name is short for a section of the kind "own".
    kind = definitions[OwnComplianceConfig.__name__]["properties"][KIND]
    definitions[OwnComplianceConfig.__name__]["properties"][KIND] = {"anyOf": [kind, _CLASS]}
    top["properties"]["compliance"]["anyOf"].append(_CLASS)
    complete = _complete({"": Scenario})
    complete["properties"]["compliance"]["anyOf"].append(
        {"required": [KIND], "properties": {KIND: _CLASS}}
    )
    # A preset's name alone is short for a table with it.
    short = top["properties"]["imperfections"]
    top["properties"]["imperfections"] = {"anyOf": [short, {"enum": list(PRESETS)}]}
    return {
        "$schema": _DRAFT,
        **top,
        "title": "dualbend scenario",
        "properties": {"extends": _EXTENDS, **top["properties"]},
        # Only a file that stands alone must be complete.
        "if": {"not": {"required": ["extends"]}},
        "then": complete,
        "definitions": definitions,
    }


def _any_task(_: type) -> Schema:
    """Return the schema of the section of the task, the only one that msgspec asks for."""
    places = {kind: f"{_DEFINITIONS}{struct.__name__}" for kind, struct in TaskKinds().items()}
    return {
        "anyOf": [{"$ref": place} for place in places.values()],
        "discriminator": {"propertyName": KIND, "mapping": places},
    }


def _definition(schema: Schema, section: Section) -> Schema:
    """Return a struct's schema as a file may have it: no key is a must, each says what it is."""
    keys = {key.name: key for key in section.keys}
    properties = {}
    for name, found in schema["properties"].items():
        said = _property(found)
        if name in keys:
            key = keys[name]
            text = f"{key.description} [{key.unit}]" if key.unit else key.description
            said = {**said, **({"description": text.strip()} if text else {})}
        properties[name] = said
    return {
        "title": schema["title"],
        "description": " ".join((section.intro, *section.more)),
        "type": "object",
        "properties": properties,
        "additionalProperties": False,
    }


def _property(schema: Schema) -> Schema:
    """Return a key's schema in draft 7, "none" in the place of null."""
    options = schema.get("anyOf", [schema])
    said = [_value(option) for option in options if option.get("type") != "null"]
    default = schema.get("default")
    if kinds := schema.get("discriminator", {}).get("mapping"):
        # The kind alone is short for a table of this kind.
        return {"anyOf": [*said, {"enum": list(kinds)}]}
    if len(said) < len(options):
        said.append({"const": UNSET})
        return {"anyOf": said}
    # Beside a reference draft 7 reads nothing.
    return said[0] if "$ref" in said[0] or default is None else {**said[0], "default": default}


def _value(schema: Schema) -> Schema:
    """Return a value's schema in draft 7: tuples as its ``items`` have them, ECMA's patterns."""
    said = {key: item for key, item in schema.items() if key not in _MOVED}
    if "pattern" in said:
        said["pattern"] = said["pattern"].replace(r"\Z", "$")
    if "prefixItems" in schema:
        said["items"] = [_value(item) for item in schema["prefixItems"]]
        said["additionalItems"] = False
    elif isinstance(said.get("items"), dict):
        said["items"] = _value(said["items"])
    return said


def _complete(kinds: Kinds) -> Schema:
    """Return what a file that extends nothing must hold, in a section and below it."""
    wanted = {kind: _of_struct(struct) for kind, struct in kinds.items()}
    if not has_kinds(kinds) or not any(wanted.values()):
        return wanted.get("", {})
    first = next(iter(kinds))
    options = []
    for kind, of in wanted.items():
        must = [*([] if kind == first else [KIND]), *of.get("required", ())]
        below = {KIND: {"const": kind}, **of.get("properties", {})}
        options.append({"required": must, "properties": below})
    return {"anyOf": options}


def _of_struct(struct: Struct) -> Schema:
    fields = fields_of(struct).items()
    must = [name for name, field in fields if field.default is msgspec.NODEFAULT]
    sections = {name: _complete(field.kinds) for name, field in fields if field.is_section}
    below = {name: wanted for name, wanted in sections.items() if wanted}
    return {**({"required": must} if must else {}), **({"properties": below} if below else {})}
