"""The section ``[imperfections]``: what the cell does wrong that nobody in it knows of.

``imperfections = "typical"`` takes the numbers of a preset; keys of its sections stand before the
preset's. What is drawn is drawn from the scenario's seed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal

import msgspec

from dualbend.imperfection.events import EventsConfig
from dualbend.imperfection.link import LinkConfig
from dualbend.imperfection.robot import RobotErrors
from dualbend.imperfection.sensor import SensorErrors
from dualbend.imperfection.sheet import SheetErrors
from dualbend.types import Config, said

PresetName = Literal["none", "typical", "worst"]

SECTIONS: Final = ("robot", "sensor", "link", "sheet", "events")


class ImperfectionsConfig(Config):
    """What robots, sensors, link and sheet do wrong, and what happens to them during a run."""

    preset: Annotated[
        PresetName,
        said("numbers of what is not given; docs/imperfections.md", extra={"replaces": SECTIONS}),
    ] = "none"
    robot: RobotErrors = RobotErrors()
    sensor: SensorErrors = SensorErrors()
    link: LinkConfig = LinkConfig()
    sheet: SheetErrors = SheetErrors()
    events: EventsConfig = EventsConfig()


Numbers = Mapping[str, Mapping[str, Any]]
"""Keys and values of some sections of the imperfections."""

PRESETS: Final[Mapping[PresetName, Mapping[str, Numbers]]] = {
    "none": {},
    "typical": {
        "joint friction": {
            "robot": {"coulomb_spread": 0.15, "viscous_spread": 0.2, "stiction_excess": 0.1}
        },
        "masses of the arms": {"robot": {"link_mass_spread": 0.02, "tool_mass_spread": 0.01}},
        "joint zeros": {"robot": {"zero_spread_rad": 2e-4}},
        "bases": {"robot": {"base_spread_m": 3e-4, "base_spread_rad": 3e-4}},
        "sensor accuracy": {"sensor": {"scale_spread": 0.005, "cross_talk_spread": 0.005}},
        "sensor drift": {
            "sensor": {
                "force_drift_spread_n_per_h": 0.5,
                "torque_drift_spread_nm_per_h": 0.04,
                "force_walk_n": 0.1,
                "torque_walk_nm": 0.008,
                "zeroed_before_s": 600.0,
            }
        },
        "believed tool": {
            "sensor": {
                "tool_mass_spread": 0.01,
                "tool_centre_spread_m": 0.001,
                "weight_place_spread_m": 1e-4,
            }
        },
        "command link": {
            "link": {"jitter_s": 0.002, "lost_probability": 5e-4, "doubled_probability": 5e-4}
        },
        "believed sheet": {
            "sheet": {
                "thickness_spread": 0.02,
                "modulus_spread": 0.01,
                "curvature_spread_per_m": 0.02,
            }
        },
    },
    "worst": {
        "joint friction": {
            "robot": {
                "coulomb_ratio": 1.25,
                "coulomb_spread": 0.25,
                "viscous_ratio": 1.5,
                "viscous_spread": 0.3,
                "stiction_excess": 0.5,
            }
        },
        "masses of the arms": {
            "robot": {"link_mass_spread": 0.05, "tool_mass_ratio": 1.1, "tool_mass_spread": 0.02}
        },
        "joint zeros": {"robot": {"zero_spread_rad": 1e-3}},
        "bases": {"robot": {"base_spread_m": 1e-3, "base_spread_rad": 1e-3}},
        "sensor accuracy": {"sensor": {"scale_spread": 0.01, "cross_talk_spread": 0.01}},
        "sensor drift": {
            "sensor": {
                "force_drift_spread_n_per_h": 2.0,
                "torque_drift_spread_nm_per_h": 0.15,
                "force_walk_n": 0.4,
                "torque_walk_nm": 0.03,
                "zeroed_before_s": 3600.0,
            }
        },
        "believed tool": {
            "sensor": {
                "tool_mass_spread": 0.05,
                "tool_centre_spread_m": 0.005,
                "weight_place_spread_m": 3e-4,
            }
        },
        "sensor records": {
            "sensor": {
                "dropout_probability": 0.01,
                "dropout_cycles": 2,
                "spike_probability": 0.001,
                "spike_force_n": 5.0,
                "spike_torque_nm": 0.3,
            }
        },
        "command link": {
            "link": {
                "jitter_s": 0.005,
                "late_probability": 0.01,
                "lost_probability": 0.005,
                "doubled_probability": 0.005,
            }
        },
        "believed sheet": {
            "sheet": {
                "thickness_spread": 0.05,
                "modulus_spread": 0.03,
                "curvature_spread_per_m": 0.1,
            }
        },
    },
}
"""Numbers of each preset by imperfection; their sources: docs/imperfections.md."""


def with_preset(table: Mapping[str, Any]) -> dict[str, Any]:
    """Return a section's table with the numbers of its preset where it gives none."""
    resolved = dict(table)
    name = resolved.get("preset", "none")
    # What is no name, and may be no key, is refused with the rest of the section.
    for numbers in PRESETS.get(name if name in list(PRESETS) else "none", {}).values():
        for section, values in numbers.items():
            given = resolved.get(section, {})
            if isinstance(given, Mapping):
                resolved[section] = {**values, **given}
    return resolved


def alone(name: PresetName) -> dict[str, ImperfectionsConfig]:
    """Return no imperfection ("none"), each of a preset by itself, and "all" of them."""
    every = with_preset({"preset": name})
    del every["preset"]
    tables: dict[str, Numbers] = {"none": {}, **PRESETS[name], "all": every}
    return {part: msgspec.convert(table, ImperfectionsConfig) for part, table in tables.items()}
