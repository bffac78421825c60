"""Judges robosuite's Lift by actcheck's rules, beside its own success check.

    pip install actcheck "robosuite==1.5.2" "mujoco==3.3.1"
    python judge_robosuite.py

Three episodes end with a raised cube. In one the gripper holds it, in one it was teleported into the air, and in one the closed
hand balances it: robosuite counts all three as successes.
"""

from __future__ import annotations

from typing import Any

import actcheck
import mujoco
import numpy as np
import robosuite

#: Prefixes of the names of robosuite's bodies, with our names.
CUBE, TABLE = "cube_main", "table"
FINGERS = {"left": ("leftfinger", "finger_joint1_tip"), "right": ("rightfinger", "finger_joint2_tip")}


class Lift:
    """robosuite's Lift, with its states as `Judge` reads them."""

    def __init__(self, seed: int) -> None:
        np.random.seed(seed)
        self.env = robosuite.make("Lift", robots="Panda", has_renderer=False, has_offscreen_renderer=False, use_camera_obs=False, horizon=1000)
        self.env.reset()
        self.model, self.data = self.env.sim.model._model, self.env.sim.data._data
        self.step([0.0, 0.0, 0.0], closed=False, steps=10)

    def step(self, towards: Any, closed: bool, steps: int = 1) -> None:
        """Moves the hand in a direction, with closed or open fingers."""
        for _ in range(steps):
            self.env.step(np.array([*towards, 0.0, 0.0, 0.0, 1.0 if closed else -1.0]))

    def move(self, target: Any, closed: bool, steps: int = 60) -> None:
        """Moves the hand to a position."""
        for _ in range(steps):
            self.step(np.clip(10.0 * (np.asarray(target) - self.hand()), -1.0, 1.0), closed)

    def hand(self) -> Any:
        """The point between the fingertips."""
        return self.data.site_xpos[self.env.robots[0].eef_site_id["right"]]

    def cube(self) -> Any:
        """The position of the cube."""
        return self.data.body(CUBE).xpos

    def owner(self, geom: int) -> str:
        """The name of the body that a geom belongs to, in contacts."""
        name = self.model.body(self.model.geom_bodyid[geom]).name
        owners = {CUBE: "cube", TABLE: "table", "world": "floor"}
        return owners.get(name, f"robot/{name}")

    def contacts(self) -> list[dict[str, Any]]:
        """All contacts with their forces."""
        found = []
        for idx, contact in enumerate(self.data.contact[: self.data.ncon]):
            force = np.zeros(6)
            mujoco.mj_contactForce(self.model, self.data, idx, force)
            first, second = self.owner(contact.geom1), self.owner(contact.geom2)
            if first != second:
                # MuJoCo's force acts on the second body, in the frame of the contact.
                on_second = contact.frame.reshape(3, 3).T @ force[:3]
                found.append({"bodies": (first, second), "force": force[0], "force_on_second": on_second, "point": contact.pos.copy()})
        return found

    def body(self, name: str, **more: Any) -> dict[str, Any]:
        """The state of a body whose shapes are boxes."""
        body = self.model.body(name)
        velocity = np.zeros(6)
        mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_BODY, body.id, velocity, 0)
        geoms = range(body.geomadr[0], body.geomadr[0] + body.geomnum[0])
        boxes = [geom for geom in geoms if self.model.geom_contype[geom] and self.model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_BOX]
        return {
            "position": self.data.xpos[body.id].copy(),
            "rotation": np.roll(self.data.xquat[body.id], -1),
            "shapes": [{"kind": "box", "size": 2 * self.model.geom_size[box], "position": self.model.geom_pos[box]} for box in boxes],
            "mass": self.model.body_subtreemass[body.id],
            "linear_velocity": velocity[3:],
            "angular_velocity": velocity[:3],
            **more,
        }

    def state(self) -> dict[str, Any]:
        """The state as `Judge` reads it. MuJoCo's arrays change with every step: they are copied."""
        site = self.env.robots[0].eef_site_id["right"]
        rotation = np.zeros(4)
        mujoco.mju_mat2Quat(rotation, self.data.site_xmat[site])
        links = [self.model.body(idx).name for idx in range(self.model.nbody)]
        fingers = {side: [f"robot/{link}" for link in links if link.endswith(ends)] for side, ends in FINGERS.items()}
        return {
            "bodies": {"cube": self.body(CUBE), "table": self.body(TABLE, fixed=True)},
            "robot": {"gripper": {"position": self.data.site_xpos[site].copy(), "rotation": np.roll(rotation, -1)}, "fingers": fingers},
            "contacts": self.contacts(),
        }


def grasped(lift: Lift) -> None:
    """Grasps the cube and lifts it."""
    lift.move(lift.cube() + [0.0, 0.0, 0.1], closed=False)
    lift.move(lift.cube(), closed=False)
    lift.step([0.0, 0.0, 0.0], closed=True, steps=15)
    lift.move(lift.cube() + [0.0, 0.0, 0.15], closed=True)


def teleported(lift: Lift) -> None:
    """Puts the cube into the air while the robot does nothing."""
    lift.data.joint("cube_joint0").qpos[2] += 0.2
    mujoco.mj_forward(lift.model, lift.data)


def balanced(lift: Lift) -> None:
    """Closes the hand, and puts the cube on top of it."""
    lift.step([0.0, 0.0, 0.0], closed=True, steps=15)
    hand = lift.data.body("gripper0_right_right_gripper").xpos
    lift.data.joint("cube_joint0").qpos[:3] = hand + [0.0, 0.0, 0.12]
    lift.data.joint("cube_joint0").qvel[:] = 0.0
    mujoco.mj_forward(lift.model, lift.data)


def main() -> None:
    """Prints both verdicts on each episode."""
    judge = actcheck.Judge()
    for episode in (grasped, teleported, balanced):
        lift = Lift(seed=1)
        before = lift.state()
        episode(lift)
        verdict = judge("Pick", before, lift.state(), parameters={"pickObject": "cube"})
        print(f"{episode.__name__}: robosuite {bool(lift.env._check_success())}, actcheck {verdict.passed}")
        for name, judgement in verdict.items():
            print(f"    {name}: {judgement.outcome}: {judgement.witness}")


if __name__ == "__main__":
    main()
