//! Descriptions and examples of expected values, for messages.

use std::fmt::Display;
use std::ops::{Bound, RangeBounds};

/// Describes bounds, as in "a number of at least 0 and at most 1". Bounds at or beyond `unlimited`
/// are omitted.
pub(super) fn in_words<T: PartialOrd + Display>(
    what: &str,
    bounds: &impl RangeBounds<T>,
    unlimited: &T,
) -> String {
    let low = match bounds.start_bound() {
        Bound::Included(low) => Some(format!("of at least {low}")),
        Bound::Excluded(low) => Some(format!("above {low}")),
        Bound::Unbounded => None,
    };
    let high = match bounds.end_bound() {
        Bound::Included(high) | Bound::Excluded(high) if high >= unlimited => None,
        Bound::Included(high) => Some(format!("at most {high}")),
        Bound::Excluded(high) => Some(format!("below {high}")),
        Bound::Unbounded => None,
    };
    match (low, high) {
        (Some(low), Some(high)) => format!("{what} {low} and {high}"),
        (Some(one), None) | (None, Some(one)) => format!("{what} {one}"),
        (None, None) => what.to_owned(),
    }
}

/// Returns an example of the expected value.
pub(super) fn example(key: &str, expected: &str) -> String {
    let value = match expected {
        text if text.contains("list of lists") => "[[\"…\"], [\"…\", \"…\"]]",
        text if text.contains("list of strings") => "[\"…\", \"…\"]",
        text if text.contains("list of tables") => {
            return format!("write one `[[{key}]]` header for each");
        }
        text if text.contains("range of whole") => "[1, 4]",
        text if text.contains("range of") => "[0.8, 1.2]",
        text if text.contains("list of 2") => "[0.1, 0.2]",
        text if text.contains("list of") => "[0.1, 0.2, 0.3]",
        text if text.contains("whole number") => "3",
        text if text.contains("number") => "0.5",
        text if text.contains("table") => return format!("write it as a table: `[{key}]`"),
        text if text.contains("true") => "true",
        _ => "\"…\"",
    };
    format!("write it like `{key} = {value}`")
}

/// Returns a text as a string of TOML.
pub fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}
