"""A small network that predicts the error of an object's perceived position from the depth camera's view of it.

The frame of the view: x points horizontally from the camera to the perceived position; y left; z up.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from actcheck import Pose, Thing
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Inputs of the network. Shape: 8. Unit: metres.
FEATURES = ("ahead", "left", "depth", "width", "height", "seen_width", "seen_depth", "seen_height")


def features(seen: Thing, shown: Thing) -> Array:
    """Input features: the box of the camera's points relative to the object of the reference perception."""
    ahead, left, _ = shown.pose.rotation.T @ (shown.pose.position - seen.pose.position)
    return np.array([ahead, left, *shown.size_m, *seen.size_m])


@dataclass(frozen=True)
class Network:
    """One hidden layer in parallel with a linear skip connection."""

    mean: Array
    scale: Array
    hidden: Array
    hidden_bias: Array
    out: Array
    straight: Array
    bias: Array

    @classmethod
    def load(cls, file: Path) -> Network:
        """Loads a file written by `save`."""
        stored = json.loads(file.read_text())
        return cls(**{name: np.array(stored[name], dtype=np.float64) for name in cls.__dataclass_fields__})

    def save(self, file: Path, note: str) -> None:
        """Writes the weights, with a note about their training."""
        weights = {name: np.round(getattr(self, name), 6).tolist() for name in self.__dataclass_fields__}
        file.write_text(json.dumps({"note": note, "features": FEATURES} | weights, indent=None) + "\n")

    def __call__(self, inputs: Array) -> Array:
        """Predicts the object's offset ahead and to the left. Shape: … × 8 to … × 2. Unit: metres."""
        scaled = (inputs - self.mean) / self.scale
        result: Array = np.tanh(scaled @ self.hidden + self.hidden_bias) @ self.out + scaled @ self.straight + self.bias
        return result


def corrected(seen: Thing, shown: Thing, network: Network) -> Thing:
    """The object at the position that the network predicts."""
    ahead, left = network(features(seen, shown))
    way = shown.pose.rotation @ np.array([ahead, left, 0.0])
    return Thing(seen.id, Pose(seen.pose.position + way, seen.pose.rotation), seen.size_m, seen.category)
