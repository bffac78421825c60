#!/usr/bin/env python3
"""Compares pattern mining of pysubgroup and SliceLine with actcheck on planted patterns: findings and times.

Run from the root of the checkout, with Cargo installed: `python3 benches/patterns_peers.py`. It creates a virtual
environment in `target/patterns_peers`, installs both from PyPI, writes the planted tables with `cargo bench --bench
patterns -- tables DIR` (10,000 runs, twelve parameters, superclasses as columns of their own), and searches for
patterns of up to three conditions. Numbers are discretised into eight bins for both, as actcheck does at first;
actcheck also tries all ranges of bins, refines bounds, simplifies patterns, corrects and confirms, which the others
leave to their users. SliceLine joins all pairs of slices in one matrix, which takes more than seven gigabytes at
depth 3 for slices of 30 runs: its slices have at least 2 % of the runs, and it is stopped if it still takes more than
MEMORY. `--tables DIR TIMES` uses existing tables and the saved output of the benchmark.
"""

import resource
import subprocess
import sys
import time
import warnings
from pathlib import Path

from environment import enter, folder_of

HERE = Path(__file__).resolve().parent
PACKAGES = ["pysubgroup==0.8.0", "sliceline==0.3.0", "pandas", "numpy"]
DEPTH = 3
CELLS = 8
TOP = 5
SUPPORT = 200
MEMORY = 4 << 30


def main():
    if sys.argv[1:2] == ["--tables"]:
        folder, times = Path(sys.argv[2]), Path(sys.argv[3]).read_text()
    else:
        folder = folder_of(__file__) / "tables"
        command = ["cargo", "bench", "--bench", "patterns", "--", "tables", str(folder)]
        times = subprocess.run(command, check=True, capture_output=True, text=True, cwd=HERE.parent).stdout
    # Set after the benchmark, which needs more memory.
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    ours = {line.split("\t")[0]: line.split("\t")[1:] for line in times.splitlines() if line.count("\t") == 2}
    for name, (secs, patterns) in ours.items():
        print(f"\n{name}: actcheck {float(secs):.3f} s, {patterns} patterns")
        table = read(folder / f"{name.replace(' ', '_')}.csv")
        for peer, ask in {"pysubgroup": pysubgroup_finds, "SliceLine": sliceline_finds}.items():
            start = time.perf_counter()
            try:
                found = ask(table)
            except MemoryError:
                print(f"  {peer}: took more than {MEMORY >> 30} GB")
                continue
            took = time.perf_counter() - start
            print(f"  {peer}: {took:.2f} s, {took / float(secs):.0f} times as long as actcheck")
            for pattern in found:
                print(f"    {pattern}")


def read(file):
    import pandas

    return pandas.read_csv(file)


def pysubgroup_finds(table):
    """Ranks by weighted relative accuracy, with pysubgroup's exhaustive search with optimistic estimates."""
    import pysubgroup

    target = pysubgroup.BinaryTarget("failed", 1)
    selectors = pysubgroup.create_selectors(table, nbins=CELLS, ignore=["failed"])
    task = pysubgroup.SubgroupDiscoveryTask(
        table, target, selectors, result_set_size=TOP, depth=DEPTH, qf=pysubgroup.WRAccQF()
    )
    with warnings.catch_warnings():
        # It divides by the size of empty subgroups.
        warnings.simplefilter("ignore", RuntimeWarning)
        result = pysubgroup.SimpleDFS().execute(task)
    return [f"{quality:.4f} {subgroup}" for quality, subgroup, *_ in result.results]


def sliceline_finds(table):
    import numpy
    import pandas
    from sliceline.slicefinder import Slicefinder

    cut = table.drop(columns="failed")
    for column in cut.select_dtypes("number"):
        cut[column] = pandas.qcut(cut[column], CELLS, duplicates="drop").astype(object)
    cut = cut.astype(object).where(cut.notna(), "none")
    finder = Slicefinder(alpha=0.95, k=TOP, max_l=DEPTH, min_sup=SUPPORT, verbose=False)
    finder.fit(cut.map(str).to_numpy(dtype=object), table["failed"].to_numpy(dtype=float))
    slices = numpy.asarray(finder.top_slices_)
    return [
        " AND ".join(f"{name}={value}" for name, value in zip(cut.columns, row) if value is not None) for row in slices
    ]


if __name__ == "__main__":
    if "--tables" not in sys.argv:
        enter(__file__, PACKAGES)
    main()
