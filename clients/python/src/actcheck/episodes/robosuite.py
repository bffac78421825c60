"""HDF5 files of robosuite, robomimic, LIBERO, MimicGen and RoboCasa: a model and MuJoCo states an episode.

A state is the time, the generalised positions and velocities. Poses, contacts and forces are computed from it; the controls are not
stored, so that forces differ from the recorded ones while motors press.
"""

from __future__ import annotations

import importlib.metadata
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from actcheck.episodes import hdf5
from actcheck.episodes.assets import loaded
from actcheck.episodes.faults import EpisodeFault
from actcheck.episodes.sources import Episode, Source
from actcheck.recording.file import EpisodeFile
from actcheck.recording.mujoco_model import described
from actcheck.recording.mujoco_states import Observer
from actcheck.recording.states import Array, Integers, Outcomes

#: States that are read and written at once.
_BATCH = 256
_FORCES = "computed from the states without the controls: forces differ while motors press"
_REWARDS = "the reward of a state is that of the action which follows it"


@dataclass
class _Loaded:
    """The model of the last episode: episodes of one file often have the same."""

    text: str = ""
    model: Any = None

    def of(self, text: str) -> Any:
        """The model with a text."""
        if text != self.text:
            self.text, self.model = "", loaded(text)
            self.text = text
        return self.model


def recognised(file: Any) -> bool:
    """Whether an open HDF5 file has MuJoCo states."""
    for name in hdf5.demonstrations(file):
        demonstration = hdf5.child(file, f"data/{name}")
        return "model_file" in demonstration.attrs or hasattr(hdf5.child(demonstration, "states"), "shape")
    return False


def episodes(source: Source) -> Iterator[Episode]:
    """Yields the episodes of a file; it stays open until the iterator ends."""
    with hdf5.opened(source.path) as file:
        models = _Loaded()
        for name in hdf5.demonstrations(file):
            yield Episode(name, lambda path, name=name: _convert(source, file, name, models, path))  # type: ignore[misc]


def _convert(source: Source, file: Any, name: str, models: _Loaded, path: Path) -> None:
    data, demonstration = hdf5.child(file, "data"), hdf5.child(file, f"data/{name}")
    text = hdf5.text(demonstration, "model_file").lstrip()
    if not text.startswith("<"):
        raise EpisodeFault("model-missing", f"data/{name} has no model: its attribute `model_file` must be the model's XML, not {text[:40]!r}")
    states = hdf5.child(demonstration, "states")
    if states is None or getattr(states, "ndim", 0) != 2 or not len(states):
        raise EpisodeFault("no-states", f"data/{name}/states must be a table with one row a state")
    model = models.of(text)
    _check_length(model, states)
    time, notes = _time(source, data, states)
    rewards = _rewards(demonstration, len(states))
    if rewards is not None:
        notes["note.rewards"] = _REWARDS
    observer = Observer(model, driven=False)
    first = hdf5.numbers(states, 0, 1)[0]
    observer.set(first[1 : 1 + model.nq], first[1 + model.nq : 1 + model.nq + model.nv])
    episode = EpisodeFile(path, described(model, observer.data))
    try:
        for begin in range(0, len(states), _BATCH):
            _write(episode, observer, hdf5.numbers(states, begin, begin + _BATCH), time[begin:], rewards, begin)
        lacks = "controls,joint_efforts,robot_forces,success" + ("" if rewards is not None else ",reward")
        episode.close(source.metadata("robosuite HDF5", name) | _said(data, demonstration) | notes | {"lacks": lacks})
    except BaseException:
        episode.discard()
        raise


def _check_length(model: Any, states: Any) -> None:
    due = 1 + model.nq + model.nv
    if states.shape[1] not in (due, due + model.na):
        raise EpisodeFault(
            "state-length",
            f"{states.name} has rows of {states.shape[1]} numbers; the model needs {due}: time, {model.nq} positions, {model.nv} velocities",
        )


def _write(episode: EpisodeFile, observer: Observer, rows: Array, time: Integers, rewards: Array | None, begin: int) -> None:
    positions = observer.data.qpos.size
    velocities = 1 + positions + observer.data.qvel.size
    for row, at in zip(rows, time.tolist(), strict=False):
        observer.set(row[1 : 1 + positions], row[1 + positions : velocities])
        observer.take(at)
    states = observer.states()
    if rewards is not None:
        no = [False] * len(rows)
        states = replace(states, outcomes=Outcomes(rewards[begin : begin + len(rows)], [None] * len(rows), no, no))
    episode.write(states)


def _time(source: Source, data: Any, states: Any) -> tuple[Integers, dict[str, str]]:
    """Nanoseconds since the first state, and a note if the states do not have them."""
    stored = hdf5.numbers(states, 0, len(states)) if len(states) < _BATCH else _first_column(states)
    time = np.round((stored[:, 0] - stored[0, 0]) * 1e9).astype(np.int64)
    if (np.diff(time) > 0).all():
        return time, {}
    frequency = hdf5.parsed(data, "env_args").get("env_kwargs", {}).get("control_freq")
    step = 1 / float(frequency) if isinstance(frequency, (int, float)) and frequency > 0 else source.options.timestep
    if step is None:
        raise EpisodeFault("time-unknown", f"the time in {states.name} does not increase from state to state: give --timestep SECONDS")
    note = f"the file's times do not increase; the states are {step:g} s apart"
    return np.arange(len(states)) * round(step * 1e9), {"note.time": note}


def _first_column(states: Any) -> Array:
    return np.asarray(states[:, :1], np.float64)


def _rewards(demonstration: Any, states: int) -> Array | None:
    """The reward of each state: that of the action which follows it, as stored; `None` if the file has none."""
    stored = hdf5.child(demonstration, "rewards")
    if stored is None or getattr(stored, "ndim", 0) != 1 or len(stored) != states:
        return None
    return hdf5.numbers(stored, 0, states)


def _said(data: Any, demonstration: Any) -> dict[str, str]:
    """The environment, the task and the versions as the file states them."""
    import mujoco

    environment, task = _named(data, demonstration)
    arguments = hdf5.parsed(data, "env_args")
    recorded = hdf5.text(data, "mujoco_version") or hdf5.text(demonstration, "mujoco_version")
    robosuite = hdf5.text(data, "repository_version") or str(arguments.get("env_version", ""))
    engine = str(mujoco.__version__)
    said = {
        "engine": "MuJoCo",
        "engine_version": engine,
        "environment": environment,
        "task": task,
        "note.forces": _FORCES,
        "note.robosuite": robosuite,
        "note.version": _version_note(engine, recorded, robosuite),
    }
    if recorded:
        said["recorded_with"] = recorded
    return {name: text for name, text in said.items() if text or not name.startswith("note.")}


def _named(data: Any, demonstration: Any) -> tuple[str, str]:
    """The environment's name and the task in words."""
    arguments = hdf5.parsed(data, "env_args")
    problem = hdf5.text(data, "bddl_file_name") or str(arguments.get("bddl_file", ""))
    words = hdf5.parsed(data, "problem_info").get("language_instruction") or hdf5.parsed(demonstration, "ep_meta").get("lang") or ""
    # LIBERO's own reader joins the parts without spaces.
    task = "".join(map(str, words)) if isinstance(words, list) else str(words).strip('"')
    if problem:
        path = PurePosixPath(problem.replace("\\", "/"))
        return f"libero/{path.parent.name}/{path.stem}", task
    name = hdf5.text(data, "env") or str(arguments.get("env_name", ""))
    return (f"robosuite/{name}" if name else ""), task


def _version_note(engine: str, recorded: str, robosuite: str) -> str:
    """A warning if the contacts are not computed with the versions that recorded the states."""
    notes = []
    if not recorded:
        notes.append(f"the file does not say which MuJoCo recorded it; contacts are computed with {engine}")
    elif recorded != engine:
        notes.append(f"recorded with MuJoCo {recorded}; contacts are computed with {engine}")
    try:
        installed = importlib.metadata.version("robosuite")
    except importlib.metadata.PackageNotFoundError:
        installed = ""
    if robosuite and installed and robosuite != installed:
        notes.append(f"recorded with robosuite {robosuite}; meshes are those of {installed}")
    return "; ".join(notes)
