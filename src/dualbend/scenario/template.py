"""A scenario to start from: one file with every key there is, each with what it means.

What differs from the defaults is live, a default is there as a comment, so that the file says what
its run is and shows what could be said.
"""

from __future__ import annotations

import re
import textwrap
from pathlib import Path

import msgspec

from dualbend.errors import InputError, brief, writing
from dualbend.scenario.keys import REQUIRED, Key, Section, sections
from dualbend.scenario.load import list_scenarios, load_scenario
from dualbend.scenario.scenario import Scenario
from dualbend.scenario.schema import shipped_schema
from dualbend.scenario.structs import KIND
from dualbend.scenario.toml_text import toml

DEFAULT_BASE = "fig6"
"""The plainest shipped scenario: a path and no compliance."""

_WIDTH = 98
_NAME = re.compile(r"[A-Za-z0-9][\w.+-]{0,99}")
_SCHEMA_BESIDE = "scenario.schema.json"

_HEAD = """\
A dualbend scenario with the values of {base}. Run it: dualbend run {file}
A # without a space after it hides a key that has its default value: take the # away to change it. \
A section whose [header] is hidden is off; take that # away too. Of the kinds of a section, which \
have one header, a file has one."""


def write_scenario(name: str, base: str = DEFAULT_BASE, folder: Path | None = None) -> Path:
    """Write ``name``.toml into a folder (none: the present one) and return its path.

    Raises InputError where the name is none, or a shipped scenario has it, where the base cannot be
    loaded, and where the file exists or cannot be written.
    """
    name = name.removesuffix(".toml")
    if not _NAME.fullmatch(name):
        raise InputError(
            f"NAME = {brief(name)}: must begin with a letter or digit and hold only letters, "
            "digits and . _ + -, at most 100"
        )
    if name in list_scenarios():
        raise InputError(f"NAME = {name}: a shipped scenario has this name; take another")
    path = (folder or Path()) / f"{name}.toml"
    text = scenario_text(name, base, beside=path.parent)
    with writing(path):
        try:
            with path.open("x", encoding="utf-8") as file:
                file.write(text)
        except FileExistsError as error:
            raise InputError(f"{path}: exists already and is left as it is") from error
    return path


def scenario_text(name: str, base: str = DEFAULT_BASE, beside: Path | None = None) -> str:
    """Return the text of a scenario that has the base's values and explains every key.

    Its first line names the schema: the file ``scenario.schema.json`` in the folder ``beside``
    where there is one, else that of the installed package.
    """
    loaded = load_scenario(base)
    scenario = msgspec.structs.replace(
        loaded, name=name, description=f"Made from {loaded.name}: {loaded.description}"
    )
    examples = [load_scenario(shipped) for shipped in list_scenarios()]
    head = _HEAD.format(base=loaded.name, file=f"{name}.toml")
    blocks = [f"#:schema {_schema_place(beside)}\n" + _comment(head)]
    blocks += [_section(section, scenario, examples) for section in sections()]
    return "\n\n".join(blocks) + "\n"


def _schema_place(beside: Path | None) -> str:
    if beside is not None and (beside / _SCHEMA_BESIDE).is_file():
        return f"./{_SCHEMA_BESIDE}"
    return shipped_schema().as_uri()


def _section(section: Section, scenario: Scenario, examples: list[Scenario]) -> str:
    """Return one table; a section that the scenario does not have is commented out whole."""
    values = section.of(scenario)
    off = values is None
    lines = []
    if section.path:
        note = " Another kind." if off and section.kind else " Off." if off else ""
        intro = f"{section.intro}{section.belongs}{note}"
        lines += [_comment(intro), f"{'#' if off else ''}[{section.title}]"]
    for key in section.keys:
        lines.append(_comment(_explained(key)))
        value = _example(section, key, examples) if off else getattr(values, key.name)
        # A key without a default is live wherever its section is.
        comment = off or (key.default is not REQUIRED and value == key.default)
        lines.append(f"{'#' if comment else ''}{key.name} = {toml(value)}")
    return "\n".join(lines)


def _example(section: Section, key: Key, examples: list[Scenario]) -> object:
    """Return a default, or what the first shipped scenario that has the section says."""
    if key.name == KIND and section.kind:
        return section.kind
    if key.default is not REQUIRED:
        return key.default
    if key.in_section is not REQUIRED:
        return key.in_section
    found = (section.of(example) for example in examples)
    values = (getattr(values, key.name) for values in found if values is not None)
    return next(values, key.example)


def _explained(key: Key) -> str:
    """Say what a key is, its type and bounds, its unit."""
    required = "required" if key.default is REQUIRED else ""
    facts = ", ".join(filter(None, (key.kind, key.bounds, required)))
    unit = f" [{key.unit}]" if key.unit else ""
    return f"{key.description}; {facts}{unit}" if key.description else f"{facts}{unit}"


def _comment(text: str) -> str:
    wrapper = textwrap.TextWrapper(_WIDTH, break_on_hyphens=False, break_long_words=False)
    lines = (wrapped for line in text.splitlines() for wrapped in wrapper.wrap(line))
    return "\n".join(f"# {line}" for line in lines)
