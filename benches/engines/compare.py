#!/usr/bin/env python3
"""Compares `actcheck datalog` with other engines on the same transitive closure.

    python3 benches/engines/compare.py [--actcheck PROGRAM] [--rounds N] [--by-hand]

Makes a random graph of 2,000 nodes and 6,000 edges (as in benches/rules.rs; its closure has some 3.6 million tuples),
runs each engine in a process of its own, checks that all count the same tuples, and prints seconds and ratios. Seconds
are the wall time of the whole process, including parsing: the fastest of the rounds, in which the engines alternate.

Engines: actcheck (`make`), SWI-Prolog with tabling (Debian: swi-prolog-nox), clingo (from PyPI, in a virtual
environment in a temporary folder). `--by-hand` adds rules compiled by hand with datafrog, as measured by `cargo bench
--bench rules`: evaluation only, without start and parsing.
"""

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
NODES, EDGES = 2_000, 6_000


def edges():
    """Returns the edges of a reproducible random graph: xorshift64, as in benches/rules.rs."""
    state, mask = 88_172_645_463_325_252, (1 << 64) - 1

    def draw():
        nonlocal state
        state ^= (state << 13) & mask
        state ^= state >> 7
        state ^= (state << 17) & mask
        return state % NODES

    return [(draw(), draw()) for _ in range(EDGES)]


class Missing(Exception):
    """An engine is not installed; the message explains how to install it."""


def actcheck(folder, graph, program):
    found = shutil.which(program)
    if not found:
        raise Missing(f"no program `{program}`: build it with `make`, or name another with --actcheck")
    facts = "".join(f"e({a}, {b}) .\n" for a, b in graph)
    (folder / "closure.rls").write_text("p(?x, ?y) :- e(?x, ?y) .\np(?x, ?z) :- p(?x, ?y), e(?y, ?z) .\n" + facts)
    command = [str(Path(found).resolve()), "datalog", "closure.rls", "--max-tuples", "100000000", "--max-time", "10m"]
    return command, r"^\s*p\s+(\d+)"


def swi(folder, graph):
    found = shutil.which("swipl")
    if not found:
        raise Missing("no program `swipl`: apt-get install swi-prolog-nox")
    facts = "".join(f"e({a}, {b}).\n" for a, b in graph)
    rules = ":- table p/2.\np(X, Y) :- e(X, Y).\np(X, Z) :- p(X, Y), e(Y, Z).\n"
    (folder / "closure.pl").write_text(rules + facts)
    goal = "aggregate_all(count, p(_, _), N), format('p ~w~n', [N]), halt"
    # The default of 1 GB is too small for tables of this size.
    return [found, "--stack-limit=4g", "--table-space=8g", "-q", "-g", goal, "closure.pl"], r"^p (\d+)"


def clingo(folder, graph):
    environment = folder / "environment"
    made = subprocess.run([sys.executable, "-m", "venv", environment], capture_output=True, text=True)
    python = environment / "bin" / "python"
    if made.returncode == 0:
        made = subprocess.run([python, "-m", "pip", "install", "-q", "clingo"], capture_output=True, text=True)
    if made.returncode != 0:
        said = (made.stderr or made.stdout).strip().splitlines()
        raise Missing("clingo could not be installed: " + (said[-1] if said else "no virtual environment"))
    facts = "".join(f"e({a},{b}).\n" for a, b in graph)
    (folder / "closure.lp").write_text("p(X,Y) :- e(X,Y).\np(X,Z) :- p(X,Y), e(Y,Z).\n" + facts)
    # Grounding alone computes the closure of a program without choices.
    (folder / "ground.py").write_text(
        "import clingo\n"
        "control = clingo.Control()\n"
        "control.load('closure.lp')\n"
        "control.ground([('base', [])])\n"
        "print('p', sum(1 for _ in control.symbolic_atoms.by_signature('p', 2)))\n"
    )
    return [str(python), "ground.py"], r"^p (\d+)"


def measured(command, pattern, folder):
    """Returns seconds and number of tuples of one run."""
    start = time.perf_counter()
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    seconds = time.perf_counter() - start
    count = re.search(pattern, done.stdout, re.MULTILINE)
    if done.returncode != 0 or not count:
        sys.exit(f"{' '.join(command)} failed:\n{done.stdout}{done.stderr}")
    return seconds, int(count.group(1))


def by_hand():
    """Returns seconds and number of tuples of the rules compiled by hand."""
    command = ["cargo", "bench", "--locked", "--bench", "rules", "--", "closure"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    found = re.search(r"transitive closure, (\d+) tuples: .* by hand ([\d.]+) s", done.stdout)
    if done.returncode != 0 or not found:
        sys.exit(f"{' '.join(command)} failed:\n{done.stdout}{done.stderr}")
    return float(found.group(2)), int(found.group(1))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--actcheck", default=str(ROOT / "actcheck"), help="the program (default: ./actcheck of this checkout)")
    parser.add_argument("--rounds", type=int, default=3, help="runs of each engine; the fastest counts (default: 3)")
    parser.add_argument("--by-hand", action="store_true", help="measure rules compiled by hand, too (builds the benchmark)")
    args = parser.parse_args()
    graph = edges()
    with tempfile.TemporaryDirectory(prefix="engines-") as name:
        folder = Path(name)
        engines, missing = {}, []
        makers = {
            "actcheck": lambda: actcheck(folder, graph, args.actcheck),
            "SWI-Prolog, tabling": lambda: swi(folder, graph),
            "clingo, grounding": lambda: clingo(folder, graph),
        }
        for title, make in makers.items():
            try:
                engines[title] = make()
            except Missing as reason:
                missing.append(f"{title} was left out: {reason}")
        results = {}
        for _ in range(max(args.rounds, 1)):
            for title, (command, pattern) in engines.items():
                seconds, tuples = measured(command, pattern, folder)
                best = min(seconds, results.get(title, (seconds, 0))[0])
                results[title] = (best, tuples)
    if args.by_hand:
        results["datafrog by hand, evaluation only"] = by_hand()
    if len({tuples for _, tuples in results.values()}) > 1:
        sys.exit(f"the engines don't agree: {results}")
    ours = results.get("actcheck", (None,))[0]
    print(f"{'engine':<36} {'tuples':>9} {'seconds':>8} {'actcheck takes':>15}")
    for title, (seconds, tuples) in results.items():
        ratio = f"{ours / seconds:.2f} ×" if ours else ""
        print(f"{title:<36} {tuples:>9} {seconds:>8.2f} {ratio:>15}")
    for reason in missing:
        print(reason)
    slow = [t for t in results if t.startswith(("SWI", "clingo")) and ours and ours > results[t][0] / 2]
    if slow:
        sys.exit(f"actcheck takes more than half the time of {' and '.join(slow)}")
    sys.exit(1 if missing else 0)


main()
