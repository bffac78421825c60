"""The skill protocol with only Python's standard library, for test programs."""

import json
import os
import socket
import struct
import sys

LIMITS = {"f32": 4, "u8": 1}


class Link:
    """Frames over the simulator's socket."""

    def __init__(self):
        kind, path = os.environ["ACTCHECK_ADDRESS"].split(":", 1)
        assert kind == "unix" and os.environ["ACTCHECK_PROTOCOL"] == "1"
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.socket.connect(path)
        log = os.environ.get("WIRE_LOG")
        self.log = open(f"{log}.{os.environ['ACTCHECK_WORKER']}", "a") if log else None

    def raw(self, data):
        self.socket.sendall(data)

    def send(self, message):
        self.note("from", message)
        text = json.dumps(message).encode()
        self.raw(struct.pack("<IB", len(text), ord("J")) + text)

    def exactly(self, size):
        data = b""
        while len(data) < size:
            piece = self.socket.recv(size - len(data))
            if not piece:
                sys.exit(0)
            data += piece
        return data

    def frame(self):
        size, kind = struct.unpack("<IB", self.exactly(5))
        return chr(kind), self.exactly(size)

    def receive(self):
        kind, text = self.frame()
        assert kind == "J", kind
        message = json.loads(text)
        self.note("to", message)
        message["frames"] = []
        for binary in message.get("binary", []):
            kind, data = self.frame()
            size = LIMITS[binary["dtype"]]
            for side in binary["shape"]:
                size *= side
            assert kind == "B" and len(data) == size, (kind, len(data), size)
            message["frames"].append(data)
        return message

    def ask(self, message):
        self.send(message)
        return self.receive()

    def note(self, direction, message):
        if self.log:
            self.log.write(json.dumps({"direction": direction, "message": message}) + "\n")
            self.log.flush()


def serve(perform, actions=("Pick",), name="test"):
    """Introduces itself and performs actions until the simulator sends `bye`."""
    link = Link()
    link.hello = link.receive()
    assert link.hello["type"] == "hello"
    link.send({"type": "hello", "protocol": 1, "name": name, "actions": list(actions)})
    while True:
        message = link.receive()
        kind = message["type"]
        if kind == "reset":
            link.run = message
            link.send({"type": "ready"})
        elif kind == "begin":
            end = perform(link, message)
            link.send(end if end else {"type": "aborted"})
        elif kind == "bye":
            return
        else:
            sys.exit(f"unexpected: {message}")
