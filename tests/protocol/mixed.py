"""Reports the ground truth as its percepts, for later actions; needs `privileged`."""

from wire import serve


def perform(link, begin):
    things = {thing["id"]: thing for thing in begin["observation"]["truth"]["objects"]}
    table = things.pop(begin["parameters"]["objectSurface"][0])
    width, depth, height = table["size_m"]
    x, y, z = table["pose"]["position_m"]
    top = {"position_m": [x, y, z + height], "quaternion_xyzw": table["pose"]["quaternion_xyzw"]}
    link.ask({"type": "command", "ticks": 3})
    return {
        "type": "end",
        "succeeded": True,
        "message": f"perceived {len(things)}",
        "perceived": [{key: thing[key] for key in ("pose", "size_m", "category")} for thing in things.values()],
        "plane": {"pose": top, "size_m": [width, depth]},
    }


serve(perform, ["PerceivePlane"])
