"""One run from a notebook or a shell: starts the simulation and raises the skill's exceptions in the caller."""

from __future__ import annotations

import json
import re
import shlex
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

from actcheck.env import ActionEnv
from actcheck.faults import Aborted, Closed, Failed
from actcheck.messages import Held, Plane, Report, Thing
from actcheck.robot import Ended, Robot
from actcheck.session import Session
from actcheck.skill import Skill, report_of, wanted
from actcheck.wire import Wire

#: Longest time between two commands. Unit: seconds of wall-clock time.
PATIENCE_S = 3600
#: Time limit for actcheck to start. Unit: seconds.
STARTUP_S = 60.0


@dataclass(frozen=True)
class Result:
    """The result of a run."""

    #: 0 if everything passed, 1 if a property failed, 2 if it could not run.
    exit_code: int
    #: Output of actcheck.
    text: str

    @property
    def passed(self) -> bool:
        """Whether every property passed."""
        return self.exit_code == 0

    def __repr__(self) -> str:
        return self.text


class Connection:
    """A campaign of one run whose actions are performed in this process."""

    def __init__(
        self, config: str | Path, actions: Sequence[str], arguments: Sequence[str] = (), actcheck: str = "actcheck"
    ) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="actcheck-")
        path = Path(self._folder.name) / "notebook.sock"
        relay = shlex.join([sys.executable, "-m", "actcheck.relay", str(path)])
        # In the same folder as the configuration, because its paths are relative to it.
        self._config = Path(config).with_name(f".{Path(config).stem}-{Path(self._folder.name).name}.toml")
        self._config.write_text(with_launcher(Path(config).read_text(), relay))
        command = [actcheck, "run", str(self._config), "--runs", "1", "--jobs", "1", *arguments]
        self._output = tempfile.TemporaryFile(mode="w+")
        self._process: subprocess.Popen[str] | None = None
        self._robot: Robot | None = None
        self._relay: socket.socket | None = None
        self._session: Session | None = None
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as door:
                door.bind(str(path))
                door.listen(1)
                self._process = subprocess.Popen(
                    command, stdin=subprocess.DEVNULL, stdout=self._output, stderr=subprocess.STDOUT, text=True
                )
                self._relay = self._answered(door)
            with self._relay.makefile("r") as said:
                address = said.readline().strip()
            self._session = Session(Wire.dial(address), "notebook", list(actions))
        except BaseException:
            self.close()
            raise

    @property
    def session(self) -> Session:
        """The connection to the simulation. Raises `Closed` once the run is over."""
        if self._session is None:
            raise Closed("the run is over")
        return self._session

    def begin(self) -> Robot:
        """Waits for the next action and returns the robot. Raises `Closed` when there are no more actions."""
        if self._robot is not None:
            raise RuntimeError(f"{self._robot.call.action} is still in progress: call `end` first")
        call = self.session.next_call()
        if call is None:
            raise Closed("the run is over: call `result` for its outcome")
        self._robot = Robot(self.session, call)
        return self._robot

    def end(
        self,
        succeeded: bool = True,
        message: str = "",
        perceived: Sequence[Thing] = (),
        plane: Plane | None = None,
        held: Held | None = None,
    ) -> None:
        """Ends the action with its own report."""
        if self._robot is None:
            raise RuntimeError("no action is in progress: call `begin` first")
        self._robot = None
        self.session.end(Report(succeeded, message, perceived, plane, held))

    def perform(self, function: Skill) -> Report:
        """Performs the next action with a skill. Unlike in a campaign, its exceptions are raised here, with their traceback."""
        robot = self.begin()
        report = Report(False, "the skill raised an exception")
        try:
            report = report_of(function, function(robot, **wanted(function, robot.call)))
        except Ended as ended:
            report = ended.report
        except Aborted as aborted:
            self._robot = None
            return Report(False, str(aborted))
        except Failed as failed:
            report = Report(False, str(failed))
        finally:
            if self._robot is not None:
                self._robot = None
                self.session.end(report)
        return report

    def env(self, action: str, ticks: int = 6) -> ActionEnv:
        """The run as an environment with `reset` and `step`."""
        return ActionEnv(action, ticks=ticks, session=self.session)

    def result(self) -> Result:
        """Waits for the end of the run and returns its result."""
        if self._robot is not None:
            self.end(False, "the skill did not end the action")
        while self.session.next_call() is not None:
            self.session.end(Report(False, "the action was not performed"))
        self._hang_up()
        code = 2 if self._process is None else self._process.wait()
        result = Result(code, self._said())
        self.close()
        return result

    def close(self) -> None:
        """Ends the run and removes its temporary files."""
        self._hang_up()
        if self._process is not None and self._process.poll() is None:
            self._process.terminate()
            self._process.wait()
        self._folder.cleanup()
        self._config.unlink(missing_ok=True)

    def _hang_up(self) -> None:
        for end in (self._session, self._relay):
            if end is not None:
                end.close()
        self._session = self._relay = None

    def __enter__(self) -> Connection:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, fault: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _answered(self, door: socket.socket) -> socket.socket:
        """Waits for the relay's connection. Raises `Closed` with actcheck's output if it does not start the relay."""
        door.settimeout(0.1)
        until = time.monotonic() + STARTUP_S
        while time.monotonic() < until:
            try:
                return door.accept()[0]
            except TimeoutError:
                if self._process is not None and self._process.poll() is not None:
                    break
        raise Closed(f"the run did not start:\n{self._said()}")

    def _said(self) -> str:
        self._output.seek(0)
        return self._output.read()


def with_launcher(config: str, launcher: str) -> str:
    """Replaces the `test_launcher` of a configuration's text and raises its time limit."""
    line = f"test_launcher = {json.dumps(launcher)}"
    config, found = re.subn(r"(?m)^test_launcher\s*=.*$", lambda _: line, config)
    if not found:
        config = f"{line}\n{config}"
    config = re.sub(r"(?m)^timeout_s\s*=.*\n?", "", config)
    patience = f"[skill]\ntimeout_s = {PATIENCE_S}.0"
    config, found = re.subn(r"(?m)^\[skill\].*$", lambda _: patience, config)
    return config if found else f"{config}\n{patience}\n"


def connect(
    config: str | Path,
    actions: Sequence[str] = ("Pick",),
    *,
    seed: int | None = None,
    history: str | Path | None = None,
    actcheck: str = "actcheck",
) -> Connection:
    """Starts one run of a configuration whose `actions` are performed here, with `begin` and `end` or with `perform`.

    `actcheck` is the program to start; `history` overrides the folder where the run is stored.
    """
    arguments = [] if seed is None else ["--seed", str(seed)]
    arguments += [] if history is None else ["--history", str(history)]
    return Connection(config, actions, arguments, actcheck)
