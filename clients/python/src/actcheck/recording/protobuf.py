"""Encodes the messages of an episode in Protocol Buffers, without a library for it.

The messages' definition for readers is `clients/episode.proto`. All but contacts have the same layout in each state of an episode, so
that a layout is made once and filled with arrays.
"""

from __future__ import annotations

import functools
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from actcheck.recording.states import Array, Contacts, Integers, Outcomes

Bytes = NDArray[np.uint8]

_LENGTH_DELIMITED = 2
_FIXED64 = 1
_VARINT = 0

#: Types of fields in a descriptor.
_DOUBLE, _INT64, _INT32, _BOOL, _STRING, _MESSAGE, _UINT32 = 1, 3, 5, 8, 9, 11, 13


def varint(value: int) -> bytes:
    """Encodes an unsigned integer in as few bytes as possible."""
    encoded = bytearray()
    while value > 0x7F:
        encoded.append(value & 0x7F | 0x80)
        value >>= 7
    encoded.append(value)
    return bytes(encoded)


def _key(number: int, wire: int) -> bytes:
    return varint(number << 3 | wire)


def delimited(number: int, payload: bytes) -> bytes:
    """Encodes a field that has a length: text, bytes, a message or packed numbers."""
    return _key(number, _LENGTH_DELIMITED) + varint(len(payload)) + payload


def _integer(number: int, value: int) -> bytes:
    return _key(number, _VARINT) + varint(value)


@dataclass(frozen=True)
class Field:
    """A field of a message. `kind` is a number of `FieldDescriptorProto.Type`, `message` the full name of a message's type."""

    name: str
    number: int
    kind: int
    repeated: bool = False
    optional: bool = False
    message: str | None = None

    def descriptor(self) -> bytes:
        """Encodes a `FieldDescriptorProto`. A field is `optional` if its absence differs from zero; its oneof has index 0."""
        encoded = delimited(1, self.name.encode()) + _integer(3, self.number)
        encoded += _integer(4, 3 if self.repeated else 1) + _integer(5, self.kind)
        if self.message is not None:
            encoded += delimited(6, f".{self.message}".encode())
        if self.optional:
            encoded += _integer(9, 0) + _integer(17, 1)
        return encoded


@dataclass(frozen=True)
class MessageType:
    """A message's type in a file of its own."""

    package: str
    name: str
    fields: tuple[Field, ...]
    #: Names of the files that it needs.
    needs: tuple[str, ...] = ()

    def file(self) -> str:
        """Name of the file that defines the type."""
        return f"{self.package.replace('.', '/')}/{self.name}.proto"

    def descriptor(self) -> bytes:
        """Encodes a `FileDescriptorProto`."""
        message = delimited(1, self.name.encode()) + b"".join(delimited(2, field.descriptor()) for field in self.fields)
        for field in self.fields:
            if field.optional:
                message += delimited(8, delimited(1, f"_{field.name}".encode()))
        encoded = delimited(1, self.file().encode()) + delimited(2, self.package.encode())
        encoded += b"".join(delimited(3, name.encode()) for name in self.needs)
        return encoded + delimited(4, message) + delimited(12, b"proto3")


def _doubles(name: str, number: int) -> Field:
    return Field(name, number, _DOUBLE, repeated=True)


_TIMESTAMP = MessageType("google.protobuf", "Timestamp", (Field("seconds", 1, _INT64), Field("nanos", 2, _INT32)))
_VECTOR = MessageType("foxglove", "Vector3", tuple(Field(axis, at + 1, _DOUBLE) for at, axis in enumerate("xyz")))
_QUATERNION = MessageType("foxglove", "Quaternion", tuple(Field(axis, at + 1, _DOUBLE) for at, axis in enumerate("xyzw")))
_TRANSFORM = MessageType(
    "foxglove",
    "FrameTransform",
    (
        Field("timestamp", 1, _MESSAGE, message="google.protobuf.Timestamp"),
        Field("parent_frame_id", 2, _STRING),
        Field("child_frame_id", 3, _STRING),
        Field("translation", 4, _MESSAGE, message="foxglove.Vector3"),
        Field("rotation", 5, _MESSAGE, message="foxglove.Quaternion"),
    ),
    (_TIMESTAMP.file(), _VECTOR.file(), _QUATERNION.file()),
)
_TRANSFORMS = MessageType(
    "foxglove",
    "FrameTransforms",
    (Field("transforms", 1, _MESSAGE, repeated=True, message="foxglove.FrameTransform"),),
    (_TRANSFORM.file(),),
)
_VELOCITIES = MessageType("actcheck", "Velocities", (_doubles("linear", 1), _doubles("angular", 2)))
_JOINTS = MessageType("actcheck", "Joints", (_doubles("position", 1), _doubles("velocity", 2), _doubles("effort", 3)))
_CONTROLS = MessageType("actcheck", "Controls", (_doubles("value", 1),))
_CONTACTS = MessageType(
    "actcheck",
    "Contacts",
    (
        Field("first", 1, _UINT32, repeated=True),
        Field("second", 2, _UINT32, repeated=True),
        _doubles("normal_force", 3),
        _doubles("force", 4),
        _doubles("position", 5),
        _doubles("distance", 6),
    ),
)
_OUTCOME = MessageType(
    "actcheck",
    "Outcome",
    (
        Field("reward", 1, _DOUBLE),
        Field("success", 2, _BOOL, optional=True),
        Field("terminated", 3, _BOOL),
        Field("truncated", 4, _BOOL),
    ),
)

#: Topic → the types of its message, the message's own type last.
TYPES: dict[str, tuple[MessageType, ...]] = {
    "/tf": (_TIMESTAMP, _VECTOR, _QUATERNION, _TRANSFORM, _TRANSFORMS),
    "/velocities": (_VELOCITIES,),
    "/joints": (_JOINTS,),
    "/controls": (_CONTROLS,),
    "/contacts": (_CONTACTS,),
    "/outcome": (_OUTCOME,),
}


@functools.cache
def schema(topic: str) -> tuple[str, bytes]:
    """Full name of a topic's message and its serialised `FileDescriptorSet`."""
    types = TYPES[topic]
    return f"{types[-1].package}.{types[-1].name}", b"".join(delimited(1, one.descriptor()) for one in types)


#: Bytes of a timestamp: two keys with five bytes each. Readers accept a varint with leading zeros, so that the length is constant.
_TIMESTAMP_BYTES = 12


def _timestamps(time: Integers) -> Bytes:
    """Encodes timestamps with a constant length. Unit of `time`: nanoseconds. Shape: states × 12."""
    encoded = np.zeros((len(time), _TIMESTAMP_BYTES), np.uint8)
    for at, (key, value) in enumerate(((1 << 3, time // 1_000_000_000), (2 << 3, time % 1_000_000_000))):
        encoded[:, 6 * at] = key
        for place in range(5):
            encoded[:, 6 * at + 1 + place] = (value >> (7 * place)) & 0x7F | (0x80 if place < 4 else 0)
    return encoded


#: A coordinate with its key.
_COORDINATE = np.dtype([("key", "u1"), ("value", "<f8")])
_VECTOR_BYTES, _QUATERNION_BYTES = 3 * _COORDINATE.itemsize, 4 * _COORDINATE.itemsize


class TransformLayout:
    """Encodes the poses of an episode's moving bodies as `foxglove.FrameTransforms`, many states at once."""

    def __init__(self, bodies: list[str]) -> None:
        self._bodies = len(bodies)
        vector, quaternion = (b"".join(_key(axis + 1, _FIXED64) + bytes(8) for axis in range(axes)) for axes in (3, 4))
        message = b""
        fields: list[tuple[str, Any, int]] = []
        for at, name in enumerate(bodies):
            names = delimited(2, b"world") + delimited(3, name.encode())
            body = delimited(1, bytes(_TIMESTAMP_BYTES)) + names + delimited(4, vector) + delimited(5, quaternion)
            message += delimited(1, body)
            # A key and a length of one byte each precede the timestamp, the vector and the quaternion.
            fields.append((f"time{at}", (np.uint8, (_TIMESTAMP_BYTES,)), len(message) - len(body) + 2))
            fields.append((f"position{at}", (_COORDINATE, (3,)), len(message) - _QUATERNION_BYTES - 2 - _VECTOR_BYTES))
            fields.append((f"rotation{at}", (_COORDINATE, (4,)), len(message) - _QUATERNION_BYTES))
        self._message = message
        layout: Any = {part: [field[at] for field in fields] for at, part in enumerate(("names", "formats", "offsets"))}
        self._layout: np.dtype[Any] = np.dtype(layout | {"itemsize": len(message)})

    def encoded(self, time: Integers, poses: Array) -> list[bytes]:
        """The message of each state. Shape of `poses`: states × bodies × 7."""
        if not self._bodies:
            return [b""] * len(time)
        rows = np.frombuffer(bytearray(self._message * len(time)), self._layout)
        timestamps = _timestamps(time)
        for at in range(self._bodies):
            rows[f"time{at}"] = timestamps
            rows[f"position{at}"]["value"] = poses[:, at, :3]
            rows[f"rotation{at}"]["value"] = poses[:, at, 3:]
        return _cut(rows.tobytes(), len(self._message))


def _cut(content: bytes, size: int) -> list[bytes]:
    """The content in pieces of one size."""
    return [content[begin : begin + size] for begin in range(0, len(content), size)]


def packed(columns: list[Array | None]) -> list[bytes]:
    """Encodes messages of packed doubles, fields 1, 2, …: one array a field, one row a state. An absent or empty field is left out."""
    states = next((len(values) for values in columns if values is not None), 0)
    parts: list[Bytes] = []
    for at, values in enumerate(columns):
        if values is None or not values[:1].size:
            continue
        rows = _bytes(values)
        head = np.frombuffer(_key(at + 1, _LENGTH_DELIMITED) + varint(rows.shape[1]), np.uint8)
        parts += [np.broadcast_to(head, (states, len(head))), rows]
    if not parts:
        return [b""] * states
    whole = np.concatenate(parts, 1)
    return _cut(whole.tobytes(), whole.shape[1])


def contacts(recorded: Contacts) -> Iterator[bytes]:
    """The message of each state; empty for a state without contacts."""
    wide = max(recorded.first.max(initial=0), recorded.second.max(initial=0)) > 0x7F
    indices = [_indices(recorded.first, wide), _indices(recorded.second, wide)]
    doubles = [recorded.normal_force, recorded.force, recorded.position, recorded.distance]
    columns = indices + [_bytes(values) for values in doubles]
    begin = 0
    for count in recorded.counts.tolist():
        end = begin + count
        yield b"".join(delimited(at + 1, rows[begin:end].tobytes()) for at, rows in enumerate(columns)) if count else b""
        begin = end


def _bytes(values: Array) -> Bytes:
    """The bytes of each row."""
    width = int(np.prod(values.shape[1:]))
    return np.ascontiguousarray(values, "<f8").reshape(len(values), width).view(np.uint8)


def _indices(values: Integers, wide: bool) -> Bytes:
    """Encodes indices below 2^14 as varints of constant length. Shape: values × 1 or 2."""
    if not wide:
        return values.astype(np.uint8).reshape(-1, 1)
    return np.stack([values & 0x7F | 0x80, values >> 7], 1).astype(np.uint8)


def outcomes(recorded: Outcomes) -> Iterator[bytes]:
    """The message of each state."""
    for reward, success, terminated, truncated in zip(
        recorded.reward.tolist(), recorded.success, recorded.terminated, recorded.truncated, strict=True
    ):
        message = struct.pack("<Bd", 1 << 3 | _FIXED64, reward)
        if success is not None:
            message += bytes((2 << 3, success))
        yield message + bytes((3 << 3, terminated, 4 << 3, truncated))
