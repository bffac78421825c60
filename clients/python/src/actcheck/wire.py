"""Frames on a socket: four bytes of length (unsigned, little-endian), one byte of kind, then the payload.

Kind `J` is a JSON object in UTF-8, kind `B` raw bytes that belong to the preceding JSON object.
"""

from __future__ import annotations

import json
import os
import socket
import struct
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from actcheck.faults import Closed, ProtocolFault

Message = dict[str, Any]

#: Largest accepted payload. Unit: bytes.
MOST_RECEIVED = 64 << 20
#: Largest payload to send. Unit: bytes.
MOST_SENT = 1 << 20

_HEADER = struct.Struct("<IB")
_JSON = ord("J")
_BYTES = ord("B")
#: Created once: `json.dumps` with separators would create an encoder for each call.
_encode = json.JSONEncoder(separators=(",", ":"), allow_nan=False).encode
_DTYPES: dict[str, np.dtype[Any]] = {"f32": np.dtype("<f4"), "f64": np.dtype("<f8"), "u8": np.dtype("u1"), "u16": np.dtype("<u2")}


class Wire:
    """One end of a connection: sends and receives whole messages."""

    def __init__(self, connection: socket.socket) -> None:
        self._socket = connection
        self._buffer = bytearray()
        #: When the last message was received, of `time.monotonic`; `None` while a message is awaited.
        self.answered_at: float | None = None

    @classmethod
    def dial(cls, address: str) -> Wire:
        """Connects to an address such as `unix:/run/simulation.sock`."""
        kind, _, path = address.partition(":")
        if kind != "unix" or not path:
            raise ProtocolFault(f"{address!r} is not an address of the form unix:/path")
        connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            connection.connect(path)
        except OSError as fault:
            connection.close()
            raise Closed(f"can't connect to {path}: {fault.strerror or fault}") from fault
        return cls(connection)

    @classmethod
    def from_environment(cls) -> Wire:
        """Connects to the simulation that started this program."""
        address = os.environ.get("ACTCHECK_ADDRESS")
        if not address:
            raise ProtocolFault(
                "this program must be started by actcheck: set it as `test_launcher` in a configuration "
                "and use `actcheck run` (in a notebook: `actcheck.connect`)"
            )
        return cls.dial(address)

    def send(self, message: Message) -> None:
        """Sends one JSON message."""
        payload = _encode(message).encode()
        if len(payload) > MOST_SENT:
            raise ValueError(f"a message of {len(payload)} bytes is too long: the limit is {MOST_SENT} bytes")
        try:
            self._socket.sendall(_HEADER.pack(len(payload), _JSON) + payload)
        except OSError as fault:
            raise Closed(f"the connection to actcheck is lost: {fault.strerror or fault}") from fault

    def receive(self) -> Message:
        """Waits for one JSON message; the arrays it announces are stored under the key `arrays`."""
        self.answered_at = None
        kind, payload = self._frame()
        if kind != _JSON:
            raise ProtocolFault("received a binary frame, expected a message")
        try:
            message = json.loads(payload.decode())
        except ValueError as fault:
            raise ProtocolFault(f"received invalid JSON: {fault}") from fault
        if not isinstance(message, dict) or not isinstance(message.get("type"), str):
            raise ProtocolFault("received a message that is not an object with a `type`")
        announced = message.get("binary")
        if announced is not None:
            message["arrays"] = {entry["name"]: self._array(entry) for entry in announced}
        self.answered_at = time.monotonic()
        return message

    def close(self) -> None:
        """Closes the connection."""
        self._socket.close()

    def _array(self, entry: Message) -> NDArray[Any]:
        kind, payload = self._frame()
        dtype = _DTYPES.get(entry["dtype"])
        if kind != _BYTES or dtype is None:
            raise ProtocolFault(f"the array {entry['name']!r} is not a binary frame of a known type")
        shape = tuple(int(side) for side in entry["shape"])
        if len(payload) != dtype.itemsize * int(np.prod(shape)):
            raise ProtocolFault(f"the array {entry['name']!r} has {len(payload)} bytes, which does not match {shape} of {dtype}")
        array: NDArray[Any] = np.frombuffer(payload, dtype=dtype).reshape(shape)
        return array

    def _frame(self) -> tuple[int, bytes]:
        length, kind = _HEADER.unpack(self._take(_HEADER.size))
        if length > MOST_RECEIVED:
            raise ProtocolFault(f"a frame of {length} bytes is too long: the limit is {MOST_RECEIVED} bytes")
        return kind, self._take(length)

    def _take(self, count: int) -> bytes:
        buffer = self._buffer
        while len(buffer) < count:
            try:
                chunk = self._socket.recv(max(65536, count - len(buffer)))
            except OSError as fault:
                raise Closed(f"the connection to actcheck is lost: {fault.strerror or fault}") from fault
            if not chunk:
                raise Closed("actcheck closed the connection")
            buffer += chunk
        taken = bytes(buffer[:count])
        del buffer[:count]
        return taken
