"""LIBERO's task, stated with the names of bodies: which object is to be put on or into which body, and from where.

Nothing of LIBERO is imported: an environment of it is recognised by its parsed problem.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from actcheck.recording.environment import attribute, layers

#: Predicates of goals that are stated.
_PLACES = ("on", "in")


@dataclass(frozen=True)
class Goal:
    """A goal of the kind "the object is on (in) the target". The places are LIBERO's names, the others those of bodies."""

    predicate: str
    #: Body that moves.
    object: str
    #: Body that is the target, or carries the target's region.
    target: str
    #: LIBERO's name of the target: an object, a fixture or a region.
    place: str
    #: Body on or in which the object is at first; `None` if the problem does not say.
    start: str | None

    def stated(self) -> dict[str, str]:
        """The metadata of an episode with this goal."""
        stated = {"goal_predicate": self.predicate, "goal_object": self.object, "goal_target": self.target}
        return stated if self.start is None else stated | {"start_surface": self.start}


def goal(environment: Any, model: Any) -> Goal | None:
    """The goal of a LIBERO task with exactly one goal, that an object is on or in something; `None` for other tasks and environments."""
    for layer in layers(environment):
        problem = attribute(layer, "parsed_problem")
        if isinstance(problem, dict):
            return _goal(layer, problem, model)
    return None


def _goal(layer: Any, problem: dict[str, Any], model: Any) -> Goal | None:
    goals = problem.get("goal_state") or []
    if len(goals) != 1 or not _is_place(goals[0]) or goals[0][1] not in (attribute(layer, "objects_dict") or {}):
        return None
    predicate, moved, place = goals[0]
    body, target = _body(layer, model, moved), _body(layer, model, place)
    if body is None or target is None:
        return None
    starts = [state[2] for state in problem.get("initial_state") or [] if _is_place(state) and state[1] == moved]
    return Goal(predicate, body, target, place, _body(layer, model, starts[0]) if starts else None)


def _is_place(state: Any) -> bool:
    return len(state) == 3 and state[0] in _PLACES


def _body(layer: Any, model: Any, name: str) -> str | None:
    """The body of an object or a fixture, or the one that carries a region; `None` if the model has none."""
    for things in ("objects_dict", "fixtures_dict"):
        thing = (attribute(layer, things) or {}).get(name)
        if thing is not None:
            return str(thing.root_body)
    try:
        return str(model.body(model.site(name).bodyid[0]).name)
    except KeyError:
        return None
