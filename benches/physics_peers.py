#!/usr/bin/env python3
"""Compares physics steps per second of MuJoCo and PyBullet with actcheck, in the scene of `physics.rs`.

Run from the root of the checkout, with Cargo installed: `python3 benches/physics_peers.py`. It creates a virtual
environment in `target/physics_peers`, installs both from PyPI, gets the scene from `cargo bench --bench physics --
--scene FILE` (or from an existing file with `--scene FILE`), builds it in each engine from the same solids, masses,
frictions and robot, with the same time step and with motors that hold every joint, and prints the rates. Each engine
keeps its own defaults for solver and contacts: the solvers of MuJoCo and PyBullet stop early if they can, and MuJoCo's
bodies never sleep here. PyBullet warns about massless links on standard error.
"""

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from environment import enter

HERE = Path(__file__).resolve().parent
PACKAGES = ["mujoco==4.0.0", "pybullet==3.2.7"]
# As in `physics.rs`.
STEPS = 480
ROUNDS = 15
SETTLING = 480


def main():
    enter(__file__, PACKAGES)
    arguments = sys.argv[1:]
    if arguments[:1] == ["--scene"]:
        scene = json.loads(Path(arguments[1]).read_text())
    else:
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "scene.json"
            bench = ["cargo", "bench", "--bench", "physics", "--", "--scene", str(file)]
            subprocess.run(bench, check=True, cwd=HERE.parent)
            scene = json.loads(file.read_text())
    rates = dict(scene["rates"])
    rates["MuJoCo"] = rate(mujoco_steps(scene))
    rates["PyBullet"] = rate(pybullet_steps(scene, sleeping=True))
    rates["PyBullet, nothing sleeps"] = rate(pybullet_steps(scene, sleeping=False))
    ours = rates["actcheck"]
    print(f"{'engine':<36}{'steps/s':>10}{'actcheck is':>14}")
    for name, value in rates.items():
        print(f"{name:<36}{value:>10.0f}{ours / value:>11.2f} x")


def rate(step):
    """Returns steps per second: the fastest of several measurements."""
    for _ in range(SETTLING):
        step()
    fastest = float("inf")
    for _ in range(ROUNDS):
        start = time.perf_counter()
        for _ in range(STEPS):
            step()
        fastest = min(fastest, time.perf_counter() - start)
    return STEPS / fastest


def mujoco_steps(scene):
    import math

    import mujoco

    # Keep links fixed to the world as bodies, so that the robot can be moved. Massless links get the same masses as ours.
    compiler = '<mujoco><compiler fusestatic="false" boundmass="0.01" boundinertia="4e-7"/></mujoco></robot>'
    urdf = scene["robot"].replace("</robot>", compiler)
    spec = mujoco.MjSpec.from_string(urdf)
    spec.option.timestep = 1.0 / scene["steps_per_second"]
    x, y, heading = scene["robot_base"]
    root = spec.worldbody.bodies[0]
    root.pos = [x, y, 0.0]
    root.quat = [math.cos(heading / 2), 0, 0, math.sin(heading / 2)]
    # The robot's links collide only with geoms of the other bit, not with each other.
    for geom in spec.geoms:
        geom.contype, geom.conaffinity = 1, 2
    for joint in spec.joints:
        kp = 5000.0
        actuator = spec.add_actuator(target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        actuator.gaintype, actuator.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
        actuator.gainprm[0], actuator.biasprm[1], actuator.biasprm[2] = kp, -kp, -kp * 0.02
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[20, 20, 1], contype=2, conaffinity=3)
    kinds = {
        "box": (mujoco.mjtGeom.mjGEOM_BOX, lambda s: [s[0] / 2, s[1] / 2, s[2] / 2]),
        "cylinder": (mujoco.mjtGeom.mjGEOM_CYLINDER, lambda s: [s[0], s[1] / 2, 0]),
        "sphere": (mujoco.mjtGeom.mjGEOM_SPHERE, lambda s: [s[0], 0, 0]),
    }
    for thing in scene["objects"]:
        body = spec.worldbody.add_body(name=thing["id"], pos=thing["place"][:3], quat=thing["place"][3:])
        if not thing["fixed"]:
            body.add_freejoint()
        for solid in thing["solids"]:
            kind, size = kinds[solid["shape"]]
            body.add_geom(
                type=kind,
                size=size(solid["size"]),
                pos=solid["place"][:3],
                quat=solid["place"][3:],
                mass=solid["mass"],
                friction=[thing["friction"], 0.005, 0.0001],
                contype=2,
                conaffinity=3,
            )
    model = spec.compile()
    data = mujoco.MjData(model)
    return lambda: mujoco.mj_step(model, data)


def pybullet_steps(scene, sleeping):
    import pybullet
    from math import cos, sin

    client = pybullet.connect(pybullet.DIRECT)
    at = {"physicsClientId": client}
    pybullet.setGravity(0, 0, -9.81, **at)
    iterations = {"numSolverIterations": scene["iterations"]}
    pybullet.setPhysicsEngineParameter(fixedTimeStep=1.0 / scene["steps_per_second"], **iterations, **at)
    floor = pybullet.createCollisionShape(pybullet.GEOM_PLANE, **at)
    pybullet.createMultiBody(0, floor, **at)
    for thing in scene["objects"]:
        links = [collision_shape(pybullet, solid, at) for solid in thing["solids"]]
        arguments = compound(links) if len(links) > 1 else {"shapeType": links[0][0], **links[0][1]}
        create = pybullet.createCollisionShapeArray if len(links) > 1 else pybullet.createCollisionShape
        shape = create(**arguments, **at)
        mass = 0 if thing["fixed"] else sum(solid["mass"] for solid in thing["solids"])
        turned = thing["place"][4:] + thing["place"][3:4]
        body = pybullet.createMultiBody(mass, shape, -1, thing["place"][:3], turned, **at)
        pybullet.changeDynamics(body, -1, lateralFriction=thing["friction"], **at)
        if sleeping:
            pybullet.changeDynamics(body, -1, activationState=pybullet.ACTIVATION_STATE_ENABLE_SLEEPING, **at)
    with tempfile.NamedTemporaryFile("w", suffix=".urdf") as file:
        file.write(scene["robot"])
        file.flush()
        x, y, heading = scene["robot_base"]
        turned = [0, 0, sin(heading / 2), cos(heading / 2)]
        robot = pybullet.loadURDF(file.name, [x, y, 0], turned, useFixedBase=True, **at)
    for joint in range(pybullet.getNumJoints(robot, **at)):
        pybullet.setJointMotorControl2(robot, joint, pybullet.POSITION_CONTROL, targetPosition=0, **at)
    return lambda: pybullet.stepSimulation(**at)


def collision_shape(pybullet, solid, at):
    size = solid["size"]
    turned = solid["place"][4:] + solid["place"][3:4]
    frame = {"collisionFramePosition": solid["place"][:3], "collisionFrameOrientation": turned}
    if solid["shape"] == "box":
        return pybullet.GEOM_BOX, {"halfExtents": [extent / 2 for extent in size], **frame}
    if solid["shape"] == "cylinder":
        return pybullet.GEOM_CYLINDER, {"radius": size[0], "height": size[1], **frame}
    return pybullet.GEOM_SPHERE, {"radius": size[0], **frame}


def compound(links):
    """Combines several shapes into one array for each argument."""
    return {
        "shapeTypes": [kind for kind, _ in links],
        "halfExtents": [form.get("halfExtents", [1, 1, 1]) for _, form in links],
        "radii": [form.get("radius", 1.0) for _, form in links],
        "lengths": [form.get("height", 1.0) for _, form in links],
        "collisionFramePositions": [form["collisionFramePosition"] for _, form in links],
        "collisionFrameOrientations": [form["collisionFrameOrientation"] for _, form in links],
    }


if __name__ == "__main__":
    main()
