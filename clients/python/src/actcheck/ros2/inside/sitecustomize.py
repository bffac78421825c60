"""Is on PYTHONPATH of the nodes under test: loads the keeper when a node imports rclpy, and an existing `sitecustomize`."""

import importlib.abc
import importlib.machinery
import importlib.util
import os
import sys
import time

_HERE = os.path.dirname(os.path.abspath(__file__))


def _chain():
    """Runs the `sitecustomize` that this one hides, if there is one."""
    elsewhere = [entry for entry in sys.path if os.path.abspath(entry or ".") != _HERE]
    spec = importlib.machinery.PathFinder.find_spec("sitecustomize", elsewhere)
    if spec is not None and spec.loader is not None:
        spec.loader.exec_module(importlib.util.module_from_spec(spec))


class _AfterRclpy(importlib.abc.MetaPathFinder):
    """Installs the keeper as soon as `rclpy.executors` was loaded, before the node's own code runs."""

    def find_spec(self, name, path, target=None):
        if name != "rclpy.executors":
            return None
        sys.meta_path.remove(self)
        spec = importlib.util.find_spec(name)
        if spec is None or spec.loader is None:
            return None
        execute = spec.loader.exec_module

        def executed(module):
            execute(module)
            import actcheck_patches

            actcheck_patches.install(module, os.environ["ACTCHECK_ROS_KEEPER"])

        spec.loader.exec_module = executed
        return spec


def _sleep(seconds):
    """Is `time.sleep` from the start, since a node may import it by name before rclpy."""
    _sleep.kept(seconds)


if os.environ.get("ACTCHECK_ROS_KEEPER"):
    _sleep.kept = _sleep.native = time.sleep
    time.sleep = _sleep
    sys.meta_path.insert(0, _AfterRclpy())
_chain()
