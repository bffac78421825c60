"""One run from a notebook, with a replacement for actcheck."""

from __future__ import annotations

import stat
import sys
import tempfile
import textwrap
import unittest
from pathlib import Path

from actcheck import Closed, Connection, Robot, connect
from actcheck.connect import with_launcher

#: Starts its launcher as actcheck does and performs one action with it.
PROGRAM = """
    import os, shlex, socket, subprocess, sys, tempfile, tomllib
    sys.path[:0] = {path!r}
    from tests import fake

    arguments = dict(zip(sys.argv[1::1], sys.argv[2::1]))
    config = tomllib.load(open(sys.argv[2], "rb"))
    if "ontology" in config:
        sys.exit("the ontology can't be read")
    assert config["skill"] == {{"timeout_s": 3600.0}}, config
    folder = tempfile.mkdtemp()
    door = socket.socket(socket.AF_UNIX)
    door.bind(folder + "/simulation.sock")
    door.listen(1)
    environment = dict(os.environ, ACTCHECK_ADDRESS="unix:" + folder + "/simulation.sock")
    relay = subprocess.Popen(shlex.split(config["test_launcher"]), env=environment)
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

    def connect(self, text: str = 'test_launcher = "reference"\n[skill]\n') -> Connection:
        config = self.program.with_name("pick.toml")
        config.write_text(text)
        return connect(config, seed=3, actcheck=str(self.program))

    def test_cell_by_cell(self) -> None:
        run = self.connect()
        robot = run.begin()
        self.assertEqual(robot.look_for("obj:glass_1")[0].id, "obj:glass_1")
        with self.assertRaises(RuntimeError):
            run.begin()
        run.end(True, "held")
        result = run.result()
        self.assertTrue(result.passed)
        self.assertEqual(str(result), "it succeeded held seed 3\n")
        self.assertEqual(sorted(file.name for file in self.program.parent.iterdir()), ["actcheck", "pick.toml"])

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
        with self.assertRaisesRegex(Closed, "the ontology can't be read"):
            self.connect('ontology = "nowhere.ttl"')

    def test_a_configuration_gets_another_launcher(self) -> None:
        skill = "[skill]\ntimeout_s = 3600.0"
        self.assertEqual(with_launcher("seed = 1", "run me"), f'test_launcher = "run me"\nseed = 1\n{skill}\n')
        given = 'test_launcher = "a" # mine\n[skill] # its own\ntimeout_s = 2\nargs = ["b"]\n[robot]'
        self.assertEqual(with_launcher(given, "c"), f'test_launcher = "c"\n{skill}\nargs = ["b"]\n[robot]')


if __name__ == "__main__":
    unittest.main()
