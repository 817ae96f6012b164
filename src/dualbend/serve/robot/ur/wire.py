"""RTDE's packages over TCP, protocol version 2: framing, recipes, values (big-endian)."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence

PROTOCOL, VERSION, TEXT, DATA = b"V", b"v", b"M", b"U"
OUTPUTS, INPUTS, START, PAUSE = b"O", b"I", b"S", b"P"

NOT_FOUND, IN_USE = "NOT_FOUND", "IN_USE"
FORMATS = {
    "BOOL": "?",
    "UINT8": "B",
    "UINT32": "I",
    "UINT64": "Q",
    "INT32": "i",
    "DOUBLE": "d",
    "VECTOR3D": "3d",
    "VECTOR6D": "6d",
    "VECTOR6INT32": "6i",
}
"""Of struct, by the name of a type in RTDE."""

_HEADER = struct.Struct(">Hc")
_LONGEST_NAMES = 2048
"""Bytes of the list of names of a recipe (RTDE guide)."""

Number = int | float


def package(kind: bytes, payload: bytes) -> bytes:
    """Return a package: length with its header, type, payload."""
    return _HEADER.pack(_HEADER.size + len(payload), kind) + payload


def taken(data: bytearray) -> tuple[bytes, bytes] | None:
    """Take a package's type and payload off the front of what came; None: it is not whole yet.

    Raises ValueError where its length is less than a header's.
    """
    if len(data) < _HEADER.size:
        return None
    size, kind = _HEADER.unpack_from(data)
    if size < _HEADER.size:
        raise ValueError(f"a package of {size} bytes")
    if len(data) < size:
        return None
    payload = bytes(data[_HEADER.size : size])
    del data[:size]
    return kind, payload


def names_of(payload: bytes) -> list[str]:
    """Return the names of a recipe; ValueError where they are none."""
    if len(payload) > _LONGEST_NAMES or not payload.isascii():
        raise ValueError("no names")
    return [name for part in payload.decode().split(",") if (name := part.strip())]


class Recipe:
    """The variables of a data package, in order, by their types."""

    def __init__(self, number: int, names: Sequence[str], types: Iterable[str]) -> None:
        self.number, self.names = number, tuple(names)
        self._struct = struct.Struct(">B" + "".join(FORMATS[kind] for kind in types))

    def pack(self, values: Iterable[Number]) -> bytes:
        """Return the data package of all numbers in a row."""
        return package(DATA, self._struct.pack(self.number, *values))

    def unpack(self, payload: bytes) -> list[Number]:
        """Return the numbers of a data package; ValueError where it has another length."""
        if len(payload) != self._struct.size:
            raise ValueError(f"{len(payload)} bytes of {self._struct.size}")
        return list(self._struct.unpack(payload)[1:])


def text(said: str, level: int) -> bytes:
    """Return a text message of the controller; level 0 exception, 1 error, 2 warning, 3 info."""
    parts = (part.encode("ascii", "replace")[:255] for part in (said, "dualbend"))
    payload = b"".join(bytes([len(part)]) + part for part in parts)
    return package(TEXT, payload + bytes([level]))
