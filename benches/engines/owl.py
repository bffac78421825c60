#!/usr/bin/env python3
"""Compares the closure of an ontology under OWL 2 RL: actcheck, `reasonable` and owlrl, on the same triples.

    python3 benches/engines/owl.py [--actcheck PROGRAM] [--triples N] [--rounds N] [--with-owlrl]

Needs `pip install reasonable`, and for `--with-owlrl` also owlrl, which takes minutes for 5,000 triples. The ontology has a
hierarchy of 200 classes, 20 properties with domains, ranges and characteristics, chains of a transitive property, and
things with several names (`owl:sameAs`). "short", "middle" and "long" differ in the length of the chains and the number of
names. Seconds are processor time of the whole process: the least of the rounds, in which the programs alternate.

The numbers of triples need not be equal: `reasonable` also keeps axiomatic triples that say nothing of the ontology, and
leaves out others. Those that speak of the ontology's things by its own properties, or give their classes, are compared one
by one.
"""

import argparse
import csv
import random
import resource
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
EX, RDFS = "http://example.org/", "http://www.w3.org/2000/01/rdf-schema#"
OWL, TYPE = "http://www.w3.org/2002/07/owl#", "http://www.w3.org/1999/02/22-rdf-syntax-ns#type"
# Length of the chains, number of other names of a thing.
SHAPES = {"short": (10, 3), "middle": (60, 11), "long": (200, 20)}
PEER = {
    "reasonable": """
import sys, reasonable
reasoner = reasonable.PyReasoner()
reasoner.load_file(sys.argv[1])
triples = [tuple(str(term).strip("<>") for term in triple) for triple in reasoner.reason()]
""",
    "owlrl": """
import sys, rdflib, owlrl
graph = rdflib.Graph().parse(sys.argv[1])
owlrl.DeductiveClosure(owlrl.OWLRL_Semantics).expand(graph)
triples = [tuple(map(str, triple)) for triple in graph]
""",
}
WRITE = """
import csv
csv.writer(open(sys.argv[2], "w")).writerows(triples)
"""


def ontology(count, length, names, seed=1):
    """The lines of an ontology of about `count` triples."""
    rng, lines = random.Random(seed), []

    def say(subject, predicate, value):
        whole = [EX + subject, predicate if ":" in predicate else EX + predicate, value if ":" in value else EX + value]
        lines.append(" ".join(f"<{iri}>" for iri in whole) + " .\n")

    for idx in range(1, 200):
        say(f"C{idx}", RDFS + "subClassOf", f"C{(idx - 1) // 3}")
    for idx in range(20):
        say(f"p{idx}", TYPE, OWL + "ObjectProperty")
    for idx in range(1, 10):
        say(f"p{idx}", RDFS + "subPropertyOf", f"p{(idx - 1) // 2}")
    for idx in range(5):
        say(f"p{idx}", RDFS + "domain", f"C{idx}")
        say(f"p{idx}", RDFS + "range", f"C{idx + 5}")
    say("p10", TYPE, OWL + "TransitiveProperty")
    say("p11", TYPE, OWL + "SymmetricProperty")
    say("p12", OWL + "inverseOf", "p13")
    things = count // 5
    for idx in range(things):
        say(f"x{idx}", TYPE, f"C{rng.randrange(200)}")
        if idx % length:
            say(f"x{idx - 1}", "p10", f"x{idx}")
    others = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 11, 12, 13]
    while len(lines) < count * 0.985:
        say(f"x{rng.randrange(things)}", f"p{rng.choice(others)}", f"x{rng.randrange(things)}")
    group = 0
    while len(lines) < count:
        thing = rng.randrange(things)
        for idx in range(names):
            say(f"x{thing}", OWL + "sameAs", f"y{group}_{idx}")
        group += 1
    return "".join(lines)


def measured(command, folder):
    """Returns the processor time of a command, and its triples that are compared."""

    def spent():
        usage = resource.getrusage(resource.RUSAGE_CHILDREN)
        return usage.ru_utime + usage.ru_stime

    start = spent()
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    seconds = spent() - start
    if done.returncode != 0:
        sys.exit(f"{' '.join(command)} failed:\n{done.stdout}{done.stderr}")
    with open(folder / "t.csv") as file:
        rows = (tuple(term.strip("<>") for term in row) for row in csv.reader(file))
        own = {row for row in rows if row[0].startswith(EX) and row[2].startswith(EX)}
    return seconds, {row for row in own if row[1].startswith(EX) or row[1] == TYPE}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--actcheck", default=str(ROOT / "actcheck"), help="the program (default: ./actcheck of this checkout)")
    parser.add_argument("--triples", type=int, default=50_000, help="size of each ontology (default: 50000)")
    parser.add_argument("--rounds", type=int, default=3, help="runs of each program; the fastest counts (default: 3)")
    parser.add_argument("--with-owlrl", action="store_true", help="compare owlrl, too")
    args = parser.parse_args()
    program = shutil.which(args.actcheck) or sys.exit(f"no program `{args.actcheck}`: build it with `make`")
    rules = (ROOT / "rules" / "lib" / "owl-rl.rls").read_text()
    head = '@import triple :- turtle{resource = "o.ttl"} .\n@export t :- csv{resource = "t.csv"} .\n'
    limits = ["--max-memory", "12GiB"]
    with tempfile.TemporaryDirectory(prefix="owl-") as name:
        folder = Path(name)
        (folder / "owl.rls").write_text(head + rules)
        commands = {"actcheck": [str(Path(program).resolve()), "datalog", "owl.rls", "-D", ".", *limits]}
        for peer in ["reasonable", *(["owlrl"] if args.with_owlrl else [])]:
            commands[peer] = [sys.executable, "-c", PEER[peer] + WRITE, "o.ttl", "t.csv"]
        for shape, (length, names) in SHAPES.items():
            (folder / "o.ttl").write_text(ontology(args.triples, length, names))
            results = {}
            for _ in range(args.rounds):
                for peer, command in commands.items():
                    seconds, triples = measured(command, folder)
                    results[peer] = (min(seconds, results.get(peer, (seconds,))[0]), triples)
            seconds, ours = results["actcheck"]
            for peer, (other, triples) in results.items():
                apart = f", {len(ours ^ triples)} triples differ" if peer != "actcheck" else ""
                print(f"{shape:<8} {peer:<12} {len(triples):>9} triples {other:8.2f} s {other / seconds:6.1f} ×{apart}", flush=True)


main()
