"""Makes episode files without a simulator: `python -m tests.made_episodes --to DIR --count N`. Needs numpy and mcap.

A gripper with two fingers hangs over a table with a cube. By turns it picks the cube up (`good`), picks it up and lets it fall (`drop`),
stays where it is while the cube is put in the air (`teleport`), or does nothing (`idle`). The place of the cube varies with the seed.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from actcheck.recording.file import EpisodeFile
from actcheck.recording.model import Body, Joint, Kind, Model, Shape, body, world
from actcheck.recording.states import Array, Contacts, Outcomes, States

KINDS = ("good", "drop", "teleport", "idle")
#: Unit: metres.
TABLE_HEIGHT, CUBE, RAISED, ABOVE, OPEN, FINGER_LENGTH = 0.8, 0.04, 0.12, 0.15, 0.04, 0.06
#: Unit: kilograms.
CUBE_MASS = 0.1
#: Force of a finger on the cube. Unit: newtons.
GRIP = 5.0
GRAVITY = 9.81
#: Time between states. Unit: seconds.
STEP = 0.1
TABLE, HAND, LEFT, RIGHT, CUBE_BODY = 1, 2, 3, 4, 5


def _shape(kind: Kind, size: list[float], position: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Shape:
    return {
        "kind": kind,
        "size": size,
        "position": list(position),
        "rotation": [0.0, 0.0, 0.0, 1.0],
        "collides": True,
        "friction": 1.0,
        "colour": [0.7, 0.7, 0.7, 1.0],
        "name": None,
    }


def _body(name: str, parent: int | None, mass: float, joint: int, shape: Shape) -> Body:
    made = body(name, moves=True, parent=parent, mass=mass)
    made["joint"], made["shapes"] = joint, [shape]
    return made


def _slide(name: str, moved: int, low: float, high: float) -> Joint:
    return {"name": name, "body": moved, "kind": "slide", "limits": [low, high], "max_effort": 20.0, "max_velocity": None}


def model() -> Model:
    """The gripper, the table and the cube."""
    ground = world()
    ground["shapes"] = [_shape("plane", [])]
    table = body("table", moves=False, mass=20.0)
    table["position"] = [0.0, 0.0, TABLE_HEIGHT / 2]
    table["shapes"] = [_shape("box", [0.8, 0.8, TABLE_HEIGHT])]
    finger = _shape("box", [0.02, 0.01, FINGER_LENGTH], (0.0, 0.0, -FINGER_LENGTH / 2))
    cube_joint: Joint = {"name": "cube_joint", "body": CUBE_BODY, "kind": "free", "limits": None, "max_effort": None, "max_velocity": None}
    return {
        "bodies": [
            ground,
            table,
            _body("gripper_hand", None, 1.0, 0, _shape("box", [0.1, 0.16, 0.04], (0.0, 0.0, 0.02))),
            _body("gripper_left_finger", HAND, 0.1, 1, finger),
            _body("gripper_right_finger", HAND, 0.1, 2, finger),
            _body("cube", None, CUBE_MASS, 3, _shape("box", [CUBE, CUBE, CUBE])),
        ],
        "joints": [
            _slide("lift", HAND, 0.0, 0.5),
            _slide("left_finger", LEFT, 0.0, OPEN),
            _slide("right_finger", RIGHT, 0.0, OPEN),
            cube_joint,
        ],
        "actuators": [{"name": "lift"}, {"name": "left_finger"}, {"name": "right_finger"}],
        "sites": [{"name": "grip_site", "body": HAND, "position": [0.0, 0.0, -FINGER_LENGTH], "rotation": [0.0, 0.0, 0.0, 1.0]}],
        "timestep": STEP,
        "gravity": [0.0, 0.0, -GRAVITY],
    }


@dataclass(frozen=True)
class Script:
    """Where everything is in each state."""

    #: Height of the hand's origin and of the cube's centre. Shape: states. Unit: metres.
    hand: Array
    cube: Array
    #: Distance of each finger from the closed position. Shape: states.
    opening: Array
    #: Whether the fingers press on the cube, and whether it is on the table. Shape: states.
    held: np.ndarray[tuple[int], np.dtype[np.bool_]]
    resting: np.ndarray[tuple[int], np.dtype[np.bool_]]


def script(kind: str, states: int) -> Script:
    """The course of an episode of a kind."""
    share = np.linspace(0.0, 1.0, states)
    ground = TABLE_HEIGHT + CUBE / 2
    grasp = ground + FINGER_LENGTH
    idle = kind in ("teleport", "idle")
    raised = np.zeros(states) if idle else np.clip((share - 0.5) / 0.3, 0.0, 1.0) * RAISED
    hand = np.full(states, grasp + ABOVE) if idle else grasp + ABOVE * np.clip(1 - share / 0.3, 0.0, 1.0) + raised
    opening = np.full(states, OPEN) if idle else CUBE / 2 + (OPEN - CUBE / 2) * np.clip(1 - (share - 0.3) / 0.15, 0.0, 1.0)
    held = np.zeros(states, bool) if idle else share >= 0.45
    cube = ground + raised
    if kind == "drop":
        dropped = share >= 0.9
        cube[dropped], held[dropped], opening[dropped] = ground, False, OPEN
    if kind == "teleport":
        cube[-1] += RAISED
    return Script(hand, cube, opening, held, cube <= ground + 1e-9)


def states_of(course: Script, place: Array) -> States:
    """The recorded quantities. `place`: x, y of the cube, under the hand."""
    count = len(course.hand)
    time = np.arange(count) * round(STEP * 1e9)
    poses = np.zeros((count, 4, 7))
    poses[..., :2], poses[..., 6] = place, 1.0
    poses[:, :3, 2], poses[:, 3, 2] = course.hand[:, None], course.cube
    poses[:, 1, 1] += course.opening + 0.005
    poses[:, 2, 1] -= course.opening + 0.005
    velocities = np.zeros((count, 4, 6))
    velocities[1:, :, :3] = np.diff(poses[..., :3], axis=0) / STEP
    joints = np.stack([course.hand - TABLE_HEIGHT, course.opening, course.opening], 1)
    speeds = np.zeros_like(joints)
    speeds[1:] = np.diff(joints, axis=0) / STEP
    efforts = np.stack([np.zeros(count), -GRIP * course.held, -GRIP * course.held], 1)
    success = course.cube > TABLE_HEIGHT + CUBE
    no = [False] * count
    outcomes = Outcomes(success.astype(np.float64), success.tolist(), no, no)
    return States(time, poses, velocities, joints, speeds, efforts, joints, _contacts(course, place), outcomes)


def _contacts(course: Script, place: Array) -> Contacts:
    """Four corners on the table while the cube rests there; one point on each finger while it is held."""
    corners = np.array([[x, y, -1.0] for x in (-1, 1) for y in (-1, 1)]) * CUBE / 2
    sides = np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])
    first, second, force, position = [], [], [], []
    counts = []
    for cube, held, resting in zip(course.cube.tolist(), course.held.tolist(), course.resting.tolist(), strict=True):
        centre = np.array([*place, cube])
        counts.append(4 * resting + 2 * held)
        if resting:
            first += [TABLE] * 4
            second += [CUBE_BODY] * 4
            force.append(np.tile([0.0, 0.0, CUBE_MASS * GRAVITY / 4], (4, 1)))
            position.append(centre + corners)
        if held:
            first += [LEFT, RIGHT]
            second += [CUBE_BODY] * 2
            carried = 0.0 if resting else CUBE_MASS * GRAVITY / 2
            force.append(-GRIP * sides + [0.0, 0.0, carried])
            position.append(centre + sides * CUBE / 2)
    forces = np.concatenate(force) if force else np.zeros((0, 3))
    points = np.concatenate(position) if position else np.zeros((0, 3))
    vertical = np.array(first) == TABLE
    normal = np.where(vertical, forces[:, 2], np.abs(forces[:, 1]))
    return Contacts(np.array(counts), np.array(first, int), np.array(second, int), normal, forces, points, np.zeros(len(first)))


def make(folder: Path, count: int, states: int = 20, seed: int = 0) -> Iterator[Path]:
    """Writes episodes `KIND-000001.mcap`, … and yields their paths."""
    described = model()
    courses = {kind: script(kind, states) for kind in KINDS}
    for at in range(count):
        kind = KINDS[at % len(KINDS)]
        random = np.random.default_rng(seed + at)
        path = folder / f"{kind}-{at + 1:06}.mcap"
        episode = EpisodeFile(path, described)
        mark = {"action": "Pick", "parameters": {"pickObject": "cube"}}
        episode.mark(0, mark | {"event": "begin", "reported": None, "message": None})
        made = states_of(courses[kind], random.uniform(-0.2, 0.2, 2))
        episode.write(made)
        episode.mark(int(made.time[-1]), mark | {"event": "end", "reported": True, "message": "done"})
        metadata = {"engine": "", "engine_version": "", "recorder": "made", "environment": "made/Pick", "task": "pick up the cube"}
        episode.close(metadata | {"seed": str(seed + at), "lacks": "", "note.kind": kind})
        yield path


def main() -> None:
    """Runs the command line."""
    parser = argparse.ArgumentParser("python -m tests.made_episodes", description=__doc__)
    parser.add_argument("--to", type=Path, required=True, metavar="DIR")
    parser.add_argument("--count", type=int, default=4)
    parser.add_argument("--states", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    made = sum(1 for _ in make(arguments.to, arguments.count, arguments.states, arguments.seed))
    print(f"{made} episodes in {arguments.to}")


if __name__ == "__main__":
    main()
