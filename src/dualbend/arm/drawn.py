"""What both readers of files make of one: an arm alone, and what is said of its joints."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco


@dataclass(frozen=True, kw_only=True, eq=False)
class Drawn:
    """An arm cut out of its file.

    Attributes
    ----------
    spec : bodies ``base``, ``link1`` ... ``link<n>`` and bodies fixed to them, joints ``joint1``
        ... ``joint<n>``, shapes and meshes as the file has them
    flange : the body that carries the tool
    stubs : links that move and have no mass in the file
    """

    spec: mujoco.MjSpec
    flange: str
    stubs: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class JointLimits:
    """Torque [N m] or force [N] and speed [rad/s] or [m/s] limits (n,); 0 where none is said.

    ``armature`` (n,): inertia of the rotors [kg m²] or [kg].
    """

    torque_n_m: tuple[float, ...]
    speed_rad_per_s: tuple[float, ...]
    armature_kg_m2: tuple[float, ...] = ()
