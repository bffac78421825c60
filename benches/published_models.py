#!/usr/bin/env python3
"""How many objects and worlds that others published for Gazebo load?

    git clone https://github.com/hsr-project/tmc_wrs_gazebo repositories/tmc_wrs_gazebo    # 79 objects of YCB, and furniture
    git clone https://github.com/osrf/gazebo_models repositories/gazebo_models
    git clone https://github.com/gazebosim/gz-sim repositories/gz-sim                      # worlds, as in the next two
    git clone https://github.com/leonhartyao/gazebo_models_worlds_collection repositories/collection
    git clone https://github.com/aws-robotics/aws-robomaker-small-house-world repositories/small_house
    python3 benches/published_models.py --program ./actcheck --work /tmp/models repositories/*

Checks each model that has a `model.config` below the folders, as an obstacle, and each `.world` or `.sdf` with a
`<world>`. Both may use the models of all folders: those that they name are linked into a folder of their own, since the
program reads all models of a folder. Prints one line for each that is refused: the code and the reason.
A world loads if `actcheck check` reports no error but that of a location that it does not have; it is then checked
again with a location of its own.
"""

import argparse
import os
import re
import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

TESTS = 'tests = [["MoveTo"]]\ntest_count = 1\nmodel_dir = "models"\n'
MODEL = 'nav_obstacle_list = ["{name}"]\nnav_obstacle_count = 1\n[world]\nworlds = ["empty_room"]\n[objectLocation]\nlocation_list = ["door"]\n'
WORLD = '[world]\nworlds = ["{name}"]\n[objectLocation]\nlocation_list = ["{location}"]\n'


def check(args, folder, text):
    """The errors of `actcheck check`, each as its code and its text without the frame."""
    (folder / "c.toml").write_text(text)
    done = subprocess.run([args.program, "check", "c.toml"], cwd=folder, capture_output=True, text=True, errors="replace",
                          env={**os.environ, "NO_COLOR": "1"}, timeout=600)
    said = done.stdout + done.stderr
    blocks = re.findall(r"^([A-Z]\d{3})\s*$(.*?)(?=^[A-Z]\d{3}\s*$|\Z)", said, re.S | re.M)
    errors = [(code, " ".join(body.split())) for code, body in blocks if "×" in body]
    if done.returncode and not errors:
        errors = [(f"exit {done.returncode}", " ".join(said.split())[:300])]
    return errors


def link(args, folder, file, own=None):
    """Links the models that a file names into a folder, and those that they name. `own`: the folder of the file's models."""
    text = file.read_text(errors="replace")
    for name in set(re.findall(r"[\w.-]+", text)) | set(re.findall(r"[\w. -]+", text)):
        # An address of Gazebo Fuel, as `.../models/Traffic Cone`, means the folder `traffic_cone`.
        for name in {name.strip(), name.strip().lower().replace(" ", "_")}:
            models = args.models.get(name, [])
            model = next((model for model in models if model.parent == own), models[0] if models else None)
            if model and not (folder / name).exists():
                link_model(args, folder, model)


def link_model(args, folder, model):
    (folder / model.name).symlink_to(model)
    for kind in ("*.sdf", "*.urdf", "*.config"):
        for file in model.glob(kind):
            link(args, folder, file, model.parent)


def reason(errors):
    code, text = errors[0]
    return f"{code}, {re.split(r' ╭─| help:|: there is no ', text.lstrip('× '))[0]}"


def check_model(args, model, number):
    folder = args.work / f"model_{number}"
    (folder / "models").mkdir(parents=True)
    link_model(args, folder / "models", model)
    errors = check(args, folder, TESTS + MODEL.format(name=model.name))
    return reason(errors) if errors else ""


def check_world(args, world, number):
    folder = args.work / f"world_{number}"
    models = folder / "models"
    (models / "worlds").mkdir(parents=True)
    shutil.copy(world, models / "worlds" / world.name)
    link(args, models, world)
    name = re.sub(r"\.(world|sdf)$", "", world.name)
    errors = check(args, folder, TESTS + WORLD.format(name=name, location="no_such_location"))
    others = [error for error in errors if error[0] != "C021"]
    if others:
        return reason(others), ""
    known = re.search(r"known names: (.+?)(?:,|$)", errors[0][1].replace("│ ", "")) if errors else None
    if not known:
        return "", "no location"
    errors = check(args, folder, TESTS + WORLD.format(name=name, location=known[1]))
    return (reason(errors), "") if errors else ("", "")


def prepare(args):
    """Empties the folder to work in, and collects the models by name. Returns the `model.config` files of each folder."""
    args.program = str(Path(args.program).resolve())
    args.work = args.work.resolve()
    shutil.rmtree(args.work, ignore_errors=True)
    configs = {folder.resolve(): sorted(folder.resolve().rglob("model.config")) for folder in args.folders}
    args.models = {}
    for model in (config.parent for found in configs.values() for config in found):
        args.models.setdefault(model.name, []).append(model)
    return configs


def worlds_below(folder):
    """The files with a world."""
    return [path for kind in ("*.world", "*.sdf") for path in sorted(folder.rglob(kind)) if has_world(path)]


def has_world(path):
    return "<world" in path.read_text(errors="replace")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--program", required=True)
    parser.add_argument("--work", required=True, type=Path)
    parser.add_argument("--jobs", type=int, default=2)
    args = parser.parse_args()
    configs = prepare(args)
    folders = list(configs)
    pool = ThreadPoolExecutor(args.jobs)
    number = 0
    for folder in folders:
        models = [config.parent for config in configs[folder]]
        worlds = worlds_below(folder)
        refusals = list(pool.map(lambda item: check_model(args, *item), zip(models, range(number, number + len(models)))))
        number += len(models)
        for model, refusal in zip(models, refusals):
            if refusal:
                print(f"{folder.name}: model {model.name}: {refusal}")
        results = list(pool.map(lambda item: check_world(args, *item), zip(worlds, range(number, number + len(worlds)))))
        number += len(worlds)
        for world, (refusal, _) in zip(worlds, results):
            if refusal:
                print(f"{folder.name}: world {world.name}: {refusal}")
        n_bare = sum(remark == "no location" for _, remark in results)
        print(f"{folder.name}: {refusals.count('')} of {len(models)} models load, "
              f"{sum(not refusal for refusal, _ in results)} of {len(worlds)} worlds ({n_bare} of them without a location)", flush=True)


if __name__ == "__main__":
    main()
