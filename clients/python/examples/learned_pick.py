"""The pick of `pick.py` with a learned correction of the object's position. `train_grasp_offset.py` learned it from runs of this
program.

Before it drives, it looks at the object with its depth camera. From the bounding box of the points seen there, a network predicts
the error of the reference perception. With `--untrained` it looks but ignores the network; this produced the training runs. Either
way it reports the box as its percept, so that networks can be trained on the runs.
"""

import math
import sys
from pathlib import Path

import numpy as np
from actcheck import Pose, Report, Robot, Thing, serve, skill
from grasp_offset import Network, corrected
from pick import take

WEIGHTS = Path(__file__).with_name("grasp_offset.json")
#: Radius of the region around an object. Unit: metres. Four standard deviations of the perceived position, or a glass's width.
AROUND_M = 0.1
#: Fewest points for a usable box.
FEWEST_POINTS = 30

network = None if "--untrained" in sys.argv else Network.load(WEIGHTS)


def look_at(robot: Robot, thing: Thing) -> Thing | None:
    """The box of the camera's points around an object, aligned with the view; `None` if there are too few points."""
    assert robot.description.camera is not None, "the robot has no camera"
    place = thing.pose.position + np.array([0.0, 0.0, float(thing.size_m[2]) / 2])
    x, y, heading = robot.observe().base
    eye = robot.fk(link=robot.description.camera.link).position
    bearing = math.atan2(place[1] - y, place[0] - x)
    down = math.atan2(eye[2] - place[2], math.hypot(place[0] - x, place[1] - y))
    robot.move_joints(dict(zip(robot.description.head_joints, (math.remainder(bearing - heading, math.tau), -down))))
    robot.wait(0.3)
    view = Pose.upright(place, bearing)
    points = (robot.cloud().astype(np.float64) - place) @ view.rotation
    near = np.hypot(points[:, 0], points[:, 1]) < AROUND_M
    # Above the table and flat objects on it, and not far above the object.
    points = points[near & (np.abs(points[:, 2]) < 0.35 * float(thing.size_m[2]))]
    if len(points) < FEWEST_POINTS:
        return None
    low, high = np.percentile(points, [3.0, 97.0], axis=0)
    middle = view * Pose.upright((low + high) / 2)
    return Thing("", middle, high - low)


@skill("Pick")
def pick(robot: Robot, pickObject: str) -> Report:
    robot.wait(0.5)
    thing, others = robot.look_for(pickObject)
    shown = look_at(robot, thing)
    if shown is not None and network is not None:
        thing = corrected(thing, shown, network)
    report = take(robot, thing, others)
    return Report(report.succeeded, report.message, [shown] if shown is not None else [])


if __name__ == "__main__":
    serve()
