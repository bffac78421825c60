r"""Trains the network of `learned_pick.py` on an exported dataset of its runs: offline, in seconds, without a simulation.

    sed 's|^test_launcher.*|test_launcher = "../clients/python/examples/learned_pick.py --untrained"|' \
        configs/pick.toml > configs/collect.toml
    actcheck run configs/collect.toml --runs 400 --seed 1000 --history collected
    actcheck export tables runs --dataset --history collected
    python clients/python/examples/train_grasp_offset.py runs

Needs polars (`pip install polars`) to read the dataset's tables.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from actcheck import Pose, Thing
from grasp_offset import Array, Network, features

HIDDEN = 12
STEPS = 4000
#: Weight decay, against overfitting.
DECAY = 2e-3


def examples(folder: Path) -> tuple[Array, Array]:
    """For each run, the features and the object's true offset ahead and to the left of its perceived position."""
    import polars as pl  # imported here, so that training can be used without it

    actions = pl.read_parquet(folder / "actions.parquet").filter(pl.col("action").str.ends_with("Pick"))
    percepts = pl.read_parquet(folder / "percepts.parquet")
    truth = pl.read_parquet(folder / "objects.parquet").filter(pl.col("time_s") == 0.0)
    robot = pl.read_parquet(folder / "robot.parquet").filter(pl.col("time_s") == 0.0)
    inputs, offsets = [], []
    for action in actions.iter_rows(named=True):
        (target,) = json.loads(action["parameters"])["pickObject"]
        of_run = (pl.col("run") == action["run"]) & (pl.col("step") == action["step"])
        told = percepts.filter(of_run)
        seen = told.filter((pl.col("source") == "detector") & (pl.col("object") == target)).rows(named=True)
        shown = told.filter(pl.col("source") == "reported").rows(named=True)
        true = truth.filter(of_run & (pl.col("object") == target)).rows(named=True)
        base = robot.filter(of_run).rows(named=True)
        if not (seen and shown and true and base):
            continue
        thing, box = thing_of(seen[0]), thing_of(shown[0])
        place = believed(base[0], np.array([true[0][axis] for axis in ("x_m", "y_m", "z_m")]))
        inputs.append(features(thing, box))
        offsets.append((box.pose.rotation.T @ (place - thing.pose.position))[:2])
    if not inputs:
        raise SystemExit("the dataset has no runs of learned_pick.py that saw the object to pick")
    return np.array(inputs), np.array(offsets)


def thing_of(row: dict[str, float]) -> Thing:
    """Converts a percept row."""
    pose = {"position_m": [row[k] for k in ("x_m", "y_m", "z_m")], "quaternion_xyzw": [row[k] for k in ("qx", "qy", "qz", "qw")]}
    return Thing("", Pose.from_wire(pose), np.array([row[k] for k in ("width_m", "depth_m", "height_m")]))


def believed(base: dict[str, float], place: Array) -> Array:
    """A true position in the robot's believed world frame, shifted by its localisation error."""
    true = Pose.upright((base["true_base_x_m"], base["true_base_y_m"], 0.0), base["true_base_heading_rad"])
    belief = Pose.upright((base["base_x_m"], base["base_y_m"], 0.0), base["base_heading_rad"])
    return (belief * true.inverse() * Pose.upright(place)).position


def learn(inputs: Array, offsets: Array, seed: int) -> Network:
    """Least squares with Adam on all examples at once; deterministic for the same examples and seed."""
    generator = np.random.default_rng(seed)
    mean, scale = inputs.mean(axis=0), inputs.std(axis=0) + 1e-4
    weights = [
        generator.normal(0.0, 0.3, (inputs.shape[1], HIDDEN)),
        np.zeros(HIDDEN),
        np.zeros((HIDDEN, 2)),
        np.zeros((inputs.shape[1], 2)),
        offsets.mean(axis=0),
    ]
    first, second = [np.zeros_like(w) for w in weights], [np.zeros_like(w) for w in weights]
    scaled, unit = (inputs - mean) / scale, offsets.std()
    for step in range(1, STEPS + 1):
        hidden, hidden_bias, out, straight, bias = weights
        active = np.tanh(scaled @ hidden + hidden_bias)
        error = (active @ out + scaled @ straight + bias - offsets) / unit / len(inputs)
        back = (error @ out.T) * (1.0 - active**2)
        slopes = [scaled.T @ back, back.sum(axis=0), active.T @ error, scaled.T @ error, error.sum(axis=0)]
        for number, slope in enumerate(slopes):
            slope = slope + DECAY * weights[number] * (number in (0, 2, 3))
            first[number] = 0.9 * first[number] + 0.1 * slope
            second[number] = 0.999 * second[number] + 0.001 * slope**2
            rate = 3e-3 * (1.0 - step / STEPS) * np.sqrt(1.0 - 0.999**step) / (1.0 - 0.9**step)
            weights[number] = weights[number] - rate * first[number] / (np.sqrt(second[number]) + 1e-9)
    hidden, hidden_bias, out, straight, bias = weights
    return Network(mean, scale, hidden, hidden_bias, out, straight, bias)


def main() -> None:
    """Trains on four fifths of the runs, evaluates on the rest, then trains on all runs and writes the weights."""
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("dataset", type=Path, help="folder written by `actcheck export tables --dataset`")
    arguments.add_argument("--output", type=Path, default=Path(__file__).with_name("grasp_offset.json"))
    arguments.add_argument("--seed", type=int, default=1)
    given = arguments.parse_args()
    inputs, offsets = examples(given.dataset)
    held = np.arange(len(inputs)) % 5 == 4
    before = np.linalg.norm(offsets[held], axis=1)
    after = np.linalg.norm(learn(inputs[~held], offsets[~held], given.seed)(inputs[held]) - offsets[held], axis=1)
    told = f"{len(inputs)} runs; on {held.sum()} held-out runs the median error is {1e3 * np.median(after):.1f} mm"
    told += f" instead of {1e3 * np.median(before):.1f} mm"
    print(told)
    learn(inputs, offsets, given.seed).save(given.output, told)
    print(f"wrote the weights to {given.output} ({given.output.stat().st_size} bytes)")


if __name__ == "__main__":
    main()
