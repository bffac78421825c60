"""Moves the objects of a MuJoCo scene as no robot does: to a place, upside down, with a velocity."""

from __future__ import annotations

from typing import Any

import numpy as np

from actcheck.recording.environment import simulation
from actcheck.recording.states import Array

#: Height above a place from which an object is let down. Unit: metres.
_ABOVE_M = 0.4
#: Distance by which it is let down at once. Unit: metres.
_STEP_M = 0.002
#: Objects farther from another one are not in the scene: robosuite puts unused ones 10 m away. Unit: metres.
_IN_SCENE_M = 3.0
#: How the names of a robot's bodies begin in robosuite and LIBERO.
ROBOT = ("robot0_", "gripper0_")


class Scene:
    """The present simulation of an environment."""

    def __init__(self, environment: Any) -> None:
        import mujoco

        found = simulation(environment)
        self._mujoco, self.model, self.data = mujoco, found.model, found.data

    def position(self, body: str) -> Array:
        """Position of a body. Unit: metres. Frame: world."""
        return np.array(self.data.body(body).xpos)

    def movable(self) -> list[str]:
        """Names of the bodies that are free to move, in the order of the model."""
        joints = self.model.jnt_type == self._mujoco.mjtJoint.mjJNT_FREE
        return [str(self.model.body(int(body)).name) for body in self.model.jnt_bodyid[joints]]

    def fastest(self) -> float:
        """Speed of the fastest movable body. Unit: m/s."""
        speeds = [float(np.linalg.norm(self.data.qvel[at : at + 3])) for at in map(self._velocity, self.movable())]
        return max(speeds, default=0.0)

    def others(self, body: str, target: str) -> list[str]:
        """The movable bodies in the scene other than two, from the nearest to the first one to the farthest."""
        at = self.position(body)
        away = {name: float(np.linalg.norm(self.position(name) - at)) for name in self.movable() if name not in (body, self._free_root(target))}
        return sorted((name for name in away if away[name] < _IN_SCENE_M), key=lambda name: away[name])

    def _free_root(self, body: str) -> str:
        """The body at the root of the tree that a body belongs to."""
        return str(self.model.body(int(self.model.body(body).rootid[0])).name)

    def move(self, body: str, position: Array, rotation: Array | None = None) -> None:
        """Moves a movable body, at rest. `rotation`: w, x, y, z; `None` keeps it."""
        pose = self._pose(body)
        pose[:3] = position
        if rotation is not None:
            pose[3:] = rotation
        self.push(body, np.zeros(3))

    def push(self, body: str, velocity: Array) -> None:
        """Gives a movable body a velocity without rotation. Unit: m/s. Frame: world."""
        at = self._velocity(body)
        self.data.qvel[at : at + 6] = [*velocity, 0.0, 0.0, 0.0]
        self._mujoco.mj_forward(self.model, self.data)

    def rotations(self) -> dict[str, Array]:
        """The rotations of the movable bodies: w, x, y, z."""
        return {body: self._pose(body)[3:].copy() for body in self.movable()}

    def let_down(self, body: str, point: Array, rotation: Array, gap: float = 0.0) -> None:
        """Puts a movable body above a point, `gap` metres above the height where it first touches something."""
        # A rotation moves a body's shapes about its origin: its middle is to be above the point.
        self.move(body, point, rotation)
        beside = self.middle(body) - self.position(body)
        highest = np.array([point[0] - beside[0], point[1] - beside[1], point[2] + _ABOVE_M])
        for step in range(int(2 * _ABOVE_M / _STEP_M)):
            self.move(body, highest - [0.0, 0.0, step * _STEP_M])
            if any(not name.startswith(ROBOT) for name in self.touches(body)):
                break
        self.move(body, highest - [0.0, 0.0, (step - 1) * _STEP_M - gap])

    def touches(self, body: str) -> set[str]:
        """Names of the bodies that touch a body or those that it carries."""
        own = self._joint(body)
        root = self.model.jnt_bodyid[own]
        tree = set(np.flatnonzero(self.model.body_rootid == root).tolist())
        found = set()
        for pair in self.model.geom_bodyid[self.data.contact.geom].tolist():
            inside = [side for side in pair if side in tree]
            if len(inside) == 1:
                found.add(str(self.model.body(pair[0] if pair[1] in tree else pair[1]).name))
        return found

    def box(self, body: str) -> tuple[Array, Array]:
        """The box around the colliding shapes of a body and those that it carries. Unit: metres. Frame: world."""
        model, data = self.model, self.data
        root = int(model.body(body).id)
        tree = [at for at in range(model.nbody) if self._is_below(at, root)]
        geoms = [at for at in np.flatnonzero(np.isin(model.geom_bodyid, tree)) if model.geom_contype[at] or model.geom_conaffinity[at]]
        middle, half = model.geom_aabb[geoms, :3], model.geom_aabb[geoms, 3:]
        turn = data.geom_xmat[geoms].reshape(-1, 3, 3)
        centre = data.geom_xpos[geoms] + np.einsum("gij,gj->gi", turn, middle)
        reach = np.einsum("gij,gj->gi", np.abs(turn), half)
        return np.asarray((centre - reach).min(0)), np.asarray((centre + reach).max(0))

    def middle(self, body: str) -> Array:
        """Middle of the box around a body."""
        low, high = self.box(body)
        return np.asarray((low + high) / 2)

    def top(self, body: str) -> Array:
        """Middle of the upper side of the box around a body."""
        return np.array([*self.middle(body)[:2], self.box(body)[1][2]])

    def _is_below(self, body: int, root: int) -> bool:
        while body > root:
            body = int(self.model.body_parentid[body])
        return body == root

    def _joint(self, body: str) -> int:
        return int(self.model.body(body).jntadr[0])

    def _velocity(self, body: str) -> int:
        """Index of a movable body's velocity in the generalised velocities."""
        return int(self.model.jnt_dofadr[self._joint(body)])

    def _pose(self, body: str) -> Array:
        at = int(self.model.jnt_qposadr[self._joint(body)])
        view: Array = self.data.qpos[at : at + 7]
        return view
