"""Read an MCAP file of ROS 2 messages by other people's programs; printed as JSON.

``ENV/bin/python read_log.py mcap_ros2|rosbags|pybag FILE``; imports nothing of this package.
Topic → rows of [log time, stamp, numbers ...].
"""

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

Found = Iterator[tuple[str, int, Any]]


def mcap_ros2(path: str) -> Found:
    from mcap_ros2.reader import read_ros2_messages  # type: ignore[import-not-found]

    for one in read_ros2_messages(path):
        yield one.channel.topic, one.log_time_ns, one.ros_msg


def rosbags(path: str) -> Found:
    from rosbags.highlevel import AnyReader  # type: ignore[import-not-found]

    with AnyReader([Path(path)]) as reader:
        for connection, time_ns, raw in reader.messages():
            yield connection.topic, time_ns, reader.deserialize(raw, connection.msgtype)


def pybag(path: str) -> Found:
    """Read all but JointState: an empty list is aligned there, as CDR does not."""
    from pybag.mcap_reader import McapFileReader  # type: ignore[import-not-found]

    with McapFileReader.from_file(path) as reader:
        for topic in reader.get_topics():
            if "pose" in topic or "wrench" in topic or topic == "/tf":
                for one in reader.messages(topic):
                    yield topic, one.log_time, one.data


def numbers(message: Any) -> list[float]:
    """Return the stamp [ns] and the numbers of a message in the order of its definition."""
    several = getattr(message, "transforms", None)
    stamp = (message if several is None else several[0]).header.stamp
    found = [stamp.sec * 10**9 + stamp.nanosec]
    if several is not None:
        for one in several:
            found += [*_of(one.transform.translation), *_of(one.transform.rotation)]
    elif hasattr(message, "pose"):
        found += [*_of(message.pose.position), *_of(message.pose.orientation)]
    elif hasattr(message, "wrench"):
        found += [*_of(message.wrench.force), *_of(message.wrench.torque)]
    else:
        found += [*message.position, *message.velocity, *message.effort]
    return [float(number) for number in found]


def _of(part: Any) -> list[float]:
    return [getattr(part, axis) for axis in "xyzw" if hasattr(part, axis)]


if __name__ == "__main__":
    read: dict[str, list[list[float]]] = {}
    for topic, time_ns, message in globals()[sys.argv[1]](sys.argv[2]):
        read.setdefault(topic, []).append([float(time_ns), *numbers(message)])
    json.dump(read, sys.stdout)
