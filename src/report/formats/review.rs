//! Formats a comparison in Markdown, for the summary of a job and comments on pull requests.

use std::fmt::Write as _;

use crate::formats::markdown::{code, plain};
use crate::summary::{compared_name, failures_of};
use crate::{CompareSummary, FlipGroup, Review};
use actcheck_analysis::{Answer, Compared, ComparedLine};
use actcheck_base::names;

/// Maximum number of lines of a list; the rest are counted.
const MOST_LISTED: usize = 10;

/// Formats the answer, the rates of each property, the scenes that flipped, and the differences of
/// the inputs.
pub fn review_markdown(review: &Review<'_>) -> String {
    let summary = review.summary;
    let mut out = format!("## actcheck: {}\n\n", plain(&review.headline()));
    for (name, side) in ["A", "B"].into_iter().zip(&summary.sides) {
        let _ = writeln!(
            out,
            "{name}: {} ({}), {} runs, started {}.  ",
            code(&side.campaign),
            plain(&side.config),
            side.runs,
            plain(&side.started)
        );
    }
    let _ = writeln!(out, "\n{} scenes in both.", summary.comparison.pairs);
    rates(summary, &mut out);
    known(summary, &mut out);
    for group in summary.flip_groups() {
        flips(review, &group, &mut out);
    }
    changes(summary, &mut out);
    out
}

fn rates(summary: &CompareSummary, out: &mut String) {
    out.push_str("\n| | A | B | B − A, percent [95 % interval] | only A | only B | answer |\n");
    out.push_str("| --- | ---: | ---: | ---: | ---: | ---: | --- |\n");
    for line in &summary.comparison.lines {
        let [a, b] = line
            .table
            .passed()
            .map(|passed| format!("{passed}/{}", line.table.pairs()));
        let difference = line.difference.as_ref().map_or_else(
            || "none decided".to_owned(),
            |found| {
                let [value, low, high] =
                    [found.value, found.low, found.high].map(|share| 100.0 * share);
                format!("{value:+.1} [{low:+.1}, {high:+.1}]")
            },
        );
        let _ = writeln!(
            out,
            "| {} | {a} | {b} | {} | {} | {} | {} |",
            plain(&compared_name(&line.of)),
            plain(&difference),
            line.table.only_first,
            line.table.only_second,
            answer(summary, line)
        );
    }
}

fn answer(summary: &CompareSummary, line: &ComparedLine) -> String {
    let answer = summary
        .comparison
        .answer_of(line, summary.answer_level(), summary.margin);
    match answer {
        Answer::Worse | Answer::Better => format!("**{}**", answer.word()),
        Answer::Underpowered { .. } => "undecided".to_owned(),
        _ => answer.word().to_owned(),
    }
}

/// The known issues, with the runs that they excuse.
fn known(summary: &CompareSummary, out: &mut String) {
    for issue in &summary.known {
        let [a, b] = issue.runs.each_ref().map(Vec::len);
        let counts = match issue.is_expired {
            true => "expired, so its scenes count",
            false => "its scenes do not count",
        };
        let _ = writeln!(
            out,
            "\nKnown until {} ({counts}): {} fails in {a} runs of A and {b} of B. {}",
            plain(&issue.until),
            plain(&issue.fails.join(", ")),
            plain(&issue.reason)
        );
    }
}

/// The headings of a group of flips.
pub(crate) fn flip_words(group: &FlipGroup<'_>) -> String {
    let listed = |of: &[&Compared]| {
        let names: Vec<String> = of.iter().map(|of| compared_name(of)).collect();
        names.join(", ")
    };
    let scenes = group.runs.len();
    let noun = if scenes == 1 { "scene" } else { "scenes" };
    match (group.worse.is_empty(), group.better.is_empty()) {
        (false, true) => format!("{scenes} {noun} fail in B only: {}", listed(&group.worse)),
        (true, _) => format!("{scenes} {noun} fail in A only: {}", listed(&group.better)),
        (false, false) => format!(
            "{scenes} {noun} fail in another way: {} in B only, {} in A only",
            listed(&group.worse),
            listed(&group.better)
        ),
    }
}

fn flips(review: &Review<'_>, group: &FlipGroup<'_>, out: &mut String) {
    let _ = writeln!(
        out,
        "\n<details><summary>{}</summary>\n",
        plain(&flip_words(group))
    );
    if let Some(origin) = review.origin(group) {
        let _ = writeln!(out, "- {}", plain(&origin));
    }
    for pair in group.runs.iter().take(MOST_LISTED) {
        let (first, second) = pair;
        let _ = writeln!(out, "- {} in A, {} in B", code(first), code(second));
        let Some(known) = review.pairs.get(pair) else {
            continue;
        };
        for (side, run) in ["A", "B"].into_iter().zip(&known.runs) {
            for (action, judgement) in failures_of(&run.detail) {
                let _ = writeln!(
                    out,
                    "  - {side}: {} **{}**: {}",
                    plain(action),
                    plain(names::local(&judgement.property)),
                    plain(&judgement.witness)
                );
            }
        }
        if let Some(found) = &known.divergence {
            let _ = writeln!(out, "  - {}", plain(&found.sentence()));
        }
    }
    let others = group.runs.len().saturating_sub(MOST_LISTED);
    if others > 0 {
        let _ = writeln!(out, "- {others} more");
    }
    out.push_str("\n</details>\n");
}

fn changes(summary: &CompareSummary, out: &mut String) {
    if summary.changes.is_empty() {
        out.push_str(
            "\nProgram, configuration, models, ontology and rules are the same in both.\n",
        );
        return;
    }
    out.push_str("\n<details><summary>Differences of A and B</summary>\n\n");
    for change in &summary.changes {
        let _ = writeln!(out, "- {} {}", change.kind, plain(&change.name));
    }
    let [first, second] = summary.config_lines();
    for (sign, lines) in [("−", &first), ("+", &second)] {
        for line in lines {
            let _ = writeln!(out, "  - {sign} {}", code(line));
        }
    }
    out.push_str("\n</details>\n");
}
