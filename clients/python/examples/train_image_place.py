r"""Trains the network of `image_pick.py` on images of its runs: offline, in minutes on two cores, without a simulation.

    sed 's|^test_launcher.*|test_launcher = "../clients/python/examples/image_pick.py --look"|' \
        configs/varied_light.toml > configs/look.toml
    actcheck run configs/look.toml --runs 300 --seed 1000 --history looks
    actcheck export tables seen --dataset --images --history looks
    python clients/python/examples/train_image_place.py seen

Needs polars and pillow (`pip install polars pillow`) to read the dataset's tables and images.
"""

from __future__ import annotations

import argparse
import io
import json
from pathlib import Path

import numpy as np
from actcheck import Pose
from image_place import CELL, WINDOWS, Array, PlaceNetwork, cells
from numpy.typing import NDArray

#: Channels of the layers.
CHANNELS = (3, 8, 12, 1)
EPOCHS = 12
BATCH = 8
#: Spread of the wanted probability around the foot. Unit: cells.
SPREAD = 0.8
#: The time at which `image_pick.py` looks. Unit: seconds.
LOOK_S = 2.0


def examples(folder: Path) -> tuple[NDArray[np.uint8], Array]:
    """For each run, the image that its skill saw, and the true foot of the object in it (column and row, in pixels)."""
    import polars as pl  # imported here, so that training can be used without them
    from PIL import Image

    actions = pl.read_parquet(folder / "actions.parquet").filter(pl.col("action").str.ends_with("Pick"))
    images = pl.read_parquet(folder / "images.parquet").filter((pl.col("time_s") - LOOK_S).abs() < 0.05)
    truth = pl.read_parquet(folder / "objects.parquet").filter(pl.col("time_s") == 0.0)
    pictures, places = [], []
    for action in actions.iter_rows(named=True):
        (target,) = json.loads(action["parameters"])["pickObject"]
        of_run = pl.col("run") == action["run"]
        seen = images.filter(of_run).rows(named=True)
        true = truth.filter(of_run & (pl.col("object") == target)).rows(named=True)
        if not (seen and true):
            continue
        rgb = np.asarray(Image.open(io.BytesIO(seen[0]["png"])))
        focal_px = rgb.shape[1] / 2.0 / np.tan(0.5)  # the field of view of the configuration is 1 rad
        foot = Pose.upright([true[0][axis] for axis in ("x_m", "y_m", "z_m")])
        x, left, up = (camera_of(seen[0]).inverse() * foot).position
        column, row = rgb.shape[1] / 2.0 - focal_px * left / x, rgb.shape[0] / 2.0 - focal_px * up / x
        if 0.0 <= column < rgb.shape[1] and 0.0 <= row < rgb.shape[0]:
            pictures.append(rgb)
            places.append((column, row))
    if not pictures:
        raise SystemExit("the dataset has no images of image_pick.py with the object to pick")
    return np.array(pictures), np.array(places, dtype=np.float32)


def camera_of(row: dict[str, float]) -> Pose:
    """The camera's pose of an image."""
    position = [row[f"camera_{axis}_m"] for axis in "xyz"]
    return Pose.from_wire({"position_m": position, "quaternion_xyzw": [row[f"camera_{axis}"] for axis in ("qx", "qy", "qz", "qw")]})


def learn(pictures: NDArray[np.uint8], places: Array, seed: int, epochs: int = EPOCHS) -> PlaceNetwork:
    """Cross-entropy with Adam; deterministic for the same examples and seed."""
    generator = np.random.default_rng(seed)
    views = cells(pictures)
    sizes = [side * side * inner for side, inner in zip(WINDOWS, CHANNELS[:-1])]
    weights: list[Array] = [
        generator.normal(0.0, np.sqrt(2.0 / size), (size, outer)).astype(np.float32) for size, outer in zip(sizes, CHANNELS[1:])
    ]
    biases: list[Array] = [np.zeros(outer, np.float32) for outer in CHANNELS[1:]]
    values = weights + biases
    first, second = [np.zeros_like(one) for one in values], [np.zeros_like(one) for one in values]
    steps, step = epochs * -(-len(views) // BATCH), 0
    for _ in range(epochs):
        order = generator.permutation(len(views))
        for start in range(0, len(order), BATCH):
            step += 1
            chosen = order[start : start + BATCH]
            batch, target = varied(views[chosen], places[chosen], generator)
            slopes = backward(PlaceNetwork(values[:3], values[3:]), batch, wanted(target, batch.shape[1:3]))
            rate = 4e-3 * (1.0 - (step - 1) / steps) * np.sqrt(1.0 - 0.999**step) / (1.0 - 0.9**step)
            for number, slope in enumerate(slopes):
                first[number] = 0.9 * first[number] + 0.1 * slope
                second[number] = 0.999 * second[number] + 0.001 * slope**2
                values[number] = (values[number] - rate * first[number] / (np.sqrt(second[number]) + 1e-8)).astype(np.float32)
    return PlaceNetwork(values[:3], values[3:])


def varied(views: Array, places: Array, generator: np.random.Generator) -> tuple[Array, Array]:
    """Other views of the same kind: mirrored, with exchanged and inverted colours."""
    views, places = views[..., generator.permutation(3)] * generator.choice([-1.0, 1.0]).astype(np.float32), places.copy()
    if generator.random() < 0.5:
        views, places[:, 0] = views[:, :, ::-1], CELL * views.shape[2] - places[:, 0]
    return views, places


def wanted(places: Array, shape: tuple[int, ...]) -> Array:
    """The wanted probability of each cell: a bell around the foot."""
    rows, columns = np.mgrid[: shape[0], : shape[1]] + 0.5
    away = (rows - places[:, 1, None, None] / CELL) ** 2 + (columns - places[:, 0, None, None] / CELL) ** 2
    bell = np.exp(-away / (2.0 * SPREAD**2))
    return np.asarray(bell / bell.sum(axis=(1, 2), keepdims=True), dtype=np.float32)


def backward(network: PlaceNetwork, views: Array, target: Array) -> list[Array]:
    """The slopes of the cross-entropy: those of the weights, then those of the biases."""
    scores, inputs = network.scores(views)
    share = np.exp(scores - scores.max(axis=(1, 2), keepdims=True))
    share /= share.sum(axis=(1, 2), keepdims=True)
    back = ((share - target) / len(views))[..., None]
    weights: list[Array] = []
    biases: list[Array] = []
    for number in reversed(range(len(WINDOWS))):
        seen = inputs[number]
        weights.append(seen.reshape(-1, seen.shape[-1]).T @ back.reshape(-1, back.shape[-1]))
        biases.append(back.sum(axis=(0, 1, 2)))
        if number > 0:
            back = folded(back @ network.weights[number].T, WINDOWS[number])
            back = back * (inputs[number][..., middle(WINDOWS[number], back.shape[-1])] > 0.0)
    return weights[::-1] + biases[::-1]


def middle(side: int, channels: int) -> slice:
    """The part of a window that is its own cell."""
    start = (side * side // 2) * channels
    return slice(start, start + channels)


def folded(slopes: Array, side: int) -> Array:
    """The sum of the slopes of all windows that see a cell: the reverse of `windows`."""
    count, height, width, size = slopes.shape
    channels, around = size // (side * side), side // 2
    sums = np.zeros((count, height + 2 * around, width + 2 * around, channels), np.float32)
    parts = slopes.reshape(count, height, width, side, side, channels)
    for down in range(side):
        for right in range(side):
            sums[:, down : down + height, right : right + width] += parts[:, :, :, down, right]
    return sums[:, around : around + height, around : around + width]


def main() -> None:
    """Trains on four fifths of the runs, evaluates on the rest, and writes the weights."""
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("dataset", type=Path, help="folder written by `actcheck export tables --dataset --images`")
    arguments.add_argument("--output", type=Path, default=Path(__file__).with_name("image_place.json"))
    arguments.add_argument("--seed", type=int, default=1)
    given = arguments.parse_args()
    pictures, places = examples(given.dataset)
    held = np.arange(len(pictures)) % 5 == 4
    network = learn(pictures[~held], places[~held], given.seed)
    off = np.array([np.hypot(*(np.array(network(one)) - place)) for one, place in zip(pictures[held], places[held], strict=True)])
    middle_off = np.linalg.norm(places[held] - places[~held].mean(axis=0), axis=1)
    told = f"{len(pictures)} images; on {held.sum()} held-out ones the median error is {np.median(off):.1f} pixels"
    told += f" instead of {np.median(middle_off):.1f} for the mean place"
    print(told)
    network.save(given.output, told)
    print(f"wrote the weights to {given.output} ({given.output.stat().st_size} bytes)")


if __name__ == "__main__":
    main()
