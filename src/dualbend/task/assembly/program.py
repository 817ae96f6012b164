"""The assembly of a printed wiring board's book, phase by phase, as a robot program would say it.

Pick the sheet up from the stand, carry it over the bed, bend it, lower its middle holes onto their
pins, unfold it until the outer ones are on theirs, let go, withdraw. What ends a phase is sensed.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from dualbend.beam.path import BendingPath
from dualbend.beam.rod.planar import solve_planar
from dualbend.beam.sheet import GRAVITY_M_PER_S2, Sheet
from dualbend.errors import InputError
from dualbend.scenario.assembly import AssemblyConfig, SearchConfig
from dualbend.task.assembly.motions import MEAN_CYCLES, Motions, Posture, Press, Steps

_TIP_MARGIN_M = 1.5e-3
"""Above and below the tips of the pins, where motions are slow."""


class AssemblyTask(Motions):
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

    def __init__(
        self,
        *,
        config: AssemblyConfig,
        sheet: Sheet,
        path: BendingPath,
        touch_rad: float,
        bend_speed_rad_per_s: float,
    ) -> None:
        self.start = Posture(
            y=config.layout.stand.y_m,
            z=config.layout.stand.top_m + 0.5 * sheet.thickness_m,
            retreat=config.retreat_m,
            opening=config.jaw_opening_m,
        )
        super().__init__(config, self.start, float(path.knots[-1]))
        self.sheet, self.path = sheet, path
        self.touch_rad, self.bend_speed_rad_per_s = touch_rad, bend_speed_rad_per_s
        self.laid = 0
        self.press_force_n = self._middle_force(config.press_m)
        self.tip_force_n = self._middle_force(config.layout.pins.height_m)

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
        stand = replace(self.start, retreat=0.0, opening=0.0)
        up = replace(stand, z=stand.z + self.config.lift_m)
        over = replace(up, y=0.0, z=self._seat_z + self.config.lift_m)
        bent = replace(over, alpha=self.bend_rad)
        down = replace(bent, z=self._seat_z - self.config.press_m)
        flat = replace(down, alpha=0.0, z=self._seat_z)
        away = replace(flat, retreat=self.config.retreat_m)
        return [
            ("approach", self.start),
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
        empty = self._mean()
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
        yield from self._move(z=self.start.z + config.lift_m)
        yield from self._settle()
        weight = self.sheet.mass_kg * GRAVITY_M_PER_S2
        carried = float(empty.net[2] - self._mean().net[2])
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
            support = self._support(MEAN_CYCLES)
            if support < missed and self._posture.z <= self._seat_z - config.press_m:
                break
        else:
            above = self._posture.z - (self._seat_z - config.press_m)
            raise self._stopped(
                f"the middle holes did not find their pins in {config.search.attempts + 1} "
                f"attempts: {_held_up('the sheet', support, missed, 1e3 * above, 'mm')}"
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
            support = self._end_support(MEAN_CYCLES)
            if self._posture.alpha == 0.0 and support < missed:
                return
        raise self._stopped(
            f"the outer holes did not find their pins in {config.search.attempts + 1} attempts: "
            f"{_held_up('an end', support, missed, self._posture.alpha, 'rad')}"
        )

    def _unfold_to(self, alpha: float, speed: float, press: Press | None = None) -> Steps:
        """Change the bending angle with the middle on the bed; the press goes with the angle."""
        z = self._seat_z - self.config.press_m * alpha / self.bend_rad
        if press is None:
            yield from self._move(alpha=alpha, z=z, angle_speed=speed, bend=1.0)
        else:
            yield from self._guarded("alpha", alpha, press, angle_speed=speed, z=z)

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
        yield from self._move(z=self.start.z)


def _held_up(what: str, support: float, missed: float, left: float, unit: str) -> str:
    """Say what keeps a hole from its pin: too large a force, or a small one all the time."""
    force = f"{what} is held up with {support:.2f} N"
    if support >= missed:
        return f"{force}, above {missed:.2f} N"
    return f"{force}, {left:.3g} {unit} short of its place"


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
