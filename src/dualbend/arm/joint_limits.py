"""How much room arms have along a way: manipulability, and distance to the joints' limits."""

from __future__ import annotations

import math

import msgspec
import numpy as np

from dualbend.arm.chain import serial_chain
from dualbend.arm.pair import ArmPair
from dualbend.arm.placement import largest_manipulability
from dualbend.types import SIDES, Vector


class ArmRoom(msgspec.Struct, frozen=True, kw_only=True):
    """Of one arm along a way: the smallest manipulability and room to a limit.

    ``manipulability`` is √det(J Jᵀ) of the Jacobian scaled by the reach, over the arm's largest
    [-]; ``room_deg`` the nearest that ``joint`` comes to a limit [degrees]. None for no way.
    """

    arm: str
    manipulability: float | None
    room_deg: float | None
    joint: str | None


def arm_room(arms: ArmPair, q: Vector) -> dict[str, ArmRoom]:
    """Return the room of both arms, by side, over joint angles (k, n); rows of NaN do not count."""
    found: dict[str, ArmRoom] = {}
    solved = q[~np.isnan(q).any(axis=1)]
    for side, placed in zip(SIDES, arms, strict=True):
        model, mine = placed.model, solved[:, arms.joints(side)]
        low, high = np.array(model.range_rad).T
        room = np.minimum(mine - low, high - mine).min(axis=0, initial=math.inf)
        tight = int(np.argmin(room))
        share = serial_chain(model.name).manipulability(mine) / largest_manipulability(model.name)
        some = len(mine) > 0
        found[side] = ArmRoom(
            arm=model.name,
            manipulability=float(share.min()) if some else None,
            room_deg=math.degrees(room[tight]) if some else None,
            joint=model.joint_names[tight] if some else None,
        )
    return found
