#!/usr/bin/env python3
"""Saves robosuite's robots, each with its own gripper, as MJCF files for `robots.py`.

    pip install robosuite
    python3 benches/robosuite_robots.py repositories/robosuite

robosuite keeps arms and grippers in files of their own and puts them together in memory; this writes the results. They
name meshes inside the package, whose licence is MIT.
"""

import sys
from pathlib import Path

from robosuite.models.grippers import gripper_factory
from robosuite.models.robots import create_robot

ROBOTS = ["Panda", "Sawyer", "UR5e", "IIWA", "Kinova3", "Jaco", "XArm7", "Baxter", "Tiago", "SpotArm", "GR1"]


def main():
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name in ROBOTS:
        robot = create_robot(name, idn=0)
        for arm in robot.arms:
            robot.add_gripper(gripper_factory(robot.default_gripper[arm], idn=f"0_{arm}"), robot.eef_name[arm])
        robot.save_model(str(folder / f"{name}.xml"))


if __name__ == "__main__":
    main()
