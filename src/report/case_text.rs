//! Results of re-running cases: whether each scene still fails as recorded.

use serde_json::{Value, json};

use actcheck_verdict::Recurrence;

/// Summary of one case.
#[derive(Debug, Clone, PartialEq)]
pub struct CaseSummary {
    /// The case file's path as displayed.
    pub file: String,
    /// Id of the new run.
    pub run: String,
    /// Names of the properties that failed when the case was recorded.
    pub expected: Vec<String>,
    /// How the new result compares with the recorded one.
    pub recurrence: Recurrence,
    /// Whether the trace is bit-for-bit the same. `None` if the case has no trace hash.
    pub same_trace: Option<bool>,
    /// Why the run did not complete, if it did not.
    pub reason: Option<String>,
}

impl CaseSummary {
    /// Whether any property fails.
    pub fn fails(&self) -> bool {
        match self.recurrence {
            Recurrence::AsBefore => !self.expected.is_empty(),
            Recurrence::Otherwise(_) => true,
            Recurrence::NoLonger | Recurrence::Undecided(_) => false,
        }
    }

    /// 0: nothing fails. 1: a property fails. 2: the case could not be decided.
    pub fn exit_code(&self) -> u8 {
        match self.recurrence {
            Recurrence::Undecided(_) => 2,
            _ => u8::from(self.fails()),
        }
    }
}

/// Describes the result of one case in words.
pub fn case_text(case: &CaseSummary) -> String {
    let was = listed(&case.expected);
    let told = match &case.recurrence {
        Recurrence::AsBefore if case.expected.is_empty() => "still passes as recorded".to_owned(),
        Recurrence::AsBefore => format!("still fails as recorded: {was}"),
        Recurrence::NoLonger => format!("no longer fails: {was}"),
        Recurrence::Otherwise(now) if case.expected.is_empty() => format!("fails now: {}", listed(now)),
        Recurrence::Otherwise(now) => format!("fails differently: {} (was {was})", listed(now)),
        Recurrence::Undecided(what) if what.is_empty() => "nothing was judged".to_owned(),
        Recurrence::Undecided(what) => format!("could not be decided: {}", listed(what)),
    };
    let trace = match case.same_trace {
        Some(true) => "; same trace",
        Some(false) => "; different trace",
        None => "",
    };
    let reason = case.reason.as_ref().map_or_else(String::new, |reason| format!(" ({reason})"));
    format!("{told}{reason}{trace}\n")
}

/// Summarises a corpus in one line: the number of cases and the ones that need attention. Empty if there are no cases.
pub fn regressions_text(cases: &[CaseSummary]) -> String {
    if cases.is_empty() {
        return String::new();
    }
    let mut told = Vec::new();
    let mut tell = |verb: [&str; 2], which: &dyn Fn(&CaseSummary) -> Option<String>| {
        let those: Vec<String> = cases.iter().filter_map(which).collect();
        if !those.is_empty() {
            let verb = verb[usize::from(those.len() != 1)];
            told.push(format!("{} {verb}: {}", those.len(), those.join(", ")));
        }
    };
    let with = |case: &CaseSummary, what: &str| Some(format!("{} ({what})", case.file));
    tell(["fails again", "fail again"], &|case| match case.recurrence {
        Recurrence::AsBefore if case.fails() => with(case, &listed(&case.expected)),
        _ => None,
    });
    tell(["fails differently", "fail differently"], &|case| match &case.recurrence {
        Recurrence::Otherwise(now) => with(case, &listed(now)),
        _ => None,
    });
    tell(["could not be decided", "could not be decided"], &|case| match &case.recurrence {
        Recurrence::Undecided(what) => with(case, &listed(what)),
        _ => None,
    });
    tell(["no longer fails", "no longer fail"], &|case| match case.recurrence {
        Recurrence::NoLonger => with(case, &listed(&case.expected)),
        _ => None,
    });
    let told = if told.is_empty() { String::new() } else { format!(", {}", told.join("; ")) };
    format!("regressions: {} ran{told}\n", cases.len())
}

fn listed<'a>(names: impl IntoIterator<Item = &'a String>) -> String {
    names.into_iter().map(String::as_str).collect::<Vec<_>>().join(" + ")
}

/// Returns the result of one case as JSON.
pub fn case_json(case: &CaseSummary) -> Value {
    let (failed, undecided) = match &case.recurrence {
        Recurrence::AsBefore => (case.expected.iter().collect::<Vec<_>>(), Vec::new()),
        Recurrence::NoLonger => (Vec::new(), Vec::new()),
        Recurrence::Otherwise(now) => (now.iter().collect(), Vec::new()),
        Recurrence::Undecided(what) => (Vec::new(), what.iter().collect()),
    };
    json!({
        "file": case.file, "run": case.run, "expected": case.expected, "recurrence": case.recurrence.word(),
        "failed": failed, "undecided": undecided, "same_trace": case.same_trace, "reason": case.reason,
        "exit_code": case.exit_code(),
    })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    fn case(file: &str, expected: &[&str], recurrence: Recurrence) -> CaseSummary {
        CaseSummary {
            file: file.to_owned(),
            run: "k7f3-1".to_owned(),
            expected: expected.iter().map(|name| (*name).to_owned()).collect(),
            recurrence,
            same_trace: None,
            reason: None,
        }
    }

    fn set(names: &[&str]) -> BTreeSet<String> {
        names.iter().map(|name| (*name).to_owned()).collect()
    }

    #[test]
    fn a_corpus_is_summarised_in_one_line() {
        let cases = [
            case("a.toml", &["A"], Recurrence::AsBefore),
            case("b.toml", &["A"], Recurrence::NoLonger),
            case("c.toml", &["A"], Recurrence::Otherwise(set(&["B", "C"]))),
            case("d.toml", &["A"], Recurrence::Undecided(set(&["A"]))),
            case("e.toml", &[], Recurrence::AsBefore),
        ];
        assert_eq!(
            regressions_text(&cases),
            "regressions: 5 ran, 1 fails again: a.toml (A); 1 fails differently: c.toml (B + C); \
             1 could not be decided: d.toml (A); 1 no longer fails: b.toml (A)\n"
        );
        assert_eq!(regressions_text(&[]), "");
        assert_eq!(cases.each_ref().map(CaseSummary::exit_code), [1, 0, 1, 2, 0]);
        let texts = cases.each_ref().map(case_text);
        assert_eq!(texts[0], "still fails as recorded: A\n");
        assert_eq!(texts[2], "fails differently: B + C (was A)\n");
    }
}
