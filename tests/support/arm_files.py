"""Small arm files that have the structure of makers' ones: six hinges like a UR's, and variants."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import trimesh

JOINT = (
    '<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
    '<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>{limit}{more}</joint>'
)
LIMIT = '<limit lower="{low}" upper="{high}" effort="{effort}" velocity="{speed}"/>'
INERTIAL = (
    '<inertial><origin xyz="{xyz}" rpy="0 0 0"/><mass value="{mass}"/>'
    '<inertia ixx="{i}" iyy="{i}" izz="{i}" ixy="0" ixz="0" iyz="0"/></inertial>'
)
CYLINDER = (
    '<{role}><origin xyz="0 0 0" rpy="0 0 0"/>'
    '<geometry><cylinder radius="0.05" length="0.2"/></geometry></{role}>'
)


def link(name: str, mass: float = 0.0, *, shape: bool = True, more: str = "") -> str:
    """Return a link, with a cylinder to see and touch; without mass it has no inertial."""
    inertial = INERTIAL.format(xyz="0 0 0.05", mass=mass, i=0.01 * mass) if mass else ""
    seen = CYLINDER.format(role="visual") + CYLINDER.format(role="collision") if shape else ""
    return f'<link name="{name}">{inertial}{seen}{more}</link>'


@dataclass(frozen=True, kw_only=True)
class J:
    """A joint: where it is in its parent's frame, about or along which axis, its limits."""

    name: str
    parent: str
    child: str
    xyz: str = "0 0 0"
    rpy: str = "0 0 0"
    axis: str = "0 0 1"
    kind: str = "revolute"
    low: float = -6.28
    high: float = 6.28
    effort: float | None = 150.0
    speed: float | None = 3.0
    limited: bool = True
    more: str = ""

    def text(self) -> str:
        """Return the element."""
        limit = (
            LIMIT.format(low=self.low, high=self.high, effort=self.effort, speed=self.speed)
            .replace(' effort="None"', "")
            .replace(' velocity="None"', "")
        )
        return JOINT.format(
            name=self.name,
            kind=self.kind,
            parent=self.parent,
            child=self.child,
            xyz=self.xyz,
            rpy=self.rpy,
            axis=self.axis,
            limit=limit if self.limited and self.kind != "fixed" else "",
            more=self.more,
        )


@dataclass(frozen=True, kw_only=True)
class Robot:
    """A URDF to be: links as text by name, joints in order."""

    links: dict[str, str]
    joints: tuple[J, ...]
    more: str = ""

    def text(self) -> str:
        """Return the file."""
        inner = "".join([*self.links.values(), *(joint.text() for joint in self.joints)])
        xacro = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
        return f'<robot name="r" {xacro}>{inner}{self.more}</robot>'

    def write(self, folder: Path, name: str = "arm.urdf") -> Path:
        """Write it into a folder."""
        folder.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(self.text())
        return folder / name

    def with_joints(self, **changes: dict[str, object]) -> "Robot":
        """Return it with changes to joints, by their names."""
        joints = tuple(replace(j, **changes.get(j.name, {})) for j in self.joints)  # type: ignore[arg-type]
        return replace(self, joints=joints)

    def with_links(self, **links: str) -> "Robot":
        """Return it with other or further links."""
        return replace(self, links={**self.links, **links})

    def plus(self, links: Sequence[str], *joints: J) -> "Robot":
        """Return it with further links, bodies without mass and shape, and joints."""
        bare = {name: link(name, shape=False) for name in links if name not in self.links}
        return replace(self, links={**self.links, **bare}, joints=(*self.joints, *joints))


MASSES = (4.0, 8.0, 3.0, 1.5, 1.5, 0.8)
NAMES = ("pan", "lift", "elbow", "wrist_1", "wrist_2", "wrist_3")


def six(first: str = "base_link") -> Robot:
    """Return an arm of six hinges in a UR's arrangement: reach 0.85 m to the wrist."""
    places = (
        ("0 0 0.15", "0 0 1"),
        ("0 0.13 0", "0 1 0"),
        ("0 -0.12 0.42", "0 1 0"),
        ("0 0 0.40", "0 1 0"),
        ("0 0.1 0", "0 0 1"),
        ("0 0 0.1", "0 1 0"),
    )
    parents = (first, *(f"link_{i}" for i in range(1, 6)))
    joints = [
        J(
            name=NAMES[i],
            parent=parents[i],
            child=f"link_{i + 1}",
            xyz=xyz,
            axis=axis,
            effort=330.0 if i < 3 else 60.0,
        )
        for i, (xyz, axis) in enumerate(places)
    ]
    links = {first: link(first)}
    links |= {f"link_{i + 1}": link(f"link_{i + 1}", mass) for i, mass in enumerate(MASSES)}
    robot = Robot(links=links, joints=tuple(joints))
    mount = J(
        name="mount",
        kind="fixed",
        parent="link_6",
        child="tool0",
        xyz="0 0.08 0",
        rpy="-1.5707963 0 0",
    )
    return robot.plus(["tool0"], mount)


MJCF = """
<mujoco model="my arm">
  <compiler angle="degree" autolimits="true" meshdir="assets"/>
  <option integrator="implicitfast"/>
  <default>
    <default class="arm">
      <joint axis="0 1 0" range="-360 360" armature="0.12" damping="0.5" frictionloss="0.3"/>
      <general biastype="affine" gainprm="2000" biasprm="0 -2000 -400" forcerange="-150 150"/>
      <default class="small">
        <joint armature="0.05"/>
        <general forcerange="-28 28"/>
      </default>
      <default class="visual"><geom contype="0" conaffinity="0" group="2"/></default>
      <default class="collision"><geom type="capsule" group="3"/></default>
    </default>
  </default>
  <asset>
    <mesh name="upper" file="upper.stl" scale="0.001 0.001 0.001"/>
    <material name="blue" rgba="0.2 0.3 0.8 1"/>
  </asset>
  <worldbody>
    <light pos="0 0 2"/>
    <geom name="ground" type="plane" size="1 1 0.1"/>
    <body name="base" pos="0.3 0 0.1" quat="0 0 0 -1" childclass="arm">
      <inertial mass="4" pos="0 0 0" diaginertia="0.01 0.01 0.01"/>
      <geom class="collision" size="0.08" fromto="0 0 0 0 0 0.1"/>
      <body name="shoulder" pos="0 0 0.163">
        <inertial mass="3.7" pos="0 0.01 0" diaginertia="0.011 0.012 0.013"/>
        <joint name="pan" axis="0 0 1"/>
        <geom class="collision" size="0.06 0.05"/>
        <body name="upper" pos="0 0.138 0" quat="1 0 1 0">
          <inertial mass="8.4" pos="0 0 0.2125" quat="0.9 0.1 0 0.2" diaginertia="0.13 0.13 0.02"/>
          <joint name="lift" ref="-20"/>
          <geom class="visual" type="mesh" mesh="upper" material="blue"/>
          <geom class="collision" size="0.05" fromto="0 0 0 0 0 0.42"/>
          <body name="forearm" pos="0 -0.131 0.425">
            <geom type="capsule" size="0.04" fromto="0 0 0 0 0 0.39" mass="2.3"/>
            <joint name="elbow" pos="0 0 0.01"/>
            <body name="motor" pos="0 0.1 0.1">
              <geom type="box" size="0.05 0.04 0.03" mass="1.1"/>
            </body>
            <body name="wrist_1" pos="0 0 0.392" quat="1 0 1 0">
              <inertial mass="1.2" pos="0 0.1 0" diaginertia="0.003 0.003 0.002"/>
              <joint name="w1" class="small"/>
              <body name="wrist_2" pos="0 0.127 0">
                <inertial mass="1.2" pos="0 0 0.1" diaginertia="0.003 0.003 0.002"/>
                <joint name="w2" axis="0 0 1" class="small"/>
                <body name="wrist_3" pos="0 0 0.1">
                  <inertial mass="0.2" pos="0 0.08 0" diaginertia="1e-4 1e-4 1e-4"/>
                  <joint name="w3" class="small"/>
                  <site name="attachment_site" pos="0 0.1 0" quat="-1 1 0 0"/>
                  <body name="gripper" pos="0 0.1 0">
                    <geom type="box" size="0.05 0.05 0.02" mass="0.9"/>
                    <body name="finger_l">
                      <joint name="fl" type="slide" axis="1 0 0" range="0 0.04"/>
                      <geom type="box" size="0.01 0.01 0.03" mass="0.05"/></body>
                    <body name="finger_r">
                      <joint name="fr" type="slide" axis="1 0 0" range="0 0.04"/>
                      <geom type="box" size="0.01 0.01 0.03" mass="0.05"/></body>
                  </body>
                </body>
              </body>
            </body>
          </body>
        </body>
      </body>
    </body>
    <body name="cube" pos="1 0 0"><freejoint/><geom type="box" size="0.1 0.1 0.1"/></body>
  </worldbody>
  <equality><joint joint1="fr" joint2="fl"/></equality>
  <tendon>
    <fixed name="split"><joint joint="fl" coef="0.5"/><joint joint="fr" coef="0.5"/></fixed>
  </tendon>
  <actuator>
    <general class="arm" name="pan" joint="pan"/>
    <general class="arm" name="lift" joint="lift"/>
    <general class="arm" name="elbow" joint="elbow"/>
    <general class="small" name="w1" joint="w1"/>
    <motor name="w2" joint="w2" gear="50" ctrlrange="-0.5 0.5" forcerange="-1 1"/>
    <motor name="w3" joint="w3" gear="50" ctrlrange="-0.5 0.5"/>
    <position name="fingers" tendon="split" kp="10"/>
  </actuator>
  <sensor><jointpos joint="pan"/></sensor>
  <keyframe><key name="home" qpos="0 0 0 0 0 0 0 0 1 0 0 1 0 0 0" ctrl="0 0 0 0 0 0 0"/></keyframe>
</mujoco>
"""
"""An arm in the manner of collections for MuJoCo: classes, actuators, keyframe, gripper."""


def write_mjcf(folder: Path, *changes: tuple[str, str]) -> Path:
    """Write the MJCF with parts replaced, its mesh beside it."""
    (folder / "assets").mkdir(parents=True, exist_ok=True)
    box = trimesh.creation.box((60, 60, 400))
    box.apply_translation((0, 0, 200))
    box.export(folder / "assets" / "upper.stl")
    text = MJCF
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    (folder / "arm.xml").write_text(text)
    return folder / "arm.xml"
