"""Poses: positions with orientations."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from actcheck.limits import LARGEST_ANGLE, LARGEST_HEADING, within

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Pose:
    """A position and an orientation. Frame: world, as the robot believes it, unless stated otherwise."""

    #: Shape: 3. Unit: metres.
    position: Vector
    #: Rotation matrix; its columns are the pose's x, y and z axes. Shape: 3 × 3.
    rotation: Matrix

    @classmethod
    def upright(cls, position: ArrayLike, yaw: float = 0.0) -> Pose:
        """A pose at a position with a yaw in radians."""
        within("the yaw", yaw, (-LARGEST_HEADING, LARGEST_HEADING), "rad")
        sin, cos = math.sin(yaw), math.cos(yaw)
        rotation = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        return cls(np.asarray(position, dtype=np.float64), rotation)

    @classmethod
    def pointing(cls, position: ArrayLike, heading: float, down: float = 0.0) -> Pose:
        """A pose whose x axis has a heading and a downward angle; its y axis is horizontal, to the left. Units: radians.

        Suits a hand whose fingers point along x and are side by side along y; `down=math.pi / 2` points straight down.
        """
        within("the heading", heading, (-LARGEST_HEADING, LARGEST_HEADING), "rad")
        within("the angle down", down, (-LARGEST_ANGLE, LARGEST_ANGLE), "rad")
        sin, cos = math.sin(heading), math.cos(heading)
        forward = np.array([cos * math.cos(down), sin * math.cos(down), -math.sin(down)])
        left = np.array([-sin, cos, 0.0])
        return cls(np.asarray(position, dtype=np.float64), np.column_stack([forward, left, np.cross(forward, left)]))

    @classmethod
    def from_wire(cls, sent: dict[str, Any]) -> Pose:
        """Converts the protocol's position and quaternion."""
        x, y, z, w = (float(value) for value in sent["quaternion_xyzw"])
        rotation = np.array([
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ])
        return cls(np.array(sent["position_m"], dtype=np.float64), rotation)

    @classmethod
    def from_matrix(cls, matrix: Matrix) -> Pose:
        """Converts a homogeneous matrix. Shape: 4 × 4."""
        return cls(matrix[:3, 3].copy(), matrix[:3, :3].copy())

    def matrix(self) -> Matrix:
        """Converts to a homogeneous matrix. Shape: 4 × 4."""
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = self.rotation, self.position
        return matrix

    def to_wire(self) -> dict[str, Any]:
        """Converts to the protocol's position and quaternion."""
        return {"position_m": self.position.tolist(), "quaternion_xyzw": list(self.quaternion())}

    def quaternion(self) -> tuple[float, float, float, float]:
        """The rotation as a quaternion x, y, z, w with w ≥ 0."""
        # Compute the largest component from the diagonal and the others from it: numerically stable for every angle.
        r = self.rotation
        trace = [r[0, 0] - r[1, 1] - r[2, 2], r[1, 1] - r[0, 0] - r[2, 2], r[2, 2] - r[0, 0] - r[1, 1], np.trace(r)]
        largest = int(np.argmax(trace))
        twice = math.sqrt(max(0.0, 1.0 + float(trace[largest])))
        q = np.zeros(4)
        q[largest] = twice / 2
        if largest == 3:
            q[:3] = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]]) / (2 * twice)
        else:
            i, j, k = largest, (largest + 1) % 3, (largest + 2) % 3
            q[j], q[k] = (r[j, i] + r[i, j]) / (2 * twice), (r[k, i] + r[i, k]) / (2 * twice)
            q[3] = (r[k, j] - r[j, k]) / (2 * twice)
        if q[3] < 0:
            q = -q
        return float(q[0]), float(q[1]), float(q[2]), float(q[3])

    @property
    def yaw(self) -> float:
        """Heading of its x axis, seen from above. Unit: radians."""
        return math.atan2(self.rotation[1, 0], self.rotation[0, 0])

    @property
    def across(self) -> float:
        """Heading of its y axis, seen from above. Unit: radians."""
        return math.atan2(self.rotation[1, 1], self.rotation[0, 1])

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Pose:
        """The pose translated along the world's axes. Unit: metres."""
        return Pose(self.position + np.array([x, y, z]), self.rotation)

    def ahead(self, metres: float) -> Pose:
        """The pose translated along its own x axis."""
        return Pose(self.position + self.rotation[:, 0] * metres, self.rotation)

    def __str__(self) -> str:
        return f"({', '.join(f'{value:.2f}' for value in self.position)})"

    def __mul__(self, inner: Pose) -> Pose:
        return Pose(self.position + self.rotation @ inner.position, self.rotation @ inner.rotation)

    def inverse(self) -> Pose:
        """The inverse pose."""
        return Pose(-self.rotation.T @ self.position, self.rotation.T)


def wrapped(angle: float) -> float:
    """Wraps an angle to [−π, π]. Unit: radians."""
    return math.remainder(angle, math.tau)
