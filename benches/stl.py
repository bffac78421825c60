#!/usr/bin/env python3
"""Random formulas of signal temporal logic with their robustness by RTAMT, as cases for the test `temporal`.

    pip install rtamt
    python3 benches/stl.py --cases 10000 > /tmp/cases.jsonl
    ACTCHECK_RTAMT=/tmp/cases.jsonl cargo test --release --locked --test all temporal::robustness_equals_rtamt

With `--seconds`, prints the CPU seconds that RTAMT and two other monitors took to the error stream, without those for
parsing: RTAMT's backend in C++, if it was built (it monitors online, so unbounded operators of the future are not
timed), and banquo (`pip install pybanquo`), if all formulas are in its language (`--common`).
"""

import argparse
import json
import math
import random
import re
import sys
import time

UNARY_FUTURE = ["always", "eventually"]
UNARY_PAST = ["historically", "once"]
COMPARISONS = ["<", "<=", ">", ">="]


def comparison(dice):
    left = dice.choice(["x", "y"])
    right = dice.choice(["x", "y", None, None])
    number = round(dice.uniform(-2, 2), 2)
    operator = dice.choice(COMPARISONS)
    if right is None or right == left:
        return f"({left} {operator} {number})", f"ex:{left}(ex:a) {operator} {number}"
    plus = abs(number)
    return f"({left} {operator} ({right} + {plus}))", f"ex:{left}(ex:a) {operator} ex:{right}(ex:a) + {plus}"


def interval(dice):
    if dice.random() < 0.4:
        return "", ""
    start = dice.choice([0, 0, 1, 2, 3])
    end = start + dice.randrange(0, 8)
    return f"[{start}:{end}]", f"[{start}, {end}]"


def formula(dice, depth):
    """Returns a formula as RTAMT writes it and as rules write it."""
    kind = dice.random()
    if depth == 0 or kind < 0.15:
        return comparison(dice)
    if kind < 0.25:
        theirs, ours = formula(dice, depth - 1)
        return f"(not({theirs}))", f"~({ours})"
    if kind < 0.5:
        word = dice.choice(["and", "or", "implies"])
        (a, b), (c, d) = formula(dice, depth - 1), formula(dice, depth - 1)
        return f"(({a}) {word} ({c}))", f"(({b}) {word} ({d}))"
    return temporal(dice, depth)


def temporal(dice, depth):
    theirs, ours = interval(dice)
    if dice.random() < 0.3:
        word = dice.choice(["until", "since"])
        (a, b), (c, d) = formula(dice, depth - 1), formula(dice, depth - 1)
        return f"(({a}) {word}{theirs} ({c}))", f"{word}{ours}({b}, {d})"
    word = dice.choice(UNARY_FUTURE + UNARY_PAST)
    a, b = formula(dice, depth - 1)
    return f"({word}{theirs}({a}))", f"{word}{ours}({b})"


def conjunct(left, operator, right, constant):
    """Returns a comparison of `left` with `right` plus a constant, as banquo writes it: always `sum <= number`."""
    sign = 1.0 if operator in ("<", "<=") else -1.0
    parts = [f"{sign}*{left}"] + ([f"{-sign}*{right}"] if right else [])
    return f"{' + '.join(parts)} <= {sign * constant}"


def common(dice, depth):
    """Returns a formula of bounded or unbounded `always` and `eventually`, as three monitors write it."""
    kind = dice.random()
    if depth == 0 or kind < 0.15:
        operator, constant = dice.choice(["<=", ">="]), round(dice.uniform(-2, 2), 1)
        right = dice.choice(["y", None])
        both = f"x {operator} y + {abs(constant)}" if right else f"x {operator} {constant}"
        ours = f"ex:x(ex:a) {operator} " + (f"ex:y(ex:a) + {abs(constant)}" if right else str(constant))
        return f"({both})", ours, conjunct("x", operator, right, abs(constant) if right else constant)
    if kind < 0.4:
        word = dice.choice(["and", "or", "implies"])
        (a, b, c), (d, e, f) = common(dice, depth - 1), common(dice, depth - 1)
        return f"(({a}) {word} ({d}))", f"(({b}) {word} ({e}))", f"(({c}) {word} ({f}))"
    return common_temporal(dice, depth)


def common_temporal(dice, depth):
    start, end = dice.choice([0, 0, 1, 5]), dice.choice([5, 30, 120, 600])
    word = dice.choice(UNARY_FUTURE)
    a, b, c = common(dice, depth - 1)
    return f"({word}[{start}:{end}]({a}))", f"{word}[{start}, {end}]({b})", f"{word}{{{start},{end}}} ({c})"


def cpp_seconds(formulas, signals):
    """Returns the CPU seconds of RTAMT's backend in C++, or the reason why it can't be timed."""
    try:
        import rtamt
        from rtamt.semantics.stl.discrete_time.online.ast_visitor import VariableOperation
        from rtamt.semantics.stl.discrete_time.online.cpp import ast_visitor
    except ImportError as error:
        return str(error)

    # Release 0.4.10 forgets variables in this backend: its own example ends with a KeyError.
    def variable(self, node, *args, **kwargs):
        self.visitChildren(node, *args, **kwargs)
        self.online_operator_dict[node.name] = VariableOperation()

    ast_visitor.StlDiscreteTimeOnlineAstVisitorCpp.visitVariable = variable
    spent, timed = 0.0, 0
    for formula, (x, y) in zip(formulas, signals):
        spec = rtamt.StlDiscreteTimeOnlineSpecificationCpp()
        for name in ["x", "y", "out"]:
            spec.declare_var(name, "float")
        spec.spec = f"out = {formula}"
        try:
            spec.parse()
            spec.pastify()
        except rtamt.RTAMTException:
            continue
        names = [name for name in "xy" if re.search(rf"\b{name}\b", formula)]
        samples = [[(name, value) for name, value in zip("xy", pair) if name in names] for pair in zip(x, y)]
        started = time.process_time()
        for at, sample in enumerate(samples):
            spec.update(at, sample)
        spent += time.process_time() - started
        timed += 1
    return f"{spent:.3f} s for {timed} formulas"


def banquo_seconds(formulas, signals, robustness):
    """Returns the CPU seconds of banquo, or the reason why it can't be timed."""
    try:
        import banquo
        from banquo import stl
    except ImportError as error:
        return str(error)
    spent, unequal = 0.0, 0
    for formula, (x, y), wanted in zip(formulas, signals, robustness):
        trace = banquo.Trace({float(at): {"x": a, "y": b} for at, (a, b) in enumerate(zip(x, y))})
        parsed = stl.parse(formula)
        started = time.process_time()
        found = banquo.evaluate(parsed, trace)
        spent += time.process_time() - started
        unequal += wanted is not None and abs(found - wanted) > 1e-9
    return f"{spent:.3f} s for {len(formulas)} formulas, {unequal} with another robustness"


def looks_back(text):
    return text.startswith(("historically", "once", "since"))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--cases", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--samples", type=int, default=0, help="number of samples of each signal; 0: 2 to 40")
    parser.add_argument("--common", action="store_true", help="only formulas that banquo reads, too")
    parser.add_argument("--seconds", action="store_true")
    args = parser.parse_args()
    import rtamt

    dice = random.Random(args.seed)
    spent = 0.0
    formulas, others, signals, found = [], [], [], []
    for _ in range(args.cases):
        depth = dice.randrange(1, 6)
        theirs, ours, other = common_temporal(dice, depth) if args.common else (*temporal(dice, depth), None)
        count = args.samples or dice.randrange(2, 41)
        x, y = ([round(dice.uniform(-2, 2), 2) for _ in range(count)] for _ in "xy")
        spec = rtamt.StlDiscreteTimeSpecification()
        spec.declare_var("x", "float")
        spec.declare_var("y", "float")
        spec.declare_var("out", "float")
        spec.spec = f"out = {theirs}"
        spec.parse()
        started = time.process_time()
        values = spec.evaluate({"time": list(range(count)), "x": list(x), "y": list(y)})
        spent += time.process_time() - started
        robustness = values[-1 if looks_back(ours) else 0][1]
        if math.isinf(robustness):
            robustness = None
        print(json.dumps({"formula": ours, "x": x, "y": y, "robustness": robustness}))
        formulas.append(theirs)
        others.append(other)
        signals.append((x, y))
        found.append(robustness)
    if args.seconds:
        print(f"RTAMT: {spent:.3f} s for {args.cases} formulas", file=sys.stderr)
        print(f"RTAMT in C++: {cpp_seconds(formulas, signals)}", file=sys.stderr)
        if args.common:
            print(f"banquo: {banquo_seconds(others, signals, found)}", file=sys.stderr)


if __name__ == "__main__":
    main()
