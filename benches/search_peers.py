#!/usr/bin/env python3
"""Counts the samples that VerifAI's cross-entropy and Hypothesis with `target()` need on the functions of `search.rs`.

Run from the root of the checkout, with Cargo installed: `python3 benches/search_peers.py [seeds]` (20 by default). It
creates a virtual environment in `target/search_peers`, installs both from PyPI, checks its functions against those of
`cargo bench --bench search -- points`, and prints the same columns as the benchmark, except failure rates, which the
two do not estimate. `--points FILE` reads the points from a file instead of running Cargo.
"""

import math
import statistics
import subprocess
import sys
from pathlib import Path

from environment import enter

HERE = Path(__file__).resolve().parent
PACKAGES = ["verifai==2.2.0", "hypothesis==6.170.15", "setuptools<81"]

WIDTH = 8
MOST_SAMPLES = 10_000
STEPS = [
    0.921_599_319_633_983,
    0.849_345_305_949_820,
    0.782_756_056_097_671,
    0.721_387_448_738_994,
    0.664_830_181_950_351,
    0.612_707_043_357_581,
    0.564_670_394_293_296,
    0.520_399_851_198_154,
]
VOLUMES = [0.01, 0.0006]
SHAPES = ["smooth", "disjoint", "deceptive", "flat"]


class Planted:
    """A planted region, as in `search.rs`."""

    def __init__(self, shape, volume, seed):
        self.shape, self.volume, self.seed = shape, volume, seed
        self.radius = (volume * 24.0 / math.pi**4) ** (1.0 / 8.0)
        radius = self.radius
        self.centre = [radius + (1.0 - 2.0 * radius) * self.placed(axis, 0) for axis in range(WIDTH)]

    def placed(self, axis, which):
        return math.fmod((2 * self.seed + which + 1) * STEPS[axis], 1.0)

    def margin(self, point):
        """Returns the margin; it is negative if the point fails."""
        if self.shape == "disjoint":
            return min(self.box_margin(point, 0), self.box_margin(point, 1))
        depth = math.dist(point, self.centre) - self.radius
        if self.shape == "deceptive" and depth >= 0.0:
            return 0.05 + math.dist(point, [0.9 if value < 0.5 else 0.1 for value in self.centre])
        if self.shape == "flat" and depth >= 0.0:
            return 1.0
        return depth

    def box_margin(self, point, which):
        side = (self.volume / 2.0 / 0.4) ** (1.0 / 7.0) / 2.0
        outside, inside = 0.0, -math.inf
        for axis, value in enumerate(point):
            if axis == 0:
                centre, half = 0.25 + 0.5 * which, 0.2
            else:
                centre, half = side + (1.0 - 2.0 * side) * self.placed(axis, which), side
            past = abs(value - centre) - half
            outside += max(past, 0.0) ** 2
            inside = max(inside, past)
        return math.sqrt(outside) if outside > 0.0 else inside


def check_points(lines):
    """Checks that both implementations compute the same margins."""
    checked = failing = 0
    for line in lines:
        shape, volume, seed, margin, *point = line.split()
        ours = Planted(shape, float(volume), int(seed)).margin([float(value) for value in point])
        if abs(ours - float(margin)) > 1e-9:
            sys.exit(f"the functions differ: {ours} here, there {line}")
        checked += 1
        failing += ours < 0.0
    if checked == 0 or failing == 0:
        sys.exit("no points to check the functions with")
    print(f"the functions agree at {checked} points, {failing} of them failing")


def first_of_random(planted):
    """Random sampling, to make the two benchmarks comparable."""
    import numpy

    generator = numpy.random.default_rng(planted.seed)
    for samples in range(1, MOST_SAMPLES + 1):
        if planted.margin(generator.random(WIDTH).tolist()) < 0.0:
            return samples
    return MOST_SAMPLES


def first_of_verifai(planted, tuned):
    """VerifAI's cross-entropy with its defaults; tuned: threshold at the 10 % quantile of 200 uncounted samples."""
    import numpy
    from dotmap import DotMap
    from verifai.features import Box
    from verifai.samplers.cross_entropy import CrossEntropySampler

    numpy.random.seed(planted.seed)
    threshold = 0.0
    if tuned:
        margins = [planted.margin(numpy.random.random(WIDTH).tolist()) for _ in range(200)]
        threshold = float(numpy.quantile(margins, 0.1))
    parameters = DotMap(alpha=0.9, thres=threshold)
    parameters.cont.buckets, parameters.cont.dist, parameters.disc.dist = 5, None, None
    # Its axes range over [-1, 1] internally; the box maps them.
    sampler = CrossEntropySampler(Box(*[(0.0, 1.0)] * WIDTH), parameters)
    for samples in range(1, MOST_SAMPLES + 1):
        sample, info = sampler.getSample()
        margin = planted.margin(list(sample))
        if margin < 0.0:
            return samples
        sampler.update(sample, info, margin)
    return MOST_SAMPLES


def first_of_hypothesis(planted):
    """Hypothesis, with `target()` set to minimise the margin."""
    from hypothesis import HealthCheck, Phase, given, seed, settings, target
    from hypothesis import strategies as st

    class Found(Exception):
        pass

    samples, first = 0, None

    @seed(planted.seed)
    @settings(
        max_examples=MOST_SAMPLES,
        database=None,
        deadline=None,
        phases=[Phase.generate, Phase.target],
        suppress_health_check=list(HealthCheck),
    )
    @given(st.tuples(*[st.floats(0.0, 1.0)] * WIDTH))
    def property_holds(point):
        nonlocal samples, first
        samples += 1
        margin = planted.margin(point)
        target(-margin)
        if margin < 0.0:
            first = samples if first is None else first
            raise Found

    try:
        property_holds()
    except Found:
        pass
    return MOST_SAMPLES if first is None else first


PEERS = {
    "random (numpy)": first_of_random,
    "verifai ce": lambda planted: first_of_verifai(planted, tuned=False),
    "verifai ce tuned": lambda planted: first_of_verifai(planted, tuned=True),
    "hypothesis": first_of_hypothesis,
}


def compare(seeds):
    print(f"{seeds} seeds")
    print("function    volume  strategy          median  ratio")
    for shape in SHAPES:
        for volume in VOLUMES:
            random = None
            for name, first in PEERS.items():
                found = sorted(first(Planted(shape, volume, seed)) for seed in range(seeds))
                median = statistics.median_high(found)
                random = random or median
                print(f"{shape:<10} {100 * volume:>5.2f} %  {name:<16} {median:>6} {median / random:>6.2f}", flush=True)


def main():
    enter(__file__, PACKAGES)
    arguments = sys.argv[1:]
    if "--points" in arguments:
        at = arguments.index("--points")
        text = Path(arguments[at + 1]).read_text()
        del arguments[at : at + 2]
    else:
        command = ["cargo", "bench", "--quiet", "--bench", "search", "--", "points"]
        text = subprocess.run(command, check=True, capture_output=True, text=True, cwd=HERE.parent).stdout
    check_points(text.splitlines())
    compare(int(arguments[0]) if arguments else 20)


if __name__ == "__main__":
    main()
