"""What the arms are not as their controller believes: friction, masses, joint zeros, bases.

The controller keeps to the arms that :func:`dualbend.scene.cell.robots_only` describes: its inverse
kinematics, its joint servos' feed-forward, its weights. What is written here into the compiled cell
are the true arms.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import msgspec
import mujoco
import numpy as np

from dualbend.arm.mjcf import JAW_JOINTS
from dualbend.arm.pair import ArmPair
from dualbend.control.worlds import stacked
from dualbend.imperfection.draws import cut_normal, stream
from dualbend.types import SIDES, Config, Side, Vector, said

_TOOL = ("sensor", "hand", *JAW_JOINTS)

Ratio = Annotated[float, msgspec.Meta(ge=0.0, le=5.0)]
Spread = Annotated[float, msgspec.Meta(ge=0.0, le=0.33)]
Shift = Annotated[float, msgspec.Meta(ge=-0.05, le=0.05)]


class RobotErrors(Config):
    """What the arms are not as their controller believes: friction, masses, joint zeros, bases.

    Ratios are true over believed. A spread is the standard deviation of a normal draw, cut at 3 σ;
    of a ratio it is a share: true = ratio (1 + draw) believed. What is systematic is the same on
    both arms, each in its own bending frame.
    """

    coulomb_ratio: Annotated[Ratio, said("true over fed forward Coulomb friction")] = 1.0
    coulomb_spread: Annotated[Spread, said("of it from joint to joint, a share")] = 0.0
    viscous_ratio: Annotated[Ratio, said("true over fed forward viscous friction")] = 1.0
    viscous_spread: Annotated[Spread, said("of it from joint to joint, a share")] = 0.0
    stiction_excess: Annotated[
        float, said("s: friction at rest is (1 + s) times the Coulomb friction", ge=0, le=5)
    ] = 0.0
    stribeck_speed_rad_per_s: Annotated[
        float, said("v_s of T(v) = T_c (1 + s exp(−(v/v_s)²)), of each joint", ge=1e-4, le=1)
    ] = 0.01
    link_mass_ratio: Annotated[
        float, said("true over believed mass and inertia of the links", ge=0.5, le=2)
    ] = 1.0
    link_mass_spread: Annotated[Spread, said("of it from link to link, a share")] = 0.0
    tool_mass_ratio: Annotated[
        float, said("true over believed mass and inertia of sensor and gripper", ge=0.5, le=2)
    ] = 1.0
    tool_mass_spread: Annotated[Spread, said("of it from arm to arm, a share")] = 0.0
    zero_rad: (
        Annotated[
            tuple[Annotated[float, msgspec.Meta(ge=-0.1, le=0.1)], ...],
            said(
                "joint zeros, true minus measured angle, base to flange; none: right",
                min_length=6,
                max_length=20,
            ),
        ]
        | None
    ) = None
    zero_spread_rad: Annotated[float, said("of them from joint to joint", ge=0, le=0.02)] = 0.0
    base_x_m: Annotated[Shift, said("base, true minus believed place, along x_B")] = 0.0
    base_y_m: Annotated[Shift, said("the same along y_B")] = 0.0
    base_z_m: Annotated[Shift, said("the same along z_B")] = 0.0
    base_roll_rad: Annotated[Shift, said("true base turned about x_B, after z_B and y_B")] = 0.0
    base_pitch_rad: Annotated[Shift, said("the same about y_B")] = 0.0
    base_yaw_rad: Annotated[Shift, said("the same about z_B, the vertical")] = 0.0
    base_spread_m: Annotated[float, said("of each arm's place, each direction", ge=0, le=0.01)] = (
        0.0
    )
    base_spread_rad: Annotated[float, said("of each arm's turns, each axis", ge=0, le=0.01)] = 0.0

    @property
    def base(self) -> Vector:
        """What is systematic of the bases, x, y, z [m], roll, pitch, yaw [rad] (6,)."""
        places = (self.base_x_m, self.base_y_m, self.base_z_m)
        return np.array([*places, self.base_roll_rad, self.base_pitch_rad, self.base_yaw_rad])

    @property
    def displaces(self) -> bool:
        """The grips are elsewhere than measured: joint zeros or bases are wrong."""
        spreads = (self.zero_spread_rad, self.base_spread_m, self.base_spread_rad)
        return any(spreads) or any(self.zero_rad or ()) or bool(self.base.any())

    @property
    def weighs_wrong(self) -> bool:
        """The drives hold up other weights than there are."""
        ratios = (self.link_mass_ratio, self.tool_mass_ratio)
        return ratios != (1.0, 1.0) or any((self.link_mass_spread, self.tool_mass_spread))


class TrueArms:
    """The true arms of a cell, over those that the controller believes in; drawn from the seed.

    Attributes
    ----------
    coulomb, viscous, link_mass : (n,) ratios of all joints or links, left arm first
    tool_mass : (2,)
    zero_rad : (n,) true angle minus measured one
    base : (2, 6) x, y, z [m], roll, pitch, yaw [rad] of each base in its arm's bending frame, about
        the base frame's origin: R_z(yaw) R_y(pitch) R_x(roll)
    """

    def __init__(self, config: RobotErrors, arms: ArmPair, seed: int) -> None:
        def draw(name: str, spread: float, *shape: int) -> Vector:
            return cut_normal(stream(seed, "robot", name), spread, shape)

        n = arms.count
        self._arms = arms
        self.coulomb = config.coulomb_ratio * (1.0 + draw("coulomb", config.coulomb_spread, n))
        self.viscous = config.viscous_ratio * (1.0 + draw("viscous", config.viscous_spread, n))
        self.link_mass = config.link_mass_ratio * (1.0 + draw("link", config.link_mass_spread, n))
        self.tool_mass = config.tool_mass_ratio * (1.0 + draw("tool", config.tool_mass_spread, 2))
        self.zero_rad = draw("zero", config.zero_spread_rad, n)
        if config.zero_rad is not None:
            self.zero_rad += np.tile(config.zero_rad, len(SIDES))
        shift = draw("base place", config.base_spread_m, 2, 3)
        self.base = config.base + np.hstack(
            (shift, draw("base turn", config.base_spread_rad, 2, 3))
        )

    def write(self, spec: mujoco.MjSpec) -> None:
        """Make the believed arms of a composed cell the true ones."""
        for i, side in enumerate(SIDES):
            joints = self._arms.of(side).model.joints
            for k, name in enumerate(joints, self._arms.joints(side).start):
                joint = spec.joint(f"{side}_{name}")
                joint.frictionloss *= self.coulomb[k]
                joint.damping = joint.damping * self.viscous[k]
                # A position is the angle from the reference on: it is now the measured one.
                joint.ref -= self.zero_rad[k]
                link = name.replace("joint", "link")
                _scale(spec.body(f"{side}_{link}"), float(self.link_mass[k]))
            for part in _TOOL:
                _scale(spec.body(f"{side}_{part}"), float(self.tool_mass[i]))
            if self.base[i].any():
                self._move(spec, side, self.base[i])

    def _move(self, spec: mujoco.MjSpec, side: Side, error: Vector) -> None:
        """Move a base, whose own frame is turned from the bending frame."""
        body, own = spec.body(f"{side}_base"), self._arms.of(side).placement.quat()
        turn, back = np.empty((2, 4))
        mujoco.mju_euler2Quat(turn, error[[5, 4, 3]], "zyx")
        mujoco.mju_negQuat(back, own)
        place, inner, quat = np.empty(3), np.empty(4), np.empty(4)
        mujoco.mju_rotVecQuat(place, error[:3], back)
        mujoco.mju_mulQuat(inner, turn, own)
        mujoco.mju_mulQuat(quat, back, inner)
        assert not np.any(body.pos)  # an arm's base frame is where the cell puts it
        body.pos, body.quat = place, quat


_ROUNDING = 1e-12


def _scale(body: mujoco.MjsBody, ratio: float) -> None:
    """Scale a body's mass and inertia; its drive goes on holding up the weight it believes in."""
    if ratio == 1.0:
        return
    body.mass *= ratio
    inertia = body.inertia * ratio
    # A principal moment that is the sum of the other two may be beyond it by rounding.
    body.inertia = np.minimum(inertia, (inertia.sum() - inertia) * (1.0 - _ROUNDING))
    body.fullinertia = body.fullinertia * ratio
    body.gravcomp /= ratio


class Stribeck:
    """Dry friction of the joints that depends on their speed: T(v) = T_c (1 + s exp(−(v/v_s)²)).

    T_c is what the compiled cell has. The constraint solver holds a joint that sticks; its level
    follows the speed from one physics step to the next.
    """

    def __init__(self, config: RobotErrors, model: mujoco.MjModel, dofs: Vector) -> None:
        # Python in every physics step: in place, on views of one span of joints. What else lies in
        # it keeps its friction.
        self.span = span = slice(dofs.min(), dofs.max() + 1)
        self._level = model.dof_frictionloss[span]
        self._coulomb, self._excess = self._level.copy(), np.zeros_like(self._level)
        mine = dofs - span.start
        self._excess[mine] = config.stiction_excess * self._coulomb[mine]
        exponent = -1.0 / config.stribeck_speed_rad_per_s**2
        self._exponent = np.full(self._level.shape, exponent)

    @classmethod
    def stacked(cls, many: Sequence[Stribeck], levels: Vector) -> Stribeck:
        """Return that of many worlds; their friction (worlds, nv) is where it acts."""
        joined = stacked(many, "_coulomb", "_excess", "_exponent")
        joined._level = levels[:, joined.span]
        return joined

    def rest(self) -> None:
        """Let all joints be at rest."""
        self._level[:] = self._coulomb + self._excess

    def on_step(self, speed: Vector) -> None:
        """Follow the speeds (..., n), of the ``span`` of joints, after a physics step."""
        level = self._level
        np.multiply(speed, speed, level)
        np.multiply(level, self._exponent, level)
        np.exp(level, level)
        np.multiply(level, self._excess, level)
        np.add(level, self._coulomb, level)
