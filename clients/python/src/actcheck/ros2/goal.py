"""Goals from designators, and reports from results."""

from __future__ import annotations

import array
import importlib
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from actcheck.messages import Call, Report, Thing
from actcheck.pose import Pose
from actcheck.ros2.faults import BrokenNode
from actcheck.ros2.mapping import NAMED, Action


def action_type(name: str) -> Any:
    """The class of an action type such as `nav2_msgs/action/NavigateToPose`."""
    package, _, kind = name.split("/")
    try:
        return getattr(importlib.import_module(f"{package}.action"), kind)
    except (ImportError, AttributeError) as error:
        raise BrokenNode(f"the action type {name} can't be loaded ({error}): is its package built, and sourced?") from None


class Values:
    """Values of the designators of a call, and perceived poses of their objects, in a frame."""

    def __init__(
        self,
        call: Call,
        places: Mapping[str, tuple[float, float, float]],
        frame: str,
        look: Callable[[], Sequence[Thing]],
        stamp: Any,
    ) -> None:
        self._call, self._places, self._frame, self._look, self._stamp = call, places, frame, look, stamp
        self._things: dict[str, Thing] | None = None

    def of(self, name: str, part: str) -> Any:
        """A designator's value or a part of it: `.pose` and so on."""
        if name not in self._call.parameters:
            has = ", ".join(self._call.parameters)
            raise BrokenNode(f"the mapping names {{{name}{part}}}, but {self._call.action} has no such designator; it has {has}")
        value = self._call.parameters[name]
        if not part:
            return value
        if part == ".category":
            return str((self._call.kinds.get(value) or {}).get("category", "")).rpartition("#")[2]
        if str(value) in self._places and part in (".pose", ".position"):
            x, y, heading = self._places[str(value)]
            pose = Pose.upright((x, y, 0.0), heading)
            return pose if part == ".pose" else pose.position
        if self._things is None:
            self._things = {thing.id: thing for thing in self._look()}
        thing = self._things.get(str(value))
        if thing is None:
            if part == ".size" and value in self._call.kinds:
                return np.array(self._call.kinds[value]["size_m"], dtype=float)
            raise LookupError(f"{value} was not seen")
        return {".pose": thing.pose, ".position": thing.pose.position, ".size": thing.size_m}[part]

    def fill(self, message: Any, fields: Mapping[str, Any], path: str = "goal") -> Any:
        """Sets fields of a message. Raises `BrokenNode` for fields that it does not have."""
        types = message.get_fields_and_field_types()
        for name, value in fields.items():
            if name not in types:
                raise BrokenNode(f"the mapping sets {path}.{name}, but its type has only {', '.join(types)}")
            try:
                setattr(message, name, self._value(getattr(message, name), value, f"{path}.{name}", types[name]))
            except (AssertionError, TypeError, ValueError) as error:
                raise BrokenNode(f"the mapping sets {path}.{name} of type {types[name]} to {value!r}, which does not fit: {error}") from None
        return message

    def _value(self, present: Any, value: Any, path: str, kind: str) -> Any:
        if isinstance(value, Mapping):
            return self.fill(present, value, path)
        if isinstance(value, str):
            whole = NAMED.fullmatch(value)
            if whole is None:
                return NAMED.sub(lambda found: str(self.of(found[1], found[2])), value)
            value = self.of(whole[1], whole[2])
        if isinstance(value, Pose):
            return self._pose(present, value, path)
        if isinstance(value, np.ndarray):
            return self._vector(present, value, path)
        if isinstance(value, (list, tuple)) and "/" in kind:
            raise BrokenNode(f"{path} is a list of messages, which a mapping can't hold")
        if isinstance(present, (list, array.array)) and not isinstance(value, (list, tuple)):
            value = [value]
        if isinstance(present, float) and isinstance(value, int):
            return float(value)
        return list(value) if isinstance(value, tuple) else value

    def _pose(self, message: Any, pose: Pose, path: str) -> Any:
        kind = type(message).__name__
        if kind == "PoseStamped":
            message.header.frame_id, message.header.stamp = self._frame, self._stamp
            message.pose = self._pose(message.pose, pose, path)
        elif kind == "Pose":
            message.position = self._vector(message.position, pose.position, path)
            q = message.orientation
            q.x, q.y, q.z, q.w = pose.quaternion()
        elif kind == "Pose2D":
            message.x, message.y, message.theta = float(pose.position[0]), float(pose.position[1]), pose.yaw
        elif kind in ("Point", "Vector3", "PointStamped"):
            return self._vector(message, pose.position, path)
        else:
            raise BrokenNode(f"{path} is of type {kind}, which can't hold a pose")
        return message

    def _vector(self, message: Any, vector: Any, path: str) -> Any:
        if isinstance(message, (list, array.array, np.ndarray)):
            return [float(one) for one in vector]
        if type(message).__name__ == "PointStamped":
            message.header.frame_id, message.header.stamp = self._frame, self._stamp
            self._vector(message.point, vector, path)
        elif all(hasattr(message, axis) for axis in "xyz"):
            message.x, message.y, message.z = (float(one) for one in vector)
        else:
            raise BrokenNode(f"{path} is of type {type(message).__name__}, which can't hold a position")
        return message


def report(action: Action, status: int, result: Any, frame: str) -> Report:
    """The report of an action from the status and the result of its goal."""
    from action_msgs.msg import GoalStatus

    ended = status == GoalStatus.STATUS_SUCCEEDED
    words = {GoalStatus.STATUS_ABORTED: "the goal was aborted", GoalStatus.STATUS_CANCELED: "the goal was cancelled"}.get(status, "")
    if action.succeeded is not None:
        name, wanted = action.succeeded
        ended = ended and field(result, name) == wanted
    message = str(field(result, action.message)) if action.message else words
    perceived = []
    if action.perceived is not None:
        many, pose, size, category = action.perceived
        for number, entry in enumerate(field(result, many)):
            place = f"result.{many}[{number}]"
            perceived.append(Thing(
                id="",
                pose=pose_of(field(entry, pose), frame, place),
                size_m=numbers(field(entry, size), place) if size else np.zeros(3),
                category=str(field(entry, category)) if category else None,
            ))
    return Report(ended, message or words, perceived)


def field(message: Any, path: str) -> Any:
    """A field of a message by its path, such as `status.code`."""
    value = message
    for name in path.split("."):
        if not hasattr(value, name):
            has = ", ".join(value.get_fields_and_field_types()) if hasattr(value, "get_fields_and_field_types") else "none"
            raise BrokenNode(f"the mapping reads the field `{path}`, but the message has no `{name}`; it has {has}")
        value = getattr(value, name)
    return value


def pose_of(message: Any, frame: str, place: str) -> Pose:
    """The pose of a message in the frame of the mapping. Raises `BrokenNode` for other frames and numbers that are none."""
    if hasattr(message, "header"):
        if message.header.frame_id.lstrip("/") != frame:
            raise BrokenNode(f"{place} is in the frame `{message.header.frame_id}`, but the mapping expects `{frame}`")
        message = message.pose
    at, q = numbers(message.position, place), message.orientation
    length = math.sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w)
    if not math.isfinite(length) or abs(length - 1.0) > 0.01:
        raise BrokenNode(f"{place} has an orientation of length {length:g}, but a quaternion of a rotation has length 1")
    sent = {"position_m": at.tolist(), "quaternion_xyzw": [one / length for one in (q.x, q.y, q.z, q.w)]}
    return Pose.from_wire(sent)


def numbers(message: Any, place: str) -> Any:
    """The three numbers of a vector or a sequence, which must be finite."""
    values = [message.x, message.y, message.z] if hasattr(message, "x") else list(message)
    found = np.array([float(one) for one in values])
    if found.shape != (3,) or not np.isfinite(found).all():
        raise BrokenNode(f"{place} holds {found.tolist()}, but must be three finite numbers")
    return found
