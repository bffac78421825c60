"""Skills and their commands to the robot."""

from __future__ import annotations

import contextlib
import io
import math
import sys
import time
import unittest
import unittest.mock
from collections.abc import Callable
from typing import Any

import numpy as np

from actcheck import Aborted, Failed, Pose, ProtocolFault, Report, Robot, Thing, Unreachable, serve
from actcheck import skill as skill_for
from actcheck.session import Session
from actcheck.skill import skills
from actcheck.wire import Message
from tests.fake import ARM, BASE, LEVEL, TICK_S, Script, Simulation, hello, one_action, robot_of


class Serving(unittest.TestCase):
    def setUp(self) -> None:
        self.kept: dict[str, Any] = dict(skills)
        skills.clear()

    def tearDown(self) -> None:
        skills.clear()
        skills.update(self.kept)

    def ends(self, function: Callable[..., Any], script: Script = one_action) -> list[Message]:
        """The final messages that the simulation received from a served skill."""
        skills.clear()
        skill_for("Pick")(function)
        simulation = Simulation(script)
        self.errors = io.StringIO()
        with contextlib.redirect_stderr(self.errors):
            serve("test", simulation.wire)
        simulation.join()
        return [message for message in simulation.received if message["type"] in ("end", "aborted")]

    def test_a_skill_gets_the_designators_that_it_names(self) -> None:
        seen: dict[str, Any] = {}

        def pick(robot: Robot, pickObject: str) -> bool:
            seen.update(target=pickObject, run=robot.call.run, seed=robot.call.seed)
            return True

        def script(simulation: Simulation) -> None:
            self.hello = simulation.greet()
            simulation.reset()
            simulation.begin(pickObject="obj:glass_1", objectSurface=["obj:table"])
            simulation.act()
            simulation.bye()

        self.assertEqual(self.ends(pick, script), [{"type": "end", "succeeded": True, "message": ""}])
        self.assertEqual(seen, {"target": "obj:glass_1", "run": "k7f3-1", "seed": 5})
        self.assertEqual(self.hello, {"type": "hello", "protocol": 1, "name": "test", "actions": ["Pick"]})

    def test_a_skill_that_takes_all_gets_all(self) -> None:
        def pick(robot: Robot, **designators: Any) -> Report:
            return Report(False, str(sorted(designators.items())))

        self.assertEqual(self.ends(pick)[0]["message"], "[('pickObject', 'obj:glass_1'), ('surfaceObjects', 'obj:cup')]")

    def test_what_a_skill_returns_or_raises_is_how_it_ended(self) -> None:
        glass = Thing("x", Pose.upright((1.0, 2.0, 3.0)), np.array([0.1, 0.1, 0.2]), "act:Glass")

        def raises_failed(robot: Robot) -> None:
            raise Failed("the glass is too wide")

        def ends_from_within(robot: Robot) -> None:
            try:
                robot.end(True, "done", [glass])
            except Exception:
                self.fail("it must not be caught")

        seen = {"pose": glass.pose.to_wire(), "size_m": [0.1, 0.1, 0.2], "category": "act:Glass"}
        cases: list[tuple[Callable[..., Any], bool, str, list[Message]]] = [
            (lambda robot: None, True, "", []),
            (lambda robot: False, False, "the skill returned False", []),
            (lambda robot: Report(True, "held"), True, "held", []),
            (raises_failed, False, "the glass is too wide", []),
            (ends_from_within, True, "done", [seen]),
        ]
        for function, succeeded, message, perceived in cases:
            (end,) = self.ends(function)
            self.assertEqual((end["succeeded"], end["message"], end.get("perceived", [])), (succeeded, message, perceived))

    def test_a_fault_of_the_skill_is_told_where_it_was_written(self) -> None:
        def pick(robot: Robot) -> None:
            robot.step({"tentacle_joint": 1.0})

        with self.assertRaisesRegex(SystemExit, r"^ValueError in test_skill.py, line \d+: .*'tentacle_joint'"):
            self.ends(pick)
        self.assertIn("Traceback", self.errors.getvalue())
        self.assertNotIn("actcheck/skill.py", self.errors.getvalue(), "the traceback begins at the skill")

    def test_a_function_that_does_not_fit_its_action_is_named_with_its_line(self) -> None:
        def misspelt(robot: Robot, pick_object: str | None = None) -> bool:
            return True

        def missing(robot: Robot, target: str) -> bool:
            return True

        cases: list[tuple[Callable[..., Any], str]] = [
            (misspelt, r"misspelt\(\) takes `pick_object`, but Pick has `pickObject`, `surfaceObjects`; an option of your own comes after a star: `\*, pick_object=None`$"),
            (missing, r"missing\(\) takes `target`, but Pick has"),
            (lambda robot: 7, r"must return a Report, a bool or None, not int"),
            (lambda robot: robot.feels, r"not method; write `feels\(\)`"),
        ]
        for function, words in cases:
            with self.assertRaisesRegex(SystemExit, rf"^TypeError in test_skill.py, line \d+: .*{words}"):
                self.ends(function)
            self.assertEqual(self.errors.getvalue(), "", "without a traceback, which would show this package only")

        def with_option(robot: Robot, *, speed: float = 0.3) -> bool:
            return speed == 0.3

        self.assertTrue(self.ends(with_option)[0]["succeeded"])

    def test_a_function_that_can_not_be_a_skill_is_refused_when_it_is_defined(self) -> None:
        async def waits(robot: Robot) -> None:
            pass

        def yields(robot: Robot) -> Any:
            yield

        class Skills:
            def pick(self, robot: Robot) -> None:
                pass

        cases: list[tuple[Any, str]] = [
            (waits, r"waits\(\) must not be `async`: .* \(test_skill.py, line \d+\)"),
            (yields, r"yields\(\) must not `yield`"),
            (Skills.pick, r"pick\(\) must not be a method"),
            (lambda: True, "must take the robot first"),
            ("Pick", "a skill must be a function, not a str"),
        ]
        for function, words in cases:
            with self.assertRaisesRegex(TypeError, words):
                skill_for("Pick")(function)
        with self.assertRaisesRegex(TypeError, r'needs the name of an action in brackets: `@actcheck.skill\("Pick"\)`'):
            skill_for(lambda robot: True)  # type: ignore[arg-type]
        skill_for("Pick")(Skills().pick)
        with self.assertRaisesRegex(TypeError, r"is a second skill for Pick; the first is pick\(\) in test_skill.py, line \d+"):
            skill_for("Pick")(lambda robot: True)
        skills.clear()
        with self.assertRaisesRegex(SystemExit, r"no skill is defined before `serve\(\)`"):
            serve("test")

    def test_a_report_is_checked_where_it_is_made(self) -> None:
        glass = Thing("", Pose.upright((math.nan, 0.0, 0.0)), np.ones(3))
        cases: list[tuple[Callable[[], Any], str]] = [
            (lambda: Report("no"), "succeeded in a Report must be True or False, not 'no'"),  # type: ignore[arg-type]
            (lambda: Report(True, {"a": 1}), "message in a Report must be a text, not {'a': 1}"),  # type: ignore[arg-type]
            (lambda: Report(True, "", glass), "perceived in a Report must be a list of Things"),  # type: ignore[arg-type]
            (lambda: Report(True, "", [1]), "an element of perceived in a Report must be a Thing, not 1"),  # type: ignore[list-item]
            (lambda: Report(True, held=glass), "held in a Report must be a Held or None"),  # type: ignore[arg-type]
            (lambda: Report(True, "a" * 1_000_000), "has 1000000 characters, but must have at most"),
            (lambda: Report(True, "", [glass]), "the pose and the size of a Thing in a Report must be finite"),
        ]
        for report, words in cases:
            with self.assertRaisesRegex((TypeError, ValueError), words):
                report()
        with self.assertRaisesRegex(SystemExit, r"^TypeError in test_skill.py, line \d+: succeeded"):
            self.ends(lambda robot: Report("no"))  # type: ignore[arg-type]
        self.assertIs(Report(np.bool_(True)).succeeded, True)  # type: ignore[arg-type]
        self.assertEqual([self.ends(lambda robot, *, end=np.bool_(it): end)[0]["succeeded"] for it in (1, 0)], [True, False])

    def test_a_skill_that_ends_the_program_is_named(self) -> None:
        def pick(robot: Robot) -> None:
            sys.exit(0)

        with self.assertRaisesRegex(SystemExit, r"^SystemExit in test_skill.py, line \d+: a skill must return a report"):
            self.ends(pick)

    def test_a_silent_program_prints_its_line_before_its_time_is_over(self) -> None:
        def pick(robot: Robot) -> None:
            time.sleep(0.6)  # too long
            robot.wait(0.1)
            time.sleep(0.2)
            robot.wait(0.1)

        with unittest.mock.patch.dict("os.environ", ACTCHECK_TIMEOUT_S="0.4"):
            self.ends(pick)
        printed = self.errors.getvalue()
        self.assertRegex(printed, r"the program has sent no message for 0.36 s; it is in test_skill.py, line \d+: time.sleep\(0.6\)  # too long")
        self.assertEqual(printed.count("no message"), 1, "only if it is silent for too long, and once")

    def test_an_aborted_action_is_over_even_for_a_skill_that_catches_everything(self) -> None:
        tries: list[str] = []

        def pick(robot: Robot) -> None:
            for _ in range(3):
                try:
                    robot.wait(0.1)
                except Aborted as aborted:
                    tries.append(aborted.reason)
            raise Aborted("again")

        def script(simulation: Simulation) -> None:
            simulation.receive_first_command()
            simulation.send({"type": "abort", "reason": "budget"})
            simulation.receive("aborted")
            simulation.reset()
            simulation.bye()

        self.assertEqual(self.ends(pick, script), [{"type": "aborted"}])
        self.assertEqual(tries, ["budget"] * 3)

    def test_a_refusal_is_printed_with_the_line_of_the_skill(self) -> None:
        def script(simulation: Simulation) -> None:
            simulation.receive_first_command()
            simulation.send({"type": "error", "reason": "its command is wrong"})

        with self.assertRaisesRegex(SystemExit, r"^actcheck refused a message in test_skill.py, line \d+$"):
            self.ends(lambda robot: robot.wait(0.1), script)
        self.assertIn("Refused: its command is wrong", self.errors.getvalue())

    def test_another_version_and_a_refusal_end_the_program_with_a_sentence(self) -> None:
        def other_version(simulation: Simulation) -> None:
            simulation.send(hello(protocol=7))

        def refusal(simulation: Simulation) -> None:
            simulation.greet()
            simulation.send({"type": "error", "reason": "unknown key"})

        for script, words in ((other_version, "version 7"), (refusal, "refused a message"), (lambda simulation: None, "closed")):
            with self.assertRaisesRegex(SystemExit, words):
                self.ends(lambda robot: None, script)
            if script is refusal:
                self.assertEqual(self.errors.getvalue(), "actcheck: unknown key\n")

    def test_a_message_that_is_not_due_is_told(self) -> None:
        def script(simulation: Simulation) -> None:
            simulation.greet()
            simulation.send(simulation.observation())

        session = Session(Simulation(script).wire, "test", [])
        with self.assertRaisesRegex(ProtocolFault, "received `observation`, expected reset or begin or bye"):
            session.next_call()


class Hands(unittest.TestCase):
    """The robot's own commands and sensors."""

    def setUp(self) -> None:
        self.simulation = Simulation(one_action)
        self.session, self.robot = robot_of(self.simulation)

    def tearDown(self) -> None:
        self.session.end(Report(True))
        self.assertIsNone(self.session.next_call())
        self.simulation.join()

    def commands(self) -> list[Message]:
        return [message for message in self.simulation.received if message["type"] == "command"]

    def test_joints_move_smoothly_to_where_they_are_told(self) -> None:
        self.robot.move_joints(LEVEL, seconds=3.0)
        self.assertEqual(len(self.commands()), 180)
        at = self.robot.joints()
        np.testing.assert_allclose([at[name] for name in ARM], LEVEL)
        self.robot.follow([{"head_tilt_joint": -0.3}, {"arm_lift_joint": 0.1}], until=lambda seen: seen.time_s > 3.1)
        self.assertLess(len(self.commands()), 190)

    def test_waiting_is_one_command(self) -> None:
        seen = self.robot.wait(0.5)
        self.assertEqual(self.commands(), [{"type": "command", "ticks": 30}])
        self.assertAlmostEqual(seen.time_s, 0.5)
        self.assertAlmostEqual(seen.budget_left_s, 59.5)

    def test_everything_that_a_command_can_say(self) -> None:
        self.robot.step(
            {"arm_lift_joint": 0.2},
            velocities={"wrist_roll_joint": 0.1},
            efforts={"arm_roll_joint": 1.5},
            base_velocity=(0.1, 0.0, 0.2),
            gripper=(0.05, 3.0),
            head=(0.1, -0.4),
            ticks=3,
        )
        self.assertEqual(
            self.commands(),
            [
                {
                    "type": "command",
                    "ticks": 3,
                    "positions": {"arm_lift_joint": 0.2},
                    "velocities": {"wrist_roll_joint": 0.1},
                    "efforts": {"arm_roll_joint": 1.5},
                    "base_velocity": [0.1, 0.0, 0.2],
                    "gripper": {"opening_m": 0.05, "force_n": 3.0},
                    "head": {"pan_rad": 0.1, "tilt_rad": -0.4},
                }
            ],
        )

    def test_what_no_robot_can_do_is_refused_here(self) -> None:
        with self.assertRaisesRegex(ValueError, "no joint 'tentacle'; it has base_x_joint, "):
            self.robot.step({"tentacle": 1.0})
        with self.assertRaisesRegex(ValueError, "velocity of arm_lift_joint is nan"):
            self.robot.step(velocities={"arm_lift_joint": math.nan})
        with self.assertRaisesRegex(ValueError, "3 positions were given for the 5 joints of the arm"):
            self.robot.move_joints([0.0, 0.0, 0.0])
        self.assertEqual(self.commands(), [])

    def test_a_target_beyond_a_limit_is_refused_with_its_unit(self) -> None:
        lift = next(joint for joint in self.robot.description.joints if joint.name == "arm_lift_joint")
        cases: list[tuple[Callable[[], Any], str]] = [
            (lambda: self.robot.gripper(80), "the opening of the gripper is 80 m, but must be from 0 to .* m; its unit is m: 80 mm are 0.08 m"),
            (lambda: self.robot.gripper(-0.1), "the opening of the gripper is -0.1 m, but must be from 0 to"),
            (lambda: self.robot.gripper(0.0, force_n=-5.0), "the force of a finger is -5 N, but must be from 0 to 100 N"),
            (lambda: self.robot.move_joints({"wrist_flex_joint": 45}), "wrist_flex_joint is 45 rad, but .* 45 ° are 0.7854 rad"),
            (lambda: self.robot.move_joints({"arm_lift_joint": 30}), "the position of arm_lift_joint is 30 m, .* 30 cm are 0.3 m"),
            (lambda: self.robot.step(velocities={"arm_lift_joint": 50.0}), f"velocity of arm_lift_joint is 50 m/s, but must be from -{lift.velocity:.4g} to"),
            (lambda: self.robot.step(efforts={"arm_lift_joint": 1e9}), r"effort of arm_lift_joint is 1e\+09 N, but must be"),
            (lambda: self.robot.step(base_velocity=(90.0, 0.0, 0.0)), "the base velocity forwards is 90 m/s, but must be"),
            (lambda: self.robot.step(base_velocity=(0.1, 0.0)), "has 3 numbers"),
            (lambda: self.robot.step(head=(0.0, 40.0)), "head_tilt_joint is 40 rad, but"),
            (lambda: self.robot.gripper(math.nan), "is nan, but must be finite"),
            (lambda: self.robot.gripper(0.0, force_n=9999.0), "the force of a finger is 9999 N, but must be from 0 to 100 N"),
            (lambda: self.robot.wait(-1.0), "the time to wait is -1 s, but must be at least 0 s"),
            (lambda: self.robot.wait(math.nan), "the time to wait is nan, but must be finite"),
            (lambda: self.robot.move_joints(LEVEL, seconds=-1.0), "the duration is -1 s"),
            (lambda: self.robot.drive(-1.0, 0.0, 90.0), "the heading is 90 rad, but .*; its unit is rad: 90 ° are 1.571 rad"),
            (lambda: self.robot.drive(-1000.0, 0.0, 0.0), "x of the base is -1000 m, .* -1000 mm are -1 m"),
            (lambda: Pose.pointing((1.0, 0.0, 0.8), 0.0, down=90.0), "the angle down is 90 rad, but .* 90 ° are 1.571 rad"),
            (lambda: Pose.pointing((1.0, 0.0, 0.8), heading=-45.0), "the heading is -45 rad, but .* -45 ° are -0.7854 rad"),
            (lambda: Pose.upright((1.0, 0.0, 0.8), yaw=180.0), "the yaw is 180 rad, but"),
            (lambda: self.robot.step({"arm_lift_joint": 0.1}, ticks=0), "`ticks` is 0, but must be at least 1"),
        ]
        for command, words in cases:
            with self.assertRaisesRegex(ValueError, words):
                command()
        self.assertEqual(self.commands(), [])
        self.assertEqual(self.robot.wait(-0.005).time_s, 0.0, "a rounding error is not refused")
        self.robot.step({"arm_lift_joint": lift.upper + 0.005})
        self.assertEqual(len(self.commands()), 1, "a rounding error is not refused")

    def test_a_target_pose_that_no_scene_has_is_refused(self) -> None:
        for move in (self.robot.ik, self.robot.move_straight):
            cases: list[tuple[Any, type[Exception], str]] = [
                (Pose.upright((math.nan, 0.0, 0.8)), ValueError, "x of the pose is nan, but must be finite"),
                (Pose(np.zeros(3), np.full((3, 3), math.nan)), ValueError, "the rotation of the pose must be finite"),
                (Pose.upright((0.3, 0.1)), ValueError, "a pose has 3 coordinates"),
                (Pose.upright((300.0, 100.0, 800.0)), ValueError, "x of the pose is 300 m, .*; its unit is m: .* and 300 mm are 0.3 m"),
                ([1.0, 0.0, 0.8], TypeError, "a target must be a Pose, such as .*, not list"),
            ]
            for pose, kind, words in cases:
                with self.assertRaisesRegex(kind, words):
                    move(pose)
        with self.assertRaisesRegex(ValueError, "the position of wrist_flex_joint is nan"):
            self.robot.ik(Pose.upright((1.0, 0.0, 0.8)), near={"wrist_flex_joint": math.nan})
        with self.assertRaisesRegex(ValueError, "no joint 'wrist'"):
            self.robot.fk({"wrist": 0.0})
        with self.assertRaisesRegex(TypeError, "integer"):
            self.robot.step(ticks=1.5)  # type: ignore[arg-type]
        self.assertEqual(self.commands(), [])

    def test_an_unreachable_pose_is_named_with_the_closest_solution(self) -> None:
        high = Pose.pointing((1.0, 0.2, 3.0), 0.0)
        closest = r"the closest solution is \d\d+\.\d cm and .*° off; at their limits: .*arm_lift_joint"
        with self.assertRaisesRegex(Unreachable, rf"can't reach \(1.00, 0.20, 3.00\): {closest}"):
            self.robot.ik(high)
        hand = self.robot.fk()
        with self.assertRaisesRegex(Unreachable, r"no straight way to \(1.00, 0.20, 3.00\): the hand can't reach \("):
            self.robot.move_straight(high)
        turned = Pose.pointing(hand.position, hand.yaw + math.pi / 2)
        with self.assertRaisesRegex(Unreachable, r"cm and [1-9]\d*\.\d° off"):
            self.robot.ik(turned, base=False)

    def test_an_object_that_is_not_named_anywhere_is_a_mistake_of_the_skill(self) -> None:
        words = r"unknown object 'glass_1' \(did you mean `obj:glass_1`\?\); known: obj:cup, obj:glass_1, obj:table"
        with self.assertRaisesRegex(ValueError, words):
            self.robot.look_for("glass_1")
        for of in (None, ["obj:glass_1"]):
            with self.assertRaisesRegex(TypeError, "`look_for` takes the id of one object"):
                self.robot.look_for(of)  # type: ignore[arg-type]

    def test_fingers_close_until_they_stall(self) -> None:
        self.assertAlmostEqual(self.robot.gripper(0.135).opening_m, 0.135, 3)
        self.simulation.between_m = 0.08
        seen = self.robot.gripper(0.0)
        self.assertAlmostEqual(seen.opening_m, 0.08, 3)
        self.assertTrue(self.robot.feels())
        self.assertLess(seen.time_s, 2.0, "it does not wait for longer than it has to")
        self.simulation.between_m = None
        self.assertAlmostEqual(self.robot.gripper(0.0).opening_m, 0.0, 3)
        self.assertFalse(self.robot.feels())

    def test_the_hand_goes_where_ik_says_and_straight(self) -> None:
        target = Pose.pointing((1.4, 0.5, 0.6), 0.4)
        self.robot.move_joints(self.robot.ik(target))
        np.testing.assert_allclose(self.robot.fk().position, target.position, atol=1e-3)
        before = len(self.commands())
        self.robot.move_straight(target.moved(z=0.1), seconds=1.0)
        for command in self.commands()[before:]:
            hand = self.robot.fk(command["positions"])
            self.assertLess(float(np.linalg.norm((hand.position - target.position)[:2])), 3e-3, "straight up")
        self.assertEqual(self.robot.commanded["base_x_joint"], self.robot.joints()["base_x_joint"])

    def test_the_base_drives_the_short_way_round(self) -> None:
        self.robot.drive(0.2, -0.1, math.pi * 1.9)
        at = self.robot.joints()
        np.testing.assert_allclose([at[name] for name in BASE], [0.2, -0.1, -0.1 * math.pi])
        self.robot.base_velocity(0.1, turn=0.3, ticks=6)
        self.assertEqual(self.commands()[-1]["base_velocity"], [0.1, 0.0, 0.3])

    def test_sensors_answer_in_no_time(self) -> None:
        self.assertEqual([thing.id for thing in self.robot.objects()], ["obj:glass_1", "obj:table"])
        glass, others = self.robot.look_for("obj:glass_1")
        self.assertEqual([thing.id for thing in others], ["obj:table"])
        self.assertAlmostEqual(glass.beside(np.array([1.1, 0.01, 0.0])), 0.06)
        self.assertAlmostEqual(glass.beside(np.array([1.0, 0.01, 0.0])), -0.03)
        self.assertEqual((glass.category, glass.furniture, glass.pose.position.tolist()), ("act:Glass", False, [1.0, 0.0, 0.5]))
        with self.assertRaisesRegex(Failed, "obj:cup was not seen"):
            self.robot.look_for("obj:cup")
        self.assertEqual(self.robot.cloud().shape, (5, 3))
        picture = self.robot.depth()
        self.assertEqual((picture.depth.shape, picture.depth[2, 3]), ((3, 4), 11.0))
        self.assertEqual(self.robot.observe().time_s, 0.0)
        self.assertAlmostEqual(TICK_S, self.robot.tick_s)


if __name__ == "__main__":
    unittest.main()
