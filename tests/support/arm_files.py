"""Small arm files that have the structure of makers' ones: six hinges like a UR's, and variants."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

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
        return f'<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">{inner}{self.more}</robot>'

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
