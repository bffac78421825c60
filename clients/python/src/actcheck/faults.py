"""What can go wrong, told apart by whose fault it is."""

from __future__ import annotations


class Failed(Exception):
    """The robot could not do what it was asked to: raise it in a skill to report failure in your own words."""


class Unreachable(Failed):
    """No joint positions within the limits bring the tool to the pose."""


class Aborted(BaseException):
    """actcheck ended the action: its time is up, simulation is at fault, or the campaign was stopped.

    No `Exception`, so that a skill's own `except Exception` does not swallow it; `serve` and `ActionEnv` deal with it.
    """

    def __init__(self, reason: str) -> None:
        super().__init__(f"the action was ended: {reason}")
        self.reason = reason


class ProtocolFault(Exception):
    """The other side sent what the protocol does not allow, or said that this side did."""


class Closed(ProtocolFault):
    """The other side is gone."""
