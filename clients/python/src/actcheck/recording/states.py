"""The recorded quantities of consecutive states, as arrays with one row a state.

Units: metres, radians, seconds, newtons, kilograms. Frame: world, Z up. Quaternions: x, y, z, w.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

#: Names of quantities that an episode may lack, as its metadata lists them.
LACKS = (
    "contacts",
    "contact_forces",
    "velocities",
    "joints",
    "joint_velocities",
    "joint_efforts",
    "joint_limits",
    "controls",
    "success",
    "reward",
    "masses",
    "frictions",
    "shapes",
    "robot",
)


@dataclass(frozen=True)
class Contacts:
    """The contacts of consecutive states, all in one list: `counts` has the number of contacts of each state."""

    #: Shape: states.
    counts: Integers
    #: Indices of bodies. Shape: contacts.
    first: Integers
    second: Integers
    #: Shape: contacts. Unit: newtons; 0 for a contact that does not press.
    normal_force: Array
    #: Force on `second` by `first`. Shape: contacts × 3.
    force: Array
    #: Shape: contacts × 3.
    position: Array
    #: Distance of the surfaces; negative if they overlap. Shape: contacts.
    distance: Array


@dataclass(frozen=True)
class Outcomes:
    """The environment's own verdict on each state."""

    #: Shape: states.
    reward: Array
    #: `None` for a state if the environment does not say. Length: states.
    success: list[bool | None]
    terminated: list[bool]
    truncated: list[bool]


@dataclass(frozen=True)
class States:
    """Consecutive states. `None` for a quantity that the episode lacks."""

    #: Simulated time since the first state of the episode, strictly increasing. Unit: nanoseconds. Shape: states.
    time: Integers
    #: Position and quaternion of the moving bodies. Shape: states × bodies × 7.
    poses: Array
    #: Linear and angular velocity of the moving bodies, of the body's origin. Shape: states × bodies × 6.
    velocities: Array | None = None
    #: Shape: states × joints, hinge and slide joints only.
    joint_positions: Array | None = None
    joint_velocities: Array | None = None
    joint_efforts: Array | None = None
    #: Shape: states × actuators.
    controls: Array | None = None
    contacts: Contacts | None = None
    outcomes: Outcomes | None = None


@dataclass
class OutcomeRows:
    """Outcomes that are collected state by state."""

    reward: list[float] = field(default_factory=list)
    success: list[bool | None] = field(default_factory=list)
    terminated: list[bool] = field(default_factory=list)
    truncated: list[bool] = field(default_factory=list)

    def add(self, reward: float, success: bool | None, terminated: bool, truncated: bool) -> None:
        """Adds the outcome of the next state."""
        self.reward.append(reward)
        self.success.append(success)
        self.terminated.append(terminated)
        self.truncated.append(truncated)

    def taken(self) -> Outcomes:
        """Returns the collected outcomes and begins anew."""
        outcomes = Outcomes(np.array(self.reward), self.success, self.terminated, self.truncated)
        self.reward, self.success, self.terminated, self.truncated = [], [], [], []
        return outcomes
