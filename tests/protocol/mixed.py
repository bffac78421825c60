"""Performs the first and the last of three actions."""

from wire import serve


def perform(link, begin):
    if begin["action"] == "MoveTo":
        link.ask({"type": "command", "ticks": 3, "base_velocity": [0, 0, 0]})
        return {"type": "end", "succeeded": True, "message": "stayed"}
    arm = link.hello["robot"]["arm_joints"]
    link.ask({"type": "command", "ticks": 3, "velocities": {arm[0]: 0.1}})
    return {"type": "end", "succeeded": False, "message": "waved"}


serve(perform, ["MoveTo", "Pick"])
