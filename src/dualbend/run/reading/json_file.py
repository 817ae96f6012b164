"""JSON from a file: strictly typed, every number finite, no key twice."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from dualbend.errors import InputError, refusing

T = TypeVar("T")


def read_json(path: Path, kind: type[T], what: str, named: str = "") -> T:
    """Return what a JSON file holds, as a type; ``named``: what it is called, if not by its path.

    Raises InputError, "no ``what``", which names file and key, where it cannot be read, holds
    another type or a number that is not finite, or has a key twice.
    """
    return json_of(file_bytes(path, named), kind, f"{named or path}: no {what}")


def file_bytes(path: Path, named: str = "") -> bytes:
    """Return what a file holds; InputError where it cannot be read, or is a pipe or a folder."""
    with refusing(f"{named or path}: cannot be read", OSError):
        if path.exists() and not path.is_file():  # a pipe would keep us waiting
            raise InputError(f"{named or path}: is no file")
        return path.read_bytes()


def json_of(data: bytes, kind: type[T], said: str) -> T:
    """Return what a JSON text holds, as :func:`read_json` does; ``said`` begins the message."""
    with refusing(said, InputError, ValueError, RecursionError):
        value = msgspec.json.decode(data, type=kind)
        # Of a key that is there twice the line above takes the last.
        json.loads(data, object_pairs_hook=_no_key_twice)
    return value


def _no_key_twice(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f"key {twice!r} is there twice")
    return found
