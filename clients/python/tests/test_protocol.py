"""The client says all that the protocol can: every field of every message of `protocol.schema.json`."""

from __future__ import annotations

import dataclasses
import itertools
import json
import unittest
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from actcheck import Held, Plane, Pose, Report, Thing
from actcheck.messages import DepthImage, Observation, RgbImage, RobotDescription, things_from_wire
from actcheck.session import Session
from actcheck.wire import Message

from .fake import ARM, Simulation, one_action, robot_of

SCHEMA = json.loads((Path(__file__).parents[2] / "protocol.schema.json").read_text())
#: Fields that the client needs to read a message, but that say nothing to a skill.
OF_THE_LINK = {"type", "protocol", "what", "binary", "reason"}


def message_schema(side: str, kind: str, question: str | None = None) -> Any:
    """The schema of a message. `question` is the subject of an answer."""
    for message in SCHEMA["$defs"][side]["oneOf"]:
        properties = message["properties"]
        if properties["type"]["const"] != kind:
            continue
        if question is None or properties["what"].get("const") == question:
            return message
    raise LookupError(f"the schema has no message {side} {kind} {question}")


def resolved(schema: Any) -> Any:
    """A schema without references, and without null as an alternative."""
    if "$ref" in schema:
        return SCHEMA["$defs"][schema["$ref"].rsplit("/")[-1]]
    if "oneOf" in schema:
        return next(one for one in schema["oneOf"] if one.get("type") != "null")
    return schema


class Samples:
    """Messages with all of their fields, each value different from the others."""

    def __init__(self) -> None:
        self.numbers = itertools.count(1001)

    def of(self, schema: Any) -> Any:
        schema = resolved(schema)
        if "const" in schema:
            return schema["const"]
        if "enum" in schema:
            return schema["enum"][-1]
        kind = schema["type"][0] if isinstance(schema["type"], list) else schema["type"]
        if kind == "object":
            if set(schema.get("properties", {})) == {"position_m", "quaternion_xyzw"}:
                return {"position_m": [float(next(self.numbers)) for _ in range(3)], "quaternion_xyzw": [0.5, -0.5, 0.5, 0.5]}
            named = {name: self.of(part) for name, part in schema.get("properties", {}).items()}
            further = schema.get("additionalProperties")
            return named | ({f"key{next(self.numbers)}": self.of(further)} if isinstance(further, dict) else {})
        if kind == "array":
            return [self.of(schema["items"]) for _ in range(schema.get("minItems", 2))]
        if kind == "boolean":
            return True
        number = next(self.numbers)
        return {"number": float(number), "integer": number, "string": f"text{number}"}[kind]


def fields(message: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """The values of a message with their paths, without those of the link."""
    if isinstance(message, dict):
        for name, value in message.items():
            if name not in OF_THE_LINK:
                yield from fields(value, f"{path}.{name}")
    elif isinstance(message, list):
        for number, value in enumerate(message):
            yield from fields(value, f"{path}[{number}]")
    else:
        yield path, message


def known(record: Any) -> Iterator[Any]:
    """The values that a record of the client has."""
    if isinstance(record, Pose):
        yield from (*record.position.tolist(), *record.quaternion())
    elif dataclasses.is_dataclass(record):
        for field in dataclasses.fields(record):
            yield from known(getattr(record, field.name))
    elif isinstance(record, np.ndarray):
        yield from record.ravel().tolist()
    elif isinstance(record, dict):
        for value in record.values():
            yield from known(value)
    elif isinstance(record, (tuple, list)):
        for value in record:
            yield from known(value)
    else:
        yield record


def missing(message: Message, record: Any) -> list[str]:
    """The fields of a message whose values a record lacks."""
    values = list(known(record))

    def has(value: Any) -> bool:
        if isinstance(value, float):
            return any(isinstance(one, float) and abs(one - value) < 1e-9 for one in values)
        return value in values

    return [path for path, value in fields(message) if not has(value)]


class FromTheSimulation(unittest.TestCase):
    def test_every_field_of_the_robot_is_read(self) -> None:
        sent = Samples().of(message_schema("ToProgram", "hello"))
        self.assertEqual(missing(sent, RobotDescription.from_wire(sent)), [])

    def test_every_field_of_an_observation_is_read(self) -> None:
        sent = Samples().of(message_schema("ToProgram", "observation"))
        self.assertEqual(missing(sent, Observation.from_wire(sent)), [])

    def test_every_field_of_an_action_is_read(self) -> None:
        samples = Samples()
        reset, begin = (samples.of(message_schema("ToProgram", kind)) for kind in ("reset", "begin"))

        def script(simulation: Simulation) -> None:
            simulation.greet()
            simulation.send(reset)
            simulation.receive("ready")
            simulation.send(begin)
            simulation.receive("end")
            simulation.bye()

        simulation = Simulation(script)
        session = Session(simulation.wire, "test", ["Pick"])
        call = session.next_call()
        assert call is not None
        self.assertEqual(missing(reset, call), [])
        self.assertEqual(missing(begin, call), [])
        session.end(Report(True))
        self.assertIsNone(session.next_call())
        simulation.join()

    def test_every_field_of_the_sensors_is_read(self) -> None:
        samples = Samples()
        seen = samples.of(message_schema("ToProgram", "answer", "objects"))
        self.assertEqual(missing(seen, things_from_wire(seen["objects"])), [])
        picture = samples.of(message_schema("ToProgram", "answer", "depth"))
        picture["arrays"] = {"depth": np.zeros((picture["height"], picture["width"]), np.float32)}
        image = DepthImage.from_wire(picture)
        self.assertEqual((image.width, image.height), (picture.pop("width"), picture.pop("height")))
        picture.pop("arrays")
        self.assertEqual(missing(picture, image), [])
        colour = samples.of(message_schema("ToProgram", "answer", "rgb"))
        colour["arrays"] = {"rgb": np.zeros((colour["height"], colour["width"], 3), np.uint8)}
        seen_colour = RgbImage.from_wire(colour)
        self.assertEqual((seen_colour.width, seen_colour.height), (colour.pop("width"), colour.pop("height")))
        colour.pop("arrays")
        self.assertEqual(missing(colour, seen_colour), [])

    def test_a_field_that_the_client_lacks_is_noticed(self) -> None:
        sent = Samples().of(message_schema("ToProgram", "observation"))
        seen = Observation.from_wire(sent)
        self.assertEqual(missing(sent | {"new": {"field_m": 7.5}}, seen), [".new.field_m"])


def names(schema: Any, path: str = "") -> set[str]:
    """The paths of all fields of a message."""
    schema = resolved(schema)
    own: set[str] = set()
    for name, part in schema.get("properties", {}).items():
        inner = resolved(part)
        inner = resolved(inner["items"]) if inner.get("type") == "array" else inner
        own |= {f"{path}.{name}"} | (names(inner, f"{path}.{name}") if inner.get("properties") else set())
    return own


def used(message: Any, path: str = "") -> set[str]:
    """The paths of all fields that a message has."""
    own: set[str] = set()
    for name, value in message.items():
        inner = value[0] if isinstance(value, list) and value and isinstance(value[0], dict) else value
        by_joint = path == "" and name in ("positions", "velocities", "efforts")
        nested = used(inner, f"{path}.{name}") if isinstance(inner, dict) and not by_joint else set()
        own |= {f"{path}.{name}"} | nested
    return own


class ToTheSimulation(unittest.TestCase):
    def test_a_report_has_every_field(self) -> None:
        thing = Thing("glass", Pose.upright((1.0, 2.0, 0.5), 0.3), np.array([0.08, 0.08, 0.14]), "http://actions#Glass")
        table = Thing("table", Pose.upright((1.0, 2.0, 0.0)), np.array([0.8, 0.6, 0.5]), furniture=True)
        sent = Report(True, "done", [thing], Plane.on_top_of(table), Held.of(thing)).to_wire()
        self.assertEqual(used(sent), names(message_schema("FromProgram", "end")))
        self.assertEqual(sent["plane"]["pose"]["position_m"], [1.0, 2.0, 0.5])
        self.assertEqual(sent["plane"]["size_m"], [0.8, 0.6])
        self.assertEqual(sent["held"]["size_m"], [0.08, 0.08, 0.14])
        self.assertEqual(used(Report(True).to_wire()), {".type", ".succeeded", ".message"})

    def test_a_command_a_question_and_hello_have_every_field(self) -> None:
        simulation = Simulation(one_action)
        session, robot = robot_of(simulation)
        robot.step(
            {ARM[0]: 0.2},
            velocities={ARM[1]: 0.1},
            efforts={ARM[2]: 0.5},
            base_velocity=(0.1, 0.0, 0.0),
            gripper=(0.05, 7.0),
            head=(0.1, 0.2),
            ticks=2,
        )
        robot.step(head=(None, 0.1))
        robot.objects("obj:glass_1")
        session.end(Report(True))
        self.assertIsNone(session.next_call())
        simulation.join()
        for kind in ("hello", "command", "ask"):
            sent = next(one for one in simulation.received if one["type"] == kind)
            self.assertEqual(used(sent), names(message_schema("FromProgram", kind)), kind)
        second = [one for one in simulation.received if one["type"] == "command"][1]
        self.assertEqual(second["head"], {"tilt_rad": 0.1})


if __name__ == "__main__":
    unittest.main()
