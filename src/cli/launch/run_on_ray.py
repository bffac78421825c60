"""Runs the shards of a launch as tasks of Ray: run_on_ray.py SETTINGS

Each task starts a process of actcheck whose standard input is a pipe from the worker. The process ends when the pipe
closes, so that it never outlives a worker or a node that was lost. This program ends in the same way when the process
that started it has ended, and Ray then ends the tasks.

Exit codes: 0 all tasks have ended, 3 the package is missing, 4 the cluster can't be reached.
"""

import json
import os
import subprocess
import sys
import threading

# Exit codes of `actcheck launch-task` after which the same shard need not be started again.
COMPLETE, FAULT = 0, 2


def end_with_parent():
    # A buffered reader would abort the interpreter's shutdown.
    while os.read(0, 4096):
        pass
    os._exit(130)


def run_shard(number, settings):
    os.chdir(settings["cwd"])
    command = [settings["program"], "launch-task", settings["folder"], str(number), "--with-parent"]
    log = os.path.join(settings["folder"], "logs", f"{number}.log")
    with open(log, "ab") as out:
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=out, stderr=out)
        try:
            code = process.wait()
        finally:
            process.stdin.close()
    if code not in (COMPLETE, FAULT):
        raise RuntimeError(f"shard {number} ended with code {code}")


def main():
    with open(sys.argv[1]) as file:
        settings = json.load(file)
    threading.Thread(target=end_with_parent, daemon=True).start()
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    try:
        import ray
    except ImportError as error:
        print(f"{sys.executable}: {error}", file=sys.stderr)
        return 3
    try:
        ray.init(address=settings["address"], log_to_driver=False)
    except Exception as error:
        print(error, file=sys.stderr)
        return 4
    needs = {"num_cpus": settings["cpus"], "max_retries": settings["tries"] - 1, "retry_exceptions": True}
    if settings["memory"]:
        needs["memory"] = settings["memory"]
    task = ray.remote(**needs)(run_shard)
    waiting, running = settings["shards"][::-1], []
    while waiting or running:
        while waiting and len(running) < settings["parallel"]:
            running.append(task.remote(waiting.pop(), settings))
        ended, running = ray.wait(running, timeout=1)
        for result in ended:
            try:
                ray.get(result)
            except Exception as error:
                print(error, file=sys.stderr)
    ray.shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
