"""The simulation's side of lockstep: gives the nodes' processes their turns, and waits until all are idle."""

from __future__ import annotations

import json
import select
import socket
import struct
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from builtin_interfaces.msg import Time
from rclpy.executors import Executor, SingleThreadedExecutor, TimeoutException
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock

from actcheck.ros2.faults import BrokenNode

_LENGTH = struct.Struct("<I")
#: Topics with which both sides know that all earlier messages have arrived, as in `inside/actcheck_keeper.py`: a message is received after
#: all that were sent before it, by whomever, since they come through the same socket.
MARK, TURN = "/actcheck/mark", "/actcheck/turn_"
#: Most rounds of messages at one moment: more are a flood, of nodes that answer each other without end.
MOST_ROUNDS = 200


@dataclass(eq=False)
class Kept:
    """A process with a keeper."""

    connection: socket.socket
    pid: int
    #: Name of its program, for people.
    program: str
    #: Number of the command that started it, and its arguments: processes take turns in this order.
    order: tuple[int, str, int] = (0, "", 0)
    #: Publisher of its markers.
    turns: Any = None
    #: Last mark that came by a message.
    marked: int = 0
    #: Whether something was sent to it, perhaps, since its last turn began.
    due: bool = True
    buffer: bytearray = field(default_factory=bytearray)


class Lockstep:
    """Turns of all processes that have a keeper. Times are simulated, in nanoseconds."""

    def __init__(self, node: Node, executor: Executor, limit_s: float, alive: Callable[[], None]) -> None:
        self._node, self._executor = node, executor
        self._limit_s = limit_s
        #: Raises `BrokenNode` if a process has ended.
        self._alive = alive
        self._folder = tempfile.TemporaryDirectory(prefix="actcheck-ros2-")
        self.address = str(Path(self._folder.name) / "keeper")
        self._server = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._server.bind(self.address)
        self._server.listen(64)
        self.kept: list[Kept] = []
        self._turn, self._now = 0, 0
        self._handled = 0
        self._qos = qos = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
        self._clock = node.create_publisher(Clock, "/clock", qos)
        # A node of its own: while the simulation waits for a mark, nothing else is taken, so that the order of its callbacks
        # does not depend on which message came first.
        self._marks = Node(f"{node.get_name()}_marks", context=node.context, start_parameter_services=False, enable_rosout=False)
        self._marks.create_subscription(Clock, MARK, self._marked, qos)
        self._marker = SingleThreadedExecutor(context=node.context)
        self._marker.add_node(self._marks)

    def accept(self) -> None:
        """Takes processes that have called, without waiting."""
        while select.select([self._server], [], [], 0)[0]:
            connection, _ = self._server.accept()
            kept = Kept(connection, 0, "")
            hello = self._receive(kept, 5.0)
            words = [str(word) for word in hello["command"]]
            kept.pid, kept.program = int(hello["hello"]), Path(words[0]).name if words else "python"
            kept.order = (int(hello["number"]), " ".join(words), kept.pid)
            kept.turns = self._marks.create_publisher(Clock, f"{TURN}{kept.pid}", self._qos)
            self.kept.append(kept)

    def hold(self, now: int) -> None:
        """From now on, processes act only in their turns."""
        self._now = now
        # The order of turns must not depend on which process started faster.
        self.kept.sort(key=lambda kept: kept.order)
        since = time.monotonic()
        while any(kept.turns.get_subscription_count() == 0 for kept in self.kept):
            if time.monotonic() - since > self._limit_s:
                raise BrokenNode("a process has no node, or the network does not let messages pass")
            time.sleep(0.01)
        for kept in self.kept:
            self._send(kept, {"hold": now})
            if self._receive(kept)["held"] == 0:
                raise BrokenNode(f"{kept.program} has an rclpy node that never spins, and so never hears of the time")

    def free(self) -> None:
        """Lets all processes act on their own, so that they can end."""
        for kept in self.kept:
            try:
                self._send(kept, {"free": True})
            except BrokenNode:
                continue

    @property
    def nodes(self) -> int:
        """Number of processes with a keeper."""
        return len(self.kept)

    def close(self) -> None:
        """Closes all connections."""
        for kept in self.kept:
            kept.connection.close()
        self._server.close()
        self._folder.cleanup()
        self._marker.shutdown()
        self._marks.destroy_node()

    def graphs(self) -> list[dict[str, Any]]:
        """The publishers and clients of every process, with the number of their matches."""
        found = []
        for kept in self.kept:
            if kept.turns.get_subscription_count() == 0:
                found.append({"nodes": [], "executors": 1, "ends": [["client", MARK, 0]]})
                continue
            self._send(kept, {"graph": True})
            graph = self._receive(kept)["graph"]
            _raise(kept, graph["faults"])
            found.append(graph)
        return found

    def barrier(self, now: int) -> None:
        """Gives all processes turns at a moment until none has anything to do. Raises `BrokenNode`."""
        if now != self._now:
            self._clock.publish(clock(now))
        self._now = now
        self.drain()
        for kept in self.kept:
            kept.due = True
        for _ in range(MOST_ROUNDS):
            self.accept()
            for kept in self.kept:
                if kept.due:
                    self._give_turn(kept)
            if not any(kept.due for kept in self.kept):
                return
        raise BrokenNode(f"the nodes sent messages in {MOST_ROUNDS} rounds while no time passed: a loop of messages without a rate")

    def _give_turn(self, kept: Kept) -> None:
        """Gives a process its turn. Others are due again if it, or the simulation in answer to it, sent something."""
        self._turn += 1
        kept.due = False
        kept.turns.publish(Clock(clock=Time(sec=self._turn)))
        self._send(kept, {"turn": self._turn, "now": self._now})
        reply = self._receive(kept)
        _raise(kept, reply["faults"])
        if not reply["sends"]:
            return
        if not reply["marked"]:
            self._alive()
            raise BrokenNode(f"{kept.program} shut its ROS context down, or destroyed the keeper's node")
        self._until_marked(kept)
        before = self._handled
        self.drain()
        for other in self.kept:
            # Messages of a process to itself arrive within its turn.
            other.due = other.due or other is not kept or self._handled != before

    def drain(self) -> None:
        """Performs all callbacks of the simulation's own node that are ready."""
        while performed(self._executor, 0.0):
            self._handled += 1

    def _marked(self, message: Clock) -> None:
        for kept in self.kept:
            if kept.pid == message.clock.nanosec:
                kept.marked = max(kept.marked, message.clock.sec)

    def _until_marked(self, kept: Kept) -> None:
        since = time.monotonic()
        while kept.marked < self._turn:
            performed(self._marker, 0.05)
            if time.monotonic() - since > self._limit_s:
                raise BrokenNode(f"messages of {kept.program} do not arrive: was the network stopped?")

    def _send(self, kept: Kept, message: dict[str, Any]) -> None:
        payload = json.dumps(message).encode()
        try:
            kept.connection.sendall(_LENGTH.pack(len(payload)) + payload)
        except OSError:
            self._alive()
            raise BrokenNode(f"{kept.program} ended") from None

    def _receive(self, kept: Kept, limit_s: float | None = None) -> dict[str, Any]:
        since, asked = time.monotonic(), False
        limit = limit_s or self._limit_s
        while True:
            if len(kept.buffer) >= _LENGTH.size:
                length = _LENGTH.unpack(kept.buffer[: _LENGTH.size])[0]
                if len(kept.buffer) >= _LENGTH.size + length:
                    payload = bytes(kept.buffer[_LENGTH.size : _LENGTH.size + length])
                    del kept.buffer[: _LENGTH.size + length]
                    message: dict[str, Any] = json.loads(payload)
                    if asked and "where" in message:
                        place = message["where"] or "an unknown place"
                        raise BrokenNode(f"{kept.program} was busy for more than {limit:g} s while no time passed: at {place}")
                    return message
            ready, _, _ = select.select([kept.connection], [], [], 0.25)
            if ready:
                try:
                    piece = kept.connection.recv(65536)
                except OSError:
                    piece = b""
                if not piece:
                    time.sleep(0.05)
                    self._alive()
                    raise BrokenNode(f"{kept.program} ended")
                kept.buffer += piece
                continue
            late = time.monotonic() - since
            if late > limit + 3.0:
                raise BrokenNode(f"{kept.program} does not answer: all of its threads are stopped")
            if late > limit and not asked:
                asked = True
                self._send(kept, {"where": True})


class FreeRunning:
    """The contrast to lockstep: the clock runs with the wall's, whether the nodes keep up or not."""

    def __init__(self, node: Node, executor: Executor, alive: Callable[[], None]) -> None:
        self._executor, self._alive = executor, alive
        self._clock = node.create_publisher(Clock, "/clock", 10)
        self._started: tuple[float, int] | None = None
        self.address, self.nodes = "", 0

    def accept(self) -> None:
        """No process calls."""

    def hold(self, now: int) -> None:
        """The clock starts to run."""
        self._started = (time.monotonic(), now)

    def free(self) -> None:
        """No process is held."""

    def close(self) -> None:
        """Nothing is open."""

    def graphs(self) -> list[dict[str, Any]]:
        """Nothing is known of the nodes."""
        return []

    def barrier(self, now: int) -> None:
        """Publishes the time, and performs callbacks until the wall's clock has come to it."""
        self._clock.publish(clock(now))
        self._alive()
        if self._started is None:
            self.drain()
            return
        since, begun = self._started
        while True:
            left = (now - begun) / 1e9 - (time.monotonic() - since)
            performed(self._executor, max(0.0, min(left, 0.01)))
            if left <= 0.0:
                return

    def drain(self) -> None:
        """Performs all callbacks that are ready."""
        while performed(self._executor, 0.0):
            pass


def _raise(kept: Kept, faults: list[dict[str, str]]) -> None:
    """Raises the first fault of a process that can't be kept in step."""
    for fault in faults:
        place = f" ({fault['place']})" if fault["place"] else ""
        raise BrokenNode(f"{kept.program} can't be kept in step: {fault['words']}{place}")


def performed(executor: Executor, seconds: float) -> bool:
    """Performs one callback that is ready within some seconds. Returns whether there was one."""
    try:
        handler, _, _ = executor.wait_for_ready_callbacks(timeout_sec=seconds)
    except TimeoutException:
        return False
    handler()
    error = handler.exception()
    if error is not None:
        raise error
    return True


def clock(now: int) -> Clock:
    """The message of a time in nanoseconds."""
    message = Clock()
    message.clock.sec, message.clock.nanosec = divmod(now, 1_000_000_000)
    return message
