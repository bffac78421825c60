"""LeRobotDataset v3: Parquet tables with observed states, actions, rewards and success. It has no bodies, shapes and contacts."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from actcheck.episodes.faults import EpisodeFault
from actcheck.episodes.sources import Episode, Source
from actcheck.recording.file import EpisodeFile
from actcheck.recording.model import Model, world
from actcheck.recording.states import Array, Outcomes, States

_LACKS = "contacts,contact_forces,velocities,joint_velocities,joint_efforts,joint_limits,masses,frictions,shapes,robot"
_JOINTS = "the columns of observation.state, in the units of the dataset; all are described as hinges"
_REWARDS = "reward and success of a state are those that follow its action"
_COLUMNS = ("episode_index", "timestamp", "task_index", "observation.state", "action", "next.reward", "next.success", "next.done")

Table = dict[str, Any]


def recognised(path: Path) -> bool:
    """Whether a path is a dataset's folder or its `meta/info.json`."""
    return path.name == "info.json" or (path / "meta" / "info.json").is_file()


def episodes(source: Source) -> Iterator[Episode]:
    """Yields the episodes of a dataset, one data file after the other."""
    folder = source.path.parent.parent if source.path.name == "info.json" else source.path
    info = _json(folder / "meta" / "info.json")
    version = str(info.get("codebase_version", ""))
    if not version.startswith("v3"):
        raise EpisodeFault("unknown-format", f"{folder} has LeRobot's format {version or 'of no version'}; convert it to v3.0 with lerobot")
    tasks = _tasks(folder)
    files = sorted((folder / "data").rglob("*.parquet"))
    if not files:
        raise EpisodeFault("no-states", f"{folder}/data has no Parquet file")
    for file in files:
        table = _table(file, _COLUMNS)
        if "episode_index" not in table or "observation.state" not in table:
            raise EpisodeFault("field-missing", f"{file} needs the columns episode_index and observation.state")
        index = np.asarray(table["episode_index"]).ravel()
        bounds = [0, *(np.flatnonzero(np.diff(index)) + 1).tolist(), len(index)]
        for begin, end in zip(bounds[:-1], bounds[1:], strict=True):
            rows = {name: values[begin:end] for name, values in table.items()}
            key = f"episode_{int(index[begin]):06}"
            yield Episode(key, lambda path, rows=rows, key=key: _convert(source, info, tasks, key, rows, path))  # type: ignore[misc]


def _json(path: Path) -> dict[str, Any]:
    try:
        parsed = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as fault:
        raise EpisodeFault("damaged", f"{path} can't be read as JSON: {fault}") from fault
    if not isinstance(parsed, dict):
        raise EpisodeFault("damaged", f"{path} must be a JSON object")
    return parsed


def _table(path: Path, wanted: tuple[str, ...] | None) -> Table:
    """The wanted columns of a Parquet file, read with pyarrow or polars: lists of values, or arrays with one row a row."""
    try:
        import pyarrow.parquet
    except ImportError:
        return _polars_table(path, wanted)
    try:
        file = pyarrow.parquet.ParquetFile(path)
        names = [name for name in file.schema_arrow.names if wanted is None or name in wanted]
        return {name: _array(values) for name, values in file.read(columns=names).to_pydict().items()}
    except (OSError, ValueError) as fault:
        raise EpisodeFault("damaged", f"{path} can't be read as Parquet: {fault}") from fault


def _polars_table(path: Path, wanted: tuple[str, ...] | None) -> Table:
    try:
        import polars
    except ImportError as fault:
        raise EpisodeFault("missing-package", "a LeRobot dataset needs a reader of Parquet: pip install pyarrow") from fault
    try:
        names = [name for name in polars.read_parquet_schema(path) if wanted is None or name in wanted]
        return {name: _array(values) for name, values in polars.read_parquet(path, columns=names).to_dict(as_series=False).items()}
    except (OSError, ValueError, polars.exceptions.PolarsError) as fault:
        raise EpisodeFault("damaged", f"{path} can't be read as Parquet: {fault}") from fault


def _array(values: list[Any]) -> Any:
    """Numbers as an array; text stays a list."""
    return values if values and isinstance(values[0], str) else np.array(values, dtype=np.float64)


def _tasks(folder: Path) -> dict[int, str]:
    """Index of a task → the task in words."""
    path = folder / "meta" / "tasks.parquet"
    if not path.is_file():
        return {}
    table = _table(path, None)
    words = next((values for name, values in table.items() if isinstance(values, list)), [])
    return {int(at): text for at, text in zip(table.get("task_index", []), words, strict=False)}


def _convert(source: Source, info: dict[str, Any], tasks: dict[int, str], key: str, rows: Table, path: Path) -> None:
    observed, acted = _numbers(rows, "observation.state", key), _numbers(rows, "action", key)
    assert observed is not None
    rewards, success = rows.get("next.reward"), rows.get("next.success")
    states = States(
        time=_time(source, info, rows, key),
        poses=np.zeros((len(observed), 0, 7)),
        joint_positions=observed,
        controls=acted,
        outcomes=_outcomes(rows, len(observed)) if rewards is not None or success is not None else None,
    )
    lacks = [_LACKS]
    lacks += [name for name, values in (("controls", acted), ("reward", rewards), ("success", success)) if values is None]
    episode = EpisodeFile(path, _model(info, observed, acted))
    try:
        episode.write(states)
        task = tasks.get(int(np.ravel(rows["task_index"])[0]), "") if "task_index" in rows else ""
        episode.close(
            source.metadata("LeRobot dataset", key)
            | {
                "engine": "",
                "engine_version": "",
                "environment": str(info.get("robot_type") or ""),
                "task": task,
                "lacks": ",".join(lacks),
                "note.joints": _JOINTS,
                "note.rewards": _REWARDS,
            }
        )
    except BaseException:
        episode.discard()
        raise


def _numbers(rows: Table, name: str, key: str) -> Array | None:
    """A column with several numbers a row. Shape: states × numbers."""
    if name not in rows:
        return None
    values = np.asarray(rows[name], np.float64).reshape(len(rows["episode_index"]), -1)
    if not np.isfinite(values).all():
        raise EpisodeFault("not-finite", f"{name} of {key} has a number that is not finite")
    return values


def _time(source: Source, info: dict[str, Any], rows: Table, key: str) -> Any:
    """Nanoseconds since the first state."""
    if "timestamp" in rows:
        stored = np.ravel(rows["timestamp"])
        time = np.round((stored - stored[0]) * 1e9).astype(np.int64)
        if (np.diff(time) > 0).all():
            return time
    frequency = info.get("fps")
    step = source.options.timestep or (1 / float(frequency) if isinstance(frequency, (int, float)) and frequency > 0 else None)
    if step is None:
        raise EpisodeFault("time-unknown", f"the times of {key} do not increase and the dataset has no `fps`: give --timestep SECONDS")
    return np.round(np.arange(len(rows["episode_index"])) * step * 1e9).astype(np.int64)


def _outcomes(rows: Table, count: int) -> Outcomes:
    said = [bool(value) for value in np.ravel(rows["next.success"])] if "next.success" in rows else [None] * count
    done = [bool(value) for value in np.ravel(rows["next.done"])] if "next.done" in rows else [False] * count
    rewards = np.ravel(rows["next.reward"]).astype(np.float64) if "next.reward" in rows else np.zeros(count)
    return Outcomes(rewards, list(said), done, [False] * count)


def _model(info: dict[str, Any], observed: Array, acted: Array | None) -> Model:
    return {
        "bodies": [world()],
        "joints": [
            {"name": name, "body": 0, "kind": "hinge", "limits": None, "max_effort": None, "max_velocity": None}
            for name in _names(info, "observation.state", observed.shape[1])
        ],
        "actuators": [{"name": name} for name in _names(info, "action", acted.shape[1])] if acted is not None else [],
        "sites": [],
        "timestep": None,
        "gravity": [0.0, 0.0, -9.81],
    }


def _names(info: dict[str, Any], feature: str, count: int) -> list[str]:
    """Names of a feature's columns, from a list or from lists in an object; otherwise numbered."""
    names = (info.get("features") or {}).get(feature, {}).get("names")
    if isinstance(names, dict):
        names = [name for part in names.values() if isinstance(part, list) for name in part]
    if isinstance(names, list) and len(names) == count and len(set(map(str, names))) == count:
        return [str(name) for name in names]
    return [f"{feature}{at}" for at in range(count)]
