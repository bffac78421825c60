"""Test your own robot skill with actcheck: a skill is a function, served by a program that actcheck starts.

```python
import actcheck

@actcheck.skill("Pick")
def pick(robot, pickObject):
    thing, others = robot.look_for(pickObject)
    ...

if __name__ == "__main__":
    actcheck.serve()
```
"""

from actcheck.connect import Connection, Result, connect
from actcheck.env import ActionEnv, Box
from actcheck.faults import Aborted, Closed, Failed, ProtocolFault, Unreachable
from actcheck.messages import (
    PROTOCOL,
    Call,
    Camera,
    DepthImage,
    Held,
    Joint,
    Observation,
    Plane,
    Report,
    RobotDescription,
    Thing,
)
from actcheck.pose import Pose, wrapped
from actcheck.robot import Robot
from actcheck.skill import serve, skill

__version__ = "0.1.0"

__all__ = [
    "PROTOCOL",
    "Aborted",
    "ActionEnv",
    "Box",
    "Call",
    "Camera",
    "Closed",
    "Connection",
    "DepthImage",
    "Failed",
    "Held",
    "Joint",
    "Observation",
    "Plane",
    "Pose",
    "ProtocolFault",
    "Report",
    "Result",
    "Robot",
    "RobotDescription",
    "Thing",
    "Unreachable",
    "connect",
    "serve",
    "skill",
    "wrapped",
]
