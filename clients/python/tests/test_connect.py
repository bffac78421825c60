"""One run from a notebook, with a stand-in for the program that starts simulations."""

from __future__ import annotations

import stat
import sys
import tempfile
import textwrap
import unittest
from pathlib import Path

from actcheck import Closed, Connection, Robot, connect

#: Starts its launcher as actcheck does, and plays one action with it.
PROGRAM = """
    import os, pathlib, shlex, socket, struct, subprocess, sys, tempfile
    sys.path[:0] = {path!r}
    from tests import fake

    arguments = dict(zip(sys.argv[1::1], sys.argv[2::1]))
    if sys.argv[2] == "missing.toml":
        sys.exit("missing.toml can't be read")
    folder = tempfile.mkdtemp()
    door = socket.socket(socket.AF_UNIX)
    door.bind(folder + "/simulation.sock")
    door.listen(1)
    environment = dict(os.environ, ACTCHECK_ADDRESS="unix:" + folder + "/simulation.sock")
    relay = subprocess.Popen(shlex.split(arguments["--launcher"]), env=environment)
    simulation = fake.Simulation(lambda simulation: None)
    simulation.join()
    simulation._socket = door.accept()[0]
    simulation.greet()
    simulation.reset()
    simulation.begin()
    end = simulation.act()
    simulation.bye()
    print("it", "succeeded" if end["succeeded"] else "failed", end["message"], "seed", arguments.get("--seed"))
    relay.wait()
    sys.exit(0 if end["succeeded"] else 1)
"""


class OneRun(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.program = Path(folder.name) / "actcheck"
        here = Path(__file__).parents[1]
        text = textwrap.dedent(PROGRAM).format(path=[str(here), str(here / "src")])
        self.program.write_text(f"#!{sys.executable}\n{text}")
        self.program.chmod(self.program.stat().st_mode | stat.S_IXUSR)

    def connect(self, config: str = "pick.toml") -> Connection:
        return connect(config, seed=3, actcheck=str(self.program))

    def test_cell_by_cell(self) -> None:
        run = self.connect()
        robot = run.begin()
        self.assertEqual(robot.object("obj:glass_1").id, "obj:glass_1")
        with self.assertRaises(RuntimeError):
            run.begin()
        run.end(True, "held")
        result = run.result()
        self.assertTrue(result.passed)
        self.assertEqual(str(result), "it succeeded held seed 3\n")

    def test_errors_are_raised_where_they_are_written(self) -> None:
        def pick(robot: Robot, pickObject: str) -> None:
            raise KeyError(pickObject)

        with self.connect() as run:
            with self.assertRaises(KeyError):
                run.perform(pick)
            result = run.result()
        self.assertEqual(result.exit_code, 1)
        self.assertIn("it failed the skill raised an exception", result.text)

    def test_a_run_that_does_not_begin_says_why(self) -> None:
        with self.assertRaisesRegex(Closed, "missing.toml can't be read"):
            self.connect("missing.toml")


if __name__ == "__main__":
    unittest.main()
