"""The mapping file: which programs are the nodes under test, and how an action of a campaign becomes a goal of theirs."""

from __future__ import annotations

import difflib
import math
import re
import shlex
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from actcheck.ros2.faults import MappingFault

#: Kinds of launch files.
LAUNCH = (".launch.py", ".launch.xml", ".launch.yaml")
#: A value of the campaign within a text of the mapping.
NAMED = re.compile(r"\{([A-Za-z_]\w*)((?:\.[A-Za-z_]\w*)*)\}")
#: Parts that can follow a designator's name.
PARTS = ("", ".pose", ".position", ".size", ".category")


@dataclass(frozen=True)
class Names:
    """Names of the simulated robot's topics and actions; an empty name leaves the interface out."""

    joint_states: str = "/joint_states"
    robot_description: str = "/robot_description"
    arm: str = "/arm_controller/follow_joint_trajectory"
    head: str = "/head_controller/follow_joint_trajectory"
    gripper: str = "/gripper_controller/gripper_cmd"
    cmd_vel: str = "/cmd_vel"
    odom: str = "/odom"
    navigate: str = "/navigate_to_pose"
    camera: str = "/camera"


@dataclass(frozen=True)
class Action:
    """An action of the campaign, performed by an action server of the nodes."""

    #: Name of the action server.
    server: str
    #: Its type, such as `control_msgs/action/FollowJointTrajectory`.
    type: str
    #: Fields of the goal; texts hold values of the campaign such as `{pickObject.pose}`.
    goal: Mapping[str, Any]
    #: Condition on the result: a field, or a field and its value; without it, the goal's status decides.
    succeeded: tuple[str, Any] | None = None
    #: Field of the result with words for people.
    message: str | None = None
    #: Field of the result with a list of perceived things, and the fields of each: pose, size, category.
    perceived: tuple[str, str, str | None, str | None] | None = None


@dataclass(frozen=True)
class SkillMapping:
    """A mapping file."""

    file: Path
    #: Commands of the nodes, each as words.
    commands: tuple[tuple[str, ...], ...]
    actions: Mapping[str, Action]
    robot: Names = field(default_factory=Names)
    #: Poses of places in the world: x, y (metres) and heading (radians).
    places: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    #: Environment variables of the nodes.
    env: Mapping[str, str] = field(default_factory=dict)
    #: Frame of all poses.
    frame: str = "map"
    #: Messages of the robot's state for each second of simulated time.
    rate_hz: float = 60.0
    #: Images of the depth camera for each second of simulated time, while a node subscribes to them.
    camera_hz: float = 5.0
    #: How long the nodes may take to start, and to compute at one moment. Unit: seconds of wall-clock time.
    startup_s: float = 25.0
    callback_s: float = 20.0


class _Reader:
    """A table of the file: takes keys, and notes faults with their lines."""

    def __init__(self, table: dict[str, Any], path: str, lines: list[str], file: Path, faults: list[str]) -> None:
        self.table, self.path, self.lines, self.file, self.faults = dict(table), path, lines, file, faults
        self.known: list[str] = []

    def fault(self, key: str, words: str) -> None:
        self.faults.append(f"{self.file}:{self._line(key)}: {words}")

    def take(self, key: str, kind: type | tuple[type, ...], default: Any = None, wanted: str = "") -> Any:
        self.known.append(key)
        if key not in self.table:
            return default
        value = self.table.pop(key)
        if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
            self.fault(key, f"`{self.path}{key}` must be {wanted}")
            return default
        return value

    def number(self, key: str, default: float, low: float, high: float) -> float:
        value = self.take(key, (int, float), default, "a number")
        if not math.isfinite(value) or not low <= value <= high:
            self.fault(key, f"`{self.path}{key}` is {value}, but must be between {low:g} and {high:g}")
            return default
        return float(value)

    def end(self) -> None:
        for key in self.table:
            near = difflib.get_close_matches(key, self.known, 1)
            hint = f": did you mean `{near[0]}`?" if near else f"; the known ones are {', '.join(f'`{name}`' for name in self.known)}"
            self.fault(key, f"unknown key `{self.path}{key}`{hint}")

    def _line(self, key: str) -> int:
        """The line of a key: in its table, if the table has a head of its own."""
        start = 0
        if self.path:
            head = re.compile(rf"\s*\[+\s*{re.escape(self.path.rstrip('.'))}\s*\]+")
            start = next((number for number, line in enumerate(self.lines) if head.match(line)), 0)
        word = re.compile(rf"\s*\"?{re.escape(key)}\"?\s*[=.]|\s*\[[^\]]*\b{re.escape(key)}\s*\]|.*\b{re.escape(key)}\s*=")
        for number in range(start, len(self.lines)):
            if word.match(self.lines[number]):
                return number + 1
        return start + 1


def read(file: Path) -> SkillMapping:
    """Reads a mapping file. Raises `MappingFault` with all of its faults."""
    try:
        text = file.read_text()
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8"
        raise MappingFault([f"{file}: it can't be read: {reason}"]) from None
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise MappingFault([f"{file}: it is not TOML: {error}"]) from None
    faults: list[str] = []
    lines = text.splitlines()
    top = _Reader(table, "", lines, file, faults)
    commands = _commands(top)
    places = {}
    for name, at in top.take("places", dict, {}, "a table of [x, y, heading]").items():
        if isinstance(at, list) and len(at) == 3 and all(isinstance(one, (int, float)) and math.isfinite(one) for one in at):
            places[name] = (float(at[0]), float(at[1]), float(at[2]))
        else:
            _Reader({}, "places.", lines, file, faults).fault(name, f"`places.{name}` must be [x, y, heading] in metres and radians")
    given = _Reader(top.take("robot", dict, {}, "a table"), "robot.", lines, file, faults)
    names = Names(**{name: given.take(name, str, default, "a name") for name, default in Names().__dict__.items()})
    given.end()
    actions = {}
    asked = top.take("actions", dict, {}, "a table of actions")
    for name, content in asked.items():
        if isinstance(content, dict):
            actions[name] = _action(_Reader(content, f"actions.{name}.", lines, file, faults), places)
        else:
            top.fault(name, f"`actions.{name}` must be a table")
    if not asked:
        top.fault("actions", "no action is mapped: add a table such as [actions.Pick] with `server`, `type` and `goal`")
    env = top.take("env", dict, {}, "a table of texts")
    mapping = SkillMapping(
        file=file,
        commands=commands,
        actions=actions,
        robot=names,
        places=places,
        env={key: str(value) for key, value in env.items()},
        frame=top.take("frame", str, "map", "the name of a frame"),
        rate_hz=top.number("rate_hz", 60.0, 1.0, 1000.0),
        camera_hz=top.number("camera_hz", 5.0, 0.0, 60.0),
        startup_s=top.number("startup_s", 25.0, 0.1, 3600.0),
        callback_s=top.number("callback_s", 20.0, 0.1, 3600.0),
    )
    top.end()
    if faults:
        raise MappingFault(faults)
    return mapping


def _commands(top: _Reader) -> tuple[tuple[str, ...], ...]:
    given = top.take("test_launcher", (str, list), None, "a command, or a list of commands")
    if given is None:
        if not any("test_launcher" in fault for fault in top.faults):
            top.fault("test_launcher", 'it lacks `test_launcher`, such as "python3 my_node.py" or "bringup.launch.py"')
        return ()
    texts = [given] if isinstance(given, str) else given
    commands = []
    for text in texts:
        try:
            words = shlex.split(text) if isinstance(text, str) else []
        except ValueError as error:
            top.fault("test_launcher", f"`test_launcher` is not a command: {error}")
            continue
        if not words:
            top.fault("test_launcher", "`test_launcher` must be a command, or a list of commands")
            continue
        commands.append(tuple(words))
    return tuple(commands)


def _action(table: _Reader, places: Mapping[str, Any]) -> Action:
    server = table.take("server", str, "", "the name of an action server")
    kind = table.take("type", str, "", "a type such as nav2_msgs/action/NavigateToPose")
    if not server:
        table.fault("server", f"`{table.path}server` is missing: the name of the action server, such as /pick")
    if not re.fullmatch(r"\w+/action/\w+", kind):
        table.fault("type", f"`{table.path}type` must be of the form PACKAGE/action/NAME, such as nav2_msgs/action/NavigateToPose")
    goal = table.take("goal", dict, {}, "a table with the goal's fields")
    for text in _texts(goal):
        for name, part in NAMED.findall(text):
            if part not in PARTS:
                table.fault("goal", f"`{{{name}{part}}}`: after a designator's name, there can be {', '.join(PARTS[1:])}")
    given = _Reader(table.take("result", dict, {}, "a table"), f"{table.path}result.", table.lines, table.file, table.faults)
    succeeded = None
    condition = given.take("succeeded", str, None, 'a field such as "success", or "error_code == 0"')
    if condition:
        name, _, value = (part.strip() for part in condition.partition("=="))
        try:
            succeeded = (name, tomllib.loads(f"value = {value}")["value"] if value else True)
        except tomllib.TOMLDecodeError:
            given.fault("succeeded", f"`{given.path}succeeded`: `{value}` is not a value; a text is written in quotes")
    message = given.take("message", str, None, "a field of the result")
    perceived = None
    things = given.take("perceived", dict, None, "a table with `list` and `pose`")
    if things is not None:
        reader = _Reader(things, f"{given.path}perceived.", table.lines, table.file, table.faults)
        fields = [reader.take(name, str, None, "a field") for name in ("list", "pose", "size", "category")]
        if not fields[0] or not fields[1]:
            reader.fault("list", f"`{given.path}perceived` needs `list`, a field of the result, and `pose`, a field of its entries")
        reader.end()
        perceived = (fields[0] or "", fields[1] or "", fields[2], fields[3])
    given.end()
    table.end()
    return Action(server, kind, goal, succeeded, message, perceived)


def _texts(value: Any) -> list[str]:
    if isinstance(value, str):
        return [value]
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else []
    return [text for one in inner for text in _texts(one)]
