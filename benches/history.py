"""Cost of a history of runs that are kept whole (bytes written, bytes a run, a column and a statement), and loss by kills.

    python benches/history.py ACTCHECK [RUNS [KILLS]]

Makes a campaign of RUNS runs (default: 1000), then one that is killed KILLS times (default: 40) at random moments and
resumed. Required: at most 3 times the final size written, at most 50 bytes a statement, and no listed run lost. Exits with
1 if a run that was listed before a kill is missing or differs after it, or if the resumed campaign differs from the first.
"""

import csv
import io
import pathlib
import random
import resource
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
CONFIG = ROOT / "configs/perceive.toml"
COUNT = "SELECT (COUNT(*) AS ?n) { { ?s ?p ?o } UNION { GRAPH ?g { ?s ?p ?o } } }"
MOST_RATIO = 3.0
MOST_A_STATEMENT = 50.0
# Size of the blocks in which the operating system counts written bytes.
BLOCK = 512


def size(folder, pattern="*"):
    return sum(file.stat().st_size for file in folder.rglob(pattern) if file.is_file())


def ask(program, *args):
    return subprocess.run([program, *args], capture_output=True, text=True)


def rows(program, history):
    """The listed runs without ids and times, which differ between campaigns."""
    listed = ask(program, "list", "--history", history, "--format", "csv").stdout
    left_out = {"run", "campaign", "started"}
    return {
        row["index"]: tuple(value for key, value in row.items() if key not in left_out)
        for row in csv.DictReader(io.StringIO(listed))
    }


def campaign(program, history, runs):
    return [program, "run", str(CONFIG), "--runs", str(runs), "--history", str(history), "--jobs", "2", "--quiet"]


def cost(program, history, runs):
    """Makes a campaign and prints its cost. Returns its runs."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(campaign(program, history, runs), stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    written, whole = (after.ru_oublock - before.ru_oublock) * BLOCK, size(history)
    columns = {name: size(history / "campaigns", f"*.{name}") for name in ("runs", "details", "states", "motion")}
    answer = ask(program, "query", COUNT, "--history", str(history), "--format", "csv").stdout
    statements = int(answer.split()[-1])
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    print(f"{runs} runs: {cpu:.1f} CPU-s, {after.ru_maxrss / 1024:.0f} MB at most, {whole / runs / 1000:.1f} kB a run")
    print(f"written: {written / 1e6:.1f} MB, {written / whole:.2f} times the final size (at most {MOST_RATIO})")
    print(", ".join(f"{name} {bytes_of / runs:.0f}" for name, bytes_of in columns.items()), "bytes a run")
    stated = sum(columns.values()) - columns["motion"]
    print(f"{stated / statements:.0f} bytes a statement (at most {MOST_A_STATEMENT:.0f})")
    return rows(program, str(history))


def killed(program, history, runs, kills, reference):
    """Kills a campaign at random moments and resumes it. Returns the number of runs that were lost or differ."""
    random.seed(3)
    first = campaign(program, history, runs)
    again = [program, "run", "--resume", "--history", str(history), "--jobs", "2", "--quiet"]
    bad = done = ended = 0
    while done < kills:
        started = rows(program, str(history)) if history.exists() else {}
        process = subprocess.Popen(again if started else first, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        time.sleep(random.uniform(0.1, 1.5))
        listed = rows(program, str(history))
        if process.poll() is not None:
            ended += 1
            bad += rows(program, str(history)) != reference
            history = history.with_name(f"killed-{ended}")
            first[first.index("--history") + 1] = again[again.index("--history") + 1] = str(history)
            continue
        process.kill()
        process.wait()
        done += 1
        there = rows(program, str(history))
        bad += sum(there.get(index) != row or reference.get(index) != row for index, row in listed.items())
    subprocess.run(again, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    whole = rows(program, str(history)) == reference
    print(f"{done} kills, {ended} campaigns complete before: {bad} runs lost, last campaign {'equal' if whole else 'DIFFERS'}")
    return bad + (not whole)


def main():
    program, *numbers = sys.argv[1:]
    runs, kills = (int(given) for given in (numbers + [1000, 40][len(numbers) :]))
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        reference = cost(program, folder / "whole", runs)
        sys.exit(1 if killed(program, folder / "killed", runs, kills, reference) else 0)


if __name__ == "__main__":
    main()
