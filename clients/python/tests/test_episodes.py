"""Conversion of other programs' episodes: which are read, and which are refused."""

from __future__ import annotations

import contextlib
import io
import json
import os
import tempfile
import unittest
from pathlib import Path
from typing import Any

import numpy as np

from actcheck.episodes.command import main
from tests.test_recording import CUBE, content, needs

Lines = list[dict[str, Any]]


class Converting(unittest.TestCase):
    def setUp(self) -> None:
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = Path(temporary.name)

    def convert(self, *arguments: str | Path) -> Lines:
        """Runs the command and returns its lines."""
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            main(["convert", *map(str, arguments), "--to", str(self.folder / "out")])
        return [json.loads(line) for line in printed.getvalue().splitlines()]

    def fault(self, *arguments: str | Path) -> str:
        """The code of the only line; nothing is left of the episode."""
        (line,) = self.convert(*arguments)
        self.assertTrue(line["reason"])
        self.assertEqual(list((self.folder / "out").glob("*")), [])
        return str(line["fault"])

    def converted(self, *arguments: str | Path) -> tuple[dict[str, str], dict[str, list[tuple[int, Any]]]]:
        """The content of the only converted episode."""
        (line,) = self.convert(*arguments)
        self.assertNotIn("fault", line, line)
        return content(Path(line["written"]))


class Unknown(Converting):
    def test_an_absent_file(self) -> None:
        self.assertEqual(self.fault(self.folder / "nowhere.hdf5"), "not-found")

    def test_a_foreign_file(self) -> None:
        path = self.folder / "notes.hdf5"
        path.write_text("not an episode")
        self.assertEqual(self.fault(path), "unknown-format")


@needs("h5py", "mujoco", "mcap", "google.protobuf")
class Robosuite(Converting):
    def written(self, text: str = CUBE, **changes: Any) -> Path:
        """A file with one demonstration of a cube that slides to rest."""
        import h5py
        import mujoco

        model = mujoco.MjModel.from_xml_string(CUBE)
        data = mujoco.MjData(model)
        data.qvel[0] = 0.5
        states = []
        for _ in range(30):
            mujoco.mj_step(model, data, 5)
            states.append(np.concatenate([[data.time], data.qpos, data.qvel]))
        path = self.folder / "cube.hdf5"
        with h5py.File(path, "w") as file:
            group = file.create_group("data/demo_1")
            group.attrs["model_file"] = text
            group["states"] = changes.get("states", np.array(states))
            file["data"].attrs.update({"env": "Cube", "repository_version": "1.4.0"})
        return path

    def test_poses_velocities_and_forces_are_those_of_the_recorder(self) -> None:
        import h5py
        import mujoco

        import actcheck

        path = self.written()
        _, messages = self.converted(path)
        with h5py.File(path) as file:
            states = file["data/demo_1/states"][:]
        model = mujoco.MjModel.from_xml_string(CUBE)
        data = mujoco.MjData(model)
        with actcheck.record(model, data, self.folder / "live.mcap") as recorder:
            for row in states:
                data.time, data.qpos[:], data.qvel[:] = row[0], row[1 : 1 + model.nq], row[1 + model.nq :]
                recorder.step()
        _, live = content(self.folder / "live.mcap")
        for (time, ours), (other_time, theirs) in zip(messages["/tf"], live["/tf"], strict=True):
            self.assertEqual(time, other_time)
            for one, other in zip(ours.transforms, theirs.transforms, strict=True):
                for part, axes in (("translation", "xyz"), ("rotation", "xyzw")):
                    first, second = ([getattr(getattr(each, part), axis) for axis in axes] for each in (one, other))
                    np.testing.assert_allclose(first, second, rtol=0, atol=1e-9)
        for (_, ours), (_, theirs) in zip(messages["/contacts"], live["/contacts"], strict=True):
            self.assertEqual(list(ours.second), list(theirs.second))
            np.testing.assert_allclose(ours.normal_force, theirs.normal_force, rtol=0.01, atol=1e-6)

    def test_the_metadata_says_what_is_known(self) -> None:
        metadata, messages = self.converted(self.written())
        self.assertEqual((metadata["environment"], metadata["source_episode"]), ("robosuite/Cube", "demo_1"))
        self.assertIn("controls", metadata["lacks"])
        self.assertIn("without the controls", metadata["note.forces"])
        self.assertIn("does not say which MuJoCo", metadata["note.version"])
        self.assertNotIn("/outcome", messages)

    def test_states_of_another_model(self) -> None:
        self.assertEqual(self.fault(self.written(states=np.zeros((5, 9)))), "state-length")

    def test_a_state_that_is_not_finite(self) -> None:
        states = np.zeros((600, 1 + 8 + 7))
        states[:, 0], states[:, 4] = np.arange(600), 1.0
        states[500, 3] = np.nan
        self.assertEqual(self.fault(self.written(states=states)), "not-finite")

    def test_an_external_link(self) -> None:
        import h5py

        path = self.written()
        with h5py.File(path, "r+") as file:
            del file["data/demo_1/states"]
            file["data/demo_1/states"] = h5py.ExternalLink("/etc/passwd", "/states")
        self.assertEqual(self.fault(path), "unsafe-link")

    def test_a_soft_link_and_data_outside_the_file(self) -> None:
        import h5py

        path = self.written()
        with h5py.File(path, "r+") as file:
            del file["data/demo_1/states"]
            file["data/demo_1"].create_dataset("states", (4, 16), "f8", external=[(str(self.folder / "raw"), 0, 512)])
        self.assertEqual(self.fault(path), "unsafe-link")
        with h5py.File(path, "r+") as file:
            del file["data/demo_1/states"]
            file["data/demo_1/states"] = h5py.SoftLink("/data/elsewhere")
        self.assertEqual(self.fault(path), "unsafe-link")

    def test_a_small_file_that_claims_a_billion_states(self) -> None:
        import h5py

        path = self.written()
        for shape, chunks in (((1_000_000_000, 16), (1024, 16)), ((4, 1_000_000), (1, 1024)), ((1_000_000, 2048), (1_000_000, 64))):
            with h5py.File(path, "r+") as file:
                del file["data/demo_1/states"]
                file["data/demo_1"].create_dataset("states", shape, "f8", chunks=chunks, compression="gzip")
            self.assertEqual(self.fault(path), "too-large")

    def with_mesh(self, file: str | Path, attributes: str = "") -> Path:
        """A file whose cube has a mesh besides its box."""
        mass = '<inertial pos="0 0 0" mass="1" diaginertia=".01 .01 .01"/>'
        geom = f'<freejoint/>{mass}<geom type="mesh" mesh="m" {attributes}/>'
        text = CUBE.replace("<worldbody>", f'<asset><mesh name="m" file="{file}"/></asset><worldbody>')
        return self.written(text.replace("<freejoint/>", geom))

    def test_a_path_of_the_authors_machine_is_not_opened(self) -> None:
        mesh = self.folder / "mesh.stl"
        mesh.write_bytes(b"solid")
        self.assertEqual(self.fault(self.with_mesh(mesh)), "asset-missing")

    def test_a_path_does_not_leave_a_package(self) -> None:
        path = self.with_mesh("/x/robosuite/../../../../../../../../etc/hosts")
        self.assertIn(self.fault(path), ("asset-missing", "missing-package"))

    def test_a_missing_mesh_that_is_only_seen_is_left_out(self) -> None:
        _, messages = self.converted(self.with_mesh("/x/gone.stl", 'contype="0" conaffinity="0"'))
        self.assertEqual([shape["kind"] for shape in messages["/model"][0][1]["bodies"][1]["shapes"]], ["box"])

    def test_a_model_that_reads_other_files(self) -> None:
        for text in (
            CUBE.replace("<worldbody>", '<include file="/etc/passwd"/><worldbody>'),
            CUBE.replace("<worldbody>", '<extension><plugin plugin="x"/></extension><worldbody>'),
            '<!DOCTYPE a [<!ENTITY b SYSTEM "/etc/passwd">]>' + CUBE,
        ):
            self.assertEqual(self.fault(self.written(text)), "unsafe-model")

    def test_a_model_that_is_missing_or_wrong(self) -> None:
        self.assertEqual(self.fault(self.written("model_1.xml")), "model-missing")
        self.assertEqual(self.fault(self.written("<mujoco><nonsense/></mujoco>")), "model-invalid")
        self.assertEqual(self.fault(self.written("<mujoco>")), "model-invalid")

    def test_a_truncated_file(self) -> None:
        path = self.written()
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
        self.assertIn(self.fault(path), ("damaged", "unknown-format"))

    def test_nothing_is_overwritten(self) -> None:
        path = self.written()
        self.converted(path)
        (line,) = self.convert(path)
        self.assertEqual(line["fault"], "exists")


@needs("h5py", "mcap", "google.protobuf")
class IsaacLab(Converting):
    def written(self, rotation: list[float], **attributes: Any) -> Path:
        """A file with a robot of two joints and a cube that rises."""
        import h5py

        path = self.folder / "isaac.hdf5"
        with h5py.File(path, "w") as file:
            demonstration = file.create_group("data/demo_0")
            file["data"].attrs["env_args"] = json.dumps({"env_name": "Isaac-Lift", "sim_args": {"dt": 0.01, "decimation": 2}})
            file["data"].attrs.update(attributes)
            demonstration.attrs.update({"success": True, "seed": 7})
            for place, count in (("initial_state", 1), ("states", 4)):
                for family, name in (("articulation", "robot"), ("rigid_object", "cube")):
                    group = demonstration.create_group(f"{place}/{family}/{name}")
                    pose = np.tile([0.5, 0.0, 0.1, *rotation], (count, 1))
                    pose[:, 2] += np.arange(count) * 0.01
                    group["root_pose"], group["root_velocity"] = pose, np.zeros((count, 6))
                    if name == "robot":
                        group["joint_position"] = group["joint_velocity"] = np.ones((count, 2))
        return path

    def test_old_and_new_order_of_quaternions(self) -> None:
        for rotation in ([np.cos(0.3), 0.0, 0.0, np.sin(0.3)], [0.0, 0.0, np.sin(0.3), np.cos(0.3)]):
            for file in (self.folder / "out").glob("*"):
                file.unlink()
            metadata, messages = self.converted(self.written(rotation))
            turned = messages["/tf"][0][1].transforms[1].rotation
            np.testing.assert_allclose([turned.x, turned.y, turned.z, turned.w], [0, 0, np.sin(0.3), np.cos(0.3)])
            self.assertIn("begin upright", metadata["note.quaternions"])

    def test_an_undecided_order_is_refused_unless_given(self) -> None:
        path = self.written([0.5, 0.5, 0.5, 0.5])
        self.assertEqual(self.fault(path), "quaternions-unknown")
        metadata, _ = self.converted(path, "--quaternions", "xyzw")
        self.assertTrue(metadata["note.quaternions"].startswith("xyzw"))

    def test_an_attribute_decides(self) -> None:
        metadata, _ = self.converted(self.written([0.5, 0.5, 0.5, 0.5], quat_convention="xyzw"))
        self.assertIn("quat_convention", metadata["note.quaternions"])

    def test_times_joints_and_success(self) -> None:
        metadata, messages = self.converted(self.written([1.0, 0.0, 0.0, 0.0]))
        self.assertEqual([time for time, _ in messages["/joints"]], [20_000_000 * at for at in range(5)])
        self.assertEqual(list(messages["/joints"][0][1].position), [1.0, 1.0])
        outcomes = [outcome for _, outcome in messages["/outcome"]]
        self.assertEqual([outcome.HasField("success") for outcome in outcomes], [False] * 4 + [True])
        self.assertEqual((metadata["environment"], metadata["seed"]), ("isaaclab/Isaac-Lift", "7"))
        self.assertIn("shapes", metadata["lacks"].split(","))


@needs("pyarrow", "mcap", "google.protobuf")
class LeRobot(Converting):
    def written(self, version: str = "v3.0") -> Path:
        """A dataset with two episodes of three states."""
        import pyarrow
        import pyarrow.parquet

        root = self.folder / "dataset"
        (root / "meta").mkdir(parents=True)
        (root / "data/chunk-000").mkdir(parents=True)
        names = {"motors": ["shoulder", "elbow"]}
        features = {"observation.state": {"dtype": "float32", "shape": [2], "names": names}}
        (root / "meta/info.json").write_text(
            json.dumps({"codebase_version": version, "fps": 10, "robot_type": "so100", "features": features})
        )
        pyarrow.parquet.write_table(pyarrow.table({"task_index": [0], "task": ["pick it up"]}), root / "meta/tasks.parquet")
        rows = {
            "episode_index": [0, 0, 0, 1, 1, 1],
            "timestamp": [0.0, 0.1, 0.2] * 2,
            "task_index": [0] * 6,
            "observation.state": [[at, -at] for at in range(6)],
            "action": [[0.5, 0.25]] * 6,
            "next.reward": [0.0, 0.0, 1.0] * 2,
            "next.success": [False, False, True] * 2,
        }
        pyarrow.parquet.write_table(pyarrow.table(rows), root / "data/chunk-000/file-000.parquet")
        return root

    def test_episodes_are_separated(self) -> None:
        lines = self.convert(self.written())
        self.assertEqual([line["episode"] for line in lines], ["episode_000000", "episode_000001"])
        metadata, messages = content(Path(lines[1]["written"]))
        self.assertEqual([list(joints.position) for _, joints in messages["/joints"]], [[3, -3], [4, -4], [5, -5]])
        self.assertEqual([joint["name"] for joint in messages["/model"][0][1]["joints"]], ["shoulder", "elbow"])
        self.assertEqual((metadata["task"], [time for time, _ in messages["/tf"]]), ("pick it up", [0, 100_000_000, 200_000_000]))
        self.assertTrue(messages["/outcome"][-1][1].success)
        self.assertLessEqual({"contacts", "shapes", "robot"}, set(metadata["lacks"].split(",")))

    def test_an_older_version(self) -> None:
        self.assertEqual(self.fault(self.written("v2.1")), "unknown-format")

    def test_the_number_of_episodes_is_limited(self) -> None:
        self.assertEqual(len(self.convert(self.written(), "--limit", "1")), 1)


@needs("rosbags", "mcap", "google.protobuf")
class Rosbag(Converting):
    def written(self, storage: str) -> Path:
        """A bag: a robot that moves in `odom`, a camera fixed on it, a shelf fixed in `map`, and one joint."""
        from rosbags.rosbag2 import StoragePlugin, Writer
        from rosbags.typesys import Stores, get_typestore

        store = get_typestore(Stores.ROS2_JAZZY)
        types = store.types
        root = self.folder / f"bag_{storage}"

        def transform(parent: str, child: str, x: float, yaw: float = 0.0) -> Any:
            header = types["std_msgs/msg/Header"](stamp=types["builtin_interfaces/msg/Time"](sec=0, nanosec=0), frame_id=parent)
            moved = types["geometry_msgs/msg/Vector3"](x=x, y=0.0, z=0.0)
            turned = types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=float(np.sin(yaw / 2)), w=float(np.cos(yaw / 2)))
            made = types["geometry_msgs/msg/Transform"](translation=moved, rotation=turned)
            return types["geometry_msgs/msg/TransformStamped"](header=header, child_frame_id=child, transform=made)

        with Writer(root, version=9, storage_plugin=StoragePlugin[storage]) as writer:
            tf, static = (writer.add_connection(topic, "tf2_msgs/msg/TFMessage", typestore=store) for topic in ("/tf", "/tf_static"))
            joints = writer.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=store)
            message = types["tf2_msgs/msg/TFMessage"]
            fixed = [transform("map", "odom", 1.0, np.pi / 2), transform("base", "camera", 0.5), transform("map", "shelf", 3.0)]
            writer.write(static, 0, store.serialize_cdr(message(transforms=fixed), message.__msgtype__))
            for at in range(5):
                time = 1_000_000_000 + at * 100_000_000
                moved = message(transforms=[transform("odom", "base", 0.1 * at)])
                writer.write(tf, time, store.serialize_cdr(moved, message.__msgtype__))
                state = types["sensor_msgs/msg/JointState"](
                    header=fixed[0].header, name=["arm"], position=np.array([at / 10]), velocity=np.zeros(0), effort=np.array([2.0])
                )
                writer.write(joints, time, store.serialize_cdr(state, state.__msgtype__))
        return root

    def test_transforms_are_resolved_to_the_root(self) -> None:
        for storage in ("MCAP", "SQLITE3"):
            metadata, messages = self.converted(self.written(storage))
            model = messages["/model"][0][1]
            shelf = next(body for body in model["bodies"] if body["name"] == "shelf")
            self.assertEqual((shelf["moves"], shelf["position"]), (False, [3.0, 0.0, 0.0]))
            last = {each.child_frame_id: each for each in messages["/tf"][-1][1].transforms}
            self.assertEqual(set(last), {"base", "camera"})
            camera = last["camera"]
            np.testing.assert_allclose([camera.translation.x, camera.translation.y], [1.0, 0.9], atol=1e-12)
            self.assertAlmostEqual(camera.rotation.z, np.sin(np.pi / 4))
            self.assertEqual([time for time, _ in messages["/joints"]][-1], 400_000_000)
            self.assertEqual((list(messages["/joints"][-1][1].position), list(messages["/joints"][-1][1].velocity)), ([0.4], []))
            self.assertLessEqual({"contacts", "velocities", "joint_velocities"}, set(metadata["lacks"].split(",")))

    def test_a_damaged_bag(self) -> None:
        root = self.written("MCAP")
        bag = next(root.glob("*.mcap"))
        os.truncate(bag, bag.stat().st_size // 2)
        self.assertEqual(self.fault(root), "damaged")


if __name__ == "__main__":
    unittest.main()
