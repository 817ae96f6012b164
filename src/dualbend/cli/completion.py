"""What a shell offers at a tab: scenarios, keys of ``--set`` and their values, materials.

A shell starts the command at every tab, so no physics is imported: the keys are those of the JSON
schema that the package holds as a file.
"""

from __future__ import annotations

import functools
import json
import tomllib
from collections.abc import Iterator
from importlib.resources import files
from typing import Any

import click
from click.shell_completion import BashComplete, CompletionItem, add_completion_class

from dualbend.errors import DualbendError

_FILES = ("learned", "material")
"""Keys whose value may be a file."""

_UNREADABLE = (DualbendError, OSError, ValueError)
"""Of an installation: its user gets no completion instead of a traceback in the prompt."""


def complete_scenarios(
    _: click.Context, __: click.Parameter, incomplete: str
) -> list[CompletionItem]:
    """Offer the shipped scenarios and the TOML files to the shell."""
    from dualbend.scenario.shipped import complete_scenario

    return complete_scenario(incomplete)


def complete_materials(
    _: click.Context, __: click.Parameter, incomplete: str
) -> list[CompletionItem]:
    """Offer the materials of the library."""
    return [CompletionItem(name) for name in _materials() if name.startswith(incomplete)]


def complete_settings(
    _: click.Context, __: click.Parameter, incomplete: str
) -> list[CompletionItem]:
    """Offer what goes on from ``path.to.k`` to a key or section, from ``path.to.key=v`` to a value.

    Numbers and texts have no values to offer; true and false, names and kinds have.
    """
    key, equals, value = incomplete.partition("=")
    above, dot, last = key.rpartition(".")
    found = _keys(above)
    if equals:
        return _values(key, last, found.get(last, {}), value)
    offered = []
    for name in found:
        if name.startswith(last) and name != "extends":  # which is of files alone
            offered += _goes_on(f"{above}{dot}{name}", found[name])
    return offered


def _goes_on(key: str, schema: dict[str, Any]) -> list[CompletionItem]:
    """Return a key as it goes on: ``sheet.`` is a section, ``seed=`` a value, some are both."""
    options = list(_options(schema))
    said = schema.get("description") or next((o.get("description") for o in options), None)
    is_section = ["properties" in option for option in options]
    ends = "." * any(is_section) + "=" * (not all(is_section))
    return [CompletionItem(f"{key}{end}", help=said) for end in ends]


def _values(key: str, name: str, schema: dict[str, Any], begun: str) -> list[CompletionItem]:
    """Return the values of a key that begin so; files where it may be one and nothing else is."""
    known: list[str] = []
    for option in _options(schema):
        known += map(str, option.get("enum", ()))
        known += [str(option["const"])] if "const" in option else []
        known += ["true", "false"] if option.get("type") == "boolean" else []
    is_arm = name == "model" and key.startswith("robot.")
    if name == "material":
        known += _materials()
    elif is_arm:
        examples = (name for option in _options(schema) for name in option.get("examples", ()))
        known += [name for name in examples if "." not in name]
    offered = [value for value in dict.fromkeys(known) if value.startswith(begun)]
    if (name in _FILES or is_arm) and not offered:
        return [CompletionItem(begun, type="file")]
    return [CompletionItem(f"{key}={value}") for value in offered]


def _keys(above: str) -> dict[str, dict[str, Any]]:
    """Return the keys of a section by its dotted name, of all its kinds; {} where it is none."""
    level = _schema().get("properties", {})
    for name in filter(None, above.split(".")):
        options = list(_options(level.get(name, {})))
        level = {}
        # A key that several kinds have may be a section of another content in each.
        for key, schema in (item for o in options for item in o.get("properties", {}).items()):
            level[key] = {"anyOf": [level[key], schema]} if key in level else schema
    return dict(level)


def _options(schema: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield what a value may be, each by itself."""
    if "$ref" in schema:
        schema = _schema()["definitions"][schema["$ref"].rpartition("/")[2]]
    if "anyOf" in schema:
        for option in schema["anyOf"]:
            yield from _options(option)
    elif schema:
        yield schema


@functools.cache
def _schema() -> dict[str, Any]:
    try:
        file = files("dualbend.scenario").joinpath("scenario.schema.json")
        found: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    except _UNREADABLE:
        return {}
    return found


def _materials() -> list[str]:
    from dualbend.resources import models_dir

    try:
        text = (models_dir() / "materials" / "materials.toml").read_text(encoding="utf-8")
        return list(tomllib.loads(text))
    except _UNREADABLE:
        return []


class Bash(BashComplete):
    """bash, which takes ``key=value`` as three words and replaces the last of them alone."""

    # A space after what goes on would end it.
    source_template = BashComplete.source_template.replace(
        "COMPREPLY+=($value)",
        "COMPREPLY+=($value); [[ $value == *[.=] ]] && compopt -o nospace",
    )

    def get_completion_args(self) -> tuple[list[str], str]:
        """Return the words before the one that is completed, and that one, whole."""
        words, last = super().get_completion_args()
        self._typed_before = ""
        if len(words) >= 2 and words[-1] == "=":  # key = val
            *words, key, _ = words
            self._typed_before, last = f"{key}=", f"{key}={last}"
        elif words and last == "=":  # key =
            *words, key = words
            self._typed_before = last = f"{key}="
        return words, last

    def format_completion(self, item: CompletionItem) -> str:
        """Return the type, and of the value what takes the last word's place."""
        return f"{item.type},{item.value.removeprefix(self._typed_before)}"


add_completion_class(Bash)
