#!/usr/bin/env python3
"""Do drives succeed in worlds that others published for Gazebo?

    git clone https://github.com/aws-robotics/aws-robomaker-small-house-world repositories/small_house
    git clone https://github.com/aws-robotics/aws-robomaker-bookstore-world repositories/bookstore
    git clone https://github.com/aws-robotics/aws-robomaker-small-warehouse-world repositories/small_warehouse
    python3 benches/published_worlds.py --program ./actcheck --work /tmp/worlds --runs 10 repositories/*

Sends the shipped robot to the locations of each `.world` or `.sdf` below the folders, without noise and with five minutes for each
drive. Prints one line for each world: the drives that reach their goal, that fail, and that do not end as planned, with the reasons.
Worlds without a location, and those that `check` refuses before it lists any, are not listed: `published_models.py` counts
them. Needs the folders of models as `published_models.py` does.
"""

import argparse
import os
import re
import shutil
import subprocess
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import published_models

CONFIG = """tests = [["MoveTo"]]
test_count = {runs}
model_dir = "models"
[world]
worlds = ["{world}"]
[objectLocation]
location_list = [{locations}]
[budget]
action_secs = 300
"""


def locations(said):
    """The names that the help of C021 lists."""
    known = re.search(r"help: known names: (.*?)(?:\n\n|\Z)", said, re.S)
    return [name.strip() for name in " ".join(known[1].split()).split(",")] if known else []


def drive(args, world, number):
    folder = args.work / f"world_{number}"
    models = folder / "models"
    (models / "worlds").mkdir(parents=True)
    shutil.copy(world, models / "worlds" / world.name)
    published_models.link(args, models, world)
    name = re.sub(r"\.(world|sdf)$", "", world.name)
    environment = {**os.environ, "NO_COLOR": "1", "COLUMNS": "100000"}

    def actcheck(command, names, *options):
        quoted = ", ".join(f'"{name}"' for name in names)
        (folder / "c.toml").write_text(CONFIG.format(runs=args.runs, world=name, locations=quoted))
        done = subprocess.run([args.program, command, "c.toml", *options], cwd=folder, capture_output=True, text=True,
                              errors="replace", env=environment, timeout=3600)
        return done.stdout + done.stderr

    names = locations(actcheck("check", ["no_such_location"]))
    if not names:
        return None
    said = actcheck("run", names, "--history", "h", "--jobs", "1")
    row = re.search(r"GoalReached +.*?%.*?\)\s+(\d+)\s+(\d+)\s+(\d+)\s+(\d+)\s+(\d+)\s+(\d+)", said)
    counts = dict(zip(("passed", "failed", "inapplicable", "broken", "timeout", "untested"), map(int, row.groups()))) if row else {}
    reasons = Counter(re.findall(r"GoalReported: the action reported failed: [^:\n]+: ([^\n]+)", said))
    reasons.update(re.findall(r"(?:the last failure|^  broken): ([^\n]+)", said, re.M))
    if not row:
        reasons.update(re.findall(r"^  × ([^\n]+)", said, re.M))
    shutil.rmtree(folder / "h", ignore_errors=True)
    shown = ", ".join(f"{count} {word}" for word, count in counts.items() if count) or "no runs"
    return f"{shown}; " + "; ".join(f"{count} x {reason}" for reason, count in reasons.most_common(3)), counts


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--program", required=True)
    parser.add_argument("--work", required=True, type=Path)
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--only", default="", help="regular expression of the names of worlds")
    parser.add_argument("--jobs", type=int, default=2)
    args = parser.parse_args()
    folders = published_models.prepare(args)
    worlds = [path for folder in folders for path in published_models.worlds_below(folder) if re.search(args.only, path.name)]
    total = Counter()

    def report(item):
        world, number = item
        found = drive(args, world, number)
        if found:
            print(f"{world.name}: {found[0]}", flush=True)
            total.update(found[1])

    with ThreadPoolExecutor(args.jobs) as pool:
        list(pool.map(report, zip(worlds, range(len(worlds)))))
    print("all: " + ", ".join(f"{count} {word}" for word, count in total.items() if count))


if __name__ == "__main__":
    main()
