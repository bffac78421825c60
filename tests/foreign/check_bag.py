"""Reads a bag with rosbags and with mcap-ros2-support, and checks it: every message deserialises, types are those of ROS 2, and every
frame leads to `map` at all times. Prints a summary as JSON."""

import json
import math
import sys
import xml.etree.ElementTree as ET

from mcap_ros2.reader import read_ros2_messages
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

OURS = ("actcheck_msgs/", "vision_msgs/")


def with_rosbags(path):
    """All messages by topic; each must give the same bytes when it is written again."""
    known = get_typestore(Stores.ROS2_JAZZY)
    store = get_typestore(Stores.EMPTY)
    found = {}
    with Reader(path) as reader:
        for connection in reader.connections:
            types = get_types_from_msg(connection.msgdef.data, connection.msgtype)
            for name, definition in types.items():
                if not name.startswith(OURS):
                    assert definition[1] == known.fielddefs[name][1], f"{name} has other fields in ROS 2"
            store.register({name: kind for name, kind in types.items() if name not in store.fielddefs})
            assert connection.ext.serialization_format == "cdr"
            assert connection.ext.offered_qos_profiles, connection.topic
        for connection, nanos, data in reader.messages():
            message = store.deserialize_cdr(data, connection.msgtype)
            again = store.serialize_cdr(message, connection.msgtype)
            assert bytes(again) == bytes(data), f"{connection.topic} at {nanos}"
            found.setdefault(connection.topic, []).append((nanos, message))
    return found


def secs(stamp):
    return stamp.sec * 1_000_000_000 + stamp.nanosec


def check_frames(found):
    """Every frame has one parent, and from each a chain leads to `map`, in every message."""
    parents, static = {}, {}

    def see(transform, into):
        child, parent = transform.child_frame_id, transform.header.frame_id
        assert parents.setdefault(child, parent) == parent, f"{child} has two parents"
        turn = transform.transform.rotation
        length = math.sqrt(turn.x**2 + turn.y**2 + turn.z**2 + turn.w**2)
        assert abs(length - 1) < 1e-3, f"{child}: {length}"
        into[child] = parent

    for _, message in found["/tf_static"]:
        for transform in message.transforms:
            see(transform, static)
    times = []
    for nanos, message in found["/tf"]:
        now = dict(static)
        for transform in message.transforms:
            assert transform.child_frame_id not in static, f"{transform.child_frame_id} is static too"
            assert secs(transform.header.stamp) == nanos
            see(transform, now)
        for frame in now:
            seen = frame
            for _ in range(len(now) + 1):
                if seen == "map":
                    break
                seen = now[seen]
            assert seen == "map", f"{frame} does not lead to map"
        assert set(now) == set(parents) or not times, "a frame is missing"
        times.append(nanos)
    assert times == sorted(set(times))
    return parents, times


def main(path):
    found = with_rosbags(path)
    parents, times = check_frames(found)
    links = []
    for _, message in found.get("/robot_description", []):
        links = [link.get("name") for link in ET.fromstring(message.data).iter("link")]
        assert set(links) <= set(parents) | {"map"}, set(links) - set(parents)
    for nanos, message in found.get("/joint_states", []):
        names = list(message.name)
        assert len(set(names)) == len(names) > 0
        for values in (message.position, message.velocity, message.effort):
            assert len(values) == len(names) and all(math.isfinite(value) for value in values)
        assert secs(message.header.stamp) == nanos
    markers = {}
    for _, message in found["/markers"]:
        for marker in message.markers:
            assert marker.header.frame_id in parents or marker.header.frame_id == "map", marker.header.frame_id
            assert marker.type in (1, 2, 3, 11) and (marker.type == 11) == bool(len(marker.points))
            assert min(marker.scale.x, marker.scale.y, marker.scale.z) > 0 and 0 < marker.color.a <= 1
            markers.setdefault(marker.ns, set()).add(marker.header.frame_id)
    outcomes = [
        {value.key: value.value for value in status.values} | {"level": int(status.level), "run": status.hardware_id}
        for _, message in found["/diagnostics"]
        for status in message.status
    ]
    counts = {topic: len(messages) for topic, messages in found.items()}
    other = {}
    for message in read_ros2_messages(path):
        other[message.channel.topic] = other.get(message.channel.topic, 0) + 1
    assert other == counts, (other, counts)
    print(
        json.dumps(
            {
                "counts": counts,
                "frames": parents,
                "links": links,
                "first": times[0],
                "last": times[-1],
                "markers": {name: sorted(frames) for name, frames in markers.items()},
                "outcomes": outcomes,
                "strongest": max(
                    (c.force for _, m in found.get("/contacts", []) for c in m.contacts),
                    default=0,
                ),
                "percepts": [d.id for _, m in found.get("/percepts", []) for d in m.detections],
            }
        )
    )


main(sys.argv[1])
