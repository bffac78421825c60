"""Prints to both streams, asks and commands; the number of lines depends on the seed, and the first line on the process."""

import os
import sys

from wire import serve

print(f"process {os.getpid()} starts")


def perform(link, begin):
    target, seed = begin["parameters"]["pickObject"][0], link.run["seed"]
    seen = link.ask({"type": "ask", "what": "objects", "of": target})["objects"][0]
    print(f"sees {seen['id']}")
    arm = link.hello["robot"]["arm_joints"]
    for tick in range(30):
        link.ask({"type": "command", "ticks": 1, "positions": {arm[1]: -0.01 * tick}})
    print("half way", file=sys.stderr)
    link.ask({"type": "command", "ticks": 30, "gripper": {"opening_m": 0.02, "force_n": 5.0}})
    for number in range(seed % 500):
        print(f"line {number} of {seed % 500}")
    print("no end of line", end="")
    return {"type": "end", "succeeded": False, "message": "only talked"}


serve(perform)
