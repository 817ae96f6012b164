"""ATI Net F/T's raw data transfer (RDT): requests and records over UDP, and the page of counts."""

from __future__ import annotations

import struct
from collections.abc import Sequence

import numpy as np

from dualbend.types import Vector

COUNTS_PER_UNIT = 1_000_000
"""Of a force [N] and of a torque [N m], a Net F/T's own default in SI units."""

STOP, STREAM, BUFFERED, BIAS = 0x0000, 0x0002, 0x0003, 0x0042
SATURATED = 1 << 31 | 1 << 30
"""Status: an error (bit 31), force or torque out of range (bit 30).

Source: ATI, manual 9610-05-Ethernet Axia-09, tables 4.7 and 4.9. That Axia sensors speak RDT with
this status word is documented there; that a Net Box sets the same bits is assumed.
"""

_REQUEST, _RECORD = struct.Struct(">HHI"), struct.Struct(">III6i")
_HEADER = 0x1234
_LARGEST = 2**31 - 1


def decode(data: bytes) -> tuple[int, int] | None:
    """Return command and number of records (0: no end) of a request; None: it is none."""
    if len(data) != _REQUEST.size:
        return None
    header, command, count = _REQUEST.unpack(data)
    known = command in (STOP, STREAM, BUFFERED, BIAS)
    return (command, count) if header == _HEADER and known else None


def encode(rdt_sequence: int, ft_sequence: int, status: int, counts: Sequence[int]) -> bytes:
    """Return a record: both sequence numbers, status, Fx, Fy, Fz, Tx, Ty, Tz in counts.

    What is beyond its whole numbers of 32 bits is cut.
    """
    cut = (min(max(count, -_LARGEST), _LARGEST) for count in counts)
    return _RECORD.pack(rdt_sequence % 2**32, ft_sequence % 2**32, status, *cut)


def counts_of(wrench: Vector) -> list[int]:
    """Return a wrench (6,) [N, N m] in counts."""
    return [int(count) for count in np.rint(COUNTS_PER_UNIT * wrench)]


def page(name: str, rate_hz: float) -> bytes:
    """Return ``netftapi2.xml``: the units, counts per unit and rate that a client asks for."""
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<netft>'
        f"<prodname>dualbend {name}</prodname><runstat>0</runstat>"
        "<setbias>0;0;0;0;0;0</setbias>"
        f"<cfgcpf>{COUNTS_PER_UNIT}</cfgcpf><cfgcpt>{COUNTS_PER_UNIT}</cfgcpt>"
        "<scfgfu>N</scfgfu><scfgtu>Nm</scfgtu>"
        f"<comrdte>1</comrdte><comrdtrate>{round(rate_hz)}</comrdtrate><comrdtbsiz>1</comrdtbsiz>"
        "</netft>\n"
    ).encode()
