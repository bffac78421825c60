"""The programs that compare.py runs, their facts, and how each engine writes them.

A rule is a head and a body of atoms and conditions: variables begin with a capital letter, a predicate that begins with
`!` is negated, and a condition such as `J = I + 1` has no parentheses.
"""

import random
import re


def rules(text):
    """Reads rules such as `p(X, Z) :- p(X, Y), e(Y, Z).`, one a line."""
    found = []
    for line in text.strip().splitlines():
        head, _, body = line.strip().rstrip(".").partition(":-")
        # Commas outside of parentheses.
        atoms = [atom.strip() for atom in re.split(r",(?![^(]*\))", body)]
        found.append((head.strip(), [atom for atom in atoms if atom]))
    return found


def graph():
    """A random graph of 2,000 nodes and 6,000 edges: xorshift64, as in benches/rules.rs."""
    state, mask = 88_172_645_463_325_252, (1 << 64) - 1

    def draw():
        nonlocal state
        state ^= (state << 13) & mask
        state ^= state >> 7
        state ^= (state << 17) & mask
        return state % 2_000

    return [(draw(), draw()) for _ in range(6_000)]


def hubs(nodes=3_000, edges=60_000):
    """A graph in which few nodes have most edges."""
    rng = random.Random(1)
    return sorted({tuple(int(nodes * rng.random() ** 3) for _ in range(2)) for _ in range(edges)})


def tree(branches=3, depth=6):
    """Edges from the nodes of a tree to their parents."""
    edges, level = [], [0]
    for _ in range(depth):
        below = []
        for parent in level:
            below += range(len(edges) + 1, len(edges) + 1 + branches)
            edges += [(child, parent) for child in below[-branches:]]
        level = below
    return edges


def pointers(variables=20_000, statements=11_000):
    """Statements of a program with pointers: `x = &y`, `x = y`, `x = *y`, `*x = y`."""
    rng = random.Random(2)

    def near(x):
        return max(0, min(variables - 1, x + rng.randint(-60, 60)))

    def pairs(count):
        starts = [rng.randrange(variables) for _ in range(count)]
        return sorted({(x, near(x)) for x in starts})

    return {"addr": pairs(statements), "assign": pairs(statements), "load": pairs(statements // 8), "store": pairs(statements // 8)}


def memory(scale=1.0):
    """Facts in the shape of Souffle's example hmmer: most statements copy pointers along, some load, few store."""
    rng = random.Random(3)
    count = lambda size: max(1, int(size * scale))
    variables, objects = count(32_000), count(1_900)
    values = range(variables)

    def flow(x):
        return min(variables - 1, int(x + rng.expovariate(1 / 40)) + 1)

    def distinct(size, draw):
        return sorted({draw() for _ in range(size)})

    hub = lambda: int(variables * rng.random() ** 1.5)
    return {
        "directflow": distinct(count(24_000), lambda: (lambda x: (x, flow(x)))(rng.choice(values))),
        "load": distinct(count(11_000), lambda: (rng.choice(values), hub())),
        "store": distinct(count(1_700), lambda: (rng.choice(values), hub())),
        "extreturn": distinct(count(400), lambda: (hub(), rng.choice(values))),
        "escapeptr": [(x,) for x in distinct(count(2_700), hub)],
        "heapalloc": distinct(count(45), lambda: (rng.choice(values), variables + rng.randrange(objects))),
        "stackalloc": distinct(count(274), lambda: (rng.choice(values), variables + rng.randrange(objects))),
        "global": distinct(count(1_000), lambda: (hub(), variables + rng.randrange(objects))),
    }


CLOSURE = """
p(X, Y) :- e(X, Y).
p(X, Z) :- p(X, Y), e(Y, Z)."""
HARMLESS = """
reached(X) :- e(Y, X).
p(X, Y) :- e(X, Y).
p(X, Z) :- p(X, Y), reached(Z), e(Y, Z)."""
GENERATION = """
p(X, Y) :- up(X, Z), up(Y, Z).
p(X, Y) :- up(X, A), up(Y, B), p(A, B)."""
ANDERSEN = """
p(X, Y) :- addr(X, Y).
p(X, Z) :- assign(X, Y), p(Y, Z).
p(X, W) :- load(X, Y), p(Y, Z), p(Z, W).
p(Z, W) :- store(X, Y), p(X, Z), p(Y, W)."""
TRIANGLES = "p(X, Y, Z) :- e(X, Y), e(Y, Z), e(X, Z)."
# A points-to analysis of C: the objects reachable through pointers that escape are not known exactly.
MEMORY = """
lptr(V) :- stackalloc(V, O).
lptr(V) :- heapalloc(V, O).
lptr(V) :- load(U, V).
lptr(V) :- store(U, V).
lptr(V) :- directflow(V, W), lptr(W).
lptr(V) :- directflow(W, V), lptr(W).
isptr(V, O) :- heapalloc(V, O).
isptr(V, O) :- stackalloc(V, O).
isptr(V, O) :- global(V, O).
isptr(V, O) :- directflow(U, V), isptr(U, O).
isptr(V, O) :- load(V, A), isptr(A, M), mem(M, O).
isptr(V, O) :- extreturn(A, V), reach(A, O).
isptr(V, unknown) :- extreturn(A, V).
mem(M, O) :- store(V, A), isptr(V, O), isptr(A, M).
mem(unknown, unknown) :- extreturn(A, V).
reach(V, O) :- isptr(V, O).
reach(V, O) :- mem(M, O), reach(V, M).
open(O) :- escapeptr(V), reach(V, O).
open(unknown) :- extreturn(A, V).
p(V, A) :- load(V, A), isptr(A, O), open(O), lptr(V).
q(V, A) :- store(V, A), isptr(A, O), open(O), lptr(V).
open(O) :- p(U, V), isptr(V, O).
open(O) :- q(U, V), isptr(V, O).
open(O) :- load(V, A), isptr(A, O), !lptr(V).
open(O) :- store(V, A), isptr(A, O), !lptr(V)."""

# Joins by equal and by computed values.
EQUAL = "p(A, B) :- r(A), s(B), A = B."
NEXT = "p(I, J) :- r(I), J = I + 1, s(J)."
BEFORE = "p(I, J) :- r(I), s(J), I = J - 1."
CHAIN = """
p(I) :- first(I).
p(J) :- p(I), J = I + 1, s(J)."""
CHAIN_BEFORE = """
p(I) :- first(I).
p(J) :- p(I), s(J), I = J - 1."""

# DuckDB can't express programs in which several predicates depend on each other.
SQL = {
    "closure": "with recursive p(x, y) as (select * from e union select p.x, e.b from p join e on p.y = e.a) select count(*) from p",
    "closure with a harmless condition": "with recursive reached as (select distinct b from e), p(x, y) as (select * from e union "
    "select p.x, e.b from p, reached, e where p.y = e.a and e.b = reached.b) select count(*) from p",
    "same generation": "with recursive p(x, y) as (select l.a, r.a from up l join up r on l.b = r.b union "
    "select l.a, r.a from p join up l on p.x = l.b join up r on p.y = r.b) select count(*) from p",
    "join by =": "select count(*) from r, s where r.a = s.a",
    "join by the next number": "select count(*) from r, s where s.a = r.a + 1",
    "join by the number before": "select count(*) from r, s where r.a = s.a - 1",
    "triangles": "select count(*) from (select distinct x.a, y.a, y.b from e x, e y, e z where x.b = y.a and z.a = x.a and z.b = y.b)",
}


def tasks():
    """Name, rules and facts by predicate of each program."""
    edges = sorted(set(graph()))
    numbers = [(number,) for number in range(8_000)]
    return [
        ("closure", rules(CLOSURE), {"e": edges}),
        ("closure with a harmless condition", rules(HARMLESS), {"e": edges}),
        ("same generation", rules(GENERATION), {"up": tree()}),
        ("Andersen's points-to", rules(ANDERSEN), pointers()),
        ("triangles", rules(TRIANGLES), {"e": hubs()}),
        ("hmmer-like points-to", rules(MEMORY), memory()),
        ("join by =", rules(EQUAL), {"r": numbers, "s": numbers}),
        ("join by the next number", rules(NEXT), {"r": numbers, "s": numbers}),
        ("join by the number before", rules(BEFORE), {"r": numbers, "s": numbers}),
        ("chain of next numbers", rules(CHAIN), {"first": [(0,)], "s": numbers}),
        ("chain of numbers before", rules(CHAIN_BEFORE), {"first": [(0,)], "s": numbers}),
    ]


def is_condition(atom):
    return "(" not in atom


def arguments(atom):
    """The arguments of an atom, or the variables of a condition."""
    if is_condition(atom):
        return re.findall(r"\b[A-Z]\w*", atom)
    return [part.strip() for part in atom[atom.index("(") + 1 : -1].split(",")]


def arity(atom):
    return len(arguments(atom))


def predicates(program):
    """The arities of the predicates of heads, and of those in bodies only."""
    derived = {head.split("(")[0]: arity(head) for head, _ in program}
    given = {a.lstrip("!").split("(")[0]: arity(a) for _, body in program for a in body if not is_condition(a)}
    return derived, {name: size for name, size in given.items() if name not in derived}


def write_rules(program, negation, end, variable=lambda v: v, constant=lambda c: c, equals="="):
    """Writes rules; a variable that occurs once becomes `_`."""
    lines = []
    for head, body in program:
        used = [v for atom in [head, *body] for v in arguments(atom)]

        def shown(atom):
            if is_condition(atom):
                return re.sub(r"\b[A-Z]\w*", lambda found: variable(found[0]), atom).replace("=", equals)
            name, negated = atom.lstrip("!").split("(")[0], atom.startswith("!")
            args = [
                (variable(v) if used.count(v) > 1 else "_") if v[0].isupper() else constant(v) for v in arguments(atom)
            ]
            return (negation if negated else "") + f"{name}({', '.join(args)})"

        lines.append(f"{shown(head)} :- {', '.join(map(shown, body))}{end}")
    return "\n".join(lines) + "\n"


def write_facts(facts, end):
    return "".join(f"{name}({', '.join(map(str, row))}){end}\n" for name, rows in facts.items() for row in rows)
