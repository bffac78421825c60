"""Runs two campaigns, exports what they left, and runs every notebook on it from top to bottom.

    python notebooks/regenerate.py                             the notebooks here, with their outputs
    python notebooks/regenerate.py --runs 8 --into /tmp/try    a quick try, which changes nothing here

Needs the packages of tests/foreign/requirements.txt, and actcheck: `make notebooks` has both. What was exported stays in the folder
`data` beside the notebooks that were written.
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
# The same scenes twice: the second robot's senses are better.
CAMPAIGNS = {"first": "configs/pick.toml", "second": "benches/quiet_pick.toml"}


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--actcheck", default=str(ROOT / "actcheck"), help="the program [default: ./actcheck of the checkout]")
    arguments.add_argument("--runs", default="200", help="runs of each campaign [default: 200]")
    arguments.add_argument("--jobs", default="2", help="runs at a time [default: 2]")
    arguments.add_argument("--into", type=Path, default=HERE, help="where the notebooks are written [default: here]")
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
    """Leaves tables, findings and RDF of both campaigns, and their comparison."""
    for name, config in CAMPAIGNS.items():
        folder = data / name
        history = ["--history", folder / "history"]
        # 1: a property failed, which is what campaigns are for.
        actcheck(asked, "run", config, "--runs", asked.runs, "--jobs", asked.jobs, *history, good=(0, 1))
        actcheck(asked, "export", "--parquet", folder, "--nquads", folder / "history.nq", *history)
        (folder / "findings.json").write_text(actcheck(asked, "analyse", "--format", "json", *history))
    pair = [data / name / "history" for name in CAMPAIGNS]
    (data / "comparison.json").write_text(actcheck(asked, "compare", *pair, "--format", "json"))


def execute(source, target, data):
    """Runs a notebook in order and writes it with its outputs. Returns what went wrong."""
    book = nbformat.read(source, as_version=4)
    os.environ["ACTCHECK_DATA"] = str(data)
    os.environ["ACTCHECK_QUERIES"] = str(ROOT / "ontology" / "queries")
    fault = None
    try:
        # Sockets in a private folder instead of ports: no other user of the machine can connect.
        with tempfile.TemporaryDirectory() as sockets:
            kernel = AsyncKernelManager(kernel_name="python3", transport="ipc", ip=f"{sockets}/kernel")
            NotebookClient(book, km=kernel, timeout=300, record_timing=False).execute()
    except CellExecutionError as error:
        fault = f"{source.name}: {error}"
    # What differs from machine to machine says nothing.
    book.metadata["language_info"] = {"name": "python"}
    nbformat.write(book, target)
    return fault


if __name__ == "__main__":
    main()
