//! Verdicts beside people's labels, for the terminal.

use std::fmt::Write as _;

use crate::summary::label_word;
use crate::table::labels_table;
use crate::text::Page;
use crate::{LabelSummary, LabelledProperty, TableFormat};
use actcheck_analysis::FittedLimit;

/// Maximum number of contradicting labels of a property; `--format json` has all.
const MAX_LISTED: usize = 10;

/// Formats the agreement of each property, limits that fit better, and the likeliest wrong labels.
pub fn labels_text(summary: &LabelSummary, page: Page) -> String {
    let mut out = labels_table(summary).render(TableFormat::Table, page);
    for one in &summary.properties {
        if let Some(fitted) = &one.found.fitted {
            let _ = writeln!(out, "\n{}", proposal(one, fitted));
        }
        let contradicting = &one.found.contradicting;
        if contradicting.is_empty() {
            continue;
        }
        let _ = writeln!(
            out,
            "\n{}: {} labels contradict the verdict; those of the surest verdicts first, which are the likeliest wrong labels",
            one.property,
            contradicting.len()
        );
        for run in contradicting.iter().take(MAX_LISTED) {
            let margin = run
                .margin
                .map_or_else(String::new, |margin| format!(", margin {margin:+.4}"));
            let _ = writeln!(
                out,
                "  {}: labelled {}{margin}",
                run.run,
                label_word(run.label)
            );
        }
        let more = contradicting.len().saturating_sub(MAX_LISTED);
        if more > 0 {
            let _ = writeln!(out, "  and {more} more: `--format json` has all");
        }
    }
    page.set(&out)
}

/// How a fitted limit differs from the present one.
fn proposal(one: &LabelledProperty, fitted: &FittedLimit) -> String {
    let figures = format!(
        "agreement with the {} labels that it was not fitted to: {} instead of {} (p = {:.4})",
        fitted.held_out, fitted.confirmed[1], fitted.confirmed[0], fitted.test.second_worse
    );
    match one.limit.zip(one.fitted_limit(fitted)) {
        Some((limit, better)) => format!(
            "{}: the limit {better:.4} fits the labels better than {}; {figures}",
            one.property, limit.at
        ),
        None => format!(
            "{}: the labels fit better if it passes from a margin of {:+.4} on; {figures}",
            one.property, fitted.margin
        ),
    }
}
