"""A careless pick, for comparison with `pick.py`: no step fails on purpose.

It drives straight at the object and unfolds its arm on the way, ignores all obstacles, does not slow down before contact,
does not wait until the fingers have stalled, lifts as fast as the arm can, and reports success without checking.
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
