"""How near two arms come to singular poses and to the limits of their joints along a path."""

from __future__ import annotations

import math

import msgspec
import numpy as np

from dualbend.arm.chain import serial_chain
from dualbend.arm.pair import ArmPair
from dualbend.types import SIDES, Vector


class JointLimitMargins(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Smallest manipulability and joint-limit margin of one arm along a path; None for no path.

    ``manipulability`` is √det(J Jᵀ) of the Jacobian scaled by the reach, over the arm's largest
    [-]; ``margin_deg`` the smallest distance of ``joint`` to a limit [degrees], of a slide over
    the reach; ``file`` of an arm that a file describes, and its SHA-256.
    """

    arm: str
    manipulability: float | None
    margin_deg: float | None = msgspec.field(name="room_deg")
    joint: str | None
    file: str = ""


def joint_limit_margins(arms: ArmPair, q: Vector) -> dict[str, JointLimitMargins]:
    """Return the margins of both arms, by side, over joint angles (k, n); NaN rows do not count."""
    found: dict[str, JointLimitMargins] = {}
    solved = q[~np.isnan(q).any(axis=1)]
    for side, placed in zip(SIDES, arms, strict=True):
        model, mine = placed.model, solved[:, arms.joints(side)]
        chain = serial_chain(model)
        margins = chain.margins(mine).min(axis=0, initial=math.inf)
        tight = int(np.argmin(margins))
        share = chain.manipulability(mine) / chain.largest_manipulability
        some = len(mine) > 0
        found[side] = JointLimitMargins(
            arm=model.name,
            manipulability=float(share.min()) if some else None,
            margin_deg=math.degrees(margins[tight]) if some else None,
            joint=model.joint_names[tight] if some else None,
            file=model.fingerprint,
        )
    return found
