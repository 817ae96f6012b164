"""The ROS 2 messages of a log: their definitions, and what makes one of numbers."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from dualbend.logs.cdr import Decoder, Encoder

JOINT_STATE, POSE, WRENCH, TRANSFORMS = (
    "sensor_msgs/msg/JointState",
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/WrenchStamped",
    "tf2_msgs/msg/TFMessage",
)

_FIELDS = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Quaternion": "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1",
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation",
    "geometry_msgs/Wrench": "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque",
    "geometry_msgs/Transform": (
        "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation"
    ),
    "geometry_msgs/TransformStamped": (
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform"
    ),
    "sensor_msgs/JointState": (
        "std_msgs/Header header\nstring[] name\n"
        "float64[] position\nfloat64[] velocity\nfloat64[] effort"
    ),
    "geometry_msgs/PoseStamped": "std_msgs/Header header\ngeometry_msgs/Pose pose",
    "geometry_msgs/WrenchStamped": "std_msgs/Header header\ngeometry_msgs/Wrench wrench",
    "tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms",
}
_PARTS = {
    JOINT_STATE: ("std_msgs/Header", "builtin_interfaces/Time"),
    POSE: (
        *("std_msgs/Header", "builtin_interfaces/Time", "geometry_msgs/Pose"),
        *("geometry_msgs/Point", "geometry_msgs/Quaternion"),
    ),
    WRENCH: (
        *("std_msgs/Header", "builtin_interfaces/Time", "geometry_msgs/Wrench"),
        "geometry_msgs/Vector3",
    ),
    TRANSFORMS: (
        *("geometry_msgs/TransformStamped", "std_msgs/Header", "builtin_interfaces/Time"),
        *("geometry_msgs/Transform", "geometry_msgs/Vector3", "geometry_msgs/Quaternion"),
    ),
}
_RULE = "=" * 80


def definition(name: str) -> str:
    """Return the definition of a message with all that it consists of (encoding ``ros2msg``)."""
    parts = "".join(f"{_RULE}\nMSG: {part}\n{_FIELDS[part]}\n" for part in _PARTS[name])
    return f"{_FIELDS[name.replace('/msg/', '/')]}\n{parts}"


def joint_state(
    time_ns: int, names: Sequence[str], position: Sequence[float], effort: Sequence[float] = ()
) -> bytes:
    """Return a JointState: angles [rad] or positions [m], torques [N m] or forces [N]."""
    made = _headed(time_ns, "")
    made.texts(names)
    for values in (position, (), effort):
        made.list_of_doubles(values)
    return made.message


def stamped(time_ns: int, frame: str, numbers: Iterable[float]) -> bytes:
    """Return a message that is a header and numbers: a PoseStamped (7), a WrenchStamped (6)."""
    made = _headed(time_ns, frame)
    made.doubles(numbers)
    return made.message


def transforms(time_ns: int, found: Iterable[tuple[str, str, Sequence[float]]]) -> bytes:
    """Return a TFMessage: parent, child, place (3) [m] and quaternion x, y, z, w, of each frame."""
    made, several = Encoder(), list(found)
    made.count(len(several))
    for parent, child, numbers in several:
        made.stamp(time_ns)
        made.text(parent)
        made.text(child)
        made.doubles(numbers)
    return made.message


def read_joint_state(message: bytes) -> tuple[int, dict[str, float]]:
    """Return stamp [ns] and positions by name; ValueError where it is no JointState."""
    fields = Decoder(message)
    time_ns = fields.stamp_ns()
    fields.text()
    names, position = fields.texts(), fields.list_of_doubles()
    if len(names) != len(position) or len(set(names)) < len(names):
        raise ValueError(f"{len(names)} names and {len(position)} positions, or a name twice")
    return time_ns, dict(zip(names, position, strict=True))


def _headed(time_ns: int, frame: str) -> Encoder:
    made = Encoder()
    made.stamp(time_ns)
    made.text(frame)
    return made
