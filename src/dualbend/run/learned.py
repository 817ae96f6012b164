"""The file of what was learned: a correction over time, and what it belongs to.

JSON: ``format``; ``scenario``, ``seed`` and ``sheets`` that it was learned on; ``force_n``, the
force along x in the hold of the sheets that taught it [N]; ``period_s`` of its values [s];
``correction_rad``, the turn that is added to each arm's path at every command cycle [rad];
``friction_ratio``, true over believed Coulomb friction of the left and then the right arm's joints;
``belongs_to``, the scenario's sections without which it is another motion's.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np

from dualbend.errors import InputError, refusing
from dualbend.run.arms import side_arm, with_placements
from dualbend.run.reading.json_file import file_bytes, read_json
from dualbend.scenario.motion import MotionConfig, NominalMotion, nominal_motion
from dualbend.scenario.scenario import Scenario, without_none
from dualbend.types import SIDES, Config, Side, Vector

_SECTIONS = ("path", "motion", "robot", "sheet", "cell", "grasp", "compliance", "task")

_Turn = Annotated[float, msgspec.Meta(ge=-0.5, le=0.5)]
_Ratio = Annotated[float, msgspec.Meta(ge=0.0, le=10.0)]


class LearnedFile(Config):
    """What was learned, as :func:`read_learned` reads it."""

    format: Literal["dualbend learned correction 1"] = "dualbend learned correction 1"
    scenario: str
    seed: int
    sheets: Annotated[int, msgspec.Meta(ge=1)]
    force_n: float
    period_s: float
    belongs_to: dict[str, dict[str, Any]]
    correction_rad: dict[Side, list[_Turn]]
    friction_ratio: list[_Ratio] | None = None

    @property
    def correction(self) -> Vector:
        """The correction (2, cycles) [rad] of the left and the right arm."""
        return np.array([self.correction_rad[side] for side in SIDES])

    @property
    def friction(self) -> Vector | None:
        """The friction ratio (n,) of all joints [-]; None: as it is believed."""
        return None if self.friction_ratio is None else np.array(self.friction_ratio)

    def to_json(self) -> str:
        """Return the text of the file."""
        return msgspec.json.format(msgspec.json.encode(self), indent=1).decode() + "\n"

    def motion(self, scenario: Scenario) -> NominalMotion:
        """Return the motion that it was learned on; InputError where it is of another scenario."""
        self.refuse_other(scenario, any_speed=True)
        with refusing("belongs_to.motion", msgspec.ValidationError):
            config = msgspec.convert(self.belongs_to.get("motion"), MotionConfig)
        motion = nominal_motion(scenario.path, config, scenario.sheet.length_m, scenario.period_s)
        if self.correction.shape[-1] != motion.cycles:
            raise InputError(
                f"correction_rad has {self.correction.shape[-1]} values; the motion has "
                f"{motion.cycles} cycles"
            )
        return motion

    def refuse_other(self, scenario: Scenario, *, any_speed: bool = False) -> None:
        """Raise InputError, with the key, where it was learned on another sheet, arm or motion.

        ``any_speed``: the motion may be another one.
        """
        if self.period_s != scenario.period_s:
            raise InputError(
                f"period_s = {self.period_s}: must be {scenario.period_s}, the command period"
            )
        joints = sum(side_arm(scenario, side).count for side in SIDES)
        if self.friction_ratio is not None and len(self.friction_ratio) != joints:
            raise InputError(
                f"friction_ratio has {len(self.friction_ratio)} values; the arms have {joints} "
                "joints"
            )
        for section, asked in belongings(scenario).items():
            if any_speed and section == "motion":
                continue
            change = _change(self.belongs_to.get(section, {}), asked, section)
            if change is not None:
                key, old, new = change
                raise InputError(
                    f"was learned with {key} = {_shown(old)}, and here it is {_shown(new)}; "
                    "learn again: dualbend learn"
                )


def read_learned(path: Path, named: str = "") -> LearnedFile:
    """Return what a file holds; InputError where it is no file of what was learned.

    ``named``: what the message calls it, if not by its path.
    """
    found = read_json(path, LearnedFile, "correction that dualbend learn wrote", named)
    with refusing(named or str(path)):
        lengths = {len(values) for values in found.correction_rad.values()}
        if set(found.correction_rad) != set(SIDES) or len(lengths) != 1:
            raise InputError(
                "correction_rad needs as many values for the left as for the right arm"
            )
    return found


def read_for(scenario: Scenario) -> tuple[LearnedFile, str]:
    """Return what the file holds that ``path.learned`` names, and how a record names it.

    Raises InputError where there is no such file, or it belongs to something else.
    """
    path = Path(str(scenario.path.learned))
    named = f"path.learned = {str(path)!r}"
    found = read_learned(path, named)
    with refusing(named):
        found.refuse_other(scenario)
        found.motion(scenario)
        sha256 = hashlib.sha256(file_bytes(path)).hexdigest()
    told = "" if found.friction_ratio is None else ", friction of the joints"
    return found, f"{path.name}, {found.sheets} sheets{told}, sha256 {sha256}"


def belongings(scenario: Scenario) -> dict[str, dict[str, Any]]:
    """Return the sections that a correction belongs to, the arms' places written in."""
    tables = msgspec.to_builtins(with_placements(scenario))
    tables["path"].pop("learned", None)
    found: dict[str, dict[str, Any]] = without_none({key: tables[key] for key in _SECTIONS})
    # As JSON gives them back: lists for tuples.
    return msgspec.json.decode(msgspec.json.encode(found), type=dict[str, dict[str, Any]])


def _change(old: object, new: object, key: str) -> tuple[str, object, object] | None:
    """Return the first key whose value differs, and both values; None where none does."""
    if isinstance(old, dict) and isinstance(new, dict):
        for name in {**new, **old}:
            found = _change(old.get(name), new.get(name), f"{key}.{name}")
            if found is not None:
                return found
        return None
    return None if old == new else (key, old, new)


def _shown(value: object) -> str:
    return "not given" if value is None else repr(value)
