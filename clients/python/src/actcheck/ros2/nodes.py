"""Processes of the nodes under test: started for each run, ended with it, with nothing left behind."""

from __future__ import annotations

import fcntl
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO

from actcheck.ros2.faults import BrokenNode
from actcheck.ros2.mapping import LAUNCH

#: Domain ids that are safe on Linux: their ports are below those of outgoing connections.
DOMAINS = range(1, 102)
#: Most output that is kept of a node in a run. Unit: bytes.
MOST_OUTPUT = 64 << 10
#: How long nodes may take to end when asked, before they are killed. Unit: seconds.
GRACE_S = 1.5


class Domain:
    """A domain id that no other campaign on this machine uses, so that nodes of two workers never meet."""

    def __init__(self, after: int = 0) -> None:
        folder = Path(tempfile.gettempdir()) / f"actcheck-ros2-domains-{os.getuid()}"
        folder.mkdir(mode=0o700, exist_ok=True)
        for step in range(1, len(DOMAINS) + 1):
            number = DOMAINS[(after + step - 1) % len(DOMAINS)]
            file = (folder / str(number)).open("w")
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                file.close()
                continue
            self.number, self._file = number, file
            return
        raise BrokenNode(f"all {len(DOMAINS)} domain ids are in use: too many campaigns with ROS 2 run on this machine")

    def close(self) -> None:
        """Frees the id."""
        self._file.close()


class _Program:
    """One node, or a launch file with its nodes."""

    def __init__(self, words: Sequence[str], number: int, folder: Path, env: Mapping[str, str]) -> None:
        self.name = Path(next((word for word in words if word.endswith((".py", *LAUNCH))), words[0])).name
        self.words = _resolved(words, folder)
        self._output = bytearray()
        self._dropped = 0
        self._stopping = False
        try:
            self.process = subprocess.Popen(
                self.words,
                cwd=folder,
                env={**env, "ACTCHECK_ROS_NUMBER": str(number)},
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        except OSError as error:
            raise BrokenNode(f"{words[0]} can't be started: {error.strerror}") from None
        assert self.process.stdout is not None
        self._reader = threading.Thread(target=self._read, args=(self.process.stdout,), daemon=True)
        self._reader.start()

    def _read(self, pipe: IO[bytes]) -> None:
        while piece := os.read(pipe.fileno(), 65536):
            if self._stopping:
                continue
            left = MOST_OUTPUT - len(self._output)
            self._output += piece[:left]
            self._dropped += len(piece) - len(piece[:left])
        pipe.close()

    def output(self) -> list[str]:
        """Its lines."""
        lines = self._output.decode(errors="replace").splitlines()
        return lines + ([f"… {self._dropped} more bytes are left out"] if self._dropped else [])

    def end(self) -> None:
        """Asks it to end."""
        self._stopping = True
        _signal(self.process.pid, signal.SIGINT)

    def kill(self) -> None:
        """Ends it and all that it started."""
        _signal(self.process.pid, signal.SIGKILL)
        self.process.wait()
        self._reader.join(1.0)


class Nodes:
    """All programs of a run."""

    def __init__(self, commands: Sequence[Sequence[str]], folder: Path, env: Mapping[str, str]) -> None:
        self._programs: list[_Program] = []
        try:
            for number, words in enumerate(commands):
                self._programs.append(_Program(words, number, folder, env))
        except BrokenNode:
            self.close()
            raise

    @property
    def count(self) -> int:
        """Number of programs."""
        return len(self._programs)

    def alive(self) -> None:
        """Raises `BrokenNode` if a program has ended."""
        for program in self._programs:
            code = program.process.poll()
            if code is not None:
                time.sleep(0.05)
                words = f"was ended by {signal.Signals(-code).name}" if code < 0 else f"exited with code {code}"
                last = next((line.strip() for line in reversed(program.output()) if line.strip()), "")
                raise BrokenNode(f"{program.name} {words}" + (f": {last}" if last else ""))

    def output(self) -> list[str]:
        """Output of all programs, one after the other, so that it does not depend on which one was faster."""
        several = len(self._programs) > 1
        return [f"[{program.name}] {line}" if several else line for program in self._programs for line in program.output()]

    def close(self) -> None:
        """Ends all programs, and whatever they started."""
        for program in self._programs:
            program.end()
        since = time.monotonic()
        while any(program.process.poll() is None for program in self._programs) and time.monotonic() - since < GRACE_S:
            time.sleep(0.01)
        for program in self._programs:
            program.kill()
        self._programs.clear()


def _resolved(words: Sequence[str], folder: Path) -> list[str]:
    """The words of a command as they are run: Python files with Python, launch files with `ros2 launch`."""
    first = words[0]
    file = folder / first
    if first.endswith(LAUNCH):
        if shutil.which("ros2") is None:
            raise BrokenNode(f"{first} is a launch file, but the program `ros2` was not found: source a ROS 2, or name the nodes' commands")
        return ["ros2", "launch", str(file) if file.exists() else first, *words[1:]]
    if first.endswith(".py"):
        if not file.exists():
            raise BrokenNode(f"the file {file} does not exist")
        return [sys.executable, "-u", str(file), *words[1:]]
    if first in ("python", "python3"):
        return [sys.executable, "-u", *words[1:]]
    return [str(file) if file.exists() else first, *words[1:]]


def _signal(group: int, which: signal.Signals) -> None:
    try:
        os.killpg(group, which)
    except (ProcessLookupError, PermissionError):
        pass
