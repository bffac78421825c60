"""Virtual environments for the scripts in this folder."""

import os
import subprocess
import sys
import venv
from pathlib import Path

TARGET = Path(__file__).resolve().parent.parent / "target"


def folder_of(script):
    """Returns the folder of a script's virtual environment, which may also have its other files."""
    return TARGET / Path(script).stem


def enter(script, packages):
    """Restarts a script in its virtual environment, with packages of PyPI. Returns if it runs there already."""
    folder = folder_of(script)
    if Path(sys.prefix).resolve() == folder.resolve():
        return
    python = folder / "bin" / "python"
    if not (folder / "ready").exists():
        venv.create(folder, with_pip=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", *packages], check=True)
        (folder / "ready").touch()
    os.execv(python, [str(python), str(Path(script).resolve()), *sys.argv[1:]])
