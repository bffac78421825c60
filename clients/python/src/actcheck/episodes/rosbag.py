"""ROS 2 bags (MCAP and SQLite): transforms, joint states, Gazebo's model states and contacts. One bag is one episode.

The states are at the times of the model states, or of the transforms if there are none; other messages hold until the next one.
Times are those at which the bag received the messages.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from actcheck.episodes.faults import EpisodeFault, missing_package
from actcheck.episodes.sources import Episode, Source
from actcheck.recording.file import EpisodeFile
from actcheck.recording.model import Model, body, world
from actcheck.recording.states import Array, Contacts, Integers, States

_MAGIC = {b"\x89MCAP0\r\n", b"SQLite f"}
_TRANSFORMS, _JOINTS = "tf2_msgs/msg/TFMessage", "sensor_msgs/msg/JointState"
_MODELS, _CONTACTS = "gazebo_msgs/msg/ModelStates", "gazebo_msgs/msg/ContactsState"
_KINDS = (_TRANSFORMS, _JOINTS, _MODELS, _CONTACTS)
#: Names of a root frame, the preferred one first.
_ROOTS = ("world", "map")
_TIME = "times are those at which the bag received the messages; values hold until the next message"


@dataclass
class _Track:
    """The values of one frame, body or joint over time."""

    times: list[int] = field(default_factory=list)
    values: list[Any] = field(default_factory=list)

    def add(self, time: int, value: Any) -> None:
        self.times.append(time)
        self.values.append(value)

    def at(self, times: Integers) -> Array:
        """The most recent values; the first one before that. Shape: times × values."""
        order = np.argsort(self.times, kind="stable")
        index = np.searchsorted(np.array(self.times)[order], times, "right") - 1
        return np.array(self.values, np.float64)[order][np.maximum(index, 0)]


@dataclass
class _Bag:
    """The topics of a bag."""

    #: Child frame → poses in the parent frame.
    frames: dict[str, _Track] = field(default_factory=dict)
    parents: dict[str, str] = field(default_factory=dict)
    static: set[str] = field(default_factory=set)
    #: Model → pose and velocity in the world.
    models: dict[str, _Track] = field(default_factory=dict)
    #: Joint → position, velocity, effort; not a number where absent.
    joints: dict[str, _Track] = field(default_factory=dict)
    contact_times: list[int] = field(default_factory=list)
    contacts: list[list[Any]] = field(default_factory=list)
    notes: dict[str, str] = field(default_factory=dict)


def recognised(path: Path) -> bool:
    """Whether a path is a bag's folder, its `metadata.yaml`, or a bag's file."""
    if path.is_dir() or path.name == "metadata.yaml":
        return (path if path.is_dir() else path.parent).joinpath("metadata.yaml").is_file()
    with path.open("rb") as stream:
        return stream.read(8) in _MAGIC


def episodes(source: Source) -> Iterator[Episode]:
    """Yields the only episode of a bag."""
    yield Episode("bag", lambda path: _convert(source, path))


def _convert(source: Source, path: Path) -> None:
    bag = _read(source.path.parent if source.path.name == "metadata.yaml" else source.path)
    if not bag.frames and not bag.models:
        raise EpisodeFault("no-states", f"{source.path} has neither transforms nor model states: record /tf and /tf_static")
    moving, fixed = _poses(bag)
    times = _times(bag)
    if not len(times):
        raise EpisodeFault("no-states", f"{source.path} has no transform or model state that changes with time")
    at = times - times[0]
    states, model = _states(bag, moving, times, at), _model(bag, moving, fixed)
    episode = EpisodeFile(path, model)
    try:
        episode.write(states)
        lacks = ["contact_forces", "joint_limits", "controls", "reward", "success", "masses", "frictions", "shapes"]
        if states.contacts is not None:
            lacks.remove("contact_forces")
        lacks += [name for name, values in _quantities(states).items() if values is None]
        named = {"engine": "", "engine_version": "", "environment": "", "task": "", "lacks": ",".join(lacks), "note.time": _TIME}
        episode.close(source.metadata("rosbag2", "bag") | named | bag.notes)
    except BaseException:
        episode.discard()
        raise


def _quantities(states: States) -> dict[str, Any]:
    return {
        "contacts": states.contacts,
        "velocities": states.velocities,
        "joints": states.joint_positions,
        "joint_velocities": states.joint_velocities,
        "joint_efforts": states.joint_efforts,
    }


def _read(path: Path) -> _Bag:
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as fault:
        raise missing_package("rosbags", "a ROS 2 bag") from fault
    bag = _Bag()
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
            wanted = [connection for connection in reader.connections if connection.msgtype in _KINDS]
            if not wanted:
                found = ", ".join(sorted({connection.msgtype for connection in reader.connections})) or "nothing"
                raise EpisodeFault("no-states", f"{path} has {found}; needed are {_TRANSFORMS} or {_MODELS}")
            for connection, time, raw in reader.messages(connections=wanted):
                _take(bag, connection, time, reader.deserialize(raw, connection.msgtype))
    except EpisodeFault:
        raise
    except Exception as fault:  # the readers of bags raise exceptions of many kinds for damaged files
        raise EpisodeFault("damaged", f"{path} can't be read as a ROS 2 bag: {' '.join(str(fault).split())}") from fault
    return bag


def _take(bag: _Bag, connection: Any, time: int, message: Any) -> None:
    if connection.msgtype == _TRANSFORMS:
        for transform in message.transforms:
            child = transform.child_frame_id.lstrip("/")
            bag.parents[child] = transform.header.frame_id.lstrip("/")
            if connection.topic.endswith("tf_static"):
                bag.static.add(child)
            moved, turned = transform.transform.translation, transform.transform.rotation
            bag.frames.setdefault(child, _Track()).add(time, [moved.x, moved.y, moved.z, turned.x, turned.y, turned.z, turned.w])
    elif connection.msgtype == _JOINTS:
        for at, name in enumerate(message.name):
            values = [part[at] if at < len(part) else np.nan for part in (message.position, message.velocity, message.effort)]
            bag.joints.setdefault(name, _Track()).add(time, values)
    elif connection.msgtype == _MODELS:
        for name, pose, twist in zip(message.name, message.pose, message.twist, strict=True):
            values = [getattr(pose.position, axis) for axis in "xyz"] + [getattr(pose.orientation, axis) for axis in "xyzw"]
            values += [getattr(part, axis) for part in (twist.linear, twist.angular) for axis in "xyz"]
            bag.models.setdefault(name, _Track()).add(time, values)
    else:
        bag.contact_times.append(time)
        bag.contacts.append(list(message.states))


def _times(bag: _Bag) -> Integers:
    """Times of the states: from the moment when every moving frame and model is known."""
    tracks = list(bag.models.values()) or [track for name, track in bag.frames.items() if name not in bag.static]
    if not tracks:
        return np.zeros(0, np.int64)
    times = np.unique(np.concatenate([np.array(track.times, np.int64) for track in tracks]))
    known = max(min(track.times) for track in tracks)
    return times[times >= known]


def _root(bag: _Bag) -> str:
    roots = sorted({parent for parent in bag.parents.values() if parent not in bag.parents})
    for name in (*_ROOTS, *roots):
        if name in roots:
            return name
    raise EpisodeFault("damaged", "the transforms have no root frame: each frame is below another one")


def _chains(bag: _Bag) -> dict[str, list[str]]:
    """Frames below the root → the frames from the root to each. Others are left out with a note."""
    if not bag.frames:
        return {}
    root, chains, left = _root(bag), {}, []
    for frame in bag.frames:
        chain = [frame]
        while bag.parents.get(chain[-1], root) != root and len(chain) <= len(bag.frames):
            chain.append(bag.parents[chain[-1]])
        if bag.parents.get(chain[-1]) == root:
            chains[frame] = chain[::-1]
        else:
            left.append(frame)
    bag.notes["note.frames"] = f"poses are in the frame {root}" + (f"; not connected to it: {', '.join(sorted(left))}" if left else "")
    return chains


@dataclass(frozen=True)
class _Placed:
    """A body and the tracks that give its pose: one of a model, or those of a chain of frames."""

    name: str
    tracks: list[_Track]
    parent: str | None = None

    def poses(self, times: Integers) -> Array:
        """Shape: times × 7."""
        pose = self.tracks[0].at(times)[:, :7]
        for track in self.tracks[1:]:
            pose = _composed(pose, track.at(times))
        pose[:, 3:] /= np.linalg.norm(pose[:, 3:], axis=1, keepdims=True)
        return pose


def _poses(bag: _Bag) -> tuple[list[_Placed], list[_Placed]]:
    """The moving and the fixed bodies. A model replaces a frame of the same name."""
    moving = [_Placed(name, [track]) for name, track in bag.models.items() if name != "world"]
    fixed: list[_Placed] = []
    for frame, chain in _chains(bag).items():
        placed = _Placed(frame, [bag.frames[name] for name in chain], chain[-2] if len(chain) > 1 else None)
        if frame not in bag.models and frame != "world":
            (fixed if set(chain) <= bag.static else moving).append(placed)
    return moving, fixed


def _composed(outer: Array, inner: Array) -> Array:
    """The pose `inner`, given in the frame `outer`. Shape: times × 7."""
    x, y, z, w = outer[:, 3:].T
    a, b, c, d = inner[:, 3:].T
    turned = np.stack(
        [w * a + x * d + y * c - z * b, w * b - x * c + y * d + z * a, w * c + x * b - y * a + z * d, w * d - x * a - y * b - z * c], 1
    )
    axis = outer[:, 3:6]
    twice = 2 * np.cross(axis, inner[:, :3])
    moved = outer[:, :3] + inner[:, :3] + w[:, None] * twice + np.cross(axis, twice)
    return np.concatenate([moved, turned], 1)


def _states(bag: _Bag, moving: list[_Placed], times: Integers, at: Integers) -> States:
    poses = np.stack([placed.poses(times) for placed in moving], 1)
    if not np.isfinite(poses).all():
        raise EpisodeFault("not-finite", "a pose in the bag has a number that is not finite, or a quaternion of length 0")
    known = all(placed.name in bag.models for placed in moving)
    velocities = np.stack([bag.models[placed.name].at(times)[:, 7:] for placed in moving], 1) if known else None
    joints = np.stack([track.at(times) for track in bag.joints.values()], 1) if bag.joints else np.zeros((len(times), 0, 3))
    parts = [joints[..., part] if joints.size and np.isfinite(joints[..., part]).all() else None for part in range(3)]
    position, velocity, effort = parts
    return States(at, poses, velocities, position, velocity, effort, contacts=_contacts(bag, moving, times))


def _model(bag: _Bag, moving: list[_Placed], fixed: list[_Placed]) -> Model:
    model: Model = {"bodies": [world()], "joints": [], "actuators": [], "sites": [], "timestep": None, "gravity": [0.0, 0.0, -9.81]}
    for placed in fixed:
        made, pose = body(placed.name, moves=False), placed.poses(np.zeros(1, np.int64))[0].tolist()
        made["position"], made["rotation"] = pose[:3], pose[3:]
        model["bodies"].append(made)
    model["bodies"] += [body(placed.name, moves=True) for placed in moving]
    index = {made["name"]: at for at, made in enumerate(model["bodies"])}
    for placed in moving + fixed:
        model["bodies"][index[placed.name]]["parent"] = index.get(placed.parent) if placed.parent else None
    for name in bag.joints:
        model["joints"].append({"name": name, "body": 0, "kind": "hinge", "limits": None, "max_effort": None, "max_velocity": None})
    if bag.joints:
        bag.notes["note.joints"] = "the bag has neither kinds nor bodies of the joints; all are described as hinges of the world"
    return model


def _contacts(bag: _Bag, moving: list[_Placed], times: Integers) -> Contacts | None:
    """Contacts of the most recent message at each time. A collision such as `cube::link::collision` belongs to the body `cube`."""
    if not bag.contact_times:
        return None
    fixed = len(_fixed(bag))
    index = {placed.name: 1 + fixed + at for at, placed in enumerate(moving)}
    latest = np.searchsorted(bag.contact_times, times, "right") - 1
    rows: list[list[Any]] = []
    counts, unknown = [], set()
    for message in latest.tolist():
        begin = len(rows)
        for state in bag.contacts[message] if message >= 0 else []:
            first, second = (_body_of(name, index) for name in (state.collision1_name, state.collision2_name))
            unknown |= {name for name, at in ((state.collision1_name, first), (state.collision2_name, second)) if at == 0}
            rows += _points(state, first, second)
        counts.append(len(rows) - begin)
    if unknown:
        bag.notes["note.contacts"] = f"without a body of their own, counted to the world: {', '.join(sorted(unknown))}"
    table = np.array(rows, np.float64).reshape(-1, 10)
    bodies = table[:, :2].astype(np.int64)
    return Contacts(np.array(counts), bodies[:, 0], bodies[:, 1], table[:, 2], table[:, 3:6], table[:, 6:9], table[:, 9])


def _fixed(bag: _Bag) -> list[_Placed]:
    return _poses(bag)[1]


def _body_of(collision: str, index: dict[str, int]) -> int:
    parts = collision.split("::")
    for name in ("::".join(parts[:2]), parts[0], parts[1] if len(parts) > 1 else ""):
        if name in index:
            return index[name]
    return 0


def _points(state: Any, first: int, second: int) -> list[list[float]]:
    """The contact points of two bodies. Gazebo's wrenches act on the first body; its depths are positive."""
    rows = []
    for wrench, point, normal, depth in zip(state.wrenches, state.contact_positions, state.contact_normals, state.depths, strict=False):
        force = -np.array([wrench.force.x, wrench.force.y, wrench.force.z])
        along = abs(float(force @ np.array([normal.x, normal.y, normal.z])))
        rows.append([first, second, along, *force.tolist(), point.x, point.y, point.z, -float(depth)])
    return rows
