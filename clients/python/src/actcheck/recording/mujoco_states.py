"""Reads states of a MuJoCo simulation without changing it.

After an environment's step MuJoCo's derived quantities belong to the state before the last integration. `Observer` therefore sets
copies of the state in data of its own and computes poses, contacts and forces there.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from actcheck.recording.mujoco_model import column_joints, moving_bodies, xyzw
from actcheck.recording.states import Array, Contacts, States

_ELLIPTIC = 1


@dataclass
class _Rows:
    """Copies of MuJoCo's arrays, one entry a state."""

    time: list[int] = field(default_factory=list)
    position: list[Array] = field(default_factory=list)
    rotation: list[Array] = field(default_factory=list)
    velocity: list[Array] = field(default_factory=list)
    centre: list[Array] = field(default_factory=list)
    qpos: list[Array] = field(default_factory=list)
    qvel: list[Array] = field(default_factory=list)
    effort: list[Array] = field(default_factory=list)
    controls: list[Array] = field(default_factory=list)
    contacts: list[int] = field(default_factory=list)
    geoms: list[NDArray[np.int32]] = field(default_factory=list)
    frame: list[Array] = field(default_factory=list)
    place: list[Array] = field(default_factory=list)
    distance: list[Array] = field(default_factory=list)
    #: Index of a contact's first number in the solver's forces; negative if it does not press.
    address: list[NDArray[np.int32]] = field(default_factory=list)
    dimension: list[NDArray[np.int32]] = field(default_factory=list)
    friction: list[Array] = field(default_factory=list)
    solved: list[Array] = field(default_factory=list)


class Observer:
    """Collects states of one model and returns them as arrays."""

    def __init__(self, model: Any, *, driven: bool = True) -> None:
        """`driven`: whether controls are known; without them neither controls nor joint efforts are returned."""
        import mujoco

        self._mujoco, self._model, self._driven = mujoco, model, driven
        self.data = mujoco.MjData(model)
        self._signature = int(mujoco.mjtState.mjSTATE_INTEGRATION)
        self._state_size = mujoco.mj_stateSize(model, self._signature)
        self._moving, self._joints = moving_bodies(model), column_joints(model)
        self._roots = model.body_rootid[self._moving]
        self._positions, self._dofs = model.jnt_qposadr[self._joints], model.jnt_dofadr[self._joints]
        self._body_of = model.geom_bodyid.astype(np.int64)
        self._elliptic = model.opt.cone == _ELLIPTIC
        self._rows = _Rows()

    def __len__(self) -> int:
        return len(self._rows.time)

    def snapshot(self, data: Any) -> Array:
        """The state of a simulation, from which all else follows; shape: MuJoCo's integration state."""
        state = np.empty(self._state_size)
        self._mujoco.mj_getState(self._model, data, state, self._signature)
        return state

    def restore(self, state: Array) -> None:
        """Sets a snapshot and computes the quantities that follow from it."""
        self._mujoco.mj_setState(self._model, self.data, state, self._signature)
        self.compute()

    def set(self, positions: Array, velocities: Array) -> None:
        """Sets generalised positions and velocities and computes the quantities that follow from them."""
        self.data.qpos[:], self.data.qvel[:] = positions, velocities
        self.compute()

    def compute(self) -> None:
        """Computes poses, contacts and forces of the state in `data`; sensors are left out."""
        self._mujoco.mj_forwardSkip(self._model, self.data, 0, 1)

    def take(self, time: int) -> None:
        """Adds the computed state. Unit of `time`: nanoseconds since the first state."""
        rows, data = self._rows, self.data
        rows.time.append(time)
        rows.position.append(data.xpos.copy())
        rows.rotation.append(data.xquat.copy())
        rows.velocity.append(data.cvel.copy())
        rows.centre.append(data.subtree_com.copy())
        rows.qpos.append(data.qpos.copy())
        rows.qvel.append(data.qvel.copy())
        if self._driven:
            rows.effort.append(data.qfrc_actuator.copy())
            rows.controls.append(data.ctrl.copy())
        self._take_contacts()

    def _take_contacts(self) -> None:
        rows, data = self._rows, self.data
        count = data.ncon
        rows.contacts.append(count)
        if count:
            contact = data.contact
            rows.geoms.append(contact.geom.copy())
            rows.frame.append(contact.frame.copy())
            rows.place.append(contact.pos.copy())
            rows.distance.append(contact.dist.copy())
            rows.address.append(contact.efc_address.copy())
            rows.dimension.append(contact.dim.copy())
            rows.solved.append(data.efc_force.copy())
            if not self._elliptic:
                rows.friction.append(contact.friction.copy())

    def states(self) -> States:
        """Returns the collected states and begins anew."""
        rows, self._rows = self._rows, _Rows()
        position = np.array(rows.position)
        moving = position[:, self._moving]
        return States(
            time=np.array(rows.time, np.int64),
            poses=np.concatenate([moving, xyzw(np.array(rows.rotation)[:, self._moving])], 2),
            velocities=self._velocities(rows, moving),
            joint_positions=np.array(rows.qpos)[:, self._positions],
            joint_velocities=np.array(rows.qvel)[:, self._dofs],
            joint_efforts=np.array(rows.effort)[:, self._dofs] if self._driven else None,
            controls=np.array(rows.controls) if self._driven else None,
            contacts=self._contacts(rows),
        )

    def _velocities(self, rows: _Rows, position: Array) -> Array:
        """Linear and angular velocities of the bodies' origins, from those at the centre of mass of each kinematic tree."""
        velocity = np.array(rows.velocity)[:, self._moving]
        turn, at_centre = velocity[..., :3], velocity[..., 3:]
        arm = position - np.array(rows.centre)[:, self._roots]
        return np.concatenate([at_centre + _cross(turn, arm), turn], 2)

    def _contacts(self, rows: _Rows) -> Contacts:
        counts = np.array(rows.contacts, np.int64)
        if not counts.sum():
            none, empty = np.zeros(0), np.zeros(0, np.int64)
            return Contacts(counts, empty, empty, none, np.zeros((0, 3)), np.zeros((0, 3)), none)
        geoms, force = np.concatenate(rows.geoms), self._forces(rows)
        frame = np.concatenate(rows.frame).reshape(-1, 3, 3)
        place, distance = np.concatenate(rows.place), np.concatenate(rows.distance)
        # A soft body has no index of a rigid body.
        rigid = (geoms >= 0).all(1)
        if not rigid.all():
            state = np.repeat(np.arange(len(counts)), counts)[rigid]
            counts = np.bincount(state, minlength=len(counts))
            geoms, force, frame, place, distance = geoms[rigid], force[rigid], frame[rigid], place[rigid], distance[rigid]
        bodies = self._body_of[geoms]
        in_world = (frame * force[:, :, None]).sum(1)
        return Contacts(counts, bodies[:, 0], bodies[:, 1], force[:, 0].copy(), in_world, place, distance)

    def _forces(self, rows: _Rows) -> Array:
        """Forces of the contacts in their own frames: normal, two tangents. Shape: contacts × 3."""
        address, dimensions = np.concatenate(rows.address).astype(np.int64), np.concatenate(rows.dimension)
        solved = np.concatenate(rows.solved)
        forces = np.zeros((len(address), 3))
        pressing = address >= 0
        begins = np.cumsum([0] + [len(values) for values in rows.solved[:-1]])
        address += np.repeat(begins, [len(values) for values in rows.address])
        if self._elliptic:
            forces[pressing, 0] = solved[address[pressing]]
            rubbing = pressing & (dimensions >= 3)
            for axis in (1, 2):
                forces[rubbing, axis] = solved[address[rubbing] + axis]
            return forces
        friction = np.concatenate(rows.friction)
        for dimension in np.unique(dimensions[pressing]).tolist():
            chosen = pressing & (dimensions == dimension)
            forces[chosen] = _pyramid(solved, address[chosen], dimension, friction[chosen])
        return forces


def _cross(first: Array, second: Array) -> Array:
    """Cross products along the last axis; faster than numpy's for small arrays."""
    a, b = np.moveaxis(first, -1, 0), np.moveaxis(second, -1, 0)
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]], -1)


def _pyramid(solved: Array, address: NDArray[np.int64], dimension: int, friction: Array) -> Array:
    """Normal and tangential forces of contacts with pyramidal friction cones: pairs of edges, one pair a tangent."""
    forces = np.zeros((len(address), 3))
    if dimension == 1:
        forces[:, 0] = solved[address]
        return forces
    edges = solved[address[:, None] + np.arange(2 * (dimension - 1))]
    forces[:, 0] = edges.sum(1)
    for axis in range(min(2, dimension - 1)):
        forces[:, axis + 1] = (edges[:, 2 * axis] - edges[:, 2 * axis + 1]) * friction[:, axis]
    return forces


