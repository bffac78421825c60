"""How many first goals are lost, with and without waiting until all nodes have found each other.

    FOLDER/bin/python benches/ros2/first_goal.py REPETITIONS

Each repetition starts a node that takes a random time until it has its action server, in a new domain, and sends one goal: at once,
as a client without care does; when the client says that the server is ready; and as the bridge does.
"""

import os
import sys
import time
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "clients/python/src"))
from actcheck.ros2 import environment

if os.environ.get("ACTCHECK_ROS2") != sys.prefix:
    os.execve(sys.executable, [sys.executable, *sys.argv], {**os.environ, **environment.variables(Path(sys.prefix)), "ACTCHECK_ROS2": sys.prefix})

import rclpy
from actcheck.ros2.bridge import NETWORK, RunOfNodes
from actcheck.ros2.mapping import read
from actcheck.ros2.nodes import Domain, Nodes
from actcheck_msgs.action import Pick
from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "clients/python"))
from actcheck.messages import Call, Observation, RobotDescription
from tests import fake

import numpy as np


def without_care(number, ready):
    """Whether a goal of a client is answered within a second after its server is ready."""
    context, domain = Context(), Domain(number)
    rclpy.init(context=context, domain_id=domain.number, args=[])
    node = Node("client", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    client = ActionClient(node, Pick, "/pick")
    env = {**os.environ, "ROS_DOMAIN_ID": str(domain.number), "FAULT": "is slow to start", "ACTCHECK_INDEX": "0"}
    nodes = Nodes([["faulty.py"]], ROOT / "tests/ros2", env)
    while ready and not client.server_is_ready():
        time.sleep(0.0005)
    sent, since = client.send_goal_async(Pick.Goal()), time.monotonic()
    while not sent.done() and time.monotonic() - since < 5.0:
        executor.spin_once(timeout_sec=0.05)
    nodes.close()
    client.destroy()
    executor.shutdown()
    node.destroy_node()
    rclpy.shutdown(context=context)
    domain.close()
    return sent.done()


class Simulation:
    """A simulation in which nothing moves."""

    def __init__(self):
        self.description = RobotDescription.from_wire(fake.hello())
        number = len(self.description.joints)
        self.seen = Observation(0.0, np.zeros(number), np.zeros(number), np.zeros(number), (0.0, 0.0, 0.0), 0.1, 0.0, 10.0, 0.0)

    def command(self, message):
        return self.seen

    def ask(self, what, of=None):
        return {"objects": []}


def bridged(number, mapping):
    simulation = Simulation()
    call = Call("Pick", {"pickObject": "mug_1"}, {}, 10.0, simulation.seen, index=0)
    run = RunOfNodes(mapping, simulation, False, Domain(number), call)
    try:
        return run.perform(call).succeeded
    finally:
        run.close()


def main():
    repetitions = int(sys.argv[1])
    os.environ.update(NETWORK)
    os.environ["FAULT"] = "is slow to start"
    mapping = replace(read(ROOT / "tests/ros2/faulty.toml"), startup_s=60.0, callback_s=60.0)
    for name, one in (
        ("sent at once", lambda number: without_care(number, False)),
        ("sent when the server is ready", lambda number: without_care(number, True)),
        ("held back by the bridge", lambda number: bridged(number, mapping)),
    ):
        arrived = sum(bool(one(number)) for number in range(repetitions))
        print(f"{name}: {arrived} of {repetitions} first goals arrived, load {os.getloadavg()[0]:.1f}", flush=True)


if __name__ == "__main__":
    main()
