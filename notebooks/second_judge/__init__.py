"""A second judgement of robot actions, from exported tables alone.

    actcheck export tables DIR --complete --history HISTORY
    python -m second_judge DIR

It judges the default properties of `ontology/actions.ttl` anew from their meaning in words, without the rules, and
compares the result with the stored outcomes. Its purpose is to find wrong rules: where the two disagree, one of them is
wrong, or the reason is stated.
"""

from .compare import Comparison, compare
from .properties import PROPERTIES, Verdict, judge
from .tables import Action, read

__all__ = ["PROPERTIES", "Action", "Comparison", "Verdict", "compare", "judge", "read"]
