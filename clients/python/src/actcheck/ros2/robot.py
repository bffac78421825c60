"""The simulated robot as a ROS 2 robot: its topics and its controllers. One tick of it is one message to the simulation."""

from __future__ import annotations

import bisect
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import TransformStamped, Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import CameraInfo, Image, JointState, PointCloud2, PointField
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage
from trajectory_msgs.msg import JointTrajectory

from actcheck.kinematics import UrdfJoint, read_urdf, turn
from actcheck.messages import DepthImage, Observation, RobotDescription
from actcheck.motion import course
from actcheck.pose import Matrix, Pose, wrapped
from actcheck.ros2.mapping import Names

#: Deviation at the end of a trajectory that still counts as reached, if the goal names none. Units: radians or metres.
GOAL_TOLERANCE = 0.05
#: Time that a trajectory may take longer than planned, if the goal names none. Unit: seconds.
GOAL_TIME_S = 2.0
#: A velocity command is in force for this long. Unit: seconds.
CMD_VEL_S = 0.5
#: Fingers slower than this have stalled, after some ticks. Unit: m/s.
STALLED = 0.003
STALLED_TICKS = 10
#: Share of the commanded force at which stalled fingers hold something.
FELT_SHARE = 0.7

Command = dict[str, Any]


class Controller:
    """An action server whose goals take simulated time. `tick` is called once in each period."""

    def __init__(self, node: Node, kind: Any, name: str) -> None:
        self.goal: Any = None
        self._server = ActionServer(
            node,
            kind,
            name,
            execute_callback=lambda goal: goal,
            goal_callback=lambda request: GoalResponse.REJECT if self.refuses(request) else GoalResponse.ACCEPT,
            cancel_callback=lambda goal: CancelResponse.ACCEPT,
            handle_accepted_callback=self._begin,
        )
        self._kind = kind

    def refuses(self, request: Any) -> str:
        """Why a goal can't be accepted; empty if it can."""
        raise NotImplementedError

    def start(self, request: Any) -> None:
        """Begins a goal."""
        raise NotImplementedError

    def tick(self, now: float, seen: Observation, command: Command) -> None:
        """Adds its targets to the command of this tick, and ends its goal if it is reached."""
        raise NotImplementedError

    def _begin(self, goal: Any) -> None:
        if self.goal is not None:
            self.end("abort", self.preempted())
        self.goal = goal
        self.start(goal.request)

    def preempted(self) -> Any:
        """Result of a goal that a newer one replaces."""
        return self._kind.Result()

    def end(self, how: str, result: Any) -> None:
        """Ends the goal: `succeed`, `abort` or `canceled`."""
        goal, self.goal = self.goal, None
        if how == "canceled" and not goal.is_cancel_requested:
            how = "abort"

        def finish(handle: Any) -> Any:
            getattr(handle, how)()
            return result

        goal.execute(finish)

    def cancelled(self) -> bool:
        """Whether the client has cancelled the goal, which then ends here."""
        if self.goal is not None and self.goal.is_cancel_requested:
            self.end("canceled", self._kind.Result())
            return True
        return False

    def stop(self) -> None:
        """Forgets a goal without a result: the run is over."""
        self.goal = None


class TrajectoryController(Controller):
    """`FollowJointTrajectory`, as a joint trajectory controller of ros2_control: it interpolates between the points."""

    def __init__(self, node: Node, kind: Any, name: str, joints: Sequence[str], period_s: float) -> None:
        self._joints, self._period_s = tuple(joints), period_s
        self._measured: dict[str, float] = {}
        self._names: list[str] = []
        self._times: list[float] = []
        self._points: list[tuple[Any, Any]] = []
        self._begun: float | None = None
        super().__init__(node, kind, name)
        topic = name.rsplit("/", 1)[0] + "/joint_trajectory"
        node.create_subscription(JointTrajectory, topic, self._heard, 10)

    def _heard(self, trajectory: JointTrajectory) -> None:
        if not self._fault(trajectory):
            self._load(trajectory)

    def refuses(self, request: Any) -> str:
        return self._fault(request.trajectory)

    def _fault(self, trajectory: JointTrajectory) -> str:
        names, points = list(trajectory.joint_names), trajectory.points
        unknown = [name for name in names if name not in self._joints]
        if unknown or not names or len(set(names)) != len(names):
            return f"joints {unknown or names}"
        if not points:
            return "no points"
        last = -1.0
        for point in points:
            at = seconds(point.time_from_start)
            values = [*point.positions, *point.velocities]
            if len(point.positions) != len(names) or len(point.velocities) not in (0, len(names)):
                return "sizes"
            if not all(math.isfinite(value) for value in values) or at < last:
                return "values"
            last = at
        return ""

    def start(self, request: Any) -> None:
        self._load(request.trajectory)

    def _load(self, trajectory: JointTrajectory) -> None:
        self._names = list(trajectory.joint_names)
        self._times = [seconds(point.time_from_start) for point in trajectory.points]
        self._points = [(np.array(point.positions), np.array(point.velocities)) for point in trajectory.points]
        self._begun = None

    def tick(self, now: float, seen: Observation, command: Command) -> None:
        if self.cancelled():
            self._points = []
        if not self._points:
            return
        here = np.array([self._measured[name] for name in self._names])
        if self._begun is None:
            self._begun = now
            if self._times[0] > 0.0:
                still = np.zeros(len(self._names)) if len(self._points[0][1]) else np.array([])
                self._times.insert(0, 0.0)
                self._points.insert(0, (here, still))
        at = now + self._period_s - self._begun
        command.setdefault("positions", {}).update(zip(self._names, self._at(at).tolist()))
        if self.goal is None:
            if at > self._times[-1]:
                self._points = []
            return
        feedback = self._kind.Feedback()
        feedback.joint_names = self._names
        feedback.actual.positions = here.tolist()
        wanted = self._at(now - self._begun)
        feedback.desired.positions = wanted.tolist()
        feedback.error.positions = (wanted - here).tolist()
        self.goal.publish_feedback(feedback)
        late = now - self._begun - self._times[-1]
        if late < 0.0:
            return
        request = self.goal.request
        allowed = {one.name: one.position for one in request.goal_tolerance if one.position != 0.0}
        off = {
            name: error
            for name, error in zip(self._names, np.abs(self._points[-1][0] - here).tolist())
            if 0.0 <= allowed.get(name, GOAL_TOLERANCE) < error
        }
        result = self._kind.Result()
        if not off:
            self._points = []
            self.end("succeed", result)
        elif late > (seconds(request.goal_time_tolerance) or GOAL_TIME_S):
            worst = max(off, key=lambda name: off[name])
            result.error_code = self._kind.Result.GOAL_TOLERANCE_VIOLATED
            result.error_string = f"{worst} is {off[worst]:.4f} from its goal"
            self._points = []
            self.end("abort", result)

    def stop(self) -> None:
        super().stop()
        self._points = []

    def measure(self, positions: dict[str, float]) -> None:
        """Takes the measured positions."""
        self._measured = positions

    def _at(self, time: float) -> Any:
        """Positions at a time of the trajectory: cubic between points with velocities, else straight."""
        after = bisect.bisect_right(self._times, time)
        if after == 0 or after >= len(self._times):
            return self._points[0 if after == 0 else -1][0]
        (begin, v0), (end, v1) = self._points[after - 1], self._points[after]
        span = self._times[after] - self._times[after - 1]
        if span <= 0.0:
            return end
        s = (time - self._times[after - 1]) / span
        if not len(v0) or not len(v1):
            return begin + (end - begin) * s
        return (
            begin * (2 * s**3 - 3 * s**2 + 1)
            + v0 * span * (s**3 - 2 * s**2 + s)
            + end * (3 * s**2 - 2 * s**3)
            + v1 * span * (s**3 - s**2)
        )


class GripperController(Controller):
    """`GripperCommand`: the position is the gap between the fingers, in metres."""

    def __init__(self, node: Node, kind: Any, name: str, description: RobotDescription) -> None:
        self._most, self._force = description.max_opening_m, description.grip_force_n
        self._period_s = description.control_period_s
        self._still, self._before, self._sent = 0, math.inf, False
        super().__init__(node, kind, name)

    def refuses(self, request: Any) -> str:
        asked = request.command
        fits = 0.0 <= asked.position <= self._most * 1.001 and math.isfinite(asked.max_effort) and asked.max_effort >= 0.0
        return "" if fits else f"a gap of {asked.position} m"

    def start(self, request: Any) -> None:
        self._still, self._before, self._sent = 0, math.inf, False

    def tick(self, now: float, seen: Observation, command: Command) -> None:
        if self.goal is None or self.cancelled():
            return
        asked = self.goal.request.command
        force = asked.max_effort or self._force
        if not self._sent:
            command["gripper"] = {"opening_m": min(asked.position, self._most), "force_n": force}
            self._sent = True
            return
        reached = abs(seen.opening_m - asked.position) < 2e-3
        speed, self._before = abs(seen.opening_m - self._before) / self._period_s / 2.0, seen.opening_m
        resting = speed < STALLED and (reached or seen.force_n > FELT_SHARE * force)
        self._still = self._still + 1 if resting else 0
        if self._still >= STALLED_TICKS:
            result = self._kind.Result()
            result.position, result.effort = seen.opening_m, max(0.0, seen.force_n)
            result.reached_goal, result.stalled = reached, not reached
            self.end("succeed", result)


class NavigationController(Controller):
    """`NavigateToPose`: drives straight to a pose; obstacles are for the nodes to avoid."""

    def __init__(self, node: Node, kind: Any, name: str, description: RobotDescription, frame: str) -> None:
        self._base, self._frame = description.base_joints, frame
        speeds = {joint.name: joint.velocity for joint in description.joints}
        self._speeds = np.array([speeds[joint] for joint in self._base])
        self._period_s = description.control_period_s
        self._way: list[list[float]] = []
        super().__init__(node, kind, name)

    def refuses(self, request: Any) -> str:
        pose = request.pose
        at = (pose.pose.position.x, pose.pose.position.y, pose.pose.orientation.z, pose.pose.orientation.w)
        known = pose.header.frame_id.lstrip("/") in (self._frame, "odom")
        return "" if known and all(math.isfinite(one) for one in at) else "the pose"

    def start(self, request: Any) -> None:
        self._way = []

    def tick(self, now: float, seen: Observation, command: Command) -> None:
        if self.goal is None or self.cancelled():
            return
        pose = self.goal.request.pose.pose
        heading = 2.0 * math.atan2(pose.orientation.z, pose.orientation.w)
        x, y, turned = seen.base
        goal = [pose.position.x, pose.position.y, turned + wrapped(heading - turned)]
        if not self._way:
            self._way = course([np.array([x, y, turned]), np.array(goal)], self._speeds, self._period_s).tolist() or [goal]
            self._way.reverse()
        if len(self._way) > 1:
            command.setdefault("positions", {}).update(zip(self._base, self._way.pop()))
        else:
            command.setdefault("positions", {}).update(zip(self._base, self._way[0]))
            if math.hypot(x - goal[0], y - goal[1]) < 0.02 and abs(turned - goal[2]) < 0.05:
                self.end("succeed", self._kind.Result())


class RosRobot:
    """All topics and controllers of the simulated robot."""

    def __init__(self, node: Node, description: RobotDescription, names: Names, frame: str) -> None:
        from control_msgs.action import FollowJointTrajectory, GripperCommand

        self._node, self._description, self._frame, self._names = node, description, frame, names
        self._urdf = read_urdf(description.urdf)
        children = {joint.child for joint in self._urdf}
        self._root = next((joint.parent for joint in self._urdf if joint.parent not in children), "base_link")
        known = {joint.name for joint in self._urdf}
        self._in_urdf = [joint.name in known for joint in description.joints]
        #: Whether the URDF's root stays where it is: then its base joints are joints like others.
        self._fixed = not description.base_joints or description.base_joints[0] in known
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._joint_states = node.create_publisher(JointState, names.joint_states, 10) if names.joint_states else None
        self._tf = node.create_publisher(TFMessage, "/tf", 100)
        self._tf_static = node.create_publisher(TFMessage, "/tf_static", latched)
        self._odom = node.create_publisher(Odometry, names.odom, 10) if names.odom and description.base_joints else None
        self._robot_description = node.create_publisher(String, names.robot_description, latched)
        self._robot_description.publish(String(data=description.urdf))
        self._camera: dict[str, Any] = {}
        if names.camera and description.camera:
            for name, kind in (("depth/image_rect_raw", Image), ("depth/camera_info", CameraInfo), ("depth/points", PointCloud2)):
                self._camera[name] = node.create_publisher(kind, f"{names.camera}/{name}", 5)
        self._trajectories: list[TrajectoryController] = []
        self._controllers: list[Controller] = []
        moving = [joint.name for joint in description.joints if joint.role == "other"]
        for name, joints in ((names.arm, [*description.arm_joints, *moving]), (names.head, list(description.head_joints))):
            if name and joints:
                controller = TrajectoryController(node, FollowJointTrajectory, name, joints, description.control_period_s)
                self._trajectories.append(controller)
                self._controllers.append(controller)
        if names.gripper and description.gripper_joints:
            self._controllers.append(GripperController(node, GripperCommand, names.gripper, description))
        self._velocity, self._heard_at, self._now = (0.0, 0.0, 0.0), -math.inf, 0.0
        if description.base_joints:
            if names.cmd_vel:
                node.create_subscription(Twist, names.cmd_vel, self._cmd_vel, 10)
                node.create_subscription(TwistStamped, f"{names.cmd_vel}_stamped", lambda it: self._cmd_vel(it.twist), 10)
            if names.navigate:
                from nav2_msgs.action import NavigateToPose

                self._controllers.append(NavigationController(node, NavigateToPose, names.navigate, description, frame))

    def publish(self, seen: Observation, now: int, first: bool) -> None:
        """Publishes the robot's state. Time: simulated, in nanoseconds."""
        stamp, positions = time_of(now), self.measure(seen)
        if self._joint_states is not None:
            message = JointState()
            message.header.stamp = stamp
            kept = [number for number, known in enumerate(self._in_urdf) if known]
            message.name = [self._description.joints[number].name for number in kept]
            message.position, message.velocity = seen.positions[kept].tolist(), seen.velocities[kept].tolist()
            message.effort = seen.efforts[kept].tolist()
            self._joint_states.publish(message)
        moving, still = [], []
        for joint in self._urdf:
            if joint.kind == "fixed":
                still.append(self._transform(joint.parent, joint.child, joint.origin, stamp))
            else:
                moving.append(self._transform(joint.parent, joint.child, moved(joint, positions), stamp))
        x, y, heading = seen.base
        on_floor = Pose.upright((x, y, seen.root_height_m), wrapped(heading)).matrix()
        if self._fixed:
            base = np.eye(4) if self._description.base_joints else on_floor
            still.append(self._transform("odom", self._root, base, stamp))
        else:
            moving.append(self._transform("odom", self._root, on_floor, stamp))
        still.append(self._transform(self._frame, "odom", np.eye(4), stamp))
        if first:
            self._tf_static.publish(TFMessage(transforms=still))
        if moving:
            self._tf.publish(TFMessage(transforms=moving))
        if self._odom is not None:
            self._odom.publish(self._odometry(seen, stamp))

    def measure(self, seen: Observation) -> dict[str, float]:
        """Gives the controllers the measured positions, by joint."""
        positions = dict(zip((joint.name for joint in self._description.joints), seen.positions.tolist()))
        for controller in self._trajectories:
            controller.measure(positions)
        return positions

    def wants_camera(self) -> bool:
        """Whether a node subscribes to the depth camera."""
        return any(publisher.get_subscription_count() for publisher in self._camera.values())

    def publish_camera(self, image: DepthImage, now: int) -> None:
        """Publishes a picture of the depth camera, its calibration, and its points in the camera's optical frame."""
        camera = self._description.camera
        assert camera is not None
        stamp, optical = time_of(now), f"{camera.link}_optical"
        turned = np.eye(4)
        # An optical frame looks along z, with x to the right and y down.
        turned[:3, :3] = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
        self._tf.publish(TFMessage(transforms=[self._transform(camera.link, optical, turned, stamp)]))
        picture = Image(height=image.height, width=image.width, encoding="32FC1", step=4 * image.width)
        picture.header.frame_id, picture.header.stamp = optical, stamp
        picture.data = image.depth.astype("<f4").tobytes()
        info = CameraInfo(height=image.height, width=image.width, distortion_model="plumb_bob", d=[0.0] * 5)
        info.header = picture.header
        f, u, v = image.focal_px, (image.width - 1) / 2.0, (image.height - 1) / 2.0
        info.k = [f, 0.0, u, 0.0, f, v, 0.0, 0.0, 1.0]
        info.r = np.eye(3).ravel().tolist()
        info.p = [f, 0.0, u, 0.0, 0.0, f, v, 0.0, 0.0, 0.0, 1.0, 0.0]
        for name, message in (("depth/image_rect_raw", picture), ("depth/camera_info", info)):
            self._send_large(self._camera[name], message)
        if self._camera["depth/points"].get_subscription_count():
            columns, rows = np.meshgrid(np.arange(image.width) - u, np.arange(image.height) - v)
            z = image.depth
            points = np.stack([columns * z / f, rows * z / f, z], axis=-1)[z > 0.0].astype("<f4")
            message = PointCloud2(height=1, width=len(points), point_step=12, row_step=12 * len(points), is_dense=True)
            message.header = picture.header
            message.fields = [
                PointField(name=name, offset=4 * number, datatype=PointField.FLOAT32, count=1) for number, name in enumerate("xyz")
            ]
            message.data = points.tobytes()
            self._send_large(self._camera["depth/points"], message)

    def command(self, now: int, seen: Observation) -> Command:
        """The command of this tick from all controllers."""
        self._now = now / 1e9
        command: Command = {"type": "command", "ticks": 1}
        for controller in self._controllers:
            controller.tick(self._now, seen, command)
        if self._description.base_joints and self._heard_at > -math.inf:
            if self._now - self._heard_at > CMD_VEL_S:
                self._velocity, self._heard_at = (0.0, 0.0, 0.0), -math.inf
            taken = command.get("positions", {})
            if not any(joint in taken for joint in self._description.base_joints):
                command["base_velocity"] = list(self._velocity)
        return command

    def stop(self) -> None:
        """Forgets all goals."""
        for controller in self._controllers:
            controller.stop()
        self._velocity, self._heard_at = (0.0, 0.0, 0.0), -math.inf

    def _cmd_vel(self, twist: Twist) -> None:
        asked = (twist.linear.x, twist.linear.y, twist.angular.z)
        if all(math.isfinite(one) for one in asked):
            self._velocity, self._heard_at = asked, self._now

    def _send_large(self, publisher: Any, message: Any) -> None:
        from rclpy.duration import Duration

        if publisher.get_subscription_count():
            publisher.publish(message)
            publisher.wait_for_all_acked(Duration(seconds=2))

    def _transform(self, parent: str, child: str, matrix: Matrix, stamp: Time) -> TransformStamped:
        pose, message = Pose.from_matrix(matrix), TransformStamped()
        message.header.frame_id, message.header.stamp, message.child_frame_id = parent, stamp, child
        at, q = message.transform.translation, message.transform.rotation
        at.x, at.y, at.z = pose.position.tolist()
        q.x, q.y, q.z, q.w = pose.quaternion()
        return message

    def _odometry(self, seen: Observation, stamp: Time) -> Odometry:
        message = Odometry()
        message.header.frame_id, message.header.stamp, message.child_frame_id = "odom", stamp, self._root
        x, y, heading = seen.base
        at, q = message.pose.pose.position, message.pose.pose.orientation
        at.x, at.y, at.z = x, y, seen.root_height_m
        q.z, q.w = math.sin(heading / 2.0), math.cos(heading / 2.0)
        numbers = {joint.name: number for number, joint in enumerate(self._description.joints)}
        vx, vy, vw = (float(seen.velocities[numbers[name]]) for name in self._description.base_joints)
        twist = message.twist.twist
        twist.linear.x = vx * math.cos(heading) + vy * math.sin(heading)
        twist.linear.y = vy * math.cos(heading) - vx * math.sin(heading)
        twist.angular.z = vw
        return message


def moved(joint: UrdfJoint, positions: dict[str, float]) -> Matrix:
    """Transform from a joint's parent link to its child link."""
    name, factor, offset = joint.mimic or (joint.name, 1.0, 0.0)
    value = positions.get(name, 0.0) * factor + offset
    motion = np.eye(4)
    if joint.kind == "prismatic":
        motion[:3, 3] = joint.axis * value
    else:
        motion[:3, :3] = turn(joint.axis, value)
    matrix: Matrix = joint.origin @ motion
    return matrix


def seconds(duration: Any) -> float:
    """A duration in seconds."""
    return float(duration.sec + duration.nanosec * 1e-9)


def time_of(now: int) -> Time:
    """A time in nanoseconds as a message."""
    sec, nanosec = divmod(now, 1_000_000_000)
    return Time(sec=sec, nanosec=nanosec)
