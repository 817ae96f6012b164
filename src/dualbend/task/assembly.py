"""The assembly of a printed wiring board's book, phase by phase, as a robot program would say it.

Pick the sheet up from the stand, carry it over the bed, bend it, lower its middle holes onto their
pins, unfold it until the outer ones are on theirs, let go, withdraw. What ends a phase is sensed.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Generator
from dataclasses import dataclass, field, fields, replace
from typing import Annotated

import msgspec
import numpy as np
from numpy.typing import NDArray

from dualbend.beam.path import BendingPath
from dualbend.beam.rod import solve_planar
from dualbend.beam.sheet import Sheet
from dualbend.control.alter import COMMAND_PERIOD_S
from dualbend.control.object_admittance import ObjectComplianceConfig
from dualbend.errors import InputError
from dualbend.scene.bed import LayoutConfig

Vector = NDArray[np.float64]
Positive = Annotated[float, msgspec.Meta(gt=0)]
NotNegative = Annotated[float, msgspec.Meta(ge=0)]

PHASES = (
    "approach",
    "grasp",
    "lift",
    "carry",
    "bend",
    "lower",
    "seat middle",
    "unfold",
    "lower outer",
    "seat outer",
    "release",
    "withdraw",
)

_MEAN_CYCLES = 18
"""Half a second: over it the sensors' noise has a mean of some 0.02 N."""

_TIP_MARGIN_M = 1.5e-3
"""Above and below the tips of the pins, where motions are slow."""

_PRESS_RATE_PER_S = 2.0
"""Rate at which the press on a sheet that is held up is corrected; the loop bears four times it."""

_PEAK_OVER_MEAN_SPEED = 1.875
"""Of the polynomial of fifth degree that every motion follows."""

GRAVITY_M_PER_S2 = 9.81


class SpeedsConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Highest speed of each kind of motion."""

    travel_m_per_s: Annotated[
        Positive, msgspec.Meta(description="of sheet or grippers in free motion")
    ] = 0.25
    contact_m_per_s: Annotated[
        Positive, msgspec.Meta(description="down past the tips of the pins")
    ] = 0.003
    seat_m_per_s: Annotated[Positive, msgspec.Meta(description="down from there to the bed")] = (
        0.010
    )
    unfold_rad_per_s: Annotated[
        Positive, msgspec.Meta(description="of unfolding and turning in free motion")
    ] = 0.1
    contact_rad_per_s: Annotated[
        Positive, msgspec.Meta(description="of unfolding onto the pins")
    ] = 0.03
    jaw_m_per_s: Annotated[Positive, msgspec.Meta(description="of each jaw")] = 0.02


class SearchConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What is done where a hole did not find its pin: up, aside, down again."""

    attempts: Annotated[int, msgspec.Meta(ge=0, le=50, description="before the task stops")] = 6
    step_m: Annotated[Positive, msgspec.Meta(description="between the places that are tried")] = (
        1.2e-3
    )


DEFAULT_YIELD_PA = 193e6
"""Of a sheet of no named material: 5052-H32, that of the shipped experiments."""


class LimitsConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What damages the sheet or a pin: beyond it the run fails."""

    pin_force_n: Annotated[Positive, msgspec.Meta(description="largest force on a pin")] = 40.0
    edge_force_n: Annotated[
        Positive, msgspec.Meta(description="largest force of one contact at a hole's edge")
    ] = 40.0
    yield_pa: (
        Annotated[
            float,
            msgspec.Meta(gt=0, description="0.2 % yield strength; none: the sheet's, or 193 MPa"),
        ]
        | None
    ) = None


class ErrorsConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What is otherwise than the robots believe; they are not told."""

    pickup_x_m: Annotated[float, msgspec.Meta(description="how far the sheet lies off along x")] = (
        0.0
    )
    pickup_y_m: Annotated[float, msgspec.Meta(description="how far the sheet lies off along y")] = (
        0.0
    )
    pickup_yaw_rad: Annotated[
        float, msgspec.Meta(description="how far the sheet lies turned about the vertical")
    ] = 0.0
    thickness_factor: Annotated[
        Positive, msgspec.Meta(description="true thickness over the believed one")
    ] = 1.0
    modulus_factor: Annotated[
        Positive, msgspec.Meta(description="true Young's modulus over the believed one")
    ] = 1.0
    friction_factor: Annotated[
        float, msgspec.Meta(ge=0, description="true friction over the believed one")
    ] = 1.0

    def true_sheet(self, sheet: Sheet) -> Sheet:
        """Return the sheet as it is."""
        return replace(
            sheet,
            thickness_m=sheet.thickness_m * self.thickness_factor,
            young_pa=sheet.young_pa * self.modulus_factor,
        )


class SpreadConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Standard deviations of what differs from sheet to sheet; those without a unit are relative.

    ``hole_m`` is that of each hole along the sheet, and across it.
    """

    pickup_x_m: Annotated[
        NotNegative, msgspec.Meta(description="of where the sheet lies along x")
    ] = 0.3e-3
    pickup_y_m: Annotated[
        NotNegative, msgspec.Meta(description="of where the sheet lies along y")
    ] = 0.3e-3
    pickup_yaw_rad: Annotated[
        NotNegative, msgspec.Meta(description="of its turn about the vertical")
    ] = math.radians(0.2)
    hole_m: Annotated[
        NotNegative, msgspec.Meta(description="of each hole's place, along and across")
    ] = 0.01e-3
    thickness: Annotated[
        NotNegative, msgspec.Meta(description="of true over believed thickness")
    ] = 0.02
    modulus: Annotated[
        NotNegative, msgspec.Meta(description="of true over believed Young's modulus")
    ] = 0.02
    friction: Annotated[NotNegative, msgspec.Meta(description="of true over believed friction")] = (
        0.2
    )


class AssemblyConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The workplace and how the robots go about it."""

    layout: LayoutConfig = LayoutConfig()
    sheets: Annotated[int, msgspec.Meta(ge=1, le=10, description="of the book")] = 1
    errors: ErrorsConfig = ErrorsConfig()
    spread: SpreadConfig = SpreadConfig()
    speeds: SpeedsConfig = SpeedsConfig()
    search: SearchConfig = SearchConfig()
    limits: LimitsConfig = LimitsConfig()
    compliance: ObjectComplianceConfig | None = None
    lift_m: Annotated[float, msgspec.Meta(gt=0, le=0.5, description="above stand and bed")] = 0.05
    retreat_m: Annotated[float, msgspec.Meta(gt=0, le=0.3, description="from the sheet's end")] = (
        0.05
    )
    jaw_opening_m: Annotated[float, msgspec.Meta(gt=0, le=0.015, description="of each jaw")] = 0.012
    press_m: Annotated[
        float, msgspec.Meta(ge=0, le=0.01, description="lower than the middle would need")
    ] = 0.2e-3
    timeout_s: Annotated[
        float, msgspec.Meta(gt=0, le=600, description="to wait for a phase's end")
    ] = 10.0

    def true_layout(self) -> LayoutConfig:
        """Return the workplace with the friction that it really has."""
        factor, layout = self.errors.friction_factor, self.layout
        return msgspec.structs.replace(
            layout,
            pins=msgspec.structs.replace(layout.pins, friction=layout.pins.friction * factor),
            bed=msgspec.structs.replace(layout.bed, friction=layout.bed.friction * factor),
        )


class TaskStopped(Exception):  # noqa: N818 - an outcome of a run
    """The robots give up, safely; the message says in which phase and why."""


@dataclass(frozen=True, kw_only=True)
class Posture:
    """What the arms are told: where the sheet's middle is, its bend, and how the grippers stand.

    ``x, y, z`` [m] and ``yaw`` [rad] of the middle of the sheet's mid-plane, ``alpha`` its end
    slope, ``retreat`` [m] of each gripper outward from the sheet's end, ``opening`` [m] of a jaw.
    """

    x: float = 0.0
    y: float
    z: float
    yaw: float = 0.0
    alpha: float = 0.0
    retreat: float = 0.0
    opening: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Goal:
    """One cycle's nominal posture; how far the sheet complies, and what happens besides.

    ``bend``: bending angle over that at which the sheet is laid, None where it must not comply.
    ``seeking``: the sheet lies on the tips of pins, where it feels their flanks, not their sides.
    """

    phase: int
    posture: Posture
    bend: float | None = None
    seeking: bool = False
    attempt: int = 0


@dataclass(frozen=True, kw_only=True)
class Sensed:
    """What the robots know of the cycle: nothing that no sensor of theirs tells.

    ``net`` (4,): net force x, y, z [N] and moment about the vertical [N m] of the sheet on the
    arms. ``vertical`` (2,): of it the force z at each arm. ``gap`` (2,): between the pads [m].
    ``error_m``: of the grips from where they were sent, by the joints' encoders.
    """

    net: Vector
    vertical: Vector
    gap: Vector
    error_m: float


Steps = Generator[Goal, Sensed, None]


@dataclass(frozen=True, kw_only=True)
class Press:
    """A force that tells of a pin's tip: where it stops a motion, and what the motion does to it.

    ``touch_n`` [N]; ``softness``: motion per force [m/N] or [rad/N]; ``support`` tells the force.
    """

    touch_n: float
    softness: float
    support: Callable[[], float]


@dataclass
class AssemblyTask:
    """The robots' program: a generator of goals that is sent what was sensed.

    Parameters
    ----------
    config
        Workplace, speeds, limits.
    sheet
        As the robots believe it to be.
    path
        Half distance and rise over the bending angle, up to that at which the sheet is laid.
    touch_rad
        Bending angle at which the outer holes come to the tips of their pins.
    bend_speed_rad_per_s
        Highest speed of the bending angle while the sheet is bent in the air.
    """

    config: AssemblyConfig
    sheet: Sheet
    path: BendingPath
    touch_rad: float
    bend_speed_rad_per_s: float
    phase: int = 0
    laid: int = 0
    attempts: int = 0
    _posture: Posture = field(init=False)
    _seen: deque[Sensed] = field(default_factory=lambda: deque(maxlen=_MEAN_CYCLES))
    _baseline: Sensed | None = None

    def __post_init__(self) -> None:
        """Start beside the stand, jaws open."""
        self.bend_rad = float(self.path.knots[-1])
        self._posture = Posture(
            y=self.config.layout.stand.y_m,
            z=self._stand_z,
            retreat=self.config.retreat_m,
            opening=self.config.jaw_opening_m,
        )
        self.press_force_n = self._middle_force(self.config.press_m)
        self.tip_force_n = self._middle_force(self.config.layout.pins.height_m)

    @property
    def start(self) -> Posture:
        """Where the arms begin."""
        return self._posture

    @property
    def _stand_z(self) -> float:
        return self.config.layout.stand.top_m + 0.5 * self.sheet.thickness_m

    @property
    def _seat_z(self) -> float:
        return self.config.layout.bed.top_m + (0.5 + self.laid) * self.sheet.thickness_m

    def _middle_force(self, height_m: float) -> float:
        """Return the force [N] that holds the bent sheet's middle this much above its place.

        Twice the end force of half the sheet, its middle level between two rigid grips.
        """
        half, rise = self.path.at(self.bend_rad)
        L, weight = self.sheet.length_m, self.sheet.mass_kg * GRAVITY_M_PER_S2
        grip, middle = (-half, rise, self.bend_rad), (0.0, height_m, 0.0)
        state = solve_planar(self.sheet.bending_stiffness_nm2, L / 2, grip, middle, weight / L)
        if not state.converged:
            raise InputError(
                f"the force of the bent sheet held {1e3 * height_m:.2f} mm up was not found "
                f"({state.reason}): what is felt could not be judged"
            )
        return -2.0 * state.right.force_z_n

    def waypoints(self) -> list[tuple[str, Posture]]:
        """Return the postures between which the arms move, by the phase that ends there."""
        stand = replace(self._posture, retreat=0.0, opening=0.0)
        up = replace(stand, z=stand.z + self.config.lift_m)
        over = replace(up, y=0.0, z=self._seat_z + self.config.lift_m)
        bent = replace(over, alpha=self.bend_rad)
        down = replace(bent, z=self._seat_z - self.config.press_m)
        flat = replace(down, alpha=0.0, z=self._seat_z)
        away = replace(flat, retreat=self.config.retreat_m)
        return [
            ("approach", self._posture),
            ("grasp", stand),
            ("lift", up),
            ("carry", over),
            ("bend", bent),
            ("lower", down),
            ("unfold", flat),
            ("withdraw", away),
        ]

    def steps(self) -> Steps:
        """Lay one sheet after another."""
        while True:
            yield from self._pick_up()
            yield from self._lower()
            yield from self._unfold()
            yield from self._leave()
            self.laid += 1
            if self.laid == self.config.sheets:
                return
            yield from self._return()

    # -- phases -----------------------------------------------------------------------------

    def _pick_up(self) -> Steps:
        config = self.config
        self._enter("approach")
        yield from self._move(retreat=0.0)
        yield from self._settle()
        self._enter("grasp")
        yield from self._move(opening=0.0)
        t = self.sheet.thickness_m
        yield from self._wait(
            lambda: bool(np.ptp([s.gap for s in self._seen], axis=0).max() < 0.1 * t),
            "the jaws have not come to rest",
        )
        gap = self._mean().gap
        for side, opening in zip(("left", "right"), gap, strict=True):
            if opening < 0.5 * t:
                raise self._stopped(
                    f"nothing is between the {side} jaws: they closed to {1e3 * opening:.2f} mm, "
                    f"the sheet has {1e3 * t:.2f} mm"
                )
        self._enter("lift")
        yield from self._move(z=self._stand_z + config.lift_m)
        yield from self._settle()
        weight = self.sheet.mass_kg * GRAVITY_M_PER_S2
        carried = -float(self._mean().net[2])
        if not 0.5 * weight < carried < 1.5 * weight:
            raise self._stopped(f"the arms carry {carried:.2f} N, the sheet weighs {weight:.2f} N")
        self._enter("carry")
        yield from self._move(y=0.0, z=self._seat_z + config.lift_m)
        yield from self._settle()
        self._enter("bend")
        yield from self._move(alpha=self.bend_rad, angle_speed=self.bend_speed_rad_per_s)
        yield from self._settle()
        self._baseline = self._mean()

    def _lower(self) -> Steps:
        """Lower the middle; a hole that sits on its pin's tip is felt, and searched for."""
        config = self.config
        tips = self._seat_z + config.layout.pins.height_m + _TIP_MARGIN_M
        missed = self.press_force_n + 0.3 * (self.tip_force_n - self.press_force_n)
        for attempt, (dx, dy) in enumerate(search_pattern(config.search)):
            self._enter("lower", attempt)
            yield from self._move(z=tips)
            yield from self._move(x=dx, y=dy)
            yield from self._push_down()
            self._enter("seat middle", attempt)
            yield from self._settle(bend=1.0)
            support = self._support(_MEAN_CYCLES)
            if support < missed and self._posture.z <= self._seat_z - config.press_m:
                break
        else:
            raise self._stopped(
                f"the middle holes did not find their pins in {config.search.attempts + 1} "
                f"attempts: the sheet is held up with {support:.2f} N, above {missed:.2f} N"
            )

    def _push_down(self) -> Steps:
        """Lower to the bed, slowly past the tips of the pins."""
        pins, speeds = self.config.layout.pins, self.config.speeds
        press = Press(
            touch_n=self.press_force_n + 0.1 * (self.tip_force_n - self.press_force_n),
            softness=self.config.press_m / self.press_force_n,
            support=self._support,
        )
        below_tips = self._seat_z + pins.height_m - pins.tip_m - _TIP_MARGIN_M
        bottom = self._seat_z - self.config.press_m
        yield from self._guarded("z", below_tips, press, speed=speeds.contact_m_per_s)
        if self._posture.z <= below_tips:
            yield from self._guarded("z", bottom, press, speed=speeds.seat_m_per_s)

    def _unfold(self) -> Steps:
        """Unfold with the middle on its pins, until the outer holes are on theirs."""
        config, sheet = self.config, self.sheet
        overhang = 0.5 * sheet.length_m - config.layout.holes.outer.along_m
        stiffness = 3.0 * sheet.bending_stiffness_nm2 / overhang**3
        missed = 0.5 * stiffness * config.layout.pins.height_m
        # A grip rises by L/π for each radian.
        press = Press(
            touch_n=0.4 * missed,
            softness=math.pi / (stiffness * sheet.length_m),
            support=self._end_support,
        )
        speeds = config.speeds
        # A little before the touch, as on the middle pins.
        touch = min(self.touch_rad + math.pi * _TIP_MARGIN_M / sheet.length_m, self.bend_rad)
        self._enter("unfold")
        yield from self._unfold_to(touch, speeds.unfold_rad_per_s)
        yaw = self._posture.yaw
        along = config.layout.holes.outer.along_m
        for attempt, aside in enumerate(side_to_side(config.search)):
            self._enter("lower outer", attempt)
            if attempt:
                yield from self._unfold_to(touch, speeds.unfold_rad_per_s)
                yield from self._move(yaw=yaw + aside / along)
            yield from self._unfold_to(0.0, speeds.contact_rad_per_s, press)
            self._enter("seat outer", attempt)
            yield from self._settle(bend=0.0)
            support = self._end_support(_MEAN_CYCLES)
            if self._posture.alpha == 0.0 and support < missed:
                return
        raise self._stopped(
            f"the outer holes did not find their pins in {config.search.attempts + 1} attempts: "
            f"an end is held up with {support:.2f} N, above {missed:.2f} N"
        )

    def _unfold_to(self, alpha: float, speed: float, press: Press | None = None) -> Steps:
        """Change the bending angle with the middle on the bed; the press goes with the angle."""
        z = self._seat_z - self.config.press_m * alpha / self.bend_rad
        if press is None:
            yield from self._move(alpha=alpha, z=z, angle_speed=speed, bend=1.0)
        else:
            yield from self._guarded("alpha", alpha, press, angle_speed=speed, z=z)

    def _guarded(
        self,
        name: str,
        target: float,
        press: Press,
        *,
        speed: float | None = None,
        angle_speed: float | None = None,
        **others: float,
    ) -> Steps:
        """Go down until something holds the sheet up; give it time to find its pins, and go on.

        Meanwhile it is pressed lightly: the flank of a tip multiplies what presses on it. Gives
        up where the time for that is over, with the target not reached. Arms that do not comply
        just go.
        """
        waited = 0
        if self.config.compliance is None:
            yield from self._move(
                speed=speed,
                angle_speed=angle_speed,
                bend=None,
                until=None,
                **{name: target},
                **others,
            )
            return
        while getattr(self._posture, name) > target:
            yield from self._move(
                speed=speed,
                angle_speed=angle_speed,
                bend=1.0,
                until=lambda: press.support() > press.touch_n,
                **{name: target},
                **others,
            )
            while getattr(self._posture, name) > target and press.support() > 0.3 * press.touch_n:
                if waited * COMMAND_PERIOD_S > self.config.timeout_s:
                    return
                waited += 1
                over = press.support() - 0.8 * press.touch_n
                back = _PRESS_RATE_PER_S * COMMAND_PERIOD_S * press.softness * over
                there = getattr(self._posture, name) + back
                self._posture = replace(self._posture, **{name: max(there, target)})
                yield from self._step(self._bend_share(1.0), seeking=True)

    def _leave(self) -> Steps:
        config = self.config
        self._enter("release")
        yield from self._move(opening=config.jaw_opening_m)
        wide = 0.8 * 2.0 * config.jaw_opening_m
        yield from self._wait(
            lambda: bool(self._seen[-1].gap.min() > wide), "the jaws have not opened"
        )
        self._enter("withdraw")
        yield from self._move(retreat=config.retreat_m)
        yield from self._settle()

    def _return(self) -> Steps:
        config = self.config
        self._enter("approach")
        yield from self._move(z=self._seat_z + config.lift_m)
        yield from self._move(x=0.0, y=config.layout.stand.y_m, yaw=0.0)
        yield from self._move(z=self._stand_z)

    # -- what they are made of ----------------------------------------------------------------

    def _enter(self, phase: str, attempt: int = 0) -> None:
        self.phase, self.attempts = PHASES.index(phase), attempt

    def _stopped(self, reason: str) -> TaskStopped:
        return TaskStopped(f"{PHASES[self.phase]}: {reason}")

    def _step(self, bend: float | None, seeking: bool = False) -> Steps:
        sensed = yield Goal(
            phase=self.phase,
            posture=self._posture,
            bend=bend,
            seeking=seeking,
            attempt=self.attempts,
        )
        self._seen.append(sensed)

    def _move(
        self,
        *,
        speed: float | None = None,
        angle_speed: float | None = None,
        bend: float | None = None,
        until: Callable[[], bool] | None = None,
        **target: float,
    ) -> Steps:
        """Move along a polynomial of fifth degree, as long as its slowest part takes."""
        speeds, begin = self.config.speeds, self._posture
        end = replace(begin, **target)
        linear = speed or speeds.travel_m_per_s
        angular = angle_speed or speeds.unfold_rad_per_s
        way = math.dist((begin.x, begin.y, begin.z), (end.x, end.y, end.z))
        duration = _PEAK_OVER_MEAN_SPEED * max(
            max(way, abs(end.retreat - begin.retreat)) / linear,
            max(abs(end.alpha - begin.alpha), abs(end.yaw - begin.yaw)) / angular,
            abs(end.opening - begin.opening) / speeds.jaw_m_per_s,
        )
        cycles = max(1, math.ceil(duration / COMMAND_PERIOD_S))
        for n in range(1, cycles + 1):
            u = n / cycles
            share = u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
            self._posture = Posture(
                **{
                    f.name: _between(getattr(begin, f.name), getattr(end, f.name), share)
                    for f in fields(Posture)
                }
            )
            now = None if bend is None else self._bend_share(bend)
            yield from self._step(now)
            if until is not None and until():
                return
        self._posture = end

    def _bend_share(self, bend: float) -> float:
        return min(bend, self._posture.alpha / self.bend_rad)

    def _settle(self, bend: float | None = None) -> Steps:
        """Stay until the grips are where they were sent and the noise has been averaged out."""
        for _ in range(_MEAN_CYCLES):
            yield from self._step(bend)
        yield from self._wait(
            lambda: self._seen[-1].error_m < 1e-3, "the grips are not where they were sent", bend
        )

    def _wait(self, done: Callable[[], bool], what: str, bend: float | None = None) -> Steps:
        cycles = math.ceil(self.config.timeout_s / COMMAND_PERIOD_S)
        for n in range(cycles):
            yield from self._step(bend)
            if n + 1 >= min(_MEAN_CYCLES, cycles) and done():
                return
        raise self._stopped(f"{what} after {self.config.timeout_s:g} s")

    def _mean(self, cycles: int = _MEAN_CYCLES) -> Sensed:
        last = list(self._seen)[-cycles:]
        return Sensed(
            net=np.mean([s.net for s in last], axis=0),
            vertical=np.mean([s.vertical for s in last], axis=0),
            gap=np.mean([s.gap for s in last], axis=0),
            error_m=max(s.error_m for s in last),
        )

    def _support(self, cycles: int = 5) -> float:
        """Return the force that holds the sheet up beside the arms [N]."""
        assert self._baseline is not None
        return float(self._mean(cycles).net[2] - self._baseline.net[2])

    def _end_support(self, cycles: int = 5) -> float:
        """Return the larger of the two arms' share of it [N]."""
        assert self._baseline is not None
        return float((self._mean(cycles).vertical - self._baseline.vertical).max())

    def contact_wrench(self, net: Vector) -> Vector:
        """Return force x, y and moment z that the sheet's contacts make, (3,) [N, N m]."""
        free = np.zeros(4) if self._baseline is None else self._baseline.net
        return np.asarray((net - free)[[0, 1, 3]])


def _between(begin: float, end: float, share: float) -> float:
    """Interpolate; rounding must not leave the range, nor change what stays."""
    return begin if begin == end else (1.0 - share) * begin + share * end


def side_to_side(search: SearchConfig) -> list[float]:
    """Return how far the outer holes are turned aside [m]: the middle is on its pins already.

    A quarter of the step: what the middle holes' clearance leaves is less than that of a free
    sheet.
    """
    places = [0.0]
    for n in range(search.attempts):
        places.append((1 + n // 2) * (0.25 if n % 2 == 0 else -0.25) * search.step_m)
    return places


def search_pattern(search: SearchConfig) -> list[tuple[float, float]]:
    """Return where to try: in place, then along and across on both sides, then the corners."""
    square = [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, -1), (1, -1), (-1, 1)]
    places = [(0.0, 0.0)]
    for n in range(search.attempts):
        ring, (along, across) = 1 + n // len(square), square[n % len(square)]
        places.append((ring * along * search.step_m, ring * across * search.step_m))
    return places
