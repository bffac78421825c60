"""A scripted pick: from the side or from above, where furniture and other objects leave room."""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from actcheck import Failed, Pose, Report, Robot, Thing, Unreachable, serve, skill


def ways(robot: Robot, thing: Thing, others: Sequence[Thing]) -> Iterator[tuple[float, float, Pose]]:
    """Hand poses beside the object, or above it if it is low: the cost, the distance back to clear furniture, and the pose."""
    height, place, (x, y, _) = float(thing.size_m[2]), thing.pose.position, robot.observe().base
    up, down = (min(max(height / 2, 0.055), 0.11), 0.0) if height >= 0.1 else (max(height - 0.03, 0.0275), math.pi / 2)
    blocks, things = [one for one in others if one.furniture], [one for one in others if not one.furniture]
    for turn in np.linspace(-math.pi, math.pi, 24, endpoint=False).tolist():
        heading = math.atan2(place[1] - y, place[0] - x) + turn
        back = -np.array([math.cos(heading), math.sin(heading), 0.0])
        along = place + back * np.arange(0.0, 2.0, 0.03)[:, None]
        out = next(n for n in range(4, len(along)) if n > 40 or all(one.beside(along[n]) > 0.1 for one in blocks))
        drive = np.linspace([x, y, 0.0], along[out + 22], 20)  # the base is about 66 cm behind the hand
        room = min((one.beside(at) for at in along[:out] for one in things), default=1.0)
        if all(one.beside(at) > 0.25 for at in drive for one in blocks):
            against = 0.012 * out + 0.3 * abs(turn) + 20.0 * max(0.0, 0.1 - room)
            yield against, 0.03 * out, Pose.pointing(place, heading, down).moved(z=up)


def take(robot: Robot, thing: Thing, others: Sequence[Thing]) -> Report:
    """Drives to the object, closes the hand on it, lifts it and backs away."""
    x, y, heading = robot.description.base_joints
    for _, back, hand in sorted(ways(robot, thing, others), key=lambda way: way[0]):
        level = hand.rotation[2, 0] > -0.5
        try:  # with the upper arm level, so that it does not meet the table
            at = robot.ik(hand, near=robot.description.postures[2 if level else 4])
        except Unreachable:
            continue
        if all(one.beside(np.array([at[x], at[y], 0.0])) > 0.2 for one in others if one.furniture):
            break
    else:
        raise Failed("no free path to it was found")
    away = {x: at[x] - back * math.cos(at[heading]), y: at[y] - back * math.sin(at[heading])}
    robot.drive(away[x], away[y], at[heading])
    robot.gripper(robot.description.max_opening_m, wait=False)
    before = hand.ahead(-0.12)
    robot.move_joints((at if level else robot.ik(before, near=at, base=False)) | away)
    robot.move_straight(before, base=True)
    robot.move_straight(hand, base=level, seconds=2.5)
    robot.gripper(0.0)
    robot.move_straight(hand.moved(z=0.15), seconds=2.0)
    robot.move_joints(away)
    return Report(robot.feels(), "it holds it" if robot.feels() else "the hand is empty")


@skill("Pick")
def pick(robot: Robot, pickObject: str) -> Report:
    return take(robot, *robot.look_for(pickObject))


if __name__ == "__main__":
    serve()
