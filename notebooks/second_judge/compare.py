"""Comparison of the second judgement with the stored outcomes."""

from dataclasses import dataclass, field

from .properties import PROPERTIES, judge


@dataclass
class Disagreement:
    """A property of an action with two different outcomes."""

    run: str
    step: int
    property: str
    stored: str
    second: str
    slack: float | None
    reason: str | None

    def __str__(self):
        slack = "" if self.slack is None else f" by {abs(self.slack):.6f}"
        why = self.reason or "unexplained"
        return f"{self.run}/{self.step} {self.property}: stored {self.stored}, judged {self.second}{slack} ({why})"


@dataclass
class Comparison:
    """Agreements and disagreements."""

    agreed: dict = field(default_factory=dict)
    disagreements: list = field(default_factory=list)
    not_judged: dict = field(default_factory=dict)

    def judged(self):
        return sum(sum(outcomes.values()) for outcomes in self.agreed.values()) + len(self.disagreements)

    def unexplained(self):
        return [each for each in self.disagreements if each.reason is None]

    def table(self):
        """Rows of property, agreements by outcome, explained and unexplained disagreements."""
        rows = []
        for name in PROPERTIES:
            wrong = [each for each in self.disagreements if each.property == name]
            explained = sum(each.reason is not None for each in wrong)
            rows.append((name, self.agreed.get(name, {}), explained, len(wrong) - explained))
        return rows


def compare(actions):
    """Judges every default property of the actions anew. Properties of other ontologies are counted, not judged."""
    found = Comparison()
    for action in actions:
        for name, (stored, _) in sorted(action.outcomes.items()):
            if name not in PROPERTIES:
                found.not_judged[name] = found.not_judged.get(name, 0) + 1
                continue
            verdict = judge(action, name)
            if verdict.outcome == stored:
                outcomes = found.agreed.setdefault(name, {})
                outcomes[stored] = outcomes.get(stored, 0) + 1
                continue
            found.disagreements.append(
                Disagreement(action.run.id, action.step, name, stored, verdict.outcome, verdict.slack, verdict.doubt())
            )
    return found
