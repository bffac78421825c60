"""Describes the bodies of a MuJoCo model.

The functions need no import of mujoco: they read the arrays of the user's own `MjModel`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from actcheck.recording.model import Body, Joint, Kind, Model, Shape, Site

#: Most corners of a hull; of a finer hull, those farthest in so many directions are kept.
MOST_CORNERS = 64
#: Decimal places of lengths in hulls: 10 µm.
_PLACES = 5

_JOINTS = ("free", "ball", "slide", "hinge")
_PLANE, _FIELD, _SPHERE, _CAPSULE, _ELLIPSOID, _CYLINDER, _BOX, _MESH, _SDF = range(9)
_TRANSMISSION_JOINT = 0
_GAIN_FIXED, _BIAS_NONE = 0, 0


def names(model: Any, kind: str, count: int, addresses: NDArray[np.int32]) -> list[str]:
    """The names of a kind of element. One without a name gets its kind and index, such as `body3`."""
    table: bytes = model.names
    found: list[str] = []
    used: set[str] = set()
    for at in range(count):
        begin = int(addresses[at])
        name = _label(table, begin) or f"{kind}{at}"
        while name in used:
            name += "_"
        used.add(name)
        found.append(name)
    return found


def _label(table: bytes, begin: int) -> str:
    """A name in MuJoCo's table of names; empty if the element has none."""
    return table[begin : table.index(b"\0", begin)].decode(errors="replace")


def moving_bodies(model: Any) -> NDArray[np.int64]:
    """Indices of the bodies that have a joint, are placed by the program, or descend from such a body."""
    moves = np.zeros(model.nbody, bool)
    for body in range(1, model.nbody):
        moves[body] = model.body_jntnum[body] > 0 or model.body_mocapid[body] >= 0 or moves[model.body_parentid[body]]
    return np.flatnonzero(moves)


def column_joints(model: Any) -> NDArray[np.int64]:
    """Indices of the hinge and slide joints."""
    return np.flatnonzero(model.jnt_type >= _JOINTS.index("slide"))


def described(model: Any, data: Any) -> Model:
    """Describes a model. `data` has the poses of the bodies that do not move."""
    return {
        "bodies": _bodies(model, data),
        "joints": _joints(model),
        "actuators": [{"name": name} for name in names(model, "actuator", model.nu, model.name_actuatoradr)],
        "sites": _sites(model),
        "timestep": float(model.opt.timestep),
        "gravity": model.opt.gravity.tolist(),
    }


def _bodies(model: Any, data: Any) -> list[Body]:
    moves = set(moving_bodies(model).tolist())
    shapes = _shapes(model)
    bodies: list[Body] = []
    for at, name in enumerate(names(model, "body", model.nbody, model.name_bodyadr)):
        parent = int(model.body_parentid[at])
        joint = int(model.body_jntadr[at])
        body: Body = {
            "name": name if at else "world",
            "parent": parent if parent else None,
            "moves": at in moves,
            "mass": float(model.body_mass[at]) if at else None,
            "joint": joint if joint >= 0 else None,
            "shapes": shapes[at],
        }
        if at not in moves:
            body["position"], body["rotation"] = data.xpos[at].tolist(), xyzw(data.xquat[at]).tolist()
        bodies.append(body)
    return bodies


def xyzw(quaternions: NDArray[Any]) -> NDArray[np.float64]:
    """Reorders quaternions w, x, y, z along the last axis."""
    return np.roll(quaternions, -1, -1)


def _shapes(model: Any) -> list[list[Shape]]:
    """The shapes of each body: the colliding ones, or all if none collides."""
    collides = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    if model.npair:
        collides[model.pair_geom1] = collides[model.pair_geom2] = True
    solid = np.zeros(model.nbody, bool)
    solid[model.geom_bodyid[collides]] = True
    shapes: list[list[Shape]] = [[] for _ in range(model.nbody)]
    kept = np.flatnonzero(collides | ~solid[model.geom_bodyid]).tolist()
    positions, rotations = model.geom_pos.tolist(), xyzw(model.geom_quat).tolist()
    frictions, colours = model.geom_friction[:, 0].tolist(), _colours(model)
    hulls: dict[int, list[list[float]]] = {}
    for geom in kept:
        kind, size = _geometry(model, geom)
        shape: Shape = {
            "kind": kind,
            "size": size,
            "position": positions[geom],
            "rotation": rotations[geom],
            "collides": bool(collides[geom]),
            "friction": frictions[geom],
            "colour": colours[geom],
            "name": _label(model.names, int(model.name_geomadr[geom])) or None,
        }
        if kind == "hull":
            shape["points"] = _corners(model, geom, hulls)
        shapes[int(model.geom_bodyid[geom])].append(shape)
    return shapes


def _geometry(model: Any, geom: int) -> tuple[Kind, list[float]]:
    """Kind and size of a shape. The sizes of MuJoCo's boxes, cylinders and capsules are half lengths."""
    kind, size = int(model.geom_type[geom]), model.geom_size[geom].tolist()
    if kind == _PLANE:
        return "plane", []
    if kind == _SPHERE:
        return "sphere", size[:1]
    if kind in (_CAPSULE, _CYLINDER):
        return ("capsule" if kind == _CAPSULE else "cylinder"), [size[0], 2 * size[1]]
    if kind == _ELLIPSOID:
        return "ellipsoid", size
    if kind == _BOX:
        return "box", [2 * half for half in size]
    return "hull", []


def _corners(model: Any, geom: int, known: dict[int, list[list[float]]]) -> list[list[float]]:
    """Corners of the hull of a mesh, or of the box around a height field. `known` has the meshes that were met before."""
    source = int(model.geom_dataid[geom])
    if model.geom_type[geom] == _FIELD:
        across, along, up, down = model.hfield_size[source].tolist()
        return [[x, y, z] for x in (-across, across) for y in (-along, along) for z in (-down, up)]
    if source not in known:
        known[source] = np.round(hull(model, source).astype(np.float64), _PLACES).tolist()
    return known[source]


def hull(model: Any, mesh: int) -> NDArray[Any]:
    """Corners of a mesh's convex hull. Shape: up to `MOST_CORNERS` × 3."""
    begin, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    corners = model.mesh_vert[begin : begin + count]
    graph = int(model.mesh_graphadr[mesh])
    if graph >= 0:
        # The graph has the number of corners and of faces, the corners' edges, and then the corners' vertices.
        known = int(model.mesh_graph[graph])
        corners = corners[model.mesh_graph[graph + 2 + known : graph + 2 + 2 * known]]
    if len(corners) > MOST_CORNERS:
        corners = corners[np.unique((_DIRECTIONS @ corners.T).argmax(1))]
    return np.asarray(corners)


def _directions(count: int) -> NDArray[np.float64]:
    """Evenly spread directions on the unit sphere, along a spiral."""
    height = 1 - (2 * np.arange(count) + 1) / count
    angle = np.arange(count) * np.pi * (3 - np.sqrt(5))
    radius = np.sqrt(1 - height**2)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], 1)


_DIRECTIONS = np.concatenate([np.eye(3), -np.eye(3), _directions(MOST_CORNERS - 6)])


def _colours(model: Any) -> list[list[float]]:
    """The colour of each shape. MuJoCo's default grey means that the colour of the material holds."""
    colours = model.geom_rgba.astype(np.float64)
    of_material = (model.geom_matid >= 0) & (colours == [0.5, 0.5, 0.5, 1.0]).all(1)
    if of_material.any():
        colours[of_material] = model.mat_rgba[model.geom_matid[of_material]]
    return np.round(colours, 3).tolist()  # type: ignore[no-any-return]


def _joints(model: Any) -> list[Joint]:
    efforts = _joint_efforts(model)
    joints: list[Joint] = []
    for at, name in enumerate(names(model, "joint", model.njnt, model.name_jntadr)):
        limited = bool(model.jnt_limited[at])
        joints.append(
            {
                "name": name,
                "body": int(model.jnt_bodyid[at]),
                "kind": _JOINTS[model.jnt_type[at]],  # type: ignore[typeddict-item]
                "limits": model.jnt_range[at].tolist() if limited and model.jnt_type[at] >= 2 else None,
                "max_effort": efforts.get(at),
                "max_velocity": None,
            }
        )
    return joints


def _joint_efforts(model: Any) -> dict[int, float]:
    """The largest effort that the actuators of each joint can apply, where the model limits it."""
    most: dict[int, float] = {}
    unlimited: set[int] = set()
    for at in range(model.nu):
        if model.actuator_trntype[at] != _TRANSMISSION_JOINT:
            continue
        joint, gear = int(model.actuator_trnid[at, 0]), abs(float(model.actuator_gear[at, 0]))
        plain = model.actuator_gaintype[at] == _GAIN_FIXED and model.actuator_biastype[at] == _BIAS_NONE
        if model.actuator_forcelimited[at]:
            force = float(np.abs(model.actuator_forcerange[at]).max())
        elif plain and model.actuator_ctrllimited[at] and model.actuator_dyntype[at] == 0:
            force = float(np.abs(model.actuator_ctrlrange[at]).max()) * abs(float(model.actuator_gainprm[at, 0]))
        else:
            unlimited.add(joint)
            continue
        most[joint] = most.get(joint, 0.0) + force * gear
    for joint in unlimited:
        most.pop(joint, None)
    for joint in np.flatnonzero(model.jnt_actfrclimited).tolist():
        most[joint] = min(most.get(joint, np.inf), float(np.abs(model.jnt_actfrcrange[joint]).max()))
    return most


def _sites(model: Any) -> list[Site]:
    sites: list[Site] = []
    for at in range(model.nsite):
        begin = int(model.name_siteadr[at])
        name = _label(model.names, begin)
        if name:
            position, rotation = model.site_pos[at].tolist(), xyzw(model.site_quat[at]).tolist()
            sites.append({"name": name, "body": int(model.site_bodyid[at]), "position": position, "rotation": rotation})
    return sites
