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
from image_place import CELL, WINDOWS, Array, PlaceNetwork, cells
from train_grasp_offset import learn
from train_image_place import CHANNELS, backward, wanted
from train_image_place import learn as learn_place

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


class ImagePlace(unittest.TestCase):
    def test_the_slopes_are_those_of_the_loss(self) -> None:
        generator = np.random.default_rng(3)
        sizes = zip(WINDOWS, CHANNELS[:-1], CHANNELS[1:], strict=True)
        weights: list[Array] = [generator.normal(0.0, 0.2, (side * side * inner, outer)) for side, inner, outer in sizes]
        network = PlaceNetwork(weights, [generator.normal(0.0, 0.1, outer) for outer in CHANNELS[1:]])
        views = generator.normal(0.0, 1.0, (2, 9, 9, 3))
        target = wanted(np.array([(12.0, 20.0), (30.0, 8.0)]), (9, 9)).astype(np.float64)

        def loss() -> float:
            scores = network.scores(views)[0]
            most = scores.max(axis=(1, 2), keepdims=True)
            logs = scores - most - np.log(np.exp(scores - most).sum(axis=(1, 2), keepdims=True))
            return -float((target * logs).sum()) / len(views)

        for values, slopes in zip(network.weights + network.biases[:2], backward(network, views, target), strict=False):
            place = tuple(int(generator.integers(0, size)) for size in values.shape)
            values[place] += 1e-5
            above = loss()
            values[place] -= 2e-5
            self.assertAlmostEqual((above - loss()) / 2e-5, float(slopes[place]), delta=1e-5)
            values[place] += 1e-5

    def test_a_block_of_any_colour_is_found_and_training_is_the_same_again(self) -> None:
        generator = np.random.default_rng(5)
        pictures = np.empty((48, 64, 64, 3), np.uint8)
        pictures[:] = generator.integers(60, 200, (48, 1, 1, 3))
        places = generator.integers((12, 24), (52, 60), (48, 2)).astype(np.float32)
        for picture, (column, row) in zip(pictures, places.astype(int), strict=True):
            picture[row - 20 : row, column - 6 : column + 6] = generator.integers(0, 255, 3)
        network = learn_place(pictures[:40], places[:40], seed=1, epochs=25)
        off = [np.hypot(*(np.array(network(one)) - place)) for one, place in zip(pictures[40:], places[40:], strict=True)]
        self.assertLess(float(np.median(off)), CELL)
        again = learn_place(pictures[:8], places[:8], seed=1, epochs=1)
        np.testing.assert_array_equal(again.weights[0], learn_place(pictures[:8], places[:8], seed=1, epochs=1).weights[0])
        self.assertEqual(cells(pictures).shape, (48, 16, 16, 3))


if __name__ == "__main__":
    unittest.main()
