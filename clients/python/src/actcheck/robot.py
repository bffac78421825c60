"""The robot as a skill sees it."""

from __future__ import annotations

import difflib
import math
import operator
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from actcheck.faults import Failed, Unreachable
from actcheck.kinematics import Chain, UrdfJoint, on_base, read_urdf, rotation
from actcheck.limits import FARTHEST_M, LARGEST_ANGLE, within
from actcheck.messages import (
    Call,
    DepthImage,
    Held,
    Joint,
    Observation,
    Plane,
    Report,
    RgbImage,
    RobotDescription,
    Thing,
    things_from_wire,
)
from actcheck.motion import course
from actcheck.pose import Pose, Vector, wrapped
from actcheck.session import Session
from actcheck.wire import Message

#: Joint positions by name, or the arm's positions in order.
Joints = Mapping[str, float] | Sequence[float] | Vector

#: Fingers that close more slowly than this have stalled. Unit: m/s.
STALLED = 0.003
#: Number of ticks after which slow fingers count as stalled; a short rest when they reverse does not count.
STALLED_TICKS = 10
#: Share of the grip force that stalled fingers must exert.
FELT_SHARE = 0.7
#: Longest time for the fingers to move. Unit: seconds.
LONGEST_GRIP_S = 2.5


class Ended(BaseException):
    """A skill ended its action with `Robot.end`. Not an `Exception`, so that a skill's own handlers don't catch it."""

    def __init__(self, report: Report) -> None:
        super().__init__(report.message)
        self.report = report


class Robot:
    """Commands and measurements for the duration of one action. Time passes only in commands."""

    def __init__(self, session: Session, call: Call, urdf: list[UrdfJoint] | None = None) -> None:
        self._session = session
        self.description: RobotDescription = session.description
        self.call = call
        self._urdf = on_base(urdf or read_urdf(self.description.urdf), self.description.base_joints)
        self._chains: dict[str, Chain] = {}
        self._numbers = {joint.name: number for number, joint in enumerate(self.description.joints)}
        self._observation = call.observation
        #: The last commanded position of each joint, by name.
        self.commanded: dict[str, float] = dict(zip(self._numbers, call.observation.positions.tolist()))

    # Data available without a request.

    @property
    def tick_s(self) -> float:
        """Control period. Unit: seconds."""
        return self.description.control_period_s

    def observe(self) -> Observation:
        """The last observation; no time passes."""
        return self._observation

    def joints(self) -> dict[str, float]:
        """Measured joint positions by name."""
        return dict(zip(self._numbers, self._observation.positions.tolist()))

    def fk(self, joints: Joints | None = None, link: str | None = None) -> Pose:
        """Pose of the tool or of another link; joints that are not given are at their measured positions."""
        positions = self.joints() if joints is None else self.joints() | self._named(joints)
        return self._chain(link or self.description.tool_link).pose(positions)

    def ik(self, pose: Pose, *, near: Joints | None = None, base: bool = True, link: str | None = None) -> dict[str, float]:
        """Positions of the arm and, unless `base` is false, of the base that bring the tool to a pose. Raises `Unreachable`.

        The search starts from `near` if it is given, otherwise from the postures of the robot's profile, then from the current
        posture. If the start does not include a base pose, the base is placed so that the hand is over the target. Collisions
        are ignored, also those of the robot with itself.
        """
        check_pose(pose)
        chain = self._chain(link or self.description.tool_link)
        movable = set(self.description.arm_joints) | (set(self.description.base_joints) if base else set())
        now = self.joints()
        postures = [*self.description.postures, self.description.home, ()]
        given = [self._named(near)] if near is not None else [dict(zip(self.description.arm_joints, it)) for it in postures]
        seeds = [now | seed for seed in given]
        if base and len(self.description.base_joints) == 3:
            stands = set(self.description.base_joints)
            seeds = [it if stands <= seed.keys() else self._standing_over(it, chain, pose) for it, seed in zip(seeds, given)]
        found = chain.solve(pose, seeds, frozenset(chain.names) - movable)
        return {name: position for name, position in found.items() if name in movable}

    # Commands.

    def step(
        self,
        positions: Joints | None = None,
        *,
        velocities: Mapping[str, float] | None = None,
        efforts: Mapping[str, float] | None = None,
        base_velocity: Sequence[float] | None = None,
        gripper: float | tuple[float, float] | None = None,
        head: tuple[float | None, float | None] | None = None,
        ticks: int = 1,
    ) -> Observation:
        """Sends one command and returns the observation after its ticks. Anything not named keeps its previous target.

        Raises `ValueError` for an unknown joint and for a target beyond its limits, such as degrees or millimetres.

        `positions`, `velocities` and `efforts` by joint; `base_velocity` forwards, to the left (m/s) and turning (rad/s), in
        the base's frame; `gripper` as the gap between the fingers (metres), or as gap and force (newtons); `head` as pan and
        tilt (radians), `None` for one that keeps its target.
        """
        message: Message = {"type": "command", "ticks": operator.index(ticks)}
        if message["ticks"] < 1:
            raise ValueError(f"`ticks` is {ticks}, but must be at least 1")
        if positions is not None:
            message["positions"] = named = self._checked(positions, "position")
            self.commanded.update(named)
        if velocities is not None:
            message["velocities"] = self._checked(velocities, "velocity")
        if efforts is not None:
            message["efforts"] = self._checked(efforts, "effort")
        if base_velocity is not None:
            message["base_velocity"] = self._checked_base(base_velocity)
        if gripper is not None:
            opening, force = gripper if isinstance(gripper, tuple) else (gripper, self.description.grip_force_n)
            message["gripper"] = {"opening_m": self._checked_opening(opening), "force_n": self._checked_force(force)}
        if head is not None:
            pan, tilt = head
            turned = dict(zip(("pan_rad", "tilt_rad"), (pan, tilt)))
            message["head"] = {name: float(angle) for name, angle in turned.items() if angle is not None}
            targets = zip(self.description.head_joints, (pan, tilt))
            self._checked({joint: angle for joint, angle in targets if angle is not None}, "position")
        return self._command(message)

    def wait(self, seconds: float) -> Observation:
        """Waits for a simulated time."""
        within("the time to wait", seconds, (0.0, math.inf), "s")
        ticks = math.ceil(seconds / self.tick_s - 1e-9)
        return self._command({"type": "command", "ticks": ticks}) if ticks > 0 else self._observation

    def follow(
        self,
        waypoints: Sequence[Joints],
        seconds: float = 0.0,
        until: Callable[[Observation], bool] | None = None,
    ) -> Observation:
        """Moves through joint positions, at rest at both ends, within the joints' velocity limits and in at least `seconds`.

        Joints that a waypoint does not name keep their targets. The motion stops early when `until` returns true.
        """
        within("the duration", seconds, (0.0, math.inf), "s")
        way = [self._checked(waypoint, "position") for waypoint in waypoints]
        names = list(dict.fromkeys(name for waypoint in way for name in waypoint))
        points = [[self.commanded[name] for name in names]]
        for waypoint in way:
            points.append([waypoint.get(name, before) for name, before in zip(names, points[-1])])
        speeds = np.array([self.description.joints[self._numbers[name]].velocity for name in names])
        rows = course([np.array(point) for point in points], speeds, self.tick_s, seconds)
        for row in rows.tolist():
            positions = dict(zip(names, row))
            self.commanded.update(positions)
            self._command({"type": "command", "ticks": 1, "positions": positions})
            if until is not None and until(self._observation):
                break
        return self._observation

    def move_joints(self, target: Joints, seconds: float = 0.0) -> Observation:
        """Moves to joint positions, at rest at both ends."""
        return self.follow([target], seconds)

    def move_straight(self, *poses: Pose, seconds: float = 0.0, step_m: float = 0.03, base: bool = False) -> Observation:
        """Moves the tool to poses along straight lines from its commanded pose. Raises `Unreachable`."""
        for pose in poses:
            check_pose(pose)
        joints, start, way = dict(self.commanded), self.fk(self.commanded), []
        for pose in poses:
            pieces = max(1, math.ceil(float(np.linalg.norm(pose.position - start.position)) / step_m))
            for piece in range(1, pieces + 1):
                place = start.position + (pose.position - start.position) * (piece / pieces)
                try:
                    joints |= self.ik(Pose(place, pose.rotation), near=joints, base=base)
                except Unreachable as fault:
                    raise Unreachable(f"no straight way to {pose}: {fault}") from fault
                way.append(dict(joints))
            start = pose
        movable = (*self.description.base_joints, *self.description.arm_joints)
        return self.follow([{name: at[name] for name in movable} for at in way], seconds)

    def drive(self, x: float, y: float, heading: float, seconds: float = 0.0) -> Observation:
        """Drives straight to a pose, turning on the way. Frame: world, by the robot's belief. Units: metres, radians."""
        names = self.description.base_joints
        for name, value in (("x", x), ("y", y)):
            within(f"{name} of the base", value, (-FARTHEST_M, FARTHEST_M), "m")
        now = self.commanded[names[2]]
        # A heading may continue the turns that the base has made.
        within("the heading", heading, (min(0.0, now) - LARGEST_ANGLE, max(0.0, now) + LARGEST_ANGLE), "rad")
        turned = now + wrapped(heading - now)
        return self.follow([dict(zip(names, (x, y, turned)))], seconds)

    def base_velocity(self, forward: float, left: float = 0.0, turn: float = 0.0, *, ticks: int = 1) -> Observation:
        """Drives at a velocity for some ticks. Units: m/s, rad/s. Frame: the base's."""
        return self.step(base_velocity=(forward, left, turn), ticks=ticks)

    def gripper(self, opening_m: float, force_n: float | None = None, wait: bool = True) -> Observation:
        """Moves the fingers to a gap and, unless `wait` is false, waits until they arrive or stall on something."""
        force = self.description.grip_force_n if force_n is None else force_n
        self.step(gripper=(opening_m, force))
        still, before = 0, math.inf
        for _ in range(math.ceil(LONGEST_GRIP_S / self.tick_s) if wait else 0):
            seen = self.step()
            speed, before = abs(seen.opening_m - before) / self.tick_s / 2.0, seen.opening_m
            resting = speed < STALLED and (seen.force_n > FELT_SHARE * force or abs(seen.opening_m - opening_m) < 2e-3)
            still = still + 1 if resting else 0
            if still >= STALLED_TICKS:
                break
        return self._observation

    def feels(self, share: float = FELT_SHARE) -> bool:
        """Whether the fingers press on something with at least this share of the grip force."""
        return self._observation.force_n > share * self.description.grip_force_n

    # Sensors. No time passes.

    def depth(self) -> DepthImage:
        """A picture of the depth camera."""
        return DepthImage.from_wire(self._session.ask("depth"))

    def image(self) -> RgbImage:
        """A colour picture of the same camera."""
        return RgbImage.from_wire(self._session.ask("rgb"))

    def cloud(self) -> NDArray[np.float32]:
        """The points that the depth camera sees. Shape: points × 3. Frame: world. Unit: metres."""
        cloud: NDArray[np.float32] = self._session.ask("cloud")["arrays"]["cloud"]
        return cloud

    def objects(self, of: str | None = None) -> tuple[Thing, ...]:
        """Objects from the reference perception, with its errors: all, or only the one with this id."""
        things = things_from_wire(self._session.ask("objects", of)["objects"])
        self._session.ids.update(thing.id for thing in things)
        return things

    def look_for(self, of: str) -> tuple[Thing, list[Thing]]:
        """One object from the reference perception, and all others. Raises `Failed` if it is not seen.

        Raises `ValueError` for an id that neither the action nor the perception has named in this run.
        """
        if not isinstance(of, str):
            raise TypeError(f"`look_for` takes the id of one object, such as the value of `pickObject`, not {of!r}")
        seen = {thing.id: thing for thing in self.objects()}
        if of in seen:
            return seen.pop(of), list(seen.values())
        known = self._session.ids
        if of in known:
            raise Failed(f"{of} was not seen")
        near = "".join(f" (did you mean `{one}`?)" for one in difflib.get_close_matches(of, known, 1))
        raise ValueError(f"unknown object {of!r}{near}; known: {', '.join(sorted(known))}")

    # The end.

    def end(
        self,
        succeeded: bool,
        message: str = "",
        perceived: Sequence[Thing] = (),
        plane: Plane | None = None,
        held: Held | None = None,
    ) -> NoReturn:
        """Ends the action with its own report, from any call depth. Returning from the skill does the same."""
        raise Ended(Report(succeeded, message, perceived, plane, held))

    def _command(self, message: Message) -> Observation:
        self._observation = self._session.command(message)
        return self._observation

    def _chain(self, link: str) -> Chain:
        if link not in self._chains:
            root, tip = Pose.upright((0.0, 0.0, 0.0)), Pose.upright((0.0, 0.0, 0.0))
            if not self.description.base_joints:
                observation = self.call.observation
                x, y, heading = observation.base
                root = Pose.upright((x, y, observation.root_height_m), wrapped(heading))
            if link == self.description.tool_link:
                tip = Pose(tip.position, rotation(*self.description.tool_turned_rad))
            self._chains[link] = Chain(self._urdf, link, root, tip)
        return self._chains[link]

    def _standing_over(self, seed: dict[str, float], chain: Chain, pose: Pose) -> dict[str, float]:
        """The posture with the base turned to the heading of the pose and placed so that the hand is at the pose."""
        x, y, heading = self.description.base_joints
        hand = chain.pose(seed)
        # Compare the axis across the fingers, which is horizontal even if they point down.
        if math.hypot(*pose.rotation[:2, 1]) > 0.1 and math.hypot(*hand.rotation[:2, 1]) > 0.1:
            seed = seed | {heading: seed[heading] + wrapped(pose.across - hand.across)}
        miss = pose.position - chain.pose(seed).position
        return seed | {x: seed[x] + float(miss[0]), y: seed[y] + float(miss[1])}

    def _named(self, joints: Joints, what: str = "position") -> dict[str, float]:
        """Numbers by joint. Raises `ValueError` for an unknown joint and for a number that is not finite."""
        if not isinstance(joints, Mapping):
            names = self.description.arm_joints
            if len(joints) != len(names):
                raise ValueError(f"{len(joints)} positions were given for the {len(names)} joints of the arm")
            joints = dict(zip(names, joints))
        named = {}
        for name, value in joints.items():
            if name not in self._numbers:
                raise ValueError(f"the robot has no joint {name!r}; it has {', '.join(self._numbers)}")
            named[name] = number = float(value)
            if not math.isfinite(number):
                raise ValueError(f"the {what} of {name} is {number}, but must be finite")
        return named

    def _checked(self, values: Joints, what: str) -> dict[str, float]:
        """As `_named`, but also raises `ValueError` for a number beyond the joint's limits."""
        named = self._named(values, what)
        for name, number in named.items():
            self._check_limit(self.description.joints[self._numbers[name]], what, number)
        return named

    def _check_limit(self, joint: Joint, what: str, number: float) -> None:
        """Raises `ValueError` if a target of a joint is beyond its limits."""
        metres = joint.kind == "prismatic"
        unit = {"position": ("rad", "m"), "velocity": ("rad/s", "m/s"), "effort": ("N·m", "N")}[what][metres]
        most = {"velocity": joint.velocity, "effort": joint.effort}.get(what)
        low, high = (joint.lower, joint.upper) if most is None else (-most, most)
        within(f"the {what} of {joint.name}", number, (low, high), unit)

    def _checked_base(self, velocity: Sequence[float]) -> list[float]:
        checked = [float(value) for value in velocity]
        if len(checked) != 3:
            raise ValueError(f"a base velocity has 3 numbers (forwards, left, turning), not {len(checked)}")
        base = [self.description.joints[self._numbers[name]] for name in self.description.base_joints]
        for name, value, joint, unit in zip(("forwards", "to the left", "of turning"), checked, base, ("m/s", "m/s", "rad/s")):
            within(f"the base velocity {name}", value, (-joint.velocity, joint.velocity), unit)
        return checked

    def _checked_opening(self, opening_m: float) -> float:
        within("the opening of the gripper", opening := float(opening_m), (0.0, self.description.max_opening_m), "m")
        return opening

    def _checked_force(self, force_n: float) -> float:
        fingers = [self.description.joints[self._numbers[name]] for name in self.description.gripper_joints]
        slide = fingers and all(joint.kind == "prismatic" for joint in fingers)
        most = max(self.description.grip_force_n, *(joint.effort for joint in fingers)) if slide else math.inf
        within("the force of a finger", force := float(force_n), (0.0, most), "N")
        return force


def check_pose(pose: Pose) -> None:
    """Raises `TypeError` or `ValueError` unless it is a finite pose within the size of a scene."""
    if not isinstance(pose, Pose):
        raise TypeError(f"a target must be a Pose, such as `Pose.pointing(position, heading)`, not {type(pose).__name__}")
    if pose.position.shape != (3,) or pose.rotation.shape != (3, 3):
        raise ValueError(f"a pose has 3 coordinates and a 3 × 3 rotation, not {pose.position.shape} and {pose.rotation.shape}")
    if not np.isfinite(pose.rotation).all():
        raise ValueError("the rotation of the pose must be finite")
    for axis, coordinate in zip("xyz", pose.position.tolist()):
        within(f"{axis} of the pose", coordinate, (-FARTHEST_M, FARTHEST_M), "m")
