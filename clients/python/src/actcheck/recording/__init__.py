"""Recording of episodes: a simulation's bodies, contacts, joints and outcomes, one MCAP file an episode.

`states` has the recorded quantities, `protobuf` their encoding, `file` the MCAP file, `model` the description of the bodies;
`mujoco_model` and `mujoco_states` read them from MuJoCo, `environment` finds MuJoCo in an environment, and users call
`recorder`. Importing the package imports neither mujoco nor mcap.
"""

from actcheck.recording.recorder import Recorder, record

__all__ = ["Recorder", "record"]
