"""A scripted look at a surface: its upper side, and the objects on it."""

from collections.abc import Sequence

import numpy as np
from actcheck import Failed, Plane, Report, Robot, Thing, serve, skill

#: Points of the camera this close to the expected height are of the surface. Unit: metres.
NEAR = 0.03


def upper_side(robot: Robot, surface: Thing) -> Plane:
    """The surface's upper side. Its height is that of the points that the camera sees on it."""
    plane = Plane.on_top_of(surface)
    cloud = np.asarray(robot.cloud(), dtype=np.float64)
    inside = [surface.beside(point) < -0.05 and abs(point[2] - plane.pose.position[2]) < NEAR for point in cloud]
    if sum(inside) < 50:
        return plane
    higher = float(np.median(cloud[inside, 2]) - plane.pose.position[2])
    return Plane(plane.pose.moved(z=higher), plane.size_m)


def stands_on(thing: Thing, plane: Plane, surface: Thing) -> bool:
    """Whether the object's foot is on the surface."""
    return surface.beside(thing.pose.position) < 0.0 and abs(thing.pose.position[2] - plane.pose.position[2]) < 2 * NEAR


def look(robot: Robot, surface: Thing, others: Sequence[Thing]) -> Report:
    """Reports the surface and the objects on it."""
    plane = upper_side(robot, surface)
    seen = [thing for thing in others if not thing.furniture and stands_on(thing, plane, surface)]
    return Report(True, f"{len(seen)} objects", perceived=seen, plane=plane)


@skill("PerceivePlane")
def perceive_plane(robot: Robot, objectSurface: str) -> Report:
    surface, others = robot.look_for(objectSurface)
    if not surface.furniture:
        raise Failed(f"{objectSurface} is not a piece of furniture")
    return look(robot, surface, others)


if __name__ == "__main__":
    serve()
