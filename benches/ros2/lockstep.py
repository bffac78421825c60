"""Repeats a goal to nodes under test and counts how many different traces there are.

    FOLDER/bin/python benches/ros2/lockstep.py REPETITIONS [--free] [--server NAME] -- COMMAND [-- COMMAND ...]

FOLDER is made by `clients/python/src/actcheck/ros2/environment.py`. A trace is everything that the simulation hears, by tick:
commands, other messages, feedback and the result.
"""

import hashlib
import os
import sys
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "clients/python/src"))
from actcheck.ros2 import environment

if os.environ.get("ACTCHECK_ROS2") != sys.prefix:
    os.execve(sys.executable, [sys.executable, *sys.argv], {**os.environ, **environment.variables(Path(sys.prefix)), "ACTCHECK_ROS2": sys.prefix})

import rclpy
from actcheck.ros2.bridge import NETWORK
from actcheck.ros2.lockstep import FreeRunning, Lockstep
from actcheck.ros2.nodes import Domain, Nodes
from control_msgs.action import FollowJointTrajectory
from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

TICK_NS = 10_000_000
#: Repetitions that are not counted: nodes that remember begin a repetition as the last one left them.
WARM_UP = 4


def main():
    words, commands = sys.argv[1:], []
    while "--" in words:
        cut = len(words) - 1 - words[::-1].index("--")
        commands.insert(0, words[cut + 1 :])
        words = words[:cut]
    repetitions, free = int(words[0]), "--free" in words
    server = words[words.index("--server") + 1] if "--server" in words else "task"
    os.environ.update(NETWORK)
    domain, context = Domain(os.getpid()), Context()
    rclpy.init(context=context, domain_id=domain.number, args=[])
    node = Node("actcheck", context=context, start_parameter_services=False, enable_rosout=False)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    nodes = None

    def alive():
        if nodes is not None:
            nodes.alive()

    step = FreeRunning(node, executor, alive) if free else Lockstep(node, executor, 20.0, alive)
    heard = []
    states = node.create_publisher(JointState, "joint_states", 100)
    target = [0.0]

    def commanded(message):
        target[0] = message.points[0].positions[0]
        heard.append(("cmd", target[0]))

    node.create_subscription(JointTrajectory, "cmd", commanded, 1000)
    node.create_subscription(JointTrajectory, "out", lambda message: heard.append(("out", message.points[0].positions[0])), 1000)
    client = ActionClient(node, FollowJointTrajectory, server)
    env = {**os.environ, "ROS_DOMAIN_ID": str(domain.number), "PYTHONHASHSEED": "0", "RCUTILS_CONSOLE_OUTPUT_FORMAT": "{message}"}
    if not free:
        inside = str(Path(environment.__file__).parent / "inside")
        env |= {"PYTHONPATH": f"{inside}:{env['PYTHONPATH']}", "ACTCHECK_ROS_KEEPER": step.address}
    nodes = Nodes(commands, Path.cwd(), env)
    since = time.monotonic()
    while not client.server_is_ready() or step.nodes < (0 if free else len(commands)):
        step.accept()
        step.drain()
        alive()
        assert time.monotonic() - since < 30.0, "the server does not come"
        time.sleep(0.02)
    time.sleep(2.0)
    now = 1_000_000_000
    step.hold(now)
    step.barrier(now)
    traces, results, ticks, begun = Counter(), Counter(), 0, time.monotonic()
    for repetition in range(-WARM_UP, repetitions):
        if repetition == 0:
            ticks, begun = 0, time.monotonic()
            traces.clear()
            results.clear()
        log, x, target[0] = [], 0.0, 0.0
        result = handle = None
        # A repetition begins at a multiple of the timers' periods, so that all begin alike.
        for tick in range(-20, 900):
            states.publish(JointState(name=["j"], position=[x]))
            if not free:
                step.barrier(now)
            now += TICK_NS
            step.barrier(now)
            if tick >= 0:
                log.append((tick, x, tuple(heard)))
            heard.clear()
            x += max(-0.02, min(0.02, target[0] - x))
            if tick == 0:
                goal = FollowJointTrajectory.Goal()
                goal.trajectory.joint_names, goal.trajectory.points = ["j"], [JointTrajectoryPoint(positions=[0.5])]
                sent = client.send_goal_async(goal, feedback_callback=lambda it: heard.append(("feedback", it.feedback.actual.positions[0])))
                step.barrier(now)
            if tick >= 0 and handle is None and sent.done():
                handle = sent.result()
                result = handle.get_result_async()
                step.barrier(now)
            if result is not None and result.done():
                break
        ticks += tick + 20
        if result is None or not result.done():
            results["none"] += 1
        else:
            results[result.result().result.error_string] += 1
        # To the next multiple of 0.6 s, one of the timers' periods; the joint is at rest at its start.
        rest = -now % 600_000_000 // TICK_NS
        for _ in range(rest if not free else 10):
            states.publish(JointState(name=["j"], position=[0.0]))
            if not free:
                step.barrier(now)
            now += TICK_NS
            step.barrier(now)
            heard.clear()
        ticks += rest
        traces[hashlib.sha256(repr(log).encode()).hexdigest()] += 1
    seconds = time.monotonic() - begun
    print(
        f"{'free' if free else 'lockstep'}: {repetitions} repetitions, {len(traces)} different traces, commonest {traces.most_common(1)[0][1]}; "
        f"{len(results)} different results, {results['none']} goals did not end, commonest: {results.most_common(1)[0][0]}; "
        f"{ticks / seconds:.0f} ticks/s, load {os.getloadavg()[0]:.1f}",
        flush=True,
    )
    step.free()
    nodes.close()
    step.close()
    rclpy.shutdown(context=context)


if __name__ == "__main__":
    main()
