"""Measures the cost of recording: CPU time and bytes for each step, beside those of the environment alone.

`python benches/recorder_python.py robosuite Lift Stack PickPlaceCan Door` or `… libero libero_spatial 0 1 2`, in an environment with
that package, mujoco, mcap and actcheck. The time is that of one process: other programs should be quiet.
"""

from __future__ import annotations

import argparse
import logging
import os
import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import actcheck

os.environ.setdefault("MUJOCO_GL", "disabled")
EPISODES = 5

Start = Callable[[Any, int], None]


def robosuite_environment(task: str) -> tuple[Any, Start, int]:
    """An environment without a renderer, the start of an episode, and the number of actions."""
    import robosuite

    environment = robosuite.make(
        task, robots="Panda", has_renderer=False, has_offscreen_renderer=False, use_camera_obs=False, control_freq=20, ignore_done=True
    )

    def start(environment: Any, seed: int) -> None:
        np.random.seed(seed)
        environment.reset()

    return environment, start, environment.action_dim


def libero_environment(suite: str, task: int) -> tuple[Any, Start, int]:
    """As `robosuite_environment`, of a task of LIBERO."""
    from libero.libero import benchmark
    from libero.libero.envs.env_wrapper import ControlEnv

    tasks = benchmark.get_benchmark_dict()[suite]()
    environment = ControlEnv(
        bddl_file_name=tasks.get_task_bddl_file_path(task),
        has_renderer=False,
        has_offscreen_renderer=False,
        use_camera_obs=False,
        ignore_done=True,
        horizon=10_000,
    )
    states = tasks.get_task_init_states(task)

    def start(environment: Any, seed: int) -> None:
        environment.seed(seed)
        environment.reset()
        environment.set_init_state(states[seed % len(states)])

    return environment, start, 7


class Clock:
    """CPU time inside the recorder's own functions."""

    def __init__(self, recorder: actcheck.Recorder) -> None:
        self.seconds = 0.0
        for name in ("before_step", "after_step", "end_episode"):
            setattr(recorder, name, self._timed(getattr(recorder, name)))

    def _timed(self, function: Callable[..., Any]) -> Callable[..., Any]:
        def timed(*arguments: Any) -> Any:
            begin = time.process_time()
            returned = function(*arguments)
            self.seconds += time.process_time() - begin
            return returned

        return timed


def measure(name: str, environment: Any, start: Start, width: int, steps: int) -> None:
    """Prints the cost of recording one environment: the median of the episodes."""
    alone, inside, sizes = [], [], []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(EPISODES):
            actions = np.random.default_rng(seed).uniform(-0.5, 0.5, (steps, width))
            with actcheck.record(environment, Path(folder)) as recorder:
                start(environment, seed)
                clock = Clock(recorder)
                begin = time.process_time()
                for action in actions:
                    environment.step(action)
                recorder.end_episode()
                whole = time.process_time() - begin
            alone.append((whole - clock.seconds) / steps)
            inside.append(clock.seconds / steps)
            sizes.append(recorder.files[0].stat().st_size / steps)
    share = 100 * float(np.median(inside) / np.median(alone))
    print(
        f"{name}: {1e3 * np.median(alone):.2f} ms a step alone, {1e3 * np.median(inside):.3f} ms for recording ({share:.1f} %), "
        f"{np.median(sizes):.0f} bytes a step",
        flush=True,
    )


def main() -> None:
    """Runs the measurement."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("package", choices=("robosuite", "libero"))
    parser.add_argument("tasks", nargs="+", help="names of tasks; for LIBERO a suite and numbers of tasks")
    parser.add_argument("--steps", type=int, default=200)
    arguments = parser.parse_args()
    warnings.filterwarnings("ignore")
    logging.disable(logging.CRITICAL)
    if arguments.package == "robosuite":
        for task in arguments.tasks:
            environment, start, width = robosuite_environment(task)
            measure(task, environment, start, width, arguments.steps)
        return
    suite, *numbers = arguments.tasks
    for number in numbers:
        environment, start, width = libero_environment(suite, int(number))
        measure(f"{suite} {number}", environment, start, width, arguments.steps)


if __name__ == "__main__":
    main()
