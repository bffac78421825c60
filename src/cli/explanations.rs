//! Explanations as rows of a table.

use serde_json::Value;

use actcheck_rules::explain::Explanation;

/// Returns a row: the given columns, then whether the statement holds, its margin, and the
/// explanation's text.
pub(super) fn row(columns: &[&str], explanation: &Explanation) -> Vec<Value> {
    let mut json = explanation.to_json();
    let columns = columns.iter().map(|column| Value::from(*column));
    let found = ["holds", "margin"].map(|key| json[key].take());
    columns
        .chain(found)
        .chain([explanation.to_text().into()])
        .collect()
}
