"""Finds MuJoCo, success and names in environments of gymnasium, robosuite, LIBERO, RoboCasa, dm_control and metaworld.

Nothing of these packages is imported: an environment is recognised by its attributes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from actcheck.faults import RecordingFault

#: Attributes that lead from a wrapper to the environment inside it.
_INNER = ("unwrapped", "env", "_env", "gym_env", "environment")
#: Where model and data are, below an environment.
_PLACES = (
    ("model", "data"),
    ("sim.model._model", "sim.data._data"),
    ("sim.model", "sim.data"),
    ("physics.model.ptr", "physics.data.ptr"),
    ("_physics.model.ptr", "_physics.data.ptr"),
)
_MOST_LAYERS = 32


@dataclass(frozen=True)
class Simulation:
    """MuJoCo's own model and data, which an environment uses."""

    model: Any
    data: Any


def attribute(owner: Any, path: str) -> Any:
    """An attribute of attributes; `None` if it is absent or can't be read."""
    for name in path.split("."):
        try:
            owner = getattr(owner, name, None)
        except Exception:  # noqa: BLE001 - a property of an unknown environment may raise any exception
            return None
        if owner is None:
            return None
    return owner


def layers(environment: Any) -> Iterator[Any]:
    """The environment and those that it wraps, from outside to inside."""
    seen: set[int] = set()
    waiting = [environment]
    while waiting and len(seen) < _MOST_LAYERS:
        layer = waiting.pop(0)
        if id(layer) in seen:
            continue
        seen.add(id(layer))
        yield layer
        for name in _INNER:
            inner = attribute(layer, name)
            if inner is not None and not isinstance(inner, (str, bytes, int, float)):
                waiting.append(inner)


def simulation(environment: Any) -> Simulation:
    """The MuJoCo simulation inside an environment. Raises `RecordingFault` if there is none."""
    for layer in layers(environment):
        for place in _PLACES:
            model, data = (attribute(layer, path) for path in place)
            if type(model).__name__ == "MjModel" and type(data).__name__ == "MjData" and _is_mujoco(model):
                return Simulation(model, data)
    looked = ", ".join("/".join(place) for place in _PLACES)
    raise RecordingFault(
        f"{type(environment).__module__}.{type(environment).__name__} has no MuJoCo simulation: looked for {looked} in it and in its "
        f"{', '.join(_INNER)}; record(model, data, path) records a simulation of your own"
    )


def _is_mujoco(model: Any) -> bool:
    return type(model).__module__.split(".")[0] == "mujoco"


def judge_of_success(environment: Any) -> Any:
    """The layer that has the success function `_check_success` of robosuite and LIBERO; `None` elsewhere."""
    return next((layer for layer in layers(environment) if callable(attribute(layer, "_check_success"))), None)


def said_success(info: Any) -> bool | None:
    """Success as an environment reports it with a step; `None` if it does not."""
    for key in ("success", "is_success"):
        if isinstance(info, dict) and info.get(key) is not None:
            try:
                return bool(info[key])
            except (TypeError, ValueError):
                return None
    return None


def environment_name(environment: Any) -> str:
    """A name such as `robosuite/Lift`, `libero/libero_spatial/NAME` or `gymnasium/FetchPickAndPlace-v4`."""
    found = list(layers(environment))
    for layer in found:
        problem = attribute(layer, "bddl_file_name")
        if isinstance(problem, (str, Path)):
            return f"libero/{Path(problem).parent.name}/{Path(problem).stem}"
    inner = found[0]
    for layer in found:
        if attribute(layer, "sim.model") is not None or attribute(layer, "physics") is not None:
            inner = layer
    package = type(inner).__module__.split(".")[0]
    identity = attribute(environment, "spec.id")
    if package in ("robosuite", "robocasa", "mimicgen"):
        return f"{package}/{type(inner).__name__}"
    if attribute(inner, "physics") is not None:
        task = attribute(inner, "task") or attribute(inner, "_task")
        return f"dm_control/{type(task).__name__}"
    unwrapped = attribute(environment, "unwrapped") or inner
    if type(unwrapped).__module__.startswith("metaworld"):
        return f"metaworld/{type(unwrapped).__name__}"
    return f"gymnasium/{identity}" if isinstance(identity, str) else f"{package}/{type(inner).__name__}"


def task_words(environment: Any) -> str:
    """The task in words, if the environment has them; otherwise empty."""
    for layer in layers(environment):
        for path in ("language_instruction", "task_description"):
            words = attribute(layer, path)
            if isinstance(words, (list, tuple)):
                words = " ".join(str(word) for word in words)
            if isinstance(words, str) and words:
                return words
        words = (attribute(layer, "_ep_meta") or {}).get("lang") if isinstance(attribute(layer, "_ep_meta"), dict) else None
        if isinstance(words, str):
            return words
    return ""


def known_seed(environment: Any) -> int | None:
    """The seed that an environment knows of itself; a random one of 128 bits, of an environment without a seed, is not returned."""
    for layer in layers(environment):
        for name in ("np_random_seed", "_np_random_seed", "seed"):
            seed = attribute(layer, name)
            if isinstance(seed, int) and not isinstance(seed, bool) and 0 <= seed < 1 << 63:
                return seed
    return None


@dataclass(frozen=True)
class Stepped:
    """The values that an environment's step returned, apart from the observation."""

    reward: float
    terminated: bool
    truncated: bool
    success: bool | None


def stepped(returned: Any) -> Stepped:
    """Reads the return value of `step`: gymnasium's five values, robosuite's four, or dm_control's `TimeStep`."""
    if hasattr(returned, "step_type"):
        last = bool(returned.last())
        ended = last and returned.discount == 0.0
        return Stepped(_number(returned.reward), ended, last and not ended, None)
    if isinstance(returned, tuple) and len(returned) == 5:
        _, reward, terminated, truncated, info = returned
        return Stepped(_number(reward), bool(terminated), bool(truncated), said_success(info))
    if isinstance(returned, tuple) and len(returned) == 4:
        _, reward, done, info = returned
        return Stepped(_number(reward), bool(done), False, said_success(info))
    raise RecordingFault(
        "`step` must return (observation, reward, terminated, truncated, info), (observation, reward, done, info) or a TimeStep; "
        f"it returned {type(returned).__name__}"
    )


def _number(reward: Any) -> float:
    """A reward as a number; 0 if there is none."""
    try:
        return float(reward)
    except (TypeError, ValueError):
        return 0.0
