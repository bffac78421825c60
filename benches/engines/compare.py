#!/usr/bin/env python3
"""Compares `actcheck datalog` with other engines on the same programs.

    python3 benches/engines/compare.py [--actcheck PROGRAM] [--rounds N] [--only TASK] [--by-hand]

The programs are closure (alone, and with a condition that changes nothing), same generation, Andersen's points-to
analysis, triangles of a graph with hubs, a points-to analysis like Souffle's example hmmer, and joins by equal and by
computed values; see programs.py. Runs
each engine in a process of its own, checks that all count the same tuples of `p`, and prints seconds and ratios. Seconds
are processor time of the whole process, including parsing: the least of the rounds, in which the engines alternate.

Engines: actcheck (`make`), SWI-Prolog with tabling (Debian: swi-prolog-nox), clingo and DuckDB (from PyPI, in a virtual
environment in a temporary folder, or `--python` with both), Souffle if it is installed (interpreter, one thread).
DuckDB is left out where predicates depend on each other. `--by-hand` adds closure compiled by hand with datafrog, as
measured by `cargo bench --bench rules`: evaluation only, without start and parsing.
"""

import argparse
import re
import resource
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import programs

ROOT = Path(__file__).resolve().parents[2]
# A run that takes longer counts as "over" this time. Unit: seconds.
LIMIT = 60


class Missing(Exception):
    """An engine is not installed; the message explains how to install it."""


def actcheck(folder, task, program):
    found = shutil.which(program)
    if not found:
        raise Missing(f"no program `{program}`: build it with `make`, or name another with --actcheck")
    _, rules, facts = task
    text = programs.write_rules(rules, "~", " .", lambda v: f"?{v}") + programs.write_facts(facts, " .")
    (folder / "program.rls").write_text(text)
    command = [str(Path(found).resolve()), "datalog", "program.rls", "--max-time", "10m"]
    return command, r"^\s*p\s+(\d+)"


def swi(folder, task):
    found = shutil.which("swipl")
    if not found:
        raise Missing("no program `swipl`: apt-get install swi-prolog-nox")
    _, rules, facts = task
    derived, given = programs.predicates(rules)
    tables = "".join(f":- table {name}/{size}.\n" for name, size in derived.items())
    tables += "".join(f":- dynamic {name}/{size}.\n" for name, size in given.items())
    (folder / "program.pl").write_text(
        ":- style_check(-discontiguous).\n" + tables + programs.write_rules(rules, "tnot ", ".", equals="is") + programs.write_facts(facts, ".")
    )
    goal = f"aggregate_all(count, p({', '.join('_' * derived['p'])}), N), format('p ~w~n', [N]), halt"
    # The default of 1 GB is too small for tables of this size.
    return [found, "--stack-limit=4g", "--table-space=8g", "-q", "-g", goal, "program.pl"], r"^p (\d+)"


def clingo(folder, task, python):
    _, rules, facts = task
    (folder / "program.lp").write_text(programs.write_rules(rules, "not ", ".") + programs.write_facts(facts, "."))
    # Grounding alone computes the closure of a program without choices.
    (folder / "ground.py").write_text(
        "import clingo\n"
        "control = clingo.Control()\n"
        "control.load('program.lp')\n"
        "control.ground([('base', [])])\n"
        f"print('p', sum(1 for _ in control.symbolic_atoms.by_signature('p', {programs.predicates(rules)[0]['p']})))\n"
    )
    return [str(python), "ground.py"], r"^p (\d+)"


def duckdb(folder, task, python):
    name, _, facts = task
    if name not in programs.SQL:
        return None
    loads = ""
    for table, rows in facts.items():
        (folder / f"{table}.csv").write_text("".join(",".join(map(str, row)) + "\n" for row in rows))
        names = ["a", "b"][: len(rows[0])]
        loads += f"base.execute(\"create table {table} as select * from read_csv('{table}.csv', names={names})\")\n"
    (folder / "query.py").write_text(
        f"import duckdb\nbase = duckdb.connect()\nbase.execute('set threads = 1')\n{loads}"
        f"print('p', base.execute({programs.SQL[name]!r}).fetchone()[0])\n"
    )
    return [str(python), "query.py"], r"^p (\d+)"


def souffle(folder, task):
    found = shutil.which("souffle")
    if not found:
        raise Missing("no program `souffle`: see https://souffle-lang.github.io/install")
    _, rules, facts = task
    derived, given = programs.predicates(rules)
    declared = "".join(
        f".decl {name}({', '.join(f'x{i}: number' for i in range(size))})\n" for name, size in (derived | given).items()
    )
    loads = "".join(f".input {name}(IO=file, filename=\"{name}.csv\", delimiter=\",\")\n" for name in given)
    for name in given:
        rows = facts.get(name, [])
        (folder / f"{name}.csv").write_text("".join(",".join(map(str, row)) + "\n" for row in rows))
    text = programs.write_rules(rules, "!", ".", constant=lambda _: "-1")
    (folder / "program.dl").write_text(declared + loads + ".printsize p\n" + text)
    return [found, "-j1", "program.dl"], r"^p\t(\d+)"


def environment(folder):
    """Makes a virtual environment with clingo and DuckDB."""
    made = subprocess.run([sys.executable, "-m", "venv", folder / "environment"], capture_output=True, text=True)
    python = folder / "environment" / "bin" / "python"
    if made.returncode == 0:
        made = subprocess.run([python, "-m", "pip", "install", "-q", "clingo", "duckdb"], capture_output=True, text=True)
    if made.returncode != 0:
        said = (made.stderr or made.stdout).strip().splitlines()
        raise Missing("clingo and DuckDB could not be installed: " + (said[-1] if said else "no virtual environment"))
    return python


def measured(command, pattern, folder):
    """Returns seconds and number of tuples of one run; no number if it takes too long."""

    def spent():
        usage = resource.getrusage(resource.RUSAGE_CHILDREN)
        return usage.ru_utime + usage.ru_stime

    start = spent()
    limited = lambda: resource.setrlimit(resource.RLIMIT_CPU, (LIMIT, LIMIT + 5))
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, preexec_fn=limited)
    seconds = spent() - start
    count = re.search(pattern, done.stdout, re.MULTILINE)
    if done.returncode != 0 and seconds > 0.95 * LIMIT:
        return LIMIT, None
    if done.returncode != 0 or not count:
        sys.exit(f"{' '.join(command)} failed:\n{done.stdout}{done.stderr}")
    return seconds, int(count.group(1))


def by_hand():
    """Returns seconds and number of tuples of the rules compiled by hand."""
    command = ["cargo", "bench", "--locked", "--bench", "rules", "--", "closure"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    found = re.search(r"transitive closure, (\d+) tuples: .* by hand ([\d.]+) s", done.stdout)
    if done.returncode != 0 or not found:
        sys.exit(f"{' '.join(command)} failed:\n{done.stdout}{done.stderr}")
    return float(found.group(2)), int(found.group(1))


def compare(task, engines, rounds):
    """Prints the table of one program. Returns the engines that are faster than actcheck."""
    title, results = task[0], {}
    with tempfile.TemporaryDirectory(prefix="engines-") as name:
        made = {}
        for engine, make in engines.items():
            folder = Path(name) / engine.split()[0].strip(",")
            folder.mkdir()
            made[engine] = (make(folder, task), folder)
        for _ in range(max(rounds, 1)):
            for engine, (run, folder) in made.items():
                if run and results.get(engine, (0, 0))[1] is not None:
                    seconds, tuples = measured(*run, folder)
                    results[engine] = (min(seconds, results.get(engine, (seconds, 0))[0]), tuples)
    if len({tuples for _, tuples in results.values() if tuples is not None}) > 1:
        sys.exit(f"the engines don't agree about {title}: {results}")
    ours = results.get("actcheck", (None,))[0]
    print(f"{title:<36} {'tuples':>9} {'seconds':>8} {'actcheck takes':>15}")
    for engine, (seconds, tuples) in results.items():
        over = "over " if tuples is None else ""
        ratio = f"{ours / seconds:.2f} ×" if ours else ""
        print(f"  {engine:<34} {tuples or '':>9} {over + format(seconds, '.2f'):>8} {ratio:>15}", flush=True)
    return [f"{engine} on {title}" for engine in results if engine != "actcheck" and ours and ours > results[engine][0]]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--actcheck", default=str(ROOT / "actcheck"), help="the program (default: ./actcheck of this checkout)")
    parser.add_argument("--rounds", type=int, default=3, help="runs of each engine; the fastest counts (default: 3)")
    parser.add_argument("--only", help="run the programs whose names contain this text")
    parser.add_argument("--python", help="a Python with clingo and DuckDB (default: a new environment)")
    parser.add_argument("--by-hand", action="store_true", help="measure rules compiled by hand, too (builds the benchmark)")
    args = parser.parse_args()
    tasks = [task for task in programs.tasks() if (args.only or "") in task[0]]
    faster, missing, engines = [], [], {}
    with tempfile.TemporaryDirectory(prefix="engines-") as name:
        try:
            python = args.python or environment(Path(name))
        except Missing as reason:
            python = None
            missing.append(str(reason))
        makers = {
            "actcheck": lambda folder, task: actcheck(folder, task, args.actcheck),
            "SWI-Prolog, tabling": swi,
            "clingo, grounding": lambda folder, task: clingo(folder, task, python),
            "DuckDB, one thread": lambda folder, task: duckdb(folder, task, python),
            "Souffle, interpreter": souffle,
        }
        for title, make in makers.items():
            if python is None and title.startswith(("clingo", "DuckDB")):
                continue
            folder = Path(name) / title.split()[0].strip(",")
            folder.mkdir()
            try:
                make(folder, programs.tasks()[0])
                engines[title] = make
            except Missing as reason:
                missing.append(f"{title} was left out: {reason}")
        for task in tasks:
            faster += compare(task, engines, args.rounds)
    if args.by_hand:
        seconds, tuples = by_hand()
        print(f"datafrog by hand, evaluation of closure only: {tuples} tuples, {seconds:.2f} s")
    for reason in missing:
        print(reason)
    if faster:
        sys.exit(f"faster than actcheck: {', '.join(faster)}")


main()
