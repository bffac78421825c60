"""A node with one of many faults: that of the run's number. `faults.toml` says how each run must end."""

import ctypes
import os
import random
import signal
import subprocess
import sys
import threading
import time
import tomllib
from pathlib import Path

FAULTS = tomllib.loads((Path(__file__).parent / "faults.toml").read_text())["fault"]
FAULT = os.environ.get("FAULT") or FAULTS[int(os.environ["ACTCHECK_INDEX"])]["name"]

if FAULT == "exits at its start":
    sys.exit("no configuration")
if FAULT == "lacks a module":
    import no_such_module_of_anybody  # noqa: F401
if FAULT == "has a syntax error":
    exec("def broken(:")

import rclpy
from actcheck_msgs.action import Pick
from control_msgs.action import FollowJointTrajectory, GripperCommand
from geometry_msgs.msg import Twist
from nav2_msgs.action import NavigateToPose
from rclpy.action import ActionClient, ActionServer, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock as ClockMessage
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectoryPoint


def burn(seconds):
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        pass


class Faulty(Node):
    def __init__(self):
        more = {}
        if FAULT == "refuses simulated time":
            more["parameter_overrides"] = [Parameter("use_sim_time", Parameter.Type.BOOL, False)]
        super().__init__("faulty", **more)
        group = ReentrantCallbackGroup()
        self.text = self.create_publisher(String, "text", 10)
        self.arm = ActionClient(self, FollowJointTrajectory, "arm_controller/follow_joint_trajectory", callback_group=group)
        self.gripper = ActionClient(self, GripperCommand, "gripper_controller/gripper_cmd", callback_group=group)
        self.base = ActionClient(self, NavigateToPose, "navigate_to_pose", callback_group=group)
        if FAULT == "is slow to start":
            # The first goal is lost if it is sent before both sides have found each other.
            time.sleep(1.5 * random.Random().random())
        if FAULT == "hangs at its start":
            time.sleep(1000)
        if FAULT == "ignores being asked to end":
            signal.signal(signal.SIGINT, signal.SIG_IGN)
            signal.signal(signal.SIGTERM, signal.SIG_IGN)
        if FAULT == "has a timer by the wall clock":
            self.create_timer(0.1, lambda: None, clock=Clock(clock_type=ClockType.STEADY_TIME))
        if FAULT == "raises in a timer":
            self.create_timer(0.1, lambda: 1 / 0)
        if FAULT == "sends from a thread of its own":
            threading.Thread(target=self.send_for_ever, daemon=True).start()
        if FAULT == "publishes the clock":
            self.create_publisher(ClockMessage, "/clock", 10)
        if FAULT == "answers itself without end":
            self.create_subscription(String, "text", self.text.publish, 10)
        if FAULT == "sends a thousand messages at once":
            self.create_timer(0.2, lambda: [self.text.publish(String(data="x" * 1000)) for _ in range(1000)])
        if FAULT == "has a fast timer":
            self.create_timer(0.001, lambda: self.text.publish(String(data="x")))
        if FAULT == "prints without end":
            self.create_timer(0.02, lambda: print("x" * 200_000))
        goal = (lambda _: GoalResponse.REJECT) if FAULT == "rejects the goal" else (lambda _: GoalResponse.ACCEPT)
        if FAULT != "has no server":
            kind = FollowJointTrajectory if FAULT == "has a server of another type" else Pick
            name = "pikc" if FAULT == "has a server of another name" else "pick"
            self.server = ActionServer(self, kind, name, self.pick, goal_callback=goal, callback_group=group)
        if FAULT == "has two servers":
            self.other = Node("other")
            ActionServer(self.other, Pick, "pick", self.pick)

    def send_for_ever(self):
        while True:
            burn(0.01)
            self.text.publish(String(data="x"))

    async def reach(self, client, goal):
        handle = await client.send_goal_async(goal)
        return (await handle.get_result_async()).result if handle.accepted else None

    async def pick(self, goal):
        result = Pick.Result(succeeded=True, message="it says so")
        if FAULT == "is killed":
            os.kill(os.getpid(), signal.SIGKILL)
        elif FAULT == "crashes":
            ctypes.string_at(0)
        elif FAULT == "exits in a callback":
            os._exit(0)
        elif FAULT == "raises SystemExit":
            sys.exit(3)
        elif FAULT == "raises in a callback":
            raise ValueError("no plan")
        elif FAULT == "computes for ever":
            burn(1000)
        elif FAULT == "waits for ever":
            threading.Event().wait()
        elif FAULT == "waits for its own lock":
            lock = threading.Lock()
            lock.acquire()
            lock.acquire()
        elif FAULT == "is late":
            self.get_clock().sleep_for(Duration(seconds=20.0))
        elif FAULT == "aborts":
            goal.abort()
            return result
        elif FAULT == "destroys its server":
            self.server.destroy()
        elif FAULT == "shuts down":
            rclpy.shutdown()
        elif FAULT == "closes its files":
            os.closerange(3, 200)
        elif FAULT == "leaves a child":
            subprocess.Popen(["sleep", "1000"], start_new_session=True)
        elif FAULT == "commands no number":
            self.create_publisher(Twist, "cmd_vel", 10).publish(Twist())
            trajectory = FollowJointTrajectory.Goal()
            trajectory.trajectory.joint_names = ["arm_lift_joint"]
            trajectory.trajectory.points = [JointTrajectoryPoint(positions=[float("nan")])]
            return await self.refused(goal, self.arm, trajectory)
        elif FAULT == "commands an unknown joint":
            trajectory = FollowJointTrajectory.Goal()
            trajectory.trajectory.joint_names = ["elbow"]
            trajectory.trajectory.points = [JointTrajectoryPoint(positions=[0.1])]
            return await self.refused(goal, self.arm, trajectory)
        elif FAULT == "commands no points":
            trajectory = FollowJointTrajectory.Goal()
            trajectory.trajectory.joint_names = ["arm_lift_joint"]
            return await self.refused(goal, self.arm, trajectory)
        elif FAULT == "opens the hand too wide":
            wide = GripperCommand.Goal()
            wide.command.position = 80.0
            return await self.refused(goal, self.gripper, wide)
        elif FAULT == "drives in another frame":
            drive = NavigateToPose.Goal()
            drive.pose.header.frame_id = "base_laser"
            return await self.refused(goal, self.base, drive)
        goal.succeed()
        return result

    async def refused(self, goal, client, asked):
        answer = await self.reach(client, asked)
        goal.abort() if answer is None else goal.succeed()
        return Pick.Result(succeeded=answer is not None, message="the controller refused it" if answer is None else "it moved")


def main():
    rclpy.init()
    node = Faulty()
    if FAULT == "never spins":
        time.sleep(1000)
    if FAULT == "uses an executor of C++":
        from rclpy.experimental import EventsExecutor

        executor = EventsExecutor()
    else:
        executor = MultiThreadedExecutor(3)
    executor.add_node(node)
    if hasattr(node, "other"):
        executor.add_node(node.other)
    executor.spin()


if __name__ == "__main__":
    main()
