"""Launches and merges that are killed at random moments: is the final result that of one that nobody disturbed?

    python3 benches/kills.py ACTCHECK [KILLS]

A launch on this machine and a merge of its shards are each killed until there were so many kills; a command that ends
before it is killed begins again with a new history. After each complete command, and at the end, every status, score
and trace digest is compared. Exits with 1 if a result differs.
"""

import pathlib
import random
import shutil
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = str(pathlib.Path(sys.argv[1]).resolve())
KILLS = int(sys.argv[2]) if len(sys.argv) > 2 else 40
CONFIG = str(ROOT / "configs/pick.toml")
RUNS, SHARDS, PARTS = "48", "8", 12


def done(*arguments):
    found = subprocess.run([PROGRAM, *arguments], capture_output=True, text=True)
    if found.returncode not in (0, 1):
        sys.exit(f"{arguments}: exit code {found.returncode}\n{found.stderr}")
    return found.stdout


def rows(history):
    """Status, score and trace digest of each run, without its id."""
    return sorted(line.split(",", 1)[1] for line in done("list", "--format", "csv", "--history", str(history)).splitlines()[1:])


def removed(history):
    for path in history.parent.glob(history.name + "*"):
        shutil.rmtree(path) if path.is_dir() else path.unlink()


def disturbed(name, command, history, expected):
    """Kills a command again and again, and lets the last one finish. Returns the number of wrong results."""
    removed(history)
    started = time.monotonic()
    done(*command)
    whole = time.monotonic() - started
    wrong, complete, killed = int(rows(history) != expected), 1, 0
    removed(history)
    while killed < KILLS:
        process = subprocess.Popen([PROGRAM, *command], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            process.wait(random.uniform(0.02, 0.8) * whole)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            killed += 1
            continue
        complete += 1
        wrong += rows(history) != expected
        removed(history)
    done(*command)
    wrong += rows(history) != expected
    print(f"{name}: {killed} kills, {complete + 1} complete commands, {wrong} with other results", flush=True)
    return wrong


def main():
    random.seed(2)
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        done("run", CONFIG, "--runs", RUNS, "--jobs", "2", "--history", str(folder / "whole"))
        expected = rows(folder / "whole")
        launch = ["launch", CONFIG, "--on", "local", "--runs", RUNS, "--shards", SHARDS, "--jobs", "2"]
        history = folder / "launched"
        wrong = disturbed("launch", [*launch, "--history", str(history)], history, expected)
        parts = [str(folder / f"part{part}") for part in range(1, PARTS + 1)]
        for number, part in enumerate(parts, start=1):
            done("run", CONFIG, "--runs", RUNS, "--jobs", "2", "--shard", f"{number}/{PARTS}", "--history", part)
        history = folder / "merged"
        wrong += disturbed("merge", ["merge", *parts, "--into", str(history)], history, expected)
    sys.exit(wrong > 0)


if __name__ == "__main__":
    main()
