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


def play(run: Run, change: Callable[[Any, Run], None], to: Path) -> float:
    """Plays a run and records it. Returns the CPU time of the simulation. Unit: seconds."""
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(run.folder / "scene.xml"))
    change(model, run)
    sleep = getattr(mujoco.mjtEnableBit, "mjENBL_SLEEP", None)
    if sleep is not None:
        model.opt.enableflags |= int(sleep)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    motors = _Motors(mujoco, model, run)
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
            for step in range(steps):
                motors.drive(data, tick, (step + 1) / steps)
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

    def __init__(self, mujoco: Any, model: Any, run: Run) -> None:
        found = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, f"robot/{name}") for name in run.joints]
        self._model, self._run = model, run
        self._columns = np.array([column for column, motor in enumerate(found) if motor >= 0], dtype=int)
        self._motors = np.array([motor for motor in found if motor >= 0], dtype=int)
        stiffness, damping = model.actuator_gainprm[self._motors, 0], -model.actuator_biasprm[self._motors, 2]
        self._lead_s = damping / stiffness
        joints = model.actuator_trnid[self._motors, 0]
        self._positions, self._speeds = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
        self._stiffness, self._damping = stiffness, damping
        self._start = model.qpos0[self._positions]

    def drive(self, data: Any, tick: int, share: float) -> None:
        """Sets the controls for a step that ends at this share of a tick."""
        run, columns = self._run, self._columns
        last = run.position[tick - 1, columns] if tick else self._start
        target = last + (run.position[tick, columns] - last) * share
        control = target + self._lead_s * run.velocity[tick, columns]
        limit, effort = run.limit[tick, columns], run.effort[tick, columns]
        pushed = np.isfinite(effort)
        if pushed.any():
            # An effort instead of a position: the effort of the motor's law is taken off again.
            own = self._stiffness * data.qpos[self._positions] + self._damping * data.qvel[self._speeds]
            control = np.where(pushed, (effort + own) / self._stiffness, control)
        self._model.actuator_forcerange[self._motors, 0], self._model.actuator_forcerange[self._motors, 1] = -limit, limit
        data.ctrl[self._motors] = control


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


def main(arguments: list[str] | None = None) -> int:
    """Runs the command. Returns 0 if every run was played, 1 if one was not."""
    parser = argparse.ArgumentParser(prog="python -m actcheck.cross_check", description="Plays runs of actcheck in MuJoCo, open loop.")
    parser.add_argument("folder", type=Path, help="a folder with a folder for each run")
    parser.add_argument("--finger-friction", type=float, default=1.0, metavar="FACTOR", help="makes the friction of the fingers wrong")
    return print_lines(_lines(parser.parse_args(arguments)))


def _lines(parsed: argparse.Namespace) -> Iterator[dict[str, Any]]:
    try:
        import mujoco
    except ImportError:
        yield {"reason": "the package `mujoco` is missing: pip install mujoco"}
        return
    yield {"engine_version": str(mujoco.__version__)}
    for folder in sorted(path.parent for path in parsed.folder.glob("*/play.json")):
        run = read(folder)
        for name, change in _settings(mujoco, parsed.finger_friction).items():
            to = folder / f"{name}.mcap"
            line: dict[str, Any] = {"run": folder.name, "setting": name}
            try:
                line |= {"cpu_secs": play(run, change, to), "written": str(to)}
            except (RecordingFault, ValueError, OSError) as fault:
                line["reason"] = str(fault)
            yield line


if __name__ == "__main__":
    sys.exit(main())
