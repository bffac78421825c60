"""Records the first states of a suite's tasks, and faulty episodes of them with the verdict of their own success function."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from actcheck.episodes.faults import EpisodeFault
from actcheck.episodes.faulty import FAULTS, Stage
from actcheck.episodes.hand import NotPossible
from actcheck.episodes.scene import Scene
from actcheck.episodes.suites import Aim, Task, idle, tasks
from actcheck.recording import record
from actcheck.recording.file import slug
from actcheck.recording.states import Array

#: A line of output.
Line = dict[str, Any]

#: Bodies that move more slowly are at rest. Unit: m/s.
_AT_REST_M_S = 0.05
#: PickPlaceCan's unused objects fall from a height of 10 m.
_MOST_STEPS_TO_REST = 150
_OTHER_GOAL = "the task's goal isn't one object on or in a place"


def record_states(suite: str, numbers: list[int] | None, states: int, settle: int, folder: Path) -> Iterator[Line]:
    """Records the first initial states of tasks, one file a state. Yields a line a state.

    The recorded state is the one after `settle` steps in which the robot does nothing: before them, LIBERO's objects are in the air.
    """
    for number, task in tasks(suite, numbers):
        for state in range(states):
            episode = f"{number}-{state}"
            try:
                task.begin(state)
            except IndexError:
                break
            if task.aim() is None:
                yield {"episode": episode, "left_out": _OTHER_GOAL}
                break
            path = _free(folder / f"{slug(task.name)}-{state:03}.mcap")
            _settle(task, settle)
            with record(task.environment, path) as recorder:
                recorder.about["note.state"] = f"initial state {state}, after {settle} steps in which the robot did nothing"
                recorder.before_step()
            yield {"episode": episode, "written": str(path)}


def record_faults(suite: str, numbers: list[int] | None, faults: list[str], steps: int, settle: int, folder: Path) -> Iterator[Line]:
    """Records faulty episodes of tasks, one file a fault. Yields a line an episode.

    `their_success` is whether the environment's own success function was true in any state: an evaluation ends at the first one.
    """
    for number, task in tasks(suite, numbers):
        for name in faults:
            line: Line = {"episode": f"{number}-{name}", "fault": name}
            task.begin(0)
            # Before anything tips over.
            upright = Scene(task.environment).rotations()
            _settle(task, settle)
            _come_to_rest(task)
            aim = task.aim()
            if aim is None:
                yield {"episode": f"{number}", "left_out": _OTHER_GOAL}
                break
            path = _free(folder / f"{slug(task.name)}-{name}.mcap")
            try:
                yield line | {"written": str(path), "their_success": _record(task, aim, name, upright, steps, path)}
            except NotPossible as reason:
                path.unlink()
                yield line | {"left_out": str(reason)}


def _record(task: Task, aim: Aim, name: str, upright: dict[str, Array], steps: int, path: Path) -> bool:
    """Records a faulty episode. Returns whether the environment counted it as a success."""
    fault = FAULTS[name]
    with record(task.environment, path) as recorder:
        recorder.about |= {"fault": name, "note.fault": fault.sentence}
        stage = Stage(task.environment, aim, recorder, upright)
        fault.happen(stage)
        stage.wait(steps)
    return stage.success


def _settle(task: Task, steps: int) -> None:
    for _ in range(steps):
        task.environment.step(idle(task.environment))


def _come_to_rest(task: Task) -> None:
    """The robot does nothing until nothing else moves: a fault begins in a state at rest, where there is one."""
    scene = Scene(task.environment)
    for _ in range(_MOST_STEPS_TO_REST):
        if scene.fastest() < _AT_REST_M_S:
            return
        task.environment.step(idle(task.environment))


def _free(path: Path) -> Path:
    if path.exists():
        raise EpisodeFault("exists", f"{path} exists: choose another folder; episodes are never overwritten")
    return path
