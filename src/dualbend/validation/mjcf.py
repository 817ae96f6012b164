"""An arm from its MJCF, as MuJoCo compiles the whole file: reference for the arm cut out of it."""

from __future__ import annotations

import mujoco
import numpy as np

from dualbend.arm.file import ArmFile
from dualbend.types import Vector
from dualbend.validation.lagrange import Link, SerialArm, joined


def equations_of(file: ArmFile) -> SerialArm:
    """Return the arm between base and flange, z outward, as its file has it.

    A link's frame is its body's, moved to the joint and turned back by the joint's reference.
    Bodies fixed beside the chain are joined to their links; what hangs on the last is a tool.
    """
    model = mujoco.MjSpec.from_file(str(file.file)).compile()
    facts = file.facts
    base = model.body(facts.base).id
    flange: Vector = np.eye(4)
    sites = [model.site(i).name for i in range(model.nsite)]
    if facts.flange in sites:
        site = sites.index(facts.flange)
        end, flange = (
            int(model.site_bodyid[site]),
            _pose(model.site_pos[site], model.site_quat[site]),
        )
    else:
        end = model.body(facts.flange).id
    way = [end]
    while (above := int(model.body_parentid[way[0]])) != base:
        way.insert(0, above)
    moving = [body for body in way if model.body_jntnum[body]]
    # Each body's frame in that of the link before it; back: from the link's frame to the body's.
    links: list[Link] = []
    back: Vector = np.eye(4)
    for body in way:
        pose = back @ _pose(model.body_pos[body], model.body_quat[body])
        shift, axis, slides = np.eye(4), np.zeros(3), False
        if body in moving:
            joint = int(model.body_jntadr[body])
            slides = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE
            axis, zero = model.jnt_axis[joint], -float(model.qpos0[model.jnt_qposadr[joint]])
            shift[:3, 3] = axis * zero if slides else model.jnt_pos[joint]
            if not slides:
                shift = shift @ _about(axis, zero)
        tool = body == end and facts.flange not in sites and body not in moving
        link = Link(
            pose=pose @ shift,
            axis=axis,
            mass_kg=0.0,
            centre_m=np.zeros(3),
            inertia_kg_m2=np.zeros((3, 3)),
            slides=bool(slides),
        )
        # Turned by the joint's own angle about its own axis, the body is where the file has it.
        back = np.eye(4) if slides or body not in moving else _moved(model, body)
        before_last = way.index(moving[0]) <= way.index(body) < way.index(moving[-1])
        bodies = _fixed(model, body, way, np.eye(4)) if before_last else [(body, np.eye(4))]
        for one, place in () if tool else bodies:
            at = back @ place @ _pose(model.body_ipos[one], model.body_iquat[one])
            turn = at[:3, :3]
            inertia = turn @ np.diag(model.body_inertia[one]) @ turn.T
            link = joined(link, float(model.body_mass[one]), at[:3, 3], inertia)
        links.append(link)
    turn = np.eye(4)
    quat, flat = np.empty(4), np.empty(9)
    mujoco.mju_euler2Quat(quat, np.array(facts.flange_rpy_rad), "XYZ")
    mujoco.mju_quat2Mat(flat, quat)
    turn[:3, :3] = flat.reshape(3, 3)
    return SerialArm(links=tuple(links), flange=back @ flange @ turn)


def _moved(model: mujoco.MjModel, body: int) -> Vector:
    """Return the body's frame (4, 4) in the frame at its joint."""
    pose = np.eye(4)
    pose[:3, 3] = -model.jnt_pos[int(model.body_jntadr[body])]
    return pose


def _fixed(
    model: mujoco.MjModel, body: int, way: list[int], pose: Vector
) -> list[tuple[int, Vector]]:
    """Return a body and those fixed to it, but for the next of the chain, with their poses."""
    found = [(body, pose)]
    for child in range(model.nbody):
        beside = child and child not in way and not model.body_jntnum[child]
        if beside and model.body_parentid[child] == body:
            place = pose @ _pose(model.body_pos[child], model.body_quat[child])
            found += _fixed(model, child, way, place)
    return found


def _about(axis: Vector, angle: float) -> Vector:
    quat, pose = np.empty(4), np.eye(4)
    mujoco.mju_axisAngle2Quat(quat, axis, angle)
    return pose @ _pose(np.zeros(3), quat)


def _pose(place: Vector, quat: Vector) -> Vector:
    """Return the transform (4, 4) of a place and a quaternion."""
    turn, pose = np.empty(9), np.eye(4)
    mujoco.mju_quat2Mat(turn, quat)
    pose[:3, :3], pose[:3, 3] = turn.reshape(3, 3), place
    return pose
