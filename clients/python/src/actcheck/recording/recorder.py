"""Records episodes of a running simulation: `record` returns a context manager, one file is written an episode."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, overload

from actcheck.faults import RecordingFault
from actcheck.recording import environment as environments
from actcheck.recording.environment import Simulation, Stepped
from actcheck.recording.file import EpisodeFile, numbered, slug
from actcheck.recording.goals import goal
from actcheck.recording.mujoco_model import described
from actcheck.recording.mujoco_states import Observer
from actcheck.recording.states import Array, OutcomeRows

#: Oldest supported MuJoCo.
OLDEST_MUJOCO = (3, 3)
#: States that are collected before they are written.
_BATCH = 64
_NANOSECONDS = 1_000_000_000

_Path = str | Path


@overload
def record(environment: Any, path: _Path, /, *, name: str | None = None) -> Recorder: ...


@overload
def record(model: Any, data: Any, path: _Path, /, *, name: str | None = None) -> Recorder: ...


def record(*arguments: Any, name: str | None = None) -> Recorder:
    """Records the episodes of an environment or of a MuJoCo simulation while the returned context manager is open.

    `record(environment, folder)` records an environment of gymnasium, robosuite, LIBERO, RoboCasa, dm_control or metaworld: each
    call of its `step` gives a state, each `reset` begins a new episode. The first state is the one before the first step.
    `record(model, data, folder)` records a simulation on plain MuJoCo; call `Recorder.step` after each control step.

    The files are named `NAME-000001.mcap`, …; none is overwritten. `name` is by default the environment's. A path that ends in
    `.mcap` is the file of the first episode; a second episode is then refused.

    Raises `RecordingFault` if the environment has no MuJoCo simulation, if mcap is missing, or if mujoco is missing or older than 3.3.
    """
    _supported_mujoco()
    if len(arguments) == 2:
        return Recorder(arguments[0], None, Path(arguments[1]), name)
    if len(arguments) == 3:
        model, data, path = arguments
        if type(model).__name__ != "MjModel" or type(data).__name__ != "MjData":
            raise RecordingFault("record(model, data, path) needs a mujoco.MjModel and its mujoco.MjData")
        return Recorder(None, Simulation(model, data), Path(path), name)
    raise TypeError("use record(environment, path) or record(model, data, path)")


def _supported_mujoco() -> str:
    try:
        import mujoco
    except ImportError as fault:
        raise RecordingFault("the package `mujoco` is missing: install the version that your environment needs, 3.3 or later") from fault
    version = str(mujoco.__version__)
    if tuple(int(part) for part in version.split(".")[:2]) < OLDEST_MUJOCO:
        raise RecordingFault(f"MuJoCo {version} is too old: the recorder needs 3.3 or later")
    return version


class _Episode:
    """One episode: its file and the states that are not yet written.

    A step only copies MuJoCo's state. Poses and contacts are computed for many states at once, which is faster than between the steps of
    an environment.
    """

    def __init__(self, simulation: Simulation, path: Path) -> None:
        self._observer = Observer(simulation.model)
        self._observer.restore(self._observer.snapshot(simulation.data))
        self.file = EpisodeFile(path, described(simulation.model, self._observer.data))
        self._times: list[int] = []
        self._states: list[Array] = []
        self._outcomes = OutcomeRows()
        self._begin_s = float(simulation.data.time)
        self.last_s = self._begin_s
        #: Time of the last state. Unit: nanoseconds since the first.
        self.time = -1
        self._says_success = False
        self._has_reward = False
        #: The environment's statements about the task.
        self.stated: dict[str, str] = {}

    def take(self, data: Any, reward: float | None, success: bool | None, terminated: bool, truncated: bool) -> None:
        """Adds the present state. A state at the time of the last one is put one nanosecond after it."""
        self.last_s = float(data.time)
        self.time = max(self.time + 1, round((self.last_s - self._begin_s) * _NANOSECONDS))
        self._times.append(self.time)
        self._states.append(self._observer.snapshot(data))
        self._outcomes.add(reward or 0.0, success, terminated, truncated)
        self._says_success |= success is not None
        self._has_reward |= reward is not None
        if len(self._times) >= _BATCH:
            self.write()

    def write(self) -> None:
        """Computes and writes the collected states."""
        if not self._times:
            return
        for time, state in zip(self._times, self._states, strict=True):
            self._observer.restore(state)
            self._observer.take(time)
        self._times, self._states = [], []
        self.file.write(replace(self._observer.states(), outcomes=self._outcomes.taken()))

    def lacks(self) -> str:
        """Names of the quantities that the episode does not have."""
        return ",".join(name for name, known in (("success", self._says_success), ("reward", self._has_reward)) if not known)


class Recorder:
    """Records while it is open. Create it with `record`."""

    def __init__(self, environment: Any, simulation: Simulation | None, path: Path, name: str | None) -> None:
        self._environment, self._simulation = environment, simulation
        self._single = path if path.suffix == ".mcap" else None
        self._folder = path.parent if self._single else path
        found = simulation or environments.simulation(environment)
        self._described = environments.environment_name(environment) if environment is not None else _model_name(found.model)
        self._name = slug(name or self._described.rpartition("/")[2])
        self._success = _Success(environments.judge_of_success(environment)) if environment is not None else None
        self._seed: int | None = None
        self._episode: _Episode | None = None
        self._hooks: list[_Hook] = []
        #: The files of completed episodes.
        self.files: list[Path] = []
        #: Further metadata of the episodes that are completed from now on, such as `goal_object`; a mapping's `about:goal_object` takes it.
        self.about: dict[str, str] = {}

    def __enter__(self) -> Recorder:
        if self._environment is not None:
            self._hooks = [
                _Hook(self._environment, "step", self._recorded_step),
                _Hook(self._environment, "reset", self._recorded_reset),
            ]
        if self._success is not None:
            self._success.watch()
        return self

    def __exit__(self, kind: type[BaseException] | None, fault: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def step(
        self,
        *,
        reward: float | None = None,
        success: bool | None = None,
        terminated: bool = False,
        truncated: bool = False,
    ) -> None:
        """Records the present state of the simulation. With an environment, its `step` does so by itself.

        The first call begins an episode. A simulation whose time went back was reset and begins a new one.
        """
        simulation = self._current()
        if self._episode is not None and simulation.data.time < self._episode.last_s:
            self.end_episode()
        if self._episode is None:
            self._begin(simulation)
        assert self._episode is not None
        self._episode.take(simulation.data, reward, success, terminated, truncated)

    def mark(
        self,
        action: str,
        event: Literal["begin", "end"],
        /,
        *,
        reported: bool | None = None,
        message: str | None = None,
        **parameters: str | list[str],
    ) -> None:
        """Records that an action was begun or ended, such as `mark("Pick", "begin", pickObject="cube")`. A designator may have several values.

        `reported` and `message` are the robot's own report at the end. The mark belongs to the last recorded state; before the first
        step, to the state before anybody acts.
        """
        if event not in ("begin", "end"):
            raise RecordingFault(f'the event of a mark must be "begin" or "end", not {event!r}')
        self.before_step()
        assert self._episode is not None
        self._episode.write()
        values = {key: [str(one) for one in value] if isinstance(value, list) else str(value) for key, value in parameters.items()}
        content = {"action": action, "event": event, "parameters": values}
        self._episode.file.mark(self._episode.time, content | {"reported": reported, "message": message})

    def end_episode(self) -> None:
        """Completes the file of the episode. The next state begins a new one."""
        episode, self._episode = self._episode, None
        if episode is None:
            return
        episode.write()
        episode.file.close(self._metadata(episode) | self.about)
        self.files.append(episode.file.path)

    def close(self) -> None:
        """Completes the episode and gives the environment its own `step` and `reset` back."""
        hooks, self._hooks = self._hooks, []
        for hook in hooks:
            hook.remove()
        if self._success is not None:
            self._success.unwatch()
        self.end_episode()

    def before_step(self) -> None:
        """Records the state before the first step of an episode."""
        if self._episode is None or self._went_back():
            self.step(success=self._success.now(None) if self._success else None)
        if self._success:
            self._success.forget()

    def after_step(self, returned: Any) -> None:
        """Records the state after a step that returned a value."""
        outcome: Stepped = environments.stepped(returned)
        assert self._success is not None
        success = self._success.now(outcome.success)
        self.step(reward=outcome.reward, success=success, terminated=outcome.terminated, truncated=outcome.truncated)

    def _recorded_step(self, step: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
        self.before_step()
        returned = step(*arguments, **named)
        self.after_step(returned)
        return returned

    def _recorded_reset(self, reset: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
        self.end_episode()
        returned = reset(*arguments, **named)
        seed = named.get("seed")
        self._seed = seed if isinstance(seed, int) else None
        return returned

    def _current(self) -> Simulation:
        """The simulation; an environment may replace its own at each reset."""
        if self._episode is None and self._environment is not None:
            self._simulation = environments.simulation(self._environment)
        assert self._simulation is not None
        return self._simulation

    def _went_back(self) -> bool:
        assert self._episode is not None and self._simulation is not None
        return bool(self._simulation.data.time < self._episode.last_s)

    def _begin(self, simulation: Simulation) -> None:
        if self._single is not None and self.files:
            raise RecordingFault(f"a second episode begins, but {self._single} is one file: give a folder instead")
        self._episode = _Episode(simulation, self._single or numbered(self._folder, self._name))
        found = goal(self._environment, simulation.model) if self._environment is not None else None
        self._episode.stated = found.stated() if found else {}

    def _metadata(self, episode: _Episode) -> dict[str, str]:
        from actcheck import __version__

        metadata = {
            "engine": "MuJoCo",
            "engine_version": _supported_mujoco(),
            "recorder": f"actcheck {__version__} recorder",
            "environment": self._described,
            "task": environments.task_words(self._environment) if self._environment is not None else "",
            "lacks": episode.lacks(),
        }
        seed = self._seed
        if self._environment is not None:
            seed = environments.known_seed(self._environment) if seed is None else seed
            metadata |= episode.stated
        return metadata if seed is None else metadata | {"seed": str(seed)}


def _model_name(model: Any) -> str:
    name = bytes(model.names).split(b"\0", 1)[0].decode(errors="replace")
    return f"mujoco/{name}" if name else "mujoco/model"


class _Hook:
    """Replaces a method of one object until it is removed."""

    def __init__(self, owner: Any, name: str, replacement: Callable[..., Any]) -> None:
        """`replacement` gets the original method as its first argument."""
        self._owner, self._name = owner, name
        self._replaced = vars(owner).get(name)
        setattr(owner, name, functools.partial(replacement, getattr(owner, name)))

    def remove(self) -> None:
        """Gives the object its own method back."""
        if self._replaced is not None:
            setattr(self._owner, self._name, self._replaced)
        else:
            delattr(self._owner, self._name)


class _Success:
    """An environment's success function. Environments call it in each step; its last value is used instead of a second call."""

    def __init__(self, owner: Any) -> None:
        self._owner = owner
        self._hook: _Hook | None = None
        self._last: bool | None = None

    def watch(self) -> None:
        """Begins to listen to the environment's own calls."""
        if self._owner is not None:
            self._hook = _Hook(self._owner, "_check_success", self._checked)

    def unwatch(self) -> None:
        """Gives the environment its own function back."""
        if self._hook is not None:
            self._hook.remove()
        self._hook = None

    def forget(self) -> None:
        """Discards the last value: a step begins."""
        self._last = None

    def now(self, said: bool | None) -> bool | None:
        """Success in the present state. `said`: the success that the environment's step returned, for one without a success function."""
        if self._owner is None:
            return said
        if self._last is None:
            self._owner._check_success()
        return self._last

    def _checked(self, check: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
        result = check(*arguments, **named)
        self._last = bool(result)
        return result
