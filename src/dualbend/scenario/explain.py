"""Errors in a scenario, told with key, value and what would be right."""

from __future__ import annotations

import difflib
import functools
import math
import re
from collections.abc import Mapping
from typing import Any

import msgspec

from dualbend.errors import InputError

UNSET = "none"
"""Value that takes an optional key or section back which the extended scenario has."""

_SMALLEST, _LARGEST = 1e-15, 1e15


def refuse_absurd(value: object, source: str, keys: tuple[str, ...]) -> None:
    """Refuse what is no number, and sizes that no quantity has but that overflow a product."""
    if isinstance(value, dict):
        for key, item in value.items():
            refuse_absurd(item, source, (*keys, key))
    elif isinstance(value, list):
        for item in value:
            refuse_absurd(item, source, keys)
    elif isinstance(value, int | float) and keys != ("seed",):
        if isinstance(value, float) and not math.isfinite(value):
            raise InputError(f"{source}: {'.'.join(keys)} = {value}: must be a finite number")
        if value and not _SMALLEST <= abs(value) <= _LARGEST:
            raise InputError(
                f"{source}: {'.'.join(keys)} = {value}: must be 0 or between {_SMALLEST:g} and "
                f"{_LARGEST:g} in size"
            )


def refuse_unknown(data: object, kind: object, source: str, keys: tuple[str, ...]) -> None:
    """Name an unknown key with its nearest valid ones, which msgspec's own message lacks."""
    fields = {name: field.type for name, field in _fields_of(kind).items()}
    if fields and isinstance(data, list):
        for i, item in enumerate(data):
            refuse_unknown(item, kind, source, (*keys[:-1], f"{keys[-1]}[{i}]"))
        return
    if not fields or not isinstance(data, dict):
        return
    for key, value in data.items():
        if key not in fields:
            close = difflib.get_close_matches(key, fields, n=2, cutoff=0.5)
            hint = f"did you mean {' or '.join(close)}? " if close else ""
            shown = "{...}" if isinstance(value, dict) else repr(value)
            raise InputError(
                f"{source}: {'.'.join((*keys, key))} = {shown}: unknown key; {hint}"
                f"valid here: {', '.join(fields)}"
            )
        refuse_unknown(value, fields[key], source, (*keys, key))


@functools.cache
def _fields_of(kind: object) -> dict[str, msgspec.structs.FieldInfo]:
    """Return the fields of a section's type; none of a value's."""
    struct = None if kind is None else _struct_of(kind)
    return {} if struct is None else {f.encode_name: f for f in msgspec.structs.fields(struct)}


def _struct_of(kind: object) -> type[msgspec.Struct] | None:
    info = msgspec.inspect.type_info(kind)
    options = info.types if isinstance(info, msgspec.inspect.UnionType) else (info,)
    for choice in options:
        bare = choice.type if isinstance(choice, msgspec.inspect.Metadata) else choice
        option = bare.item_type if isinstance(bare, msgspec.inspect.VarTupleType) else bare
        if isinstance(option, msgspec.inspect.StructType):
            return option.cls
    return None


def explain(data: Mapping[str, Any], message: str, kind: object) -> str:
    """Put msgspec's message as key, value and what would be right."""
    match = re.search(r" - at `\$\.?(.*)`$", message)
    if match is None:
        return message
    keys, text = match.group(1), message[: match.start()]
    value: Any = data
    for part in re.findall(r"[^.\[\]]+", keys):
        fields = _fields_of(kind)
        kind = fields[part].type if part in fields else kind
        if isinstance(value, dict):
            value = value.get(part)
        elif isinstance(value, list) and part.isdigit() and int(part) < len(value):
            value = value[int(part)]
    if text.startswith("Invalid enum value"):
        text = f"must be one of {', '.join(_choices(msgspec.inspect.type_info(kind)))}"
    elif "matching regex" in text:
        text = "must begin with a letter or digit and hold only letters, digits and . _ + -"
    elif value == UNSET and text.startswith("Expected `object"):
        below = ", ".join(_fields_of(kind))
        text = f"this section is always there: leave it out, or give its keys: {below}"
    shown = "" if isinstance(value, dict) or value is None else f" = {value!r}"
    return f"{keys}{shown}: {text}"


def _choices(info: msgspec.inspect.Type) -> list[str]:
    """Return the words that a type allows, also inside a tuple or beside None."""
    if isinstance(info, msgspec.inspect.LiteralType):
        return [repr(word) for word in info.values]
    if isinstance(info, msgspec.inspect.Metadata):
        return _choices(info.type)
    if isinstance(info, msgspec.inspect.VarTupleType):
        return _choices(info.item_type)
    if isinstance(info, msgspec.inspect.UnionType):
        return [word for option in info.types for word in _choices(option)]
    return []
