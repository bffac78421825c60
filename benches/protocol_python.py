#!/usr/bin/env python3
"""How many lockstep exchanges a second does the Python client make?

    python benches/protocol_python.py          (where clients/python is installed)

The simulation's side is a process that answers every command with the same bytes, so that what is measured is the client: a
command of eight joints at each tick, and the observation that comes back. Beside it the same without the client: what sockets alone
allow.
"""

from __future__ import annotations

import json
import multiprocessing
import socket
import struct
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "clients/python"))
from actcheck import Robot
from actcheck.messages import Call
from actcheck.session import Session
from actcheck.wire import Wire
from tests.fake import ARM, BASE, Simulation, hello

EXCHANGES = 20_000


def frame(message: dict[str, object]) -> bytes:
    payload = json.dumps(message).encode()
    return struct.pack("<IB", len(payload), ord("J")) + payload


def answer(connection: socket.socket, first: bytes, reply: bytes) -> None:
    """Says hello, and then the same to everything."""
    connection.sendall(first)
    while connection.recv(65536):
        connection.sendall(reply)


def rate(work: object) -> float:
    """Times a second that something was done."""
    began = time.perf_counter()
    for _ in range(EXCHANGES):
        work()  # type: ignore[operator]
    return EXCHANGES / (time.perf_counter() - began)


def main() -> None:
    reply = Simulation(lambda simulation: None).observation()
    here, there = socket.socketpair()
    server = multiprocessing.Process(target=answer, args=(there, frame(hello()), frame(reply)), daemon=True)
    server.start()
    there.close()
    session = Session(Wire(here), "bench", ["Pick"])
    call_observation = session._receive("observation")
    from actcheck.messages import Observation

    robot = Robot(session, Call("Pick", {}, {}, 60.0, Observation.from_wire(call_observation)))
    targets = dict.fromkeys([*BASE, *ARM], 0.1)
    client = rate(lambda: robot.step(targets))
    request, length = frame({"type": "command", "ticks": 1, "positions": targets}), len(frame(reply))

    def bare() -> None:
        here.sendall(request)
        left = length
        while left:
            left -= len(here.recv(65536))

    sockets = rate(bare)
    print(f"client   {client:8.0f} exchanges a second")
    print(f"sockets  {sockets:8.0f} exchanges a second, {sockets / client:.1f} times as many")
    server.kill()


if __name__ == "__main__":
    main()
