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

Or record the episodes of your own simulation, to be judged by actcheck:

```python
with actcheck.record(env, "episodes/"):
    ...  # env.reset() and env.step() as usual
```
"""

from actcheck.connect import Connection, Result, connect
from actcheck.env import ActionEnv, Box
from actcheck.faults import Aborted, Closed, Failed, Fault, JudgeError, ProtocolFault, RecordingFault, Unreachable
from actcheck.judge import Judge, Judgement, Monitor, Verdict
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
    RgbImage,
    RobotDescription,
    Thing,
)
from actcheck.pose import Pose, wrapped
from actcheck.recording import Recorder, record
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
    "Fault",
    "Held",
    "Joint",
    "Judge",
    "JudgeError",
    "Judgement",
    "Monitor",
    "Observation",
    "Plane",
    "Pose",
    "ProtocolFault",
    "Recorder",
    "RecordingFault",
    "Report",
    "Result",
    "RgbImage",
    "Robot",
    "RobotDescription",
    "Thing",
    "Unreachable",
    "Verdict",
    "connect",
    "record",
    "serve",
    "skill",
    "wrapped",
]
