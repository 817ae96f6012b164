"""The keys of a scenario as the code has them: type, unit, bounds, default, what each is.

Read from the configuration structs with ``msgspec.inspect``; reference, schema and the scenario
that ``dualbend new`` writes are made of this and so cannot say what the code does not.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

import msgspec
from msgspec import NODEFAULT
from msgspec import inspect as mi

from dualbend.scenario.scenario import Scenario
from dualbend.scenario.toml_text import number

REQUIRED: Final = NODEFAULT
"""Default of a key that has none."""

_UNITS = {
    **{"m": "m", "rad": "rad", "s": "s", "s2": "s²", "ms": "ms", "hz": "Hz", "n": "N", "nm": "N m"},
    **{"pa": "Pa", "kg": "kg", "m3": "m³", "cycles": "cycles", "ratio": "-", "factor": "-"},
    **{"fraction": "-", "margin": "-"},
}
_UNIT_NAMES = {"friction": "-"}


@dataclass(frozen=True, kw_only=True)
class Key:
    """One key: texts for people, and the default as the code has it.

    Attributes
    ----------
    kind : what a value is, in words; ``choices`` are the words that it may be
    unit : "" where there is none
    bounds : "" where there are none
    default : value, None where the key may be absent, REQUIRED where it may not
    in_section : what it is where the whole section is left out; differs from ``default`` where a
        section's own default gives a key that has none
    """

    name: str
    kind: str
    unit: str
    bounds: str
    default: Any
    in_section: Any
    description: str


@dataclass(frozen=True, kw_only=True)
class Section:
    """A TOML table: ``path`` is () for the keys at the top; ``optional`` is off unless given.

    ``intro`` and ``more`` are the first and the other paragraphs of the code's own description.
    """

    path: tuple[str, ...]
    struct: type[msgspec.Struct]
    intro: str
    more: tuple[str, ...]
    optional: bool
    keys: tuple[Key, ...]

    @property
    def title(self) -> str:
        """The table's name as TOML has it, without brackets."""
        return ".".join(self.path)


def sections() -> list[Section]:
    """Return every section of a scenario, each before those inside it, in the code's order."""
    return list(_walk(Scenario, (), None, optional=False))


def section_of(struct: type[msgspec.Struct]) -> Section:
    """Return the section that a struct would be, one that stands in a list and not by itself."""
    return next(_walk(struct, (), None, optional=False))


def _walk(
    struct: type[msgspec.Struct], path: tuple[str, ...], instance: object, *, optional: bool
) -> Iterator[Section]:
    keys, inner = [], []
    for field in fields_of(struct):
        nested = struct_of(field.type)
        own = _default(field)
        inherited = own if instance is None else getattr(instance, field.encode_name)
        if nested is None:
            keys.append(_key(field, own, inherited))
        else:
            default = None if inherited is REQUIRED else inherited
            off = not field.required and default is None
            inner.append((nested, (*path, field.encode_name), default, off))
    intro, *more = paragraphs(struct)
    yield Section(
        path=path,
        struct=struct,
        intro=intro,
        more=tuple(more),
        optional=optional,
        keys=tuple(keys),
    )
    for nested, where, default, off in inner:
        yield from _walk(nested, where, default, optional=off)


def fields_of(struct: type[msgspec.Struct]) -> tuple[mi.Field, ...]:
    """Return a struct's fields with their types as ``msgspec.inspect`` has them."""
    info = mi.type_info(struct)
    assert isinstance(info, mi.StructType)
    return info.fields


def struct_of(info: mi.Type) -> type[msgspec.Struct] | None:
    """Return the struct that a type is, also with a description or beside None; else None."""
    if isinstance(info, mi.StructType):
        return info.cls
    if isinstance(info, mi.Metadata):
        return struct_of(info.type)
    if isinstance(info, mi.UnionType):
        return next((s for s in map(struct_of, info.types) if s is not None), None)
    return None


def paragraphs(struct: type[msgspec.Struct]) -> list[str]:
    """Return a struct's docstring up to its first heading, a line a paragraph."""
    found = []
    for block in inspect.cleandoc(struct.__doc__ or "").split("\n\n"):
        if re.search(r"^-{3,}$", block, re.MULTILINE):
            break
        found.append(" ".join(block.replace("``", "`").split()))
    return found


def _default(field: mi.Field) -> Any:  # noqa: ANN401 - a value of any key
    if field.required:
        return REQUIRED
    return field.default if field.default_factory is NODEFAULT else field.default_factory()


def _key(field: mi.Field, default: object, in_section: object) -> Key:
    info, description = _plain(field.type)
    text, unit = split_unit(description)
    return Key(
        name=field.encode_name,
        kind=_kind(info),
        unit=unit or unit_of(field.encode_name),
        bounds=_bounds(info),
        default=default,
        in_section=in_section,
        description=text,
    )


def _plain(info: mi.Type) -> tuple[mi.Type, str]:
    """Return a type without description and without None, and the description."""
    if isinstance(info, mi.UnionType):
        options = [option for option in info.types if not isinstance(option, mi.NoneType)]
        if len(options) == 1:
            return _plain(options[0])
    if isinstance(info, mi.Metadata):
        inner, below = _plain(info.type)
        return inner, str((info.extra_json_schema or {}).get("description", below))
    return info, ""


def split_unit(description: str) -> tuple[str, str]:
    """Take a unit in brackets off the end of a description."""
    match = re.fullmatch(r"(.*?)\s*\[([^\]]+)\]", description)
    return (match.group(1), match.group(2)) if match else (description, "")


def unit_of(name: str) -> str:
    """Return the unit that a key's name ends with, "" where it has none.

    ``stiffness_n_m_per_rad`` is N m/rad, ``travel_m_per_s`` m/s, ``young_pa`` Pa.
    """
    if name in _UNIT_NAMES:
        return _UNIT_NAMES[name]
    above, per, below = name.partition("_per_")
    if per and below not in _UNITS:
        return ""
    words = above.split("_")[1:]  # a name is never a unit alone
    unit: list[str] = []
    while words and words[-1] in _UNITS:
        unit.insert(0, _UNITS[words.pop()])
    return " ".join(unit) + (f"/{_UNITS[below]}" if per and unit else "")


def _kind(info: mi.Type) -> str:
    if isinstance(info, mi.LiteralType):
        *words, last = (f'"{word}"' for word in info.values)
        return f"{', '.join(words)} or {last}" if words else last
    if isinstance(info, mi.VarTupleType):
        item, _ = _plain(info.item_type)
        if isinstance(item, mi.StructType):
            return f"list of {{ {', '.join(f.encode_name for f in item.fields)} }}"
        inner = _kind(item)
        return f"list of {inner if isinstance(item, mi.LiteralType) else _plural(inner)}"
    if isinstance(info, mi.TupleType):
        return f"{len(info.item_types)} {_plural(_kind(_plain(info.item_types[0])[0]))}"
    if isinstance(info, mi.BoolType):
        return "true or false"
    names: dict[type[mi.Type], str] = {
        mi.FloatType: "number",
        mi.IntType: "whole number",
        mi.StrType: "text",
    }
    if type(info) not in names:
        raise NotImplementedError(f"a key of type {info}: say in {__name__} what it is")
    return names[type(info)]


def _plural(kind: str) -> str:
    return re.sub(r"number\b", "numbers", kind) if kind.endswith("number") else f"({kind})"


def _bounds(info: mi.Type) -> str:
    if isinstance(info, mi.FloatType | mi.IntType):
        pairs = ((">", info.gt), ("≥", info.ge), ("<", info.lt), ("≤", info.le))
        return ", ".join(f"{sign} {_short(b)}" for sign, b in pairs if b is not None)
    if isinstance(info, mi.TupleType):
        each = _bounds(_plain(info.item_types[0])[0])
        return f"each {each}" if each else ""
    if isinstance(info, mi.VarTupleType | mi.StrType):
        what = "characters" if isinstance(info, mi.StrType) else "entries"
        low, high = info.min_length, info.max_length
        if low is not None and low == high:
            return f"{low} {what}"
        if high is not None:
            return f"{low or 0} to {high} {what}"
        return "" if low is None else f"{low} or more {what}"
    return ""


def _short(bound: float) -> str:
    return number(bound).removesuffix(".0")
