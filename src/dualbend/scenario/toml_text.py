"""TOML: files read with their errors, and values as a person would write them on one line."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import msgspec

from dualbend.errors import InputError, refusing

_LARGEST_FILE, _DEEPEST = 10**7, 20
"""Bytes of a file, and tables in one another: more is a mistake."""


def read_toml(path: Path, said: str = "cannot be read") -> dict[str, Any]:
    """Return the tables of a TOML file; an InputError begins with its path and what is ``said``."""
    with refusing(f"{path}: {said}", OSError, UnicodeDecodeError):
        if path.exists() and not path.is_file():
            what = "a folder" if path.is_dir() else "a pipe or a device"
            raise InputError(f"{path}: is {what}, no file")
        if path.stat().st_size > _LARGEST_FILE:
            raise InputError(f"{path}: has more than {_LARGEST_FILE:.0e} bytes")
        # Windows' editors begin a file with a byte order mark.
        text = path.read_text(encoding="utf-8-sig")
    return parse_toml(text, path.name)


def parse_toml(text: str, source: str) -> dict[str, Any]:
    """Return the tables of a TOML text; InputError with ``source`` where it is none."""
    # Thousands of digits or brackets are refused, too.
    with refusing(f"{source}: no valid TOML", ValueError, RecursionError):
        tables = tomllib.loads(text)
    level: list[Any] = [tables]
    for _ in range(_DEEPEST):
        inside = (each.values() if isinstance(each, dict) else each for each in level)
        level = [item for items in inside for item in items if isinstance(item, dict | list)]
    if level:
        raise InputError(f"{source}: tables and lists are nested more than {_DEEPEST} deep")
    return tables


def number(value: float) -> str:
    """Return a number as TOML reads it, in powers of a thousand where that is shorter."""
    text = repr(value)
    if isinstance(value, int) or not value or 1e-4 <= abs(value) < 1e5:
        return text
    for exponent in range(-15, 16, 3):
        mantissa = float(f"{value / 10.0**exponent:.12g}")
        short = f"{mantissa:g}e{exponent}"
        if 1.0 <= abs(mantissa) < 1e3 and float(short) == value:
            return short
    return text


def toml(value: object) -> str:
    """Return a value as TOML has it on one line; a key that is absent is ``"none"``.

    In a table of a list it is left out: what stands there extends nothing.
    """
    if isinstance(value, msgspec.Struct):
        value = {k: v for k, v in msgspec.structs.asdict(value).items() if v is not None}
    if value is None:
        return '"none"'
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return number(value)
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(toml, value))}]"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{_basic_string(k)} = {toml(v)}' for k, v in value.items())}}}"
    return _basic_string(str(value))


def _basic_string(text: str) -> str:
    """Quote text: TOML's escapes are JSON's, but for DEL, which JSON leaves as it is."""
    return msgspec.json.encode(text).decode().replace("\x7f", "\\u007f")
