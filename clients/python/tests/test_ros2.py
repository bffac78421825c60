"""The bridge to ROS 2, as far as it needs no ROS 2: mapping files, goals and reports. The rest is tested where one can be had."""

from __future__ import annotations

import math
import sys
import tempfile
import unittest
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from actcheck import Pose, Thing
from actcheck.messages import Call, Observation

if sys.version_info >= (3, 11):
    from actcheck.ros2.faults import BrokenNode, MappingFault
    from actcheck.ros2.goal import Values, field, pose_of
    from actcheck.ros2.mapping import SkillMapping, read

GOOD = """\
test_launcher = "server.py --speed 0.5"

[actions.Pick]
server = "/pick"
type = "my_msgs/action/Pick"
goal = { object = "{pickObject}", pose = "{pickObject.pose}" }
result = { succeeded = "error_code == 0", message = "words" }

[places]
kitchen = [1.0, 2.0, 1.57]
"""


def mapping(text: str) -> SkillMapping:
    """Reads a mapping file with a text."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "skill.toml"
        file.write_text(text)
        return read(file)


class Message(SimpleNamespace):
    """A message: fields with types."""

    def get_fields_and_field_types(self) -> dict[str, str]:
        return {name: type(value).__name__ for name, value in vars(self).items()}


class Pose_(Message):
    """Named as the message: values are set by the type's name."""


Pose_.__name__ = "Pose"


def pose_message(x: float = 0.0, w: float = 1.0) -> Any:
    return Pose_(position=Message(x=x, y=0.0, z=0.5), orientation=Message(x=0.0, y=0.0, z=0.0, w=w))


@unittest.skipIf(sys.version_info < (3, 11), "mapping files are read by Python 3.11 and later")
class Mappings(unittest.TestCase):
    def test_a_good_file(self) -> None:
        read = mapping(GOOD)
        self.assertEqual(read.commands, (("server.py", "--speed", "0.5"),))
        self.assertEqual(read.actions["Pick"].succeeded, ("error_code", 0))
        self.assertEqual(read.places["kitchen"], (1.0, 2.0, 1.57))

    def test_faults_have_lines_and_ways_out(self) -> None:
        cases = {
            "": ["it lacks `test_launcher`", "no action is mapped"],
            "x = [": ["it is not TOML"],
            GOOD.replace('server = "/pick"\n', ""): [":3: `actions.Pick.server` is missing"],
            GOOD.replace("my_msgs/action/Pick", "Pick"): [":5: `actions.Pick.type` must be of the form PACKAGE/action/NAME"],
            GOOD.replace("server =", "sevrer ="): [":4: unknown key `actions.Pick.sevrer`: did you mean `server`?"],
            GOOD.replace("{pickObject.pose}", "{pickObject.place}"): [":6: `{pickObject.place}`: after a designator's name"],
            GOOD.replace("[1.0, 2.0, 1.57]", "[1.0, 2.0]"): [":10: `places.kitchen` must be [x, y, heading]"],
            GOOD.replace('"server.py --speed 0.5"', '"server.py \'"'): [":1: `test_launcher` is not a command"],
            GOOD.replace('"server.py --speed 0.5"', "7"): [":1: `test_launcher` must be a command"],
            "callback_s = -1\n" + GOOD: [":1: `callback_s` is -1, but must be between 0.1 and 3600"],
            "callback_s = nan\n" + GOOD: [":1: `callback_s` is nan"],
            "rate_hz = true\n" + GOOD: [":1: `rate_hz` must be a number"],
            GOOD.replace("error_code == 0", "error_code == done"): ["`done` is not a value"],
            GOOD.replace('result = {', 'result = { perceived = { list = "things" },'): ["`actions.Pick.result.perceived` needs `list`"],
            GOOD + "[robot]\narms = 'x'\n": ["unknown key `robot.arms`: did you mean `arm`?"],
        }
        for text, words in cases.items():
            with self.assertRaises(MappingFault) as caught:
                mapping(text)
            for word in words:
                self.assertIn(word, str(caught.exception), text)

    def test_all_faults_are_told_at_once(self) -> None:
        with self.assertRaises(MappingFault) as caught:
            mapping('test_launcher = []\nframe = 3\n[actions.Pick]\nserver = "/pick"\n')
        self.assertEqual(len(caught.exception.faults), 2, caught.exception)


@unittest.skipIf(sys.version_info < (3, 11), "mapping files are read by Python 3.11 and later")
class Goals(unittest.TestCase):
    def values(self) -> Values:
        still = Observation(0.0, np.zeros(1), np.zeros(1), np.zeros(1), (0.0, 0.0, 0.0), 0.0, 0.0, 1.0, 0.0)
        call = Call("Pick", {"pickObject": "mug_1", "place": "kitchen", "others": ["a", "b"]}, {}, 1.0, still)
        thing = Thing("mug_1", Pose.upright((1.0, 2.0, 0.5), 0.3), np.array([0.1, 0.1, 0.2]))
        return Values(call, {"kitchen": (3.0, 4.0, 0.0)}, "map", lambda: [thing], 5)

    def test_values_fill_fields(self) -> None:
        goal = Message(object="", pose=pose_message(), at=Message(x=0.0, y=0.0, z=0.0), names=[""], speed=0.0, text="")
        fields = {
            "object": "{pickObject}",
            "pose": "{place.pose}",
            "at": "{pickObject.position}",
            "names": "{others}",
            "speed": 2,
            "text": "the {pickObject}",
        }
        self.values().fill(goal, fields)
        self.assertEqual((goal.object, goal.names, goal.speed, goal.text), ("mug_1", ["a", "b"], 2.0, "the mug_1"))
        self.assertEqual((goal.pose.position.x, goal.at.z), (3.0, 0.5))

    def test_wrong_goals_are_faults_of_the_mapping(self) -> None:
        goal = Message(object="", number=Message(data=0))
        for fields, words in (
            ({"objetc": "x"}, "the mapping sets goal.objetc, but its type has only object, number"),
            ({"object": "{pickObjekt}"}, "Pick has no such designator; it has pickObject, place, others"),
            ({"number": "{pickObject.pose}"}, "goal.number is of type Message, which can't hold a pose"),
        ):
            with self.assertRaisesRegex(BrokenNode, words.replace(".", r"\.")):
                self.values().fill(goal, fields)

    def test_poses_of_nodes_are_checked(self) -> None:
        self.assertEqual(pose_of(pose_message(2.0), "map", "result").position[0], 2.0)
        stamped = Message(header=Message(frame_id="camera"), pose=pose_message())
        with self.assertRaisesRegex(BrokenNode, "is in the frame `camera`, but the mapping expects `map`"):
            pose_of(stamped, "map", "result")
        with self.assertRaisesRegex(BrokenNode, "must be three finite numbers"):
            pose_of(pose_message(math.nan), "map", "result")
        with self.assertRaisesRegex(BrokenNode, "an orientation of length 0"):
            pose_of(pose_message(w=0.0), "map", "result")
        with self.assertRaisesRegex(BrokenNode, "the message has no `pose`; it has x"):
            field(Message(x=1), "pose")


if __name__ == "__main__":
    unittest.main()
