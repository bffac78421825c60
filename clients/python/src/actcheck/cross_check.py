"""Plays runs of actcheck in MuJoCo, open loop: `python -m actcheck.cross_check FOLDER`.

FOLDER has a folder for each run with the files of `actcheck export RUN --mjcf DIR --setpoints`, and `play.json`, which names its actions.
Each run is played once for each setting, and recorded as `SETTING.mcap` in the folder of the run. A line of JSON is printed for each
recording.
"""

from __future__ import annotations

import argparse
import csv
import json
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from actcheck.faults import RecordingFault
from actcheck.lines import print_lines
from actcheck.recording import Recorder, record

#: Number of steps of friction that the setting `noslip` adds to each step.
_NOSLIP = 5
#: Factor on the friction of the fingers in the setting `finger-friction`.
_GRIP = 1.1
_PYRAMIDAL = 0
#: One number for each joint.
Row = NDArray[np.float64]


@dataclass(frozen=True)
class Run:
    """A run to play."""

    folder: Path
    #: Names of joints, in the order of the columns of the arrays.
    joints: list[str]
    #: Setpoints at the end of each control tick. Shape: ticks × joints.
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    limit: NDArray[np.float64]
    #: Commanded effort instead of a position; NaN if there is none.
    effort: NDArray[np.float64]
    tick_s: float
    actions: list[dict[str, Any]]
    #: Bodies of the fingers, left and right.
    fingers: list[list[str]]
    about: dict[str, str]


def read(folder: Path) -> Run:
    """Reads the files of a run."""
    with (folder / "setpoints.csv").open(newline="", encoding="utf-8") as stream:
        rows = csv.reader(stream)
        head = next(rows)
        table = np.array([[float(value) if value else np.nan for value in row] for row in rows])
    told = json.loads((folder / "play.json").read_text(encoding="utf-8"))
    columns = table[:, 1:].reshape(len(table), -1, 4)
    position, velocity, limit, effort = (columns[:, :, idx] for idx in range(4))
    joints = [name.removesuffix(".position") for name in head[1::4]]
    return Run(
        folder, joints, position, velocity, limit, effort, float(table[0, 0]), told["actions"], told["fingers"], told["about"]
    )


def _settings(mujoco: Any, finger_friction: float) -> dict[str, Callable[[Any, Run], None]]:
    """The settings by name. The first one is that of the file."""

    def grip(by: float) -> Callable[[Any, Run], None]:
        def change(model: Any, run: Run) -> None:
            bodies = {mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name) for side in run.fingers for name in side}
            owners = model.geom_bodyid
            for pair in range(model.npair):
                if owners[model.pair_geom1[pair]] in bodies or owners[model.pair_geom2[pair]] in bodies:
                    model.pair_friction[pair, :3] *= by

        return change

    def plain(model: Any, run: Run) -> None:
        pass

    def impratio(model: Any, run: Run) -> None:
        model.opt.impratio = 1

    def cone(model: Any, run: Run) -> None:
        model.opt.cone = _PYRAMIDAL

    def noslip(model: Any, run: Run) -> None:
        model.opt.noslip_iterations = _NOSLIP

    settings = {"mujoco": plain, "impratio": impratio, "cone": cone, "noslip": noslip, "finger-friction": grip(_GRIP)}
    if finger_friction == 1:
        return settings
    # Wrong on purpose, in all settings; in one of them it is put right again.
    wrong = grip(finger_friction)

    def both(change: Callable[[Any, Run], None]) -> Callable[[Any, Run], None]:
        def changed(model: Any, run: Run) -> None:
            wrong(model, run)
            change(model, run)

        return changed

    settings = {name: both(change) for name, change in settings.items()}
    return settings | {"finger-friction": both(grip(1 / finger_friction))}


def _data(mujoco: Any, model: Any) -> Any:
    """The state of a model at its start."""
    sleep = getattr(mujoco.mjtEnableBit, "mjENBL_SLEEP", None)
    if sleep is not None:
        model.opt.enableflags |= int(sleep)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return data


def play(run: Run, change: Callable[[Any, Run], None], to: Path) -> float:
    """Plays a run and records it. Returns the CPU time of the simulation. Unit: seconds."""
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(run.folder / "scene.xml"))
    change(model, run)
    data = _data(mujoco, model)
    motors = _Motors(mujoco, model, run.joints)
    steps = max(1, round(run.tick_s / model.opt.timestep))
    began = time.process_time()
    with record(model, data, to) as recorder:
        recorder.about |= run.about
        recorder.step()
        grips = _Grips(mujoco, model, run.fingers)
        for tick in range(len(run.position) + 1):
            _mark(recorder, run, tick, grips)
            if tick == len(run.position):
                break
            motors.begin_tick(run.position[tick], run.velocity[tick], run.limit[tick], run.effort[tick])
            for step in range(steps):
                motors.drive(data, (step + 1) / steps)
                mujoco.mj_step(model, data)
            grips.look(data)
            recorder.step()
    return time.process_time() - began


def _mark(recorder: Recorder, run: Run, tick: int, grips: _Grips) -> None:
    """Records the actions that end or begin at a tick; an action that fails at once does both."""
    for action in run.actions:
        if action["begin_tick"] < tick == action["end_tick"]:
            _mark_end(recorder, action, grips)
    for action in run.actions:
        if action["begin_tick"] == tick:
            recorder.mark(action["action"], "begin", **action["parameters"])
            if action["end_tick"] == tick:
                _mark_end(recorder, action, grips)


def _mark_end(recorder: Recorder, action: dict[str, Any], grips: _Grips) -> None:
    """Records the end of an action with the robot's own report. It is a failure if the robot held an object here, and holds none there."""
    reported, message = action["reported"], action["message"]
    if reported and action["holds"] and not grips.hold():
        reported, message = False, "the fingers hold nothing"
    recorder.mark(action["action"], "end", reported=reported, message=message)


class _Motors:
    """The motors of a robot, which follow setpoints."""

    def __init__(self, mujoco: Any, model: Any, joints: list[str]) -> None:
        found = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, f"robot/{name}") for name in joints]
        self._model = model
        self.columns = np.array([column for column, motor in enumerate(found) if motor >= 0], dtype=int)
        self.motors = np.array([motor for motor in found if motor >= 0], dtype=int)
        stiffness, damping = model.actuator_gainprm[self.motors, 0], -model.actuator_biasprm[self.motors, 2]
        self._lead_s = damping / stiffness
        ids = model.actuator_trnid[self.motors, 0]
        self._positions, self._speeds = model.jnt_qposadr[ids], model.jnt_dofadr[ids]
        self._stiffness, self._damping = stiffness, damping
        self._last = self._target = model.qpos0[self._positions]
        self._tick = (self._target, self._target, self._target)

    def begin_tick(self, position: Row, velocity: Row, limit: Row, effort: Row) -> None:
        """Takes the setpoints at the end of a control tick, one for each joint."""
        self._last, self._target = self._target, position[self.columns]
        self._tick = (velocity[self.columns], limit[self.columns], effort[self.columns])

    def drive(self, data: Any, share: float) -> None:
        """Sets the controls for a step that ends at this share of the tick."""
        velocity, limit, effort = self._tick
        target = self._last + (self._target - self._last) * share
        control = target + self._lead_s * velocity
        pushed = np.isfinite(effort)
        if pushed.any():
            # An effort instead of a position: the effort of the motor's law is taken off again.
            own = self._stiffness * data.qpos[self._positions] + self._damping * data.qvel[self._speeds]
            control = np.where(pushed, (effort + own) / self._stiffness, control)
        self._model.actuator_forcerange[self.motors, 0], self._model.actuator_forcerange[self.motors, 1] = -limit, limit
        data.ctrl[self.motors] = control


class _Grips:
    """The object between the fingers."""

    #: Ticks for which a touch is remembered: MuJoCo drops the contacts of things that sleep, and a grip may slip for an instant.
    _MEMORY = 6

    def __init__(self, mujoco: Any, model: Any, fingers: list[list[str]]) -> None:
        self._owner = model.geom_bodyid
        self._free = {body for body in range(model.nbody) if model.body_dofnum[model.body_rootid[body]] == 6}
        self._fingers = [{mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name) for name in side} for side in fingers]
        self._touched: list[list[set[int]]] = []

    def look(self, data: Any) -> None:
        """Notes the objects that each finger touches now."""
        touched: list[set[int]] = [set(), set()]
        for contact in range(data.ncon):
            first, second = (int(self._owner[geom]) for geom in data.contact.geom[contact])
            for one, other in ((first, second), (second, first)):
                for side, finger in zip(touched, self._fingers, strict=True):
                    if one in finger and other in self._free:
                        side.add(other)
        self._touched = [*self._touched[1 - self._MEMORY :], touched]

    def hold(self) -> bool:
        """Whether both fingers touch the same object, or did a moment ago."""
        left, right = (set().union(*(moment[side] for moment in self._touched)) for side in range(2))
        return bool(left & right)


class Scene:
    """A scene that is stepped on request: `python -m actcheck.cross_check --serve`.

    Each line of the input is a request in JSON, and each line of the output its answer: `{"begin": {…}}` loads a scene, `{"tick": [[position,
    velocity, limit, effort or null], …]}` performs a control tick and returns the state of robot and objects.
    """

    def __init__(self, mujoco: Any, begin: dict[str, Any]) -> None:
        self._mujoco = mujoco
        self._model = model = mujoco.MjModel.from_xml_string(begin["mjcf"])
        self._data = _data(mujoco, model)
        self._steps = max(1, round(begin["tick_s"] / model.opt.timestep))
        self._motors = _Motors(mujoco, model, begin["joints"])
        joints = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, f"robot/{name}") for name in begin["joints"]]
        missing = [name for name, found in zip(begin["joints"], joints, strict=True) if found < 0]
        if missing:
            raise ValueError(f"MuJoCo's model has no joint {missing[0]}")
        self._positions, self._speeds = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
        self._objects = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name) for name in begin["objects"]]
        self._names = [model.body(body).name if body else "floor" for body in range(model.nbody)]

    def tick(self, setpoints: list[list[float | None]]) -> dict[str, Any]:
        """Performs a control tick, and returns the state after it."""
        data, motors = self._data, self._motors
        rows = np.array(setpoints, dtype=float).reshape(-1, 4)
        motors.begin_tick(*(rows[:, column] for column in range(4)))
        for step in range(self._steps):
            motors.drive(data, (step + 1) / self._steps)
            self._mujoco.mj_step(self._model, data)
        loads = np.zeros(len(self._positions))
        loads[motors.columns] = data.actuator_force[motors.motors]
        return {
            "positions": data.qpos[self._positions].tolist(),
            "velocities": data.qvel[self._speeds].tolist(),
            "loads": loads.tolist(),
            "objects": [self._object(body) for body in self._objects],
            "contacts": [self._contact(number) for number in range(data.ncon)],
        }

    def _object(self, body: int) -> list[float]:
        """Position, rotation as x, y, z, w, linear and angular velocity; none of a thing that MuJoCo does not have."""
        if body < 0:
            return []
        w, x, y, z = self._data.xquat[body]
        velocity = np.zeros(6)
        self._mujoco.mj_objectVelocity(self._model, self._data, self._mujoco.mjtObj.mjOBJ_BODY, body, velocity, 0)
        return [*self._data.xpos[body].tolist(), float(x), float(y), float(z), float(w), *velocity[3:].tolist(), *velocity[:3].tolist()]

    def _contact(self, number: int) -> list[Any]:
        """The names of both bodies, the normal force, the force on the second one, and the point."""
        contact = self._data.contact[number]
        names = [self._names[self._model.geom_bodyid[geom]] for geom in contact.geom]
        force = np.zeros(6)
        self._mujoco.mj_contactForce(self._model, self._data, number, force)
        on_second = contact.frame.reshape(3, 3).T @ force[:3]
        return [*names, float(force[0]), on_second.tolist(), contact.pos.tolist()]


def serve() -> int:
    """Answers requests until the input ends."""
    try:
        import mujoco
    except ImportError:
        mujoco = None
    scene: Scene | None = None
    for line in sys.stdin:
        request = json.loads(line)
        try:
            if mujoco is None:
                raise ValueError("the package `mujoco` is missing: pip install mujoco")
            if "begin" in request:
                scene = Scene(mujoco, request["begin"])
                answer: dict[str, Any] = {"engine_version": str(mujoco.__version__)}
            elif scene is None:
                raise ValueError("no scene was loaded")
            else:
                answer = scene.tick(request["tick"])
        except (ValueError, KeyError, IndexError) as fault:
            answer = {"reason": str(fault)}
        print(json.dumps(answer), flush=True)
    return 0


def main(arguments: list[str] | None = None) -> int:
    """Runs the command. Returns 0 if every run was played, 1 if one was not."""
    parser = argparse.ArgumentParser(prog="python -m actcheck.cross_check", description="Plays runs of actcheck in MuJoCo.")
    parser.add_argument("folder", type=Path, nargs="?", help="a folder with a folder for each run, which are played open loop")
    parser.add_argument("--plain", action="store_true", help="plays runs in the setting of their files alone")
    parser.add_argument("--serve", action="store_true", help="steps scenes on request instead")
    parser.add_argument("--finger-friction", type=float, default=1.0, metavar="FACTOR", help="makes the friction of the fingers wrong")
    parsed = parser.parse_args(arguments)
    if parsed.serve:
        return serve()
    if parsed.folder is None:
        parser.error("name a folder, or give --serve")
    return print_lines(_lines(parsed))


def _lines(parsed: argparse.Namespace) -> Iterator[dict[str, Any]]:
    try:
        import mujoco
    except ImportError:
        yield {"reason": "the package `mujoco` is missing: pip install mujoco"}
        return
    yield {"engine_version": str(mujoco.__version__)}
    for folder in sorted(path.parent for path in parsed.folder.glob("*/play.json")):
        run = read(folder)
        settings = _settings(mujoco, parsed.finger_friction)
        for name, change in list(settings.items())[: 1 if parsed.plain else None]:
            to = folder / f"{name}.mcap"
            line: dict[str, Any] = {"run": folder.name, "setting": name}
            try:
                line |= {"cpu_secs": play(run, change, to), "written": str(to)}
            except (RecordingFault, ValueError, OSError) as fault:
                line["reason"] = str(fault)
            yield line


if __name__ == "__main__":
    sys.exit(main())
