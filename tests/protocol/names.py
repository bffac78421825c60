"""Reports the objects of the scene with categories and a message that no parser and no terminal likes."""

import json
import os

from wire import serve


def perform(link, begin):
    with open("categories.json", encoding="utf-8") as file:
        categories = json.load(file)
    pose = {"position_m": [1.0, 0.0, 0.5], "quaternion_xyzw": [0.0, 0.0, 0.0, 1.0]}
    perceived = [{"pose": pose, "size_m": [0.1, 0.1, 0.1], "category": category} for category in categories]
    return {"type": "end", "succeeded": False, "message": os.environ["MESSAGE"], "perceived": perceived}


serve(perform, name="a \x1b[2J name")
