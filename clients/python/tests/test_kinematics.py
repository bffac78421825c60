"""Poses, forward and inverse kinematics, trajectories: against each other and against known values."""

from __future__ import annotations

import math
import unittest

import numpy as np

from actcheck import Pose, Unreachable, wrapped
from actcheck.kinematics import Chain, on_base, read_urdf, rotation, turn, turn_between
from actcheck.motion import course
from tests.fake import ARM, BASE, HOME, LEVEL, URDF


class Poses(unittest.TestCase):
    def test_quaternions_go_there_and_back(self) -> None:
        generator = np.random.default_rng(1)
        for _ in range(200):
            axis = generator.normal(size=3)
            pose = Pose(generator.normal(size=3), turn(axis / np.linalg.norm(axis), generator.uniform(-math.pi, math.pi)))
            back = Pose.from_wire(pose.to_wire())
            np.testing.assert_allclose(back.matrix(), pose.matrix(), atol=1e-12)
            np.testing.assert_allclose((pose * pose.inverse()).matrix(), np.eye(4), atol=1e-12)

    def test_half_turns_have_a_quaternion_too(self) -> None:
        for axis in np.eye(3):
            np.testing.assert_allclose(np.abs(Pose(np.zeros(3), turn(axis, math.pi)).quaternion()), [*axis, 0.0], atol=1e-9)

    def test_a_hand_points_where_it_is_told(self) -> None:
        level = Pose.pointing((1.0, 2.0, 3.0), math.pi / 2)
        np.testing.assert_allclose(level.rotation[:, 0], [0.0, 1.0, 0.0], atol=1e-12)
        self.assertAlmostEqual(level.yaw, math.pi / 2)
        np.testing.assert_allclose(level.ahead(0.5).position, [1.0, 2.5, 3.0], atol=1e-12)
        down = Pose.pointing((0.0, 0.0, 0.0), 0.3, math.pi / 2)
        np.testing.assert_allclose(down.rotation[:, 0], [0.0, 0.0, -1.0], atol=1e-12)
        np.testing.assert_allclose(np.linalg.det(down.rotation), 1.0)

    def test_angles_are_wrapped(self) -> None:
        self.assertAlmostEqual(wrapped(3 * math.pi / 2), -math.pi / 2)
        self.assertAlmostEqual(wrapped(-0.2), -0.2)

    def test_a_turn_is_its_axis_times_its_angle(self) -> None:
        axis = np.array([0.6, 0.0, 0.8])
        np.testing.assert_allclose(turn_between(np.eye(3), turn(axis, 2.5)), axis * 2.5, atol=1e-12)
        np.testing.assert_allclose(turn_between(np.eye(3), np.eye(3)), np.zeros(3), atol=1e-12)


class Chains(unittest.TestCase):
    def setUp(self) -> None:
        self.chain = Chain(read_urdf(URDF), "grasp_link")

    def test_the_chain_has_the_joints_on_the_way(self) -> None:
        self.assertEqual(self.chain.names, BASE + ARM)
        with self.assertRaisesRegex(ValueError, "no link 'tentacle'"):
            Chain(read_urdf(URDF), "tentacle")

    def test_a_level_posture_is_where_the_urdf_says(self) -> None:
        # Upper arm and hand in one horizontal line: shoulder at 0.141, 0.078, 0.34 + lift, then 0.345 + 0.1405 + 0.08 ahead.
        pose = self.chain.pose(dict(zip(ARM, (0.3, -math.pi / 2, 0.0, 0.0, 0.0))))
        np.testing.assert_allclose(pose.rotation[:, 0], [1.0, 0.0, 0.0], atol=1e-9)
        np.testing.assert_allclose(pose.position, [0.141 + 0.345 + 0.1405 + 0.08, 0.078, 0.34 + 0.3 - 0.005 - 0.012], atol=1e-9)

    def test_the_jacobian_is_the_slope_of_the_pose(self) -> None:
        generator = np.random.default_rng(2)
        for _ in range(20):
            positions = generator.uniform(-1.0, 1.0, len(self.chain.names))
            pose, jacobian = self.chain.jacobian(positions)
            for number in range(len(positions)):
                nudge = np.zeros(len(positions))
                nudge[number] = 1e-6
                moved, _ = self.chain.jacobian(positions + nudge)
                linear = (moved[:3, 3] - pose[:3, 3]) / 1e-6
                angular = turn_between(pose[:3, :3], moved[:3, :3]) / 1e-6
                np.testing.assert_allclose(np.concatenate([linear, angular]), jacobian[:, number], atol=1e-4)

    def test_inverse_kinematics_reaches_what_forward_kinematics_shows(self) -> None:
        generator = np.random.default_rng(3)
        seed = dict(zip(BASE + ARM, [0.0, 0.0, 0.0, *LEVEL]))
        reached = 0
        for _ in range(60):
            positions = {name: value + generator.uniform(-0.35, 0.35) for name, value in seed.items()}
            inside = np.clip([positions[name] for name in self.chain.names], self.chain.lower, self.chain.upper)
            target = self.chain.pose(dict(zip(self.chain.names, inside.tolist())))
            found = self.chain.solve(target, [seed])
            reached += 1
            pose = self.chain.pose(found)
            self.assertLess(float(np.linalg.norm(pose.position - target.position)), 5e-4)
            self.assertLess(float(np.linalg.norm(turn_between(pose.rotation, target.rotation))), 2e-3)
            values = np.array([found[name] for name in self.chain.names])
            self.assertTrue(np.all(values >= self.chain.lower) and np.all(values <= self.chain.upper))
        self.assertEqual(reached, 60)

    def test_held_joints_stay_and_what_is_out_of_reach_is_told(self) -> None:
        seed = dict(zip(BASE + ARM, [0.0, 0.0, 0.0, *HOME]))
        far = Pose.pointing((9.0, 0.0, 0.6), 0.0)
        with self.assertRaisesRegex(Unreachable, r"\(9.00, 0.00, 0.60\): .* cm and .*° off"):
            self.chain.solve(far, [seed], frozenset(BASE))
        found = self.chain.solve(far, [seed | dict(zip(ARM, LEVEL))])
        self.assertGreater(found["base_x_joint"], 8.0)

    def test_a_root_elsewhere_moves_everything(self) -> None:
        root = Pose.upright((1.0, 2.0, 3.0), math.pi / 2)
        moved = Chain(read_urdf(URDF), "grasp_link", root).pose({})
        np.testing.assert_allclose(moved.matrix(), (root * self.chain.pose({})).matrix(), atol=1e-12)
        tip = Pose(np.zeros(3), rotation(0.0, 0.0, math.pi / 2))
        turned = Chain(read_urdf(URDF), "grasp_link", tip=tip).pose({})
        np.testing.assert_allclose(turned.matrix(), (self.chain.pose({}) * tip).matrix(), atol=1e-12)


    def test_a_base_that_the_urdf_lacks_is_put_below_it(self) -> None:
        joints = read_urdf(URDF)
        self.assertIs(on_base(joints, BASE), joints)
        standing = [joint for joint in joints if joint.name not in BASE]
        driven = Chain(on_base(standing, ["planar_x", "planar_y", "planar_heading"]), "grasp_link")
        self.assertEqual(driven.names, ["planar_x", "planar_y", "planar_heading", *ARM])
        there = dict(zip(driven.names, (1.0, 2.0, 0.5, *LEVEL)))
        expected = self.chain.pose(dict(zip(BASE + ARM, there.values())))
        np.testing.assert_allclose(driven.pose(there).matrix(), expected.matrix(), atol=1e-12)


class Courses(unittest.TestCase):
    def test_a_course_keeps_to_speeds_and_ends_where_it_should(self) -> None:
        speeds = np.array([0.5, 1.0])
        points = [np.array([0.0, 0.0]), np.array([0.4, 0.1]), np.array([0.4, 0.9])]
        rows = course(points, speeds, 0.01)
        np.testing.assert_allclose(rows[-1], points[-1])
        steps = np.abs(np.diff(np.vstack([points[0], rows]), axis=0)) / 0.01
        self.assertTrue(np.all(steps <= speeds * 0.901), steps.max(axis=0))
        self.assertLess(steps[0].max(), 0.02, "it starts at rest")
        self.assertLess(steps[-1].max(), 0.02, "it ends at rest")
        self.assertEqual(len(course(points, speeds, 0.01, least_s=10.0)), 1000)

    def test_no_way_takes_no_time_unless_it_has_to(self) -> None:
        point = np.array([0.3])
        self.assertEqual(len(course([point, point], np.array([1.0]), 0.01)), 0)
        rows = course([point, point], np.array([1.0]), 0.01, least_s=0.05)
        np.testing.assert_allclose(rows, np.full((5, 1), 0.3))


if __name__ == "__main__":
    unittest.main()
