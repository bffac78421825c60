"""The bridge between actcheck and ROS 2: `python3 -m actcheck.ros2 MAPPING.toml` is a `test_launcher`."""
