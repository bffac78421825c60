"""Uses every kind of command and query with small motions, and reports that it felt no contact."""

import random

from wire import serve


def perform(link, begin):
    robot = link.hello["robot"]
    chance = random.Random(link.run["seed"])
    assert len(begin["observation"]["joints"]["positions"]) == len(robot["joints"])
    target = begin["parameters"]["pickObject"][0]
    assert target in begin["kinds"], begin
    depth = link.ask({"type": "ask", "what": "depth"})
    camera = robot["camera"]
    assert (depth["width"], depth["height"]) == (camera["width"], camera["height"])
    rgb = link.ask({"type": "ask", "what": "rgb"})
    assert rgb["binary"][0]["shape"] == [camera["height"], camera["width"], 3]
    cloud = link.ask({"type": "ask", "what": "cloud"})
    assert cloud["binary"][0]["shape"][1] == 3
    seen = link.ask({"type": "ask", "what": "objects", "of": target})
    assert [thing["id"] for thing in seen["objects"]] == [target]
    assert len(link.ask({"type": "ask", "what": "objects"})["objects"]) >= 2
    arm = robot["arm_joints"]
    start = dict(zip([joint["name"] for joint in robot["joints"]], begin["observation"]["joints"]["positions"]))
    commands = [
        {"ticks": 5, "positions": {arm[1]: start[arm[1]] + 0.1 * chance.random()}},
        {"ticks": 5, "velocities": {arm[2]: 0.2}, "base_velocity": [0.0, 0.05, 0.1]},
        {"ticks": 5, "efforts": {arm[2]: 0.1}, "gripper": {"opening_m": 0.02, "force_n": 5.0}},
        {"ticks": 5, "positions": {arm[2]: start[arm[2]]}, "head": {"pan_rad": 0.1, "tilt_rad": 0.2}},
    ]
    for command in commands:
        observation = link.ask({"type": "command", **command})
        if observation["type"] == "abort":
            return None
        assert observation["type"] == "observation"
    assert observation["time_s"] > 0.3
    return {"type": "end", "succeeded": False, "message": "only waved"}


serve(perform)
