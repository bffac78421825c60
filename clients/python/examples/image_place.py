"""A small convolutional network, in numpy, that finds the foot of an object in a colour image."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]

#: Pixels of the image in a cell of the network, in each direction.
CELL = 4
#: Sides of the windows of the layers. Unit: cells.
WINDOWS = (5, 7, 3)
#: Distance around the best cell over which the place is averaged. Unit: cells.
AROUND = 2


def cells(rgb: NDArray[np.uint8]) -> Array:
    """The network's view of images: means over cells, relative to the image's own. Shape: … × height × width × 3 to … / CELL."""
    *many, height, width, _ = rgb.shape
    shape = (*many, height // CELL, CELL, width // CELL, CELL, 3)
    means = (rgb.astype(np.float32) / 255.0).reshape(shape).mean(axis=(-2, -4))
    return np.asarray((means - means.mean(axis=(-2, -3), keepdims=True)) / 0.25, dtype=np.float32)


def windows(values: Array, side: int) -> Array:
    """The surroundings of each cell, zero beyond the border. Shape: n × height × width × channels to … × side² channels."""
    around = side // 2
    padded = np.pad(values, ((0, 0), (around, around), (around, around), (0, 0)))
    seen = np.lib.stride_tricks.sliding_window_view(padded, (side, side), axis=(1, 2))
    return seen.transpose(0, 1, 2, 4, 5, 3).reshape(*values.shape[:3], -1)


@dataclass(frozen=True)
class PlaceNetwork:
    """Three layers; the last one gives each cell a score, whose softmax is the probability that the foot is there."""

    weights: list[Array]
    biases: list[Array]

    @classmethod
    def load(cls, file: Path) -> PlaceNetwork:
        """Loads a file written by `save`."""
        stored = json.loads(file.read_text())
        return cls(*([np.array(one, dtype=np.float32) for one in stored[name]] for name in ("weights", "biases")))

    def save(self, file: Path, note: str) -> None:
        """Writes the weights, with a note about their training."""
        rounded = {name: [np.round(one.astype(float), 4).tolist() for one in getattr(self, name)] for name in ("weights", "biases")}
        file.write_text(json.dumps({"note": note} | rounded) + "\n")

    def scores(self, views: Array) -> tuple[Array, list[Array]]:
        """The score of each cell, and the inputs of the layers. Shape: n × height × width."""
        inputs: list[Array] = []
        values = views
        for number, (weight, bias, side) in enumerate(zip(self.weights, self.biases, WINDOWS, strict=True)):
            inputs.append(windows(values, side))
            values = inputs[-1] @ weight + bias
            if number + 1 < len(self.weights):
                values = np.maximum(values, 0.0)
        return values[..., 0], inputs

    def __call__(self, rgb: NDArray[np.uint8]) -> tuple[float, float]:
        """The column and row of the foot in an image. Unit: pixels."""
        scores = self.scores(cells(rgb[None]))[0][0]
        row, column = np.unravel_index(int(scores.argmax()), scores.shape)
        top, left = max(0, int(row) - AROUND), max(0, int(column) - AROUND)
        near = scores[top : top + 2 * AROUND + 1, left : left + 2 * AROUND + 1]
        share = np.exp(near - near.max())
        share /= share.sum()
        rows, columns = np.mgrid[: near.shape[0], : near.shape[1]]
        return (
            CELL * (left + float((share * columns).sum()) + 0.5),
            CELL * (top + float((share * rows).sum()) + 0.5),
        )
