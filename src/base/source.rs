//! Source texts, and places in them.

use std::ops::Range;
use std::sync::Arc;

/// Range of a source text. Unit: bytes from the start, end exclusive.
pub type Span = Range<usize>;

/// A text with its name (usually the path as the user gave it).
///
/// Cheap to clone: both parts are shared.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Source {
    /// Path or title, as it appears in messages.
    pub name: Arc<str>,
    /// The whole text.
    pub text: Arc<str>,
}

/// A place in a text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SourceSpan {
    /// The text.
    pub source: Source,
    /// The place in it.
    pub span: Span,
}

impl Default for SourceSpan {
    /// A place in no text.
    fn default() -> Self {
        Self {
            source: Source::new("", ""),
            span: 0..0,
        }
    }
}

impl Source {
    /// Creates a source from its name and text.
    pub fn new(name: impl Into<Arc<str>>, text: impl Into<Arc<str>>) -> Self {
        Self {
            name: name.into(),
            text: text.into(),
        }
    }

    /// Returns the line and column of a byte offset. Both count from 1; columns count characters.
    pub fn line_and_column(&self, offset: usize) -> (usize, usize) {
        let before = &self.text[..self.boundary(offset)];
        let line = before.matches('\n').count() + 1;
        let start_of_line = before.rfind('\n').map_or(0, |idx| idx + 1);
        (line, before[start_of_line..].chars().count() + 1)
    }

    /// Returns the start of the character at or before a byte offset.
    pub(super) fn boundary(&self, offset: usize) -> usize {
        let mut end = offset.min(self.text.len());
        while !self.text.is_char_boundary(end) {
            end -= 1;
        }
        end
    }
}
