#!/usr/bin/env python3
"""Does each fault of a robot or object file give a diagnostic with a code, a place and help?

    python3 benches/broken_robots.py --program ./actcheck --work /tmp/broken panda.urdf fetch.urdf panda.xml model.sdf

Breaks each file in the ways below that apply to it, and reads it as a user would: robots with `actcheck new robot` and
`actcheck check`, objects (SDF) with `actcheck check` alone. Prints one line for each: the exit code, the code and the message.
A fault that a robot can be simulated with, such as a speed of 0, may be a warning. A crash, no diagnostic, or one without a
file and help is printed as WRONG, and the exit code is then 1. A broken robot is written beside the original, so that its
meshes are found, and removed again.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path


def first(pattern, replacement):
    """Replaces the first match; the file must have one."""
    return lambda text: re.sub(pattern, replacement, text, count=1, flags=re.S) if re.search(pattern, text, re.S) else None


def last(pattern, replacement):
    """Replaces the last match: the first links are often fixed to the root, and their inertia has no effect."""
    def change(text):
        found = list(re.finditer(pattern, text, re.S))
        return text[: found[-1].start()] + replacement + text[found[-1].end() :] if found else None
    return change


def every(pattern, replacement):
    return lambda text: re.sub(pattern, replacement, text, flags=re.S) if re.search(pattern, text, re.S) else None


def cut(text):
    return text[: len(text) * 2 // 3]


# Name, kinds of files, and the change.
FAULTS = [
    ("empty file", "urdf mjcf sdf", lambda text: ""),
    ("cut off", "urdf mjcf sdf", cut),
    ("not XML", "urdf mjcf sdf", lambda text: "robot: panda\nlinks: []\n"),
    ("other root element", "urdf mjcf sdf", lambda text: "<html><body>404 Not Found</body></html>"),
    ("closing tag missing", "urdf sdf", first(r"</link>", "")),
    ("joint of an unknown type", "urdf", first(r'type="(revolute|prismatic)"', 'type="hinge"')),
    ("parent is unknown", "urdf", first(r'<parent\s+link="[^"]*"', '<parent link="nowhere"')),
    ("child is unknown", "urdf", first(r'<child\s+link="[^"]*"', '<child link="nowhere"')),
    ("axis of length 0", "urdf", first(r'<axis\s+xyz="[^"]*"', '<axis xyz="0 0 0"')),
    ("axis of two numbers", "urdf", first(r'<axis\s+xyz="[^"]*"', '<axis xyz="0 1"')),
    ("limits exchanged", "urdf", first(r'lower="[^"]*"(.*?)upper="[^"]*"', r'lower="2"\1upper="-2"')),
    ("limit is not a number", "urdf", first(r'upper="[^"]*"', 'upper="wide"')),
    ("effort is negative", "urdf", first(r'effort="[^"]*"', 'effort="-5"')),
    ("speed is 0", "urdf", every(r'velocity="[^"]*"', 'velocity="0"')),
    ("mass is negative", "urdf", first(r'<mass\s+value="[^"]*"', '<mass value="-1"')),
    ("mass is not a number", "urdf", first(r'<mass\s+value="[^"]*"', '<mass value="nan"')),
    ("mass is infinite", "urdf", first(r'<mass\s+value="[^"]*"', '<mass value="inf"')),
    ("inertia is 0", "urdf", last(r'<inertia\s[^>]*/>', '<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>')),
    ("inertia is negative", "urdf", last(r'<inertia\s[^>]*/>', '<inertia ixx="-1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>')),
    ("meshes are missing", "urdf", every(r'filename="[^"]*/([^"/]*)"', r'filename="package://gone_description/\1"')),
    ("mesh of an unknown kind", "urdf", every(r'filename="([^"]*)\.(stl|STL|dae|obj)"', r'filename="\1.blend"')),
    ("two links of a name", "urdf", lambda text: text.replace("</robot>", re.search(r'<link name="[^"]*"', text)[0] + "/></robot>")),
    ("origin of four numbers", "urdf", first(r'xyz="[^"]*"', 'xyz="0 0 0 0"')),
    ("mimics an unknown joint", "urdf", first(r'<limit ', '<mimic joint="gone"/><limit ')),
    ("a circle of joints", "urdf", lambda text: text.replace("</robot>", '<joint name="back" type="fixed"><parent link="%s"/><child link="%s"/></joint></robot>' % (re.findall(r'<child\s+link="([^"]*)"', text)[-1], re.search(r'<link\s+name="([^"]*)"', text)[1]))),
    ("fingers are fixed", "urdf", lambda text: re.sub(r'(<joint name="[^"]*finger[^"]*" type=)"\w+"', r'\1"fixed"', text)),
    ("unknown class", "mjcf", first(r'class="[^"]*"', 'class="nobody"')),
    ("position of a word", "mjcf", first(r'pos="[^"]*"', 'pos="here"')),
    ("mesh is missing", "mjcf", first(r'<mesh ([^>]*)file="[^"]*"', r'<mesh \1file="gone.stl"')),
    ("geom of an unknown mesh", "mjcf", first(r'<worldbody>', '<worldbody><body><geom type="mesh" mesh="gone"/></body>')),
    ("geom of an unknown type", "mjcf", first(r'<worldbody>', '<worldbody><body><geom type="torus" size="1"/></body>')),
    ("equality of an unknown joint", "mjcf", first(r'</worldbody>', '</worldbody><equality><joint joint1="gone" joint2="lost"/></equality>')),
    ("included file is missing", "mjcf", first(r'<worldbody>', '<include file="gone.xml"/><worldbody>')),
    ("size is negative", "mjcf", first(r'<worldbody>', '<worldbody><body><geom type="box" size="-1 1 1"/></body>')),
    ("range of one number", "mjcf", first(r'range="[^"]*"', 'range="1"')),
    ("mass is negative", "mjcf sdf", first(r'mass="[^"]*"|<mass>[^<]*</mass>', lambda m: 'mass="-1"' if m[0][0] == "m" else "<mass>-1</mass>")),
    ("version of the future", "sdf", first(r'<sdf version="[^"]*"', '<sdf version="9.9"')),
    ("mass is a word", "sdf", first(r'<mass>[^<]*</mass>', '<mass>heavy</mass>')),
    ("pose of five numbers", "sdf", first(r'<link ([^>]*)>', r'<link \1><pose>0 0 0 0 0</pose>')),
    ("mesh is missing", "sdf", every(r'<uri>[^<]*/([^</]*)</uri>', r'<uri>model://gone/\1</uri>')),
    ("no collision shape", "sdf", every(r'<collision.*?</collision>', "")),
    ("no link", "sdf", every(r'<link.*</link>', "")),
    ("geometry is empty", "sdf", every(r'<geometry>.*?</geometry>', "<geometry/>")),
]

CHECK = """tests = [["Pick"]]
test_count = 1
model_dir = "models"
[objectSurface]
object_surfaces = ["coffee_table"]
[pickObject]
model_list = ["thing"]
"""
ROBOT = """[robot]
profile = "robot.toml"
"""


def kind_of(path):
    text = path.read_text(errors="replace")
    return "mjcf" if "<mujoco" in text else "sdf" if "<sdf" in text else "urdf"


def read_broken(args, path, kind, text, folder):
    """Reads the broken file as a user would; returns the exit code and the output."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    if kind == "sdf":
        # The whole folder of the model, with its meshes.
        model = folder / "models" / "thing"
        shutil.copytree(path.parent, model)
        (model / path.name).write_text(text)
        (folder / "c.toml").write_text(CHECK)
        command = ["check", "c.toml"]
    else:
        broken = path.with_name(f"broken_{path.name}")
        broken.write_text(text)
        command = ["new", "robot", str(broken), "--out", str(folder / "robot.toml")]
        for package in args.packages:
            command += ["--packages", package]
    try:
        done = run(args, folder, command)
        if kind != "sdf" and done.returncode == 0:
            shipped = CHECK.replace('model_dir = "models"\n', "").replace("thing", "can")
            (folder / "c.toml").write_text(shipped + ROBOT)
            done = run(args, folder, ["check", "c.toml"])
    finally:
        if kind != "sdf":
            broken.unlink()
    return done.returncode, done.stdout + done.stderr


def run(args, folder, command):
    return subprocess.run([args.program, *command], cwd=folder, capture_output=True, text=True, errors="replace",
                          env={**os.environ, "NO_COLOR": "1"}, timeout=300)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--program", required=True)
    parser.add_argument("--work", required=True, type=Path)
    parser.add_argument("--packages", action="append", default=[])
    args = parser.parse_args()
    n_right, n_wrong = 0, 0
    for path in args.files:
        path = path.resolve()
        kind, original = kind_of(path), path.read_text(errors="replace")
        for name, kinds, change in FAULTS:
            text = change(original) if kind in kinds.split() else None
            if text is None or text == original:
                continue
            code, said = read_broken(args, path, kind, text, args.work.resolve())
            found = re.search(r"^([A-Z]\d{3})\s*$(.*?)(?=^[A-Z]\d{3}\s*$|\Z)", said, re.S | re.M)
            body = found[2] if found else ""
            place = re.search(r"\[[^\]]*:\d+:\d+\]|\w+\.\w+:\d+", body) or re.search(r"/[^ ]+\.\w+", body)
            help_ = "help:" in body
            is_right = bool(found and place and help_) and code in (0, 1, 2) and "panicked" not in said
            n_right, n_wrong = n_right + is_right, n_wrong + (not is_right)
            message = " ".join(re.sub(r"[│╭─╰·╯┬]", " ", body.split("╭")[0]).split())[:110]
            shown = "" if is_right else "WRONG "
            print(f"{shown}{path.name}: {name}: exit {code}, {found[1] if found else 'no code'}, {message}")
            if not is_right:
                print("    " + " ".join(said.split())[:300])
    print(f"{n_right} right, {n_wrong} wrong")
    sys.exit(1 if n_wrong else 0)


if __name__ == "__main__":
    main()
