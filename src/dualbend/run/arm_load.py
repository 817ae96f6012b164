"""Whether the arms can bear their work: weights against the payload, torques against the drives."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np

from dualbend.arm.mjcf import FT_SITE, GRIP_SITE
from dualbend.arm.model import PUMA, ArmModel
from dualbend.arm.pair import ArmPair
from dualbend.beam import elastica
from dualbend.beam.sheet import GRAVITY_M_PER_S2
from dualbend.errors import InputError
from dualbend.scenario.path import PiecesPathConfig, PiecewisePathConfig, TablePathConfig
from dualbend.scenario.scenario import Scenario
from dualbend.types import SIDES, Side, Vector

_PIECE_RAD, _FIRST_FORCE, _MOMENT = 0.2, 15.0, 2.0
"""On a linear piece of 0.2 rad from the flat on, the sheet pushes by up to 15 EI/L² more than in
its zero-moment shapes and turns by up to 2 EI Δα/L, both proportional to the piece; of the rod."""


def refuse_overload(
    scenario: Scenario, arms: ArmPair, robots: mujoco.MjModel, poses: Vector
) -> None:
    """Refuse arms that cannot bear gripper and sheet at the path's joint angles (k, n).

    Statics: gravity of arm and tool, half the sheet's weight, its end force and the moment of the
    first piece at the grip must stay below every joint's torque limit. Weights alone are compared
    with the rated payload. InputError names the arm, the joint and both numbers.
    """
    data, load = mujoco.MjData(robots), sheet_load(scenario)
    for side, placed in zip(SIDES, arms, strict=True):
        carried = scenario.task.carried_share * scenario.sheet.sheet().mass_kg
        refuse_payload(robots, side, placed.model, carried, "its share of the sheet")
        limits = np.array(placed.model.torque_limit_n_m)
        needed = np.zeros(placed.model.count)
        for q in poses:
            data.qpos[:] = q
            mujoco.mj_forward(robots, data)
            asked = np.abs(_held(robots, data, side, load))[:, arms.joints(side)]
            needed = np.maximum(needed, asked.max(axis=0))
            if placed.model.name != PUMA:
                _refuse_contact(robots, data)
        worst = int(np.argmax(needed / limits))
        if needed[worst] > limits[worst]:
            raise InputError(
                f"arm {placed.model.name!r} on the {side} is too weak: to hold gripper and sheet, "
                f"{placed.model.joint_names[worst]} needs {needed[worst]:.1f} "
                f"{'N' if placed.model.slides[worst] else 'N m'}, its limit is "
                f"{limits[worst]:.1f}"
            )


def sheet_load(scenario: Scenario) -> Vector:
    """Return the largest wrench of the sheet on a grip, x, z [N] and about y [N m], (3,)."""
    sheet = scenario.sheet.sheet()
    # Of a sheet whose thickness varies that of its stiffest section: no less is asked for.
    thickest = max((t for _, t in sheet.profile), default=sheet.thickness_m)
    stiffest, length = replace(sheet, thickness_m=thickest, profile=()), sheet.length_m
    stiffness = stiffest.bending_stiffness_nm2
    path, interval = scenario.path, _longest_piece(scenario)
    share = min(interval / _PIECE_RAD, 1.0)
    force = elastica.end_force(path.end_rad, stiffness, length)
    if path.start_rad < interval * (1.0 - 1e-9):  # a rounding error is no way from the flat
        force += _FIRST_FORCE * share * stiffness / length**2
    moment = _MOMENT * stiffness * share * _PIECE_RAD / length
    moment += stiffness * abs(sheet.rest_curvature_per_m)
    return np.array([force, 0.5 * sheet.mass_kg * GRAVITY_M_PER_S2, moment])


def _longest_piece(scenario: Scenario) -> float:
    """Return the end slope [rad] of the longest straight piece; 0 of a path that has none."""
    path = scenario.path
    straight = isinstance(path, TablePathConfig) and not path.smooth
    if straight or isinstance(path, PiecewisePathConfig | PiecesPathConfig):
        return float(np.diff(path.make(scenario.sheet.length_m).knots).max())
    return 0.0


def _held(model: mujoco.MjModel, data: mujoco.MjData, side: Side, load: Vector) -> Vector:
    """Return the torques (2, nv) that hold the arms and the load, its moment with either sign."""
    site = model.site(f"{side}_{GRIP_SITE}").id
    translation, rotation = np.zeros((2, 3, model.nv))
    mujoco.mj_jacSite(model, data, translation, rotation, site)
    outward = -np.sign(data.site_xmat[site][0]) * np.array([1.0, 0.0, 0.0])
    across = data.site_xmat[site].reshape(3, 3)[:, 1]
    force = load[0] * outward - load[1] * np.array([0.0, 0.0, 1.0])
    carried = data.qfrc_bias - translation.T @ force
    turned = load[2] * rotation.T @ across
    return np.stack((carried - turned, carried + turned))


def refuse_payload(
    robots: mujoco.MjModel, side: Side, arm: ArmModel, carried_kg: float, said: str
) -> None:
    """Refuse what an arm carries besides its gripper, as it is ``said``, above its payload."""
    tool = float(robots.body_subtreemass[robots.site(f"{side}_{FT_SITE}").bodyid[0]])
    sensor = float(robots.body(f"{side}_sensor").mass[0])
    # A payload that was computed from the torques says no more than they do along the path.
    if arm.rated and tool + sensor + carried_kg > arm.payload_kg:
        raise InputError(
            f"arm {arm.name!r} on the {side} is too weak: gripper with sensor "
            f"{tool + sensor:.2f} kg and {said} {carried_kg:.2f} kg are above its "
            f"payload of {arm.payload_kg:g} kg"
        )


def _refuse_contact(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    if data.ncon:
        first, second = (model.body(model.geom_bodyid[geom]).name for geom in data.contact[0].geom)
        raise InputError(
            f"on the path {first} touches {second}: look at cell.base_distance_m, "
            "cell.base_lateral_m, cell.base_height_m"
        )
