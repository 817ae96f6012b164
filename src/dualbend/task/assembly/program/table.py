"""The assembly of a stack of printed wiring boards, phase by phase.

Pick the sheet up from the stand, carry it over the bed, bend it, lower its middle holes onto their
pins, unfold it until the outer ones are on theirs, let go, withdraw. What ends a phase is sensed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from dualbend.beam.path import BendingPath
from dualbend.beam.sheet import GRAVITY_M_PER_S2, Sheet
from dualbend.planning.geometry import circles, overhangs
from dualbend.scene.cell import GraspConfig
from dualbend.task.assembly.config import AssemblyConfig
from dualbend.task.assembly.program.execution import Execution, Phase
from dualbend.task.assembly.program.held import Level, Press, Slack, Slacken
from dualbend.task.assembly.program.learning import Carry, Learn
from dualbend.task.assembly.program.middle import BentMiddle, Yields, rigid
from dualbend.task.assembly.program.motions import CHECK, Pace, Posture
from dualbend.task.assembly.program.search import GoAside, HolePair, MoveDown, Turn
from dualbend.task.assembly.program.seats import Feeling, PinGuard
from dualbend.task.assembly.program.state import State, mean_cycles
from dualbend.task.assembly.program.steps import (
    CheckFlat,
    CheckGrasp,
    CheckWeight,
    Measure,
    Move,
    Step,
    Wait,
)

_TIP_MARGIN_M = 1.5e-3
"""Above and below the tips of the pins, where motions are slow."""

_CHECK_M_PER_S = 3e-4
"""How fast the outer holes are turned: as slowly as pins are felt for."""

_ARMS_OFF_M = 1e-3
"""By how much arms may stand higher, lower, nearer or farther than they know."""

_PATIENCE_S, _PROGRESS_M = 2.5, 0.1e-3
"""An end that does not come down by that much for so long lies flat, or on its pin's tip.

A middle is given twice the time: it yields sideways meanwhile.
"""

_FELT_M = 0.25e-3
"""By so much lower than elsewhere, a middle has come down on the flank of a tip, or into a hole."""

_BENT_PER_M = 0.2
"""Rest curvature of a sheet that is not taken for a flat one: 0.4 m of it are 4 mm high."""

_SLACK_N = 1.0
"""Tension of a flat sheet that is let be."""

_HELD_UP = 0.25
"""Share of a pin's height: what is held up by more is not on its pins.

With one of its holes on a tip the middle is half of it, an end all of it; arms that stand too low
are some tenths of a millimetre.
"""

_SUNK = 0.6
"""Share of a pin's height: a middle that is held up by less has one hole on its pin.

With the other one on its tip it is half of it.
"""


class AssemblyProgram:
    """Table of phases and steps by which two robots lay a stack of sheets.

    It does not change: any number of executions may share it. ``sheet``: as the robots believe it
    to be. ``grasp``: its rubber yields where pins hold the sheet; ``yields``: the grips do, to the
    bent sheet. ``path``: half distance and rise over the bending angle, up to that at which the
    sheet is laid. ``touch_rad``: bending angle at which the outer holes come to the tips of their
    pins; ``uneven_m``: height of the highest middle hole above the lowest, bent. In the air sheets
    bend at ``bend_speed_rad_per_s`` at most. ``least_force_n``, ``least_moment_nm``: differences
    that noise, drift and cross-talk of the sensors do not make. ``rehearse``: before the first
    sheet the arms go all the way without one, and learn their friction.
    """

    def __init__(
        self,
        *,
        config: AssemblyConfig,
        sheet: Sheet,
        grasp: GraspConfig,
        path: BendingPath,
        touch_rad: float,
        bend_speed_rad_per_s: float,
        period_s: float,
        least_force_n: float,
        least_moment_nm: float,
        rehearse: bool = False,
        uneven_m: float = 0.0,
        yields: Yields = rigid,
    ) -> None:
        self.config, self.sheet, self.bend_rad = config, sheet, float(path.knots[-1])
        self.touch_rad, self.uneven_m = touch_rad, uneven_m
        self.bend_speed_rad_per_s, self.rehearse = bend_speed_rad_per_s, rehearse
        self.least_force_n, self.least_moment_nm = least_force_n, least_moment_nm
        k, arm = grasp.translational_stiffness_n_per_m, 0.5 * sheet.length_m
        turn = k * arm**2 + grasp.rotational_stiffness_n_m_per_rad
        self.rubber = 2.0 * np.array([k, k, turn])
        """Of both grips along x and y [N/m] and about the vertical [N m/rad]."""
        self.pace = Pace(
            linear_m_per_s=config.speeds.travel_m_per_s,
            angular_rad_per_s=config.speeds.unfold_rad_per_s,
            jaw_m_per_s=config.speeds.jaw_m_per_s,
            period_s=period_s,
        )
        self._wait = partial(Wait, timeout_s=config.timeout_s, period_s=period_s)
        self.start = Posture(
            y=config.layout.stand.y_m,
            z=config.layout.stand.top_m + 0.5 * sheet.thickness_m,
            retreat=config.retreat_m,
            opening=config.jaw_opening_m,
        )
        self.path, self.middle = path, BentMiddle(sheet, path, config.layout.pins.height_m, yields)
        self.press_force_n = self.middle.force(config.press_m)
        self._middle, self._outer = circles(config.layout.holes)
        self._beyond_farthest, self._beyond_nearest = overhangs(config.layout.holes, sheet.length_m)
        self.table = tuple(p for layer in range(config.sheets) for p in self._lay(layer))

    def begin(self) -> Execution:
        """Return an execution from the start."""
        return Execution(self.table, self.start, self.bend_rad, self.pace.period_s)

    def waypoints(self) -> list[tuple[str, Posture]]:
        """Return the postures between which the arms move, by the phase that ends there."""
        config, posture, seat = self.config, self.start, self._seat_z(0)
        found = [("approach", posture)]
        for phase, change in (
            ("grasp", {"retreat": 0.0, "opening": 0.0}),
            ("lift", {"z": posture.z + config.lift_m}),
            ("carry", {"y": 0.0, "z": seat + config.lift_m}),
            ("bend", {"alpha": self.bend_rad}),
            ("lower", {"z": seat - self.down_m}),
            ("unfold", {"alpha": 0.0, "z": seat}),
            ("withdraw", {"retreat": config.retreat_m}),
        ):
            posture = replace(posture, **change)
            found.append((phase, posture))
        return found

    @property
    def down_m(self) -> float:
        """By how much lower than its middle the bent sheet is sent, to press it on the bed [m]."""
        return self.middle.hang_m + self.config.press_m

    def _seat_z(self, layer: int) -> float:
        return self.config.layout.bed.top_m + (0.5 + layer) * self.sheet.thickness_m

    def _lay(self, layer: int) -> Sequence[Phase]:
        """Return the phases that lay a sheet on this many others."""
        config, start, move, wait = self.config, self.start, self._move, self._wait
        sheet, t = self.sheet, self.sheet.thickness_m
        over = self._seat_z(layer) + config.lift_m
        come = [move(z=over), move(x=0.0, y=start.y, yaw=0.0), move(z=start.z)] if layer else []
        if self.rehearse and not layer:
            away = [move(z=start.z + config.lift_m), move(y=0.0, z=over), move(alpha=self.bend_rad)]
            come = [*away, move(alpha=0.0), move(y=start.y), move(z=start.z)]
        slow = replace(self.pace, angular_rad_per_s=self.bend_speed_rad_per_s)
        # The grips are where they were sent, and the noise has been averaged out.
        settle = partial(
            wait,
            quantity=State.grip_error,
            below=1e-3,
            otherwise="the grips are not where they were sent",
            rest_cycles=mean_cycles(self.pace.period_s),
        )
        rest, gap = "the jaws have not come to rest", "the jaws have not opened"
        closed = wait(quantity=State.jaw_travel, below=0.1 * t, otherwise=rest)
        opened = wait(quantity=State.jaw_gap, above=1.6 * start.opening, otherwise=gap)
        middle, outer = self._middle_holes(layer), self._outer_holes()
        on_all, on_middle, jammed = list[Step](), list[Step](), list[Step]()
        if feel := self._feeling():
            on_all += feel.all()
            # Arms that do not comply have not found the middle pins, but for luck.
            if config.compliance is not None:
                on_middle += [settle(alpha_ratio=1.0), *feel.middle()]
                jammed += feel.jammed(middle)
        touch, slack, ready = self._unfold_to_touch(layer), self._slack(), settle(alpha_ratio=1.0)
        weight, least = sheet.mass_kg * GRAVITY_M_PER_S2, self.least_moment_nm
        guard = PinGuard.of(config, self.least_force_n, least)
        on_tips = None if guard is None else replace(guard, outer_m=self._outer.radius_m)
        weighed, clamped = CheckWeight(weight, self.least_force_n), weight * sheet.length_m / 12.0
        # Under tension, which arms that do not comply cannot take off, every sheet turns its grips.
        EI = sheet.bending_stiffness_nm2
        flat = [CheckFlat(EI, clamped, max(_BENT_PER_M * EI, least))] if slack else []
        aloft, slacken = (
            [Slacken(slack=slack, timeout_s=config.timeout_s, alpha_ratio=ratio)] if slack else []
            for ratio in (None, 0.0)
        )
        return [
            Phase("approach", [*come, move(retreat=0.0), settle(), Measure("empty")]),
            Phase("grasp", [move(opening=0.0), closed, CheckGrasp(t)]),
            Phase(
                "lift",
                [move(z=start.z + config.lift_m), settle(), *aloft, weighed, *flat],
                slack=slack,
            ),
            Phase("carry", [Carry(pace=self.pace, z=over), settle()], slack=slack),
            Phase("bend", [move(pace=slow, alpha=self.bend_rad), settle(), Measure("free")]),
            Phase("lower", self._lower(layer, middle, settle()), guard=guard),
            Phase("seat middle", [ready, *self._press(middle), *jammed], middle, guard=guard),
            Phase("unfold", [touch, *on_middle, ready, Measure("seated")]),
            Phase("lower outer", self._lower_outer(layer, touch, outer), None, slack, on_tips),
            Phase("seat outer", [settle(alpha_ratio=0.0), *self._level(outer)], outer, slack),
            Phase(CHECK, [*on_all, *slacken, *self._learn()], slack=slack),
            Phase("release", [move(opening=start.opening), opened]),
            Phase("withdraw", [move(retreat=start.retreat), settle()]),
        ]

    def _lower(self, layer: int, holes: HolePair, settle: Step) -> Sequence[Step]:
        """Go above the tips, to a place of the search, down past the tips, and to the bed."""
        config, pins, speeds = self.config, self.config.layout.pins, self.config.speeds
        tips = self._seat_z(layer) + pins.height_m
        past_tips = tips - pins.tip_m - _TIP_MARGIN_M - self.uneven_m
        contact, seat = (
            replace(self.pace, linear_m_per_s=speed)
            for speed in (speeds.contact_m_per_s, speeds.seat_m_per_s)
        )
        return [
            # Arms that stand too low, which they do not know, must come off the pins as well.
            replace(self._move(z=tips + _TIP_MARGIN_M + pins.height_m), retry_only=True),
            replace(settle, retry_only=True),
            GoAside(
                pace=self.pace,
                places=config.search.places(),
                turn=config.search.turn_rad,
                centre=self._middle.centre_m,
                felt=_FELT_M,
                near=0.5 * config.search.step_m,
                retry_only=True,
                relax=True,
            ),
            self._move(z=tips + _TIP_MARGIN_M),
            self._down(holes, contact, z=past_tips),
            self._down(holes, seat, top=past_tips, z=holes.target),
        ]

    def _unfold_to_touch(self, layer: int) -> Move:
        """Go to a little before the touch, as on the middle pins; the press goes with the angle."""
        margin_rad = math.pi * _TIP_MARGIN_M / self.sheet.length_m
        alpha = min(self.touch_rad + margin_rad, self.bend_rad)
        z = self._seat_z(layer) - self.down_m * alpha / self.bend_rad
        return self._move(alpha_ratio=1.0, alpha=alpha, z=z, retreat=0.0)

    def _lower_outer(self, layer: int, touch: Move, holes: HolePair) -> Sequence[Step]:
        """Unfold; where it is not the first time, bend up to the touch and turn before."""
        config, about, far = self.config, self._middle.centre_m, self._outer.radius_m
        turns = config.search.turns(config.layout.holes)
        # As slowly as pins are felt for: the middle ones hold the sheet.
        pace = replace(self.pace, angular_rad_per_s=_CHECK_M_PER_S / far)
        most = max(config.check_force_n, self.least_force_n) * far
        turn = Turn(pace=pace, turns=turns, centre=about, most=most, alpha_ratio=1.0)
        slow = replace(self.pace, angular_rad_per_s=config.speeds.contact_rad_per_s)
        return [
            *(replace(move, retry_only=True) for move in (touch, turn)),
            self._down(holes, slow, alpha=holes.target, z=self._seat_z(layer)),
        ]

    def _press(self, holes: HolePair) -> Iterator[Press]:
        if self.config.compliance is not None and self.press_force_n > 0.0:
            yield Press(
                force=self.press_force_n,
                band=max(self.press_force_n / 3.0, self.least_force_n),
                softness=holes.softness,
                most=_ARMS_OFF_M,
                timeout_s=self.config.timeout_s,
                period_s=self.pace.period_s,
                alpha_ratio=1.0,
            )

    def _level(self, holes: HolePair) -> Iterator[Level]:
        if self.config.compliance is not None:
            yield Level(
                force=max(0.5 * holes.touch_n, self.least_force_n),
                # Of a beam from the outer hole to the grip, whose slopes stay.
                softness=self._beyond_farthest**3 / (12.0 * self.sheet.bending_stiffness_nm2),
                most=_ARMS_OFF_M,
                timeout_s=self.config.timeout_s,
                period_s=self.pace.period_s,
                alpha_ratio=0.0,
            )

    def _slack(self) -> Slack | None:
        """Return what takes the tension off a flat sheet; arms that do not comply just go."""
        sheet = self.sheet
        if self.config.compliance is None:
            return None
        return Slack(
            force=_SLACK_N,
            buckling_n=math.pi**2 * sheet.bending_stiffness_nm2 / sheet.length_m**2,
            softness=2.0 / float(self.rubber[0]),
            most=_ARMS_OFF_M,
            # There the ends are nearer by L α²/4 than those of a flat sheet.
            flat_rad=2.0 * math.sqrt(_ARMS_OFF_M / sheet.length_m),
            period_s=self.pace.period_s,
        )

    def _learn(self) -> Sequence[Step]:
        """Learn from the seated sheet; arms that do not comply find nothing with it.

        It is elsewhere where the search would say so.
        """
        config, search = self.config, self.config.search
        if config.compliance is None or not config.learn:
            return []
        return [Learn(near=0.5 * np.array([search.step_m, search.step_m, search.turn_rad]))]

    def _feeling(self) -> Feeling | None:
        """Return the motions that feel the pins; None where they are not to be felt."""
        config = self.config
        if not config.check_force_n:
            return None
        holes, force_n, period_s = config.layout.holes, config.check_force_n, self.pace.period_s
        return Feeling(holes=holes, force_n=force_n, rubber=self.rubber, period_s=period_s)

    def _middle_holes(self, layer: int) -> HolePair:
        """Tell a tip from the press on the bent sheet, whose middle either holds up."""
        press_n, pin_m = self.press_force_n, self.config.layout.pins.height_m
        tip_n, held_up_m = self.middle.force(pin_m), _HELD_UP * pin_m
        return HolePair(
            name="middle",
            coordinate="z",
            target=self._seat_z(layer) - self.down_m,
            support=State.support,
            touch_n=press_n + max(0.1 * (tip_n - press_n), self.least_force_n),
            missed_n=self.middle.force(held_up_m),
            short=held_up_m,
            softness=self.config.press_m / press_n,
            patience_s=2.0 * _PATIENCE_S,
            progress=_PROGRESS_M,
            yields=self.middle.yields,
            sunk=self._seat_z(layer) - self.down_m + _SUNK * pin_m,
            attempts=1 + self.config.search.attempts,
            cannot="at some places it came down as with one of them on its pin, at none as with "
            "both: either pins and holes are not as far apart, or as thick, as drawn, or the sheet "
            "lies farther off than is searched",
            felt=_FELT_M,
            centre=self._middle.centre_m,
        )

    def _outer_holes(self) -> HolePair:
        """Tell a tip by the stiffness of the sheet between the outer hole and the grip."""
        layout, sheet = self.config.layout, self.sheet
        ends = 3.0 * sheet.bending_stiffness_nm2 / self._beyond_nearest**3
        stiffness = float(ends.min())
        missed = 0.5 * stiffness * layout.pins.height_m
        return HolePair(
            name="outer",
            coordinate="alpha",
            target=0.0,
            highest=self.bend_rad,
            support=partial(State.end_support, shares=stiffness / ends),
            touch_n=max(0.4 * missed, self.least_force_n),
            missed_n=max(missed, self.least_force_n),
            short=_HELD_UP * self.touch_rad,
            # A grip rises by L/π for each radian.
            softness=math.pi / (stiffness * sheet.length_m),
            patience_s=_PATIENCE_S,
            progress=math.pi / sheet.length_m * _PROGRESS_M,
            attempts=len(self.config.search.turns(layout.holes)),
            turning=(self._middle.radius_m / self._outer.radius_m) or 1.0,
            cannot="the middle ones are on theirs, and were turned through all of their play: pins "
            "or holes are not as far apart, or as thick, as drawn",
            felt=0.0,
        )

    def _move(
        self, *, pace: Pace | None = None, alpha_ratio: float | None = None, **to: float
    ) -> Move:
        return Move(to=to, pace=pace or self.pace, alpha_ratio=alpha_ratio)

    def _down(self, holes: HolePair, pace: Pace, *, top: float = math.inf, **to: float) -> Move:
        """Return a motion that heeds the tips of pins; arms that do not comply just go."""
        if self.config.compliance is None:
            return self._move(pace=pace, **to)
        return MoveDown(
            to=to,
            pace=pace,
            alpha_ratio=1.0,
            holes=holes,
            bottom=to[holes.coordinate],
            top=top,
            timeout_s=self.config.timeout_s,
        )
