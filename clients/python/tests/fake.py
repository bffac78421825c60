"""The simulation's side of the protocol, without physics: joints reach their targets at once, and simulated time costs no
computation.
"""

from __future__ import annotations

import json
import socket
import struct
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from actcheck import Robot
from actcheck.kinematics import read_urdf
from actcheck.session import Session
from actcheck.wire import Message, Wire

URDF = (Path(__file__).parents[3] / "models/robots/mobile_manipulator.urdf").read_text()
BASE = ["base_x_joint", "base_y_joint", "base_heading_joint"]
ARM = ["arm_lift_joint", "arm_flex_joint", "arm_roll_joint", "wrist_flex_joint", "wrist_roll_joint"]
FINGERS = ["finger_left_joint", "finger_right_joint"]
HEAD = ["head_pan_joint", "head_tilt_joint"]
ROLES = {name: role for role, names in zip(("base", "arm", "gripper", "head"), (BASE, ARM, FINGERS, HEAD)) for name in names}
SPEEDS = dict(zip(BASE + ARM + FINGERS + HEAD, (0.25, 0.25, 1.0, 0.2, 1.2, 2.0, 1.5, 1.5, 0.1, 0.1, 1.0, 1.0)))
JOINTS = [joint for joint in read_urdf(URDF) if joint.kind != "fixed"]
HOME = [0.0, 0.0, -1.57, -1.57, 0.0]
LEVEL = [0.3, -1.25, 0.0, -0.32, 0.0]
TICK_S = 1.0 / 60.0

Script = Callable[["Simulation"], None]


def hello(**changes: Any) -> Message:
    """The simulation's hello."""
    joints = [
        {
            "name": joint.name,
            "kind": joint.kind,
            "role": ROLES[joint.name],
            "lower": max(joint.lower, -1000.0),
            "upper": min(joint.upper, 1000.0),
            "velocity": SPEEDS[joint.name],
            "effort": 100.0,
        }
        for joint in JOINTS
    ]
    robot = {
        "name": "Mobile manipulator",
        "urdf": URDF,
        "joints": joints,
        "base_joints": BASE,
        "arm_joints": ARM,
        "gripper_joints": FINGERS,
        "head_joints": HEAD,
        "tool_link": "grasp_link",
        "tool_turned_rad": [0.0, 0.0, 0.0],
        "mount_height_m": 0.0,
        "max_opening_m": 0.135,
        "grip_force_n": 7.0,
        "home": HOME,
        "postures": [LEVEL],
        "camera": {"link": "head_camera_link", "width": 4, "height": 3, "horizontal_fov_rad": 1.0, "min_range_m": 0.3, "max_range_m": 5.0},
    }
    message = {"type": "hello", "protocol": 1, "actcheck": "0.1.0", "worker": 0, "control_period_s": TICK_S}
    return message | {"privileged": False, "robot": robot, "sensors": []} | changes


class Simulation:
    """One end of a socket pair; `script` plays the simulation in a separate thread."""

    def __init__(self, script: Script) -> None:
        self._socket, client = socket.socketpair()
        self.wire = Wire(client)
        #: All messages from the client, in order.
        self.received: list[Message] = []
        self.fault: BaseException | None = None
        self.positions = {joint.name: 0.0 for joint in JOINTS} | dict(zip(ARM, HOME))
        self.opening_m, self.wanted_m, self.force_n = 0.0, 0.0, 0.0
        #: Width of the object between the fingers, or `None`. Unit: metres.
        self.between_m: float | None = None
        self.time_s = 0.0
        self._thread = threading.Thread(target=self._play, args=(script,), daemon=True)
        self._thread.start()

    def _play(self, script: Script) -> None:
        try:
            script(self)
        except BaseException as fault:
            self.fault = fault
        finally:
            self._socket.close()

    def join(self) -> None:
        """Waits for the script's end and re-raises its exception."""
        self._thread.join(20.0)
        assert not self._thread.is_alive(), "the script did not end"
        self.wire.close()
        if self.fault is not None:
            raise self.fault

    def send_bytes(self, kind: bytes, payload: bytes) -> None:
        self._socket.sendall(struct.pack("<I", len(payload)) + kind + payload)

    def send(self, message: Message, *arrays: np.ndarray[Any, Any]) -> None:
        self.send_bytes(b"J", json.dumps(message).encode())
        for array in arrays:
            self.send_bytes(b"B", array.tobytes())

    def receive(self, kind: str | None = None) -> Message:
        header = self._exactly(5)
        (length,) = struct.unpack("<I", header[:4])
        assert header[4:] == b"J"
        message: Message = json.loads(self._exactly(length))
        self.received.append(message)
        assert kind in (None, message["type"]), f"received {message}, expected {kind}"
        return message

    def _exactly(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            chunk = self._socket.recv(count - len(data))
            if not chunk:
                raise EOFError("the client closed the connection")
            data += chunk
        return data

    def greet(self) -> Message:
        """Sends hello and returns the client's hello."""
        self.send(hello())
        return self.receive("hello")

    def reset(self) -> None:
        self.send({"type": "reset", "run": "k7f3-1", "index": 1, "seed": 5})
        self.receive("ready")

    def observation(self) -> Message:
        names = [joint.name for joint in JOINTS]
        x, y, heading = (self.positions[name] for name in BASE)
        return {
            "type": "observation",
            "time_s": self.time_s,
            "joints": {
                "positions": [self.positions[name] for name in names],
                "velocities": [0.0] * len(names),
                "efforts": [0.0] * len(names),
            },
            "base": {"position_m": [x, y], "heading_rad": heading, "height_m": 0.0},
            "gripper": {"opening_m": self.opening_m, "force_n": self.force_n},
            "budget_left_s": 60.0 - self.time_s,
        }

    def begin(self, **parameters: Any) -> None:
        values = parameters or {"pickObject": ["obj:glass_1"], "surfaceObjects": ["obj:cup"]}
        message = {"type": "begin", "action": "Pick", "parameters": values, "kinds": {}, "budget_s": 60.0}
        self.send(message | {"observation": self.observation()})

    def receive_first_command(self) -> Message:
        """Begins a run with one action, and returns its first command."""
        self.greet()
        self.reset()
        self.begin()
        return self.receive("command")

    def take(self, command: Message) -> None:
        """Moves the joints and the gripper by the ticks of a command."""
        self.positions |= command.get("positions", {})
        if "gripper" in command:
            self.wanted_m = command["gripper"]["opening_m"]
        stop = self.wanted_m if self.between_m is None else max(self.wanted_m, self.between_m)
        way = 0.2 * TICK_S * command["ticks"]
        self.opening_m += min(max(stop - self.opening_m, -way), way)
        pressing = stop > self.wanted_m and abs(self.opening_m - stop) < 1e-9
        self.force_n = 7.0 if pressing else 0.0
        self.time_s += command["ticks"] * TICK_S

    def act(self) -> Message:
        """Executes commands until the client ends the action; returns its `end` message."""
        while True:
            message = self.receive()
            if message["type"] == "end":
                return message
            if message["type"] == "ask":
                self.answer(message)
                continue
            self.take(message)
            self.send(self.observation())

    def answer(self, ask: Message) -> None:
        """Answers a sensor request."""
        upright = {"position_m": [1.0, 0.0, 0.5], "quaternion_xyzw": [0.0, 0.0, 0.0, 1.0]}
        answer: Message = {"type": "answer", "what": ask["what"]}
        if ask["what"] == "objects":
            glass = {"id": "obj:glass_1", "pose": upright, "size_m": [0.08, 0.08, 0.14], "category": "act:Glass"}
            table = {"id": "obj:table", "pose": upright, "size_m": [0.8, 0.8, 0.5], "furniture": True}
            self.send(answer | {"objects": [one for one in (glass, table) if ask.get("of") in (None, one["id"])]})
        elif ask["what"] == "cloud":
            announced = [{"name": "cloud", "dtype": "f32", "shape": [5, 3]}]
            self.send(answer | {"binary": announced}, np.arange(15, dtype="<f4"))
        else:
            announced = [{"name": "depth", "dtype": "f32", "shape": [3, 4]}]
            picture = {"camera_pose": upright, "width": 4, "height": 3, "horizontal_fov_rad": 1.0, "focal_px": 3.7, "binary": announced}
            self.send(answer | picture, np.arange(12, dtype="<f4"))

    def bye(self) -> None:
        self.send({"type": "bye"})


def one_action(simulation: Simulation) -> None:
    """A whole campaign of one action."""
    simulation.greet()
    simulation.reset()
    simulation.begin()
    simulation.act()
    simulation.bye()


def robot_of(simulation: Simulation) -> tuple[Session, Robot]:
    """The client's side of `one_action`, up to the robot."""
    session = Session(simulation.wire, "test", ["Pick"])
    call = session.next_call()
    assert call is not None
    return session, Robot(session, call)
