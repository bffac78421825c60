"""Makes faulty episodes from robosuite's demonstrations of Lift: `python -m tests.lift_faults DEMO.hdf5 --to FAULTY.hdf5`.

Each demonstration gives three: the object is raised at the end while the robot holds its first state (`teleport`), the object is back
at its first pose at the end (`drop`), and nothing moves (`idle`).
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Columns of the object's position and quaternion in a state: after the time and nine joints of arm and gripper.
POSE = slice(10, 17)
#: Columns of the object's velocity.
VELOCITY = slice(26, 32)
#: Unit: metres.
RAISED = 0.1

States = NDArray[np.float64]


def _held(states: States) -> States:
    """The first state for the whole time."""
    held = np.repeat(states[:1], len(states), 0)
    held[:, 0] = states[:, 0]
    held[:, 17:] = 0.0
    return held


def teleport(states: States) -> States:
    """The robot holds its first state; the object is raised in the last one."""
    faulty = _held(states)
    faulty[-1, POSE.start + 2] += RAISED
    return faulty


def drop(states: States) -> States:
    """The demonstration; in the last state the object is back at its first pose."""
    faulty = states.copy()
    faulty[-1, POSE], faulty[-1, VELOCITY] = states[0, POSE], 0.0
    return faulty


def idle(states: States) -> States:
    """Nothing moves."""
    return _held(states)


FAULTS = {"teleport": teleport, "drop": drop, "idle": idle}


def make(source: Path, target: Path) -> None:
    """Writes the faulty episodes `demo_FAULT_N` of all demonstrations to a new file."""
    import h5py

    with h5py.File(source, "r") as file, h5py.File(target, "x") as out:
        data = out.create_group("data")
        for key, value in file["data"].attrs.items():
            data.attrs[key] = value
        for name in file["data"]:
            demonstration: Any = file["data"][name]
            for fault, change in FAULTS.items():
                group = data.create_group(f"demo_{fault}_{name.removeprefix('demo_')}")
                group.attrs["model_file"] = demonstration.attrs["model_file"]
                group["states"] = change(demonstration["states"][:])


def main() -> None:
    """Runs the command line."""
    parser = argparse.ArgumentParser("python -m tests.lift_faults", description=__doc__)
    parser.add_argument("source", type=Path)
    parser.add_argument("--to", type=Path, required=True)
    arguments = parser.parse_args()
    make(arguments.source, arguments.to)


if __name__ == "__main__":
    main()
