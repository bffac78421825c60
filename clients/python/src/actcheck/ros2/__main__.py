"""`python3 -m actcheck.ros2 MAPPING.toml`: the `test_launcher` of a campaign whose skills are ROS 2 action servers."""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from pathlib import Path

from actcheck.ros2 import environment
from actcheck.ros2.faults import MappingFault
from actcheck.ros2.mapping import read

#: Modules of ROS 2 that the bridge uses.
NEEDED = ("rclpy", "control_msgs.action", "nav_msgs.msg", "sensor_msgs.msg", "tf2_msgs.msg")


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(prog="actcheck.ros2", description="Tests ROS 2 action servers with actcheck.")
    parser.add_argument("mapping", type=Path, help="the mapping file: nodes, and how actions become goals")
    parser.add_argument(
        "--free-running", action="store_true", help="let the clock run with the wall's: for contrast, verdicts do not repeat"
    )
    arguments = parser.parse_args()
    try:
        mapping = read(arguments.mapping)
    except MappingFault as fault:
        sys.exit("\n".join(fault.faults))
    _find_ros()
    from actcheck.ros2.bridge import Bridge

    Bridge(mapping, arguments.free_running).serve()


def _find_ros() -> None:
    """Starts again with the environment variables of this Python's own ROS 2, if it has one and none is sourced."""
    folder, script = Path(sys.prefix), Path(environment.__file__)
    if environment.is_stale(folder):
        sys.exit(f"actcheck.ros2: {folder} was made by another version: run `python3 {script} {folder}` again")
    if environment.is_made(folder) and os.environ.get("ACTCHECK_ROS2") != str(folder):
        added = environment.variables(folder)
        for name in ("PYTHONPATH", "LD_LIBRARY_PATH", "AMENT_PREFIX_PATH"):
            added[name] = os.pathsep.join(filter(None, [added[name], os.environ.get(name, "")]))
        os.execve(sys.executable, [sys.executable, "-m", "actcheck.ros2", *sys.argv[1:]], {**os.environ, **added, "ACTCHECK_ROS2": str(folder)})
    for name in NEEDED:
        try:
            importlib.import_module(name)
        except ImportError as error:
            sys.exit(
                f"actcheck.ros2: {name} can't be imported ({error}): source a ROS 2 of this Python's version, or make one with "
                f"`python3 {script} FOLDER` and use its FOLDER/bin/python"
            )


if __name__ == "__main__":
    main()
