"""ROS 2's messages as bytes: CDR, little endian, of the few types that a log has."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence

_HEADER = b"\0\1\0\0"
"""Of the encapsulation: plain CDR, little endian. What follows is aligned from its end on."""
_BIG_ENDIAN = b"\0\0\0\0"


class Encoder:
    """Bytes of one message, field after field."""

    def __init__(self) -> None:
        self._data = bytearray()

    def stamp(self, time_ns: int) -> None:
        """Add a builtin_interfaces/Time."""
        self._pack("i", 4, time_ns // 10**9)
        self._pack("I", 4, time_ns % 10**9)

    def text(self, value: str) -> None:
        """Add a string."""
        data = value.encode() + b"\0"
        self._pack("I", 4, len(data))
        self._data += data

    def texts(self, values: Sequence[str]) -> None:
        """Add a sequence of strings."""
        self._pack("I", 4, len(values))
        for value in values:
            self.text(value)

    def doubles(self, values: Iterable[float]) -> None:
        """Add float64 fields, one after another."""
        for value in values:
            self._pack("d", 8, value)

    def list_of_doubles(self, values: Sequence[float]) -> None:
        """Add a sequence of float64."""
        self.count(len(values))
        self.doubles(values)

    def count(self, number: int) -> None:
        """Add the length of a sequence, whose elements follow."""
        self._pack("I", 4, number)

    def _pack(self, kind: str, size: int, value: float) -> None:
        self._data += bytes(-len(self._data) % size) + struct.pack(f"<{kind}", value)

    @property
    def message(self) -> bytes:
        """The whole message."""
        return _HEADER + bytes(self._data)


class Decoder:
    """Fields of one message, in their order; ValueError where they are not there."""

    def __init__(self, message: bytes) -> None:
        if len(message) < len(_HEADER) or message[:2] not in (_HEADER[:2], _BIG_ENDIAN[:2]):
            raise ValueError("no plain CDR")
        self._order = "<" if message[1] else ">"
        self._data, self._at = message[len(_HEADER) :], 0

    def stamp_ns(self) -> int:
        """Read a builtin_interfaces/Time [ns]."""
        return int(self._unpack("i", 4)) * 10**9 + int(self._unpack("I", 4))

    def text(self) -> str:
        """Read a string."""
        size = self.count(1)
        data = self._data[self._at : self._at + size]
        self._at += size
        return data.rstrip(b"\0").decode()

    def texts(self) -> list[str]:
        """Read a sequence of strings."""
        return [self.text() for _ in range(self.count(4))]

    def list_of_doubles(self) -> list[float]:
        """Read a sequence of float64."""
        return [self._unpack("d", 8) for _ in range(self.count(8))]

    def count(self, size: int) -> int:
        """Read the length of a sequence, whose elements have so many bytes at least."""
        number = int(self._unpack("I", 4))
        if number * size > len(self._data) - self._at:
            raise ValueError("a list that is longer than its message")
        return number

    def _unpack(self, kind: str, size: int) -> float:
        self._at += -self._at % size
        if self._at + size > len(self._data):
            raise ValueError("a message that is cut off")
        (value,) = struct.unpack_from(f"{self._order}{kind}", self._data, self._at)
        self._at += size
        return float(value) if kind == "d" else int(value)
