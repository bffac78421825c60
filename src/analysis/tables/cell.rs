//! A value of the table.

/// A value, or `None` if it is missing.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Cell {
    Text(Option<String>),
    Number(Option<f64>),
    Count(Option<i64>),
    Bool(Option<bool>),
    Bytes(Option<Vec<u8>>),
}

impl Cell {
    pub fn text(text: impl Into<String>) -> Self {
        Self::Text(Some(text.into()))
    }

    pub fn number(number: f64) -> Self {
        Self::Number(Some(number))
    }

    /// Creates a count. Counts above `i64::MAX` saturate.
    pub fn count(count: impl TryInto<i64>) -> Self {
        Self::Count(Some(count.try_into().unwrap_or(i64::MAX)))
    }
}
