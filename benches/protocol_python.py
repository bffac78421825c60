#!/usr/bin/env python3
"""Measures the lockstep exchanges per second of the Python client.

    pip install clients/python
    python benches/protocol_python.py

The simulator is a process that answers every command with the same bytes, so that only the client is measured: a
command for eight joints at each tick, and the parsed observation with arrays. The same exchange over bare sockets,
without the client, is measured for comparison.
"""

from __future__ import annotations

import json
import multiprocessing
import socket
import struct
import sys
import time
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "clients/python"))
from actcheck import Robot
from actcheck.session import Session
from actcheck.wire import Wire
from tests.fake import ARM, BASE, Simulation, hello

EXCHANGES = 20_000


def frame(message: dict[str, object]) -> bytes:
    """Encodes a message for the wire."""
    payload = json.dumps(message).encode()
    return struct.pack("<IB", len(payload), ord("J")) + payload


def answer(connection: socket.socket, greeting: bytes, reply: bytes) -> None:
    """Begins an action, then sends the same reply to every message."""
    connection.sendall(greeting)
    connection.recv(65536)
    while connection.recv(65536):
        connection.sendall(reply)


def rate(work: Callable[[], object]) -> float:
    """Returns calls of `work` per second."""
    began = time.perf_counter()
    for _ in range(EXCHANGES):
        work()
    return EXCHANGES / (time.perf_counter() - began)


def main() -> None:
    """Measures and prints both rates."""
    observation = Simulation(lambda simulation: None).observation()
    begin = {"type": "begin", "action": "Pick", "parameters": {}, "budget_s": 60.0, "observation": observation}
    here, there = socket.socketpair()
    greeting, reply = frame(hello()) + frame(begin), frame(observation)
    simulation = multiprocessing.Process(target=answer, args=(there, greeting, reply), daemon=True)
    simulation.start()
    session = Session(Wire(here), "bench", ["Pick"])
    call = session.next_call()
    assert call is not None
    robot, targets = Robot(session, call), dict.fromkeys([*BASE, *ARM], 0.1)
    client = rate(lambda: robot.step(targets))
    request = frame({"type": "command", "ticks": 1, "positions": targets})

    def bare() -> None:
        here.sendall(request)
        left = len(reply)
        while left:
            left -= len(here.recv(65536))

    sockets = rate(bare)
    print(f"client   {client:8.0f} exchanges per second")
    print(f"sockets  {sockets:8.0f} exchanges per second, {sockets / client:.1f} times as many")
    simulation.kill()


if __name__ == "__main__":
    main()
