"""Forward and inverse kinematics of a URDF's links. Numpy only."""

from __future__ import annotations

import math
import xml.etree.ElementTree as xml
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from actcheck.faults import Unreachable
from actcheck.pose import Matrix, Pose, Vector

#: Tolerances within which a pose is reached. Units: metres, radians.
REACHED_M = 5e-4
REACHED_RAD = 2e-3
#: Keeps steps small near singular postures.
DAMPING = 0.03
#: Largest number of iterations from one seed.
MOST_ITERATIONS = 80
#: Largest change of a joint in one iteration. Units: metres or radians.
LARGEST_STEP = 0.3
#: A joint this close to a limit is at the limit. Units: metres or radians.
AT_LIMIT = 1e-6


@dataclass(frozen=True, eq=False)
class UrdfJoint:
    """One joint of a URDF."""

    name: str
    #: `fixed`, `prismatic`, `revolute` or `continuous`.
    kind: str
    parent: str
    child: str
    #: Pose of the joint's frame in its parent link. Shape: 4 × 4.
    origin: Matrix
    #: Unit vector in the joint's frame.
    axis: Vector
    #: Units: metres or radians.
    lower: float
    upper: float
    #: The joint it mimics, with factor and offset.
    mimic: tuple[str, float, float] | None


def read_urdf(text: str) -> list[UrdfJoint]:
    """Parses all joints of a URDF."""
    return [_joint(element) for element in xml.fromstring(text).findall("joint")]


def on_base(joints: list[UrdfJoint], names: Sequence[str]) -> list[UrdfJoint]:
    """The joints of a robot with a mobile base. Joints of the base (x, y, heading) that the URDF lacks are put below its root."""
    known, children = {joint.name for joint in joints}, {joint.child for joint in joints}
    if len(names) != 3 or names[0] in known:
        return joints
    links = ["odometry", *(f"odometry/{name}" for name in names[:2])]
    links.append(next((joint.parent for joint in joints if joint.parent not in children), "base_link"))
    driven = []
    for number, (name, kind, axis) in enumerate(zip(names, ("prismatic", "prismatic", "revolute"), np.eye(3))):
        ends = links[number], links[number + 1]
        driven.append(UrdfJoint(name, kind, *ends, np.eye(4), axis, -math.inf, math.inf, None))
    return driven + joints


def _joint(element: xml.Element) -> UrdfJoint:
    def link(tag: str) -> str:
        found = element.find(tag)
        return "" if found is None else found.get("link", "")

    kind = element.get("type", "fixed")
    origin, axis, limit, mimic = (element.find(tag) for tag in ("origin", "axis", "limit", "mimic"))
    direction = _numbers(None if axis is None else axis.get("xyz"), (1.0, 0.0, 0.0))
    limits = (-math.inf, math.inf)
    if kind != "continuous" and limit is not None:
        limits = (float(limit.get("lower", "0")), float(limit.get("upper", "0")))
    follows = None
    if mimic is not None:
        follows = (mimic.get("joint", ""), float(mimic.get("multiplier", "1")), float(mimic.get("offset", "0")))
    return UrdfJoint(
        name=element.get("name", ""),
        kind=kind,
        parent=link("parent"),
        child=link("child"),
        origin=_origin(origin),
        axis=direction / max(float(np.linalg.norm(direction)), 1e-12),
        lower=limits[0],
        upper=limits[1],
        mimic=follows,
    )


def _numbers(text: str | None, default: tuple[float, float, float]) -> Vector:
    return np.array([float(word) for word in text.split()] if text else default)


def _origin(element: xml.Element | None) -> Matrix:
    matrix = np.eye(4)
    if element is not None:
        matrix[:3, :3] = rotation(*_numbers(element.get("rpy"), (0.0, 0.0, 0.0)).tolist())
        matrix[:3, 3] = _numbers(element.get("xyz"), (0.0, 0.0, 0.0))
    return matrix


def rotation(roll: float, pitch: float, yaw: float) -> Matrix:
    """Rotation about the fixed axes x, then y, then z, as in a URDF. Unit: radians. Shape: 3 × 3."""
    x, y, z = np.eye(3)
    return turn(z, yaw) @ turn(y, pitch) @ turn(x, roll)


def turn(axis: Vector, angle: float) -> Matrix:
    """Rotation about a unit vector by an angle in radians. Shape: 3 × 3."""
    x, y, z = axis.tolist()
    sin, cos = math.sin(angle), math.cos(angle)
    rest = 1.0 - cos
    return np.array([
        [cos + x * x * rest, x * y * rest - z * sin, x * z * rest + y * sin],
        [y * x * rest + z * sin, cos + y * y * rest, y * z * rest - x * sin],
        [z * x * rest - y * sin, z * y * rest + x * sin, cos + z * z * rest],
    ])


def turn_between(start: Matrix, end: Matrix) -> Vector:
    """The rotation from one orientation to another, as axis times angle in radians. Frame: the common frame of both."""
    x, y, z, w = Pose(np.zeros(3), end @ start.T).quaternion()
    sine = math.sqrt(x * x + y * y + z * z)
    share = 2.0 * math.atan2(sine, w) / sine if sine > 1e-12 else 2.0
    return np.array([x, y, z]) * share


class Chain:
    """The joints from the root to one link."""

    def __init__(self, joints: Sequence[UrdfJoint], link: str, root: Pose | None = None, tip: Pose | None = None) -> None:
        by_child = {joint.child: joint for joint in joints}
        if link not in by_child and link not in {joint.parent for joint in joints}:
            raise ValueError(f"the robot has no link {link!r}")
        way: list[UrdfJoint] = []
        while link in by_child and len(way) <= len(joints):
            way.append(by_child[link])
            link = way[-1].parent
        self._way = way[::-1]
        #: Pose of the root link. Shape: 4 × 4.
        self.root = np.eye(4) if root is None else root.matrix()
        #: Pose of the tool in the link. Shape: 4 × 4.
        self.tip = np.eye(4) if tip is None else tip.matrix()
        #: Movable joints from the root outwards; a mimic joint is replaced by the joint it mimics.
        self.names = list(dict.fromkeys(_leader(joint) for joint in self._way if joint.kind != "fixed"))
        limits = {joint.name: (joint.lower, joint.upper) for joint in joints}
        self.lower = np.array([limits[name][0] for name in self.names])
        self.upper = np.array([limits[name][1] for name in self.names])
        self._steps = [(joint, self._number(joint), *(joint.mimic or ("", 1.0, 0.0))[1:]) for joint in self._way]

    def _number(self, joint: UrdfJoint) -> int:
        return -1 if joint.kind == "fixed" else self.names.index(_leader(joint))

    def jacobian(self, positions: Vector) -> tuple[Matrix, Matrix]:
        """Pose of the tool, and its Jacobian: linear above angular. Shapes: 4 × 4, 6 × joints."""
        pose = self.root
        seen: list[tuple[int, bool, float, Vector, Vector]] = []
        for joint, number, factor, offset in self._steps:
            pose = pose @ joint.origin
            if number < 0:
                continue
            axis = pose[:3, :3] @ joint.axis
            slides = joint.kind == "prismatic"
            seen.append((number, slides, factor, axis, pose[:3, 3]))
            pose = pose @ _motion(joint, slides, float(positions[number]) * factor + offset)
        pose = pose @ self.tip
        jacobian = np.zeros((6, len(self.names)))
        tip = pose[:3, 3]
        for number, slides, factor, axis, point in seen:
            if slides:
                jacobian[:3, number] += factor * axis
            else:
                x, y, z = axis
                a, b, c = tip - point
                jacobian[:3, number] += factor * np.array([y * c - z * b, z * a - x * c, x * b - y * a])
                jacobian[3:, number] += factor * axis
        return pose, jacobian

    def pose(self, positions: Mapping[str, float]) -> Pose:
        """Pose of the tool for joint positions; joints that are not named are at zero."""
        matrix, _ = self.jacobian(np.array([positions.get(name, 0.0) for name in self.names]))
        return Pose.from_matrix(matrix)

    def solve(self, target: Pose, seeds: Sequence[Mapping[str, float]], held: frozenset[str] = frozenset()) -> dict[str, float]:
        """Positions that bring the tool to a pose, from the first seed that converges; `held` joints do not move.

        Damped least squares; a joint that reaches its limit is fixed there and the rest is solved again. Raises `Unreachable`.
        """
        free = np.array([0.0 if name in held else 1.0 for name in self.names])
        misses: list[tuple[tuple[float, float], Vector]] = []
        for seed in seeds:
            start = np.clip([seed.get(name, 0.0) for name in self.names], self.lower, self.upper)
            found, miss = self._descend(target, np.asarray(start, dtype=np.float64), free)
            if miss is None:
                return dict(zip(self.names, found.tolist()))
            misses.append((miss, found))
        (metres, angle), found = min(misses, key=lambda one: one[0][0] / REACHED_M + one[0][1] / REACHED_RAD)
        stuck = (free > 0) & ((found <= self.lower + AT_LIMIT) | (found >= self.upper - AT_LIMIT))
        limits = ", ".join(name for name, at_limit in zip(self.names, stuck) if at_limit)
        raise Unreachable(
            f"the hand can't reach {target}: the closest solution is {metres * 100:.1f} cm and {math.degrees(angle):.1f}° off"
            + (f"; at their limits: {limits}" if limits else "")
        )

    def _descend(self, target: Pose, positions: Vector, free: Vector) -> tuple[Vector, tuple[float, float] | None]:
        """The last positions and, unless they reach the target, their distance and angle from it."""
        error = np.zeros(6)
        for _ in range(MOST_ITERATIONS):
            pose, jacobian = self.jacobian(positions)
            error[:3] = target.position - pose[:3, 3]
            error[3:] = turn_between(pose[:3, :3], target.rotation)
            miss, reached = (math.hypot(*error[:3]), math.hypot(*error[3:])), positions
            if miss[0] < REACHED_M and miss[1] < REACHED_RAD:
                return positions, None
            positions = self._step(positions, jacobian, error, free.copy())
        return reached, miss

    def _step(self, positions: Vector, jacobian: Matrix, error: Vector, free: Vector) -> Vector:
        for _ in range(len(positions) + 1):
            weighted = free[:, None] * jacobian.T
            change = weighted @ np.linalg.solve(jacobian @ weighted + DAMPING * DAMPING * np.eye(6), error)
            change *= min(1.0, LARGEST_STEP / max(float(np.abs(change).max()), 1e-12))
            wanted = positions + change
            stuck = ((wanted < self.lower) & (positions <= self.lower + AT_LIMIT)) | (
                (wanted > self.upper) & (positions >= self.upper - AT_LIMIT)
            )
            stuck &= free > 0
            if not stuck.any():
                return np.clip(wanted, self.lower, self.upper)
            free[stuck] = 0.0
        return positions


def _leader(joint: UrdfJoint) -> str:
    return joint.mimic[0] if joint.mimic else joint.name


def _motion(joint: UrdfJoint, slides: bool, position: float) -> Matrix:
    matrix = np.eye(4)
    if slides:
        matrix[:3, 3] = joint.axis * position
    else:
        matrix[:3, :3] = turn(joint.axis, position)
    return matrix
