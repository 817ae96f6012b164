"""KUKA RSI's telegrams: XML of the robot's state, and the correction that answers it."""

from __future__ import annotations

import math
import re

import numpy as np

from dualbend.control.alter import angles_of, turn
from dualbend.types import Vector

AXES = ("X", "Y", "Z", "A", "B", "C")

_NUMBER = rb"[+-]?(?:\d{1,20}(?:\.\d{0,20})?|\.\d{1,20})(?:[eE][+-]?\d{1,3})?"
_ATTRIBUTE = re.compile(rb'\s+([XYZABC])\s*=\s*"(' + _NUMBER + rb')"')
_CORRECTION = re.compile(rb"<RKorr((?:" + _ATTRIBUTE.pattern + rb")*)\s*(?:/>|>\s*</RKorr>)")
_IPOC = re.compile(rb"<IPOC>\s*(\d{1,18})\s*</IPOC>")


def encode(
    measured: Vector,
    nominal: Vector,
    joints: Vector,
    delay: int,
    ipoc: int,
    read_turn: Vector | None = None,
) -> bytes:
    """Return what the robot sends: RIst and RSol in mm and degrees, AIPos, Delay and IPOC.

    Poses (6,) are x, y, z [m], roll, pitch, yaw [rad]; six decimals. ``read_turn``: those of the
    sensor's axes (3,) [rad] when it took its reading, RRead in degrees.
    """
    read = "" if read_turn is None else f"<RRead {_turn(read_turn)}/>"
    axes = " ".join(f'A{i}="{angle:.6f}"' for i, angle in enumerate(joints, 1))
    return (
        f'<Rob Type="KUKA"><RIst {_pose(measured)}/><RSol {_pose(nominal)}/><AIPos {axes}/>{read}'
        f'<Delay D="{delay}"/><IPOC>{ipoc}</IPOC></Rob>'
    ).encode()


def decode(data: bytes) -> tuple[int, Vector] | None:
    """Return IPOC and deviation (6,) of an answer, x, y, z [m], roll, pitch, yaw [rad].

    None: it is no ``<Sen>`` with exactly one RKorr and one IPOC. What RKorr does not give is 0.
    """
    text = data.strip(b"\0 \t\r\n")
    if not (text.startswith(b"<Sen") and text.endswith(b"</Sen>")):
        return None
    if b"<!" in text or text.count(b"<RKorr") != 1 or text.count(b"<IPOC") != 1:
        return None
    correction, ipoc = _CORRECTION.search(text), _IPOC.search(text)
    if correction is None or ipoc is None:
        return None
    pairs = _ATTRIBUTE.findall(correction[1])
    found = {name.decode(): float(number) for name, number in pairs}
    if len(found) < len(pairs) or not all(map(math.isfinite, found.values())):
        return None
    return int(ipoc[1]), deviation_of([found.get(axis, 0.0) for axis in AXES])


def deviation_of(correction: list[float]) -> Vector:
    """Return x, y, z [m], roll, pitch, yaw [rad] of X, Y, Z [mm], A, B, C [degrees].

    KUKA's axes are R_z(A) R_y(B) R_x(C), ours R_z(yaw) R_x(roll) R_y(pitch).
    """
    x, y, z, a, b, c = correction
    angles = np.array([0.0, math.radians(b), 0.0])
    if a or c:
        a, b, c = (math.remainder(angle, 360.0) for angle in (a, b, c))
        about = [np.radians(np.eye(3)[i] * angle) for i, angle in ((2, a), (1, b), (0, c))]
        angles = angles_of(turn(about[0]) @ turn(about[1]) @ turn(about[2]))
    return np.concatenate(([1e-3 * x, 1e-3 * y, 1e-3 * z], angles))


def pose_of(pose: Vector) -> list[float]:
    """Return X, Y, Z [mm], A, B, C [degrees] of a pose, the other way round."""
    x, y, z, roll, pitch, yaw = pose.tolist()
    a, b, c = 0.0, pitch, 0.0
    if roll or yaw:
        r = turn(pose[3:])
        a = math.atan2(r[1, 0], r[0, 0])
        b = math.asin(min(max(-float(r[2, 0]), -1.0), 1.0))
        c = math.atan2(r[2, 1], r[2, 2])
    return [1e3 * x, 1e3 * y, 1e3 * z, *(math.degrees(angle) for angle in (a, b, c))]


def _pose(pose: Vector) -> str:
    return " ".join(
        f'{axis}="{number:.6f}"' for axis, number in zip(AXES, pose_of(pose), strict=True)
    )


def _turn(angles: Vector) -> str:
    a_b_c = _pose(np.concatenate((np.zeros(3), angles))).split()[3:]
    return " ".join(a_b_c)


def configuration(address: str, port: int) -> str:
    """Return the RSI Ethernet configuration of a port: what is exchanged, by name and type."""
    sent = [("RIst", "DOUBLE"), ("RSol", "DOUBLE"), ("AIPos", "DOUBLE"), ("Delay", "LONG")]
    send = "\n".join(
        f'      <ELEMENT TAG="DEF_{tag}" TYPE="{kind}" INDX="INTERNAL" />' for tag, kind in sent
    )
    send += "".join(
        f'\n      <ELEMENT TAG="RRead.{axis}" TYPE="DOUBLE" INDX="{i}" />'
        for i, axis in enumerate(AXES[3:], 1)
    )
    receive = "\n".join(
        f'      <ELEMENT TAG="RKorr.{axis}" TYPE="DOUBLE" INDX="{i}" HOLDON="1" />'
        for i, axis in enumerate(AXES, 1)
    )
    return f"""<ROOT>
  <CONFIG>
    <IP_NUMBER>{address}</IP_NUMBER>
    <PORT>{port}</PORT>
    <SENTYPE>ImFree</SENTYPE>
    <ONLYSEND>FALSE</ONLYSEND>
  </CONFIG>
  <SEND>
    <ELEMENTS>
{send}
    </ELEMENTS>
  </SEND>
  <RECEIVE>
    <ELEMENTS>
{receive}
    </ELEMENTS>
  </RECEIVE>
</ROOT>
"""
