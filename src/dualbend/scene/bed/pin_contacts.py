"""Contact of sheet and pins: peaks of all physics steps, places of the holes."""

from __future__ import annotations

import math
from typing import NamedTuple

import mujoco
import numpy as np

from dualbend.beam.sheet import Sheet
from dualbend.scene.bed.config import LayoutConfig, hole_places
from dualbend.scene.bed.mjcf import laid_body, wedged_contact
from dualbend.scene.sheet.strips import StripConfig, strip_body
from dualbend.types import Vector

_FALLS_FROM_M, _NEAR_M, _RESOLVED_M = 8e-3, 0.5e-3, 40e-6
"""From where above a tip holes are watched, what tilt adds, and the motion that a step resolves."""

_FINE, _FINE_STEPS = 8.0, 2
"""Parts of a step where holes fall, at most, and for how many steps one that was lost counts."""

_SLOPE, _FAR_M, _MOST_M = 0.3, 3e-3, 6e-3
"""Of a bent sheet, how far from its pin a hole is where that counts, and what it makes at most."""

_WEDGED = 16.0
"""Parts of a step where a hole may be wedged on a tip that is too thick for it, from all sides.

They resolve :func:`dualbend.scene.bed.mjcf.wedged_contact`, which pins have then.
"""

_MOST_PARTS = 32

_TOLD = 7
"""Numbers of each pin's sensors: net force, largest force of a contact, its distance."""

_THICK_M = 0.45e-3
"""Sheets that are thinner than this are resolved finer in proportion: less of it comes through."""


class PinPeaks(NamedTuple):
    """Of each pin, (n,): force on it [N], largest force of one contact [N], depths of sheet in pin.

    ``penetration_m``: what lasted through all physics steps; ``impact_m``: in any of them. A sheet
    that falls on a tip is as deep in it as it moves in one or two steps, before it is stopped.
    """

    force_n: Vector
    edge_force_n: Vector
    penetration_m: Vector
    impact_m: Vector


class PinContacts:
    """The holes against their pins, in the order of the layout's names."""

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        layout: LayoutConfig,
        sheet: Sheet,
        strips: StripConfig,
    ) -> None:
        self._data = data
        holes = layout.holes.names
        self._count = len(holes)
        first = model.sensor(f"net_{holes[0]}").adr[0]
        # Python in every physics step: what is told is only kept, and looked at once a cycle.
        self._told = data.sensordata[first : first + _TOLD * self._count]
        self._steps = list[bytes]()
        self._sites = np.array([model.site(f"hole_{hole}").id for hole in holes])
        self._site_heights = data.site_xpos[:, 2]
        self._pins = np.column_stack((hole_places(layout.holes), [layout.bed.top_m] * self._count))
        self._half_thickness_m, self._width_m = sheet.thickness_m / 2, sheet.width_m
        self._finer = max(1.0, _THICK_M / sheet.thickness_m)
        # The holes' height with their lower face on a tip, and from where on down tips are struck.
        self._tips_m = layout.bed.top_m + layout.pins.height_m + self._half_thickness_m
        # A thicker pin's round tip begins lower.
        self._struck_m = -layout.pins.tip_m - 0.5 * float(layout.thicker_m.max())
        self._pairs, self._finest, self._lost = b"", 1, 0
        self._at_tips: list[int] = []
        # What a tip stops at once of a sheet that comes off another one is of the size of a strip.
        self._parts_of_root_n: float = model.opt.timestep / math.sqrt(
            _RESOLVED_M / self._finer * sheet.mass_kg / (strips.hinges + 1)
        )
        self._height, self._near, self._tilts_m = [0.0] * self._count, False, _NEAR_M
        self._strips = [model.body(strip_body(i)).id for i in range(strips.hinges + 1)]
        self._model = model
        too_thick = layout.thicker_m > layout.holes.clearance_m
        self._thick: list[bool] = too_thick.tolist()
        self._jams, self._wedged = [False] * self._count, False
        pins = np.array([model.geom(f"pin_{hole}").id for hole in holes])
        self._tips = pins[too_thick]
        usual = model.geom_solref[pins[0]].copy(), model.geom_solimp[pins[0]].copy()
        self._contacts = usual, wedged_contact(layout.pins.friction)

    def _heights(self) -> list[float]:
        """Return the height of each hole's centre [m]."""
        heights: list[float] = self._site_heights.take(self._sites).tolist()
        return heights

    def on_step(self) -> None:
        """Keep what is told of the pins for :meth:`peaks`; once per physics step."""
        self._steps.append(self._told.tobytes())
        if self._near:
            self._pairs = self._data.contact.geom.tobytes()

    def _wedge(self, wedged: bool) -> None:
        """Let pins that are too thick bear a hole all around, or touch as the others do."""
        if wedged != self._wedged:
            solref, solimp = self._contacts[wedged]
            self._model.geom_solref[self._tips] = solref
            self._model.geom_solimp[self._tips] = solimp
            self._wedged = wedged

    def parts(self) -> int:
        """Return into how many the next physics step must be divided, not to miss an impact.

        So that a hole that comes down to a tip moves by `_RESOLVED_M` in each, down to an eighth;
        a thin sheet's by less. Into `_WEDGED` where its hole is smaller than the pin, whose contact
        is another then. 0 near a tip, else: :meth:`parts_by_contacts` tells it.
        """
        if not self._near:
            self._wedge(False)
            return 1
        heights, needed, wedged = self._heights(), 0.0, False
        lowest, self._at_tips = self._struck_m - self._tilts_m, list[int]()
        holes = zip(heights, self._height, self._jams, strict=True)
        for i, (now, before, jams) in enumerate(holes):
            fall, above = before - now, now - self._tips_m
            if lowest < above < 3.0 * fall + self._tilts_m:
                self._at_tips.append(i)
                needed = max(needed, fall / _RESOLVED_M)
                wedged = wedged or (jams and above < 0.0)
        self._height = heights
        self._wedge(wedged)
        if wedged:
            return _power_of_two(_WEDGED)
        needed = min(needed, _FINE) * self._finer
        if needed <= 1.0:
            return 0 if self._at_tips else 1
        return _power_of_two(max(needed, self._parts_by_force()))

    def _parts_by_force(self) -> float:
        """Return into how many a step must be divided in which a tip may lose what it bears."""
        told: list[float] = self._told.tolist()
        borne = max(math.hypot(*told[i * _TOLD : i * _TOLD + 3]) for i in self._at_tips)
        return self._parts_of_root_n * math.sqrt(borne)

    def parts_by_contacts(self) -> int:
        """Return the same, by the contacts of that step, which have been found.

        A sheet that is pressed on a tip by F rests a fraction of a micrometre deep in it. Where it
        comes off by as much, a strip of mass m falls F dt²/m in that one step, 2 mm by 1.2 N in a
        whole one: so in one of dt √(F/m r) parts it falls by what is resolved, r.
        """
        if self._data.contact.geom.tobytes() != self._pairs:
            self._finest, self._lost = _power_of_two(self._parts_by_force()), _FINE_STEPS
        if not self._lost:
            return 1
        self._lost -= 1
        return self._finest

    def peaks(self) -> PinPeaks:
        """Return the peaks, and start again; once per command cycle."""
        self._height = self._heights()
        offsets = self.offsets().tolist()
        away = [max(abs(x), abs(y)) for x, y, _ in offsets]
        # A pin far from its hole meets the bent sheet higher or lower than the hole is.
        self._tilts_m = _NEAR_M + min(_SLOPE * max(max(away) - _FAR_M, 0.0), _MOST_M)
        self._jams = [thick and far < _FAR_M for thick, far in zip(self._thick, away, strict=True)]
        low, high = self._struck_m - self._tilts_m, _FALLS_FROM_M + self._tilts_m
        # A sheet that is further aside than its width, as on the stand, is over no pin.
        aside = min(abs(y) for _, y, _ in offsets) > self._width_m
        self._near = not aside and any(low < z - self._tips_m < high for z in self._height)
        told = np.frombuffer(b"".join(self._steps)).reshape(-1, self._count, _TOLD)
        self._steps.clear()
        if not np.count_nonzero(told):
            return PinPeaks(*np.zeros((4, self._count)))
        forces, depth = told[..., :-1].reshape(*told.shape[:2], 2, 3), 0.0 - told[..., -1]
        force, edge = np.sqrt(np.einsum("...i,...i", forces, forces).max(axis=0)).T
        return PinPeaks(force, edge, depth.min(axis=0), depth.max(axis=0))

    def offsets(self) -> Vector:
        """Return (n, 3): each hole's centre from its pin's axis, x and y [m], and its height [m].

        The height is that of the sheet's lower face above the bed.
        """
        away = self._data.site_xpos[self._sites] - self._pins
        away[:, 2] -= self._half_thickness_m
        return np.asarray(away)

    def lay(self, number: int) -> None:
        """Leave a fixed copy of the sheet where its strips are now."""
        data, model = self._data, self._model
        for i, strip in enumerate(self._strips):
            mocap = model.body_mocapid[model.body(laid_body(number, i)).id]
            # A strip's centre of mass is its plate's middle; the simulated model has no plates.
            data.mocap_pos[mocap] = data.xipos[strip]
            data.mocap_quat[mocap] = data.xquat[strip]


def _power_of_two(needed: float) -> int:
    """Return the least power of two that is not less, up to `_MOST_PARTS`."""
    parts = 1
    while parts < needed and parts < _MOST_PARTS:
        parts *= 2
    return parts
