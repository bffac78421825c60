//! The lines of a bisection.

use std::fmt::Write as _;

use super::ends::Ends;
use super::judge::{Judge, Unjudged};
use super::search::{Found, Step};
use super::versions::{Version, Versions};
use actcheck_analysis::{
    Answer, Compared, ComparedLine, ComparedRun, Comparison, Likeness, OutcomeFlip,
};
use actcheck_base::{Diagnostic, Diagnostics, Outcome, names};

/// Maximum number of flips that are listed.
const MOST_FLIPS: usize = 5;
/// Maximum number of lines with rates in a step.
const MOST_RATES: usize = 2;

/// The two lines of the ends.
pub fn ends(versions: &Versions, difference: &str) -> String {
    let [good, bad] = versions.ends();
    format!(
        "good     {}\nbad      {}: {difference}\n",
        good.name, bad.name
    )
}

/// The line of a step. `left` is the number of versions that could be the first one before it.
pub fn step(version: &Version, step: &Step, left: usize) -> String {
    format!(
        "{:<8} {}: {} ({left} left)\n",
        step.word, version.name, step.reason
    )
}

/// The first message of faults, with its place.
pub fn first(faults: &Diagnostics) -> String {
    let Some(fault) = faults.iter().next() else {
        return "unknown".to_owned();
    };
    match (&fault.source, &fault.span) {
        (Some(source), Some(span)) => {
            let line = 1 + source
                .text
                .get(..span.start)
                .map_or(0, |text| text.matches('\n').count());
            format!("{}:{line}: {}", source.name, fault.message)
        }
        (Some(source), None) => format!("{}: {}", source.name, fault.message),
        _ => fault.message.clone(),
    }
}

/// A number with its noun.
pub fn count(number: usize, one: &str, many: &str) -> String {
    format!("{number} {}", if number == 1 { one } else { many })
}

/// The reason for an answer by outcomes.
pub fn outcomes(likeness: Likeness, flips: &[OutcomeFlip], runs: &[ComparedRun]) -> String {
    let outcome = |flip: &OutcomeFlip| {
        let run = runs.iter().find(|run| run.place == flip.place);
        run.map(|run| run.outcomes().get(&flip.of).copied())
    };
    let changed = flips
        .iter()
        .filter(|flip| outcome(flip).is_some_and(|outcome| outcome != flip.outcomes[0]))
        .count();
    match likeness {
        Likeness::First | Likeness::Second => {
            format!(
                "{changed} of {} changed",
                count(flips.len(), "outcome", "outcomes")
            )
        }
        Likeness::Undecided => "its runs are broken, untested or missing".to_owned(),
    }
}

/// The pass rates of some lines of a comparison with the good end.
pub fn rates(comparison: &Comparison, is_shown: impl Fn(&ComparedLine) -> bool) -> String {
    let line = |line: &ComparedLine| {
        let [good, this] = line.table.passed();
        let pairs = line.table.pairs();
        format!(
            "{} passed {this} of {pairs} scenes (good end: {good})",
            subject(&line.of)
        )
    };
    let shown: Vec<String> = comparison
        .lines
        .iter()
        .filter(|line| is_shown(line))
        .map(line)
        .collect();
    let more = shown.len().saturating_sub(MOST_RATES);
    let text = shown
        .into_iter()
        .take(MOST_RATES)
        .collect::<Vec<_>>()
        .join("; ");
    if more > 0 {
        format!("{text}; {more} more")
    } else {
        text
    }
}

fn subject(of: &Compared) -> String {
    match of {
        Compared::WholeRun => "whole runs".to_owned(),
        Compared::Completion => "completion".to_owned(),
        Compared::Property { action, property } => {
            format!("{} {}", names::local(action), names::local(property))
        }
    }
}

/// X064: the ends don't differ, or the bad one is better.
pub fn no_difference(versions: &Versions, answer: Answer, scenes: usize, most: u64) -> Diagnostic {
    let [good, bad] = versions.ends();
    let both = format!("`{}` and `{}`", good.name, bad.name);
    let compared = count(scenes, "scene", "scenes");
    match answer {
        Answer::Better => Diagnostic::error(
            "X064",
            format!("`{}` is better than `{}`", bad.name, good.name),
        )
        .help("swap the ends: `--good` names the version with the better outcomes, older or newer"),
        Answer::Underpowered { scenes: needed } => {
            let needed = needed.map_or("very many".to_owned(), |needed| format!("about {needed}"));
            Diagnostic::error("X064", format!("{both} can't be distinguished in {compared}")).help(format!(
                "{needed} scenes would decide: raise `--most-scenes` (now {most}); or bisect a single case"
            ))
        }
        Answer::Same | Answer::NoDifference | Answer::Worse => {
            Diagnostic::error("X064", format!("{both} don't differ in {compared}"))
                .help("name other ends, another property or other runs")
        }
    }
}

/// The result: the first version, its author and date, the outcomes that it changed, and the proof
/// of one.
pub fn found(
    versions: &Versions,
    ends: &Ends<'_>,
    found: &Found,
    steps: usize,
    judge: &mut Judge<'_>,
) -> Result<String, Diagnostics> {
    let kind = if versions.finds_fix { "good" } else { "bad" };
    let steps = count(steps, "step", "steps");
    let mut text = String::new();
    let (version, before) = match found {
        Found::OneOf(several) => {
            let _ = writeln!(
                text,
                "\nafter {steps}, the first {kind} {} is one of these; the others were skipped:",
                versions.word()
            );
            for version in several {
                let _ = writeln!(text, "  {}", version.name);
            }
            return Ok(text);
        }
        Found::First { version, before } => (version, before),
    };
    let _ = writeln!(
        text,
        "\nafter {steps}, the first {kind} {} is {}",
        versions.word(),
        version.id_or_name()
    );
    if let Some(repository) = versions.repository() {
        let _ = writeln!(text, "  {} ({})", version.name, repository.author(version)?);
    }
    let runs = |judge: &mut Judge<'_>, version| {
        judge
            .runs(version, ends.scenes())
            .map_err(Unjudged::into_faults)
    };
    let (old, new) = (runs(judge, before)?, runs(judge, version)?);
    let flips = ends.relevant_flips(&old, &new);
    let _ = writeln!(
        text,
        "  {} since {}",
        count(flips.len(), "outcome changed", "outcomes changed"),
        before.name
    );
    for flip in flips.iter().take(MOST_FLIPS) {
        let [was, is] = flip
            .outcomes
            .map(|outcome| outcome.map_or("not judged", Outcome::word));
        let _ = writeln!(
            text,
            "    {} {}: {was} → {is}",
            flip.runs[1],
            subject(&flip.of)
        );
    }
    if let Some(more @ 1..) = flips.len().checked_sub(MOST_FLIPS) {
        let _ = writeln!(text, "    {more} more");
    }
    if let Some(flip) = flips.first() {
        let _ = write!(
            text,
            "\n  {} {}\n{}",
            flip.runs[1],
            subject(&flip.of),
            judge.explain(version, &flip.runs[1], &flip.of)?
        );
    }
    Ok(text)
}
