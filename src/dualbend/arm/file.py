"""An arm from a file of its maker, URDF or MJCF, as a MuJoCo specification.

After either is cut to the arm alone, links get a capsule that collides and meshes to look at, and
joints what the file does not hold.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import msgspec
import mujoco
import numpy as np

from dualbend.arm.drawn import JointLimits
from dualbend.arm.facts import ArmFacts
from dualbend.arm.meshes import add_shapes
from dualbend.arm.mjcf import FLANGE_SITE
from dualbend.arm.mjcf_file import Mjcf
from dualbend.arm.tree import SLIDE, Chain, refuse_count
from dualbend.arm.urdf import Urdf
from dualbend.errors import InputError, refusing
from dualbend.types import Vector

SUFFIXES: Final = (".urdf", ".xml")
"""How the names of arms' files end: URDF, MJCF."""

ROTOR_KG_M2, ROTOR_KG = 0.1, 10.0
"""Rotor inertia at a hinge, and at a slide, where neither file nor scenario says it."""

_HARD_FRICTION: Final = [0.9999, 0.9999, 0.001, 0.5, 2.0]
"""Nearly hard dry friction, as the PUMA's: the default smears it over 5 mrad/s."""

_NEIGHBOURS = 2
"""Links this near in the chain overlap at their joints: their capsules do not collide."""

_ALONG, _AHEAD_M = 0.97, 0.005
"""Cosine from which on an axis of the flange is the last joint's, and a distance along it."""

_OUTWARD: Final = {
    (2, 1): (0.0, 0.0, 0.0),
    (2, -1): (np.pi, 0.0, 0.0),
    (0, 1): (0.0, 0.5 * np.pi, 0.0),
    (0, -1): (0.0, -0.5 * np.pi, 0.0),
    (1, 1): (-0.5 * np.pi, 0.0, 0.0),
    (1, -1): (0.5 * np.pi, 0.0, 0.0),
}
"""The turn that puts z where an axis of the flange and its sign are."""

_LISTS = (
    *("torque_limit_n_m", "speed_limit_rad_per_s", "armature_kg_m2"),
    *("coulomb_n_m", "viscous_n_m_s_per_rad"),
)
_INCLUDED = re.compile(rb"<include\s+file\s*=\s*[\"']([^\"']+)[\"']")

_USUAL = {"torque": "10 to 300 N m", "speed": "2 to 3 rad/s"}


@dataclass(frozen=True, kw_only=True, eq=False)
class FileArm:
    """A serial arm of n joints from its file.

    Attributes
    ----------
    spec : bodies ``base`` and ``link1`` ... ``link<n>`` with the file's frames, joints ``joint1``
        ... ``joint<n>``, site ``flange`` with z outward; no actuators
    chain : links and joints as the file calls them
    limits : of torque and speed, as the facts or the file give them
    notes : what was put in the place of something that the file lacks
    """

    spec: mujoco.MjSpec
    chain: Chain
    limits: JointLimits
    notes: tuple[str, ...]

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The file's names of the joints (n,)."""
        return tuple(joint.name for joint in self.chain.moving)

    @property
    def slides(self) -> tuple[bool, ...]:
        """Which joints are slides (n,)."""
        return tuple(joint.kind == SLIDE for joint in self.chain.moving)


@dataclass(frozen=True, kw_only=True)
class ArmFile:
    """A file with what it does not say; ``sha256`` of its content, "" where that is not asked."""

    file: Path
    facts: ArmFacts
    sha256: str = ""

    def read(self, *, looks: bool) -> FileArm:
        """Return the arm between base and flange, with meshes to look at or without.

        Links that move beside the chain or hang beyond the flange are left out, links that are
        fixed to each other are one. Gravity is held up by the joints' own drives, as in
        :func:`dualbend.arm.mjcf.load_puma`. Raises InputError where the file cannot be read, or is
        no chain of hinges and slides with masses and limits.
        """
        facts, reader = self.facts, self._reader()
        chain = reader.tree.chain(facts.base, facts.flange)
        limits = _given(reader.limits(chain), facts)
        _refuse_missing(self.file, chain, limits)
        drawn = reader.cut(chain, facts)
        spec = drawn.spec
        _add_flange(spec, drawn.flange, facts.flange_rpy_rad or (0.0, 0.0, 0.0))
        add_shapes(spec, looks=looks)
        spec.bodies[1].fuse = False
        with _naming(self.file, chain):
            spec.fuse_static()
        for joint, link in zip(chain.moving, spec.bodies[2:], strict=True):
            link.gravcomp = 1.0
            if not link.mass > 0.0:
                raise InputError(f"{self.file}: link {joint.child!r} moves and has no mass")
            if not max(*link.inertia, *link.fullinertia[:3]) > 0.0:
                raise InputError(f"{self.file}: link {joint.child!r} moves and has no inertia")
        _add_drives(spec, limits, chain)
        for i, joint in enumerate(spec.joints):
            if facts.coulomb_n_m is not None:
                joint.frictionloss = facts.coulomb_n_m[i]
            if facts.viscous_n_m_s_per_rad is not None:
                joint.damping = np.array([facts.viscous_n_m_s_per_rad[i], 0.0, 0.0])
        notes = tuple(f"link {name!r} moves and has no mass: 1 mg" for name in drawn.stubs)
        return FileArm(spec=spec, chain=chain, limits=limits, notes=notes)

    @property
    def is_urdf(self) -> bool:
        """It is a URDF, by its name or its content, and no MJCF."""
        return self.file.suffix.lower() == ".urdf" or b"<robot" in file_bytes(self.file)

    def _reader(self) -> Urdf | Mjcf:
        return Urdf(self.file, file_bytes(self.file)) if self.is_urdf else Mjcf(self.file)

    def resolved(self) -> ArmFile:
        """Return the file with base, flange and the turn of its axes found.

        Raises InputError where it has not as many joints as an arm of a cell, or cannot be
        compiled.
        """
        refuse_count(self._reader().tree.chain(self.facts.base, self.facts.flange), self.file)
        arm = self.read(looks=False)
        with _naming(self.file, arm.chain):
            model = arm.spec.compile()
        _refuse_absurd(self.file, model, arm.limits)
        turn = self.facts.flange_rpy_rad
        if turn is None:
            turn = _outward(model)
        found = {"base": arm.chain.base, "flange": arm.chain.flange, "flange_rpy_rad": turn}
        facts = msgspec.structs.replace(self.facts, **found)
        return ArmFile(file=self.file, facts=facts, sha256=self.sha256)


def is_file(name: str) -> bool:
    """Tell the file of an arm from a name of a shipped one."""
    return Path(name).suffix.lower() in SUFFIXES


def file_bytes(file: Path) -> bytes:
    """Return the content of an arm's file; InputError where it cannot be read."""
    with refusing(f"{file}: cannot be read", OSError, ValueError):
        return file.read_bytes()


def sha256_of(file: Path) -> str:
    """Return the SHA-256 of an arm's file, and of those that an MJCF includes."""
    contents = [file_bytes(file)]
    for name in _INCLUDED.findall(contents[0]):
        contents.append(file_bytes(file.parent / name.decode(errors="replace")))
    return hashlib.sha256(b"".join(contents)).hexdigest()


def _given(limits: JointLimits, facts: ArmFacts) -> JointLimits:
    """Return a file's limits with what is given beside it in their place."""
    count = len(limits.torque_n_m)
    for key in _LISTS:
        values = getattr(facts, key)
        if values is not None and len(values) != count:
            raise InputError(f"robot.arm.{key} has {len(values)} values, the arm {count} joints")
    return JointLimits(
        torque_n_m=facts.torque_limit_n_m or limits.torque_n_m,
        speed_rad_per_s=facts.speed_limit_rad_per_s or limits.speed_rad_per_s,
        armature_kg_m2=facts.armature_kg_m2 or limits.armature_kg_m2,
    )


def _refuse_missing(file: Path, chain: Chain, limits: JointLimits) -> None:
    """Raise InputError, which asks for all of it, where a joint has no torque or speed limit."""
    wanted = []
    for what, key, values in (
        ("torque", "torque_limit_n_m", limits.torque_n_m),
        ("speed", "speed_limit_rad_per_s", limits.speed_rad_per_s),
    ):
        names = [j.name for j, value in zip(chain.moving, values, strict=True) if not value > 0.0]
        if names:
            lacking = "any joint" if len(names) == len(values) else ", ".join(names)
            wanted.append(
                f"the {what} limit of {lacking}: robot.arm.{key} = [{len(values)} values, usual "
                f"are {_USUAL[what]}]"
            )
    if wanted:
        raise InputError(f"{file}: does not say {'; nor '.join(wanted)}")


def _add_flange(spec: mujoco.MjSpec, body: str, rpy: Sequence[float]) -> None:
    outward = np.empty(4)
    mujoco.mju_euler2Quat(outward, np.array(rpy), "XYZ")
    spec.body(body).add_site(
        name=FLANGE_SITE,
        quat=outward,
        group=4,
        size=[0.006, 0.006, 0.006],
        rgba=[0.9, 0.2, 0.1, 1.0],
    )


def _add_drives(spec: mujoco.MjSpec, limits: JointLimits, chain: Chain) -> None:
    """Give links and joints what files do not hold, and let neighbours overlap."""
    for i, (joint, one) in enumerate(zip(spec.joints, chain.moving, strict=True)):
        joint.limited = joint.actfrclimited = joint.actgravcomp = True
        joint.solimp_friction = _HARD_FRICTION
        rotor = limits.armature_kg_m2[i] if limits.armature_kg_m2 else 0.0
        joint.armature = rotor or (ROTOR_KG if one.kind == SLIDE else ROTOR_KG_M2)
        joint.actfrcrange = np.array([-1.0, 1.0]) * limits.torque_n_m[i]
    names = [body.name for body in spec.bodies[1:]]
    for i, first in enumerate(names):
        for second in names[i + 1 : i + 1 + _NEIGHBOURS]:
            spec.add_exclude(bodyname1=first, bodyname2=second)


@contextmanager
def _naming(file: Path, chain: Chain) -> Iterator[None]:
    """Turn MuJoCo's error into an InputError with the file's own names of links."""
    try:
        yield
    except ValueError as error:
        text = " ".join(str(error).removeprefix("Error: ").split())
        for i, joint in enumerate(chain.moving, 1):
            text = text.replace(f"'link{i}'", repr(joint.child))
        raise InputError(f"{file}: cannot be simulated: {text}") from error


def _refuse_absurd(file: Path, model: mujoco.MjModel, limits: JointLimits) -> None:
    """Raise InputError where a number of the file is none that an arm has."""
    for what, values, most in (
        ("a length [m]", model.body_pos, 100.0),
        ("a mass [kg]", model.body_mass, 1e5),
        ("an inertia [kg m²]", model.body_inertia, 1e6),
        ("a joint's range [rad or m]", model.jnt_range, 1e3),
        ("a joint's friction", model.dof_frictionloss, 1e6),
        ("a joint's damping", model.dof_damping, 1e6),
        ("a torque limit [N m]", limits.torque_n_m, 1e6),
        ("a speed limit [rad/s]", limits.speed_rad_per_s, 1e6),
    ):
        size = np.abs(np.asarray(values))
        if not (size <= most).all():  # no number is not, either
            raise InputError(f"{file}: {what} is {size.max():g}; {most:g} at most")


def _outward(model: mujoco.MjModel) -> tuple[float, float, float]:
    """Return the turn after which the flange's z is along the last joint's axis, away from the arm.

    Away is where the flange lies ahead of the joint before, along that axis; the axis itself
    where it lies beside it. A flange with no axis along the joint's keeps its z.
    """
    data = mujoco.MjData(model)
    data.qpos[:] = 0.0
    mujoco.mj_kinematics(model, data)
    axis: Vector = data.xaxis[-1].copy()
    ahead = float(axis @ (data.site(FLANGE_SITE).xpos - data.xanchor[-2]))
    if ahead < -_AHEAD_M:
        axis = -axis
    own = data.site(FLANGE_SITE).xmat.reshape(3, 3).T @ axis
    k = int(np.argmax(np.abs(own)))
    if abs(own[k]) < _ALONG:
        return _OUTWARD[2, 1]
    return _OUTWARD[k, int(np.sign(own[k]))]
