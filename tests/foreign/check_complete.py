"""Compares the complete facts in N-Quads with those in tables: the same things, with the same numbers. Needs the folder
`notebooks` in PYTHONPATH.

    python check_complete.py FILE.nq FOLDER
"""

import json
import pathlib
import sys
from collections import defaultdict

import polars as pl
import pyoxigraph as ox

import second_judge
from second_judge.geometry import surface_distance

W = "https://w3id.org/actcheck/world#"
RUN = "https://w3id.org/actcheck/run/"

# Graphs as dictionaries: subject → property → values.
graphs = defaultdict(lambda: defaultdict(lambda: defaultdict(list)))
for quad in ox.parse(path=sys.argv[1], format=ox.RdfFormat.N_QUADS):
    if isinstance(quad.graph_name, ox.NamedNode) and quad.graph_name.value.startswith(RUN):
        graph = quad.graph_name.value.removeprefix(RUN)
        graphs[graph][quad.subject.value][quad.predicate.value.removeprefix(W)].append(quad.object.value)


def table(name):
    return list(pl.read_parquet(pathlib.Path(sys.argv[2]) / f"{name}.parquet").iter_rows(named=True))


def thing(name):
    """The IRI of a thing with an id."""
    if name in ("robot", "floor"):
        return W + name
    return W + "link/" + name.removeprefix("robot/") if name.startswith("robot/") else "https://w3id.org/actcheck/object/" + name


def same(where, found, row, columns):
    """Compares numbers, which are rounded to single precision in RDF. A missing number has no triple."""
    for name, column in columns.items():
        values = found.get(name, [])
        if row[column] is None:
            assert not values, (where, name, values)
            continue
        assert len(values) == 1, (where, name, values)
        assert abs(float(values[0]) - row[column]) <= 2e-7 * max(1.0, abs(row[column])), (where, name, values, row[column])


POSE = dict(zip(("x", "y", "z", "qx", "qy", "qz", "qw"), ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")))
BOX = {f"{end}{axis.upper()}": f"{end}_{axis}_m" for end in ("min", "max") for axis in "xyz"}
SIZE = {f"size{axis.upper()}": f"size_{axis}_m" for axis in "xyz"}
MATTER = {"mass": "mass_kg", "friction": "friction", "restitution": "restitution", "gripperDistance": "gripper_distance_m"}
bodies = table("bodies")
for row in bodies:
    found = graphs[f"{row['run']}/state/{row['state']}"][thing(row["body"])]
    same(row, found, row, POSE | BOX | SIZE | MATTER)
    assert sorted(found["restsOn"]) == sorted(map(thing, json.loads(row["rests_on"]))), row
    assert sorted(found["touches"]) == sorted(map(thing, json.loads(row["touches"]))), row

links = table("links")
for row in links:
    same(row, graphs[f"{row['run']}/state/{row['state']}"][thing("robot/" + row["link"])], row, POSE)

GRIPPER = {name: f"gripper_{column}" for name, column in POSE.items()} | {"opening": "opening_m"}
BASE = {"baseX": "base_x_m", "baseYaw": "base_heading_rad", "believedY": "believed_y_m"}
for row in table("states"):
    graph = graphs[f"{row['run']}/state/{row['state']}"]
    same(row, graph[W + "robot"], row, BASE)
    same(row, graph[W + "gripper"], row, GRIPPER)

# Contacts have no names in the tables: the same ones in some order.
CONTACT = {"start": "start_s", "end": "end_s", "maxForce": "max_force_n", "x": "x_m", "y": "y_m", "z": "z_m"}
contacts = defaultdict(list)
for row in table("contacts"):
    contacts[f"{row['run']}/{row['step']}/during"].append(row)
for name, rows in contacts.items():
    found = [found for subject, found in graphs[name].items() if subject.startswith(W + "contact/")]
    assert len(found) == len(rows), (name, len(found), len(rows))
    found.sort(key=lambda each: (each["first"], each["second"], float(each["start"][0])))
    rows.sort(key=lambda row: ([thing(row["first"])], [thing(row["second"])], row["start_s"]))
    for each, row in zip(found, rows):
        assert (each["first"], each["second"]) == ([thing(row["first"])], [thing(row["second"])]), (name, row)
        same(name, each, row, CONTACT)

LOOK = {"takenAt": "taken_at_s", "takenBaseX": "taken_base_x_m", "takenBelievedYaw": "taken_believed_heading_rad"}
LOOK |= {"cameraX": "camera_x_m", "cameraZ": "camera_z_m", "cameraQw": "camera_qw"}
for row in table("planes"):
    found = graphs[f"{row['run']}/{row['step']}/during"][W + "perceivedPlane"]
    same(row, found, row, LOOK | {"x": "x_m", "extentX": "length_m", "extentY": "width_m"})

SEEN = {"x": "x_m", "y": "y_m", "z": "z_m", "sizeX": "width_m", "sizeY": "depth_m", "sizeZ": "height_m"}
numbers = defaultdict(int)
for row in table("percepts"):
    heading = {"detector": "percept", "reported": "perceivedObject"}[row["source"]]
    numbers[row["run"], row["step"], heading] += 1
    subject = f"{W}{heading}/{numbers[row['run'], row['step'], heading]}"
    same(row, graphs[f"{row['run']}/{row['step']}/during"][subject], row, SEEN | LOOK)

# The shapes have the surfaces that the simulation measured distances to.
actions = second_judge.read(sys.argv[2])
states = {(action.run.id, action.step - 1): (action.run, action.before) for action in actions}
measured = [row for row in bodies if row["gripper_distance_m"] is not None and (row["run"], row["state"]) in states]
for row in measured:
    run, state = states[row["run"], row["state"]]
    distance = surface_distance(run.shapes[row["body"]], state.bodies[row["body"]].pose, state.gripper)
    assert abs(distance - row["gripper_distance_m"]) < 1e-5, (row, distance)

assert len(measured) > 0 and len(bodies) > 0 and len(contacts) > 0 and len(links) > 0 and numbers
print(f"{len(bodies)} bodies, {len(links)} links and {sum(map(len, contacts.values()))} contacts are the same in both")
