"""What the messages of the protocol say, as typed records. SI units, radians; poses in the world as the robot believes it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from actcheck.pose import Pose, Vector
from actcheck.wire import Message

#: The version of the protocol that this package speaks.
PROTOCOL = 1


@dataclass(frozen=True)
class Joint:
    """A joint of the robot."""

    name: str
    #: `revolute`, `prismatic` or `continuous`.
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
    horizontal_fov_rad: float


@dataclass(frozen=True)
class RobotDescription:
    """The robot, as the hello has it."""

    name: str
    urdf: str
    #: In the order of all arrays.
    joints: tuple[Joint, ...]
    #: x, y and heading; empty where the robot stands for good.
    base_joints: tuple[str, ...]
    arm_joints: tuple[str, ...]
    gripper_joints: tuple[str, ...]
    head_joints: tuple[str, ...]
    #: The link that is brought to things.
    tool_link: str
    #: How the tool is turned in it (roll, pitch, yaw; radians): its x points where the fingers point, its y across them.
    tool_turned_rad: tuple[float, float, float]
    #: How high the root of a robot that does not drive stands. Unit: metres.
    mount_height_m: float
    max_opening_m: float
    grip_force_n: float
    #: Arm positions for driving.
    home: tuple[float, ...]
    #: Arm positions to look for others from.
    postures: tuple[tuple[float, ...], ...]
    camera: Camera | None
    #: Time between two commands. Unit: seconds.
    control_period_s: float
    #: Whether messages carry the truth.
    privileged: bool

    @classmethod
    def from_wire(cls, hello: Message) -> RobotDescription:
        """From the simulation's hello."""
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
            **lists,
        )


@dataclass(frozen=True, eq=False)
class Observation:
    """What the robot measures of itself."""

    #: Since the action began. Unit: seconds.
    time_s: float
    #: Of all joints, in the order of the robot's description; the base's by its own belief.
    positions: Vector
    velocities: Vector
    #: What each motor gives beyond what holds the robot's own weight. Units: newtons or newton metres.
    efforts: Vector
    #: x, y and heading of the base by odometry. Units: metres, radians.
    base: tuple[float, float, float]
    #: Gap between the fingers. Unit: metres.
    opening_m: float
    #: What the fingers press with. Unit: newtons.
    force_n: float
    #: Simulated time that the action may still take. Unit: seconds.
    budget_left_s: float
    #: True poses and sizes of all objects, only where the campaign is privileged.
    truth: tuple[Thing, ...] = ()

    @classmethod
    def from_wire(cls, sent: Message) -> Observation:
        """From an observation."""
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
            truth=things_from_wire(sent["truth"]["objects"]) if sent.get("truth") else (),
        )


@dataclass(frozen=True, eq=False)
class Thing:
    """An object as it is perceived: an upright box."""

    id: str
    #: Of the middle of its foot.
    pose: Pose
    #: Along the axes of that pose. Unit: metres.
    size_m: Vector
    #: Class in the ontology, where it is told.
    category: str | None = None
    #: Whether it stands for good.
    furniture: bool = False

    @classmethod
    def from_wire(cls, sent: Message) -> Thing:
        """From an answer's object."""
        return cls(
            id=sent["id"],
            pose=Pose.from_wire(sent["pose"]),
            size_m=np.array(sent["size_m"], dtype=np.float64),
            category=sent.get("category"),
            furniture=bool(sent.get("furniture", False)),
        )

    def beside(self, place: Vector) -> float:
        """How far a place is beside it, seen from above; negative within it. Unit: metres."""
        x, y, _ = self.pose.rotation.T @ (place - self.pose.position)
        return float(max(abs(x) - self.size_m[0] / 2, abs(y) - self.size_m[1] / 2))

    def to_wire(self) -> Message:
        """As the end of an action tells what was perceived."""
        sent: Message = {"pose": self.pose.to_wire(), "size_m": [float(side) for side in self.size_m]}
        return sent if self.category is None else sent | {"category": self.category}


def things_from_wire(sent: Sequence[Message]) -> tuple[Thing, ...]:
    """All objects of an answer."""
    return tuple(Thing.from_wire(one) for one in sent)


@dataclass(frozen=True, eq=False)
class DepthImage:
    """A picture of the depth camera."""

    #: Along the optical axis; what the protocol says stands for nothing seen. Shape: height × width. Unit: metres.
    depth: NDArray[np.float32]
    #: x looks forward, z is up in the picture. Frame: world, by the robot's belief.
    camera_pose: Pose
    horizontal_fov_rad: float


@dataclass(frozen=True, eq=False)
class Report:
    """What an action says of itself when it ends."""

    succeeded: bool
    message: str = ""
    #: What it perceived, for actions that are judged by it.
    perceived: Sequence[Thing] = ()

    def to_wire(self) -> Message:
        """As the message that ends an action."""
        sent: Message = {"type": "end", "succeeded": self.succeeded, "message": self.message}
        if self.perceived:
            sent["perceived"] = [thing.to_wire() for thing in self.perceived]
        return sent


@dataclass(frozen=True, eq=False)
class Call:
    """An action that is to be performed."""

    #: Such as `Pick`.
    action: str
    #: Values by designator: one as it is, several as a list.
    parameters: Mapping[str, Any]
    #: What kind of thing a value stands for (`category`, `size_m`), by value.
    kinds: Mapping[str, Any]
    #: Simulated time that it may take. Unit: seconds.
    budget_s: float
    #: What the robot measures at the beginning.
    observation: Observation
    #: Id of the run.
    run: str = ""
    #: The same for the same campaign seed and run.
    seed: int = 0
