"""The scenario reference as a Markdown page, one table per section, made from the code."""

from __future__ import annotations

from dualbend.scenario.keys import REQUIRED, Key, Section, sections
from dualbend.scenario.toml_text import toml

_HEAD = """# Scenario reference

Every section and key that a scenario file may hold, made from the code (`dualbend reference`).

* A key without a default must be given, unless the file extends another that gives it:
  `extends = "fig8"` at the top takes a shipped scenario, or a `.toml` file beside this one, and the
  file says only what differs.
* The value `"none"` takes back an optional key or section that the extended scenario has.
* A section of several kinds says by `kind` which it is; without, the extended file's kind stays, or
  it is of the first kind below. Another kind replaces the section whole. `sheet.model = "shell"` is
  short for `[sheet.model]` with `kind = "shell"`.
* On the command line, `--set section.key=value` sets one key of a run.
* Numbers are finite, and 0 or between 1e-15 and 1e15 in size. Beyond the bounds below, the loader
  checks rules between keys (a sheet is thin, a step divides the period) and names the key.

`dualbend new NAME` writes a scenario with all of this as comments; an editor checks and completes
it with the [schema](command-line.md#the-schema).
"""


def reference_markdown() -> str:
    """Return the page."""
    found = sections()
    contents = "\n".join(
        f"{'    ' * (len(s.path) - 1)}* [{_heading(s, '`')}](#{_anchor(s)})"
        for s in found
        if s.path
    )
    return "\n".join([_HEAD, contents, "", *(_section(section) for section in found)])


def _heading(section: Section, quote: str = "") -> str:
    kind = f" of kind {section.kind}" if section.kind else ""
    around = f" of {section.around}" if section.around else ""
    return f"{quote}{section.title}{quote}{around}{kind}"


def _anchor(section: Section) -> str:
    """Return the anchor that Markdown's tools make of the heading: letters and digits are left."""
    return _heading(section).replace(".", "").replace(" ", "-")


def _section(section: Section) -> str:
    lines = [f"## {_heading(section)}" if section.path else "## At the top of the file", ""]
    off = " Off unless given." if section.optional else ""
    lines += [f"{section.intro}{section.belongs}{off}", ""]
    for paragraph in section.more:
        lines += [paragraph, ""]
    if section.keys:
        lines += [
            "| key | type | unit | default | bounds | what it is |",
            "|---|---|---|---|---|---|",
        ]
        lines += [_row(key) for key in section.keys]
        lines.append("")
    return "\n".join(lines)


def _row(key: Key) -> str:
    cells = (f"`{key.name}`", key.kind, key.unit, _default(key), key.bounds, key.description)
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _default(key: Key) -> str:
    if key.default is not REQUIRED:
        return "none" if key.default is None else f"`{toml(key.default)}`"
    if key.in_section is REQUIRED:
        return "required"
    return f"required; `{toml(key.in_section)}` without the section"
