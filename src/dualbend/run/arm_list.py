"""The arms that a scenario may name, as a table, and what each makes of a scenario."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import msgspec

from dualbend.arm.catalog import JOINT_COUNT
from dualbend.arm.joint_limits import joint_limit_margins
from dualbend.arm.model import arm_model
from dualbend.errors import InputError
from dualbend.run.make import make_run
from dualbend.scenario.load import load_scenario
from dualbend.table import Code, Table, quantity

_LISTED = (
    *("name", "joint_names", "payload_kg", "reach_m", "range_rad", "speed_limit_rad_per_s"),
    *("torque_limit_n_m", "armature_kg_m2", "viscous_n_m_s_per_rad", "coulomb_n_m"),
    *("stiffness_n_m_per_rad", "source", "grade", "assumed"),
)


def arm_table() -> list[dict[str, Any]]:
    """Return what is known of each arm; ``missing`` says why an arm's data cannot be read."""
    rows: list[dict[str, Any]] = []
    for name, joints in JOINT_COUNT.items():
        try:
            model = arm_model(name)
        except InputError as error:
            rows.append({"name": name, "joints": joints, "missing": str(error)})
            continue
        known = {key: getattr(model, key) for key in _LISTED}
        rows.append({**known, "joints": model.count, "placed": model.placement is None})
    return rows


def evaluate_arms(
    scenario: str, settings: Sequence[str] = (), names: Iterable[str] | None = None
) -> Iterator[dict[str, Any]]:
    """Yield for each arm, on both sides, what becomes of a scenario: its place, or why not.

    ``names``: shipped arms or arms' files; None: all that are shipped.

    An arm that the scenario names for one side alone is replaced, too.

    ``room`` has manipulability and room to the limits by side, ``cell`` where the bases stand,
    ``refused`` the reason of an arm that cannot do it.
    """
    for name in JOINT_COUNT if names is None else names:
        both = (f'robot.model="{name}"', "robot.left.model=none", "robot.right.model=none")
        try:
            ready = make_run(load_scenario(scenario, (*settings, *both)))
        except InputError as error:
            yield {"name": name, "refused": str(error)}
            continue
        yield {
            "name": name,
            "cell": msgspec.to_builtins(ready.scenario.cell),
            "room": msgspec.to_builtins(joint_limit_margins(ready.cell.arms, ready.checked_poses)),
        }


def table_text(rows: Sequence[dict[str, Any]]) -> str:
    """Return the table of :func:`arm_table` for people."""
    lines: list[tuple[object, ...]] = []
    for row in rows:
        if "missing" in row:
            lines.append((row["name"], row["joints"], "", "", row["missing"]))
            continue
        reach, payload = f"{row['reach_m']:.3g} m", f"{row['payload_kg']:.3g} kg"
        lines.append((row["name"], row["joints"], reach, payload, row["source"]))
        lines += [("", "", "", "", note) for note in _grade(row)]
    numbers = [quantity(name) for name in ("joints", "reach", "payload")]
    return Table(["name", *numbers, "source; grade"], lines).text()


def table_markdown(rows: Sequence[dict[str, Any]]) -> str:
    """Return the table of :func:`arm_table` for the documentation."""
    columns = (
        *("arm", "joints", "reach", "payload"),
        *("servo stiffness, base to flange", "source", "grade"),
    )
    lines = [
        (
            *(Code(row["name"]), row["joints"]),
            *(f"{row['reach_m']:g} m", f"{row['payload_kg']:g} kg"),
            f"{' '.join(f'{1e-3 * k:.3g}' for k in row['stiffness_n_m_per_rad'])} kN m/rad",
            *(row["source"], "; ".join(_grade(row))),
        )
        for row in rows
        if "missing" not in row
    ]
    return Table(columns, lines).markdown()


def _grade(row: dict[str, Any]) -> list[str]:
    return [row["grade"], *(f"assumed: {text}" for text in row["assumed"])]


def verdict_text(row: dict[str, Any]) -> str:
    """Return a row of :func:`evaluate_arms` for people: the base, and the worse of both rooms."""
    name = Path(row["name"]).name
    if "refused" in row:
        return f"{name:<8} no: {row['refused']}"
    stand, base = row["cell"], "base"
    if stand["base_distance_m"] is None:  # the arms stand differently
        stand, base = stand["left"], "left base"
    rooms = list(row["room"].values())
    manipulability = min(room["manipulability"] for room in rooms)
    tight = min(rooms, key=lambda room: float(room["room_deg"]))
    return (
        f"{name:<8} {base} {stand['base_distance_m']:.3f} m behind, "
        f"{stand['base_lateral_m']:+.3f} m beside, {stand['base_height_m']:.3f} m up, "
        f"yaw {stand['base_yaw_rad']:+.3f}; manipulability {manipulability:.2f}, "
        f"{tight['room_deg']:.0f} degrees of room ({tight['joint']})"
    )
