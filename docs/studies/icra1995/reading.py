"""The readings of the paper that the scan tries: what it leaves open, and the values taken."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from pathlib import Path

import msgspec

from dualbend.control.compliance.admittance import DEG_PER_RAD, MM_PER_M
from dualbend.scenario.load import load_scenario
from dualbend.scenario.scenario import Scenario
from icra1995.row import PAPER

STRIP = {name: str(Path(__file__).with_name(f"strip-{name}.toml")) for name in ("fig6", "fig8")}
"""Scenarios of the reading that the scan found, on which the others are settings."""

SHEETS: dict[str, tuple[float, float, float]] = {
    "400x20x0.5": (0.4, 0.02, 0.0005),
    "400x57x0.5": (0.4, 0.057, 0.0005),
    "400x120x0.5": (0.4, 0.12, 0.0005),
    "600x100x1": (0.6, 0.1, 0.001),
    "600x200x0.5": (0.6, 0.2, 0.0005),
    "610x457x0.8": (0.61, 0.457, 0.0008),
}
"""Length, width and thickness [m]; the name has them in mm."""

FORMS = ("printed", "impulse-invariant", "static")
LENGTHS, ANGLES = ("mm", "m"), ("deg", "rad")
STARTS_RAD = (0.0, 0.2)
ROBOTS: dict[str, tuple[float, float]] = {"2Hz/0.995": (2.0, 0.995), "3Hz/0.9": (3.0, 0.9)}
DELAYS = (0, 2, 4)
FILTERS: dict[str, tuple[str, str]] = {
    "fir2": ("fir", "filter.taps=2"),
    "fir5": ("fir", "filter.taps=5"),
    "iir2": ("iir", "filter.order=2"),
}


class Reading(msgspec.Struct, frozen=True, kw_only=True):
    """One way to complete what the paper leaves open; the words are keys of the tables above.

    ``length`` and ``angle``: the units of B and K; ``start_rad``: from where the compliance acts;
    ``delay``: transport delay [command periods].
    """

    sheet: str
    form: str
    length: str
    angle: str
    start_rad: float
    robot: str
    delay: int
    low_pass: str

    def settings(self, b_factor: float = 1.0) -> list[str]:
        """Return the ``--set`` arguments that make Fig. 8 this reading, B times a factor."""
        length, width, thickness = SHEETS[self.sheet]
        hertz, ratio = ROBOTS[self.robot]
        kind, size = FILTERS[self.low_pass]
        # N s/m is a thousandth as many N s/mm, and a radian is 57.3 degrees.
        x = 1.0 if self.length == "mm" else 1.0 / MM_PER_M
        turn = 1.0 if self.angle == "deg" else 1.0 / DEG_PER_RAD
        gains = {
            "x.b": PAPER.b_x * b_factor * x,
            "x.k": PAPER.k_x * x,
            "rotation.b": PAPER.b_rotation * b_factor * turn,
            "rotation.k": PAPER.k_rotation * turn,
        }
        return [
            f"sheet.length_m={length}",
            f"sheet.width_m={width}",
            f"sheet.thickness_m={thickness}",
            # What the arms reach: the strip's for 0.4 m, the cell's default for 0.6 m.
            f"cell.base_distance_m={1.05 if length < 0.5 else 1.075}",
            *(f"compliance.{name}={value!r}" for name, value in gains.items()),
            *(f'compliance.{axis}.form="{self.form}"' for axis in ("x", "rotation")),
            *(f"compliance.{axis}.from_alpha_rad={self.start_rad}" for axis in ("x", "rotation")),
            f"robot.response.natural_frequency_hz={hertz}",
            f"robot.response.damping_ratio={ratio}",
            f"robot.alter.delay_cycles={self.delay}",
            f'filter.kind="{kind}"',
            "filter.cutoff_hz=10.0",
            size,
        ]

    def scenario(self, b_factor: float = 1.0) -> Scenario:
        """Return the scenario of Fig. 8 (or of Fig. 9, with a smaller factor on B)."""
        return load_scenario(STRIP["fig8"], self.settings(b_factor))

    def without_compliance(self, *, exact: bool = False) -> Scenario:
        """Return the scenario of Fig. 6, or of the exact path."""
        settings = ["imperfections=none", "robot.servo.integral=none", *self.settings()[:4]]
        return load_scenario("exact" if exact else STRIP["fig6"], settings)


def readings() -> Iterator[Reading]:
    """Yield all readings of the scan, the loop's own choices varying fastest."""
    for sheet, form, length, angle, start, robot, delay, low_pass in itertools.product(
        SHEETS, FORMS, LENGTHS, ANGLES, STARTS_RAD, ROBOTS, DELAYS, FILTERS
    ):
        yield Reading(
            sheet=sheet,
            form=form,
            length=length,
            angle=angle,
            start_rad=start,
            robot=robot,
            delay=delay,
            low_pass=low_pass,
        )
