"""A scripted hand: picks an object up from above and carries it, with robosuite's controller for positions of the hand (OSC_POSE)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from actcheck.episodes.scene import ROBOT, Scene
from actcheck.episodes.suites import idle
from actcheck.recording.states import Array

#: Motion of the hand for an action of 1. Unit: metres.
_ACTION_M = 0.05
#: The hand has arrived at a point when it is nearer. Unit: metres.
_ARRIVED_M = 0.008
#: Largest action while it carries something, so that nothing slips.
_CAREFULLY = 0.6
#: The hand stalls when it comes no nearer for so many steps.
_STALLED_STEPS = 12
_PROGRESS_M = 0.001
#: Action with which it lowers something: 1.5 cm a step.
_SLOWLY = 0.3
_STEPS_OF_A_DESCENT = 150
_STEPS_OF_A_GRASP = 12
#: Depths of the fingertips below an object's top that are tried, from the deepest to the shallowest. Unit: metres.
_DEPTHS_M = (0.035, 0.025, 0.015, 0.008)
#: Distance from the point between the fingertips to their lower ends. Unit: metres.
_FINGERTIP_M = 0.012
#: Distances from the object's middle at which the fingers are tried, in the direction in which they close. Unit: metres.
_OFFSETS_M = sorted(np.arange(-0.12, 0.121, 0.004).tolist(), key=abs)


class NotPossible(Exception):
    """Something can't happen in a scene; the text says why."""


class Hand:
    """The hand of a robosuite or LIBERO environment with one Panda."""

    def __init__(self, environment: Any, step: Callable[[Array], None]) -> None:
        """`step` performs an action. Raises `NotPossible` if the robot has another gripper."""
        self._environment, self._step = environment, step
        self.scene = Scene(environment)
        model = self.scene.model
        sites = [str(model.site(at).name) for at in range(model.nsite)]
        names = [str(model.body(at).name) for at in range(model.nbody)]
        joints = [str(model.joint(at).name) for at in range(model.njnt)]
        self._grip = _named(sites, "grip_site")
        self._fingers = [_named(names, f"finger_joint{side}_tip") for side in (1, 2)]
        self._joints = [joints.index(_named(joints, f"finger_joint{side}")) for side in (1, 2)]
        self._closed = False

    @property
    def position(self) -> Array:
        """The point between the fingertips. Unit: metres. Frame: world."""
        return np.array(self.scene.data.site(self._grip).xpos)

    def move(self, point: Array) -> bool:
        """Moves to a point, until the hand arrives or stalls. Returns whether it arrived."""
        nearest, since = np.inf, 0
        while since < _STALLED_STEPS:
            way = point - self.position
            left = float(np.linalg.norm(way))
            if left < _ARRIVED_M:
                return True
            since = 0 if left < nearest - _PROGRESS_M else since + 1
            nearest = min(left, nearest)
            most = _CAREFULLY if self._closed else 1.0
            self._act(np.clip(way / _ACTION_M, -most, most))
        return False

    def grip(self, closed: bool) -> None:
        """Closes or opens the fingers."""
        self._closed = closed
        self.wait(_STEPS_OF_A_GRASP)

    def wait(self, steps: int) -> None:
        """Stays where it is."""
        for _ in range(steps):
            self._act(np.zeros(3))

    def pick(self, body: str, rise: float) -> bool:
        """Picks a body up and raises it. Returns whether both fingers hold it then."""
        grasp = self._grasp(body)
        if grasp is None:
            return False
        above = np.array([grasp[0], grasp[1], max(self.position[2], grasp[2] + 0.1)])
        self.grip(False)
        self.move(above)
        self.move(grasp)
        self.grip(True)
        self.move(grasp + [0.0, 0.0, rise])
        return self.holds(body)

    def carry(self, body: str, point: Array, height: float) -> bool:
        """Carries the held body until the middle of its box is above a point, and its lowest point `height` metres above it."""
        for _ in range(3):
            low, _ = self.scene.box(body)
            middle = self.scene.middle(body)
            self.move(self.position + [point[0] - middle[0], point[1] - middle[1], point[2] + height - low[2]])
        return self.holds(body)

    def lower(self, body: str) -> bool:
        """Lowers the held body slowly until it touches something. Returns whether it does."""
        for _ in range(_STEPS_OF_A_DESCENT):
            if any(not name.startswith(ROBOT) for name in self.scene.touches(body)):
                return True
            self._act(np.array([0.0, 0.0, -_SLOWLY]))
        return False

    def holds(self, body: str) -> bool:
        """Whether both fingers touch a body."""
        return self._touching(body) >= {0, 1}

    def _act(self, way: Array) -> None:
        action = idle(self._environment)
        action[:3] = way
        action[-1] = 1.0 if self._closed else -1.0
        self._step(action)

    def _touching(self, body: str) -> set[int]:
        touches = self.scene.touches(body)
        return {side for side, tip in enumerate(self._fingers) if touches & {tip, self._carrier(tip)}}

    def _carrier(self, tip: str) -> str:
        model = self.scene.model
        return str(model.body(int(model.body(tip).parentid[0])).name)

    def _grasp(self, body: str) -> Array | None:
        """Returns a pose in which the open fingers touch nothing and the closed ones touch the body from both sides; `None` if there is none.

        The robot's present posture is moved as a whole: the object is tried at the places relative to the hand instead.
        """
        scene = self.scene
        saved = scene.data.qpos.copy(), scene.data.qvel.copy()
        across = scene.position(self._fingers[0]) - scene.position(self._fingers[1])
        across[2] = 0.0
        across /= np.linalg.norm(across)
        at, middle = scene.position(body), scene.middle(body)
        bottom, top = (float(corner[2]) for corner in scene.box(body))
        hand = self.position
        found = None
        for depth in _DEPTHS_M:
            for offset in _OFFSETS_M:
                grasp = np.array([*(middle[:2] + offset * across[:2]), max(top - depth, bottom + _FINGERTIP_M)])
                scene.move(body, at + hand - grasp)
                if self._fits(body):
                    found = grasp
                    break
            if found is not None:
                break
        scene.data.qpos[:], scene.data.qvel[:] = saved
        scene.push(body, np.zeros(3))
        return found

    def _fits(self, body: str) -> bool:
        model, data = self.scene.model, self.scene.data
        for closed in (False, True):
            for joint in self._joints:
                limits = model.jnt_range[joint]
                data.qpos[model.jnt_qposadr[joint]] = limits[np.abs(limits).argmin() if closed else np.abs(limits).argmax()]
            self.scene.push(body, np.zeros(3))
            touches = self.scene.touches(body)
            if closed:
                return self._touching(body) == {0, 1}
            if any(name.startswith(ROBOT) for name in touches):
                return False
        return False


def _named(names: list[str], ending: str) -> str:
    """The name of a part of the gripper, in robosuite 1.4 or 1.5."""
    for name in names:
        if name.startswith("gripper0_") and name.endswith(ending):
            return name
    raise NotPossible("the robot has no Panda's gripper")
