"""The messages of the protocol as typed records. SI units, radians; poses in the world as the robot believes it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import NoneType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from actcheck.pose import Pose, Vector
from actcheck.wire import Message

#: Protocol version of this package.
PROTOCOL = 1
#: Longest message of a report. Unit: characters.
LONGEST_MESSAGE = 100_000


@dataclass(frozen=True)
class Joint:
    """A joint of the robot."""

    name: str
    #: `revolute` or `prismatic`.
    kind: str
    #: `base`, `arm`, `gripper`, `head` or `other`.
    role: str
    #: Units: metres or radians.
    lower: float
    upper: float
    #: Largest speed. Units: m/s or rad/s.
    velocity: float
    #: Largest effort. Units: newtons or newton metres.
    effort: float


@dataclass(frozen=True)
class Camera:
    """The depth camera."""

    link: str
    width: int
    height: int
    #: Width of the picture as an angle.
    horizontal_fov_rad: float
    #: Nearest and farthest distance that it measures. Unit: metres.
    min_range_m: float
    max_range_m: float


@dataclass(frozen=True)
class RobotDescription:
    """The robot, as described in the hello message."""

    name: str
    urdf: str
    #: All arrays are in this order.
    joints: tuple[Joint, ...]
    #: x, y and heading; empty if the base is fixed.
    base_joints: tuple[str, ...]
    arm_joints: tuple[str, ...]
    gripper_joints: tuple[str, ...]
    head_joints: tuple[str, ...]
    #: The end effector's link, between the fingertips.
    tool_link: str
    #: Rotation of the tool in that link (roll, pitch, yaw; radians): x points along the fingers, y across them.
    tool_turned_rad: tuple[float, float, float]
    #: Height of the root above its mount: the floor or a surface. Unit: metres.
    mount_height_m: float
    max_opening_m: float
    grip_force_n: float
    #: Arm posture for driving.
    home: tuple[float, ...]
    #: Arm postures to start inverse kinematics from.
    postures: tuple[tuple[float, ...], ...]
    camera: Camera | None
    #: Control period. Unit: seconds.
    control_period_s: float
    #: Whether messages include ground truth.
    privileged: bool
    #: Names of the sensors that the program may ask for.
    sensors: tuple[str, ...] = ()
    #: Version of actcheck.
    actcheck: str = ""
    #: Number of the worker, from 0; behaviour must not depend on it.
    worker: int = 0

    @classmethod
    def from_wire(cls, hello: Message) -> RobotDescription:
        """Converts the simulation's hello message."""
        robot = hello["robot"]
        camera = robot.get("camera")
        names = ("base_joints", "arm_joints", "gripper_joints", "head_joints")
        lists = {name: tuple(robot.get(name) or ()) for name in names}
        return cls(
            name=robot["name"],
            urdf=robot["urdf"],
            joints=tuple(
                Joint(**{name: joint[name] for name in Joint.__dataclass_fields__}) for joint in robot["joints"]
            ),
            tool_link=robot["tool_link"],
            tool_turned_rad=tuple(robot.get("tool_turned_rad") or (0.0, 0.0, 0.0)),
            mount_height_m=float(robot.get("mount_height_m", 0.0)),
            max_opening_m=float(robot["max_opening_m"]),
            grip_force_n=float(robot["grip_force_n"]),
            home=tuple(robot.get("home") or ()),
            postures=tuple(tuple(posture) for posture in robot.get("postures") or ()),
            camera=camera and Camera(**{name: camera[name] for name in Camera.__dataclass_fields__}),
            control_period_s=float(hello["control_period_s"]),
            privileged=bool(hello.get("privileged", False)),
            sensors=tuple(hello.get("sensors") or ()),
            actcheck=str(hello.get("actcheck", "")),
            worker=int(hello.get("worker", 0)),
            **lists,
        )


@dataclass(frozen=True, eq=False)
class Observation:
    """The robot's measurements of itself."""

    #: Since the action began. Unit: seconds.
    time_s: float
    #: Of all joints, in the order of the robot's description; the base joints by the robot's belief.
    positions: Vector
    velocities: Vector
    #: Motor efforts without gravity compensation of the robot's own weight. Units: newtons or newton metres.
    efforts: Vector
    #: x, y and heading of the base by odometry. Units: metres, radians.
    base: tuple[float, float, float]
    #: Gap between the fingers. Unit: metres.
    opening_m: float
    #: Force of the weaker finger. Unit: newtons.
    force_n: float
    #: Simulated time left in the action's budget. Unit: seconds.
    budget_left_s: float
    #: Height of the robot's root above the floor. Unit: metres.
    root_height_m: float
    #: True poses and sizes of all objects; empty unless the program is privileged.
    truth: tuple[Thing, ...] = ()

    @classmethod
    def from_wire(cls, sent: Message) -> Observation:
        """Converts an observation message."""
        joints, base, gripper = sent["joints"], sent["base"], sent["gripper"]
        x, y = base["position_m"]
        return cls(
            time_s=sent["time_s"],
            positions=np.array(joints["positions"], dtype=np.float64),
            velocities=np.array(joints["velocities"], dtype=np.float64),
            efforts=np.array(joints["efforts"], dtype=np.float64),
            base=(x, y, base["heading_rad"]),
            opening_m=gripper["opening_m"],
            force_n=gripper["force_n"],
            budget_left_s=sent["budget_left_s"],
            root_height_m=base["height_m"],
            truth=things_from_wire(sent["truth"]["objects"]) if sent.get("truth") else (),
        )


@dataclass(frozen=True, eq=False)
class Thing:
    """An object as perceived: an upright box."""

    id: str
    #: Pose of the centre of its foot.
    pose: Pose
    #: Dimensions along the axes of that pose. Unit: metres.
    size_m: Vector
    #: Class in the ontology, if known.
    category: str | None = None
    #: Whether it is fixed furniture.
    furniture: bool = False

    @classmethod
    def from_wire(cls, sent: Message) -> Thing:
        """Converts an object of an answer message."""
        return cls(
            id=sent["id"],
            pose=Pose.from_wire(sent["pose"]),
            size_m=np.array(sent["size_m"], dtype=np.float64),
            category=sent.get("category"),
            furniture=bool(sent.get("furniture", False)),
        )

    def beside(self, place: Vector) -> float:
        """Horizontal distance from its outline to a place; negative inside. Unit: metres."""
        x, y, _ = self.pose.rotation.T @ (place - self.pose.position)
        return float(max(abs(x) - self.size_m[0] / 2, abs(y) - self.size_m[1] / 2))

    def to_wire(self) -> Message:
        """Converts to a percept of an `end` message."""
        sent: Message = {"pose": self.pose.to_wire(), "size_m": [float(side) for side in self.size_m]}
        return sent if self.category is None else sent | {"category": self.category}


@dataclass(frozen=True, eq=False)
class Plane:
    """A level surface as perceived."""

    #: Pose of its centre: z is the normal of its upper side, x runs along its first side.
    pose: Pose
    #: Lengths of its two sides. Unit: metres.
    size_m: Vector

    @classmethod
    def on_top_of(cls, thing: Thing) -> Plane:
        """The upper side of an upright box."""
        return cls(thing.pose.moved(z=float(thing.size_m[2])), thing.size_m[:2])

    def to_wire(self) -> Message:
        """Converts to the plane of an `end` message."""
        return {"pose": self.pose.to_wire(), "size_m": [float(side) for side in self.size_m]}


@dataclass(frozen=True, eq=False)
class Held:
    """The object in the hand."""

    #: Pose of its foot when the fingers closed on it.
    pose: Pose
    #: Dimensions along the axes of that pose. Unit: metres.
    size_m: Vector

    @classmethod
    def of(cls, thing: Thing) -> Held:
        """An object as it was perceived before the fingers closed on it."""
        return cls(thing.pose, thing.size_m)

    def to_wire(self) -> Message:
        """Converts to the held object of an `end` message."""
        return {"pose": self.pose.to_wire(), "size_m": [float(side) for side in self.size_m]}


def _check_type(name: str, value: object, words: str, *kinds: type) -> None:
    """Raises `TypeError` if an argument of a report has another type."""
    if not isinstance(value, kinds):
        raise TypeError(f"{name} in a Report must be {words}, not {value!r:.60}")


def things_from_wire(sent: Sequence[Message]) -> tuple[Thing, ...]:
    """Converts all objects of an answer message."""
    return tuple(Thing.from_wire(one) for one in sent)


@dataclass(frozen=True, eq=False)
class DepthImage:
    """A picture of the depth camera."""

    #: Distance along the optical axis; 0 where nothing was measured. Shape: height × width. Unit: metres.
    depth: NDArray[np.float32]
    #: x looks forward, z is up in the picture. Frame: world, by the robot's belief.
    camera_pose: Pose
    horizontal_fov_rad: float
    #: Focal length in pixels: the point of column u and row v at depth d is, in the camera's frame,
    #: (d, d·(width/2 − u − 0.5)/focal_px, d·(height/2 − v − 0.5)/focal_px).
    focal_px: float

    @property
    def width(self) -> int:
        """Number of columns."""
        return int(self.depth.shape[1])

    @property
    def height(self) -> int:
        """Number of rows."""
        return int(self.depth.shape[0])

    @classmethod
    def from_wire(cls, sent: Message) -> DepthImage:
        """Converts an answer message with its array."""
        return cls(
            depth=sent["arrays"]["depth"],
            camera_pose=Pose.from_wire(sent["camera_pose"]),
            horizontal_fov_rad=float(sent["horizontal_fov_rad"]),
            focal_px=float(sent["focal_px"]),
        )


@dataclass(frozen=True, eq=False)
class RgbImage:
    """A colour picture of the camera."""

    #: Red, green and blue in sRGB. Shape: height × width × 3.
    rgb: NDArray[np.uint8]
    #: As of :class:`DepthImage`, whose pixels see the same points.
    camera_pose: Pose
    horizontal_fov_rad: float
    focal_px: float

    @property
    def width(self) -> int:
        """Number of columns."""
        return int(self.rgb.shape[1])

    @property
    def height(self) -> int:
        """Number of rows."""
        return int(self.rgb.shape[0])

    @classmethod
    def from_wire(cls, sent: Message) -> RgbImage:
        """Converts an answer message with its array."""
        return cls(
            rgb=sent["arrays"]["rgb"],
            camera_pose=Pose.from_wire(sent["camera_pose"]),
            horizontal_fov_rad=float(sent["horizontal_fov_rad"]),
            focal_px=float(sent["focal_px"]),
        )


@dataclass(frozen=True, eq=False)
class Report:
    """An action's own report at its end."""

    succeeded: bool
    message: str = ""
    #: The perceived objects, for actions that are judged by them, and for later actions.
    perceived: Sequence[Thing] = ()
    #: The perceived surface, likewise.
    plane: Plane | None = None
    #: The object in the hand, for later actions. Without it, an object that the fingers feel is assumed to be the `pickObject`.
    held: Held | None = None

    def __post_init__(self) -> None:
        """Raises `TypeError` or `ValueError` where the report is made, instead of later, where it is sent."""
        _check_type("succeeded", self.succeeded, "True or False", bool, np.bool_)
        object.__setattr__(self, "succeeded", bool(self.succeeded))
        _check_type("message", self.message, "a text", str)
        if len(self.message) > LONGEST_MESSAGE:
            raise ValueError(f"the message in a Report has {len(self.message)} characters, but must have at most {LONGEST_MESSAGE}")
        _check_type("perceived", self.perceived, "a list of Things", Sequence)
        for thing in self.perceived:
            _check_type("an element of perceived", thing, "a Thing", Thing)
        _check_type("plane", self.plane, "a Plane or None", Plane, NoneType)
        _check_type("held", self.held, "a Held or None", Held, NoneType)
        for one in (*self.perceived, self.plane, self.held):
            if one is not None and not np.isfinite([*one.pose.position, *one.pose.rotation.flat, *one.size_m]).all():
                raise ValueError(f"the pose and the size of a {type(one).__name__} in a Report must be finite")

    def to_wire(self) -> Message:
        """Converts to an `end` message."""
        sent: Message = {"type": "end", "succeeded": self.succeeded, "message": self.message}
        if self.perceived:
            sent["perceived"] = [thing.to_wire() for thing in self.perceived]
        if self.plane is not None:
            sent["plane"] = self.plane.to_wire()
        if self.held is not None:
            sent["held"] = self.held.to_wire()
        return sent


@dataclass(frozen=True, eq=False)
class Call:
    """An action to perform."""

    #: Name of the action, such as `Pick`.
    action: str
    #: Values by designator: a single value, or a list of several.
    parameters: Mapping[str, Any]
    #: Kind of object (`category`, `size_m`) by designator value.
    kinds: Mapping[str, Any]
    #: Budget of simulated time. Unit: seconds.
    budget_s: float
    #: The observation at the start of the action.
    observation: Observation
    #: Id of the run.
    run: str = ""
    #: Seed of the run, the same for the same campaign seed and run.
    seed: int = 0
    #: Position of the run in its campaign, for people.
    index: int = 0
