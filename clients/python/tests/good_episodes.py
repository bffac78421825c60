"""Records good episodes with a scripted hand: `python -m tests.good_episodes robosuite/Stack --to DIR --states 3`.

The hand picks the object up from above, carries it to its goal, lowers it, lets go and rises; in a task whose goal is in the air, it
holds it there. Tasks whose objects the hand can't pick up are left out.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import actcheck
from actcheck.episodes.command import task_numbers
from actcheck.episodes.faulty import Stage
from actcheck.episodes.hand import NotPossible
from actcheck.episodes.scene import Scene
from actcheck.episodes.suites import Task, idle, quiet, tasks
from actcheck.recording.file import slug

#: Unit: metres.
RISE = 0.15
SETTLING_STEPS, MOST_STEPS = 10, 150
LAST_STEPS = 20


def perform(stage: Stage) -> None:
    """Performs the task."""
    hand = stage.pick()
    if stage.aim.carries:
        stage.carry(hand)
        stage.lower(hand)
        hand.grip(False)
        hand.move(hand.position + [0.0, 0.0, RISE])
    stage.wait(LAST_STEPS)


def record(task: Task, state: int, path: Path) -> str:
    """Records an episode. Returns its result."""
    task.begin(state)
    scene = Scene(task.environment)
    for step in range(MOST_STEPS):
        if step >= SETTLING_STEPS and scene.fastest() < 0.05:
            break
        task.environment.step(idle(task.environment))
    aim = task.aim()
    if aim is None:
        return "another kind of goal"
    try:
        with actcheck.record(task.environment, path) as recorder:
            stage = Stage(task.environment, aim, recorder, {})
            perform(stage)
    except NotPossible as reason:
        path.unlink()
        return str(reason)
    return "success" if stage.success else "no success"


def main() -> None:
    """Runs the command line."""
    parser = argparse.ArgumentParser("python -m tests.good_episodes", description=__doc__)
    parser.add_argument("suite")
    parser.add_argument("--to", type=Path, required=True)
    parser.add_argument("--tasks", type=task_numbers)
    parser.add_argument("--states", type=int, default=1)
    arguments = parser.parse_args()
    lines = []
    with quiet():
        for number, task in tasks(arguments.suite, arguments.tasks):
            for state in range(arguments.states):
                path = arguments.to / f"{slug(task.name)}-good-{state}.mcap"
                lines.append(f"{number} {task.name} {state}: {record(task, state, path)}")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
