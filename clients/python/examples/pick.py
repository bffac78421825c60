#!/usr/bin/env python3
"""A scripted pick: tall things from the side, low ones from above, from where furniture and other things leave room."""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from actcheck import Failed, Pose, Report, Robot, Thing, Unreachable, serve, skill


def ways(robot: Robot, thing: Thing, others: Sequence[Thing]) -> Iterator[tuple[float, float, Pose]]:
    """Hands around the thing: what speaks against each, how far back it is clear of all furniture, and its pose."""
    height, place, (x, y, _) = float(thing.size_m[2]), thing.pose.position, robot.observe().base
    up, down = (min(max(height / 2, 0.055), 0.11), 0.0) if height >= 0.1 else (max(height - 0.03, 0.0275), math.pi / 2)
    for turn in np.linspace(-math.pi, math.pi, 24, endpoint=False).tolist():
        heading = math.atan2(place[1] - y, place[0] - x) + turn
        along = [place - np.array([math.cos(heading), math.sin(heading), 0.0]) * back for back in np.arange(0.0, 1.2, 0.03)]
        clear = [all(one.beside(at) > 0.1 for one in others if one.furniture) for at in along]
        if any(clear[4:]):
            out = clear.index(True, 4)
            room = min((one.beside(at) for at in along[:out] for one in others if not one.furniture), default=1.0)
            cost = 0.012 * out + 0.3 * abs(turn) + 20.0 * max(0.0, 0.1 - room)
            yield cost, 0.03 * out, Pose.pointing(place, heading, down).moved(z=up)


def take(robot: Robot, thing: Thing, others: Sequence[Thing]) -> Report:
    """Drives there, closes the hand on the thing, lifts it and takes it away."""
    x, y, heading = robot.description.base_joints
    for _, back, hand in sorted(ways(robot, thing, others), key=lambda way: way[0]):
        try:
            at = robot.ik(hand)
        except Unreachable:
            continue
        if all(one.beside(np.array([at[x], at[y], 0.0])) > 0.24 for one in others if one.furniture):
            break
    else:
        raise Failed("no free way to it was found")
    away = {x: at[x] - back * math.cos(at[heading]), y: at[y] - back * math.sin(at[heading])}
    robot.drive(away[x], away[y], at[heading])
    robot.gripper(robot.description.max_opening_m, wait=False)
    before, level = hand.ahead(-0.12), hand.rotation[2, 0] > -0.5
    robot.move_joints((at if level else robot.ik(before, near=at, base=False)) | away)
    robot.move_straight(before, base=True)
    robot.move_straight(hand, base=level, seconds=2.5)
    robot.gripper(0.0)
    robot.move_straight(hand.moved(z=0.15), seconds=2.0)
    robot.move_joints(away)
    robot.wait(0.5)
    gap = robot.observe().opening_m * 100.0
    return Report(robot.feels(), f"the fingers are {gap:.1f} cm apart" if robot.feels() else "the hand is empty")


@skill("Pick")
def pick(robot: Robot, pickObject: str) -> Report:
    robot.wait(0.5)
    return take(robot, *robot.look_for(pickObject))


if __name__ == "__main__":
    serve()
