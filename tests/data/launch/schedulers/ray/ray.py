"""A substitute for the package: tasks are threads of this process. The first attempt of the tasks in $SCHEDULER/lose fails
in the middle, as if their workers were killed."""

import os
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor
from concurrent.futures import wait as wait_for
from pathlib import Path

POOL = ThreadPoolExecutor(2)
LOSE = Path(os.environ["SCHEDULER"], "lose")


def init(address=None, log_to_driver=True):
    if address:
        raise ConnectionError(f"Could not find any running Ray instance at {address}")


class Task:
    def __init__(self, function, max_retries):
        self.function, self.max_retries = function, max_retries

    def attempt(self, number, settings):
        lost = LOSE.read_text().split() if LOSE.exists() else []
        if str(number) not in lost:
            return self.function(number, settings)
        LOSE.unlink()
        program = Path(os.environ["SCHEDULER"], "cut_short")
        program.write_text(f"#!/bin/sh\nexec 3<&0\n'{settings['program']}' \"$@\" <&3 & sleep 0.3; kill -s KILL $!; exit 137\n")
        program.chmod(0o755)
        return self.function(number, {**settings, "program": str(program)})

    def run(self, *arguments):
        for attempt in range(self.max_retries + 1):
            try:
                return self.attempt(*arguments)
            except RuntimeError:
                if attempt == self.max_retries:
                    raise

    def remote(self, *arguments):
        return POOL.submit(self.run, *arguments)


def remote(num_cpus, max_retries, retry_exceptions, memory=None):
    return lambda function: Task(function, max_retries)


def wait(results, timeout):
    done, left = wait_for(results, timeout, FIRST_COMPLETED)
    return list(done), list(left)


def get(result):
    return result.result()


def shutdown():
    POOL.shutdown()
