"""The keys of a scenario as the code has them: type, unit, bounds, default, what each is.

Reference, schema and the scenario that ``dualbend new`` writes are made of this and so cannot say
what the code does not.
"""

from __future__ import annotations

import inspect
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Final, Literal

from msgspec import NODEFAULT
from msgspec import inspect as mi

from dualbend.scenario.scenario import Scenario
from dualbend.scenario.structs import KIND, Field, Kinds, Struct, fields_of, plain
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
    """One key: texts for people, type and default as the code has them.

    Attributes
    ----------
    kind : what a value is, in words
    type : the annotation
    unit : "" where there is none
    bounds : "" where there are none
    default : value, None where the key may be absent, REQUIRED where it may not
    in_section : what it is where the whole section is left out; differs from ``default`` where a
        section's own default gives a key that has none
    example : a value of a key that no shipped scenario has
    """

    name: str
    kind: str
    type: Any
    unit: str
    bounds: str
    default: Any
    in_section: Any
    description: str
    example: Any = "?"


@dataclass(frozen=True, kw_only=True)
class Section:
    """A TOML table: ``path`` is () for the keys at the top; ``optional`` is off unless given.

    ``kind``: of a section of several kinds, each of which is one of these; else "". ``belongs``: a
    sentence that says to which kinds of a section around it this one belongs, "" where to all;
    ``around``: those kinds, where another section of this name belongs to others; else "".
    ``intro`` and ``more`` are the first and the other paragraphs of the code's own description.
    """

    path: tuple[str, ...]
    struct: Struct
    kind: str
    belongs: str
    around: str
    intro: str
    more: tuple[str, ...]
    optional: bool
    keys: tuple[Key, ...]

    @property
    def title(self) -> str:
        """The table's name as TOML has it, without brackets."""
        return ".".join(self.path)

    def of(self, scenario: object) -> object:
        """Return the section's struct in a scenario; None where the scenario does not have it."""
        values: object = scenario
        for name in self.path:
            values = getattr(values, name, None)
        return values if isinstance(values, self.struct) else None


def sections() -> list[Section]:
    """Return every section of a scenario, each before those inside it, in the code's order."""
    return list(_walk({"": Scenario}, (), None))


def listed() -> list[Section]:
    """Return the sections that structs would be which stand in lists and not by themselves."""
    fields = (field for section in sections() for field in fields_of(section.struct).values())
    structs = (struct for field in fields if field.many for struct in field.kinds.values())
    return [next(_walk({"": struct}, (), None)) for struct in structs]


def _walk(
    kinds: Kinds,
    path: tuple[str, ...],
    instance: object,
    *,
    belongs: str = "",
    around: str = "",
    optional: bool = False,
) -> Iterator[Section]:
    """Yield a section, once for each of its kinds, then those inside it.

    ``instance``: what the section is where a scenario leaves it out, None where it may not.
    """
    inner: dict[tuple[str, tuple[Struct, ...]], dict[str, tuple[Field, Any]]] = {}
    for kind, struct in kinds.items():
        keys = [_kind_key(kinds, kind, instance)] if kind else []
        for name, field in fields_of(struct).items():
            found = getattr(instance, name) if isinstance(instance, struct) else field.default
            if field.is_section:
                inner.setdefault((name, tuple(field.kinds.values())), {})[kind] = field, found
            else:
                keys.append(_key(field, found))
        intro, *more = paragraphs(struct)
        yield Section(
            path=path,
            struct=struct,
            kind=kind,
            belongs=belongs,
            around=around,
            intro=intro,
            more=tuple(more),
            optional=optional,
            keys=tuple(keys),
        )
    names = Counter(name for name, _ in inner)
    for (name, _), of in inner.items():
        field, found = next(iter(of.values()))
        some = (
            f" Of {'.'.join(path)} with kind = {_words(of)}." if len(of) < len(kinds) else belongs
        )
        yield from _walk(
            field.kinds,
            (*path, name),
            None if found is REQUIRED else found,
            belongs=some,
            around=" or ".join(of) if names[name] > 1 else "",
            optional=found is None,
        )


def _kind_key(kinds: Kinds, kind: str, instance: object) -> Key:
    """Return the key that names the kind of a section."""
    first = next(iter(kinds))
    return Key(
        name=KIND,
        kind=_words(kinds),
        type=Literal[tuple(kinds)],
        unit="",
        bounds="",
        default=first if kind == first else REQUIRED,
        in_section=next((k for k, s in kinds.items() if isinstance(instance, s)), first),
        description="another kind replaces the whole section",
    )


def _key(field: Field, in_section: object) -> Key:
    text, unit = split_unit(field.said.get("description", ""))
    return Key(
        name=field.name,
        kind=kind_of(field.type),
        type=field.annotation,
        unit=unit or unit_of(field.name),
        bounds=bounds_of(field.type),
        default=field.default,
        in_section=in_section,
        description=text,
        example=next(iter(field.said.get("examples", ())), "?"),
    )


def paragraphs(struct: Struct) -> list[str]:
    """Return a struct's docstring up to its first heading, a line a paragraph."""
    found = []
    for block in inspect.cleandoc(struct.__doc__ or "").split("\n\n"):
        if re.search(r"^-{3,}$", block, re.MULTILINE):
            break
        found.append(" ".join(block.replace("``", "`").split()))
    return found


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


def kind_of(info: mi.Type) -> str:
    """Return what a value of a type is, in words."""
    if isinstance(info, mi.LiteralType):
        return _words(info.values)
    if isinstance(info, mi.VarTupleType | mi.ListType):
        item = plain(info.item_type)[0]
        if isinstance(item, mi.StructType):
            return f"list of {{ {', '.join(f.encode_name for f in item.fields)} }}"
        inner = kind_of(item)
        return f"list of {inner if isinstance(item, mi.LiteralType) else _plural(inner)}"
    if isinstance(info, mi.TupleType):
        return f"{len(info.item_types)} {_plural(kind_of(plain(info.item_types[0])[0]))}"
    if isinstance(info, mi.BoolType):
        return "true or false"
    names: dict[type[mi.Type], str] = {
        mi.FloatType: "number",
        mi.IntType: "whole number",
        mi.StrType: "text",
        mi.DictType: "section",
        mi.AnyType: "value",
    }
    if type(info) not in names:
        raise NotImplementedError(f"a key of type {info}: say in {__name__} what it is")
    return names[type(info)]


def _words(words: Iterable[object]) -> str:
    *some, last = (f'"{word}"' for word in words)
    return f"{', '.join(some)} or {last}" if some else last


def _plural(kind: str) -> str:
    return f"{kind}s" if kind.endswith(("number", "value")) else f"({kind})"


def bounds_of(info: mi.Type) -> str:
    """Return the bounds that a type has, "" where it has none."""
    if isinstance(info, mi.FloatType | mi.IntType):
        pairs = ((">", info.gt), ("≥", info.ge), ("<", info.lt), ("≤", info.le))
        return ", ".join(f"{sign} {_short(b)}" for sign, b in pairs if b is not None)
    if isinstance(info, mi.TupleType):
        each = bounds_of(plain(info.item_types[0])[0])
        return f"each {each}" if each else ""
    if isinstance(info, mi.VarTupleType | mi.ListType | mi.StrType):
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
