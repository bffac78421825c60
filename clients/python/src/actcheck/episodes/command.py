"""The command line: converts files, or records episodes of a suite, and prints one JSON line an episode."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from actcheck.episodes import audit, hdf5, isaac, lerobot, robosuite, rosbag, suites
from actcheck.episodes.faults import EpisodeFault
from actcheck.episodes.faulty import FAULTS
from actcheck.episodes.sources import Episode, Options, Source
from actcheck.faults import RecordingFault
from actcheck.lines import print_lines
from actcheck.recording.file import slug


def main(arguments: list[str] | None = None) -> int:
    """Runs the command. Returns 0 if every episode was written or left out, 1 if one has a fault, 2 if the arguments are wrong."""
    return print_lines(_lines(_parser().parse_args(arguments)))


def _lines(parsed: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Performs the command. Yields a line an episode."""
    if parsed.command == "convert":
        options = Options(parsed.quaternions, parsed.timestep)
        for path in parsed.files:
            for line in _converted(Source(path, options), parsed.to, parsed.limit):
                yield {"file": str(path)} | line
        return
    if parsed.command == "states":
        lines = audit.record_states(parsed.suite, parsed.tasks, parsed.states, parsed.settle, parsed.to)
    else:
        lines = audit.record_faults(parsed.suite, parsed.tasks, parsed.faults, parsed.steps, parsed.settle, parsed.to)
    for line in _recorded(lines):
        yield {"file": parsed.suite} | line


def _recorded(lines: Iterator[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """The lines of a recording, which ends with a line for a fault if there is one."""
    try:
        while True:
            # Only while the environment runs: its own prints must not be among the lines.
            with suites.quiet():
                line = next(lines, None)
            if line is None:
                return
            yield line
    except EpisodeFault as fault:
        yield {"episode": None, "fault": fault.code, "reason": fault.reason}
    except RecordingFault as fault:
        yield {"episode": None} | _recording_fault(fault)
    except Exception as fault:  # noqa: BLE001 - a line of output, never a traceback
        yield {"episode": None, "fault": "failed", "reason": _words(fault)}


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser("python -m actcheck.episodes", description="Writes episode files.")
    commands = parser.add_subparsers(dest="command", required=True)
    convert = commands.add_parser(
        "convert",
        help="convert HDF5 files of robosuite, robomimic, LIBERO, MimicGen, RoboCasa and Isaac Lab, LeRobot datasets, and ROS 2 bags",
    )
    convert.add_argument("files", nargs="+", type=Path, metavar="FILE")
    convert.add_argument("--limit", type=int, metavar="N", help="most episodes of a file")
    convert.add_argument("--quaternions", choices=("wxyz", "xyzw"), help="order in an Isaac Lab file that does not say")
    convert.add_argument("--timestep", type=_positive, metavar="SECONDS", help="time between states in a file that does not say")
    states = commands.add_parser("states", help="record the first states of a suite's tasks, for `actcheck check-episodes`")
    states.add_argument("--states", type=int, default=10, metavar="N", help="initial states of a task; seeds of robosuite [default: 10]")
    faulty = commands.add_parser("audit", help="record faulty episodes of a suite's tasks, for `actcheck check-oracles --episodes`")
    faulty.add_argument("--faults", type=fault_names, default=list(FAULTS), metavar="A,B", help=f"some of {', '.join(FAULTS)} [default: all]")
    faulty.add_argument("--steps", type=int, default=40, metavar="N", help="steps after the fault in which the robot does nothing [default: 40]")
    for command in (states, faulty):
        command.add_argument("suite", metavar="SUITE", help="a suite of LIBERO, such as libero_spatial, or robosuite/NAME")
        command.add_argument("--tasks", type=task_numbers, metavar="0,3-5", help="numbers of tasks [default: all]")
        command.add_argument("--settle", type=int, default=10, metavar="N", help="idle steps before the first state [default: 10]")
    for command in (convert, states, faulty):
        command.add_argument("--to", required=True, type=Path, metavar="DIR", help="folder of the episode files; none is overwritten")
    return parser


def fault_names(text: str) -> list[str]:
    """Names of faults, such as `idle,teleport`."""
    names = text.split(",")
    for name in names:
        if name not in FAULTS:
            raise argparse.ArgumentTypeError(f"{name!r} is not a fault: choose from {', '.join(FAULTS)}")
    return names


def task_numbers(text: str) -> list[int]:
    """Numbers and ranges of tasks, such as `0,3-5`."""
    numbers: set[int] = set()
    for part in text.split(","):
        found = re.fullmatch(r"([0-9]+)(?:-([0-9]+))?", part)
        if found is None:
            raise argparse.ArgumentTypeError(f"{part!r} is neither a number nor a range such as 3-5")
        numbers.update(range(int(found[1]), int(found[2] or found[1]) + 1))
    return sorted(numbers)


def _positive(text: str) -> float:
    value = float(text)
    if not 0 < value < 1e6:
        raise argparse.ArgumentTypeError("must be a positive number of seconds")
    return value


def _converted(source: Source, folder: Path, limit: int | None) -> Iterator[dict[str, Any]]:
    """Converts the episodes of a source. Yields a line an episode, or one for a fault of the whole source."""
    try:
        for count, episode in enumerate(_episodes(source)):
            if limit is not None and count >= limit:
                return
            yield {"episode": episode.key} | _written(source, episode, folder)
    except EpisodeFault as fault:
        yield {"episode": None, "fault": fault.code, "reason": fault.reason}
    except Exception as fault:  # noqa: BLE001 - a line of output, never a traceback
        yield {"episode": None, "fault": "failed", "reason": _words(fault)}


def _written(source: Source, episode: Episode, folder: Path) -> dict[str, Any]:
    path = folder / f"{slug(source.path.stem)}-{slug(episode.key)}.mcap"
    try:
        if path.exists():
            raise EpisodeFault("exists", f"{path} exists: choose another folder; episodes are never overwritten")
        episode.write(path)
    except EpisodeFault as fault:
        return {"fault": fault.code, "reason": fault.reason}
    except RecordingFault as fault:
        return _recording_fault(fault)
    except Exception as fault:  # noqa: BLE001 - a line of output, never a traceback
        return {"fault": "failed", "reason": _words(fault)}
    return {"written": str(path)}


def _recording_fault(fault: RecordingFault) -> dict[str, Any]:
    return {"fault": "missing-package" if "pip install" in str(fault) else "unwritable", "reason": str(fault)}


def _words(fault: Exception) -> str:
    return f"{type(fault).__name__}: {' '.join(str(fault).split())}"


def _episodes(source: Source) -> Iterator[Episode]:
    """Recognises a source by its content and yields its episodes."""
    path = source.path
    if not path.exists():
        raise EpisodeFault("not-found", f"{path} does not exist")
    if path.is_file() and hdf5.is_hdf5(path):
        return _hdf5_episodes(source)
    if lerobot.recognised(path):
        return lerobot.episodes(source)
    if rosbag.recognised(path):
        return rosbag.episodes(source)
    raise EpisodeFault(
        "unknown-format",
        f"{path} is neither an HDF5 file, nor the folder of a LeRobot dataset (meta/info.json), nor a ROS 2 bag (metadata.yaml)",
    )


def _hdf5_episodes(source: Source) -> Iterator[Episode]:
    with hdf5.opened(source.path) as file:
        if isaac.recognised(file):
            return isaac.episodes(source)
        if robosuite.recognised(file):
            return robosuite.episodes(source)
    raise EpisodeFault(
        "unknown-format", f"{source.path} has no groups data/demo_… with `model_file` and `states`, nor with `initial_state`"
    )


if __name__ == "__main__":
    sys.exit(main())
