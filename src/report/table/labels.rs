//! Verdicts beside people's labels as a flat table.

use crate::table::percent_interval;
use crate::{LabelSummary, Table};

/// One row for each property.
pub fn labels_table(summary: &LabelSummary) -> Table {
    let mut table = Table::new([
        "property",
        "labels",
        "agree",
        "interval",
        "passes_only_by_rules",
        "passes_only_by_labels",
        "limit",
        "fitted_limit",
    ]);
    for one in &summary.properties {
        let found = &one.found;
        let fitted = found.fitted.as_ref();
        let fitted = fitted.and_then(|fitted| one.fitted_limit(fitted));
        table.rows.push(vec![
            one.property.as_str().into(),
            found.agreement.of.into(),
            found.agreement.agree.into(),
            percent_interval(found.agreement).into(),
            found.only_rules.into(),
            found.only_labels.into(),
            one.limit.map(|limit| limit.at).into(),
            // In four decimals, as texts have it.
            fitted.map(|limit| (limit * 1e4).round() / 1e4).into(),
        ]);
    }
    table
}
