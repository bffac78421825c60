"""The tasks of LIBERO's suites and robosuite's environments, with their initial states.

LIBERO and robosuite are those of the environment that runs this program; they are imported when a suite is opened.
"""

from __future__ import annotations

import contextlib
import importlib
import logging
import os
import sys
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from actcheck.episodes.faults import EpisodeFault, missing_package
from actcheck.episodes.scene import Scene
from actcheck.recording.environment import simulation
from actcheck.recording.goals import goal
from actcheck.recording.states import Array

_ROBOSUITE = "robosuite/"
#: Height to which Lift's cube is raised: 4 cm above the table count as success. Unit: metres.
_LIFTED_M = 0.1


@dataclass(frozen=True)
class Aim:
    """Where an object is to be."""

    #: Body that moves.
    object: str
    #: Body that is the goal or carries it; the world's for a place in the air.
    target: str
    #: Point of the goal. Unit: metres. Frame: world.
    point: Array
    #: Whether the goal carries the object; otherwise it is a place in the air.
    carries: bool = True


class Task(Protocol):
    """A task with its environment."""

    #: Name for files.
    name: str
    environment: Any

    def begin(self, state: int) -> None:
        """Puts the environment into an initial state. Raises `IndexError` if it has fewer."""

    def aim(self) -> Aim | None:
        """Where the task wants an object in the present state; `None` if its goal is of another kind."""

    def close(self) -> None:
        """Frees the environment."""


def tasks(suite: str, numbers: list[int] | None) -> Iterator[tuple[int, Task]]:
    """Opens the tasks of a suite one after another, each of which is closed before the next.

    `suite` is the name of a suite of LIBERO, or `robosuite/` with that of an environment, which is one task. Raises `EpisodeFault` for an
    unknown suite or task.
    """
    opened = _robosuite_tasks(suite, numbers) if suite.startswith(_ROBOSUITE) else _libero_tasks(suite, numbers)
    for number, task in opened:
        try:
            yield number, task
        finally:
            task.close()


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Moves the prints of LIBERO and robosuite to the standard error, and silences their warnings."""
    os.environ.setdefault("MUJOCO_GL", "disabled")
    disabled = logging.root.manager.disable
    logging.disable(logging.WARNING)
    try:
        with warnings.catch_warnings(), contextlib.redirect_stdout(sys.stderr):
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(disabled)


def idle(environment: Any) -> Array:
    """The action with which a robot stays where it is, with an open hand."""
    action = np.zeros(_action_size(environment))
    action[-1] = -1.0
    return action


def _action_size(environment: Any) -> int:
    inner = getattr(environment, "env", environment)
    return int(getattr(environment, "action_dim", None) or inner.action_dim)


def _package(name: str, installed_as: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError as fault:
        raise missing_package(installed_as, "this suite") from fault


class _LiberoTask:
    """A task of LIBERO."""

    def __init__(self, benchmark: Any, number: int) -> None:
        wrapper = _package("libero.libero.envs.env_wrapper", "libero")
        self.name = str(benchmark.get_task(number).name)
        self._states = benchmark.get_task_init_states(number)
        self.environment = wrapper.ControlEnv(
            bddl_file_name=benchmark.get_task_bddl_file_path(number),
            has_renderer=False,
            has_offscreen_renderer=False,
            use_camera_obs=False,
            ignore_done=True,
        )

    def begin(self, state: int) -> None:
        """Puts the environment into one of LIBERO's initial states. Its fixtures are placed by chance, always with the same seed."""
        values = self._states[state]
        self.environment.seed(0)
        self.environment.reset()
        self.environment.set_init_state(values)

    def aim(self) -> Aim | None:
        """The single goal "the object is on (in) the target"; `None` for tasks with other goals."""
        model, data = _now(self.environment)
        found = goal(self.environment, model)
        if found is None:
            return None
        try:
            point = data.site(found.place).xpos
        except KeyError:
            point = data.body(found.target).xpos
        return Aim(found.object, found.target, np.array(point))

    def close(self) -> None:
        """Frees the environment."""
        self.environment.close()


def _libero_tasks(suite: str, numbers: list[int] | None) -> Iterator[tuple[int, Task]]:
    suites = _package("libero.libero.benchmark", "libero").get_benchmark_dict()
    if suite.lower() not in suites:
        raise EpisodeFault("not-found", f"LIBERO has no suite {suite}; it has {', '.join(sorted(suites)[:8])}, …")
    benchmark = suites[suite.lower()]()
    for number in _chosen(suite, int(benchmark.n_tasks), numbers):
        yield number, _LiberoTask(benchmark, number)


def _chosen(suite: str, count: int, numbers: list[int] | None) -> list[int]:
    for number in numbers or []:
        if number >= count:
            raise EpisodeFault("not-found", f"{suite} has the tasks 0 to {count - 1}, not {number}")
    return list(range(count)) if numbers is None else numbers


class _RobosuiteTask:
    """An environment of robosuite with a Panda. The number of an initial state is the seed."""

    def __init__(self, name: str) -> None:
        self._robosuite = _package("robosuite", "robosuite")
        if name not in self._robosuite.ALL_ENVIRONMENTS:
            raise EpisodeFault("not-found", f"robosuite has no environment {name}; it has {', '.join(sorted(self._robosuite.ALL_ENVIRONMENTS))}")
        self.name = name
        self.environment: Any = None

    def begin(self, state: int) -> None:
        """Makes the environment anew: robosuite 1.5 draws from a generator that it gets when it is made, 1.4 from NumPy's."""
        self.close()
        np.random.seed(state)
        version = tuple(int(part) for part in str(self._robosuite.__version__).split(".")[:2])
        seed = {"seed": state} if version >= (1, 5) else {}
        controller = {} if seed else {"controller_configs": self._robosuite.load_controller_config(default_controller="OSC_POSE")}
        self.environment = self._robosuite.make(
            self.name,
            robots="Panda",
            has_renderer=False,
            has_offscreen_renderer=False,
            use_camera_obs=False,
            control_freq=20,
            ignore_done=True,
            **seed,
            **controller,
        )
        self.environment.reset()

    def aim(self) -> Aim | None:
        """Where Lift, Stack and PickPlaceCan want their object; `None` for other environments."""
        _, data = _now(self.environment)
        if self.name == "Lift":
            return Aim("cube_main", "world", data.body("cube_main").xpos + [0.0, 0.0, _LIFTED_M], carries=False)
        if self.name == "Stack":
            return Aim("cubeA_main", "cubeB_main", Scene(self.environment).top("cubeB_main"))
        if self.name == "PickPlaceCan":
            place = self.environment.target_bin_placements[self.environment.object_id]
            return Aim("Can_main", "bin2", np.array(place))
        return None

    def close(self) -> None:
        """Frees the environment."""
        environment, self.environment = self.environment, None
        if environment is not None:
            environment.close()


def _robosuite_tasks(suite: str, numbers: list[int] | None) -> Iterator[tuple[int, Task]]:
    for number in _chosen(suite, 1, numbers):
        yield number, _RobosuiteTask(suite.removeprefix(_ROBOSUITE))


def _now(environment: Any) -> tuple[Any, Any]:
    found = simulation(environment)
    return found.model, found.data
