"""Exceptions, distinguished by cause: the skill, the simulation or the protocol."""

from __future__ import annotations


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


class Closed(ProtocolFault):
    """actcheck closed the connection, or can't be reached."""
