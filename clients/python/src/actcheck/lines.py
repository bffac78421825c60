"""The output of the package's commands: a line of JSON for each episode, which actcheck reads."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any


def print_lines(lines: Iterable[dict[str, Any]]) -> int:
    """Prints each line at once. Returns the exit code: 1 if a line has the `reason` of a fault, otherwise 0."""
    faults = 0
    for line in lines:
        faults += "reason" in line
        print(json.dumps(line), flush=True)
    return 1 if faults else 0
