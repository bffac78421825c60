"""Judge actions of any simulator or robot by actcheck's rules, in your own program.

```python
judge = actcheck.Judge()
verdict = judge("Pick", before, after, parameters={"pickObject": "cube"})
verdict["ObjectInGripper"].outcome
```

The rules and the outcomes are those of `actcheck recheck`. A quantity that you do not give is missing, and never guessed: a property
that can't be decided without it is `inapplicable`, and `missing` names it.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from actcheck import _judge

#: A state or the events of an action: a dictionary with the keys of the README; numbers may be numpy's.
Values = dict[Any, Any]

MISSING = (
    "actcheck.Judge needs the compiled rules, which this installation lacks: in a checkout of actcheck, "
    "run `make judge`, or write a wheel with `make wheel` and install it"
)


@dataclass(frozen=True)
class Judgement:
    """The outcome of one property."""

    #: Local name, such as `ObjectInGripper`.
    name: str
    #: IRI of the property.
    iri: str
    #: `passed`, `failed`, `inapplicable`, `broken`, `timeout` or `untested`.
    outcome: str
    #: Distance from flipping in the property's unit, positive if it passed; None if it has none.
    margin: float | None
    #: The reason in words.
    witness: str
    #: Facts that the property reads and that were not given. If it is decided, its outcome is certain without them.
    missing: tuple[str, ...]
    #: Whether a passed property held before the action already; None if this says nothing.
    held_before: bool | None
    #: Whether a passed property passed only because no left side of an `implies` held; None if it has none.
    vacuous: bool | None
    #: Digest of the rules that decided.
    rule_digest: str
    _verdict: _judge.Verdict = field(repr=False, compare=False)

    @property
    def passed(self) -> bool:
        """Whether the outcome is `passed`."""
        return self.outcome == "passed"

    def why(self) -> str:
        """Explains the outcome as `actcheck why` does: the proof down to the facts, or the rule that came closest."""
        return self._verdict.why(self.iri)

    def why_not(self, statement: str | None = None) -> str:
        """Explains why the rules do not derive a statement, such as `near_its_place(obj:cube)`; `_` matches any value.

        Without a statement, explains why the property does not hold: the same as `why`.
        """
        return self.why() if statement is None else self._verdict.why_not(self.iri, statement)

    def as_dict(self) -> dict[str, Any]:
        """The judgement as plain values, for JSON or a table."""
        return {
            "property": self.iri,
            "outcome": self.outcome,
            "margin": self.margin,
            "witness": self.witness,
            "missing": list(self.missing),
            "held_before": self.held_before,
            "vacuous": self.vacuous,
        }


class Verdict(Mapping[str, Judgement]):
    """The judgements of one action, by the local names of the properties. True if the action `passed`."""

    def __init__(self, verdict: _judge.Verdict) -> None:
        self._verdict = verdict
        self._judgements: dict[str, Judgement] = {}
        for iri, outcome, margin, witness, missing, held_before, vacuous, digest in verdict.rows():
            name = iri.replace("#", "/").rsplit("/", 1)[-1]
            key = iri if name in self._judgements else name
            self._judgements[key] = Judgement(
                key, iri, outcome, margin, witness, tuple(missing), held_before, vacuous, digest, verdict
            )

    def __getitem__(self, name: str) -> Judgement:
        return self._judgements[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._judgements)

    def __len__(self) -> int:
        return len(self._judgements)

    def __bool__(self) -> bool:
        return self.passed

    def __repr__(self) -> str:
        listed = ", ".join(f"{name}: {judgement.outcome}" for name, judgement in self.items())
        return f"<Verdict {'passed' if self.passed else 'not passed'}: {listed}>"

    @property
    def passed(self) -> bool:
        """Whether every property that could be decided passed, and at least one was decided."""
        return self._verdict.passed()

    @property
    def score(self) -> float:
        """The share of the applicable properties that passed, from 0 to 1: the score of an action in reports."""
        return self._verdict.score()

    def as_dict(self) -> dict[str, Any]:
        """The verdict as plain values, for JSON or a table."""
        judgements = {name: judgement.as_dict() for name, judgement in self.items()}
        return {"passed": self.passed, "score": self.score, "properties": judgements}


class Monitor:
    """Judges an action after every step. `Judge.monitor` makes one.

    A step costs one judgement, and more by the number of steps so far: the course of the action is judged from its begin.
    """

    def __init__(self, monitor: _judge.Monitor) -> None:
        self._monitor = monitor

    def step(self, state: Values, seconds: float, report: bool | tuple[bool, str] | None = None) -> Verdict:
        """Adds the state at a time since the action began, and judges the action as if it ended there.

        Steps have equal lengths. Formulas of the past (`once`, `historically`, `since`) are final with every step; those of the
        future are judged as if the last state lasted. The report is that of the action itself, if it made one.
        """
        if isinstance(report, bool):
            report = (report, "")
        return Verdict(self._monitor.step(state, seconds, report))


class Judge:
    """actcheck's rules, prepared once; call it to judge an action. Threads may share it: judging releases the GIL.

    Without arguments, it has the shipped ontology. `ontology` is the path of another one, or of another shipped one, such as
    `built-in:ontology/time.ttl`. `rules` are properties of your own: rule texts by name, which are added to every action of
    the `ontology`; without one, only these are judged, for an action of any name. A name that ends in `.rq` has a SPARQL query.

    Raises `JudgeError` with every fault of the ontology and the rules, and `ImportError` where the compiled rules are missing.
    """

    def __init__(
        self, ontology: str | os.PathLike[str] | None = None, *, rules: Mapping[str, str] | None = None
    ) -> None:
        try:
            import actcheck._judge as _judge
        except ImportError as error:
            raise ImportError(MISSING) from error
        path = None if ontology is None else os.fspath(ontology)
        self._judge = _judge.Judge(path, list((rules or {}).items()))

    @property
    def actions(self) -> list[str]:
        """Names of the actions."""
        return self._judge.actions()

    def properties(self, action: str) -> list[str]:
        """IRIs of the properties by which an action is judged."""
        return self._judge.properties(action)

    @property
    def warnings(self) -> list[str]:
        """Warnings about the ontology and the rules."""
        return self._judge.warnings()

    def __call__(
        self,
        action: str,
        before: Values,
        after: Values,
        during: Values | None = None,
        parameters: Mapping[str, str | Sequence[str]] | None = None,
    ) -> Verdict:
        """Judges an action by the states before and after it, and by the events during it.

        Raises `JudgeError` with every fault of the values.
        """
        return Verdict(self._judge.judge(action, before, after, during, dict(parameters or {})))

    def monitor(
        self, action: str, before: Values, parameters: Mapping[str, str | Sequence[str]] | None = None
    ) -> Monitor:
        """Begins to judge an action step by step, from the state before it."""
        return Monitor(self._judge.monitor(action, before, dict(parameters or {})))
