//! Results of re-running cases for the terminal.

use crate::CaseSummary;
use actcheck_verdict::Recurrence;

/// Describes the result of one case in words.
pub fn case_text(case: &CaseSummary) -> String {
    let was = listed(&case.expected);
    let result = match &case.recurrence {
        Recurrence::AsBefore if case.expected.is_empty() => "still passes as recorded".to_owned(),
        Recurrence::AsBefore => format!("still fails as recorded: {was}"),
        Recurrence::NoLonger => format!("no longer fails: {was}"),
        Recurrence::Otherwise(now) if case.expected.is_empty() => {
            format!("fails now: {}", listed(now))
        }
        Recurrence::Otherwise(now) => format!("fails differently: {} (was {was})", listed(now)),
        Recurrence::Undecided(what) if what.is_empty() => "nothing was judged".to_owned(),
        Recurrence::Undecided(what) => format!("could not be decided: {}", listed(what)),
    };
    let trace = match case.same_trace {
        Some(true) => "; same trace",
        Some(false) => "; different trace",
        None => "",
    };
    let reason = case
        .reason
        .as_ref()
        .map_or_else(String::new, |reason| format!(" ({reason})"));
    format!("{result}{reason}{trace}\n")
}

/// Summarises a corpus in one line: the number of cases and the ones that need attention. Empty if
/// there are no cases.
pub fn regressions_text(cases: &[CaseSummary]) -> String {
    if cases.is_empty() {
        return String::new();
    }
    let mut groups = Vec::new();
    let mut list_group = |verb: [&str; 2], which: &dyn Fn(&CaseSummary) -> Option<String>| {
        let those: Vec<String> = cases.iter().filter_map(which).collect();
        if !those.is_empty() {
            let verb = verb[usize::from(those.len() != 1)];
            groups.push(format!("{} {verb}: {}", those.len(), those.join(", ")));
        }
    };
    let with = |case: &CaseSummary, what: &str| Some(format!("{} ({what})", case.file));
    list_group(
        ["fails again", "fail again"],
        &|case| match case.recurrence {
            Recurrence::AsBefore if case.fails() => with(case, &listed(&case.expected)),
            _ => None,
        },
    );
    list_group(
        ["fails differently", "fail differently"],
        &|case| match &case.recurrence {
            Recurrence::Otherwise(now) => with(case, &listed(now)),
            _ => None,
        },
    );
    list_group(
        ["could not be decided", "could not be decided"],
        &|case| match &case.recurrence {
            Recurrence::Undecided(what) => {
                with(case, case.reason.as_deref().unwrap_or(&listed(what)))
            }
            _ => None,
        },
    );
    list_group(
        ["no longer fails", "no longer fail"],
        &|case| match case.recurrence {
            Recurrence::NoLonger => with(case, &listed(&case.expected)),
            _ => None,
        },
    );
    let groups = if groups.is_empty() {
        String::new()
    } else {
        format!(", {}", groups.join("; "))
    };
    format!("regressions: {} ran{groups}\n", cases.len())
}

fn listed<'a>(names: impl IntoIterator<Item = &'a String>) -> String {
    names
        .into_iter()
        .map(String::as_str)
        .collect::<Vec<_>>()
        .join(" + ")
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
        let reason = Some("the program `mine` exited with code 3".to_owned());
        let undecided = CaseSummary {
            reason,
            ..case("d.toml", &["A"], Recurrence::Undecided(set(&["A"])))
        };
        assert_eq!(
            regressions_text(&[undecided]),
            "regressions: 1 ran, 1 could not be decided: d.toml (the program `mine` exited with code 3)\n"
        );
        assert_eq!(regressions_text(&[]), "");
        assert_eq!(
            cases.each_ref().map(CaseSummary::exit_code),
            [1, 0, 1, 2, 0]
        );
        let texts = cases.each_ref().map(case_text);
        assert_eq!(texts[0], "still fails as recorded: A\n");
        assert_eq!(texts[2], "fails differently: B + C (was A)\n");
    }
}
