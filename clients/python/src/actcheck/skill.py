"""Skills by name, and the loop that performs them for a campaign."""

from __future__ import annotations

import faulthandler
import inspect
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from actcheck.faults import Aborted, Failed, ProtocolFault, Refused
from actcheck.kinematics import read_urdf
from actcheck.messages import Call, Report
from actcheck.robot import Ended, Robot
from actcheck.session import Session
from actcheck.silence import watched
from actcheck.tracebacks import place_of_definition, place_of_fault, print_traceback
from actcheck.wire import Wire

#: A skill takes the robot and, as keyword arguments, any of the action's designators.
Skill = Callable[..., "Report | bool | None"]
_Skill = TypeVar("_Skill", bound=Skill)
_STANDARD_ERROR = 2

#: The skills of this program by action.
skills: dict[str, Skill] = {}


class Unfit(TypeError):
    """A function can't be a skill, or not the skill of its action. The message names the line of its definition."""

    def __init__(self, function: Callable[..., Any], words: str) -> None:
        self.words, self.place = f"{_name(function)} {words}", place_of_definition(function)
        super().__init__(f"{self.words} ({self.place})" if self.place else self.words)


def skill(action: str) -> Callable[[_Skill], _Skill]:
    """Registers a function as the skill for an action: `@skill("Pick")`.

    It is called with the robot and, as keyword arguments, the designators of the action that it has parameters for. It
    returns a `Report`, `True` or `None` for success, `False` for failure; `Failed` is a failure too. Any other exception is a
    fault of the program, not of the robot: the run is `broken`, with the traceback in its record.

    A skill of another file for the same action is replaced, so that a program can import functions from another program.
    """
    if not isinstance(action, str):
        raise TypeError('the decorator needs the name of an action in brackets: `@actcheck.skill("Pick")`')

    def register(function: _Skill) -> _Skill:
        _check(function)
        place, other = place_of_definition(function), skills.get(action)
        before = place_of_definition(other) if other is not None else None
        if before is not None and before != place and _file(other) == _file(function):
            raise Unfit(function, f"is a second skill for {action}; the first is {_name(other)} in {before}")
        skills[action] = function
        return function

    return register


def serve(name: str | None = None, wire: Wire | None = None) -> None:
    """Performs actions until the campaign is over. Call it at the end of a program that defines skills.

    Actions without a skill in this program are performed by actcheck's reference skills. An exception of a skill ends the
    program, and actcheck starts it anew for the next run.
    """
    if not skills:
        sys.exit('actcheck: no skill is defined before `serve()`: write `@actcheck.skill("Pick")` above a function, `serve()` below it')
    # The line of a crash in native code.
    faulthandler.enable(_STANDARD_ERROR, all_threads=False)
    name = name or Path(sys.argv[0]).stem or "python"
    try:
        wire = wire or Wire.from_environment()
        with Session(wire, name, sorted(skills)) as session, watched(wire):
            urdf = read_urdf(session.description.urdf)
            while (call := session.next_call()) is not None:
                try:
                    report = perform(skills[call.action], Robot(session, call, urdf))
                except Aborted:
                    continue
                except ProtocolFault:
                    raise
                except (Exception, SystemExit) as fault:
                    if not isinstance(fault, Unfit):
                        print_traceback(fault)
                    # The last line is the reason of the broken run, for readers of its record.
                    sys.exit(summary(fault))
                session.end(report)
    except Refused as fault:
        place = place_of_fault(fault)
        if place:
            print_traceback(fault)
        else:
            print(f"actcheck: {fault}", file=sys.stderr)
        # actcheck adds the last line to its own reason, so it does not repeat it.
        sys.exit(f"actcheck refused a message in {place}" if place else "actcheck refused a message")
    except ProtocolFault as fault:
        sys.exit(f"actcheck: {fault}")


def perform(function: Skill, robot: Robot) -> Report:
    """Performs one action and returns its report."""
    try:
        return report_of(function, function(robot, **wanted(function, robot.call)))
    except Ended as ended:
        return ended.report
    except Failed as failed:
        return Report(False, str(failed))


def wanted(function: Skill, call: Call) -> dict[str, Any]:
    """The action's designators that a function has parameters for, or all if it accepts `**kwargs`.

    Raises `Unfit` for a parameter that is not a designator; options with a default after `*` keep it.
    """
    _check(function)
    _, *others = inspect.signature(function).parameters.values()
    kinds, taken = inspect.Parameter, {one.name: one for one in others}
    for name, one in taken.items():
        option = one.kind is kinds.KEYWORD_ONLY and one.default is not kinds.empty
        if name not in call.parameters and not option and one.kind not in (kinds.VAR_KEYWORD, kinds.VAR_POSITIONAL):
            has = ", ".join(f"`{designator}`" for designator in call.parameters)
            own = "" if one.default is kinds.empty else f"; an option of your own comes after a star: `*, {name}={one.default!r}`"
            raise Unfit(function, f"takes `{name}`, but {call.action} has {has}{own}")
    if any(one.kind is kinds.VAR_KEYWORD for one in others):
        return dict(call.parameters)
    return {name: value for name, value in call.parameters.items() if name in taken}


def report_of(function: Skill, returned: object) -> Report:
    """Converts a skill's return value to a report."""
    if isinstance(returned, Report):
        return returned
    if returned is None:
        return Report(True)
    if isinstance(returned, (bool, np.bool_)):
        return Report(True) if returned else Report(False, "the skill returned False")
    forgotten = f"; write `{_name(returned)}`" if callable(returned) else ""
    raise Unfit(function, f"must return a Report, a bool or None, not {type(returned).__name__}{forgotten}")


def summary(fault: BaseException) -> str:
    """An exception in one line: its type, the innermost line of code outside this package, and its message.

    The place comes before the message, because actcheck shortens long lines.
    """
    kind, words, place = type(fault).__name__, str(fault), place_of_fault(fault)
    if isinstance(fault, Unfit):
        kind, words, place = "TypeError", fault.words, fault.place
    if isinstance(fault, SystemExit):
        words = "a skill must return a report instead of ending the program"
    return f"{kind} in {place}: {words}" if place else f"{kind}: {words}"


def _check(function: Callable[..., Any]) -> None:
    """Raises `Unfit` if a function can't be the skill of any action."""
    if not callable(function):
        raise TypeError(f"a skill must be a function, not a {type(function).__name__}")
    if inspect.iscoroutinefunction(function) or inspect.isasyncgenfunction(function):
        raise Unfit(function, "must not be `async`: write `def`, and `asyncio.run(...)` inside of it")
    if inspect.isgeneratorfunction(function):
        raise Unfit(function, "must not `yield`: a skill returns once, at its end")
    first = next(iter(inspect.signature(function).parameters.values()), None)
    if first is None or first.kind in (inspect.Parameter.KEYWORD_ONLY, inspect.Parameter.VAR_KEYWORD):
        raise Unfit(function, "must take the robot first: write `def pick(robot, pickObject)`")
    if first.name in ("self", "cls"):
        raise Unfit(function, "must not be a method: define it outside of a class")


def _name(function: object) -> str:
    return f"{getattr(function, '__name__', type(function).__name__)}()"


def _file(function: object) -> str | None:
    return getattr(getattr(function, "__code__", None), "co_filename", None)
