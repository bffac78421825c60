"""The first states and the faulty episodes of a suite, and the goal that the recorder states."""

from __future__ import annotations

import contextlib
import io
import json
import tempfile
import unittest
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

import numpy as np

import actcheck
from actcheck.episodes import audit
from actcheck.episodes.command import main
from actcheck.episodes.faulty import FAULTS
from actcheck.episodes.scene import Scene
from actcheck.episodes.suites import Aim, Task
from tests.test_recording import content, installed, needs

#: A table with a cube, a can and a tray, whose site is a region.
SCENE = """<mujoco model="table"><worldbody>
<body name="table" pos="0 0 .4"><geom type="box" size=".5 .5 .4" mass="10"/><site name="table_front_region" pos=".2 0 .4"/></body>
<body name="tray_main" pos=".2 .2 .8"><geom type="box" size=".1 .1 .01" pos="0 0 .01" mass="1"/><site name="tray_region" pos="0 0 .02"/></body>
<body name="cube_main" pos="-.2 0 .83"><freejoint name="cube_joint"/><geom type="box" size=".03 .03 .03" mass=".1"/></body>
<body name="can_main" pos="-.2 .3 .85"><freejoint name="can_joint"/><geom type="cylinder" size=".03 .05" mass=".1"/></body>
</worldbody></mujoco>"""


class Environment:
    """A scene on plain MuJoCo with LIBERO's attributes; success is a cube less than 5 cm from the tray's middle, seen from above."""

    action_dim = 7

    def __init__(self, goals: list[list[str]], start: str = "table_front_region") -> None:
        import mujoco

        self.model = mujoco.MjModel.from_xml_string(SCENE)
        self.data = mujoco.MjData(self.model)
        self.parsed_problem = {"goal_state": goals, "initial_state": [["on", "can", "tray"], ["on", "cube", start]]}
        self.objects_dict = {name: SimpleNamespace(root_body=f"{name}_main") for name in ("cube", "can")}
        self.fixtures_dict = {"tray": SimpleNamespace(root_body="tray_main")}
        self.reset()

    def reset(self) -> None:
        import mujoco

        mujoco.mj_resetData(self.model, self.data)
        mujoco.mj_forward(self.model, self.data)

    def step(self, action: Any) -> Any:
        import mujoco

        mujoco.mj_step(self.model, self.data, 25)
        return None, 0.0, False, {}

    def _check_success(self) -> bool:
        return bool(np.linalg.norm(self.data.body("cube_main").xpos[:2] - [0.2, 0.2]) < 0.05)


def stated(goals: list[list[str]], start: str = "table_front_region") -> dict[str, str]:
    """The recorder's statements about a task."""
    with tempfile.TemporaryDirectory() as folder:
        environment = Environment(goals, start)
        with actcheck.record(environment, Path(folder) / "one.mcap") as recorder:
            environment.step(None)
        metadata, _ = content(recorder.files[0])
    return {key: metadata[key] for key in ("goal_predicate", "goal_object", "goal_target", "start_surface") if key in metadata}


@needs("mujoco", "mcap", "google.protobuf")
class Stated(unittest.TestCase):
    def test_a_goal_on_a_fixture(self) -> None:
        found = {"goal_predicate": "on", "goal_object": "cube_main", "goal_target": "tray_main", "start_surface": "table"}
        self.assertEqual(stated([["on", "cube", "tray"]]), found)

    def test_a_region_is_the_body_that_carries_it(self) -> None:
        self.assertEqual(stated([["in", "cube", "tray_region"]])["goal_target"], "tray_main")
        self.assertEqual(stated([["on", "cube", "table_front_region"]], "tray")["start_surface"], "tray_main")

    def test_an_unknown_start_is_not_stated(self) -> None:
        self.assertNotIn("start_surface", stated([["on", "cube", "tray"]], "nowhere"))

    def test_other_goals_state_nothing(self) -> None:
        two = [["on", "cube", "tray"], ["on", "can", "tray"]]
        for goals in (two, [["open", "tray"]], [["on", "tray", "table_front_region"]], [["on", "cube", "nowhere"]], []):
            with self.subTest(goals):
                self.assertEqual(stated(goals), {})

    def test_metadata_of_the_caller(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            environment = Environment([])
            with actcheck.record(environment, Path(folder)) as recorder:
                recorder.about["goal_object"] = "can_main"
                environment.step(None)
            metadata, _ = content(recorder.files[0])
        self.assertEqual(metadata["goal_object"], "can_main")


@needs("mujoco")
class Scenes(unittest.TestCase):
    def setUp(self) -> None:
        self.scene = Scene(Environment([]))

    def test_an_object_is_let_down_onto_a_place(self) -> None:
        self.scene.let_down("cube_main", np.array([0.2, 0.2, 0.8]), self.scene.rotations()["cube_main"])
        np.testing.assert_allclose(self.scene.position("cube_main"), [0.2, 0.2, 0.85], atol=0.003)
        self.assertEqual(self.scene.touches("cube_main"), set())

    def test_an_object_is_turned_upside_down(self) -> None:
        self.scene.let_down("can_main", np.array([0.2, 0.2, 0.8]), np.array([0.0, 1.0, 0.0, 0.0]), gap=0.1)
        np.testing.assert_allclose(self.scene.position("can_main"), [0.2, 0.2, 0.97], atol=0.003)
        np.testing.assert_allclose(self.scene.data.body("can_main").xmat[8], -1.0, atol=1e-9)

    def test_what_a_body_touches(self) -> None:
        self.scene.move("cube_main", np.array([0.0, 0.0, 0.829]))
        self.assertEqual(self.scene.touches("cube_main"), {"table"})

    def test_the_fastest_body(self) -> None:
        self.assertEqual(self.scene.fastest(), 0.0)
        self.scene.push("can_main", np.array([0.3, 0.0, 0.4]))
        self.assertAlmostEqual(self.scene.fastest(), 0.5)

    def test_other_movable_objects(self) -> None:
        self.assertEqual(self.scene.movable(), ["cube_main", "can_main"])
        self.assertEqual(self.scene.others("cube_main", "tray_main"), ["can_main"])
        self.assertEqual(self.scene.others("cube_main", "can_main"), [])


class FakeTask:
    """A task of two initial states."""

    name = "put the cube on the tray"

    def __init__(self, has_aim: bool = True) -> None:
        self.environment = Environment([["on", "cube", "tray"]])
        self._has_aim = has_aim

    def begin(self, state: int) -> None:
        if state > 1:
            raise IndexError
        self.environment.reset()

    def aim(self) -> Aim | None:
        return Aim("cube_main", "tray_main", np.array([0.2, 0.2, 0.82])) if self._has_aim else None

    def close(self) -> None:
        pass


def run(*arguments: str, has_aim: bool = True) -> tuple[int, list[dict[str, Any]]]:
    """Runs the command with a fake suite. Returns its exit code and its lines."""

    def tasks(suite: str, numbers: list[int] | None) -> Iterator[tuple[int, Task]]:
        yield 3, FakeTask(has_aim)

    printed = io.StringIO()
    with mock.patch.object(audit, "tasks", tasks), contextlib.redirect_stdout(printed):
        code = main(list(arguments))
    return code, [json.loads(line) for line in printed.getvalue().splitlines()]


@needs("mujoco", "mcap", "google.protobuf")
class Commands(unittest.TestCase):
    def setUp(self) -> None:
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = temporary.name

    def test_first_states_are_recorded_at_rest(self) -> None:
        code, lines = run("states", "fake", "--to", self.folder, "--states", "5", "--settle", "4")
        self.assertEqual((code, [line["episode"] for line in lines]), (0, ["3-0", "3-1"]))
        metadata, messages = content(Path(lines[1]["written"]))
        self.assertEqual(metadata["note.state"], "initial state 1, after 4 steps in which the robot did nothing")
        self.assertEqual((len(messages["/tf"]), metadata["goal_object"]), (1, "cube_main"))

    def test_faults_are_recorded_with_their_success(self) -> None:
        code, lines = run("audit", "fake", "--to", self.folder, "--steps", "5")
        self.assertEqual((code, [line["fault"] for line in lines]), (0, list(FAULTS)))
        theirs = {line["fault"]: line["their_success"] for line in lines if "written" in line}
        self.assertEqual(theirs, {fault: fault not in ("idle", "wrong-object") for fault in FAULTS if fault not in ("dropped", "held")})
        left_out = {line["fault"]: line["left_out"] for line in lines if "written" not in line}
        self.assertEqual(left_out, dict.fromkeys(("dropped", "held"), "the robot has no Panda's gripper"))
        metadata, messages = content(Path(lines[1]["written"]))
        self.assertEqual((metadata["fault"], metadata["note.fault"]), ("teleport", FAULTS["teleport"].sentence))
        self.assertEqual([outcome.success for _, outcome in messages["/outcome"]], [False] + [True] * 6)
        self.assertEqual(len(list(Path(self.folder).iterdir())), len(theirs))

    def test_a_thrown_object_is_fast(self) -> None:
        _, (line,) = run("audit", "fake", "--to", self.folder, "--faults", "thrown")
        _, messages = content(Path(line["written"]))
        self.assertAlmostEqual(messages["/velocities"][1][1].linear[2], -4.0)

    def test_tasks_with_other_goals_are_left_out(self) -> None:
        for command in ("states", "audit"):
            code, (line,) = run(command, "fake", "--to", self.folder, has_aim=False)
            self.assertEqual((code, line["left_out"]), (0, "the task's goal isn't one object on or in a place"))

    def test_nothing_is_overwritten(self) -> None:
        run("states", "fake", "--to", self.folder, "--states", "1")
        code, (line,) = run("states", "fake", "--to", self.folder, "--states", "1")
        self.assertEqual((code, line["fault"]), (1, "exists"))


class Arguments(unittest.TestCase):
    def refused(self, *arguments: str) -> str:
        """Returns the message about wrong arguments."""
        printed = io.StringIO()
        with contextlib.redirect_stderr(printed), self.assertRaises(SystemExit):
            main([*arguments, "--to", "out"])
        return printed.getvalue()

    def test_wrong_arguments_are_named(self) -> None:
        self.assertIn("'3-' is neither a number nor a range", self.refused("states", "libero_spatial", "--tasks", "1,3-"))
        self.assertIn("'flood' is not a fault", self.refused("audit", "libero_spatial", "--faults", "idle,flood"))

    @unittest.skipIf(installed("libero") and installed("robosuite"), "LIBERO and robosuite are installed")
    def test_a_missing_package_is_named(self) -> None:
        suites = {"libero_spatial": "libero", "robosuite/Lift": "robosuite"}
        for suite in (suite for suite, package in suites.items() if not installed(package)):
            printed = io.StringIO()
            with contextlib.redirect_stdout(printed):
                self.assertEqual(main(["states", suite, "--to", "out"]), 1)
            self.assertEqual(json.loads(printed.getvalue())["fault"], "missing-package")


@needs("libero", "mujoco", "mcap", "google.protobuf")
class Libero(unittest.TestCase):
    def run_task(self, command: str, *arguments: str) -> tuple[dict[str, Any], dict[str, str]]:
        """Records one episode of a task. Returns its line and metadata."""
        with tempfile.TemporaryDirectory() as folder:
            printed = io.StringIO()
            with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(io.StringIO()):
                main([command, "libero_spatial", "--to", folder, *arguments])
            (line,) = map(json.loads, printed.getvalue().splitlines())
            metadata, _ = content(Path(line["written"]))
        return line, metadata

    def test_the_goal_of_a_task_is_stated(self) -> None:
        _, metadata = self.run_task("states", "--tasks", "5", "--states", "1")
        self.assertEqual((metadata["goal_object"], metadata["goal_target"]), ("akita_black_bowl_1_main", "plate_1_main"))
        self.assertEqual(metadata["start_surface"], "glazed_rim_porcelain_ramekin_1_main")

    def test_a_teleport_counts_as_success(self) -> None:
        line, metadata = self.run_task("audit", "--tasks", "0", "--faults", "teleport", "--steps", "5")
        self.assertEqual((line["their_success"], metadata["start_surface"]), (True, "table"))


if __name__ == "__main__":
    unittest.main()
