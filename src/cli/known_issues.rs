//! Known issues of a comparison: failure modes that a file accepts until a date.

use std::collections::BTreeSet;
use std::path::Path;

use jiff::civil::Date;

use crate::compare::Side;
use crate::{clock, output};
use actcheck_analysis::{Compared, ComparedRun};
use actcheck_base::{Diagnostic, Diagnostics, Files, Outcome, Source, did_you_mean, names};
use actcheck_config::{Located, Table};
use actcheck_report::KnownIssueRuns;

/// A failure mode that is accepted until a date.
#[derive(Debug, Clone, PartialEq)]
struct KnownIssue {
    /// The properties that fail, and no others: each `Property` or `Action Property`.
    fails: Vec<Located<String>>,
    /// The reason why it is accepted.
    reason: String,
    /// The last day on which it is accepted: `2027-01-31`. Dates are ordered as texts.
    until: Located<String>,
}

/// Reads known issues from a text.
///
/// # Errors
/// C002 to C007 and C009: syntax errors, unknown or missing keys, and wrong values.
fn known_issues(source: &Source) -> Result<Vec<KnownIssue>, Diagnostics> {
    let mut root = Table::parse(source)?;
    root.require(&["issue"]);
    let mut found = Diagnostics::new();
    let mut issues = Vec::new();
    for mut table in root.tables("issue") {
        table.require(&["fails", "reason", "until"]);
        let fails = table.non_empty_strings("fails");
        let reason = table.string("reason");
        let until = table.string("until").filter(|until| {
            let is_date = until
                .value
                .parse::<Date>()
                .is_ok_and(|date| date.to_string() == until.value);
            if !is_date {
                let message = format!("`{}` is not a date", until.value);
                let help = "write year, month and day, such as \"2027-01-31\"";
                table.fault("C006", until.span.clone(), message, help);
            }
            is_date
        });
        if let (Some(fails), Some(reason), Some(until)) = (fails, reason, until) {
            issues.push(KnownIssue {
                fails,
                reason: reason.value,
                until,
            });
        }
        table.finish(&mut found);
    }
    root.finish(&mut found);
    match found.is_empty() {
        true => Ok(issues),
        false => Err(found),
    }
}

/// Reads known issues, and removes the scenes from both sides in which a run of either has one. Those of
/// an expired issue stay; a warning names it.
///
/// # Errors
/// The file can't be read, or has faults; X045 it names a property that was not judged.
pub(super) fn set_apart(
    file: &Path,
    sides: [&mut Side; 2],
) -> Result<Vec<KnownIssueRuns>, Diagnostics> {
    let source = read(file)?;
    let issues = known_issues(&source)?;
    check_names(&source, &issues, &sides)?;
    let today: String = (clock::system().now)().chars().take(10).collect();
    let mut found = Vec::new();
    let mut excused = BTreeSet::new();
    for issue in issues {
        let is_expired = issue.until.value < today;
        if is_expired {
            let message = format!(
                "a known issue expired on {}: {}",
                issue.until.value, issue.reason
            );
            let warning = Diagnostic::warning("X098", message)
                .at(&source, issue.until.span.clone())
                .help("its scenes are compared again; repair it, or give it a later date and the reason for that");
            output::print_diagnostics(&warning.into());
        }
        let runs = sides.each_ref().map(|side| {
            let of_it = side.runs.iter().filter(|run| has(run, &issue));
            of_it
                .inspect(|run| {
                    if !is_expired {
                        excused.insert(run.place);
                    }
                })
                .map(|run| run.run.clone())
                .collect()
        });
        found.push(KnownIssueRuns {
            fails: issue.fails.into_iter().map(|name| name.value).collect(),
            reason: issue.reason,
            until: issue.until.value,
            is_expired,
            runs,
        });
    }
    for side in sides {
        side.runs.retain(|run| !excused.contains(&run.place));
    }
    Ok(found)
}

fn read(file: &Path) -> Result<Source, Diagnostics> {
    Files::Disk.read(file).map_err(|error| {
        Diagnostic::error(
            "C001",
            format!("can't read the known issues {}: {error}", file.display()),
        )
        .help("name a TOML file with `[[issue]]`, as docs/ci.md shows")
        .into()
    })
}

/// Whether exactly the properties of an issue fail in a run.
fn has(run: &ComparedRun, issue: &KnownIssue) -> bool {
    let failed: Vec<(&str, &str)> = run
        .outcomes()
        .iter()
        .filter(|(_, outcome)| **outcome == Outcome::Failed)
        .filter_map(|(of, _)| parts(of))
        .collect();
    let names = |(action, property): &(&str, &str), name: &str| match name.split_once(' ') {
        Some((own, of_it)) => (own, of_it) == (*action, *property),
        None => name == *property,
    };
    let is_named = |of: &(&str, &str)| issue.fails.iter().any(|name| names(of, &name.value));
    !failed.is_empty()
        && failed.iter().all(is_named)
        && issue
            .fails
            .iter()
            .all(|name| failed.iter().any(|of| names(of, &name.value)))
}

/// The names of action and property.
fn parts(of: &Compared) -> Option<(&str, &str)> {
    match of {
        Compared::Property { action, property } => {
            Some((names::local(action), names::local(property)))
        }
        Compared::WholeRun | Compared::Completion => None,
    }
}

fn check_names(
    source: &Source,
    issues: &[KnownIssue],
    sides: &[&mut Side; 2],
) -> Result<(), Diagnostics> {
    let judged: BTreeSet<(&str, &str)> = sides
        .iter()
        .flat_map(|side| &side.runs)
        .flat_map(|run| run.outcomes().keys().filter_map(parts))
        .collect();
    let known: BTreeSet<String> = judged
        .iter()
        .flat_map(|(action, property)| [format!("{action} {property}"), (*property).to_owned()])
        .collect();
    let mut faults = Diagnostics::new();
    for name in issues.iter().flat_map(|issue| &issue.fails) {
        if !known.contains(&name.value) {
            let message = format!("`{}` was not judged in these campaigns", name.value);
            let help = did_you_mean(&name.value, known.iter().map(String::as_str));
            faults.push(
                Diagnostic::error("X045", message)
                    .at(source, name.span.clone())
                    .help(help),
            );
        }
    }
    match faults.is_empty() {
        true => Ok(()),
        false => Err(faults),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn codes(text: &str) -> Vec<String> {
        let read = known_issues(&Source::new("known.toml", text));
        let faults = read.err().unwrap_or_default();
        faults.iter().map(|fault| fault.code.to_string()).collect()
    }

    #[test]
    fn an_issue_has_a_mode_a_reason_and_a_date() {
        let text = "[[issue]]\nfails = [\"Pick CloseObject\", \"MovedObject\"]\nreason = \"slippery\"\nuntil = \"2027-01-31\"\n";
        let issues = known_issues(&Source::new("known.toml", text)).expect("it is well-formed");
        let [issue] = issues.as_slice() else {
            panic!("{issues:?}")
        };
        assert_eq!(issue.fails[0].value, "Pick CloseObject");
        assert_eq!(
            (issue.reason.as_str(), issue.until.value.as_str()),
            ("slippery", "2027-01-31")
        );
    }

    #[test]
    fn all_mistakes_of_a_file_are_reported() {
        let text = "[[issue]]\nfails = []\nreason = \"\"\nuntil = \"31.1.2027\"\n[[issue]]\nfail = [\"A\"]\nuntil = \"2027-1-3\"\n";
        let found = codes(text);
        for code in ["C003", "C005", "C006", "C007"] {
            assert!(
                found.iter().any(|known| known == code),
                "{code} in {found:?}"
            );
        }
        assert_eq!(codes(""), ["C005"]);
        assert_eq!(codes("[[issue"), ["C002"]);
    }
}
