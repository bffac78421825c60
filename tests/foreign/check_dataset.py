"""Reads a dataset as a learner would, and checks its tables against its schema and each other."""

import json
import pathlib
import sys

import polars as pl

folder = pathlib.Path(sys.argv[1])
schema = json.loads((folder / "schema.json").read_text())
tables = {}
KINDS = {"text": pl.String, "number": pl.Float64, "count": pl.Int64, "truth": pl.Boolean}
for table in schema["tables"]:
    frame = pl.read_parquet(folder / table["file"])
    said = {column["name"]: KINDS[column["type"]] for column in table["columns"]}
    assert dict(frame.schema) == said, (table["file"], frame.schema)
    tables[table["file"].removesuffix(".parquet")] = frame

actions, joints, robot, objects = (tables[name] for name in ("actions", "joints", "robot", "objects"))
assert len(actions) > 0 and len(joints) > 0 and len(objects) > 0 and len(tables["percepts"]) > 0
key = ["run", "step", "time_s"]
moments = robot.select(key)
assert moments.n_unique() == len(moments), "one row a moment"
assert joints.select(key).unique().sort(key).equals(moments.sort(key)), "joints have the same moments"
assert objects.select(key).unique().sort(key).equals(moments.sort(key)), "objects too"

# Each action's trajectory starts at 0 and has the action's duration.
lengths = robot.group_by(["run", "step"]).agg(pl.col("time_s").min().alias("first"), pl.col("time_s").max().alias("last"))
both = lengths.join(actions, on=["run", "step"])
assert len(both) == len(lengths) and (both["first"] == 0.0).all()
assert ((both["duration_s"] - both["last"]).is_between(-0.01, 0.11)).all(), both

# The counts of passed properties agree with the outcomes.
passed = tables["outcomes"].filter(pl.col("outcome") == "passed").group_by(["run", "step"]).agg(pl.len().alias("counted"))
both = actions.join(passed, on=["run", "step"], how="left").with_columns(pl.col("counted").fill_null(0))
assert (both["properties_passed"] == both["counted"]).all()

# Joints follow their targets (those of the base in the believed pose), and quaternions have unit length.
still = joints.filter(~pl.col("joint").str.contains("finger"))
assert (still["position"] - still["target"]).abs().quantile(0.5) < 0.02
base = joints.filter(pl.col("joint") == "base_x_joint").join(robot, on=key)
assert (base["position"] - base["base_x_m"]).abs().max() < 2e-4
norm = objects.select((pl.col("qx") ** 2 + pl.col("qy") ** 2 + pl.col("qz") ** 2 + pl.col("qw") ** 2).alias("n"))["n"]
assert (norm - 1.0).abs().max() < 5e-3
