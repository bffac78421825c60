"""The exported tables as actions: the world before and after each one, and the events during it."""

import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import polars as pl

from .geometry import Part, Pose


@dataclass
class Body:
    """An object or a piece of furniture in one state."""

    id: str
    model: str
    kinds: list
    role: str
    fixed: bool
    pose: Pose
    velocity: np.ndarray
    spin: np.ndarray
    low: np.ndarray
    high: np.ndarray
    size: np.ndarray | None
    touches: list
    rests_on: list
    asleep: bool


@dataclass
class State:
    """The world at one moment. Bases are x, y and heading."""

    base: np.ndarray
    believed: np.ndarray
    gripper: np.ndarray
    left_touches: list
    right_touches: list
    bodies: dict = field(default_factory=dict)

    def holds(self, body):
        return body in self.left_touches and body in self.right_touches


@dataclass
class Seen:
    """A perceived object or surface, by the robot's estimate of its own pose.

    `base` and `believed` are the true and the estimated base when the picture was taken; None without one."""

    pose: Pose
    size: np.ndarray
    base: np.ndarray | None
    believed: np.ndarray | None
    category: str | None = None


@dataclass
class Run:
    """The facts that all actions of a run share."""

    id: str
    locations: dict = field(default_factory=dict)
    rooms: list = field(default_factory=list)
    shapes: dict = field(default_factory=dict)


@dataclass
class Action:
    """One action of a run with its stored outcomes: pairs of an outcome and a margin, by property.

    `path` has the smallest and the largest x and y of the base; `joints` the largest speed of each joint as a share of
    its limit; `extremes` the largest tilt and displacement of each body during the action; `motions` the times at
    which it was faster than 2 cm/s."""

    run: Run
    step: int
    name: str
    parameters: dict
    end: str
    reported: bool | None
    duration: float
    path: np.ndarray | None
    before: State | None = None
    after: State | None = None
    contacts: list = field(default_factory=list)
    self_contacts: list = field(default_factory=list)
    plane: Seen | None = None
    objects: list = field(default_factory=list)
    joints: dict = field(default_factory=dict)
    extremes: dict = field(default_factory=dict)
    motions: dict = field(default_factory=dict)
    outcomes: dict = field(default_factory=dict)


def read(folder):
    """Reads the tables that `actcheck export tables FOLDER --complete` wrote. Returns the actions in order."""
    tables = Tables(Path(folder))
    states = read_states(tables)
    runs = read_runs(tables)
    actions = {}
    for row in tables.rows("actions"):
        run = runs.setdefault(row["run"], Run(row["run"]))
        path = known(row, "base_min_x_m", "base_min_y_m", "base_max_x_m", "base_max_y_m")
        action = Action(
            run=run,
            step=row["step"],
            name=local(row["action"]),
            parameters=json.loads(row["parameters"]),
            end=row["end"],
            reported=row["reported"],
            duration=row["duration_s"],
            path=None if path is None else path.reshape(2, 2),
            before=states.get((row["run"], row["step"] - 1)),
            after=states.get((row["run"], row["step"])),
        )
        actions[row["run"], row["step"]] = action
    add_events(tables, actions)
    for row in tables.rows("outcomes"):
        actions[row["run"], row["step"]].outcomes[local(row["property"])] = (row["outcome"], row["margin"])
    return [actions[key] for key in sorted(actions)]


class Tables:
    """The folder of an export."""

    def __init__(self, folder):
        self.folder = folder

    def rows(self, name):
        return pl.read_parquet(self.folder / f"{name}.parquet").iter_rows(named=True)


def local(iri):
    return iri.rsplit("#")[-1].rsplit("/")[-1]


def numbers(row, *names):
    return np.array([np.nan if row[name] is None else row[name] for name in names])


def known(row, *names):
    """The numbers, or None if they are missing."""
    return None if row[names[0]] is None else numbers(row, *names)


def pose(row):
    return Pose(numbers(row, "x_m", "y_m", "z_m"), numbers(row, "qx", "qy", "qz", "qw"))


def read_states(tables):
    states = {}
    for row in tables.rows("states"):
        states[row["run"], row["state"]] = State(
            base=numbers(row, "base_x_m", "base_y_m", "base_heading_rad"),
            believed=numbers(row, "believed_x_m", "believed_y_m", "believed_heading_rad"),
            gripper=numbers(row, "gripper_x_m", "gripper_y_m", "gripper_z_m"),
            left_touches=json.loads(row["left_touches"]),
            right_touches=json.loads(row["right_touches"]),
        )
    for row in tables.rows("bodies"):
        states[row["run"], row["state"]].bodies[row["body"]] = Body(
            id=row["body"],
            model=row["model"],
            kinds=row["kinds"].split(" "),
            role=row["role"],
            fixed=row["fixed"],
            pose=pose(row),
            velocity=numbers(row, "vx_m_s", "vy_m_s", "vz_m_s"),
            spin=numbers(row, "wx_rad_s", "wy_rad_s", "wz_rad_s"),
            low=numbers(row, "min_x_m", "min_y_m", "min_z_m"),
            high=numbers(row, "max_x_m", "max_y_m", "max_z_m"),
            size=known(row, "size_x_m", "size_y_m", "size_z_m"),
            touches=json.loads(row["touches"]),
            rests_on=json.loads(row["rests_on"]),
            asleep=row["asleep"],
        )
    return states


def read_runs(tables):
    runs = {}
    for row in tables.rows("places"):
        run = runs.setdefault(row["run"], Run(row["run"]))
        if row["kind"] == "location":
            run.locations[row["name"]] = numbers(row, "x_m", "y_m", "heading_rad")
        elif row["kind"] == "room":
            run.rooms.append(numbers(row, "min_x_m", "min_y_m", "max_x_m", "max_y_m").reshape(2, 2))
    for row in tables.rows("shapes"):
        run = runs.setdefault(row["run"], Run(row["run"]))
        size = numbers(row, "size_x_m", "size_y_m", "size_z_m")
        tube = numbers(row, "radius_m", "radius_high_m", "wall_m")
        points = np.array(json.loads(row["points"])) if row["points"] else None
        part = Part(row["shape"], pose(row), size, tube, row["staves"], points)
        run.shapes.setdefault(row["body"], []).append(part)
    return runs


def add_events(tables, actions):
    def of(row):
        return actions[row["run"], row["step"]]

    for row in tables.rows("contacts"):
        of(row).contacts.append(row)
    for row in tables.rows("self_contacts"):
        of(row).self_contacts.append(row)
    for row in tables.rows("planes"):
        of(row).plane = seen(row, "length_m", "width_m")
    for row in tables.rows("percepts"):
        if row["source"] == "reported":
            of(row).objects.append(seen(row, "width_m", "depth_m", "height_m", category=row["category"]))
    for row in tables.rows("extremes"):
        of(row).extremes[row["body"]] = row
    for row in tables.rows("intervals"):
        if row["kind"] == "motion":
            of(row).motions.setdefault(row["body"], []).append((row["start_s"], row["end_s"]))
    for row in tables.rows("joint_extremes"):
        of(row).joints[row["joint"]] = row["max_speed_share"]


def seen(row, *size, category=None):
    base, believed = (
        known(row, f"taken_{which}_x_m", f"taken_{which}_y_m", f"taken_{which}_heading_rad") for which in ("base", "believed")
    )
    return Seen(pose(row), numbers(row, *size), base, believed, category and local(category))
