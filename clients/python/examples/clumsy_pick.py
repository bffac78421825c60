"""A pick in a hurry, to be compared with `pick.py`: nothing in it fails on purpose, it is only careless.

It goes straight at the thing and unfolds its arm on the way, looks at nothing that stands around, does not slow down before it
touches, does not wait until the fingers have stalled, lifts as fast as the arm can, and takes its success for granted.
"""

import math

from actcheck import Pose, Report, Robot, serve, skill


@skill("Pick")
def pick(robot: Robot, pickObject: str) -> Report:
    thing, _ = robot.look_for(pickObject)
    place, (x, y, _) = thing.pose.position, robot.observe().base
    heading = math.atan2(place[1] - y, place[0] - x)
    hand = Pose.pointing(place, heading).moved(z=float(thing.size_m[2]) / 2)
    robot.gripper(robot.description.max_opening_m, wait=False)
    robot.move_joints(robot.ik(hand))
    robot.gripper(0.0, wait=False)
    robot.wait(0.2)
    robot.move_straight(hand.moved(z=0.15))
    return Report(True, "of course it holds it")


if __name__ == "__main__":
    serve()
