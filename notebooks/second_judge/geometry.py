"""Poses, and distances from a point to shapes. Unit: metres and radians."""

from dataclasses import dataclass

import numpy as np


@dataclass
class Pose:
    """Position, and rotation as a unit quaternion (x, y, z, w)."""

    position: np.ndarray
    rotation: np.ndarray

    def matrix(self):
        """The rotation matrix: its columns are the axes."""
        x, y, z, w = self.rotation
        return np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )

    def to_local(self, point):
        return self.matrix().T @ (point - self.position)

    def to_world(self, point):
        return self.matrix() @ point + self.position

    def yaw(self):
        """Angle of the x axis about the vertical."""
        x_axis = self.matrix()[:, 0]
        return np.arctan2(x_axis[1], x_axis[0])

    def tilt(self):
        """Angle between the z axis and the vertical."""
        return np.arccos(np.clip(self.matrix()[2, 2], -1.0, 1.0))


def turn(angle):
    """The rotation of the plane by an angle."""
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def wrapped(angle):
    """The angle in [-π, π)."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


@dataclass
class Part:
    """One convex part of a body, or a tube; see the table `shapes`."""

    shape: str
    pose: Pose
    size: np.ndarray
    tube: np.ndarray
    staves: int | None
    points: np.ndarray | None

    def distance(self, point):
        """Distance of a point, in the body's frame, to the part's surface; negative inside."""
        point = self.pose.to_local(point)
        radius, radius_high, wall = self.tube
        if self.shape == "box":
            return box_distance(point, self.size / 2)
        if self.shape == "sphere":
            return np.linalg.norm(point) - radius
        if self.shape == "capsule":
            end = np.array([0.0, 0.0, np.clip(point[2], -self.size[2] / 2, self.size[2] / 2)])
            return np.linalg.norm(point - end) - radius
        if self.shape == "cylinder":
            return box_distance(np.array([np.hypot(*point[:2]), point[2]]), np.array([radius, self.size[2] / 2]))
        if self.shape == "tube":
            return min(box_distance(pose.to_local(point), half) for pose, half in staves(self))
        return hull_distance(point, self.points)

    def is_exact(self):
        """Whether the export has the whole shape: a hull is reduced to its outermost points."""
        return self.shape != "hull"


def surface_distance(parts, body_pose, point):
    """Distance of a point in the world to the surface of a body; negative inside."""
    local = body_pose.to_local(point)
    return min(part.distance(local) for part in parts)


def box_distance(point, half):
    """Distance to an axis-parallel box around the origin; negative inside."""
    beyond = np.abs(point) - half
    return np.linalg.norm(np.maximum(beyond, 0.0)) + min(beyond.max(), 0.0)


def staves(tube):
    """The boxes of a tube's wall, as the simulation builds it: poses, and half sizes."""
    low, high, wall = tube.tube
    height, half_angle = tube.size[2], np.pi / tube.staves
    slant, middle = np.arctan2(high - low, height), (low + high) / 2
    half = np.array([wall, 2 * middle * np.sin(half_angle), height / np.cos(slant)]) / 2
    reach = middle * np.cos(half_angle) - wall / 2
    for number in range(tube.staves):
        angle = 2 * half_angle * number
        lean = np.array([0.0, np.sin(slant / 2), 0.0, np.cos(slant / 2)])
        around = np.array([0.0, 0.0, np.sin(angle / 2), np.cos(angle / 2)])
        centre = np.array([reach * np.cos(angle), reach * np.sin(angle), 0.0])
        yield Pose(centre, product(around, lean)), half


def product(first, second):
    """The rotation by `second`, then by `first`."""
    (a, b), (w, v) = (first[:3], second[:3]), (first[3], second[3])
    return np.append(w * b + v * a + np.cross(a, b), w * v - a @ b)


def hull_distance(point, corners, rounds=1000):
    """Distance to the convex hull of points, by Gilbert's algorithm; 0 inside."""
    nearest = corners[np.argmin(np.linalg.norm(corners - point, axis=1))]
    for _ in range(rounds):
        away = nearest - point
        corner = corners[np.argmin(corners @ away)]
        gain = away @ (nearest - corner)
        if gain < 1e-10:
            break
        along = corner - nearest
        nearest = nearest + np.clip(gain / (along @ along), 0.0, 1.0) * along
    return np.linalg.norm(nearest - point)
