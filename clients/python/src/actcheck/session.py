"""The message sequence of a connection: hello, then resets and actions until bye."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from types import TracebackType
from typing import Any

from actcheck.faults import Aborted, Closed, ProtocolFault, Refused
from actcheck.messages import PROTOCOL, Call, Observation, Report, RobotDescription
from actcheck.wire import Message, Wire


class Session:
    """A connection to one simulation after the exchange of hello messages."""

    def __init__(self, wire: Wire, name: str, actions: list[str], on_reset: Callable[[], None] = lambda: None) -> None:
        self._wire = wire
        #: Called before a new scene, and after the last action of a run.
        self._on_reset = on_reset
        hello = self._receive("hello")
        if hello.get("protocol") != PROTOCOL:
            wire.close()
            raise ProtocolFault(f"actcheck uses protocol version {hello.get('protocol')}, this package version {PROTOCOL}")
        self.description = RobotDescription.from_wire(hello)
        self._run, self._seed, self._index = "", 0, 0
        #: Ids that the actions and the perception have named in this run.
        self.ids: set[str] = set()
        self._aborted: Aborted | None = None
        wire.send({"type": "hello", "protocol": PROTOCOL, "name": name, "actions": actions})

    def __enter__(self) -> Session:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, fault: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._wire.close()

    def next_call(self) -> Call | None:
        """Waits for the next action; returns `None` when there are no more."""
        while True:
            message = self._receive("reset", "begin", "bye")
            if message["type"] == "bye":
                return None
            if message["type"] == "reset":
                self._on_reset()
                self._run, self._seed = str(message["run"]), int(message["seed"])
                self._index = int(message.get("index", 0))
                self.ids.clear()
                self._wire.send({"type": "ready"})
                continue
            self._aborted = None
            sent = message["observation"]
            truth = {"truth": message["truth"]} if message.get("truth") else {}
            self.ids.update(_texts(message["parameters"].values()))
            return Call(
                action=message["action"],
                parameters={name: _single(value) for name, value in message["parameters"].items()},
                kinds=message.get("kinds") or {},
                budget_s=float(message["budget_s"]),
                observation=Observation.from_wire(sent | truth),
                run=self._run,
                seed=self._seed,
                index=self._index,
            )

    def command(self, message: Message) -> Observation:
        """Sends a command and waits for the observation after its ticks. Raises `Aborted`."""
        self._go_on()
        self._wire.send(message)
        return Observation.from_wire(self._receive("observation"))

    def ask(self, what: str, of: str | None = None) -> Message:
        """Requests sensor data; no simulated time passes. Raises `Aborted`."""
        self._go_on()
        self._wire.send({"type": "ask", "what": what} if of is None else {"type": "ask", "what": what, "of": of})
        return self._receive("answer")

    def end(self, report: Report) -> None:
        """Ends the action with its own report."""
        self._wire.send(report.to_wire())

    def close(self) -> None:
        """Closes the connection."""
        self._wire.close()

    def _go_on(self) -> None:
        """Raises `Aborted` again, without sending anything, if a skill continues after its action was aborted."""
        if self._aborted is not None:
            raise Aborted(self._aborted.reason)

    def _receive(self, *due: str) -> Message:
        message = self._wire.receive()
        kind = message["type"]
        if kind in due:
            return message
        if kind == "abort":
            self._wire.send({"type": "aborted"})
            self._aborted = Aborted(str(message.get("reason", "no reason was given")))
            raise self._aborted
        if kind == "error":
            raise Refused(str(message.get("reason", "no reason was given")))
        if kind == "bye":
            raise Closed("actcheck ended the connection")
        raise ProtocolFault(f"received `{kind}`, expected {' or '.join(due)}")


def _texts(values: Iterable[Any]) -> list[str]:
    """All texts among values and lists of values."""
    lists = (value if isinstance(value, list) else [value] for value in values)
    return [one for some in lists for one in some if isinstance(one, str)]


def _single(value: Any) -> Any:
    """The value of a designator: a single value is unwrapped from its list."""
    return value[0] if isinstance(value, list) and len(value) == 1 else value
