"""Writes the gallery: failures that the shipped campaigns find, each with pictures, its smallest scene and a proof.

    python3 docs/gallery/make.py                        writes docs/gallery.md and the pictures in docs/gallery
    python3 docs/gallery/make.py --into /tmp/try --failures 2 --runs 6 --trials 5      a quick test in another folder

`make gallery` builds actcheck and starts this. It needs only Python's standard library. The campaigns' histories go to a
temporary folder. The same program writes the same page.
"""

import argparse
import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# Each campaign with its share of the runs. Of the runs that fail in the same way, the first campaign shows its own.
CAMPAIGNS = {"move_to": 1.0, "perceive": 1.0, "pick": 3.0, "clutter": 1.0, "fixed_arm": 1.0, "pick_and_place": 1.0}
ACTIONS = ["MoveTo", "PerceivePlane", "Pick", "Place"]

HEAD = """# Gallery

Failures that the campaigns in `configs/` find: {count} different ones, each with the run, the smallest scene in which the
property still fails, and the proof by the rules. [`gallery/make.py`](gallery/make.py) wrote this page from runs of the program:
`make gallery` writes it again. How to read it: [Failures](failures.md).

| | fails | campaign | how often |
| --- | --- | --- | --- |
"""


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--actcheck", default=str(ROOT / "actcheck"), help="path of the program [default: ./actcheck of the checkout]")
    arguments.add_argument("--project", type=Path, default=ROOT, help="folder with configs [default: the checkout]")
    arguments.add_argument("--campaigns", nargs="+", default=list(CAMPAIGNS), help="names of configurations [default: %(default)s]")
    arguments.add_argument("--into", type=Path, default=ROOT / "docs", help="folder of the page [default: docs]")
    arguments.add_argument("--failures", type=int, default=10, help="number of failures [default: 10]")
    arguments.add_argument("--runs", type=int, default=60, help="runs of a campaign; of pick, three times as many [default: 60]")
    arguments.add_argument("--trials", type=int, default=60, help="simulations to shrink one failure [default: 60]")
    arguments.add_argument("--jobs", default="2", help="number of parallel runs [default: 2]")
    asked = arguments.parse_args()
    pictures = asked.into / "gallery"
    pictures.mkdir(parents=True, exist_ok=True)
    for old in pictures.glob("*.svg"):
        old.unlink()
    with tempfile.TemporaryDirectory() as scratch:
        modes = [mode for name in asked.campaigns for mode in failure_modes(asked, name, Path(scratch))]
        chosen = choose(modes, asked.failures)
        if not chosen:
            sys.exit("no run of these campaigns failed")
        sections = [section(asked, number, mode, pictures) for number, mode in enumerate(chosen, start=1)]
    rows = "".join(row(number, mode) for number, mode in enumerate(chosen, start=1))
    page = HEAD.format(count=len(chosen)) + rows + "\n" + "\n".join(sections)
    (asked.into / "gallery.md").write_text(page)


def actcheck(asked, *words):
    """Runs a command in the project. Exit code 1 means that a property failed, which is a valid result."""
    done = subprocess.run([asked.actcheck, *map(str, words)], cwd=asked.project, capture_output=True, text=True)
    if done.returncode > 1:
        sys.exit(f"actcheck {' '.join(map(str, words))}\n{done.stderr}")
    return done.stdout


def local(iri):
    return re.split("[#/]", iri)[-1]


def failure_modes(asked, name, scratch):
    """Runs a campaign and returns its failure modes: failed properties, how often, and the first run."""
    history = scratch / name
    runs = max(round(asked.runs * CAMPAIGNS.get(name, 1.0)), 1)
    actcheck(asked, "run", f"configs/{name}.toml", "--runs", runs, "--jobs", asked.jobs, "--history", history)
    found = json.loads(actcheck(asked, "analyse", "--format", "json", "--history", history))["failure_modes"]
    for mode in found:
        if failed := [local(iri) for iri in mode["failed"]]:
            number = lambda run: int(run.rsplit("-", 1)[1])
            runs_of_mode = sorted(mode["runs"], key=number)
            detail = json.loads(actcheck(asked, "show", runs_of_mode[0], "--format", "json", "--history", history))
            yield {
                "campaign": name, "history": history, "failed": failed, "run": runs_of_mode[0], "detail": detail,
                "count": len(runs_of_mode), "of": runs,
            }


def choose(modes, number):
    """Different sets of failed properties: for each property the simplest one, then the most frequent of the others."""
    by_failed = {}
    for mode in modes:
        by_failed.setdefault(frozenset(mode["failed"]), mode)
    share = lambda mode: -mode["count"] / mode["of"]
    chosen, shown = [], set()
    for mode in sorted(by_failed.values(), key=lambda mode: (len(mode["failed"]), share(mode), mode["failed"])):
        if new := [name for name in mode["failed"] if name not in shown]:
            # Of several, a collision says most.
            mode["about"] = next((name for name in new if "Collisions" in name), new[0])
            chosen.append(mode)
            shown.update(new)
    for mode in sorted((mode for mode in by_failed.values() if mode not in chosen), key=share):
        mode["about"] = mode["failed"][0]
        chosen.append(mode)
    return sorted(chosen[:number], key=lambda mode: (ACTIONS.index(about(mode)[0]), len(mode["failed"]), mode["failed"]))


def about(mode):
    """The action and the sentence of the failed property that the section is about."""
    for action in mode["detail"]["actions"]:
        for outcome in action["outcomes"]:
            if outcome["outcome"] == "failed" and local(outcome["property"]) == mode["about"]:
                return local(action["action"]), outcome["witness"]
    raise ValueError(mode["run"])


def title(mode):
    return ": ".join(about(mode))


def row(number, mode):
    names = ", ".join(mode["failed"])
    text = re.sub(r"[|]", r"\\|", title(mode))
    return f"| [{number}](#failure-{number}) | {text} | `{mode['campaign']}` | {mode['count']} of {mode['of']} runs: {names} |\n"


def section(asked, number, mode, pictures):
    history, run = mode["history"], mode["run"]
    name = f"{number:02}"
    picture = lambda kind: (pictures / f"{name}-{kind}.svg").resolve()
    actcheck(asked, "show", run, "--history", history, "--picture", picture("run"))
    shrunk = ["shrink", run, "--property", mode["about"], "--trials", asked.trials, "--jobs", asked.jobs, "--history", history, "--format", "json"]
    shrunk = json.loads(actcheck(asked, *shrunk, "--picture", picture("smallest")))
    for kind in ["run", "smallest"]:
        picture(kind).write_text(compact(picture(kind).read_text()))
    failures = []
    for action in mode["detail"]["actions"]:
        said = [f"- {local(action['action'])}, {local(outcome['property'])}: {outcome['witness']}"
                for outcome in action["outcomes"] if outcome["outcome"] == "failed"]
        failures += said + [f"- {action['perceived']}" for _ in said[:1] if action.get("perceived")]
    why = "\n\n".join(text.strip() for text in shrunk["why"]).replace(f"{asked.project.resolve()}/", "")
    table = needed(shrunk)
    lines = [
        f"## Failure {number}", "", f"**{title(mode)}**", "", *failures, "",
        f"![Run {run} of {mode['campaign']}, before and after](gallery/{name}-run.svg)", "",
        f"**The smallest scene** in which {mode['about']} fails: {smallest(shrunk)}", "", *table, *[""] * bool(table),
        f"![The smallest scene found in which {mode['about']} fails, before and after](gallery/{name}-smallest.svg)", "",
        "**The proof**", "", "```text", why, "```", "",
    ]
    return "\n".join(lines)


def smallest(shrunk):
    noise = shrunk["fresh_noise"]
    parts = [
        f"{shrunk['others']} of {shrunk['others_before']} other objects left,",
        f"{len(shrunk['choices'])} of {shrunk['special_before']} choices not nominal, after {shrunk['simulations']} simulations.",
    ]
    if not shrunk["minimal"]:
        parts.append("More simulations may find a smaller one.")
    if noise:
        parts.append(f"With fresh noise it fails in {noise['failed']} of {noise['of']} repetitions.")
    return " ".join(parts)


def needed(shrunk):
    """The choices that the failure needs, as a table."""
    found = [choice for choice in shrunk["choices"] if choice["needed"]]
    if not found:
        return []
    unit = lambda choice: f" {choice['unit']}" if choice["unit"] else ""
    value = lambda choice, key: "" if choice[key] is None else f"{choice[key]:.4g}"
    rows = [
        f"| `{choice['name']}` | {choice['value']:.4g}{unit(choice)} | {value(choice, 'fails_from')} to {value(choice, 'fails_to')} |"
        for choice in found
    ]
    return ["| needs | value | fails from … to |", "| --- | --- | --- |", *rows]


def compact(svg):
    """The same picture with half the bytes: points in whole pixels, relative to each other, repeated ones dropped."""

    def path(found):
        return 'd="' + "".join(relative(part) for part in re.findall("M[^M]*", found[1])) + '"'

    def relative(part):
        closed = part.rstrip().endswith("Z")
        points = [tuple(round(float(number)) for number in point.split(",")) for point in part.strip("MZ ").split()]
        text, last = f"M{points[0][0]} {points[0][1]}", points[0]
        steps = []
        for point in points[1:]:
            if point != last:
                steps.append(f"{point[0] - last[0]} {point[1] - last[1]}")
                last = point
        if steps:
            text += "l" + " ".join(steps).replace(" -", "-")
        return text + ("z" if closed else "")

    return re.sub(r'\bd="(M[0-9., MZ-]+)"', path, svg)


if __name__ == "__main__":
    main()
