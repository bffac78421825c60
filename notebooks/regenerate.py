"""Runs campaigns, exports their results, and executes every notebook on them from top to bottom.

    python notebooks/regenerate.py                             regenerates the notebooks in place
    python notebooks/regenerate.py --runs 8 --into /tmp/try    a quick test, which writes to another folder

Requires the packages of tests/foreign/requirements.txt, and actcheck; `make notebooks` provides both. The exported data
stay in the folder `data` next to the written notebooks.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import nbformat
from jupyter_client.manager import AsyncKernelManager
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
# The same scenes twice: the second robot has better sensors.
CAMPAIGNS = {"first": "configs/pick.toml", "second": "benches/quiet_pick.toml"}
# Whole tasks take longer: a quarter of the runs.
TASKS = "configs/pick_and_place.toml"


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--actcheck", default=str(ROOT / "actcheck"), help="path of the program [default: ./actcheck of the checkout]")
    arguments.add_argument("--runs", default="200", help="runs of each campaign [default: 200]")
    arguments.add_argument("--jobs", default="2", help="number of parallel runs [default: 2]")
    arguments.add_argument("--into", type=Path, default=HERE, help="output folder [default: the notebooks folder]")
    asked = arguments.parse_args()
    asked.into.mkdir(parents=True, exist_ok=True)
    data = asked.into.resolve() / "data"
    shutil.rmtree(data, ignore_errors=True)
    export(asked, data)
    faults = [fault for book in sorted(HERE.glob("*.ipynb")) if (fault := execute(book, asked.into / book.name, data))]
    if faults:
        sys.exit("\n".join(faults))


def actcheck(asked, *words, good=(0,)):
    done = subprocess.run([asked.actcheck, *map(str, words)], cwd=ROOT, capture_output=True, text=True)
    if done.returncode not in good:
        sys.exit(f"actcheck {' '.join(map(str, words))}\n{done.stderr}")
    return done.stdout


def export(asked, data):
    """Exports tables, findings and RDF of the campaigns, and the comparison of those with the same scenes."""
    for name, config in {**CAMPAIGNS, "tasks": TASKS}.items():
        folder = data / name
        history = ["--history", folder / "history"]
        runs = max(int(asked.runs) // 4, 1) if config == TASKS else asked.runs
        # Exit code 1 means that a property failed, which is a valid result.
        actcheck(asked, "run", config, "--runs", runs, "--jobs", asked.jobs, *history, good=(0, 1))
        actcheck(asked, "export", "--parquet", folder, "--complete", *history)
        actcheck(asked, "export", "--nquads", folder / "history.nq", *history)
        (folder / "findings.json").write_text(actcheck(asked, "analyse", "--format", "json", *history))
    pair = [data / name / "history" for name in CAMPAIGNS]
    (data / "comparison.json").write_text(actcheck(asked, "compare", *pair, "--format", "json"))


def execute(source, target, data):
    """Executes a notebook in order and writes it with its outputs. Returns the error, or `None`."""
    book = nbformat.read(source, as_version=4)
    os.environ["ACTCHECK_DATA"] = str(data)
    os.environ["ACTCHECK_QUERIES"] = str(ROOT / "ontology" / "queries")
    fault = None
    try:
        # Use sockets in a private folder instead of ports, so that other users of the machine can't connect.
        with tempfile.TemporaryDirectory() as sockets:
            kernel = AsyncKernelManager(kernel_name="python3", transport="ipc", ip=f"{sockets}/kernel")
            here = {"metadata": {"path": str(HERE)}}
            NotebookClient(book, km=kernel, timeout=300, record_timing=False, resources=here).execute()
    except CellExecutionError as error:
        fault = f"{source.name}: {error}"
    # Remove machine-dependent metadata.
    book.metadata["language_info"] = {"name": "python"}
    nbformat.write(book, target)
    return fault


if __name__ == "__main__":
    main()
