"""How much does a campaign cost with readers of its history beside it, and how soon do they answer?

Runs the same campaign in pairs, alone and beside a process that asks the growing history once a second, in turns of
order. Prints the ratio of the campaign's CPU times in each pair with their median, and the CPU and wall times of the
answers. With HISTORY, each campaign is added to a copy of that history, so that the answers are about many runs.

    python3 benches/readers.py [PROGRAM [PAIRS [RUNS [HISTORY]]]]
"""

import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import threading
import time

PROGRAM = os.path.abspath(sys.argv[1]) if len(sys.argv) > 1 else "actcheck"
PAIRS = int(sys.argv[2]) if len(sys.argv) > 2 else 5
RUNS = sys.argv[3] if len(sys.argv) > 3 else "100"
STORED = os.path.abspath(sys.argv[4]) if len(sys.argv) > 4 else None
ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
# Some answers depend on all runs, some on one.
QUESTIONS = {
    "list": ["list"],
    "list --failed": ["list", "--failed"],
    "show": ["show", "@last"],
    "query, one run": ["query", "SELECT ?p ?v WHERE { ?run act:index 0 ; ?p ?v } LIMIT 20"],
    "query, all outcomes": ["query", "--named", "failure-rates"],
}
PAUSE_SECS = 1.0


def asked(history, done, times, faults):
    """Asks all questions again and again, one at a time."""
    while not done.is_set():
        for name, question in QUESTIONS.items():
            started = time.monotonic()
            command = [PROGRAM, *question, "--history", history]
            process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
            errors = process.stderr.read()
            _, status, usage = os.wait4(process.pid, 0)
            wall = time.monotonic() - started
            times.setdefault(name, []).append((wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024))
            # Before the first run, there is nothing to show.
            if os.waitstatus_to_exitcode(status) > 1 and "H003" not in errors and "H008" not in errors:
                faults.append(errors)
            if done.wait(PAUSE_SECS):
                break


def campaign(folder, with_reader, times, faults):
    """CPU time of one campaign, without that of its readers. Unit: seconds."""
    history = os.path.join(folder, "h")
    if STORED:
        shutil.copytree(STORED, history)
    command = [PROGRAM, "run", "configs/pick.toml", "--runs", RUNS, "--jobs", "1", "--history", history]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    done = threading.Event()
    reader = threading.Thread(target=asked, args=(history, done, times, faults))
    if with_reader:
        reader.start()
    errors = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    done.set()
    if with_reader:
        reader.join()
    if os.waitstatus_to_exitcode(status) > 1:
        sys.exit(f"the campaign failed: {errors.decode()}")
    return usage.ru_utime + usage.ru_stime


def main():
    ratios, times, faults = [], {}, []
    for pair in range(PAIRS):
        secs = {}
        for with_reader in (False, True) if pair % 2 == 0 else (True, False):
            with tempfile.TemporaryDirectory() as folder:
                secs[with_reader] = campaign(folder, with_reader, times, faults)
        ratios.append(secs[True] / secs[False])
        print(f"pair {pair + 1}: {secs[False]:.2f} s alone, {secs[True]:.2f} s beside readers: {ratios[-1]:.3f}", flush=True)
    print(f"median ratio of CPU times: {statistics.median(ratios):.3f}")
    for name, answers in times.items():
        walls, cpus, sizes = zip(*answers)
        print(
            f"{name}: {len(walls)} answers, wall median {statistics.median(walls):.2f} s, longest {max(walls):.2f} s, "
            f"CPU median {statistics.median(cpus):.2f} s, longest {max(cpus):.2f} s, memory {max(sizes):.0f} MB"
        )
    print(f"{len(faults)} refused")
    for fault in faults[:3]:
        print(fault)


if __name__ == "__main__":
    main()
