"""The interface of `ActionEnv`."""

from __future__ import annotations

import unittest

import numpy as np

from actcheck import ActionEnv, Closed
from actcheck.session import Session
from tests.fake import ARM, Simulation


def two_episodes(simulation: Simulation) -> None:
    simulation.greet()
    for _ in range(2):
        simulation.reset()
        simulation.begin()
        simulation.act()
    simulation.bye()


class Environment(unittest.TestCase):
    def test_episodes_follow_each_other_until_the_campaign_is_over(self) -> None:
        simulation = Simulation(two_episodes)
        session = Session(simulation.wire, "test", ["Pick"])
        env = ActionEnv("Pick", reward=lambda robot: -robot.observe().time_s, session=session)
        seen, info = env.reset()
        parameters = {"pickObject": "obj:glass_1", "surfaceObjects": "obj:cup"}
        self.assertEqual(info, {"action": "Pick", "parameters": parameters, "run": "k7f3-1", "seed": 5})
        assert env.observation_space is not None
        self.assertTrue(env.observation_space.contains(seen))
        self.assertEqual(env.action_space.shape, (len(ARM) + 3 + 1,))
        action = np.zeros(env.action_space.shape)
        action[0], action[-1] = 1.0, 1.0
        _, reward, terminated, truncated, _ = env.step(action)
        self.assertAlmostEqual(reward, -0.1)
        self.assertFalse(terminated or truncated)
        # The lift goes up at its velocity limit for a tenth of a second.
        self.assertAlmostEqual(env.robot.joints()["arm_lift_joint"], 0.02)
        self.assertEqual(simulation.wanted_m, 0.135)
        with self.assertRaisesRegex(ValueError, "9 finite numbers"):
            env.step(np.zeros(3))
        env.reset()
        env.end(True, "held")
        with self.assertRaisesRegex(RuntimeError, "reset"):
            env.step(action)
        with self.assertRaisesRegex(Closed, "over"):
            env.reset()
        simulation.join()
        ends = [(end["succeeded"], end["message"]) for end in simulation.received if end["type"] == "end"]
        self.assertEqual(ends, [(False, "the next episode was begun"), (True, "held")])
        with self.assertRaisesRegex(ValueError, "campaign"):
            env.reset(seed=3)

    def test_what_actcheck_ends_is_truncated(self) -> None:
        def script(simulation: Simulation) -> None:
            simulation.receive_first_command()
            simulation.send({"type": "abort", "reason": "budget"})
            simulation.receive("aborted")
            simulation.bye()

        simulation = Simulation(script)
        env = ActionEnv("Pick", session=Session(simulation.wire, "test", ["Pick"]))
        env.reset()
        _, _, terminated, truncated, info = env.step(np.zeros(9))
        self.assertEqual((terminated, truncated, info), (False, True, {"aborted": "budget"}))
        simulation.join()

    def test_samples_are_in_their_space(self) -> None:
        simulation = Simulation(two_episodes)
        env = ActionEnv("Pick", session=Session(simulation.wire, "test", ["Pick"]))
        sample = env.action_space.sample(np.random.default_rng(0))
        self.assertTrue(env.action_space.contains(sample))
        self.assertFalse(env.action_space.contains(sample * 9.0))
        env.close()


if __name__ == "__main__":
    unittest.main()
