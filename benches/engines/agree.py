#!/usr/bin/env python3
"""Does `actcheck datalog` derive the same as clingo? Compares all tuples of random programs.

    python3 benches/engines/agree.py [--actcheck PROGRAM] [--programs N] [--seed N]

Needs clingo (`pip install clingo`). The programs have rules with several heads, computed terms, equalities, negation,
recursion and aggregates. clingo gets a rule with several heads as one rule for their values and one for each head, so
that a head without a value makes the whole rule inapplicable. The integers of clingo have 32 bits; the inputs of sums
are therefore multiples of 2 ** 60 in the other program, which must report a sum that does not fit.
"""

import argparse
import random
import subprocess
import sys
import tempfile
from pathlib import Path

import clingo

ROOT = Path(__file__).resolve().parents[2]
UNIT = 2**60
LEAST, MOST = -(2**63), 2**63 - 1


def facts(rng):
    """Rows by predicate: small integers, and a text, with which no computation has a value."""
    value = lambda: "x" if rng.random() < 0.08 else rng.randint(-1, 4)
    rows = {f"e{n}": {(value(), value()) for _ in range(rng.randint(4, 14))} for n in range(4)}
    rows["big"] = {(rng.randint(0, 2), rng.randint(0, 3), rng.randint(-7, 7)) for _ in range(rng.randint(1, 9))}
    return rows


def rule(rng, level):
    """A rule for `p<level>`: its heads and conditions. Only lower predicates are negated or aggregated."""
    below = [f"e{n}" for n in range(4)] + [f"p{n}" for n in range(level)]
    variables = ["A", "B", "C", "D"]
    argument = lambda: rng.choice(variables + ["1", '"x"'] if rng.random() < 0.3 else variables)
    body, bound = [], []
    for _ in range(rng.randint(1, 3)):
        name = f"p{level}" if rng.random() < 0.25 else rng.choice(below)
        args = [argument(), argument()]
        if bound and rng.random() < 0.2:
            args[0] = f"{rng.choice(bound)} {rng.choice('+-')} 1"
        body.append(f"{name}({args[0]}, {args[1]})")
        bound += [arg for arg in args if arg in variables and arg not in bound]
    if not bound:
        return None
    one = lambda: rng.choice(bound)
    for _ in range(rng.randint(0, 2)):
        body.append(
            rng.choice(
                [
                    f"{one()} = {one()}",
                    f"{one()} = {one()} + {rng.randint(-2, 2)}",
                    f"{one()} - 1 = {one()}",
                    f"{one()} * 2 = {one()} + {one()}",
                    f"{one()} != {one()}",
                    f"{one()} - {one()} < {rng.randint(-1, 3)}",
                ]
            )
        )
    if rng.random() < 0.3:
        body.append(f"not {rng.choice(below)}({one()}, {one()})")
    heads = []
    for _ in range(rng.choice([1, 1, 2, 3])):
        args = []
        for _ in range(2):
            term = one()
            if rng.random() < 0.3:
                term = rng.choice([f"{term} + 1", f"{term} - {one()}", f"{term} * {one()}"])
                # Computed values are bounded, so that recursion ends.
                body += [f"{term} < 9", f"{term} > -9"]
            args.append(term)
        heads.append((f"p{level}", args))
    return heads, body


def aggregate(rng, number):
    """A rule for `s<number>`, as text for both engines."""
    kind = rng.choice(["sum", "sum", "min", "max", "count"])
    distinct = rng.random() < 0.5
    inner, outer = ("V, X", "?v, ?x") if distinct else ("V", "?v")
    ours = f"s{number}(?g, #{kind}({outer})) :- big(?g, ?x, ?v) ."
    theirs = f"s{number}(G, S) :- big(G, _, _), S = #{kind} {{ {inner} : big(G, X, V) }}."
    return kind, ours, theirs


def shown(atom):
    """Writes variables as `?a`, and negation as `~`."""
    text = "".join(f"?{c.lower()}" if c in "ABCD" else c for c in atom)
    return "~" + text.removeprefix("not ") if text.startswith("not ") else text


def written(rng):
    """Returns a random program for both engines, and the kinds of its aggregates."""
    rows = facts(rng)
    ours, theirs, kinds = [], [], {}
    for name, some in rows.items():
        for row in sorted(some, key=str):
            values = [f'"{value}"' if value == "x" else str(value) for value in row]
            theirs.append(f"{name}({', '.join(values)}).")
            if name == "big":
                values[2] = str(row[2] * UNIT)
            ours.append(f"{name}({', '.join(values)}) .")
    for number in range(rng.randint(3, 8)):
        found = rule(rng, rng.randint(0, 3))
        if found is None:
            continue
        heads, body = found
        atoms = [f"{name}({', '.join(args)})" for name, args in heads]
        ours.append(f"{', '.join(map(shown, atoms))} :- {', '.join(map(shown, body))} .")
        values = [arg for _, args in heads for arg in args]
        names = [f"V{place}" for place in range(len(values))]
        given = [f"{name} = {value}" for name, value in zip(names, values)]
        theirs.append(f"t{number}({', '.join(names)}) :- {', '.join(body + given)}.")
        for place, (name, args) in enumerate(heads):
            mine = names[2 * place : 2 * place + len(args)]
            theirs.append(f"{name}({', '.join(mine)}) :- t{number}({', '.join(names)}).")
    for number in range(rng.randint(0, 2)):
        kinds[f"s{number}"], mine, other = aggregate(rng, number)
        ours.append(mine)
        theirs.append(other)
    exported = [f"p{level}" for level in range(4)] + list(kinds)
    ours += [f"@export {name} :- csv{{}} ." for name in exported]
    return "\n".join(ours), "\n".join(theirs), kinds


def solved(text):
    """Returns clingo's tuples by predicate."""
    control = clingo.Control(logger=lambda code, message: None)
    control.add("base", [], text)
    control.ground([("base", [])])
    found = {}
    with control.solve(yield_=True) as handle:
        for symbol in handle.model().symbols(atoms=True):
            row = tuple(a.number if a.type == clingo.SymbolType.Number else a.string for a in symbol.arguments)
            found.setdefault(symbol.name, set()).add(row)
    return found


def derived(text, program, folder):
    """Returns our tuples by predicate, or the message of an error."""
    (folder / "program.rls").write_text(text)
    out = folder / "out"
    done = subprocess.run([program, "datalog", "program.rls", "-D", out], cwd=folder, capture_output=True, text=True)
    if done.returncode != 0:
        return done.stderr
    rows = {}
    for file in out.glob("*.csv"):
        lines = file.read_text().splitlines()
        cell = lambda value: "x" if "x" in value else int(value)
        rows[file.stem] = {tuple(map(cell, line.split(","))) for line in lines}
    return rows


def expected(rows, kinds):
    """Returns clingo's tuples with the large values; `None` if a sum does not fit."""
    for name, kind in kinds.items():
        if kind == "count":
            continue
        large = {(group, value * UNIT) for group, value in rows.get(name, set())}
        if any(not LEAST <= value <= MOST for _, value in large):
            return None
        rows[name] = large
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--actcheck", default=str(ROOT / "actcheck"), help="the program (default: ./actcheck of this checkout)")
    parser.add_argument("--programs", type=int, default=2_000, help="number of programs (default: 2000)")
    parser.add_argument("--seed", type=int, default=1, help="seed of the first program (default: 1)")
    args = parser.parse_args()
    different, too_large, tuples = 0, 0, 0
    with tempfile.TemporaryDirectory(prefix="agree-") as name:
        for seed in range(args.seed, args.seed + args.programs):
            ours, theirs, kinds = written(random.Random(seed))
            wanted = expected(solved(theirs), kinds)
            found = derived(ours, str(Path(args.actcheck).resolve()), Path(name))
            if wanted is None:
                too_large += 1
                agrees = isinstance(found, str) and "R065" in found
            else:
                names = [f"p{level}" for level in range(4)] + list(kinds)
                agrees = not isinstance(found, str) and all(found.get(n, set()) == wanted.get(n, set()) for n in names)
                tuples += sum(len(wanted.get(n, ())) for n in names)
            if not agrees:
                different += 1
                print(f"seed {seed} differs:\n{ours}\n\nclingo: {wanted}\nactcheck: {found}\n")
    print(f"{args.programs} programs, {tuples} tuples, {too_large} with a sum that does not fit: {different} differ")
    sys.exit(1 if different else 0)


if __name__ == "__main__":
    main()
