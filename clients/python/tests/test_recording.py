"""Episode files: their messages, the recorder on plain MuJoCo and in environments."""

from __future__ import annotations

import importlib.util
import json
import re
import subprocess
import sys
import tempfile
import unittest
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

import actcheck
from actcheck.recording import protobuf
from actcheck.recording.file import numbered, slug
from actcheck.recording.model import SCHEMA
from actcheck.recording.states import Contacts
from tests import made_episodes

_Test = TypeVar("_Test", bound=Callable[..., Any])

CLIENTS = Path(__file__).parents[2]
CUBE = """<mujoco model="cube"><compiler angle="radian"/><worldbody><geom name="floor" type="plane" size="1 1 .1"/>
<body name="cube" pos="0 0 .05"><freejoint/><geom type="box" size=".05 .05 .05" mass="1"/></body>
<body name="arm" pos="1 0 1"><joint name="swing" type="hinge" axis="0 1 0" range="-1 1" limited="true"/>
<geom type="capsule" size=".02 .2" mass="1"/></body></worldbody>
<actuator><motor name="motor" joint="swing" ctrlrange="-2 2" ctrllimited="true"/></actuator></mujoco>"""


def installed(*packages: str) -> bool:
    """Whether all packages can be imported."""
    return all(importlib.util.find_spec(package.partition(".")[0]) is not None for package in packages)


def needs(*packages: str) -> Callable[[_Test], _Test]:
    """Leaves a test out if a package is missing."""
    return unittest.skipUnless(installed(*packages), f"needs {' and '.join(packages)}")


def content(path: Path) -> tuple[dict[str, str], dict[str, list[tuple[int, Any]]]]:
    """Metadata and messages of a file, by topic, decoded with the packages mcap and protobuf."""
    from google.protobuf import descriptor_pb2, message_factory
    from mcap.reader import make_reader

    types: dict[str, Any] = {}
    messages: dict[str, list[tuple[int, Any]]] = {}
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            if schema.encoding == "jsonschema":
                decoded = json.loads(message.data)
            else:
                if schema.name not in types:
                    files = descriptor_pb2.FileDescriptorSet.FromString(schema.data).file
                    types[schema.name] = message_factory.GetMessages(list(files))[schema.name]
                decoded = types[schema.name].FromString(message.data)
            messages.setdefault(channel.topic, []).append((message.log_time, decoded))
    return metadata["actcheck.episode"], messages


class Messages(unittest.TestCase):
    def test_published_definitions_are_those_of_the_code(self) -> None:
        self.assertEqual(json.loads((CLIENTS / "episode_model.schema.json").read_text()), SCHEMA)
        text = (CLIENTS / "episode.proto").read_text()
        kinds = {1: "double", 8: "bool", 13: "uint32"}
        for types in protobuf.TYPES.values():
            if types[-1].package != "actcheck":
                continue
            published = re.search(rf"message {types[-1].name} \{{(.*?)\n\}}", text, re.DOTALL)
            assert published is not None
            for field in types[-1].fields:
                label = "repeated " if field.repeated else "optional " if field.optional else ""
                self.assertIn(f"  {label}{kinds[field.kind]} {field.name} = {field.number};", published[1])
            self.assertEqual(len(re.findall(r" = \d+;", published[1])), len(types[-1].fields))

    def test_a_message_without_contacts_is_empty(self) -> None:
        none, empty = np.zeros(0), np.zeros(0, np.int64)
        recorded = Contacts(np.zeros(3, np.int64), empty, empty, none, np.zeros((0, 3)), np.zeros((0, 3)), none)
        self.assertEqual(list(protobuf.contacts(recorded)), [b""] * 3)

    @needs("google.protobuf")
    def test_indices_above_127_are_decoded(self) -> None:
        from google.protobuf import descriptor_pb2, message_factory

        values = np.arange(6.0).reshape(2, 3)
        recorded = Contacts(np.array([2]), np.array([1, 300]), np.array([128, 2]), np.ones(2), values, values, np.zeros(2))
        name, descriptors = protobuf.schema("/contacts")
        decoded = message_factory.GetMessages(list(descriptor_pb2.FileDescriptorSet.FromString(descriptors).file))[name].FromString(
            next(protobuf.contacts(recorded))
        )
        self.assertEqual([list(decoded.first), list(decoded.second)], [[1, 300], [128, 2]])
        self.assertEqual(list(decoded.force), values.ravel().tolist())

    def test_the_package_imports_neither_mujoco_nor_mcap(self) -> None:
        program = "import sys, actcheck; print([name for name in ('mujoco', 'mcap', 'h5py') if name in sys.modules])"
        printed = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
        self.assertEqual(printed.strip(), "[]")

    def test_names_of_files(self) -> None:
        self.assertEqual(slug("put the/../bowl"), "put_the_.._bowl")
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / "Lift-000007.mcap").touch()
            (Path(folder) / "Lift-x.mcap").touch()
            self.assertEqual(numbered(Path(folder), "Lift").name, "Lift-000008.mcap")


@needs("mcap", "google.protobuf")
class Made(unittest.TestCase):
    def test_an_episode_is_decoded_by_the_public_packages(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            paths = list(made_episodes.make(Path(folder), 4))
            self.assertEqual([path.name.partition("-")[0] for path in paths], list(made_episodes.KINDS))
            metadata, messages = content(paths[0])
        self.assertEqual((metadata["format"], metadata["note.kind"]), ("1", "good"))
        self.assertEqual(next(iter(messages)), "/model")
        self.assertEqual({len(values) for topic, values in messages.items() if topic not in ("/model", "/marks")}, {20})

    def test_the_poses_have_their_times(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            path = next(made_episodes.make(Path(folder), 1))
            _, messages = content(path)
        time, last = messages["/tf"][-1]
        self.assertEqual(time, 1_900_000_000)
        stamp = last.transforms[-1].timestamp
        self.assertEqual((stamp.seconds, stamp.nanos), (1, 900_000_000))
        cube = last.transforms[-1]
        self.assertEqual((cube.parent_frame_id, cube.child_frame_id, cube.rotation.w), ("world", "cube", 1.0))
        self.assertAlmostEqual(cube.translation.z, made_episodes.TABLE_HEIGHT + made_episodes.CUBE / 2 + made_episodes.RAISED)
        self.assertTrue(messages["/outcome"][-1][1].success)

    def test_contacts_carry_the_cube(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            _, messages = content(next(made_episodes.make(Path(folder), 1)))
        for _, contacts in (messages["/contacts"][0], messages["/contacts"][-1]):
            force = np.array(contacts.force).reshape(-1, 3).sum(0)
            np.testing.assert_allclose(force, [0, 0, made_episodes.CUBE_MASS * made_episodes.GRAVITY], atol=1e-12)


class FakeEnvironment:
    """An environment on plain MuJoCo, as robosuite's: four values a step and a success function."""

    def __init__(self) -> None:
        import mujoco

        self.model = mujoco.MjModel.from_xml_string(CUBE)
        self.data = mujoco.MjData(self.model)
        self.checks = 0

    def reset(self, seed: int | None = None) -> None:
        import mujoco

        mujoco.mj_resetData(self.model, self.data)

    def step(self, action: float) -> Any:
        import mujoco

        self.data.ctrl[:] = action
        for _ in range(10):
            mujoco.mj_step(self.model, self.data)
        return None, 0.5, False, {"checked": self._check_success()}

    def _check_success(self) -> bool:
        self.checks += 1
        return bool(self.data.qpos[-1] > 0.01)


@needs("mujoco", "mcap", "google.protobuf")
class Recording(unittest.TestCase):
    def setUp(self) -> None:
        self._temporary = tempfile.TemporaryDirectory()
        self.addCleanup(self._temporary.cleanup)
        self.folder = Path(self._temporary.name)

    def test_each_reset_begins_a_file(self) -> None:
        environment = FakeEnvironment()
        with actcheck.record(environment, self.folder, name="Cube") as recorder:
            for seed in (3, 4):
                environment.reset(seed=seed)
                for _ in range(5):
                    environment.step(1.0)
        self.assertEqual([path.name for path in recorder.files], ["Cube-000001.mcap", "Cube-000002.mcap"])
        metadata, messages = content(recorder.files[1])
        self.assertEqual((metadata["seed"], metadata["engine"], metadata["lacks"]), ("4", "MuJoCo", ""))
        self.assertEqual([time for time, _ in messages["/tf"]], [20_000_000 * at for at in range(6)])
        self.assertEqual([outcome.reward for _, outcome in messages["/outcome"]], [0.0] + [0.5] * 5)

    def test_the_environment_gets_its_methods_back(self) -> None:
        environment = FakeEnvironment()
        with self.assertRaises(KeyError), actcheck.record(environment, self.folder):
            environment.reset()
            environment.step(0.0)
            raise KeyError
        self.assertFalse({"step", "reset", "_check_success"} & set(vars(environment)))
        self.assertEqual(len(list(self.folder.iterdir())), 1)

    def test_recording_does_not_change_the_simulation(self) -> None:
        plain, recorded = FakeEnvironment(), FakeEnvironment()
        with actcheck.record(recorded, self.folder):
            for environment in (plain, recorded):
                environment.reset()
                for at in range(50):
                    environment.step(float(np.sin(at)))
        np.testing.assert_array_equal(plain.data.qpos, recorded.data.qpos)
        np.testing.assert_array_equal(plain.data.xpos, recorded.data.xpos)
        # One call more: for the state before the first step.
        self.assertEqual(recorded.checks, plain.checks + 1)

    def test_contacts_and_velocities_are_those_of_physics(self) -> None:
        environment = FakeEnvironment()
        with actcheck.record(environment, self.folder) as recorder:
            environment.reset()
            for _ in range(200):
                environment.step(0.0)
            environment.data.qvel[:6] = [0.3, 0.0, 0.0, 0.0, 0.0, 2.0]
            recorder.step()
        _, messages = content(recorder.files[0])
        resting, thrown = messages["/contacts"][-2][1], messages["/velocities"][-1][1]
        np.testing.assert_allclose(np.array(resting.force).reshape(-1, 3).sum(0), [0, 0, 9.81], atol=1e-3)
        self.assertEqual((set(resting.first), set(resting.second)), ({0}, {1}))
        np.testing.assert_allclose(thrown.linear[:3], [0.3, 0, 0], atol=1e-9)
        np.testing.assert_allclose(thrown.angular[:3], [0, 0, 2], atol=1e-9)
        self.assertEqual(messages["/tf"][-1][0], messages["/tf"][-2][0] + 1)

    def test_marks_of_plain_mujoco(self) -> None:
        environment = FakeEnvironment()
        with actcheck.record(environment.model, environment.data, self.folder / "one.mcap") as recorder:
            recorder.mark("Pick", "begin", pickObject="cube")
            environment.step(0.0)
            recorder.step(success=True)
            recorder.mark("Pick", "end", reported=False, message="lost it")
        metadata, messages = content(self.folder / "one.mcap")
        begin, end = messages["/marks"]
        self.assertEqual((begin[0], begin[1]["parameters"]), (0, {"pickObject": "cube"}))
        self.assertEqual((end[0], end[1]["reported"], end[1]["message"]), (20_000_000, False, "lost it"))
        self.assertEqual((metadata["environment"], metadata["lacks"]), ("mujoco/cube", "reward"))
        model = messages["/model"][0][1]
        self.assertEqual([body["name"] for body in model["bodies"]], ["world", "cube", "arm"])
        self.assertEqual(model["bodies"][1]["shapes"][0]["size"], [0.1, 0.1, 0.1])
        self.assertEqual((model["joints"][1]["limits"], model["joints"][1]["max_effort"]), ([-1.0, 1.0], 2.0))

    def test_a_file_is_never_overwritten(self) -> None:
        environment = FakeEnvironment()
        (self.folder / "one.mcap").touch()
        recorder = actcheck.record(environment.model, environment.data, self.folder / "one.mcap")
        with self.assertRaisesRegex(actcheck.RecordingFault, "never overwritten"):
            recorder.step()

    def test_an_environment_without_mujoco_is_refused(self) -> None:
        with self.assertRaisesRegex(actcheck.RecordingFault, r"sim\.model\._model"):
            actcheck.record(object(), self.folder)


if __name__ == "__main__":
    unittest.main()
