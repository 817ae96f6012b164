"""What a scenario that names another arm takes back of the one that it extends.

Where a base stands, its home and its servos' stiffness belong to one kind of arm. A file or a
setting that changes the arm of a side so takes back what the extended file says of them, before
anything that it gives itself.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import msgspec

from dualbend.scene.cell import PlacementConfig
from dualbend.types import SIDES

_PLACEMENT = tuple(field.encode_name for field in msgspec.structs.fields(PlacementConfig))
_STIFFNESS = "stiffness_n_m_per_rad"


def without_other_arms(base: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """Return the table ``base`` without what belongs to arms that ``over`` changes.

    Where one side keeps its arm, what stood for both stays for that side.
    """
    before, after = _table(base, "arm"), _table(over, "arm")
    both = {**before, **after}
    changed = [side for side in SIDES if _of(before, side) != _of(both, side)]
    merged = dict(base)
    if not changed:
        return merged
    cell = dict(_table(base, "cell"))
    common = {key: cell.pop(key) for key in _PLACEMENT if key in cell}
    for side in SIDES:
        own = {**common, **_table(cell, side)}
        cell.pop(side, None)
        if side not in changed and own:
            cell[side] = own
    if cell or "cell" in base:
        merged["cell"] = cell
    if _STIFFNESS in _table(base, "servo"):
        merged["servo"] = {k: v for k, v in base["servo"].items() if k != _STIFFNESS}
    return merged


def _table(data: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    value = data.get(key)
    return value if isinstance(value, dict) else {}


def _of(arm: Mapping[str, Any], side: str) -> object:
    """Return the name of a side's arm; "none" takes an override back."""
    own = arm.get(side, "none")
    return arm.get("model", "puma560") if own == "none" else own
