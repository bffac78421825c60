"""`Judge` with the compiled rules; skipped where they are missing."""

from __future__ import annotations

import importlib.util
import json
import pickle
import subprocess
import sys
import threading
import unittest
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

import actcheck

UP = (0.0, 0.0, 0.0, 1.0)
PICK = {"pickObject": "cube"}
RULE = """
@prefix act: <http://actions#> .
@prefix w: <https://w3id.org/actcheck/world#> .
success(?o) :- parameter(act:pickObject, ?o), historically(w:tilt(?o) < 0.5) .
margin(?m) :- parameter(act:pickObject, ?o), after(?o, w:tilt, ?t), ?m = 0.5 - ?t .
"""


def has_rules() -> bool:
    return importlib.util.find_spec("actcheck._judge") is not None


def state(height: float = 0.0, held: bool = False) -> dict[str, Any]:
    fingers = ["cube"] if held else []
    under = ["robot"] if held else ["table"]
    return {
        "bodies": {
            "cube": {
                "position": np.array([0.0, 0.0, 0.82 + height]),
                "rotation": np.array(UP, dtype=np.float32),
                "size": (0.04, 0.04, 0.04),
                "category": "Box",
                "mass": np.float32(0.5),
                "linear_velocity": np.zeros(3),
                "angular_velocity": np.zeros(3),
                "touches": under,
                "rests_on": set(under),
            },
            "table": {
                "position": (0, 0, 0.4),
                "rotation": UP,
                "size": [1.0, 1.0, 0.8],
                "fixed": np.bool_(True),
                "touches": [] if held else ["cube"],
            },
        },
        "robot": {
            "base": (0.0, 0.0, 0.0),
            "gripper": {"position": (0.0, 0.0, 0.83 + height), "rotation": UP},
            "opening": 0.04,
            "left_touches": fingers,
            "right_touches": fingers,
        },
    }


class Missing(unittest.TestCase):
    def test_importing_the_package_does_not_load_the_rules(self) -> None:
        loads = "import sys, actcheck; print('actcheck._judge' in sys.modules)"
        printed = subprocess.run([sys.executable, "-c", loads], capture_output=True, text=True, check=True).stdout
        self.assertEqual(printed.strip(), "False")

    def test_without_the_rules_the_error_names_the_ways_to_get_them(self) -> None:
        with mock.patch.dict(sys.modules, {"actcheck._judge": None}):
            with self.assertRaisesRegex(ImportError, "make judge.*make wheel"):
                actcheck.Judge()


@unittest.skipUnless(has_rules(), "the compiled rules are missing: run `make judge`")
class Judging(unittest.TestCase):
    judge: actcheck.Judge

    @classmethod
    def setUpClass(cls) -> None:
        cls.judge = actcheck.Judge()

    def test_a_verdict_has_outcomes_margins_and_reasons(self) -> None:
        verdict = self.judge("Pick", state(), state(0.2, held=True), {"report": (True, "held")}, PICK)
        outcomes = {name: judgement.outcome for name, judgement in verdict.items()}
        self.assertEqual(
            outcomes,
            {
                "CloseObject": "passed",
                "ObjectGrasped": "passed",
                "NoGraspCollisions": "inapplicable",
                "MovedObject": "passed",
                "ObjectInGripper": "passed",
            },
        )
        self.assertTrue(verdict.passed and verdict)
        self.assertEqual((verdict.score, len(verdict), list(verdict)[0]), (1.0, 5, "CloseObject"))
        moved = verdict["MovedObject"]
        self.assertAlmostEqual(moved.margin or 0.0, 0.18, places=6)
        self.assertEqual((moved.missing, moved.held_before), ((), False))
        self.assertIn("moved 20 cm", moved.witness)
        self.assertIn("by rules/moved_object.rls", moved.why().replace("built-in:", ""))
        self.assertIn("near_its_place(obj:cube): is not derived", moved.why_not("near_its_place(obj:cube)"))
        self.assertIn("maxDisplacement", verdict["NoGraspCollisions"].missing)
        self.assertIn("MovedObject: passed", repr(verdict))
        plain = json.loads(json.dumps(verdict.as_dict()))
        self.assertEqual(plain["properties"]["CloseObject"]["outcome"], "passed")

    def test_a_teleported_object_is_no_pick(self) -> None:
        after = state(0.2)
        after["bodies"]["cube"].update(touches=[], rests_on=[])
        verdict = self.judge("Pick", state(), after, {"report": True}, PICK)
        self.assertFalse(verdict)
        self.assertEqual(verdict["ObjectInGripper"].outcome, "failed")
        self.assertIn("the fingers do not both touch cube", verdict["ObjectInGripper"].why())

    def test_every_fault_is_listed_with_its_place(self) -> None:
        after = state(0.2, held=True)
        after["bodies"]["cube"]["position"] = (0.0, float("nan"), 0.0)
        after["bodies"]["cube"]["tuches"] = []
        after["robot"]["base"] = np.zeros((2, 2))
        with self.assertRaises(actcheck.JudgeError) as caught:
            self.judge("Pick", state(), after, {"samples": {"cube": {"z": np.zeros(3)}}}, {"pickObjekt": "cube"})
        faults = {(fault.code, fault.place) for fault in caught.exception.faults}
        cube = 'after["bodies"]["cube"]'
        for expected in [
            ("J001", cube),
            ("J003", cube + '["position"]'),
            ("J002", 'after["robot"]["base"]'),
            ("J004", 'during["samples"]'),
            ("J006", "parameters"),
        ]:
            self.assertIn(expected, faults)
        self.assertIn("did you mean `touches`?", str(caught.exception))
        again = pickle.loads(pickle.dumps(caught.exception))
        self.assertEqual(again.faults, caught.exception.faults)
        with self.assertRaisesRegex(actcheck.JudgeError, "did you mean `Pick`"):
            self.judge("Pik", state(), state())
        with self.assertRaisesRegex(TypeError, "is not a plain value"):
            self.judge("Pick", state(), {"bodies": object()}, parameters=PICK)
        looped: list[Any] = []
        looped.append(looped)
        with self.assertRaises(RecursionError):
            self.judge("Pick", state(), {"bodies": looped}, parameters=PICK)

    def test_own_rules_read_the_samples(self) -> None:
        judge = actcheck.Judge(rules={"StaysUpright": RULE})
        tilted = np.array([0.0, 0.4, 0.0])
        samples = {
            "period": 0.05,
            "cube": {"qx": np.sin(tilted / 2), "qy": np.zeros(3), "qz": np.zeros(3), "qw": np.cos(tilted / 2)},
        }
        verdict = judge("Lift", state(), state(0.2, held=True), {"samples": samples}, PICK)
        self.assertEqual([it.outcome for it in verdict.values()], ["passed"])
        samples["cube"]["qx"] = np.sin(2 * tilted / 2)  # type: ignore[index]
        samples["cube"]["qw"] = np.cos(2 * tilted / 2)  # type: ignore[index]
        verdict = judge("Lift", state(), state(0.2, held=True), {"samples": samples}, PICK)
        self.assertEqual(verdict["StaysUpright"].outcome, "failed")
        verdict = judge("Lift", state(), state(0.2, held=True), None, PICK)
        self.assertEqual((verdict["StaysUpright"].outcome, verdict["StaysUpright"].missing), ("inapplicable", ("samples",)))
        with self.assertRaisesRegex(actcheck.JudgeError, "Wrong.rls:1:"):
            actcheck.Judge(rules={"Wrong": "success(?x) :- aftr(?x) ."})
        with self.assertRaisesRegex(actcheck.JudgeError, "O001|no such file"):
            actcheck.Judge("no/such/file.ttl")

    def test_a_monitor_judges_every_step(self) -> None:
        monitor = actcheck.Judge(rules={"StaysUpright": RULE}).monitor("Lift", state(), PICK)
        outcomes = []
        for step, angle in enumerate([0.1, 0.6, 0.1], start=1):
            now = state(0.1 * step, held=True)
            now["bodies"]["cube"]["rotation"] = (np.sin(angle / 2), 0.0, 0.0, np.cos(angle / 2))
            outcomes.append(monitor.step(now, step * 0.05)["StaysUpright"].outcome)
        self.assertEqual(outcomes, ["passed", "failed", "failed"])
        with self.assertRaisesRegex(actcheck.JudgeError, "J010"):
            monitor.step(state(), 0.1)
        picked = self.judge.monitor("Pick", state(), PICK).step(state(0.2, held=True), 0.05, report=True)
        self.assertEqual(picked["ObjectGrasped"].outcome, "passed")

    def test_threads_share_a_judge(self) -> None:
        verdicts: list[actcheck.Verdict] = []

        def judge_some() -> None:
            for _ in range(20):
                verdicts.append(self.judge("Pick", state(), state(0.2, held=True), parameters=PICK))

        threads = [threading.Thread(target=judge_some) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(len(verdicts), 80)
        self.assertEqual({str(verdict.as_dict()) for verdict in verdicts}, {str(verdicts[0].as_dict())})

    def test_the_example_of_the_readme_runs(self) -> None:
        readme = (Path(__file__).parents[1] / "README.md").read_text()
        section = readme.split("## Judge your own actions", 1)[1]
        code = section.split("```python\n", 1)[1].split("```", 1)[0]
        printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
        self.assertEqual(printed.returncode, 0, printed.stderr)
        lines = printed.stdout.splitlines()
        self.assertEqual(lines[0], "passed 0.18")
        self.assertEqual(lines[-1], "('message', 'reported')")


if __name__ == "__main__":
    unittest.main()
