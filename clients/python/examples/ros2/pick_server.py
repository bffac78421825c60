"""A pick as a ROS 2 action server: it knows its goal and the robot's topics and actions, and nothing of actcheck."""

import math

import rclpy
from actcheck_msgs.action import Pick
from control_msgs.action import FollowJointTrajectory, GripperCommand
from nav2_msgs.action import NavigateToPose
from nav_msgs.msg import Odometry
from rclpy.action import ActionClient, ActionServer
from rclpy.duration import Duration
from rclpy.node import Node
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectoryPoint

ARM = ["arm_lift_joint", "arm_flex_joint", "arm_roll_joint", "wrist_flex_joint", "wrist_roll_joint"]
SPEEDS = [0.2, 1.2, 2.0, 1.5, 1.5]
#: Postures with the hand level, and pointing down: flex to wrist roll, and the hand in the base's frame with the lift at 0.
LEVEL = ([-1.25, 0.0, -0.32, 0.0], (0.690, 0.078, 0.432))
DOWN = ([-1.25, 0.0, -1.89, 0.0], (0.458, 0.078, 0.224))


class PickServer(Node):
    """Drives to an object, closes the hand on it and lifts it."""

    def __init__(self) -> None:
        super().__init__("pick_server")
        self.joints: dict[str, float] = {}
        self.base = (0.0, 0.0)
        self.create_subscription(JointState, "joint_states", self.heard_joints, 10)
        self.create_subscription(Odometry, "odom", self.heard_odometry, 10)
        self.arm = ActionClient(self, FollowJointTrajectory, "arm_controller/follow_joint_trajectory")
        self.gripper = ActionClient(self, GripperCommand, "gripper_controller/gripper_cmd")
        self.navigation = ActionClient(self, NavigateToPose, "navigate_to_pose")
        self.server = ActionServer(self, Pick, "pick", self.pick)

    def heard_joints(self, message: JointState) -> None:
        self.joints = dict(zip(message.name, message.position))

    def heard_odometry(self, message: Odometry) -> None:
        self.base = (message.pose.pose.position.x, message.pose.pose.position.y)

    async def pick(self, goal):
        request, result = goal.request, Pick.Result()
        at, height = request.pose.pose.position, request.size.z
        level = height >= 0.1
        posture, (forward, left, up) = LEVEL if level else DOWN
        hand = at.z + (min(max(height / 2, 0.055), 0.11) if level else max(height - 0.03, 0.0275))
        lift = min(max(hand - up, 0.0), 0.65)
        heading = math.atan2(at.y - self.base[1], at.x - self.base[0])
        sin, cos = math.sin(heading), math.cos(heading)
        # The base's place when the hand is at the object.
        x, y = at.x - forward * cos + left * sin, at.y - forward * sin - left * cos

        await self.close_hand(0.12, 0.0)
        await self.drive(x - 0.3 * cos, y - 0.3 * sin, heading)
        await self.move_arm([lift if level else min(lift + 0.15, 0.69), *posture])
        await self.drive(x, y, heading)
        if not level:
            await self.move_arm([lift, *posture])
        closed = await self.close_hand(0.0, 20.0)
        await self.move_arm([min(lift + 0.12, 0.69), *posture])
        await self.drive(x - 0.3 * cos, y - 0.3 * sin, heading)
        result.succeeded = closed is not None and closed.stalled
        result.message = "it holds it" if result.succeeded else "the hand is empty"
        self.get_logger().info(f"{request.object}: {result.message}")
        goal.succeed()
        return result

    async def drive(self, x: float, y: float, heading: float):
        goal = NavigateToPose.Goal()
        goal.pose.header.frame_id = "map"
        goal.pose.pose.position.x, goal.pose.pose.position.y = x, y
        goal.pose.pose.orientation.z, goal.pose.pose.orientation.w = math.sin(heading / 2), math.cos(heading / 2)
        return await self.reach(self.navigation, goal)

    async def move_arm(self, target: list[float]):
        goal = FollowJointTrajectory.Goal()
        goal.trajectory.joint_names = ARM
        longest = max(abs(end - self.joints[name]) / speed for name, end, speed in zip(ARM, target, SPEEDS))
        point = JointTrajectoryPoint(positions=target, velocities=[0.0] * len(ARM))
        point.time_from_start = Duration(seconds=max(1.7 * longest, 0.5)).to_msg()
        goal.trajectory.points = [point]
        return await self.reach(self.arm, goal)

    async def close_hand(self, gap: float, force: float):
        goal = GripperCommand.Goal()
        goal.command.position, goal.command.max_effort = gap, force
        return await self.reach(self.gripper, goal)

    async def reach(self, client: ActionClient, goal):
        handle = await client.send_goal_async(goal)
        return (await handle.get_result_async()).result if handle.accepted else None


def main() -> None:
    rclpy.init()
    rclpy.spin(PickServer())


if __name__ == "__main__":
    main()
