"""Nodes of a chain, as users write them: `chain.py ROLE single|multi async|blocking SECONDS_OF_COMPUTING`.

filter: answers every state with a message, and beats by a timer. planner: a service. motion: an action server that moves the
joint. executive: an action server that asks the planner, then has motions made, and reports everything that it hears, in the
order in which it hears it.
"""

import random
import sys
import threading
import time
from time import sleep  # by name, before rclpy: it is of simulated time, too

import rclpy
from control_msgs.action import FollowJointTrajectory
from rcl_interfaces.srv import ListParameters
from rclpy.action import ActionClient, ActionServer
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.duration import Duration
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

ROLE, EXECUTOR, STYLE, BURN = sys.argv[1], sys.argv[2], sys.argv[3], float(sys.argv[4])
wall = random.Random()  # computing takes a different time each time; it never enters a result


def burn():
    end = time.perf_counter() + wall.random() * BURN
    while time.perf_counter() < end:
        pass


def message(value):
    return JointTrajectory(joint_names=["j"], points=[JointTrajectoryPoint(positions=[float(value)])])


class Filter(Node):
    def __init__(self):
        super().__init__("filter")
        self.count, self.mean = 0, 0.0
        self.out = self.create_publisher(JointState, "filtered", 10)
        self.beat = self.create_publisher(JointState, "beat", qos_profile_sensor_data)
        self.create_subscription(JointState, "joint_states", self.heard, qos_profile_sensor_data)
        self.create_timer(0.03, self.tick)

    def heard(self, state):
        burn()
        self.mean += 0.3 * (state.position[0] - self.mean)
        self.out.publish(JointState(name=["j"], position=[self.mean]))

    def tick(self):
        self.count += 1
        self.beat.publish(JointState(name=["beat"], position=[float(self.count % 1000), self.mean]))


class Planner(Node):
    def __init__(self):
        super().__init__("planner")
        self.create_service(ListParameters, "plan", self.plan)

    def plan(self, request, response):
        burn()
        goal = float(request.prefixes[0])
        response.result.names = [str(goal * (number + 1) / request.depth) for number in range(request.depth)]
        return response


class Motion(Node):
    def __init__(self):
        super().__init__("motion")
        self.group, self.x = ReentrantCallbackGroup(), 0.0
        self.create_subscription(JointState, "joint_states", self.heard, 10, callback_group=self.group)
        self.command = self.create_publisher(JointTrajectory, "cmd", 10)
        ActionServer(self, FollowJointTrajectory, "move", self.move, callback_group=self.group)
        self.rate = self.create_rate(50) if STYLE == "blocking" else None

    def heard(self, state):
        self.x = state.position[0]

    async def pause(self):
        future = rclpy.task.Future()
        timer = self.create_timer(0.02, lambda: future.done() or future.set_result(True), callback_group=self.group)
        await future
        self.destroy_timer(timer)

    def one(self, goal, target):
        burn()
        self.command.publish(message(self.x + 0.2 * (target - self.x)))
        feedback = FollowJointTrajectory.Feedback()
        feedback.actual.positions = [self.x]
        goal.publish_feedback(feedback)

    if STYLE == "async":

        async def move(self, goal):
            target, steps = goal.request.trajectory.points[-1].positions[0], 0
            while abs(self.x - target) > 1e-3 and steps < 200:
                self.one(goal, target)
                steps += 1
                await self.pause()
            return self.ended(goal, steps)

    else:

        def move(self, goal):
            target, steps = goal.request.trajectory.points[-1].positions[0], 0
            while abs(self.x - target) > 1e-3 and steps < 200:
                self.one(goal, target)
                steps += 1
                if steps % 3 == 0:
                    sleep(0.02)
                elif steps % 3 == 1:
                    self.rate.sleep()
                else:
                    self.get_clock().sleep_for(Duration(seconds=0.02))
            return self.ended(goal, steps)

    def ended(self, goal, steps):
        goal.succeed()
        return FollowJointTrajectory.Result(error_string=f"{steps} steps, {self.x:.9f}")


class Executive(Node):
    def __init__(self):
        super().__init__("executive")
        self.group = ReentrantCallbackGroup()
        self.heard, self.lock = [], threading.Lock()
        self.out = self.create_publisher(JointTrajectory, "out", 100)
        for topic in ("filtered", "beat", "joint_states"):
            self.create_subscription(JointState, topic, self.listen, 100, callback_group=self.group)
        self.planner = self.create_client(ListParameters, "plan", callback_group=self.group)
        self.motion = ActionClient(self, FollowJointTrajectory, "move", callback_group=self.group)
        ActionServer(self, FollowJointTrajectory, "task", self.task, callback_group=self.group)

    def listen(self, state):
        with self.lock:
            burn()
            self.heard.append(state.position[-1] + len(state.name[0]))
            if len(self.heard) == 5:
                total = 0.0
                for value in self.heard:
                    total = total * 0.9 + value  # the order matters
                self.heard.clear()
                self.out.publish(message(total))

    def wait(self, future):
        done = threading.Event()
        future.add_done_callback(lambda _: done.set())
        done.wait()
        return future.result()

    def request(self, goal):
        return ListParameters.Request(prefixes=[str(goal.request.trajectory.points[-1].positions[0])], depth=2)

    def part(self, text):
        return FollowJointTrajectory.Goal(trajectory=message(float(text)))

    if STYLE == "async":

        async def task(self, goal):
            said = []
            plan = await self.planner.call_async(self.request(goal))
            for text in plan.result.names:
                handle = await self.motion.send_goal_async(self.part(text))
                said.append((await handle.get_result_async()).result.error_string)
            goal.succeed()
            return FollowJointTrajectory.Result(error_string="; ".join(said))

    else:

        def task(self, goal):
            said = []
            plan = self.planner.call(self.request(goal))
            for text in plan.result.names:
                handle = self.wait(self.motion.send_goal_async(self.part(text)))
                said.append(self.wait(handle.get_result_async()).result.error_string)
            goal.succeed()
            return FollowJointTrajectory.Result(error_string="; ".join(said))


def main():
    rclpy.init()
    made = {"filter": [Filter], "planner": [Planner], "motion": [Motion], "executive": [Executive], "tools": [Filter, Planner]}
    nodes = [kind() for kind in made[ROLE]]
    executor = MultiThreadedExecutor(4) if EXECUTOR == "multi" else SingleThreadedExecutor()
    for node in nodes:
        executor.add_node(node)
    try:
        executor.spin()
    except (KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
        pass


if __name__ == "__main__":
    main()
