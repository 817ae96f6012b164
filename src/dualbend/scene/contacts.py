"""Who touches whom in a cell, and the contacts that no task intends.

Two shapes touch where one's ``contype`` has a bit of the other's ``conaffinity``. Links, tools,
bases, sheet, floor, bed, stand, pins and laid sheets all do, but for these pairs:

* what stands still: floor, bases, bed, stand, pins and laid sheets never move;
* neighbours in an arm, which overlap at their joints (each arm's model lists them), and the jaws
  of one gripper with each other and with its palm, which their joints keep apart;
* an arm's first link and the floor: it turns about the vertical, its height never changes;
* a gripper and the sheet's end in it, :data:`HELD_M` deep: the rubber holds it there;
* a gripper and a laid sheet: the next sheet's ends lie on it, and the jaws that let go of them
  would have to be thinner than the sheet. A real bed leaves the ends room;
* the sheet with itself: its ends come together last, and their grippers touch before;
* the sheet with bed, stand and laid sheets: its task lays it on them, and its feet touch them; pins
  touch metal wherever it is (:mod:`dualbend.scene.bed.holes`);
* a shell's edges, which the grippers hold; its other vertices touch what strips touch.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import msgspec
import mujoco
import numpy as np

from dualbend.types import SIDES

ARM, RESTING, PINNING, GRIPPING, FLOOR, LINK, LAID = (1 << i for i in range(7))
"""Collision bits: arms with each other and what stands around them; as tasks intend, the sheet on
what it lies on, the sheet on a pin, a jaw on the sheet; anything with the floor; the sheet
with links; links with laid sheets."""

_GRIPPERS: Final = dict(zip(SIDES, (1 << 7, 1 << 8), strict=True))
"""Each gripper with the sheet."""

_INTENDED = RESTING | PINNING | GRIPPING

_GRIPPER_BODIES = ("sensor", "hand", "jaw_upper", "jaw_lower")

HELD_M: Final = 0.02
"""From the clamp line to where a sheet's own gripper may not touch it: twice a jaw's half depth."""


def sheet_bits(from_left_m: float, from_right_m: float) -> int:
    """Return ``contype`` of a piece of the sheet, by its distances from both clamp lines [m]."""
    away = dict(zip(SIDES, (from_left_m, from_right_m), strict=True))
    beyond = [bit for side, bit in _GRIPPERS.items() if away[side] >= HELD_M]
    return FLOOR | LINK | sum(beyond)


def let_arms_touch(spec: mujoco.MjSpec) -> None:
    """Give the shapes of links, bases and grippers their bits; those only looked at have none."""
    for geom in spec.geoms:
        side, _, part = geom.parent.name.partition("_")
        if side not in SIDES or not geom.contype:
            continue
        if part in _GRIPPER_BODIES:
            geom.contype, geom.conaffinity = ARM | FLOOR, ARM | _GRIPPERS[side]
        else:
            low = 0 if part in ("base", "link1") else FLOOR
            geom.contype, geom.conaffinity = ARM | LAID | low, ARM | LINK


class Contact(msgspec.Struct, frozen=True):
    """Two bodies in plain words, and when they first touched [s]."""

    first: str
    second: str
    time_s: float

    def __str__(self) -> str:
        """Say which touches which."""
        return f"{self.first} touches {self.second}"


class UnintendedContacts:
    """The contacts of a simulation that no task intends: each pair of bodies once, in order."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        self._data, self._step_s = data, model.opt.timestep
        self._names = [_name(model, geom) for geom in range(model.ngeom)]
        # The world's own shapes last: the arm touches the floor.
        self._rank = np.where(model.geom_bodyid == 0, model.nbody, model.geom_bodyid)
        bits = model.geom_contype[:, np.newaxis] & model.geom_conaffinity
        self._unintended = ((bits | bits.T) & _INTENDED) == 0
        self._found: dict[tuple[str, str], float] = {}
        self._seen = b""

    def __iter__(self) -> Iterator[Contact]:
        return (Contact(*names, time_s) for names, time_s in self._found.items())

    def reset(self) -> None:
        """Forget all, and look at the present positions."""
        self._found.clear()
        self._seen = b""
        self.look(self._data.time)

    def on_step(self) -> None:
        """Look at the positions from which the last physics step went; most often, none touch."""
        data = self._data
        # From step to step they are mostly the same.
        if data.ncon and data.contact.geom.tobytes() != self._seen:
            self.look(data.time - self._step_s)

    def look(self, time_s: float) -> None:
        """Add the pairs that touch now for the first time."""
        geoms = self._data.contact.geom
        self._seen = geoms.tobytes()
        for pair in geoms[self._unintended[geoms[:, 0], geoms[:, 1]]].tolist():
            first, second = sorted(pair, key=self._rank.item)
            self._found.setdefault((self._names[first], self._names[second]), time_s)


def _name(model: mujoco.MjModel, geom: int) -> str:
    """Return what a shape belongs to, in plain words."""
    body = model.body(model.geom_bodyid[geom]).name
    if body == "world":
        return f"the {model.geom(geom).name}"
    side, _, part = body.partition("_")
    if side in SIDES:
        return f"the {side} arm's {'gripper' if part in _GRIPPER_BODIES else part}"
    if side == "pin":
        return f"the {part.replace('_', ' ')} pin"
    return "a laid sheet" if side == "laid" else "the sheet"
