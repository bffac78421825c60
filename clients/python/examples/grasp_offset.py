"""A small network that says how far a thing is from where it seems to be, by what the depth camera shows around there.

The view's frame: x from the camera to where the thing seems to be, level; y to the left of it; z up.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from actcheck import Pose, Thing
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: What the network sees. Shape: 8. Unit: metres.
FEATURES = ("ahead", "left", "depth", "width", "height", "seen_width", "seen_depth", "seen_height")


def features(seen: Thing, shown: Thing) -> Array:
    """What is known of a thing: the box of what the camera shows against what the reference perception says."""
    ahead, left, _ = shown.pose.rotation.T @ (shown.pose.position - seen.pose.position)
    return np.array([ahead, left, *shown.size_m, *seen.size_m])


@dataclass(frozen=True)
class Network:
    """One hidden layer beside a linear way through."""

    mean: Array
    scale: Array
    hidden: Array
    hidden_bias: Array
    out: Array
    straight: Array
    bias: Array

    @classmethod
    def load(cls, file: Path) -> Network:
        """From a file that `save` wrote."""
        stored = json.loads(file.read_text())
        return cls(**{name: np.array(stored[name], dtype=np.float64) for name in cls.__dataclass_fields__})

    def save(self, file: Path, note: str) -> None:
        """Writes it, with how it came about."""
        weights = {name: np.round(getattr(self, name), 6).tolist() for name in self.__dataclass_fields__}
        file.write_text(json.dumps({"note": note, "features": FEATURES} | weights, indent=None) + "\n")

    def __call__(self, inputs: Array) -> Array:
        """How far ahead and to the left it is. Shape: … × 8 to … × 2. Unit: metres."""
        scaled = (inputs - self.mean) / self.scale
        result: Array = np.tanh(scaled @ self.hidden + self.hidden_bias) @ self.out + scaled @ self.straight + self.bias
        return result


def corrected(seen: Thing, shown: Thing, network: Network) -> Thing:
    """The thing where the network says that it is."""
    ahead, left = network(features(seen, shown))
    way = shown.pose.rotation @ np.array([ahead, left, 0.0])
    return Thing(seen.id, Pose(seen.pose.position + way, seen.pose.rotation), seen.size_m, seen.category)
