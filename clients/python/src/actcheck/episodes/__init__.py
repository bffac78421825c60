"""Writes episode files: `python -m actcheck.episodes convert FILE... --to DIR`, `states SUITE --to DIR`, `audit SUITE --to DIR`.

`command` is the command line, `faults` has the coded faults of files.

`convert` converts other programs' episodes. `sources` recognises a file by its content. One module a kind: `robosuite` (HDF5 with MuJoCo
states), `isaac` (Isaac Lab HDF5), `lerobot` (LeRobotDataset v3), `rosbag` (rosbag2). `hdf5` opens HDF5 files without following links out
of them; `assets` finds meshes in installed packages.

`states` and `audit` record LIBERO's and robosuite's tasks: `audit` records them, `suites` opens them, `faulty` has the faults, `scene` moves
objects, `hand` picks them up.
"""
