"""The learned example: its network's predictions, and that training can be reproduced."""

from __future__ import annotations

import sys
import unittest
from pathlib import Path

import numpy as np

from actcheck import Pose, Thing

EXAMPLES = Path(__file__).parents[1] / "examples"
sys.path.insert(0, str(EXAMPLES))

from grasp_offset import FEATURES, Network, corrected, features
from train_grasp_offset import learn

WEIGHTS = EXAMPLES / "grasp_offset.json"


class GraspOffset(unittest.TestCase):
    def test_the_shipped_weights_follow_what_the_camera_shows(self) -> None:
        self.assertLess(WEIGHTS.stat().st_size, 1_000_000)
        network = Network.load(WEIGHTS)
        usual = network.mean
        for axis in (0, 1):
            nudged = usual.copy()
            nudged[axis] += 0.01
            moved = network(nudged) - network(usual)
            # If the camera shows the object a centimetre further ahead, the prediction moves most of a centimetre ahead, not aside.
            self.assertTrue(0.005 < moved[axis] < 0.015, moved)
            self.assertLess(abs(moved[1 - axis]), 0.005)

    def test_corrections_are_made_in_the_world(self) -> None:
        seen = Thing("glass", Pose.upright((1.0, 2.0, 0.7)), np.array([0.08, 0.08, 0.14]))
        shown = Thing("", Pose.upright((1.0, 2.0, 0.77), np.pi / 2), np.array([0.04, 0.08, 0.1]))
        nothing = np.zeros((len(FEATURES), 2))
        ahead = Network(np.zeros(8), np.ones(8), nothing, np.zeros(2), np.zeros((2, 2)), nothing, np.array([0.03, 0.01]))
        np.testing.assert_allclose(features(seen, shown)[:2], [0.0, 0.0], atol=1e-12)
        # Ahead is the world's y, left its −x.
        np.testing.assert_allclose(corrected(seen, shown, ahead).pose.position, [0.99, 2.03, 0.7], atol=1e-12)

    def test_what_is_there_to_be_learned_is_learned_and_always_the_same(self) -> None:
        generator = np.random.default_rng(5)
        inputs = generator.normal(0.0, 0.02, (120, len(FEATURES)))
        offsets = 0.8 * inputs[:, :2] + np.array([0.02, 0.0]) + 0.01 * np.tanh(40.0 * inputs[:, 2:4])
        network = learn(inputs[:100], offsets[:100], seed=1)
        error = np.linalg.norm(network(inputs[100:]) - offsets[100:], axis=1)
        self.assertLess(np.median(error), 0.004)
        np.testing.assert_array_equal(learn(inputs[:100], offsets[:100], seed=1).hidden, network.hidden)


if __name__ == "__main__":
    unittest.main()
