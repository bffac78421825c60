"""A pick that finds its object in one colour image. `train_image_place.py` trained its network on images of such runs.

It knows the table from the robot's map and the size of a glass, but not where the glass is: it looks down at the table, lets the
network find the foot of the glass in the image, and follows that pixel's ray to the table. With `--look` it only looks (this
produced the training images); with `--chance` it reaches for the middle of the table instead.
"""

import sys
from pathlib import Path

import numpy as np
from actcheck import Failed, Pose, Report, RgbImage, Robot, Thing, serve, skill
from image_place import PlaceNetwork
from pick import take

WEIGHTS = Path(__file__).with_name("image_place.json")
#: How far the camera looks down. Unit: radians.
TILT_RAD = -0.6
#: When it looks. Unit: seconds.
LOOK_S = 2.0

network = PlaceNetwork.load(WEIGHTS) if WEIGHTS.exists() else None


def on_plane(image: RgbImage, column: float, row: float, height_m: float) -> np.ndarray:
    """The point at a height that a pixel of an image sees. Frame: world, by the robot's belief."""
    ray = image.camera_pose.rotation @ np.array(
        [1.0, (image.width / 2 - column) / image.focal_px, (image.height / 2 - row) / image.focal_px]
    )
    eye = image.camera_pose.position
    if ray[2] > -1e-3:
        raise Failed("the network looks above the horizon")
    return np.asarray(eye + ray * ((height_m - eye[2]) / ray[2]))


@skill("Pick")
def pick(robot: Robot, pickObject: str) -> Report:
    robot.move_joints(dict(zip(robot.description.head_joints, (0.0, TILT_RAD))))
    robot.wait(max(0.0, LOOK_S - robot.observe().time_s))
    image = robot.image()
    if "--look" in sys.argv:
        return Report(False, "it only looked")
    # The head is level again before the arm rises beside it.
    robot.move_joints(dict(zip(robot.description.head_joints, (0.0, 0.0))))
    furniture = [thing for thing in robot.objects() if thing.furniture]
    x, y, _ = robot.observe().base
    table = min(furniture, key=lambda thing: thing.beside(np.array([x, y, 0.0])))
    height_m = float(table.pose.position[2] + table.size_m[2])
    if "--chance" in sys.argv:
        place = table.pose.position + np.array([0.0, 0.0, float(table.size_m[2])])
    elif network is None:
        raise Failed("there are no weights; run train_image_place.py")
    else:
        place = on_plane(image, *network(image.rgb), height_m)
    glass = Thing(pickObject, Pose.upright(place), np.array(robot.call.kinds[pickObject]["size_m"]))
    return take(robot, glass, furniture)


if __name__ == "__main__":
    serve()
