"""Writes one episode to an MCAP file. The format is described in `docs/episodes.md`."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from pathlib import Path
from typing import IO, Any

from actcheck.faults import RecordingFault
from actcheck.recording import protobuf
from actcheck.recording.model import MARK_SCHEMA, SCHEMA, Model, moving
from actcheck.recording.states import States

#: Version of the file's format.
FORMAT = "1"
#: Name of the metadata record.
METADATA = "actcheck.episode"

_encode = json.JSONEncoder(separators=(",", ":"), allow_nan=False, ensure_ascii=False).encode
_NUMBER = re.compile(r"-(\d{6,})\.mcap")


class EpisodeFile:
    """An episode's file while it is written: first the model, then states and marks in the order of time, last the metadata."""

    def __init__(self, path: Path, model: Model) -> None:
        """Creates the file. Raises `RecordingFault` if it exists or the package `mcap` is missing."""
        try:
            from mcap.writer import CompressionType, Writer
        except ImportError as fault:
            raise RecordingFault("the package `mcap` is missing: pip install mcap") from fault
        self.path = path
        self._stream = _created(path)
        self._writer = Writer(self._stream, compression=CompressionType.ZSTD, enable_data_crcs=True)
        self._writer.start(profile="actcheck", library="actcheck")
        self._layout = protobuf.TransformLayout(moving(model))
        self._channels: dict[str, int] = {}
        self._sequence = 0
        self._json("/model", "actcheck.Model", SCHEMA, 0, model)

    def write(self, states: States) -> None:
        """Writes consecutive states. Every call of an episode has the same quantities."""
        time = states.time.tolist()
        columns: dict[str, Iterable[bytes]] = {"/tf": self._layout.encoded(states.time, states.poses)}
        if states.velocities is not None:
            columns["/velocities"] = protobuf.packed([states.velocities[..., :3], states.velocities[..., 3:]])
        joints = [states.joint_positions, states.joint_velocities, states.joint_efforts]
        if any(values is not None for values in joints):
            columns["/joints"] = protobuf.packed(joints)
        if states.controls is not None:
            columns["/controls"] = protobuf.packed([states.controls])
        if states.contacts is not None:
            columns["/contacts"] = protobuf.contacts(states.contacts)
        if states.outcomes is not None:
            columns["/outcome"] = protobuf.outcomes(states.outcomes)
        channels = [self._channel(topic) for topic in columns]
        add = self._writer.add_message
        for at, *messages in zip(time, *columns.values(), strict=True):
            for channel, message in zip(channels, messages, strict=True):
                add(channel, at, message, at, self._sequence)
            self._sequence += 1

    def mark(self, time: int, mark: dict[str, Any]) -> None:
        """Writes the begin or end of an action. Unit of `time`: nanoseconds since the first state."""
        self._json("/marks", "actcheck.Mark", MARK_SCHEMA, time, mark)

    def close(self, metadata: dict[str, str]) -> None:
        """Writes the metadata and completes the file."""
        self._writer.add_metadata(METADATA, {"format": FORMAT} | metadata)
        self._writer.finish()
        self._stream.close()

    def discard(self) -> None:
        """Deletes the file."""
        self._stream.close()
        self.path.unlink(missing_ok=True)

    def _channel(self, topic: str) -> int:
        if topic not in self._channels:
            name, descriptors = protobuf.schema(topic)
            schema = self._writer.register_schema(name, "protobuf", descriptors)
            self._channels[topic] = self._writer.register_channel(topic, "protobuf", schema)
        return self._channels[topic]

    def _json(self, topic: str, name: str, schema: dict[str, Any], time: int, content: Any) -> None:
        message = _encode(content).encode()
        if topic not in self._channels:
            registered = self._writer.register_schema(name, "jsonschema", _encode(schema).encode())
            self._channels[topic] = self._writer.register_channel(topic, "json", registered)
        self._writer.add_message(self._channels[topic], time, message, time, self._sequence)


def _created(path: Path) -> IO[bytes]:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        return path.open("xb")
    except FileExistsError as fault:
        raise RecordingFault(f"{path} exists: choose another name or folder; episodes are never overwritten") from fault
    except OSError as fault:
        raise RecordingFault(f"can't create {path}: {fault.strerror or fault}") from fault


def numbered(folder: Path, name: str) -> Path:
    """The next unused path `NAME-000001.mcap`, `NAME-000002.mcap`, … in a folder."""
    taken = [0]
    if folder.is_dir():
        prefix = len(name)
        taken += [int(found[1]) for path in folder.iterdir() if (found := _match(path.name, name, prefix))]
    return folder / f"{name}-{max(taken) + 1:06}.mcap"


def _match(file: str, name: str, prefix: int) -> re.Match[str] | None:
    return _NUMBER.fullmatch(file[prefix:]) if file.startswith(name) else None


def slug(name: str) -> str:
    """A file name without separators, from a name of an environment or a task."""
    return re.sub(r"[^A-Za-z0-9._-]+", "_", name).strip("._-") or "episode"
