//! The fault of an option's value.

/// Why the value of an option can't be used, in words that follow the option's name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct OptionFault(String);

impl From<String> for OptionFault {
    fn from(words: String) -> Self {
        Self(words)
    }
}

impl From<&str> for OptionFault {
    fn from(words: &str) -> Self {
        Self(words.to_owned())
    }
}
