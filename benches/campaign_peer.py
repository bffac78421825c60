#!/usr/bin/env python3
"""Compares the CPU time of a campaign with that of the same campaign in Python: MuJoCo, Hypothesis and pyoxigraph.

Run from the root of the checkout, with a built program: `python3 benches/campaign_peer.py [--program FILE] [--runs 16]
[--rounds 5]`. It creates a virtual environment in `target/campaign_peer`, installs the three packages from PyPI, and
runs both campaigns in turn, each in a process of its own with one worker.

The task is that of `configs/pick.toml`: a glass on a coffee table among one to five other objects, the same robot
(URDF), models, ranges and noise, 240 steps per second of simulated time and 60 commands. The peer draws scenes with
Hypothesis, evenly in their ranges as actcheck does, lets them settle, plans, drives, grasps, lifts and retreats with
a controller of its own in Python, records contacts at each command and poses ten times a second, writes the state
before and after and the contacts as RDF into a pyoxigraph store on disk and the poses into a compressed file, and
checks five properties in SPARQL. Scenes are not the same as those of actcheck, and the peer has neither proofs nor
margins nor shrinking. Objects at rest sleep in both. The peer's joints start and stop at once, at their largest
speed, so that its runs are a third shorter in simulated time.
"""

import argparse
import math
import resource
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

from environment import enter

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
PACKAGES = ["mujoco==4.0.0", "hypothesis", "pyoxigraph", "numpy"]
PROPERTIES = ["CloseObject", "ObjectGrasped", "NoGraspCollisions", "MovedObject", "ObjectInGripper"]

STEPS_PER_SECOND, STEPS_PER_TICK = 240, 4
TICK_SECS = STEPS_PER_TICK / STEPS_PER_SECOND
ARM = ["arm_lift_joint", "arm_flex_joint", "arm_roll_joint", "wrist_flex_joint", "wrist_roll_joint"]
BASE = ["base_x_joint", "base_y_joint", "base_heading_joint"]
FINGERS = ["finger_left_joint", "finger_right_joint"]
HOME = [0.0, 0.0, -1.57, -1.57, 0.0]
# The hand is level, and the lift is free.
LEVEL = [0.3, -1.25, 0.0, -0.32, 0.0]
OPEN, GRIP_N = 0.0675, 7.0
OTHERS = ["mug", "bottle", "can", "bowl", "salt_shaker", "box"]
TABLE_M, HALF_M = 0.705, 0.31


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--program", default=str(ROOT / "actcheck"))
    parser.add_argument("--runs", type=int, default=16)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--peer", metavar="SEED", type=int, help="run only the peer's campaign, with this seed")
    chosen = parser.parse_args()
    enter(__file__, PACKAGES)
    if chosen.peer is not None:
        return peer(chosen.runs, chosen.peer)
    ratios = []
    print(f"{'round':<8}{'actcheck':>12}{'the peer':>12}{'ratio':>8}   CPU seconds a run, {chosen.runs} runs each")
    for idx in range(chosen.rounds):
        with tempfile.TemporaryDirectory() as folder:
            config = str(ROOT / "configs" / "pick.toml")
            same = ["--runs", str(chosen.runs)]
            ours = ["run", config, *same, "--seed", str(idx + 1), "--jobs", "1", "--history", folder]
            own, _ = cpu_secs([chosen.program, *ours], chosen.runs)
        theirs, report = cpu_secs([sys.executable, __file__, *same, "--peer", str(idx + 1)], chosen.runs)
        ratios.append(own / theirs)
        print(f"{idx + 1:<8}{own:>12.3f}{theirs:>12.3f}{own / theirs:>8.2f}   the peer: {report.strip()}", flush=True)
    print(f"median ratio: {sorted(ratios)[len(ratios) // 2]:.2f}")


def cpu_secs(command, runs):
    """Returns the CPU seconds of a command for each run, and its output."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    output = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True).stdout
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return (after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime) / runs, output


def peer(runs, seed):
    """The peer's campaign. Prints its pass rates and the simulated time of a run."""
    import hypothesis
    import hypothesis.strategies as st
    import pyoxigraph

    models = {name: model_of(name) for name in ["coffee_table", "glass", *OTHERS]}
    robot = robot_spec()
    folder = tempfile.TemporaryDirectory()
    store = pyoxigraph.Store(folder.name + "/store")
    results = []

    @hypothesis.seed(seed)
    @hypothesis.settings(
        max_examples=runs, database=None, deadline=None, phases=[hypothesis.Phase.generate],
        suppress_health_check=list(hypothesis.HealthCheck),
    )
    @hypothesis.given(st.randoms(use_true_random=True))
    def campaign(random):
        scene = Scene(models, random)
        results.append(Run(robot, models, scene).perform(store, f"{folder.name}/{len(results)}.npz", len(results)))

    campaign()
    store.flush()
    made = len(results)
    rates = ", ".join(f"{name} {sum(r[0][name] for r in results)}/{made}" for name in PROPERTIES)
    print(f"{rates}; {sum(r[1] for r in results) / made:.1f} s simulated a run")


def model_of(name):
    return tomllib.loads((ROOT / "models" / "objects" / f"{name}.toml").read_text())


def robot_spec():
    """The robot without objects, with a motor for each joint."""
    import mujoco

    urdf = (ROOT / "models" / "robots" / "mobile_manipulator.urdf").read_text()
    compiler = '<mujoco><compiler fusestatic="false" boundmass="0.01" boundinertia="4e-7"/></mujoco></robot>'
    spec = mujoco.MjSpec.from_string(urdf.replace("</robot>", compiler))
    spec.option.timestep = 1.0 / STEPS_PER_SECOND
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 10
    spec.option.enableflags |= mujoco.mjtEnableBit.mjENBL_SLEEP
    for body in spec.bodies[1:]:
        body.gravcomp = 1.0
    for geom in spec.geoms:
        # The robot's links collide with objects, but not with each other.
        geom.contype, geom.conaffinity = 1, 2
    for joint in spec.joints:
        slides = joint.type == mujoco.mjtJoint.mjJNT_SLIDE
        most = GRIP_N if joint.name in FINGERS else max(abs(joint.actfrcrange[0]), abs(joint.actfrcrange[1]))
        gain = most / (1e-3 if slides else 0.02)
        motor = spec.add_actuator(name=joint.name, target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.gaintype, motor.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
        motor.gainprm[0], motor.biasprm[1] = gain, -gain
        motor.biasprm[2] = -gain * (0.1 if joint.name in FINGERS else 0.02)
        motor.forcelimited, motor.forcerange = True, [-most, most]
    floor = {"type": mujoco.mjtGeom.mjGEOM_PLANE, "size": [20, 20, 1], "contype": 2, "conaffinity": 2}
    spec.worldbody.add_geom(**floor)
    return spec


class Scene:
    """One scene: places without overlaps, masses, frictions, and the errors of the robot's sensing."""

    def __init__(self, models, random):
        import numpy

        place = random.uniform(-0.25, 0.0), random.uniform(-0.25, 0.25), random.uniform(-3.1, 3.1)
        self.things = [("glass", place, physics_of(random))]
        others = random.randint(1, 5)
        for _ in range(100):
            name = random.choice(OTHERS)
            x, y, yaw = random.uniform(-0.25, 0.25), random.uniform(-0.25, 0.25), random.uniform(-3.1, 3.1)
            if self.has_room(models, name, x, y):
                self.things.append((name, (x, y, yaw), physics_of(random)))
            if len(self.things) > others:
                break
        self.start = [-1.04 + 0.05 * random.uniform(-1, 1), 0.05 * random.uniform(-1, 1), 0.05 * random.uniform(-1, 1)]
        errors = numpy.random.default_rng(random.randrange(2**31))
        self.target_error = errors.normal(0.0, [0.025, 0.025, 0.01])
        self.others_error = errors.normal(0.0, 0.025, (len(self.things), 2))
        self.base_error = errors.normal(0.0, [0.015, 0.015, 0.02])
        self.finger_error = errors.normal(0.0, 0.001)

    def has_room(self, models, name, x, y):
        radius = lambda kind: math.hypot(*models[kind]["size_m"][:2]) / 2 * (1 if kind == "box" else 0.75)
        return all(
            math.hypot(x - at[0], y - at[1]) > radius(name) + radius(kind) + 0.02 for kind, at, _ in self.things
        )


def physics_of(random):
    """Factors of mass and friction."""
    return random.uniform(0.7, 1.3), random.uniform(0.5, 1.2)


class Run:
    def __init__(self, robot, models, scene):
        import mujoco
        import numpy

        self.mujoco, self.numpy, self.scene, self.models = mujoco, numpy, scene, models
        spec = robot.copy()
        self.add(spec, "table", models["coffee_table"], [0.0, 0.0, 0.0], (1.0, 1.0), fixed=True)
        for idx, (name, (x, y, yaw), physics) in enumerate(scene.things):
            self.add(spec, f"thing_{idx}", models[name], [x, y, yaw], physics)
        friction = math.sqrt(0.8 * models["glass"]["friction"] * scene.things[0][2][1])
        for name in ["finger_left_link", "finger_right_link"]:
            for geom in spec.body(name).geoms:
                geom.friction, geom.priority, geom.condim = [friction, 0.005, 0.0001], 1, 4
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        names = [*BASE, *ARM, *FINGERS]
        self.motors = {name: self.model.actuator(name).id for name in names}
        self.joints = {name: int(self.model.joint(name).qposadr[0]) for name in names}
        self.fastest = {"base_x_joint": 0.25, "base_y_joint": 0.25, "base_heading_joint": 1.0, "arm_lift_joint": 0.2,
                        "arm_flex_joint": 1.2, "arm_roll_joint": 2.0, "wrist_flex_joint": 1.5, "wrist_roll_joint": 1.5}
        self.bodies = [self.model.body(f"thing_{idx}").id for idx in range(len(scene.things))]
        self.hand = self.model.body("grasp_link").id
        self.fingers = [self.model.body(name).id for name in ("finger_left_link", "finger_right_link")]
        # 0: static, 1: robot, 2: object.
        self.kind = numpy.ones(self.model.nbody, dtype=int)
        self.kind[[0, self.model.body("table").id]], self.kind[self.bodies] = 0, 2
        self.contacts, self.frames, self.ticks = {}, [], 0
        for name, value in [*zip(BASE, scene.start), *zip(ARM, HOME), *((name, OPEN / 2) for name in FINGERS)]:
            self.data.qpos[self.joints[name]] = self.data.ctrl[self.motors[name]] = value

    def add(self, spec, name, model, at, physics, fixed=False):
        mujoco = self.mujoco
        x, y, yaw = at
        height = 0.0 if fixed else TABLE_M + 0.001
        turned = [math.cos(yaw / 2), 0, 0, math.sin(yaw / 2)]
        body = spec.worldbody.add_body(name=name, pos=[x, y, height], quat=turned)
        if not fixed:
            body.add_freejoint()
        parts = [shape for part in model["parts"] for shape in solids(mujoco, part)]
        volume = sum(amount for *_, amount in parts)
        for kind, size, pos, quat, amount in parts:
            body.add_geom(type=kind, size=size, pos=pos, quat=quat, mass=model["mass_kg"] * physics[0] * amount / volume,
                          friction=[model["friction"] * physics[1], 0.005, 0.0001], contype=2, conaffinity=3)

    def tick(self):
        """One control tick: steps physics and records contacts and poses."""
        self.mujoco.mj_step(self.model, self.data, STEPS_PER_TICK)
        self.ticks += 1
        contact = self.data.contact
        if len(contact.geom):
            bodies = self.model.geom_bodyid[contact.geom]
            kinds = self.kind[bodies]
            for idx in self.numpy.flatnonzero((kinds[:, 0] != kinds[:, 1]) & (kinds == 1).any(axis=1)):
                self.touch(int(idx), tuple(map(int, bodies[idx])))
        if self.ticks % 6 == 0:
            self.frames.append(self.numpy.hstack([self.data.xpos, self.data.xquat]).astype("f4"))

    def touch(self, idx, pair):
        force = self.numpy.zeros(6)
        self.mujoco.mj_contactForce(self.model, self.data, idx, force)
        first, last, most = self.contacts.get(pair, (self.ticks, self.ticks, 0.0))
        self.contacts[pair] = (first, self.ticks, max(most, float(force[0])))

    def wait(self, secs):
        for _ in range(round(secs / TICK_SECS)):
            self.tick()

    def go(self, goals, secs=0.0):
        """Moves joints evenly to their goals, within their largest speeds, and lets them arrive."""
        ctrl = self.data.ctrl
        ways = [(self.motors[name], goal - ctrl[self.motors[name]], self.fastest[name]) for name, goal in goals.items()]
        secs = max([secs, *(abs(way) / fastest for _, way, fastest in ways)])
        n_ticks = max(1, math.ceil(secs / TICK_SECS))
        began = ctrl.copy()
        for tick in range(1, n_ticks + 1):
            for motor, way, _ in ways:
                ctrl[motor] = began[motor] + way * tick / n_ticks
            self.tick()
        self.wait(0.1)

    def plan(self):
        """Chooses the heading of the approach with the most room. Returns the joints in front of the object and at it."""
        mujoco, scene = self.mujoco, self.scene
        x, y, heading = scene.start
        seen = [self.seen(idx) for idx in range(len(scene.things))]
        height = TABLE_M + 0.075 + scene.target_error[2]
        probe = mujoco.MjData(self.model)
        probe.qpos[:] = self.data.qpos
        for name, value in [*zip(BASE, [0.0] * 3), *zip(ARM, LEVEL)]:
            probe.qpos[self.joints[name]] = value
        mujoco.mj_kinematics(self.model, probe)
        gx, gy, gz = probe.xpos[self.hand]
        best = None
        direct = math.atan2(seen[0][1] - y, seen[0][0] - x)
        for turn in [0.0, 0.25, -0.25, 0.5, -0.5, 0.75, -0.75, 1.0, -1.0]:
            angle = direct + turn
            cos, sin = math.cos(angle), math.sin(angle)
            base = [seen[0][0] - cos * gx + sin * gy, seen[0][1] - sin * gx - cos * gy, angle]
            # Room beside the hand on its way, and of the base from the table.
            room = min((self.beside(seen[0], cos, sin, other) for other in seen[1:]), default=1.0)
            edge = max(abs(base[0]), abs(base[1])) - HALF_M - 0.22
            score = min(room, 0.05) - 0.01 * abs(turn) if edge > 0 else -1.0
            if best is None or score > best[0]:
                best = (score, base, cos, sin)
        _, base, cos, sin = best
        arm = dict(zip(ARM, [LEVEL[0] + height - gz, *LEVEL[1:]]))
        before = dict(zip(BASE, [base[0] - 0.2 * cos, base[1] - 0.2 * sin, base[2]]))
        away = dict(zip(BASE, [base[0] - 0.35 * cos, base[1] - 0.35 * sin, base[2]]))
        return arm, before, dict(zip(BASE, base)), away

    def seen(self, idx):
        """Where the robot believes an object to be, with its errors of perception and of localisation."""
        x, y, _ = self.data.xpos[self.bodies[idx]]
        error = self.scene.target_error[:2] if idx == 0 else self.scene.others_error[idx]
        bx, by, turn = self.scene.base_error
        dx, dy = x + error[0] - self.scene.start[0], y + error[1] - self.scene.start[1]
        cos, sin = math.cos(turn), math.sin(turn)
        return [self.scene.start[0] + bx + cos * dx - sin * dy, self.scene.start[1] + by + sin * dx + cos * dy]

    @staticmethod
    def beside(target, cos, sin, other):
        """Room between an object and the hand on its way to the target."""
        dx, dy = other[0] - target[0], other[1] - target[1]
        along, across = dx * cos + dy * sin, abs(-dx * sin + dy * cos)
        if along > 0.1:
            return 1.0
        return across - 0.17

    def perform(self, store, file, number):
        self.wait(0.5)
        before = self.snapshot()
        self.contacts.clear()
        began = self.ticks
        self.wait(0.5)
        arm, near, at, away = self.plan()
        self.go(arm)
        for name in FINGERS:
            self.data.ctrl[self.motors[name]] = OPEN
        self.go({BASE[2]: near[BASE[2]]})
        self.go(near)
        self.go(at, 2.5 + 0.2 / 0.25)
        held = self.close()
        self.go({ARM[0]: min(0.69, arm[ARM[0]] + 0.12)}, 2.0)
        self.go(away)
        self.wait(0.5)
        gap = sum(self.data.qpos[self.joints[name]] for name in FINGERS) + self.scene.finger_error
        reported = bool(held and gap > 0.006)
        after = self.snapshot()
        self.numpy.savez_compressed(file, frames=self.numpy.array(self.frames))
        self.write(store, number, before, after, reported)
        return self.judge(store, number), (self.ticks - began) * TICK_SECS

    def close(self):
        for name in FINGERS:
            self.data.ctrl[self.motors[name]] = 0.0
        still = 0
        dofs = [int(self.model.joint(name).dofadr[0]) for name in FINGERS]
        for _ in range(round(2.5 / TICK_SECS)):
            # Fingers have a largest speed: their setpoints run ahead of them by little.
            for name in FINGERS:
                now = self.data.qpos[self.joints[name]]
                self.data.ctrl[self.motors[name]] = max(0.0, now - 0.01)
            self.tick()
            still = still + 1 if max(abs(self.data.qvel[dof]) for dof in dofs) < 0.003 else 0
            if still >= 10:
                break
        for name in FINGERS:
            self.data.ctrl[self.motors[name]] = 0.0
        return sum(self.data.qpos[self.joints[name]] for name in FINGERS) > 0.006

    def snapshot(self):
        """The state of all bodies and joints."""
        data = self.data
        touching = set()
        for geoms in data.contact.geom:
            touching.add(tuple(sorted(int(self.model.geom_bodyid[geom]) for geom in geoms)))
        grasp = data.xpos[self.hand].copy()
        return {
            "poses": {
                body: (data.xpos[body].copy(), data.xquat[body].copy(), data.cvel[body].copy()) for body in self.bodies
            },
            "joints": {name: float(data.qpos[at]) for name, at in self.joints.items()},
            "touching": touching, "grasp": grasp,
        }

    def write(self, store, number, before, after, reported):
        from pyoxigraph import Literal, NamedNode, Quad

        act, world = "http://actions#", "https://w3id.org/actcheck/world#"
        term = lambda name: NamedNode(world + name)
        thing = lambda body: NamedNode(f"https://w3id.org/actcheck/object/{self.model.body(body).name}")
        quads = []
        for phase, state in (("before", before), ("after", after)):
            graph = NamedNode(f"{act}run/{number}/{phase}")
            add = lambda s, p, o: quads.append(Quad(s, term(p), o, graph))
            for idx, (body, (position, turned, velocity)) in enumerate(state["poses"].items()):
                name, _, physics = self.scene.things[idx]
                model = self.models[name]
                add(thing(body), "category", NamedNode(act + model["category"].split(":")[1]))
                for axis, value in zip("xyz", position):
                    add(thing(body), axis, Literal(float(value)))
                for axis, value in zip("wxyz", turned):
                    add(thing(body), "q" + axis, Literal(float(value)))
                for axis, value in zip(("wx", "wy", "wz", "vx", "vy", "vz"), velocity):
                    add(thing(body), axis, Literal(float(value)))
                add(thing(body), "mass", Literal(model["mass_kg"] * physics[0]))
                add(thing(body), "friction", Literal(model["friction"] * physics[1]))
            for axis, value in zip("xyz", state["grasp"]):
                add(term("gripper"), axis, Literal(float(value)))
            for name, value in state["joints"].items():
                joint = NamedNode(f"{world}joint/{name}")
                add(term("robot"), "joint", joint)
                add(joint, "position", Literal(value))
            for one, other in state["touching"]:
                add(thing(one), "touches", thing(other))
                add(thing(other), "touches", thing(one))
        during = NamedNode(f"{act}run/{number}/during")
        for (one, other), (first, last, most) in self.contacts.items():
            contact = NamedNode(f"{act}run/{number}/contact/{one}-{other}")
            times = [("start", Literal(first * TICK_SECS)), ("end", Literal(last * TICK_SECS))]
            pair = [("between", thing(one)), ("between", thing(other)), ("maxForce", Literal(most))]
            for predicate, value in pair + times:
                quads.append(Quad(contact, term(predicate), value, during))
        quads.append(Quad(NamedNode(f"{act}run/{number}"), NamedNode(act + "reported"), Literal(reported), during))
        store.extend(quads)

    def judge(self, store, number):
        prefixes = (
            "PREFIX w: <https://w3id.org/actcheck/world#> PREFIX o: <https://w3id.org/actcheck/object/> "
            f"PREFIX r: <http://actions#run/{number}/> "
        )
        at = lambda graph, thing, n: f"GRAPH r:{graph} {{ {thing} w:x ?x{n} ; w:y ?y{n} ; w:z ?z{n} }}"
        apart = "((?x1-?x2)*(?x1-?x2) + (?y1-?y2)*(?y1-?y2) + (?z1-?z2)*(?z1-?z2))"
        queries = {
            # The grasp point is within 5 cm of the glass: of the middle, and 4.4 cm more.
            "CloseObject": f"ASK {{ {at('after', 'o:thing_0', 1)} {at('after', 'w:gripper', 2)} "
                           "FILTER((?x1-?x2)*(?x1-?x2) + (?y1-?y2)*(?y1-?y2) < 0.0088 && ABS(?z1 + 0.073 - ?z2) < 0.123) }",
            "ObjectGrasped": f"ASK {{ GRAPH r:during {{ <http://actions#run/{number}> <http://actions#reported> true }} }}",
            "MovedObject": f"ASK {{ {at('before', 'o:thing_0', 1)} {at('after', 'o:thing_0', 2)} FILTER({apart} > 0.0004) }}",
            "ObjectInGripper": "ASK { GRAPH r:after { o:thing_0 w:touches o:finger_left_link, o:finger_right_link "
                               "FILTER NOT EXISTS { o:thing_0 w:touches o:table } } }",
        }
        collides = (
            f"ASK {{ {{ {at('before', '?thing', 1)} {at('after', '?thing', 2)} "
            f"FILTER(STRSTARTS(STR(?thing), STR(o:thing_)) && ?thing != o:thing_0 && {apart} > 0.0001) }} UNION "
            "{ GRAPH r:during { ?c w:between o:table ; w:maxForce ?force FILTER(?force > 70.0) } } }"
        )
        found = {name: bool(store.query(prefixes + query)) for name, query in queries.items()}
        found["NoGraspCollisions"] = not bool(store.query(prefixes + collides))
        return found


def solids(mujoco, part):
    """The convex shapes of a part: kind, size, position, quaternion and volume."""
    x, y, z = part["at_m"]
    upright = [1, 0, 0, 0]
    if part["shape"] == "box":
        a, b, c = part["size_m"]
        return [(mujoco.mjtGeom.mjGEOM_BOX, [a / 2, b / 2, c / 2], [x, y, z], upright, a * b * c)]
    height = part["height_m"]
    if part["shape"] == "cylinder":
        radius = part["radius_m"]
        return [(mujoco.mjtGeom.mjGEOM_CYLINDER, [radius, height / 2, 0], [x, y, z], upright, math.pi * radius**2 * height)]
    # The staves of a tube are as wide as its outer edges, and lean outwards with its wall.
    low, high, wall, n = part["radius_low_m"], part["radius_high_m"], part["wall_m"], part["staves"]
    lean, middle, found = math.atan2(high - low, height), (low + high) / 2 - wall / 2, []
    width = 2 * (low + high) / 2 * math.tan(math.pi / n)
    for stave in range(n):
        angle = 2 * math.pi * stave / n
        turned = [math.cos(angle / 2), 0, 0, math.sin(angle / 2)]
        leaned = [math.cos(lean / 2), 0, math.sin(lean / 2), 0]
        pos = [x + middle * math.cos(angle), y + middle * math.sin(angle), z]
        size = [wall / 2, width / 2, height / 2 / math.cos(lean)]
        found.append((mujoco.mjtGeom.mjGEOM_BOX, size, pos, product(turned, leaned), wall * width * height))
    return found


def product(a, b):
    """The product of two quaternions."""
    return [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]


if __name__ == "__main__":
    main()
