"""Judges exported runs anew: `python -m second_judge DIR`. Exits with 1 if a disagreement is unexplained."""

import sys

from . import compare, read


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    found = compare(read(sys.argv[1]))
    for name, agreed, explained, unexplained in found.table():
        outcomes = ", ".join(f"{count} {outcome}" for outcome, count in sorted(agreed.items())) or "none"
        print(f"{name:20} agree: {sum(agreed.values()):5} ({outcomes}); explained: {explained}; unexplained: {unexplained}")
    for each in found.disagreements:
        print(each)
    for name, count in sorted(found.not_judged.items()):
        print(f"{name}: {count} outcomes not judged")
    sys.exit(1 if found.unexplained() else 0)


if __name__ == "__main__":
    main()
