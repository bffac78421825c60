//! Weighted failure rates of a guided search for the terminal.

use std::fmt::Write as _;

use crate::text::{Page, fitted, ruled};
use crate::{CampaignSummary, GuidedSearch};

/// Writes the weighted rates next to the raw counts. Writes nothing if scenes were sampled at
/// random.
pub(super) fn weighted_text(out: &mut String, summary: &CampaignSummary, page: Page) {
    let Some(GuidedSearch { strategy, lines }) = &summary.search else {
        return;
    };
    let _ = writeln!(
        out,
        "scenes chosen by {strategy} search, which looks for failures: counts and shares of these runs are not failure rates"
    );
    if lines.is_empty() {
        let _ = writeln!(
            out,
            "no generation of scenes is complete, so there are no weighted rates\n"
        );
        return;
    }
    let mut table = ruled();
    table.set_header([
        "test",
        "property",
        "fails in scenes as configured [95 % interval]",
        "runs that failed (not a rate)",
    ]);
    for line in lines {
        let [rate, low, high] =
            [line.failing.rate, line.failing.low, line.failing.high].map(|share| share * 100.0);
        let failing = format!(
            "{rate:.1} % [{low:.1}–{high:.1}] (weighted, {} scenes)",
            line.scenes
        );
        let raw = line
            .raw
            .map_or_else(String::new, |raw| format!("{} of {}", raw.count, raw.of));
        table.add_row([line.test.clone(), line.label.clone(), failing, raw]);
    }
    let _ = writeln!(out, "{}", fitted(table, page, &["test"]));
}
