"""Errors in a scenario, told with key, value and what would be right."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterable, Mapping
from typing import Any, TypeVar

import msgspec
from msgspec import inspect as mi

from dualbend.errors import InputError, brief, shortened
from dualbend.scenario.keys import bounds_of, kind_of, unit_of
from dualbend.scenario.structs import (
    KIND,
    Kinds,
    Struct,
    fields_in,
    fields_of,
    has_kinds,
    plain,
)
from dualbend.scenario.task import AnyTask, TaskKinds

T = TypeVar("T", bound=msgspec.Struct)

UNSET = "none"
"""Value that takes an optional key or section back which the extended scenario has."""

_SMALLEST, _LARGEST = 1e-15, 1e15

_RENAMED = {
    "arm.left": "robot.left.model",
    "arm.right": "robot.right.model",
    "arm": "robot",
    "response": "robot.response",
    "servo": "robot.servo",
    "alter": "robot.alter",
    "arms": "compliance",
    "assembly": "task",
    "misalignment": "task.misalignment",
    "sheet.strips": "sheet.model",
    "sheet.shell": "sheet.model",
}
"""Keys and sections of version 0.1, each before what holds it, with what they are called now."""


def refuse_renamed(key: str, source: str) -> None:
    """Refuse a key of version 0.1, naming the new one."""
    for old, new in _RENAMED.items():
        if key == old or key.startswith(f"{old}."):
            renamed = f"{key} is now {new}{key.removeprefix(old)}"
            raise InputError(f"{source}: {shortened(renamed)}")


def nearest(word: str, words: Iterable[str], most: int = 2) -> str:
    """Return the question whether one of the nearest words was meant; "" where none is near."""
    close = difflib.get_close_matches(word, list(words), n=most, cutoff=0.5)
    return f"did you mean {' or '.join(close)}? " if close else ""


def _listed(words: Iterable[object]) -> str:
    return ", ".join(map(repr, words))


def refuse_absurd(value: object, source: str, keys: tuple[str, ...]) -> None:
    """Refuse what is no number, and sizes that no quantity has but that overflow a product."""
    if isinstance(value, dict):
        for key, item in value.items():
            refuse_absurd(item, source, (*keys, key))
    elif isinstance(value, list | tuple):
        for item in value:
            refuse_absurd(item, source, keys)
    elif isinstance(value, str):
        if any("\ud800" <= character <= "\udfff" for character in value):
            raise InputError(f"{source}: {_dotted(keys)} = {brief(value)}: is no text in UTF-8")
    elif isinstance(value, int | float) and keys != ("seed",):
        if isinstance(value, float) and not math.isfinite(value):
            raise InputError(f"{source}: {_dotted(keys)} = {value}: must be a finite number")
        if value and not _SMALLEST <= abs(value) <= _LARGEST:
            raise InputError(
                f"{source}: {_dotted(keys)} = {brief(value)}: must be 0 or between "
                f"{_SMALLEST:g} and {_LARGEST:g} in size"
            )


def _dotted(keys: Iterable[str]) -> str:
    """Return the name of a key, short also where it is none."""
    return shortened(".".join(keys), 120)


def refuse_unknown(data: object, kinds: Kinds, source: str, keys: tuple[str, ...]) -> None:
    """Refuse a kind or key that a table does not have, and name what it does have."""
    if kinds and isinstance(data, list | tuple):
        for i, item in enumerate(data):
            refuse_unknown(item, kinds, source, (*keys[:-1], f"{keys[-1]}[{i}]"))
        return
    tagged = has_kinds(kinds)
    if tagged and isinstance(data, str):
        data = {KIND: data}
    if not kinds or not isinstance(data, dict):
        return
    if tagged and KIND in data and data[KIND] not in list(kinds):
        hint = nearest(brief(data[KIND]), map(repr, kinds), most=1).rstrip()
        own = '"module:Class" for a class of your own' if "own" in kinds else ""
        raise InputError(
            f"{source}: {_dotted((*keys, KIND))} = {brief(data[KIND])}: must be one of "
            f"{'; '.join(part for part in (_listed(kinds), own, hint) if part)}"
        )
    fields = fields_in(kinds, data)
    for key, value in data.items():
        where = (*keys, key)
        if key in fields:
            refuse_unknown(value, fields[key].kinds, source, where)
        elif not (tagged and key == KIND):
            refuse_renamed(_first_leaf(where, value), source)
            shown = "{...}" if isinstance(value, dict) else brief(value)
            right = _what_is_right(key, data, kinds, keys)
            raise InputError(f"{source}: {_dotted(where)} = {shown}: {right}")


def _first_leaf(keys: tuple[str, ...], value: object) -> str:
    """Return the dotted name of the first key in a table, or of the value itself."""
    while isinstance(value, dict) and value:
        key, value = next(iter(value.items()))
        keys = (*keys, key)
    return ".".join(keys)


def _what_is_right(key: str, data: Mapping[str, Any], kinds: Kinds, keys: tuple[str, ...]) -> str:
    others = [f'"{other}"' for other, struct in kinds.items() if key in fields_of(struct)]
    if others:
        return f'belongs to kind = {" or ".join(others)}, this {keys[-1]} is "{data[KIND]}"'
    valid = [*([KIND] if has_kinds(kinds) else []), *fields_in(kinds, data)]
    return f"unknown key; {nearest(key, valid)}valid here: {', '.join(valid)}"


def explain(data: Mapping[str, Any], message: str, struct: Struct) -> str:
    """Put msgspec's message as key, value and what would be right."""
    match = re.search(r" - at `\$\.?(.*)`$", message)
    if match is None:
        return message
    keys, text = match.group(1), message[: match.start()]
    value: Any = data
    kinds: Kinds = {"": struct}
    wanted: mi.Type | None = None
    unit = ""
    for part in re.findall(r"[^.\[\]]+", keys):
        field = fields_in(kinds, value).get(part)
        if field:
            kinds, wanted, unit = field.kinds, field.type, unit_of(field.name)
        elif isinstance(wanted, mi.VarTupleType | mi.TupleType):
            items = wanted.item_types if isinstance(wanted, mi.TupleType) else (wanted.item_type,)
            wanted = plain(items[0])[0]
        if isinstance(value, dict):
            value = value.get(part)
        elif isinstance(value, list | tuple) and part.isdigit() and int(part) < len(value):
            value = value[int(part)]
    shown = "" if isinstance(value, dict) or value is None else f" = {brief(value)}"
    return f"{keys}{shown}: {_right(text, value, kinds, wanted, unit)}"


def _right(
    text: str,
    value: Any,  # noqa: ANN401 - as a file has it
    kinds: Kinds,
    wanted: mi.Type | None,
    unit: str,
) -> str:
    """Return what would be right, in the words of a scenario where msgspec's text is not."""
    if text.startswith("Invalid enum value"):
        text = f"must be one of {_listed(_choices(wanted))}"
    elif "matching regex" in text:
        text = "must begin with a letter or digit and hold only letters, digits and . _ + -"
    elif kinds and text.startswith(("Expected `object", "Expected `AnyTask")):
        below = ", ".join(fields_in(kinds, {}))
        text = f"must be a section with keys: {below}"
        if value == UNSET:
            text = f"this section is always there: leave it out, or give its keys: {below}"
        elif has_kinds(kinds):
            text = f"must be a section, or the name of its kind: {_listed(kinds)}"
    elif text.startswith(("Expected `", "Integer value out")) and wanted is not None:
        text = f"must be {_in_words(wanted, unit, value)}"
    elif "missing required field" in text and has_kinds(kinds):
        text = f'{text}, as kind = "{value[KIND]}" needs; the kinds are {_listed(kinds)}'
    return text


def _in_words(wanted: mi.Type, unit: str, value: object) -> str:
    """Say what a value must be, of which kind, within which bounds, in which unit."""
    kind, bounds = kind_of(wanted), bounds_of(wanted)
    article = "a " if kind.startswith(("number", "whole", "text", "list", "section")) else ""
    numbers = isinstance(wanted, mi.IntType | mi.FloatType) and bounds
    said = f"{article}{kind}{' ' if numbers else ', ' if bounds else ''}{bounds}"
    said += f" [{unit}]" if unit and unit != "-" else ""
    if isinstance(wanted, mi.VarTupleType) and value in _choices(plain(wanted.item_type)[0]):
        said += f', such as ["{value}"]'
    return said


def _choices(info: mi.Type | None) -> list[object]:
    """Return the words that a type allows."""
    return list(info.values) if isinstance(info, mi.LiteralType) else []


def converted(
    data: Mapping[str, Any], struct: type[T], source: str, keys: tuple[str, ...] = ()
) -> T:
    """Return the struct that tables are; InputError says what is wrong, and with which key.

    ``keys``: where the tables stand in a file, if not at its top.
    """
    refuse_absurd(data, source, keys)
    refuse_unknown(data, {"": struct}, source, keys)
    try:
        return msgspec.convert(data, struct, dec_hook=_custom)
    except msgspec.ValidationError as error:
        text = explain(data, str(error), struct)
        at = f"{_dotted(keys)}{'.' if ' - at `$.' in str(error) else ': '}" if keys else ""
        raise InputError(f"{source}: {at}{text}") from error


def _custom(wanted: type, value: object) -> object:
    """Return the section of the task that a table is; msgspec asks for it at this place alone."""
    if wanted is not AnyTask or not isinstance(value, dict):
        return value
    kinds = TaskKinds()
    kind = value.get(KIND, next(iter(kinds)))
    try:
        return msgspec.convert({**value, KIND: kind}, kinds[kind])
    except msgspec.ValidationError as error:
        text, at, path = str(error).partition(" - at `$")
        raise msgspec.ValidationError(f"{text} - at `$.task{path if at else '`'}") from error
