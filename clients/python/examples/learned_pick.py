"""The pick of `pick.py`, with a learned idea of where the thing is: `train_grasp_offset.py` learned it from runs of this program.

Before it drives it looks at the thing with its depth camera. A network says from the box of what is seen there how far the thing is
from where the reference perception has it. With `--untrained` it looks and does not listen: so the first runs were made. Either way
it reports the box as what it perceived, by which the runs can be learned from.
"""

import math
import sys
from pathlib import Path

import numpy as np
from actcheck import Pose, Report, Robot, Thing, serve, skill
from grasp_offset import Network, corrected
from pick import take

WEIGHTS = Path(__file__).with_name("grasp_offset.json")
#: What is looked at around a thing. Unit: metres. Four standard deviations of where things seem to be, or a glass's width.
AROUND_M = 0.1
#: Fewer points say nothing.
FEWEST_POINTS = 30

network = None if "--untrained" in sys.argv else Network.load(WEIGHTS)


def look_at(robot: Robot, thing: Thing) -> Thing | None:
    """The box of the points that the camera shows around a thing, turned as it looks; nothing if there are too few."""
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
    # Above the table and what lies flat on it, and not far above the thing.
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
