"""Skills by name, and the loop that performs them for a campaign."""

from __future__ import annotations

import inspect
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from actcheck.faults import Aborted, Failed, ProtocolFault
from actcheck.kinematics import read_urdf
from actcheck.messages import Call, Report
from actcheck.robot import Ended, Robot
from actcheck.session import Session
from actcheck.wire import Wire

#: A skill takes the robot and, as keyword arguments, any of the action's designators.
Skill = Callable[..., "Report | bool | None"]
_Skill = TypeVar("_Skill", bound=Skill)
_PACKAGE = str(Path(__file__).parent)

#: The skills of this program by action.
skills: dict[str, Skill] = {}


def skill(action: str) -> Callable[[_Skill], _Skill]:
    """Registers a function as the skill for an action: `@skill("Pick")`.

    It is called with the robot and, as keyword arguments, the designators of the action that it has parameters for. It
    returns a `Report`, `True` or `None` for success, `False` for failure; `Failed` is a failure too. Any other exception is a
    fault of the program, not of the robot: the run is `broken`, with the traceback in its record.
    """

    def register(function: _Skill) -> _Skill:
        skills[action] = function
        return function

    return register


def serve(name: str | None = None, wire: Wire | None = None) -> None:
    """Performs actions until the campaign is over. Call it at the end of a program that defines skills.

    Actions without a skill in this program are performed by actcheck's reference skills. An exception of a skill ends the
    program, and actcheck starts it anew for the next run.
    """
    name = name or Path(sys.argv[0]).stem or "python"
    try:
        with Session(wire or Wire.from_environment(), name, sorted(skills)) as session:
            urdf = read_urdf(session.description.urdf)
            while (call := session.next_call()) is not None:
                try:
                    report = perform(skills[call.action], Robot(session, call, urdf))
                except Aborted:
                    continue
                except ProtocolFault:
                    raise
                except Exception as fault:
                    # The last line is the reason of the broken run, for readers of its record.
                    traceback.print_exception(fault)
                    sys.exit(told(fault))
                session.end(report)
    except ProtocolFault as fault:
        sys.exit(f"actcheck: {fault}")


def perform(function: Skill, robot: Robot) -> Report:
    """Performs one action and returns its report."""
    try:
        return report_of(function(robot, **wanted(function, robot.call)))
    except Ended as ended:
        return ended.report
    except Failed as failed:
        return Report(False, str(failed))


def wanted(function: Skill, call: Call) -> dict[str, Any]:
    """The action's designators that a function has parameters for, or all if it accepts `**kwargs`."""
    taken = inspect.signature(function).parameters
    if any(parameter.kind is inspect.Parameter.VAR_KEYWORD for parameter in taken.values()):
        return dict(call.parameters)
    return {name: value for name, value in call.parameters.items() if name in taken}


def report_of(returned: Report | bool | None) -> Report:
    """Converts a skill's return value to a report."""
    if isinstance(returned, Report):
        return returned
    if returned is None or returned is True:
        return Report(True)
    if returned is False:
        return Report(False, "the skill returned False")
    raise TypeError(f"a skill returns a Report, a bool or None, not {type(returned).__name__}")


def told(fault: BaseException) -> str:
    """An exception in one line: its message, and the innermost line of code outside this package."""
    words = f"{type(fault).__name__}: {fault}"
    frames = traceback.extract_tb(fault.__traceback__)
    own = [frame for frame in frames if not frame.filename.startswith(_PACKAGE) and "/site-packages/" not in frame.filename]
    if not own:
        return words
    place = own[-1]
    return f"{words} ({Path(place.filename).name}, line {place.lineno}: {(place.line or '').strip()})"
