"""Exceptions, distinguished by cause: the skill, the simulation or the protocol."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


class Failed(Exception):
    """The robot could not perform the action. Raise it in a skill to report a failure in your own words."""


class Unreachable(Failed):
    """No joint positions within the limits bring the tool to the pose."""


class Aborted(BaseException):
    """actcheck ended the action: its budget is exhausted, the simulation failed, or the campaign was stopped.

    Not an `Exception`, so that a skill's own `except Exception` does not catch it; `serve` and `ActionEnv` handle it.
    """

    def __init__(self, reason: str) -> None:
        super().__init__(f"the action was ended: {reason}")
        self.reason = reason


class ProtocolFault(Exception):
    """Either side violated the protocol: actcheck sent an invalid message, or rejected one of this program's."""


class Refused(ProtocolFault):
    """actcheck refused a message of this program; the text is its reason."""


class Closed(ProtocolFault):
    """actcheck closed the connection, or can't be reached."""


class RecordingFault(Exception):
    """An episode can't be recorded: a package is missing, the environment has no MuJoCo simulation, or the file exists."""


@dataclass(frozen=True)
class Fault:
    """One fault of the values, rules or ontology that `Judge` got."""

    #: Stable code, such as `J001`; `actcheck explain J001` explains it.
    code: str
    message: str
    #: The place: of a value, such as `before["bodies"]["cube"]`, or of a text, such as `rule.rls:3:5`.
    place: str | None
    #: The remedy.
    help: str | None

    def __str__(self) -> str:
        text = f"{self.code} {self.place}: {self.message}" if self.place else f"{self.code}: {self.message}"
        return f"{text} ({self.help})" if self.help else text


class JudgeError(ValueError):
    """`Judge` can't use the values, rules or ontology that it got. `faults` lists everything that is wrong."""

    def __init__(self, faults: Sequence[Fault | tuple[str, str, str | None, str | None]]) -> None:
        self.faults = tuple(fault if isinstance(fault, Fault) else Fault(*fault) for fault in faults)
        super().__init__("\n".join(str(fault) for fault in self.faults))

    def __reduce__(self) -> tuple[type[JudgeError], tuple[tuple[Fault, ...]]]:
        return JudgeError, (self.faults,)

    @property
    def code(self) -> str:
        """The code of the first fault."""
        return self.faults[0].code

    @property
    def place(self) -> str | None:
        """The place of the first fault."""
        return self.faults[0].place
