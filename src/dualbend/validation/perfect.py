"""The cell that theory speaks of: nothing is wrong in it, and the joints' servos are springs."""

from __future__ import annotations

from collections.abc import Sequence

from dualbend.scenario.load import load_scenario
from dualbend.scenario.scenario import Scenario

PERFECT = ("imperfections=none",)
"""What a comparison with theory asks of the cell."""


def perfect_scenario(name: str, settings: Sequence[str] = ()) -> Scenario:
    """Return a scenario without imperfections and without integral action of the servos.

    ``settings`` are changed besides. Integral action hides what the stiffness of the arms does.
    """
    return load_scenario(name, (*PERFECT, "robot.servo.integral=none", *settings))
