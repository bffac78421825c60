"""An action as a reinforcement-learning environment with `reset` and `step` (the interface of gymnasium)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from actcheck.faults import Aborted, Closed
from actcheck.messages import Held, Plane, Report, Thing
from actcheck.pose import Vector
from actcheck.robot import Robot
from actcheck.session import Session
from actcheck.wire import Wire

Info = dict[str, Any]

BETWEEN = "no episode is in progress: call `reset` first"


@dataclass(frozen=True, eq=False)
class Box:
    """A range of vectors, like gymnasium's `Box`."""

    low: Vector
    high: Vector

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of each vector."""
        return self.low.shape

    @property
    def dtype(self) -> np.dtype[np.float64]:
        """Type of the vectors' elements."""
        return self.low.dtype

    def contains(self, value: NDArray[Any]) -> bool:
        """Whether a vector is in the range."""
        return value.shape == self.shape and bool(np.all((self.low <= value) & (value <= self.high)))

    def sample(self, generator: np.random.Generator) -> Vector:
        """A uniformly distributed vector. The range must be bounded."""
        return generator.uniform(self.low, self.high)


def measured(robot: Robot) -> Vector:
    """Positions and velocities of all joints, then the gap between the fingers and their force."""
    seen = robot.observe()
    return np.concatenate([seen.positions, seen.velocities, [seen.opening_m, seen.force_n]])


def nothing(_robot: Robot) -> float:
    """The default reward, always 0: success is judged by the simulation."""
    return 0.0


class ActionEnv:
    """One action, repeated: each episode performs it in another scene of the campaign.

    The components of a step's vector range from −1 to 1: the velocity of each arm joint as a share of its limit; for a mobile
    base, likewise its velocity forwards, left and turning; the gap between the fingers, from closed to wide open.

    `observe` computes an observation from the robot, `reward` a reward; `ticks` is the number of control ticks per step.
    """

    def __init__(
        self,
        action: str,
        *,
        observe: Callable[[Robot], Vector] = measured,
        reward: Callable[[Robot], float] = nothing,
        ticks: int = 6,
        session: Session | None = None,
    ) -> None:
        self._session = session or Session(Wire.from_environment(), Path(__file__).stem, [action])
        self._observe, self._reward, self._ticks = observe, reward, ticks
        self._robot: Robot | None = None
        self._last: Vector = np.zeros(0)
        robot = self._session.description
        speeds = {joint.name: joint.velocity for joint in robot.joints}
        limits = {joint.name: (joint.lower, joint.upper) for joint in robot.joints}
        self._arm = [(name, speeds[name], *limits[name]) for name in robot.arm_joints]
        self._drive = [speeds[name] for name in robot.base_joints]
        length = len(self._arm) + len(self._drive) + 1
        self.action_space = Box(-np.ones(length), np.ones(length))
        wide = np.full(2 * len(robot.joints) + 2, np.inf)
        #: Space of the default observation; `None` with a custom `observe`.
        self.observation_space = Box(-wide, wide) if observe is measured else None

    @property
    def robot(self) -> Robot:
        """The robot of the episode, for direct access. Raises `RuntimeError` between episodes."""
        if self._robot is None:
            raise RuntimeError(BETWEEN)
        return self._robot

    def reset(self, *, seed: int | None = None, options: Info | None = None) -> tuple[Vector, Info]:
        """Waits for the next scene. Raises `Closed` when the campaign has no more.

        Scenes come from the campaign's seed: `seed` and `options` exist for compatibility with gymnasium and must be `None`.
        """
        if seed is not None or options:
            raise ValueError("`reset` takes no seed or options: set `seed` in the campaign's configuration")
        if self._robot is not None:
            self.end(False, "the next episode was begun")
        call = self._session.next_call()
        if call is None:
            raise Closed("the campaign is over")
        self._robot = Robot(self._session, call)
        self._last = self._observe(self._robot)
        return self._last, {"action": call.action, "parameters": dict(call.parameters), "run": call.run, "seed": call.seed}

    def step(self, action: NDArray[Any]) -> tuple[Vector, float, bool, bool, Info]:
        """Performs one step. Returns observation, reward, terminated (always false), truncated (by actcheck), and info."""
        robot = self.robot
        shares = np.clip(np.asarray(action, dtype=np.float64), -1.0, 1.0)
        if shares.shape != self.action_space.shape or not np.isfinite(shares).all():
            raise ValueError(f"an action must have {self.action_space.shape[0]} finite numbers")
        seconds = self._ticks * robot.tick_s
        positions = {
            name: min(max(robot.commanded[name] + float(share) * speed * seconds, lower), upper)
            for share, (name, speed, lower, upper) in zip(shares, self._arm)
        }
        drive = [float(share) * speed for share, speed in zip(shares[len(self._arm) :], self._drive)]
        opening = float(shares[-1] + 1.0) / 2.0 * robot.description.max_opening_m
        try:
            robot.step(positions, base_velocity=drive or None, gripper=opening, ticks=self._ticks)
        except Aborted as aborted:
            self._robot = None
            return self._last, 0.0, False, True, {"aborted": aborted.reason}
        self._last = self._observe(robot)
        return self._last, float(self._reward(robot)), False, False, {}

    def end(
        self,
        succeeded: bool,
        message: str = "",
        perceived: Sequence[Thing] = (),
        plane: Plane | None = None,
        held: Held | None = None,
    ) -> None:
        """Ends the episode with the action's own report. The report and the rules decide the verdict."""
        if self._robot is None:
            raise RuntimeError(BETWEEN)
        self._robot = None
        self._session.end(Report(succeeded, message, perceived, plane, held))

    def close(self) -> None:
        """Closes the connection."""
        self._session.close()
