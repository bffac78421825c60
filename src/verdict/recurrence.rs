//! Compares the failures of a scene that is run again with those expected.

use std::collections::BTreeSet;

use actcheck_base::{Judgement, Outcome, names};

/// How the failures of a scene compare with the expected ones. Properties are identified by their
/// local names.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Recurrence {
    /// Exactly the expected properties fail. If none is expected, none fails.
    AsBefore,
    /// Failures were expected, and no property fails.
    NoLonger,
    /// The failed properties differ from the expected ones. Holds the failed properties.
    Otherwise(BTreeSet<String>),
    /// No property fails, but these are undecided or no longer exist.
    Undecided(BTreeSet<String>),
}

impl Recurrence {
    /// Compares the properties expected to fail with the judgements of all actions.
    pub fn of<'a>(
        expected: &BTreeSet<String>,
        judgements: impl Iterator<Item = &'a Judgement>,
    ) -> Self {
        let (mut failed, mut undecided, mut decided) =
            (BTreeSet::new(), BTreeSet::new(), BTreeSet::new());
        for judgement in judgements {
            let name = names::local(&judgement.property).to_owned();
            match judgement.outcome {
                Outcome::Failed => failed.insert(name),
                Outcome::Passed | Outcome::Inapplicable => decided.insert(name),
                Outcome::Broken | Outcome::Timeout | Outcome::Untested => undecided.insert(name),
            };
        }
        if !failed.is_empty() {
            return if failed == *expected {
                Self::AsBefore
            } else {
                Self::Otherwise(failed)
            };
        }
        let gone = expected
            .iter()
            .filter(|name| !decided.contains(*name))
            .cloned();
        undecided.extend(gone);
        match undecided.is_empty() {
            false => Self::Undecided(undecided),
            true if decided.is_empty() => Self::Undecided(undecided),
            true if expected.is_empty() => Self::AsBefore,
            true => Self::NoLonger,
        }
    }

    /// Returns the name used in reports.
    pub fn word(&self) -> &'static str {
        match self {
            Self::AsBefore => "as before",
            Self::NoLonger => "no longer",
            Self::Otherwise(_) => "otherwise",
            Self::Undecided(_) => "undecided",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Properties expected to fail, outcome of each property, and the resulting recurrence.
    type Row = (
        &'static [&'static str],
        &'static [(&'static str, Outcome)],
        Recurrence,
    );

    fn recurrence(expected: &[&str], outcomes: &[(&str, Outcome)]) -> Recurrence {
        let judgements: Vec<Judgement> = outcomes
            .iter()
            .map(|(name, outcome)| Judgement {
                property: format!("http://actions#{name}"),
                outcome: *outcome,
                margin: None,
                witness: String::new(),
                rule_digest: String::new(),
                held_before: None,
                vacuous: None,
            })
            .collect();
        Recurrence::of(&set(expected), judgements.iter())
    }

    fn set(names: &[&str]) -> BTreeSet<String> {
        names.iter().map(|name| (*name).to_owned()).collect()
    }

    #[test]
    fn every_kind_of_recurrence_is_distinguished() {
        use Outcome::{Broken, Failed, Inapplicable, Passed};
        let cases: [Row; 9] = [
            (
                &["A"],
                &[("A", Failed), ("B", Passed)],
                Recurrence::AsBefore,
            ),
            (
                &["A"],
                &[("A", Passed), ("B", Passed), ("A", Failed)],
                Recurrence::AsBefore,
            ),
            (
                &["A"],
                &[("A", Passed), ("B", Passed)],
                Recurrence::NoLonger,
            ),
            (
                &["A"],
                &[("A", Inapplicable), ("B", Passed)],
                Recurrence::NoLonger,
            ),
            (
                &["A"],
                &[("A", Failed), ("B", Failed)],
                Recurrence::Otherwise(set(&["A", "B"])),
            ),
            (&[], &[("A", Failed)], Recurrence::Otherwise(set(&["A"]))),
            (&[], &[("A", Passed)], Recurrence::AsBefore),
            (
                &["A"],
                &[("A", Broken), ("B", Broken)],
                Recurrence::Undecided(set(&["A", "B"])),
            ),
            (
                &["Gone"],
                &[("A", Passed)],
                Recurrence::Undecided(set(&["Gone"])),
            ),
        ];
        for (expected, outcomes, recurs) in cases {
            assert_eq!(
                recurrence(expected, outcomes),
                recurs,
                "{expected:?} {outcomes:?}"
            );
        }
        assert_eq!(recurrence(&[], &[]), Recurrence::Undecided(set(&[])));
    }
}
