"""The few kinds of protobuf's wire format that EGM uses: varints, doubles and nested messages."""

from __future__ import annotations

import struct
from collections.abc import Iterator

_DOUBLE = struct.Struct("<d")
_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5

Value = int | float | bytes


def whole(number: int, value: int) -> bytes:
    """Return a field that is a whole number, or true or false."""
    return _varint(number << 3 | _VARINT) + _varint(value)


def double(number: int, value: float) -> bytes:
    """Return a field that is a double; a repeated one is several of them."""
    return _varint(number << 3 | _FIXED64) + _DOUBLE.pack(value)


def message(number: int, *fields: bytes) -> bytes:
    """Return a field that is a message of these fields."""
    content = b"".join(fields)
    return _varint(number << 3 | _BYTES) + _varint(len(content)) + content


def doubles(*values: float) -> bytes:
    """Return the message of doubles that are its fields 1, 2, ..."""
    return b"".join(double(i, value) for i, value in enumerate(values, 1))


def fields(data: bytes) -> Iterator[tuple[int, Value]]:
    """Yield number and value of each field; a message is its bytes. ValueError: it is none."""
    at = 0
    while at < len(data):
        key, at = _read_varint(data, at)
        number, kind = key >> 3, key & 7
        if not number:
            raise ValueError("a field without a number")
        value: Value
        if kind == _VARINT:
            value, at = _read_varint(data, at)
        else:
            size = {_FIXED64: 8, _FIXED32: 4}.get(kind)
            if kind == _BYTES:
                size, at = _read_varint(data, at)
            if size is None or at + size > len(data):
                raise ValueError("a field that does not end")
            content, at = data[at : at + size], at + size
            value = _DOUBLE.unpack(content)[0] if kind == _FIXED64 else content
        yield number, value


def _varint(value: int) -> bytes:
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)


def _read_varint(data: bytes, at: int) -> tuple[int, int]:
    value = 0
    for i, byte in enumerate(data[at : at + 10]):
        value |= (byte & 0x7F) << 7 * i
        if byte < 0x80:
            return value, at + i + 1
    raise ValueError("a whole number that does not end")
