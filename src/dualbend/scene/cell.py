"""The robot cell as MuJoCo specifications: arms, tools, pads, sheet, one servo actuator a joint."""

from __future__ import annotations

from functools import lru_cache
from typing import Annotated

import msgspec
import mujoco
import numpy as np

from dualbend.arm import mjcf as arm
from dualbend.arm.pair import ArmPair
from dualbend.arm.placement import COLUMN_FROM_M, COLUMN_RADIUS_M
from dualbend.beam.sheet import Sheet
from dualbend.control.servo import JointServo
from dualbend.scene.bed.config import LayoutConfig
from dualbend.scene.bed.holes import add_holes
from dualbend.scene.bed.mjcf import add_workplace
from dualbend.scene.contacts import FLOOR, GRIPPING, let_arms_touch
from dualbend.scene.mjcf import BOX, DRAWN, SITE, add_floor_and_sky
from dualbend.scene.sheet.shell import ShellConfig, add_shell
from dualbend.scene.sheet.strips import LEFT_END, RIGHT_END, StripConfig, add_sheet
from dualbend.types import SIDES, Config, Side, said

PAD_SITE = "pad"
_WELD_TIME_S, _WELD_TORQUE_SCALE_M = 5e-4, 10.0
"""Time constant [s] and moment arm [m] of the weld that holds the sheet's edge."""

_HOLD_WEIGHT = 10.0, 1e-3
"""Mass [kg] and inertia [kg m²] by which MuJoCo is to scale both sides of a hold."""

PAD_LENGTH_M, PAD_WIDTH_M = 0.020, 0.060
"""Of a rubber pad, along the sheet and across it."""

_JAW_STIFFNESS_N_PER_M, _JAW_FORCE_N = 2e4, 40.0


class PlacementConfig(Config):
    """Where one arm stands, by hand; what is not given is as for both arms."""

    base_distance_m: (
        Annotated[float, said("base axis to the mid-plane, along x_B", ge=0, lt=3)] | None
    ) = None
    base_lateral_m: (
        Annotated[float, said("base axis off the bending plane, along y_B", ge=-1, le=1)] | None
    ) = None
    base_height_m: (
        Annotated[float, said("base frame's origin above the floor", ge=0, lt=3)] | None
    ) = None
    base_yaw_rad: (
        Annotated[float, said("base frame about the vertical, from x_B", ge=-7, le=7)] | None
    ) = None
    base_roll_rad: (
        Annotated[float, said("base frame turned about x_B, first; none: upright", ge=-3.2, le=3.2)]
        | None
    ) = None
    base_pitch_rad: (
        Annotated[float, said("then about y_B; 1.5708 on a wall behind", ge=-3.2, le=3.2)] | None
    ) = None
    home_rad: (
        Annotated[
            tuple[Annotated[float, msgspec.Meta(ge=-1e3, le=1e3)], ...],
            said(
                "joint angles near the start: the branch of solutions, and the posture "
                "that a redundant arm keeps",
                min_length=6,
                max_length=20,
            ),
        ]
        | None
    ) = None


class CellConfig(PlacementConfig):
    """Where the arms and the sheet stand, in the world (z up, x from the left to the right arm).

    What is not given is as documented for the arm (the PUMA's: 1.075, 0.15005, 0.672 m, no yaw), or
    found for the sheet and its path.
    """

    sheet_height_m: Annotated[float, said("flat sheet above the floor", gt=0, lt=3)] = 0.672
    left: PlacementConfig | None = None
    right: PlacementConfig | None = None


class GraspConfig(Config):
    """Rubber pads between jaw and sheet, as one linear bushing at the gripper centre.

    Two pads of 60 x 20 x 3 mm, G = 1.2 MPa, confined E = 10 MPa (assumed): shear 2 G A / t =
    0.96e6 N/m, tilt about the bending axis 2 E w l³ / (12 t) = 267 N m/rad. One stiffness serves
    all three directions; across the sheet the pads would be some eight times stiffer.
    """

    translational_stiffness_n_per_m: Annotated[
        float, said("of the pads along x, y and z", ge=1, le=1e12)
    ] = 0.96e6
    rotational_stiffness_n_m_per_rad: Annotated[
        float, said("of the pads about x, y and z", ge=1e-3, le=1e9)
    ] = 267.0
    loss_time_s: Annotated[float, said("damping over stiffness; rubber", ge=0, le=0.1)] = 1.6e-3
    friction: (
        Annotated[float, said("of the pads on the sheet; none: it never slides [-]", ge=0.01, le=5)]
        | None
    ) = None
    normal_force_n: Annotated[float, said("of each jaw on the sheet; assumed", ge=0.1, le=1e5)] = (
        40.0
    )


def robots_only(arms: ArmPair) -> mujoco.MjSpec:
    """Return both arms with their tools and nothing else: no jaws, for IK and inertia."""
    spec = mujoco.MjSpec()
    spec.modelname, spec.compiler.degree = "dualbend robots", False
    for side in SIDES:
        _add_arm(spec, arms, side, looks=False)
        for joint in arm.JAW_JOINTS:
            spec.delete(spec.joint(f"{side}_{joint}"))
    return spec


def compose_cell(
    cell: CellConfig,
    arms: ArmPair,
    grasp: GraspConfig,
    sheet: Sheet,
    division: StripConfig | ShellConfig,
    servo: JointServo,
    step_s: float,
    layout: LayoutConfig | None = None,
    laid_sheets: int = 0,
    *,
    looks: bool = True,
) -> mujoco.MjSpec:
    """Return the whole scene: floor, two arms with servos and tools, the sheet held by both.

    With a layout, the grippers' jaws are driven, the sheet has holes and is held by nobody yet, and
    bed, pins and stand are there, with room for sheets that were laid before; a shell has no holes.
    Without looks, no mesh of an arm is read.
    """
    spec = mujoco.MjSpec()
    spec.modelname, spec.compiler.degree = "dualbend", False
    spec.option.timestep = step_s
    # The only integrator that treats the strips' stiffness implicitly: the highest bending mode
    # of the chain would otherwise ask for steps of 0.1 ms.
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    # With holds as hard as these the default, 1e-8, ends the solver after one iteration, and near
    # rest forces jump by up to 2 N for some steps. What it takes instead costs no time.
    spec.option.tolerance = 1e-12
    # A state that diverged must stay as it was, to be looked at. One island holds everything here,
    # and its few rows are dense: the general machinery would only cost time (14 % of a step).
    spec.option.disableflags |= int(
        mujoco.mjtDisableBit.mjDSBL_AUTORESET | mujoco.mjtDisableBit.mjDSBL_ISLAND
    )
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    _add_surroundings(spec, cell)
    for side, placed in zip(SIDES, arms, strict=True):
        _add_arm(spec, arms, side, looks=looks)
        _add_pad(spec, grasp, side)
        for i, joint in enumerate(placed.model.joints, arms.joints(side).start):
            k, c = float(servo.stiffness[i]), float(servo.damping[i])
            _add_drive(spec, f"{side}_{joint}", "servo", k, c)
    let_arms_touch(spec)
    middle = np.array([0.0, 0.0, cell.sheet_height_m])
    if isinstance(division, ShellConfig):
        add_shell(spec, sheet, division, middle)
    else:
        add_sheet(spec, sheet, division, middle)
    for side, end in zip(SIDES, (LEFT_END, RIGHT_END), strict=True):
        hold = spec.add_equality(
            name=f"{side}_hold",
            type=mujoco.mjtEq.mjEQ_WELD,
            objtype=mujoco.mjtObj.mjOBJ_SITE,
            name1=f"{side}_{PAD_SITE}",
            name2=end,
            solref=[_WELD_TIME_S, 1.0],
            solimp=[0.9999, 0.9999, 0.001, 0.5, 2.0],
            active=layout is None,
        )
        hold.data[10] = _WELD_TORQUE_SCALE_M
    if layout is not None:
        for side in SIDES:
            _add_jaw_drives(spec, side)
        assert isinstance(division, StripConfig)
        add_workplace(spec, layout, sheet, division, laid_sheets)
        add_holes(spec, sheet, division, layout)
        # Trees of boxes find the same contacts in the same order; around a pin all boxes are near.
        spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_MIDPHASE)
    return spec


def without_looks(spec: mujoco.MjSpec) -> mujoco.MjSpec:
    """Return a copy without the geoms that are only looked at: same joints, 14 % less to step."""
    bare = spec.copy()
    bare.compiler.discardvisual = True
    return bare


@lru_cache(maxsize=8)
def compiled_robots(arms: ArmPair) -> mujoco.MjModel:
    """Return :func:`robots_only` compiled, which cells of equal arms share: only to be read."""
    return without_looks(robots_only(arms)).compile()


def harden_holds(model: mujoco.MjModel) -> None:
    """Make the welds between pads and edges so hard that the sheet feels the pads alone.

    MuJoCo lets each row of a weld, along an axis of the world, yield in proportion to the inverse
    inertia of its two bodies, A: stiffness K d / (A (1 - d)) with d capped at 0.9999 and K at
    1/h², h the step. Strips of a gram would yield by 6 % of the pads along the sheet and by 12 %
    across it, so that wrenches would depend on how the cell is turned. A serves for nothing else
    on these bodies, which no contact touches; with ``_HOLD_WEIGHT`` the yield is below 1e-4.
    """
    for name in (*(f"{side}_{PAD_SITE}" for side in SIDES), LEFT_END, RIGHT_END):
        model.body_invweight0[model.site(name).bodyid] = np.reciprocal(_HOLD_WEIGHT)


def _add_arm(spec: mujoco.MjSpec, arms: ArmPair, side: Side, *, looks: bool) -> None:
    """Attach one arm with its tool; every name gets the side as a prefix."""
    origin, quat = arms.base_pose(side)
    frame = spec.worldbody.add_frame(pos=origin, quat=quat)
    model, placement = arms.of(side).model, arms.of(side).placement
    spec.attach(model.spec(looks=looks), frame=frame, prefix=f"{side}_")
    if not placement.upright:
        _add_plate(spec.body(f"{side}_base"))
    elif model.placement is None and origin[2] > COLUMN_FROM_M:
        _add_pedestal(spec.body(f"{side}_base"), float(origin[2]))
    tool = arm.load_gripper()
    # Arm and tool share a prefix; two classes of one name would not load again from the XML.
    tool.default.name = "tool_main"
    spec.attach(tool, site=f"{side}_{arm.FLANGE_SITE}", prefix=f"{side}_")


def _add_plate(base: mujoco.MjsBody) -> None:
    """Put a plate behind a base that hangs on a wall or a ceiling."""
    base.add_geom(
        type=BOX,
        size=[0.16, 0.16, 0.01],
        pos=[0.0, 0.0, -0.01],
        rgba=[0.45, 0.47, 0.50, 1.0],
        mass=0.0,
        **DRAWN,
    )


def _add_pedestal(base: mujoco.MjsBody, height_m: float) -> None:
    """Put a column under a base that stands above the floor, and about it a capsule to touch."""
    for radius, top, bottom in (
        (COLUMN_RADIUS_M, 0.0, -height_m),
        (0.16, -height_m + 0.015, -height_m),
    ):
        base.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CYLINDER,
            size=[radius, 0.5 * (top - bottom), 0.0],
            pos=[0.0, 0.0, 0.5 * (top + bottom)],
            rgba=[0.45, 0.47, 0.50, 1.0],
            mass=0.0,
            **DRAWN,
        )
    base.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        size=[COLUMN_RADIUS_M, max(height_m / 2 - COLUMN_RADIUS_M, 1e-3), 0.0],
        pos=[0.0, 0.0, -height_m / 2],
        mass=0.0,
        group=3,
        rgba=[0.3, 0.5, 0.9, 0.4],
    )


def _add_pad(spec: mujoco.MjSpec, grasp: GraspConfig, side: Side) -> None:
    """Put the rubber pads' compliance between hand and sheet: six sprung joints, 10 g."""
    hand = spec.body(f"{side}_hand")
    grip = spec.site(f"{side}_{arm.GRIP_SITE}")
    pad = hand.add_body(name=f"{side}_pad", pos=grip.pos, quat=grip.quat)
    # Its weight is held up, so that the bushing's springs read the sheet alone.
    pad.explicitinertial, pad.mass, pad.gravcomp = True, 0.01, 1.0
    pad.ipos, pad.inertia = [0.0, 0.0, 0.0], [3e-6, 1e-6, 3e-6]
    for name, kind, stiffness in (
        ("slide", mujoco.mjtJoint.mjJNT_SLIDE, grasp.translational_stiffness_n_per_m),
        ("tilt", mujoco.mjtJoint.mjJNT_HINGE, grasp.rotational_stiffness_n_m_per_rad),
    ):
        for axis, letter in zip(np.eye(3), "xyz", strict=True):
            pad.add_joint(
                name=f"{side}_pad_{name}_{letter}",
                type=kind,
                axis=axis,
                stiffness=stiffness,
                damping=stiffness * grasp.loss_time_s,
            )
    pad.add_site(name=f"{side}_{PAD_SITE}", **SITE)


def _add_drive(
    spec: mujoco.MjSpec, joint: str, kind: str, stiffness: float, damping: float
) -> mujoco.MjsActuator:
    """Drive a joint to a position: torque = k (u − q) − c q̇, within the joint's limit."""
    actuator = spec.add_actuator(
        name=f"{joint}_{kind}",
        target=joint,
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        biastype=mujoco.mjtBias.mjBIAS_AFFINE,
    )
    actuator.gainprm[0] = stiffness
    actuator.biasprm[1:3] -= [stiffness, damping]
    return actuator


def _add_jaw_drives(spec: mujoco.MjSpec, side: Side) -> None:
    """Drive both jaws of a gripper, and let their rubber touch the sheet's end."""
    for jaw, above in zip(arm.JAW_JOINTS, (1.0, -1.0), strict=True):
        spec.body(f"{side}_{jaw}").add_geom(
            name=f"{side}_{jaw}_rubber",
            type=BOX,
            size=[PAD_LENGTH_M / 2, PAD_WIDTH_M / 2, 0.0015],
            pos=[0.0, 0.0, above * 0.0015],
            mass=0.0,
            contype=0,
            conaffinity=GRIPPING,
            condim=1,
            solref=[0.0035, 1.0],
            # Hard: between soft ones a sheet of half a millimetre would slip through.
            solimp=[0.999, 0.9999, 1e-4, 0.5, 2.0],
            group=3,
        )
        drive = _add_drive(spec, f"{side}_{jaw}", "drive", _JAW_STIFFNESS_N_PER_M, 0.0)
        drive.forcerange, drive.forcelimited = [-_JAW_FORCE_N, _JAW_FORCE_N], True


def _add_surroundings(spec: mujoco.MjSpec, cell: CellConfig) -> None:
    """Floor, light and camera."""
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 1920, 1080
    spec.visual.headlight.ambient[:] = 0.45
    spec.visual.headlight.diffuse[:] = 0.45
    add_floor_and_sky(spec, FLOOR)
    spec.worldbody.add_light(
        name="lamp", pos=[0.5, -2.0, 3.0], dir=[-0.15, 0.55, -0.8], castshadow=True
    )
    spec.worldbody.add_camera(
        name="front",
        pos=[0.0, -2.20, cell.sheet_height_m + 0.95],
        xyaxes=[1.0, 0.0, 0.0, 0.0, 0.40, 0.917],
        fovy=42.0,
    )
