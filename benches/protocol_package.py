"""The idle controller of `benches/protocol.rs` with the package `clients/python`, which needs numpy."""

import os
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "clients/python/src"))
import actcheck


@actcheck.skill("Pick")
def pick(robot, pickObject):
    ticks, total = int(os.environ["TICKS"]), int(os.environ["TOTAL"])
    began = time.process_time()
    for _ in range(total // ticks):
        robot.step(ticks=ticks)
    robot.end(True, str(time.process_time() - began))


actcheck.serve()
