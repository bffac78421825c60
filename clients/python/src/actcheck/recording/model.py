"""The description of an episode's bodies: the first message of its file.

Units: metres, kilograms, radians, newtons. Quaternions: x, y, z, w. The published schema is `clients/episode_model.schema.json`.
"""

from __future__ import annotations

from typing import Any, Literal, TypedDict

Kind = Literal["box", "sphere", "cylinder", "capsule", "ellipsoid", "plane", "hull"]


class _ShapeParts(TypedDict):
    #: box: edge lengths; sphere: radius; cylinder, capsule: radius and height of the cylindrical part, along z; ellipsoid: three radii;
    #: plane, hull: empty.
    kind: Kind
    size: list[float]
    #: In the body's frame.
    position: list[float]
    rotation: list[float]
    collides: bool
    #: Coefficient of sliding friction.
    friction: float | None
    #: Red, green, blue, opacity from 0 to 1.
    colour: list[float] | None
    name: str | None


class Shape(_ShapeParts, total=False):
    """One shape of a body."""

    #: Corners of a convex hull, in the shape's frame. Only of the kind `hull`.
    points: list[list[float]]


class _BodyParts(TypedDict):
    name: str
    #: Index of the parent; `None` if it is the world.
    parent: int | None
    #: Whether the body or an ancestor has a joint or is placed by the program.
    moves: bool
    mass: float | None
    #: Index of the body's first joint.
    joint: int | None
    shapes: list[Shape]


class Body(_BodyParts, total=False):
    """A body. The first body of a model is the world."""

    #: World frame. Only of bodies that do not move.
    position: list[float]
    rotation: list[float]


class Joint(TypedDict):
    """A joint. Only hinges and slides have a column among the recorded joint positions."""

    name: str
    #: Index of the body that it moves.
    body: int
    kind: Literal["hinge", "slide", "ball", "free"]
    #: Lowest and highest position.
    limits: list[float] | None
    max_effort: float | None
    max_velocity: float | None


class Actuator(TypedDict):
    """An actuator, in the order of the recorded controls."""

    name: str


class Site(TypedDict):
    """A named point on a body."""

    name: str
    body: int
    position: list[float]
    rotation: list[float]


class Model(TypedDict):
    """The bodies of an episode and their connections."""

    bodies: list[Body]
    joints: list[Joint]
    actuators: list[Actuator]
    sites: list[Site]
    #: Seconds of simulated time in one step of the engine.
    timestep: float | None
    gravity: list[float]


def world() -> Body:
    """The first body of a model, without shapes."""
    return body("world", moves=False)


def body(name: str, *, moves: bool, parent: int | None = None, mass: float | None = None) -> Body:
    """A body without shapes and joints; if it does not move, at the world's origin."""
    described: Body = {"name": name, "parent": parent, "moves": moves, "mass": mass, "joint": None, "shapes": []}
    if not moves:
        described["position"], described["rotation"] = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]
    return described


def moving(model: Model) -> list[str]:
    """Names of the moving bodies, in the order of the recorded poses."""
    return [body["name"] for body in model["bodies"] if body["moves"]]


def _object(properties: dict[str, Any], optional: tuple[str, ...] = ()) -> dict[str, Any]:
    required = [name for name in properties if name not in optional]
    return {"type": "object", "properties": properties, "required": required}


def _numbers(fewest: int, most: int) -> dict[str, Any]:
    return {"type": "array", "items": {"type": "number"}, "minItems": fewest, "maxItems": most}


def _maybe(schema: dict[str, Any]) -> dict[str, Any]:
    return {"anyOf": [schema, {"type": "null"}]}


def _list(items: dict[str, Any]) -> dict[str, Any]:
    return {"type": "array", "items": items}


_NUMBER = {"type": "number"}
_TEXT = {"type": "string"}
_FLAG = {"type": "boolean"}
_INDEX = {"type": "integer", "minimum": 0}
_POSITION = _numbers(3, 3) | {"description": "x, y, z in metres"}
_ROTATION = _numbers(4, 4) | {"description": "unit quaternion x, y, z, w"}
_KINDS = ["box", "sphere", "cylinder", "capsule", "ellipsoid", "plane", "hull"]

_SHAPE = _object(
    {
        "kind": {"enum": _KINDS},
        "size": _numbers(0, 3)
        | {
            "description": "metres; box: edge lengths; sphere: radius; cylinder, capsule: radius and height of the cylindrical part, "
            "along z; ellipsoid: three radii; plane, hull: empty"
        },
        "points": _list(_POSITION) | {"description": "corners of a convex hull, in the shape's frame"},
        "position": _POSITION,
        "rotation": _ROTATION,
        "collides": _FLAG,
        "friction": _maybe(_NUMBER),
        "colour": _maybe(_numbers(4, 4)),
        "name": _maybe(_TEXT),
    },
    ("points",),
)
_BODY = _object(
    {
        "name": _TEXT,
        "parent": _maybe(_INDEX),
        "moves": _FLAG | {"description": "the body or an ancestor has a joint or is placed by the program"},
        "mass": _maybe(_NUMBER) | {"description": "kilograms"},
        "joint": _maybe(_INDEX) | {"description": "the body's first joint"},
        "shapes": _list(_SHAPE),
        "position": _POSITION | {"description": "world frame, metres; only of a body that does not move"},
        "rotation": _ROTATION,
    },
    ("position", "rotation"),
)
_JOINT = _object(
    {
        "name": _TEXT,
        "body": _INDEX,
        "kind": {"enum": ["hinge", "slide", "ball", "free"]},
        "limits": _maybe(_numbers(2, 2)),
        "max_effort": _maybe(_NUMBER) | {"description": "newtons or newton metres"},
        "max_velocity": _maybe(_NUMBER),
    }
)
_SITE = _object({"name": _TEXT, "body": _INDEX, "position": _POSITION, "rotation": _ROTATION})

#: JSON schema of the message on the topic `/model`.
SCHEMA: dict[str, Any] = {
    "$schema": "https://json-schema.org/draft/2020-12/schema",
    "title": "actcheck.Model",
    "description": "The bodies of an episode. Lengths in metres, masses in kilograms, angles in radians; world frame, Z up.",
} | _object(
    {
        "bodies": _list(_BODY) | {"description": "the first is the world"},
        "joints": _list(_JOINT) | {"description": "only hinge and slide joints have a column on the topic /joints"},
        "actuators": _list(_object({"name": _TEXT})) | {"description": "in the order of the topic /controls"},
        "sites": _list(_SITE) | {"description": "named points on bodies"},
        "timestep": _maybe(_NUMBER) | {"description": "seconds of simulated time in one step of the engine"},
        "gravity": _numbers(3, 3),
    }
)

#: JSON schema of the messages on the topic `/marks`.
MARK_SCHEMA: dict[str, Any] = {
    "$schema": "https://json-schema.org/draft/2020-12/schema",
    "title": "actcheck.Mark",
    "description": "Begin or end of an action that was asked for.",
} | _object(
    {
        "action": _TEXT,
        "event": {"enum": ["begin", "end"]},
        "parameters": {"type": "object", "additionalProperties": {"anyOf": [_TEXT, {"type": "array", "items": _TEXT}]}},
        "reported": _maybe(_FLAG) | {"description": "whether the robot reported success; only at the end"},
        "message": _maybe(_TEXT),
    }
)
