"""An arm from a user's MJCF: what MuJoCo compiles of the file, cut to the arm alone.

Actuators, keyframes, sensors, tendons and constraints are left out: the cell has its own. Numbers
are read from the compiled model, where defaults, classes and included files are resolved.
"""

from __future__ import annotations

import math
from pathlib import Path

import mujoco
import numpy as np

from dualbend.arm.drawn import Drawn, JointLimits
from dualbend.arm.facts import ArmFacts
from dualbend.arm.tree import FIXED, HINGE, SLIDE, Chain, Joint, Tree
from dualbend.errors import refusing
from dualbend.types import Vector

_TURN = 2.0 * math.pi
"""Range to each side of a joint without one [rad]."""

_KINDS = {
    mujoco.mjtJoint.mjJNT_HINGE: HINGE,
    mujoco.mjtJoint.mjJNT_SLIDE: SLIDE,
    # What floats in its file stands in the cell.
    mujoco.mjtJoint.mjJNT_FREE: FIXED,
    mujoco.mjtJoint.mjJNT_BALL: "ball",
}


class Mjcf:
    """An MJCF file, compiled: its tree, and the arm cut out of it.

    Sites are frames without mass in the tree. Raises InputError where the file cannot be read.
    """

    def __init__(self, file: Path) -> None:
        self.file = file
        with refusing(f"{file}: cannot be read as MJCF", ValueError):
            self.model = model = mujoco.MjSpec.from_file(str(file)).compile()
        self.bodies = {_name(model.body(i), "body"): i for i in range(model.nbody)}
        self.sites = {
            name: i
            for i in range(model.nsite)
            if (name := model.site(i).name) and name not in self.bodies
        }
        names = list(self.bodies)
        joints = [self._joint(name, i, names) for name, i in self.bodies.items() if i]
        joints += [
            Joint(
                name=name,
                kind=FIXED,
                parent=names[int(model.site_bodyid[i])],
                child=name,
                bare=True,
            )
            for name, i in self.sites.items()
        ]
        self.tree = Tree(file, [*names, *self.sites], joints)

    def _joint(self, child: str, body: int, names: list[str]) -> Joint:
        model = self.model
        first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        parent, bare = names[int(model.body_parentid[body])], not model.body_geomnum[body]
        if not count:
            return Joint(name=child, kind=FIXED, parent=parent, child=child, bare=bare)
        low, high = model.jnt_range[first]
        return Joint(
            name=_name(model.joint(first), "joint"),
            kind=_KINDS[mujoco.mjtJoint(model.jnt_type[first])]
            if count == 1
            else f"one of {count} of its body",
            parent=parent,
            child=child,
            stroke=float(high - low) if model.jnt_limited[first] else math.inf,
            bare=bare,
            mimics=self._followed(first),
        )

    def _followed(self, joint: int) -> str:
        """Return the joint that an equality constraint makes a joint follow; "" where none does."""
        model = self.model
        for i in range(model.neq):
            if model.eq_type[i] == mujoco.mjtEq.mjEQ_JOINT and model.eq_obj1id[i] == joint:
                other = int(model.eq_obj2id[i])
                return _name(model.joint(other), "joint") if other >= 0 else "a constant"
        return ""

    def limits(self, chain: Chain) -> JointLimits:
        """Return torque limits and rotors of the joints that move; MJCF knows no speed limits."""
        indices = [self.index(joint) for joint in chain.moving]
        for joint in chain.moving:
            if joint.kind not in (HINGE, SLIDE):
                raise self.tree.error(
                    f"joint {joint.name!r} is {joint.kind}; needs one hinge or slide"
                )
        for joint, i in zip(chain.moving, indices, strict=True):
            if joint.kind == SLIDE and not self.model.jnt_limited[i]:
                raise self.tree.error(f"joint {joint.name!r} lacks a range")
        rotors = tuple(float(self.model.dof_armature[self.model.jnt_dofadr[i]]) for i in indices)
        return JointLimits(
            torque_n_m=tuple(self._torque(i) for i in indices),
            speed_rad_per_s=(0.0,) * len(indices),
            armature_kg_m2=rotors if any(rotors) else (),
        )

    def index(self, joint: Joint) -> int:
        """Return the number of a joint that moves in the compiled file."""
        return int(self.model.body_jntadr[self.bodies[joint.child]])

    def _torque(self, joint: int) -> float:
        """Return the largest torque of a joint: its own limit, or that of its actuator."""
        model = self.model
        if model.jnt_actfrclimited[joint]:
            return float(np.abs(model.jnt_actfrcrange[joint]).max())
        for i in range(model.nu):
            kind = model.actuator_trntype[i]
            if kind != mujoco.mjtTrn.mjTRN_JOINT or model.actuator_trnid[i, 0] != joint:
                continue
            gear = abs(float(model.actuator_gear[i, 0]))
            if model.actuator_forcelimited[i]:
                return gear * float(np.abs(model.actuator_forcerange[i]).max())
            motor = not np.any(model.actuator_biasprm[i])
            if motor and model.actuator_ctrllimited[i]:
                most = float(np.abs(model.actuator_ctrlrange[i]).max())
                return gear * abs(float(model.actuator_gainprm[i, 0])) * most
        return 0.0

    def cut(self, chain: Chain, _: ArmFacts) -> Drawn:
        """Return the arm alone, as :meth:`dualbend.arm.urdf.Urdf.cut` does."""
        spec = mujoco.MjSpec()
        spec.compiler.degree = False
        made = {chain.base: spec.worldbody.add_body(name="base")}
        self._add_geoms(spec, made[chain.base], self.bodies[chain.base])
        count, stubs = 0, []
        for i, joint in enumerate([*chain.joints, *self.tree.sides(chain)]):
            count += joint.moves
            name = f"link{count}" if joint.moves else f"fixed{i}"
            body = made[joint.child] = made[joint.parent].add_body(name=name)
            body.pos, body.quat = self.frame(joint.child)
            if joint.child in self.sites:
                continue
            index = self.bodies[joint.child]
            if joint.moves:
                self._add_joint(body, f"joint{count}", self.index(joint))
            if joint.child == chain.flange and not joint.moves:
                continue  # the flange is where the arm ends
            if self._add_mass(body, index, moves=joint.moves):
                stubs.append(joint.child)
            self._add_geoms(spec, body, index)
        return Drawn(spec=spec, flange=made[chain.flange].name, stubs=tuple(stubs))

    def _add_joint(self, body: mujoco.MjsBody, name: str, joint: int) -> None:
        model = self.model
        dof = int(model.jnt_dofadr[joint])
        low, high = model.jnt_range[joint] if model.jnt_limited[joint] else (-_TURN, _TURN)
        body.add_joint(
            name=name,
            type=mujoco.mjtJoint(model.jnt_type[joint]),
            pos=model.jnt_pos[joint],
            axis=model.jnt_axis[joint],
            range=[low, high],
            ref=model.qpos0[model.jnt_qposadr[joint]],
            damping=model.dof_damping[dof],
            frictionloss=model.dof_frictionloss[dof],
        )

    def _add_mass(self, body: mujoco.MjsBody, index: int, *, moves: bool) -> bool:
        """Give a body its mass; return whether it moves and has next to none in the file."""
        model = self.model
        stub = moves and model.body_mass[index] < 1e-5
        body.explicitinertial = True
        body.mass = max(float(model.body_mass[index]), 1e-6 * stub)
        body.ipos, body.iquat = model.body_ipos[index], model.body_iquat[index]
        body.inertia = np.maximum(model.body_inertia[index], 1e-9 * stub)
        return bool(stub)

    def _add_geoms(self, spec: mujoco.MjSpec, body: mujoco.MjsBody, index: int) -> None:
        """Give a body the file's shapes, meshes as they were compiled."""
        model = self.model
        for i in np.flatnonzero(model.geom_bodyid == index).tolist():
            kind = mujoco.mjtGeom(model.geom_type[i])
            material = int(model.geom_matid[i])
            shape = {
                "type": kind,
                "pos": model.geom_pos[i],
                "quat": model.geom_quat[i],
                "size": model.geom_size[i],
                "contype": int(model.geom_contype[i] or model.geom_conaffinity[i]),
                "rgba": model.mat_rgba[material] if material >= 0 else model.geom_rgba[i],
                "mass": 0.0,
            }
            if kind == mujoco.mjtGeom.mjGEOM_MESH:
                shape["meshname"] = self._mesh(spec, int(model.geom_dataid[i]))
                del shape["size"]
            body.add_geom(**shape)

    def _mesh(self, spec: mujoco.MjSpec, mesh: int) -> str:
        """Add a compiled mesh to the specification, once, and return its name."""
        model, name = self.model, f"mesh{mesh}"
        if spec.mesh(name) is None:
            first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
            faces, many = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
            spec.add_mesh(
                name=name,
                uservert=model.mesh_vert[first : first + count].ravel(),
                userface=model.mesh_face[faces : faces + many].ravel(),
            )
        return name

    def frame(self, name: str) -> tuple[Vector, Vector]:
        """Return place (3,) and quaternion (4,) of a body or site in what it hangs on."""
        model = self.model
        if name in self.sites:
            return model.site_pos[self.sites[name]], model.site_quat[self.sites[name]]
        return model.body_pos[self.bodies[name]], model.body_quat[self.bodies[name]]


def _name(element: mujoco.mjModel, kind: str) -> str:
    """Return the name of an element, or its kind and number where it has none."""
    return str(element.name or f"{kind}{element.id}")
