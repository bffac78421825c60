"""Runs campaigns, exports their results, and executes every notebook on them from top to bottom.

    python notebooks/regenerate.py                             regenerates the notebooks in place
    python notebooks/regenerate.py --pictures                  and the pictures of README and of the page about failures
    python notebooks/regenerate.py --runs 8 --into /tmp/try    a quick test, which writes to another folder
    python notebooks/regenerate.py --only judge_robosuite      the notebook that needs robosuite and `actcheck.Judge` instead

Requires the packages of tests/foreign/requirements.txt, and actcheck; `make notebooks` provides both. The exported data
stay in the folder `data` next to the written notebooks. The notebook with robosuite is left out unless it is named.
"""

import argparse
import json
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
# Needs the packages of tests/foreign/robosuite.txt and the Python package with the compiled rules, and no campaigns.
ROBOSUITE = "judge_robosuite"
# Width of a picture beside another. Unit: pixels.
WIDTH = 800


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--actcheck", default=str(ROOT / "actcheck"), help="path of the program [default: ./actcheck of the checkout]")
    arguments.add_argument("--runs", default="300", help="runs of each campaign [default: 300]")
    arguments.add_argument("--jobs", default="2", help="number of parallel runs [default: 2]")
    arguments.add_argument("--into", type=Path, default=HERE, help="output folder [default: the notebooks folder]")
    arguments.add_argument("--pictures", action="store_true", help="also draw the pictures of documents")
    arguments.add_argument("--only", choices=[ROBOSUITE], help="a notebook that needs other packages")
    asked = arguments.parse_args()
    asked.into.mkdir(parents=True, exist_ok=True)
    data = asked.into.resolve() / "data"
    shutil.rmtree(data, ignore_errors=True)
    if asked.only is None:
        export(asked, data)
    books = [book for book in sorted(HERE.glob("*.ipynb")) if (book.stem == ROBOSUITE) == (asked.only is not None)]
    faults = [fault for book in books if (fault := execute(book, asked.into / book.name, data))]
    if faults:
        sys.exit("\n".join(faults))
    if asked.pictures:
        draw(asked, asked.into / "pictures")


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
        actcheck(asked, "export", "tables", folder, "--complete", *history)
        actcheck(asked, "export", "rdf", folder / "history.nq", *history)
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
            NotebookClient(book, km=kernel, timeout=600, record_timing=False, resources=here).execute()
    except CellExecutionError as error:
        fault = f"{source.name}: {error}"
    # Remove machine-dependent metadata.
    book.metadata["language_info"] = {"name": "python"}
    nbformat.write(book, target)
    return fault


def draw(asked, pictures):
    """Draws README's failed pick, and one run of each failure mode on a cluttered table beside its smallest scene."""
    pictures.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        scratch = Path(scratch)
        history = ["--history", scratch / "pick"]
        actcheck(asked, "run", "configs/pick.toml", "--jobs", asked.jobs, *history, good=(0, 1))
        # README describes this run.
        ninth = failing(asked, history)[0].rsplit("-", 1)[0] + "-9"
        actcheck(asked, "show", ninth, "--picture", pictures / "failed_pick.svg", *history)
        history = ["--history", scratch / "clutter"]
        actcheck(asked, "run", "configs/clutter.toml", "--runs", "60", "--jobs", asked.jobs, *history, good=(0, 1))
        rows = []
        for run in failing(asked, history)[:4]:
            pair = [scratch / f"{run}-{kind}.png" for kind in ("run", "smallest")]
            actcheck(asked, "show", run, "--picture", pair[0], *history)
            actcheck(asked, "shrink", run, "--jobs", asked.jobs, "--picture", pair[1], *history)
            rows.append(pair)
        beside(rows, pictures / "shrunk.png")


def failing(asked, history):
    """The first run of each failure mode, the most frequent mode first."""
    modes = json.loads(actcheck(asked, "analyse", "--format", "json", *history))["failure_modes"]
    return [min(mode["runs"], key=lambda run: int(run.rsplit("-", 1)[1])) for mode in modes if mode["failed"]]


def beside(rows, target):
    """Arranges pairs of pictures in rows, in a third of their size."""
    from PIL import Image

    shown = [[Image.open(picture).convert("RGB") for picture in pair] for pair in rows]
    shown = [[picture.resize((WIDTH, picture.height * WIDTH // picture.width)) for picture in pair] for pair in shown]
    heights = [max(picture.height for picture in pair) for pair in shown]
    sheet = Image.new("RGB", (2 * WIDTH, sum(heights)), "white")
    for number, pair in enumerate(shown):
        for column, picture in enumerate(pair):
            sheet.paste(picture, (column * WIDTH, sum(heights[:number])))
    sheet.quantize(255).save(target, optimize=True)


if __name__ == "__main__":
    main()
