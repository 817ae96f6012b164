"""The links of a robot's file as a tree, and the arm in it: from which link to which.

Both formats are read into the same tree, so that an arm is found in the same way in either.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from dualbend.errors import InputError

FEWEST, MOST = 6, 8
"""Joints of an arm that a cell can use: a pose has six numbers, a rail and an elbow make 8."""

HINGE, SLIDE, FIXED = "hinge", "slide", "fixed"

_FLANGES: Final = (r"tool0$", r"flange", r"attachment", r"(^|_)(ee|eef|end_?effector)(_|$)")
"""Names of flanges, the surest first."""

_NO_FLANGE: Final = re.compile(r"camera|led|imu|optic|accel|laser|range", re.IGNORECASE)
_FINGER: Final = re.compile(r"grip|finger|jaw|knuckle|thumb|claw|hand", re.IGNORECASE)
_FINGER_STROKE_M = 0.12

_SHOWN = 6


@dataclass(frozen=True, kw_only=True)
class Joint:
    """A joint: names, kind, the links it is between; ``stroke`` upper minus lower limit.

    ``bare``: its child neither shows nor touches, a frame and no body. ``mimics``: the joint that
    it follows, "" where it is free.
    """

    name: str
    kind: str
    parent: str
    child: str
    stroke: float = float("inf")
    bare: bool = False
    mimics: str = ""

    @property
    def moves(self) -> bool:
        """It is not fixed."""
        return self.kind != FIXED

    @property
    def is_finger(self) -> bool:
        """It moves a gripper's part, by its name or by what it does."""
        short = self.kind == SLIDE and self.stroke < _FINGER_STROKE_M
        named = _FINGER.search(self.name) or _FINGER.search(self.child)
        return bool(self.mimics or short or named)


@dataclass(frozen=True, kw_only=True)
class Chain:
    """The joints of an arm, fixed ones too, from the link ``base`` to the link ``flange``."""

    base: str
    flange: str
    joints: tuple[Joint, ...]

    @property
    def moving(self) -> tuple[Joint, ...]:
        """The joints that move."""
        return tuple(joint for joint in self.joints if joint.moves)


class Tree:
    """Links and joints of one file, each link below one joint; InputErrors begin with ``file``."""

    def __init__(self, file: object, links: Sequence[str], joints: Sequence[Joint]) -> None:
        self.file, self.links = file, links
        self.above = {joint.child: joint for joint in joints}
        self.below: dict[str, list[Joint]] = {}
        for joint in joints:
            self.below.setdefault(joint.parent, []).append(joint)

    def error(self, text: str) -> InputError:
        """Return an error that names the file."""
        return InputError(f"{self.file}: {text}")

    def chain(self, base: str | None, flange: str | None) -> Chain:
        """Return the arm between two links, each found where it is not given.

        Raises InputError where there is none, or where several could be meant: it names them.
        """
        for key, link in (("base", base), ("flange", flange)):
            if link is not None and link not in self.links:
                some = ", ".join(self.links[:20])
                raise self.error(f"robot.arm.{key} = {link!r}: no such link; there are {some}")
        if flange is None:
            start = self._root() if base is None else base
            flange = self._flange(self._last(start))
        joints = self._way(base, flange)
        moving = sum(joint.moves for joint in joints)
        if base is None:
            while joints and not joints[0].moves:
                joints.pop(0)
            base = joints[0].parent if joints else flange
        ends = f"{base!r} to {flange!r}"
        if not moving:
            raise self.error(f"no chain of joints from {ends}")
        for joint in joints:
            if joint.mimics:
                raise self.error(
                    f"joint {joint.name!r} follows {joint.mimics!r}: an arm whose joints are "
                    "coupled by mechanics is not simulated"
                )
        return Chain(base=base, flange=flange, joints=tuple(joints))

    def sides(self, chain: Chain) -> list[Joint]:
        """Return the joints by which bodies are fixed beside a chain, to all but its last link.

        What is fixed to the link that the last joint moves is a tool, and what hangs on the base
        stands still.
        """
        found: list[Joint] = []
        moving = [i for i, joint in enumerate(chain.joints) if joint.moves]
        on_way = {joint.child for joint in chain.joints}
        level = [joint.child for joint in chain.joints[moving[0] : moving[-1]]]
        while level:
            beside = [
                joint
                for link in level
                for joint in self.below.get(link, ())
                if not joint.moves and joint.child not in on_way
            ]
            found += beside
            level = [joint.child for joint in beside]
        return found

    def _way(self, base: str | None, flange: str) -> list[Joint]:
        joints: list[Joint] = []
        link = flange
        while link != base and link in self.above:
            joints.insert(0, self.above[link])
            link = joints[0].parent
            if len(joints) > len(self.above):
                raise self.error("its joints form a circle")
        if base is not None and link != base:
            raise self.error(f"no chain of joints from {base!r} to {flange!r}")
        return joints

    def _root(self) -> str:
        roots = [link for link in self.links if link not in self.above]
        if not roots:
            raise self.error("has no link that is not moved by another")
        return max(roots, key=self._depth)

    @functools.cache  # noqa: B019 - a tree lives as long as it is looked at
    def _depth(self, link: str) -> int:
        """Return the most joints that move, one after the other, beyond a link."""
        below = self.below.get(link, ())
        return max((joint.moves + self._depth(joint.child) for joint in below), default=0)

    def _next(self, link: str) -> Iterator[Joint]:
        """Yield the moving joints that follow a link, over fixed ones."""
        for joint in self.below.get(link, ()):
            if joint.moves:
                yield joint
            else:
                yield from self._next(joint.child)

    def _last(self, start: str) -> str:
        """Follow the arm from a link on to the last link that it moves."""
        link, count = start, 0
        while True:
            after = [j for j in self._next(link) if count < FEWEST - 1 or not j.is_finger]
            if count < FEWEST:
                after = [j for j in after if count + 1 + self._depth(j.child) >= FEWEST] or after
            if not after or (len(after) > 1 and count >= FEWEST):
                break
            if len(after) > 1:
                ends = [self._flange(self._last(joint.child)) for joint in after]
                ways = zip(after, ends, strict=True)
                some = ", ".join(f"{joint.parent!r} to {end!r}" for joint, end in ways)
                raise self.error(
                    f"has several chains: say which by robot.arm.base and robot.arm.flange; {some}"
                )
            link, count = after[0].child, count + 1
        return link

    def _flange(self, last: str) -> str:
        """Return the link that carries the tool, of those fixed to the last one that moves."""
        fixed = list(self._fixed(last))
        for pattern in _FLANGES:
            for joint in fixed:
                if re.search(pattern, joint.child, re.IGNORECASE):
                    return joint.child
        beside = [joint for joint in self.below.get(last, ()) if not joint.moves]
        beside = [joint for joint in beside if not _NO_FLANGE.search(joint.child)]
        bare = [joint for joint in beside if joint.bare]
        # A frame there marks the flange; one thing alone that is fixed there is a tool: it sits on
        # the flange.
        found = bare or (beside if len(beside) == 1 else [])
        return found[0].child if found else last

    def _fixed(self, link: str) -> Iterator[Joint]:
        """Yield what is fixed to a link, the nearest first."""
        level = [joint for joint in self.below.get(link, ()) if not joint.moves]
        while level:
            yield from level
            level = [j for one in level for j in self.below.get(one.child, ()) if not j.moves]


def refuse_count(chain: Chain, file: object) -> None:
    """Raise InputError where an arm has fewer or more joints than a cell can use."""
    names = [joint.name for joint in chain.moving]
    if FEWEST <= len(names) <= MOST:
        return
    shown = ", ".join(names[:_SHOWN]) + (", ..." if len(names) > _SHOWN else "")
    raise InputError(
        f"{file}: {len(names)} joints from {chain.base!r} to {chain.flange!r} ({shown}); an arm "
        f"has {FEWEST} to {MOST}: robot.arm.base and robot.arm.flange say between which links"
    )
