"""The PUMA 560 and the gripper of every arm as MuJoCo specifications, and the names in them."""

from typing import Final

import mujoco

from dualbend.resources import models_dir

JAW_JOINTS: Final = ("jaw_upper", "jaw_lower")
"""Slide joints of the gripper: 0 closed, 0.015 m open, each."""

FLANGE_SITE: Final = "flange"
"""Mounting face of an arm, z outward; the PUMA's has the axes of DH frame 6."""

GRIP_SITE: Final = "grip"
"""Gripper centre with the axes of the grip frame G."""

FT_SITE: Final = "ft_site"
"""Measuring point of the force/torque sensor, axes parallel to the grip frame."""

FT_SENSORS: Final = ("ft_force", "ft_torque")
"""MuJoCo sensors at `FT_SITE`: what the arm exerts on the tool, so minus the wrench on the arm."""

LEVER_ARM_M: Final = 0.120
"""Distance from `FT_SITE` to `GRIP_SITE` along x of both [m]."""


def load_puma() -> mujoco.MjSpec:
    """Return a fresh specification of one PUMA 560 without actuators or gripper.

    The frame of ``base`` is DH frame 0, on the shoulder axis; ``flange`` is where a tool attaches.
    Gravity compensation reaches the joints only in a model with at least one actuator.
    """
    return mujoco.MjSpec.from_file(str(models_dir() / "puma560" / "puma560.xml"))


def load_gripper() -> mujoco.MjSpec:
    """Return a fresh specification of the force/torque sensor with the parallel gripper.

    Attach it with ``arm.attach(gripper, site="flange", prefix=...)``.
    """
    return mujoco.MjSpec.from_file(str(models_dir() / "gripper" / "gripper.xml"))


def with_gripper(arm: mujoco.MjSpec) -> mujoco.MjSpec:
    """Return one arm with sensor and gripper at its flange, the jaws fixed: prefix ``tool_``."""
    tool = load_gripper()
    arm.attach(tool, site=FLANGE_SITE, prefix="tool_")
    for jaw in JAW_JOINTS:
        arm.delete(arm.joint(f"tool_{jaw}"))
    return arm
