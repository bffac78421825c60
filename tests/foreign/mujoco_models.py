"""Prints how MuJoCo reads MJCF files: one line of JSON for each file.

    python mujoco_models.py FILE...
    python mujoco_models.py --packages NAME...    lists the MJCF files of installed packages
"""

import importlib.util
import json
import pathlib
import sys

import mujoco
import numpy as np


def model_files(packages: list[str]) -> list[str]:
    """The files in packages whose first element is <mujoco>, and that have bodies."""
    found = []
    for name in packages:
        spec = importlib.util.find_spec(name)
        for folder in spec.submodule_search_locations if spec else []:
            for path in sorted(pathlib.Path(folder).rglob("*.xml")):
                text = path.read_text(errors="replace")
                if "<mujoco" in text and "<worldbody" in text:
                    found.append(str(path))
    return found


def name_of(model: mujoco.MjModel, kind: mujoco.mjtObj, idx: int) -> str:
    return mujoco.mj_id2name(model, kind, idx) or ""


def described(path: str) -> dict:
    """Masses, geoms and joints of a model where MuJoCo puts them at first. Frame: world."""
    model = mujoco.MjModel.from_xml_path(path)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    bodies = {}
    for idx in range(model.nbody):
        turned = data.ximat[idx].reshape(3, 3)
        bodies[name_of(model, mujoco.mjtObj.mjOBJ_BODY, idx)] = {
            "kg": float(model.body_mass[idx]),
            "com": data.xipos[idx].tolist(),
            "inertia": (turned @ np.diag(model.body_inertia[idx]) @ turned.T).ravel().tolist(),
        }
    geoms = []
    for idx in range(model.ngeom):
        kind = mujoco.mjtGeom(model.geom_type[idx]).name.removeprefix("mjGEOM_").lower()
        at, turned = data.geom_xpos[idx].copy(), data.geom_xmat[idx].reshape(3, 3).copy()
        if kind == "mesh":
            # MuJoCo moves a mesh to the frame of its inertia; the file's own frame is compared.
            mesh = model.geom_dataid[idx]
            own = np.zeros(9)
            mujoco.mju_quat2Mat(own, model.mesh_quat[mesh])
            turned = turned @ own.reshape(3, 3).T
            at = at - turned @ model.mesh_pos[mesh]
        geoms.append(
            {
                "body": name_of(model, mujoco.mjtObj.mjOBJ_BODY, model.geom_bodyid[idx]),
                "type": kind,
                "size": model.geom_size[idx].tolist(),
                "at": at.tolist(),
                "turned": turned.ravel().tolist(),
                "friction": float(model.geom_friction[idx][0]),
                "collides": bool(model.geom_contype[idx] or model.geom_conaffinity[idx]),
            }
        )
    joints = {}
    for idx in range(model.njnt):
        kind = mujoco.mjtJoint(model.jnt_type[idx]).name.removeprefix("mjJNT_").lower()
        if kind in ("hinge", "slide"):
            joints[name_of(model, mujoco.mjtObj.mjOBJ_JOINT, idx)] = {
                "axis": data.xaxis[idx].tolist(),
                "anchor": data.xanchor[idx].tolist(),
                "range": model.jnt_range[idx].tolist() if model.jnt_limited[idx] else None,
                "at": float(model.qpos0[model.jnt_qposadr[idx]]),
                "body": name_of(model, mujoco.mjtObj.mjOBJ_BODY, model.jnt_bodyid[idx]),
                "slides": kind == "slide",
                "effort": effort(model, idx),
            }
        else:
            joints[name_of(model, mujoco.mjtObj.mjOBJ_JOINT, idx)] = {"type": kind}
    return {"file": path, "bodies": bodies, "geoms": geoms, "joints": joints}


def effort(model: mujoco.MjModel, joint: int) -> float | None:
    """The largest effort of the actuators of a joint; None if no number limits it."""
    limits = []
    for idx in range(model.nu):
        if model.actuator_trntype[idx] != mujoco.mjtTrn.mjTRN_JOINT or model.actuator_trnid[idx][0] != joint:
            continue
        own = []
        if model.actuator_forcelimited[idx]:
            own.append(np.abs(model.actuator_forcerange[idx]).max())
        has_no_bias = model.actuator_biastype[idx] == mujoco.mjtBias.mjBIAS_NONE
        is_fixed = model.actuator_gaintype[idx] == mujoco.mjtGain.mjGAIN_FIXED
        if model.actuator_ctrllimited[idx] and has_no_bias and is_fixed:
            own.append(np.abs(model.actuator_ctrlrange[idx] * model.actuator_gainprm[idx][0]).max())
        if own:
            limits.append(min(own) * abs(model.actuator_gear[idx][0]))
    of_joint = []
    if model.jnt_actfrclimited[joint]:
        of_joint.append(np.abs(model.jnt_actfrcrange[joint]).max())
    if limits:
        of_joint.append(max(limits))
    return float(min(of_joint)) if of_joint else None


def main(arguments: list[str]) -> None:
    if arguments[:1] == ["--packages"]:
        print("\n".join(model_files(arguments[1:])))
        return
    for path in arguments:
        try:
            line = described(path)
        except ValueError as error:
            line = {"file": path, "refused": str(error).splitlines()[0]}
        print(json.dumps(line), flush=True)


main(sys.argv[1:])
