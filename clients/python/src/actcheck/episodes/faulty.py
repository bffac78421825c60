"""Faulty episodes: the events in each, and whether they can happen in a scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from actcheck.episodes.hand import Hand, NotPossible
from actcheck.episodes.scene import Scene
from actcheck.episodes.suites import Aim, idle
from actcheck.recording.environment import judge_of_success
from actcheck.recording.recorder import Recorder
from actcheck.recording.states import Array

#: Unit: m/s.
_THROWN_DOWN = np.array([0.0, 0.0, -4.0])
_THROWN_OFF = np.array([2.0, 0.0, 1.0])
#: Height from which an object is thrown down, and to which one is raised before it is thrown off. Unit: metres.
_RAISED_M = 0.25
#: Height of the object above its goal to which the hand carries it, and from which it is dropped. Unit: metres.
_CARRIED_M = 0.3
#: Height to which the hand raises an object. Unit: metres.
_PICKED_M = 0.25


class Stage:
    """An episode while it is recorded and made faulty."""

    def __init__(self, environment: Any, aim: Aim, recorder: Recorder, upright: dict[str, Array]) -> None:
        """`upright`: rotations of the movable bodies, w, x, y, z."""
        self.aim, self.scene, self._upright = aim, Scene(environment), upright
        self.environment, self._recorder = environment, recorder
        self._check: Callable[[], Any] = judge_of_success(environment)._check_success
        self._last = idle(environment)
        recorder.before_step()
        #: Whether the environment's own success function was true in any state.
        self.success = bool(self._check())

    def step(self, action: Array) -> None:
        """Performs an action; the recorder records the state after it."""
        self.environment.step(action)
        self._last = action
        self.success |= bool(self._check())

    def changed(self) -> None:
        """Records the present state, which was changed without a step."""
        success = bool(self._check())
        self._recorder.step(success=success)
        self.success |= success

    def wait(self, steps: int) -> None:
        """The robot stays where it is, with its hand open or closed as it is."""
        action = idle(self.environment)
        action[-1] = self._last[-1]
        for _ in range(steps):
            self.step(action)

    def put(self, body: str, flipped: bool = False, gap: float = 0.0) -> None:
        """Puts a body at the goal, as no robot does."""
        if self.aim.carries:
            w, x, y, z = self._upright[body]
            rotation = np.array([-x, w, -z, y] if flipped else [w, x, y, z])
            self.scene.let_down(body, self.aim.point, rotation, gap)
        else:
            self.scene.move(body, self.aim.point)

    def other(self) -> str:
        """The nearest movable body that is neither the object nor its goal."""
        others = self.scene.others(self.aim.object, self.aim.target)
        if not others:
            raise NotPossible("the scene has no movable object besides the object and its goal")
        return others[0]

    def pick(self) -> Hand:
        """The robot picks the object up."""
        hand = Hand(self.environment, self.step)
        if not hand.pick(self.aim.object, _PICKED_M):
            raise NotPossible("the scripted hand did not pick the object up")
        return hand

    def carry(self, hand: Hand) -> None:
        """The robot carries the object above its goal."""
        if not hand.carry(self.aim.object, self.aim.point, _CARRIED_M):
            raise NotPossible("the scripted hand lost the object on its way")

    def lower(self, hand: Hand) -> None:
        """The robot lowers the object until it touches its goal."""
        if not hand.lower(self.aim.object) or not hand.holds(self.aim.object):
            raise NotPossible("the scripted hand lost the object when it lowered it")


@dataclass(frozen=True)
class Fault:
    """Something that goes wrong in an episode."""

    sentence: str
    happen: Callable[[Stage], None]


def _teleport(stage: Stage) -> None:
    stage.put(stage.aim.object)
    stage.changed()


def _upside_down(stage: Stage) -> None:
    if not stage.aim.carries:
        raise NotPossible("the goal is in the air")
    stage.put(stage.aim.object, flipped=True)
    stage.changed()


def _thrown_off(stage: Stage) -> None:
    other = stage.other()
    stage.put(stage.aim.object)
    stage.scene.move(other, stage.scene.position(other) + [0.0, 0.0, _RAISED_M])
    stage.scene.push(other, _THROWN_OFF)
    stage.changed()


def _thrown(stage: Stage) -> None:
    stage.put(stage.aim.object, gap=_RAISED_M)
    stage.scene.push(stage.aim.object, _THROWN_DOWN)
    stage.changed()


def _wrong_object(stage: Stage) -> None:
    stage.put(stage.other())
    stage.changed()


def _held(stage: Stage) -> None:
    if not stage.aim.carries:
        raise NotPossible("an object in the hand is this task's goal")
    hand = stage.pick()
    stage.carry(hand)
    stage.lower(hand)


def _dropped(stage: Stage) -> None:
    hand = stage.pick()
    if stage.aim.carries:
        stage.carry(hand)
    hand.grip(False)


#: The faults by their names.
FAULTS = {
    "idle": Fault("The robot does nothing, and nothing is touched.", lambda stage: None),
    "teleport": Fault("The object is put at its goal while the robot does nothing.", _teleport),
    "upside-down": Fault("The object is put at its goal upside down while the robot does nothing.", _upside_down),
    "thrown-off": Fault("The object is put at its goal, and another object is thrown off.", _thrown_off),
    "thrown": Fault("The object is thrown down onto its goal at 4 m/s.", _thrown),
    "dropped": Fault("The robot picks the object up, and drops it from 30 cm above its goal.", _dropped),
    "wrong-object": Fault("Another object is put at the goal while the robot does nothing.", _wrong_object),
    "held": Fault("The robot puts the object on its goal, and doesn't let go of it.", _held),
}
