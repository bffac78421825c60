#!/usr/bin/env python3
"""Puts arms and grippers of other projects together, as MJCF files for `robots.py`.

    pip install robosuite
    python3 benches/compose_robots.py robosuite repositories/robosuite
    git clone https://github.com/google-deepmind/mujoco_menagerie repositories/mujoco_menagerie
    python3 benches/compose_robots.py repositories/mujoco_menagerie repositories/menagerie_hands

robosuite puts each robot and its own gripper together in memory; this saves the results. Of the menagerie, arms without a
hand get the 2F-85 of Robotiq, and the FR3 also the hand of Franka. The files name the meshes of both projects.
"""

import sys
from pathlib import Path

ROBOSUITE = ["Panda", "Sawyer", "UR5e", "IIWA", "Kinova3", "Jaco", "XArm7", "Baxter", "Tiago", "SpotArm", "GR1"]
ROBOTIQ = "robotiq_2f85/2f85.xml"
# Name, arm, its site or body for the hand, and the hand.
MENAGERIE = [
    ("ur5e", "universal_robots_ur5e/ur5e.xml", "attachment_site", ROBOTIQ),
    ("ur10e", "universal_robots_ur10e/ur10e.xml", "attachment_site", ROBOTIQ),
    ("gen3", "kinova_gen3/gen3.xml", "pinch_site", ROBOTIQ),
    ("iiwa14", "kuka_iiwa_14/iiwa14.xml", "attachment_site", ROBOTIQ),
    ("sawyer", "rethink_robotics_sawyer/sawyer.xml", "attachment_site", ROBOTIQ),
    ("fr3", "franka_fr3/fr3.xml", "attachment_site", ROBOTIQ),
    ("fr3_hand", "franka_fr3/fr3.xml", "attachment_site", "franka_emika_panda/hand.xml"),
]


def save_robosuite(folder):
    from robosuite.models.grippers import gripper_factory
    from robosuite.models.robots import create_robot

    for name in ROBOSUITE:
        robot = create_robot(name, idn=0)
        for arm in robot.arms:
            robot.add_gripper(gripper_factory(robot.default_gripper[arm], idn=f"0_{arm}"), robot.eef_name[arm])
        robot.save_model(str(folder / f"{name}.xml"))


def opened(path):
    """The model of a file, with the paths of its meshes in full, and without meshes that are missing."""
    import mujoco

    spec = mujoco.MjSpec.from_file(str(path))
    assets = path.parent / (spec.meshdir or "")
    for mesh in list(spec.meshes):
        file = assets / mesh.file
        if file.exists():
            mesh.file = str(file)
            continue
        for geom in list(spec.geoms):
            if geom.meshname == (mesh.name or file.stem):
                spec.delete(geom)
        spec.delete(mesh)
    for texture in spec.textures:
        texture.file = str(assets / texture.file) if texture.file else ""
    spec.meshdir = spec.texturedir = ""
    for key in list(spec.keys):
        spec.delete(key)
    return spec


def save_menagerie(menagerie, folder):
    for name, arm, place, hand in MENAGERIE:
        spec = opened(menagerie / arm)
        site = next(site for site in spec.sites if site.name == place)
        spec.attach(opened(menagerie / hand), site=site, prefix="hand_")
        spec.compile()
        (folder / f"{name}.xml").write_text(spec.to_xml())


def main():
    source, folder = sys.argv[1], Path(sys.argv[2]).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    if source == "robosuite":
        save_robosuite(folder)
    else:
        save_menagerie(Path(source).resolve(), folder)


if __name__ == "__main__":
    main()
