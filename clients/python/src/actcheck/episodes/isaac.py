"""HDF5 files of Isaac Lab: poses and velocities of assets, positions and velocities of joints.

The files have no shapes, masses and contacts. Isaac Lab up to 2.x writes quaternions as w, x, y, z, later versions as x, y, z, w; most
files do not say which.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from actcheck.episodes import hdf5
from actcheck.episodes.faults import EpisodeFault
from actcheck.episodes.sources import Episode, Source
from actcheck.recording.file import EpisodeFile
from actcheck.recording.model import Model, body, world
from actcheck.recording.states import Array, Outcomes, States

Order = Literal["wxyz", "xyzw"]

_FAMILIES = ("articulation", "rigid_object")
_LACKS = "contacts,contact_forces,joint_efforts,joint_limits,controls,reward,masses,frictions,shapes"
_JOINTS = "the file has neither names nor kinds of the joints; all are described as hinges"
_VELOCITIES = "linear velocities are those of the centres of mass"
#: Least vertical part of an upright body's own z axis.
_UPRIGHT = 0.9999
_BATCH = 4096


@dataclass(frozen=True)
class _Asset:
    """One asset of a scene: its name, its first state and its later states. `later` is `None` if only the first state is stored."""

    name: str
    first: Any
    later: Any

    def rows(self, quantity: str, begin: int, end: int) -> Array | None:
        """A quantity in the states `begin` to `end`; the first state has index 0. `None` if the file does not have it."""
        first = hdf5.child(self.first, quantity)
        if first is None:
            return None
        parts = [hdf5.numbers(first, 0, 1)] if begin == 0 else []
        if self.later is not None:
            later = hdf5.child(self.later, quantity)
            if later is None:
                raise EpisodeFault("field-missing", f"{self.later.name}/{quantity} is missing, but the first state has it")
            parts.append(hdf5.numbers(later, max(begin - 1, 0), end - 1))
        return np.concatenate(parts)

    def count(self) -> int:
        """Number of states."""
        poses = hdf5.child(self.later, "root_pose") if self.later is not None else None
        return 1 + (len(poses) if poses is not None else 0)


def recognised(file: Any) -> bool:
    """Whether an open HDF5 file has scenes of Isaac Lab."""
    names = hdf5.demonstrations(file)
    return bool(names) and hasattr(hdf5.child(file, f"data/{names[0]}/initial_state"), "keys")


def episodes(source: Source) -> Iterator[Episode]:
    """Yields the episodes of a file; it stays open until the iterator ends."""
    with hdf5.opened(source.path) as file:
        for name in hdf5.demonstrations(file):
            yield Episode(name, lambda path, name=name: _convert(source, file, name, path))  # type: ignore[misc]


def _assets(demonstration: Any) -> list[_Asset]:
    assets = []
    for family in _FAMILIES:
        first = hdf5.child(demonstration, f"initial_state/{family}")
        for name in first or ():
            member = hdf5.child(first, name)
            if hdf5.child(member, "root_pose") is not None:
                assets.append(_Asset(name, member, hdf5.child(demonstration, f"states/{family}/{name}")))
    if not assets:
        raise EpisodeFault("no-states", f"{demonstration.name}/initial_state has no asset with a root_pose")
    if len({asset.count() for asset in assets}) > 1:
        raise EpisodeFault("damaged", f"the assets in {demonstration.name}/states have different numbers of states")
    return assets


def _convert(source: Source, file: Any, name: str, path: Path) -> None:
    demonstration = hdf5.child(file, f"data/{name}")
    assets = _assets(demonstration)
    order, reason = _order(source, file, demonstration, assets)
    step = _step(source, file)
    count = assets[0].count()
    # The success of an episode is that of its last state.
    success = demonstration.attrs.get("success")
    episode = EpisodeFile(path, _model(assets))
    try:
        for begin in range(0, count, _BATCH):
            end = min(begin + _BATCH, count)
            said = None if success is None else bool(success)
            episode.write(_states(assets, order, step, begin, end, [said if at == count - 1 else None for at in range(begin, end)]))
        environment = str(hdf5.parsed(hdf5.child(file, "data"), "env_args").get("env_name") or "")
        metadata = source.metadata("Isaac Lab HDF5", name) | {
            "engine": "",
            "engine_version": "",
            "environment": f"isaaclab/{environment}" if environment else "",
            "task": "",
            "lacks": _LACKS + (",success" if success is None else ""),
            "note.quaternions": f"{order}: {reason}",
            "note.joints": _JOINTS,
            "note.velocities": _VELOCITIES,
        }
        seed = hdf5.text(demonstration, "seed")
        episode.close(metadata | ({"seed": seed} if seed else {}))
    except BaseException:
        episode.discard()
        raise


def _model(assets: list[_Asset]) -> Model:
    model: Model = {"bodies": [world()], "joints": [], "actuators": [], "sites": [], "timestep": None, "gravity": [0.0, 0.0, -9.81]}
    for asset in assets:
        made = body(asset.name, moves=True)
        joints = hdf5.child(asset.first, "joint_position")
        for at in range(joints.shape[1] if joints is not None and joints.ndim == 2 else 0):
            made["joint"] = len(model["joints"]) if made["joint"] is None else made["joint"]
            model["joints"].append(
                {
                    "name": f"{asset.name}_joint{at}",
                    "body": len(model["bodies"]),
                    "kind": "hinge",
                    "limits": None,
                    "max_effort": None,
                    "max_velocity": None,
                }
            )
        model["bodies"].append(made)
    return model


def _states(assets: list[_Asset], order: Order, step: float, begin: int, end: int, success: list[bool | None]) -> States:
    poses = np.stack([_rows(asset, "root_pose", begin, end, 7) for asset in assets], 1)
    if order == "wxyz":
        poses[..., 3:] = np.roll(poses[..., 3:], -1, -1)
    velocities = np.stack([_rows(asset, "root_velocity", begin, end, 6) for asset in assets], 1)
    positions, speeds = (
        [values for asset in assets if (values := asset.rows(quantity, begin, end)) is not None]
        for quantity in ("joint_position", "joint_velocity")
    )
    no = [False] * (end - begin)
    return States(
        time=np.round(np.arange(begin, end) * step * 1e9).astype(np.int64),
        poses=poses,
        velocities=velocities,
        joint_positions=np.concatenate(positions, 1) if positions else None,
        joint_velocities=np.concatenate(speeds, 1) if speeds else None,
        outcomes=Outcomes(np.zeros(end - begin), success, no, no),
    )


def _rows(asset: _Asset, quantity: str, begin: int, end: int, width: int) -> Array:
    rows = asset.rows(quantity, begin, end)
    if rows is None or rows.shape != (end - begin, width):
        raise EpisodeFault("field-missing", f"{asset.first.name}/{quantity} must have {width} numbers in each of {end - begin} states")
    return rows


def _step(source: Source, file: Any) -> float:
    """Time between states. Unit: seconds."""
    if source.options.timestep is not None:
        return source.options.timestep
    simulated = hdf5.parsed(hdf5.child(file, "data"), "env_args").get("sim_args")
    if isinstance(simulated, dict):
        step, decimation = simulated.get("dt"), simulated.get("decimation", 1)
        if isinstance(step, (int, float)) and isinstance(decimation, int) and step > 0 and decimation > 0:
            return float(step * decimation)
    raise EpisodeFault("time-unknown", f"{source.path} does not say the time between its states: give --timestep SECONDS")


def _order(source: Source, file: Any, demonstration: Any, assets: list[_Asset]) -> tuple[Order, str]:
    """The order of the quaternions and how it is known."""
    if source.options.quaternions is not None:
        return source.options.quaternions, "given by the option --quaternions"
    for owner in (demonstration, hdf5.child(file, "data"), file):
        for name in ("quat_convention", "quaternion_order", "quat_order"):
            said = hdf5.text(owner, name).lower()
            if said in ("wxyz", "xyzw"):
                return said, f"the file's attribute `{name}`"  # type: ignore[return-value]
        for name in ("isaaclab_version", "isaac_lab_version"):
            major = hdf5.text(owner, name).lstrip("v").partition(".")[0]
            if major.isdigit():
                return ("wxyz" if int(major) < 3 else "xyzw"), f"Isaac Lab {hdf5.text(owner, name)} wrote the file"
    return _upright(source, np.concatenate([_rows(asset, "root_pose", 0, 1, 7)[:, 3:] for asset in assets]))


def _upright(source: Source, quaternions: Array) -> tuple[Order, str]:
    """Decides by the first state: bodies that are upright in one order and never in the other."""
    orders: tuple[Order, Order] = ("wxyz", "xyzw")
    first = {"wxyz": 1, "xyzw": 0}
    upright = {}
    for order in orders:
        x, y = quaternions[:, first[order]], quaternions[:, first[order] + 1]
        upright[order] = int((1 - 2 * (x * x + y * y) >= _UPRIGHT).sum())
    for order, other in (orders, orders[::-1]):
        if upright[order] and not upright[other]:
            return order, f"{upright[order]} of {len(quaternions)} bodies begin upright in this order, none in the other"
    raise EpisodeFault(
        "quaternions-unknown",
        f"{source.path} does not say the order of its quaternions, and the first state does not show it: give --quaternions wxyz or xyzw",
    )
