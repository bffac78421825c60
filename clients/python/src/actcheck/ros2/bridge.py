"""Performs the actions of a campaign with action servers of ROS 2 nodes."""

from __future__ import annotations

import os
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import rclpy
from rclpy.action import ActionClient, get_action_server_names_and_types_by_node
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from actcheck.faults import Aborted, ProtocolFault
from actcheck.messages import Call, DepthImage, Observation, Report, things_from_wire
from actcheck.ros2.faults import BrokenNode
from actcheck.ros2.goal import Values, action_type, report
from actcheck.ros2.lockstep import MARK, FreeRunning, Lockstep
from actcheck.ros2.mapping import SkillMapping
from actcheck.ros2.nodes import Domain, Nodes
from actcheck.ros2.robot import RosRobot, time_of
from actcheck.session import Session
from actcheck.wire import Wire

#: Simulated time at which a run begins; 0 means "no time yet" to ROS 2. Unit: nanoseconds.
BEGINNING = 1_000_000_000
#: Names of the bridge's own nodes.
NAME = "actcheck"
OWN = (NAME, f"{NAME}_marks")
#: Nodes of tools, which take no part.
TOOLS = ("_ros2cli", "launch_ros", "_actcheck_keeper")
#: Time for the answers to a new participant, so that none that belongs to the graph is missed. Unit: seconds.
SETTLE_S = 0.2


class RunOfNodes:
    """The nodes, the simulated robot and the clock of one run."""

    def __init__(self, mapping: SkillMapping, session: Session, free_running: bool, domain: Domain, call: Call) -> None:
        self._mapping, self._session, self._domain = mapping, session, domain
        self._description = session.description
        self._now, self._ticks = BEGINNING, 0
        self._nodes: Nodes | None = None
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain.number, args=[])
        self._node = Node(NAME, context=self._context, start_parameter_services=False, enable_rosout=False)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        if free_running:
            self._step: Lockstep | FreeRunning = FreeRunning(self._node, self._executor, self._alive)
        else:
            self._step = Lockstep(self._node, self._executor, mapping.callback_s, self._alive)
        self._robot = RosRobot(self._node, self._description, mapping.robot, mapping.frame)
        self._clients = {
            action: ActionClient(self._node, action_type(wanted.type), wanted.server) for action, wanted in mapping.actions.items()
        }
        self._every = max(1, round(1.0 / (mapping.rate_hz * self._description.control_period_s)))
        self._camera_every = max(1, round(1.0 / (mapping.camera_hz * self._description.control_period_s))) if mapping.camera_hz else 0
        self._begun = False
        self._env = self._environment(call, free_running)

    def start(self, seen: Observation) -> None:
        """Starts the nodes, and waits until all have found each other. Raises `BrokenNode`."""
        self._nodes = Nodes(self._mapping.commands, self._mapping.file.parent.absolute(), self._env)
        self._robot.publish(seen, self._now, True)
        since, calm = time.monotonic(), 0
        while calm < 2:
            self._alive()
            self._step.accept()
            self._step.drain()
            missing = self._missing()
            calm = 0 if missing else calm + 1
            if missing and time.monotonic() - since > self._mapping.startup_s:
                raise BrokenNode(f"after {self._mapping.startup_s:g} s, {missing}")
            time.sleep(SETTLE_S / 2 if not missing else 0.02)
        self._check()
        self._step.hold(self._now)
        self._step.barrier(self._now)

    def perform(self, call: Call) -> Report:
        """Performs one action. Raises `BrokenNode` and `Aborted`."""
        seen = call.observation
        if not self._begun:
            self._begun = True
            self.start(seen)
        action = self._mapping.actions[call.action]
        client = self._clients[call.action]
        self._publish(seen)
        self._step.barrier(self._now)
        values = Values(
            call,
            self._mapping.places,
            self._mapping.frame,
            lambda: things_from_wire(self._session.ask("objects")["objects"]),
            time_of(self._now),
        )
        kind = action_type(action.type)
        try:
            goal = values.fill(kind.Goal(), action.goal)
        except LookupError as unseen:
            return Report(False, str(unseen.args[0]))
        accepted = client.send_goal_async(goal)
        self._step.barrier(self._now)
        result: Any = None
        handle: Any = None
        try:
            while True:
                if handle is None and accepted.done():
                    handle = accepted.result()
                    if not handle.accepted:
                        return Report(False, f"{action.server} rejected the goal")
                    result = handle.get_result_async()
                    self._step.barrier(self._now)
                if result is not None and result.done():
                    answer = result.result()
                    return report(action, answer.status, answer.result, self._mapping.frame)
                self._tick(seen := self._next(seen))
        except Aborted:
            if handle is not None:
                handle.cancel_goal_async()
                self._step.barrier(self._now)
            raise
        finally:
            self._robot.stop()

    def close(self) -> list[str]:
        """Ends the nodes. Returns their output."""
        output: list[str] = []
        self._step.free()
        if self._nodes is not None:
            output = self._nodes.output()
            self._nodes.close()
        self._step.close()
        for client in self._clients.values():
            client.destroy()
        self._executor.shutdown()
        self._node.destroy_node()
        rclpy.shutdown(context=self._context)
        self._domain.close()
        return output

    def _next(self, seen: Observation) -> Observation:
        """Advances the simulation by a tick."""
        return self._session.command(self._robot.command(self._now, seen))

    def _tick(self, seen: Observation) -> None:
        """Sends the nodes a new state, then its time."""
        self._ticks += 1
        now = BEGINNING + round(self._ticks * self._description.control_period_s * 1e9)
        if self._ticks % self._every == 0:
            self._robot.publish(seen, now, False)
            if self._camera_every and self._ticks % self._camera_every == 0 and self._robot.wants_camera():
                self._robot.publish_camera(DepthImage.from_wire(self._session.ask("depth")), now)
            self._step.barrier(self._now)
        else:
            self._robot.measure(seen)
        self._now = now
        self._step.barrier(now)

    def _publish(self, seen: Observation) -> None:
        self._robot.publish(seen, self._now, True)

    def _alive(self) -> None:
        if self._nodes is not None:
            self._nodes.alive()

    def _missing(self) -> str:
        """The missing part of the graph; empty if it is complete."""
        assert self._nodes is not None
        for action, client in self._clients.items():
            if not client.server_is_ready():
                wanted = self._mapping.actions[action]
                seen = sorted({name for _, found in self._servers() for name in found})
                return f"the action server {wanted.server} of type {wanted.type} has not appeared; present: {', '.join(seen) or 'none'}"
        graphs = self._step.graphs()
        if isinstance(self._step, FreeRunning):
            return ""
        if not graphs:
            return "no node has called: their programs use no rclpy, or were started without the environment that they got"
        for graph in graphs:
            if not graph["executors"]:
                return f"the nodes {', '.join(graph['nodes'])} do not spin"
            for kind, name, matches in graph["ends"]:
                if kind == "publisher" and self._node.count_subscribers(name) > matches:
                    return f"a subscriber of {name} has not been found by its publisher; perhaps their QoS does not match"
                if kind == "client" and name == MARK:
                    return "a process has no node yet"
                if kind == "client" and not matches and self._node.count_services(name):
                    return f"the service {name} has not been found by its client; perhaps their types differ"
        return ""

    def _servers(self) -> list[tuple[str, list[str]]]:
        """Names of the action servers of each other node."""
        found = []
        for name, space in self._node.get_node_names_and_namespaces():
            if name in OWN:
                continue
            try:
                servers = get_action_server_names_and_types_by_node(self._node, name, space)
            except Exception:  # A node that left the graph at this moment.
                continue
            found.append((f"{space.rstrip('/')}/{name}", [server for server, _ in servers]))
        return found

    def _check(self) -> None:
        """Raises `BrokenNode` if the graph holds something that makes runs differ."""
        for wanted in self._mapping.actions.values():
            servers = [node for node, names in self._servers() if wanted.server in names]
            if len(servers) > 1:
                raise BrokenNode(f"{len(servers)} nodes have an action server {wanted.server}: {', '.join(servers)}")
        if self._node.count_publishers("/clock") > 1:
            raise BrokenNode("a node publishes /clock: the time is the simulation's")
        if isinstance(self._step, FreeRunning):
            return
        kept = {name for graph in self._step.graphs() for name in graph["nodes"]}
        for name, space in self._node.get_node_names_and_namespaces():
            full = f"{space.rstrip('/')}/{name}"
            if name not in OWN and not name.startswith(TOOLS) and full not in kept:
                raise BrokenNode(
                    f"the node {full} can't be kept in step: it is not of rclpy, or was started without the environment of "
                    "its launcher; --free-running tests it without a promise that runs repeat"
                )

    def _environment(self, call: Call, free_running: bool) -> dict[str, str]:
        """Environment variables of the nodes."""
        env = dict(os.environ)
        # Domains are the bridge's; messages go through memory of the kernel, of which nothing is left after a kill.
        env.update(ROS_DOMAIN_ID=str(self._domain.number), **NETWORK)
        # Output without wall-clock times, and the same order of sets in every process.
        env.update(RCUTILS_CONSOLE_OUTPUT_FORMAT="[{severity}] [{name}]: {message}", PYTHONHASHSEED="0", ACTCHECK_SEED=str(call.seed), ACTCHECK_INDEX=str(call.index))
        for name in ("ACTCHECK_ADDRESS", "ACTCHECK_ROS_KEEPER"):
            env.pop(name, None)
        if not free_running:
            inside = str(Path(__file__).parent / "inside")
            env["PYTHONPATH"] = os.pathsep.join(filter(None, [inside, env.get("PYTHONPATH", "")]))
            env["ACTCHECK_ROS_KEEPER"] = self._step.address
        env.update(self._mapping.env)
        return env


#: Settings of the middleware, for the bridge and the nodes: those of `loopback.xml`. Other ranges replace its transports.
NETWORK = {
    "FASTDDS_DEFAULT_PROFILES_FILE": str(Path(__file__).parent / "loopback.xml"),
    "ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT",
    "ROS_LOCALHOST_ONLY": "0",
}


#: Part of the report of every run whose nodes are not kept in step.
LOOSE = "free-running clock: neither the run nor its verdict repeats"


class Bridge:
    """Connects one campaign's worker with the nodes of a mapping."""

    def __init__(self, mapping: SkillMapping, free_running: bool) -> None:
        self._mapping, self._free_running = mapping, free_running
        self._run: RunOfNodes | None = None
        self._last_domain = os.getpid()

    def serve(self) -> None:
        """Performs actions until the campaign is over."""
        os.environ.update(NETWORK)
        name = self._mapping.file.stem + (f" ({LOOSE})" if self._free_running else "")
        fault: BrokenNode | ProtocolFault | None = None
        try:
            with Session(Wire.from_environment(), name, sorted(self._mapping.actions), on_reset=self._end_run) as session:
                while (call := session.next_call()) is not None:
                    try:
                        done = self._of_run(call, session).perform(call)
                        session.end(replace(done, message=f"{done.message} ({LOOSE})") if self._free_running else done)
                    except Aborted:
                        continue
        except (BrokenNode, ProtocolFault) as found:
            fault = found
        finally:
            self._end_run()
        if fault is not None:
            sys.exit(f"actcheck: {fault}" if isinstance(fault, ProtocolFault) else str(fault))

    def _of_run(self, call: Call, session: Session) -> RunOfNodes:
        if self._run is None:
            domain = Domain(self._last_domain)
            self._last_domain = domain.number
            self._run = RunOfNodes(self._mapping, session, self._free_running, domain, call)
        return self._run

    def _end_run(self) -> None:
        if self._run is not None:
            run, self._run = self._run, None
            for line in run.close():
                print(line, flush=True)
