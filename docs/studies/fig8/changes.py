"""What is changed, one thing at a time, in ``fig6`` and ``fig8`` alike."""

from __future__ import annotations

import msgspec


class Change(msgspec.Struct, frozen=True):
    """A change of the scenario; ``limit``: what the worst ratio of peaks may be with it."""

    name: str
    settings: tuple[str, ...] = ()
    limit: float = 0.78


NOMINAL = Change("as shipped")
_LEFT = ('compliance.sensing=["left"]', 'compliance.complying=["left"]')


def _scaled(what: str, key: str, values: dict[str, float]) -> tuple[Change, ...]:
    return tuple(Change(f"{what} {said}", (f"{key}={value!r}",)) for said, value in values.items())


SLOPES = tuple(
    Change(
        f"both slopes {said}",
        tuple(f"task.misalignment.{side}.pitch_rad={rad}" for side in ("left", "right")),
        limit=0.85,
    )
    for said, rad in (("− 5 mrad", -5e-3), ("+ 5 mrad", 5e-3))
)

CHANGES: tuple[Change, ...] = (
    NOMINAL,
    *_scaled("width", "sheet.width_m", {"− 20 %": 0.24, "+ 20 %": 0.36}),
    # Placed as the shipped one is: half the length and 0.69 m between the bases.
    Change("length − 20 %", ("sheet.length_m=0.64", "cell.base_distance_m=1.01")),
    Change("length + 20 %", ("sheet.length_m=0.96", "cell.base_distance_m=1.17")),
    *_scaled("thickness", "sheet.thickness_m", {"− 10 %": 0.0009, "+ 10 %": 0.0011}),
    *_scaled("speed", "motion.speed_rad_per_s", {"halved": 0.05, "doubled": 0.2}),
    *_scaled("delay", "robot.alter.delay_cycles", {f"{n} cycles": n for n in (0, 1, 3, 4)}),
    *_scaled("response", "robot.response.natural_frequency_hz", {"2 Hz": 2, "3 Hz": 3, "4 Hz": 4}),
    Change("one sensor, the other arm mirrors", (_LEFT[0],)),
    Change("one arm senses and complies", _LEFT),
    Change("a beam's rigidity", ("sheet.rigidity=beam",)),
    Change("a plate's rigidity", ("sheet.rigidity=plate",)),
    *_scaled(
        "Coulomb friction over the fed forward one",
        "imperfections.robot.coulomb_ratio",
        {"0.5": 0.5, "0.75": 0.75, "1.25": 1.25, "1.5": 1.5},
    ),
    *_scaled(
        "left grip along the sheet",
        "task.misalignment.left.along_m",
        {"− 0.3 mm": -3e-4, "+ 0.3 mm": 3e-4},
    ),
    *_scaled(
        "both bases along the sheet",
        "imperfections.robot.base_x_m",
        {"− 0.3 mm": -3e-4, "+ 0.3 mm": 3e-4},
    ),
    *SLOPES,
    Change("no imperfections", ("imperfections=none",)),
    Change("worst imperfections", ("imperfections=worst",)),
)

CONTROLLED: tuple[Change, ...] = (NOMINAL, *SLOPES)
"""With which constants are put in the controller's place."""
