//! Diagnostics of the user's input: a code, a message, the place, and a help text.

use std::fmt;

use crate::{Source, Span};

/// Severity of a diagnostic.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The command continues.
    Warning,
    /// The input is rejected.
    Error,
}

/// A diagnostic: the problem, its place and the remedy.
///
/// Messages are lower-case sentences without a full stop. Codes are stable: a letter for the
/// stage (`C` config, `O` ontology, `S` scenario, `W` world and models, `R` rules, `H` history,
/// `A` analysis, `X` command line) and three digits. `actcheck explain` explains each; a new code
/// needs its explanation in `src/cli/codes`.
#[derive(Debug, Clone)]
pub struct Diagnostic {
    /// Stable code, such as `C003`.
    pub code: &'static str,
    /// Whether the input is rejected.
    pub severity: Severity,
    /// The problem.
    pub message: String,
    /// The text with the problem, if any.
    pub source: Option<Source>,
    /// The place in `source`.
    pub span: Option<Span>,
    /// The remedy.
    pub help: Option<String>,
}

impl Diagnostic {
    /// Creates an error without a place.
    pub fn error(code: &'static str, message: impl Into<String>) -> Self {
        Self {
            code,
            severity: Severity::Error,
            message: readable(message.into()),
            source: None,
            span: None,
            help: None,
        }
    }

    /// Creates a warning without a place.
    pub fn warning(code: &'static str, message: impl Into<String>) -> Self {
        Self {
            severity: Severity::Warning,
            ..Self::error(code, message)
        }
    }

    /// Adds a place in a text.
    #[must_use]
    pub fn at(mut self, source: &Source, span: Span) -> Self {
        self.source = Some(source.clone());
        self.span = Some(span);
        self
    }

    /// Adds a file, if the place in it is unknown.
    #[must_use]
    pub fn in_source(mut self, source: &Source) -> Self {
        self.source = Some(source.clone());
        self
    }

    /// Adds a help text.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// Returns `file:line:column`, or only the file if the span is unknown, or `None` without a
    /// file.
    pub fn place(&self) -> Option<String> {
        let source = self.source.as_ref()?;
        Some(match &self.span {
            Some(span) => {
                let (line, column) = source.line_and_column(span.start);
                format!("{}:{line}:{column}", source.name)
            }
            None => source.name.to_string(),
        })
    }
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Diagnostic {}

/// Truncates a message, because it may quote a name of several megabytes.
fn readable(mut message: String) -> String {
    if let Some((end, _)) = message.char_indices().nth(LONGEST_MESSAGE) {
        message.truncate(end);
        message.push('…');
    }
    message
}

/// Longest message. Unit: characters. A contradiction's proof or a cycle of rules takes a few
/// thousand.
const LONGEST_MESSAGE: usize = 20_000;
/// Longest part of a text shown before a span, in it, and after it. Unit: bytes.
const MOST_SHOWN: usize = 300;

impl miette::Diagnostic for Diagnostic {
    fn code<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        Some(Box::new(self.code))
    }

    fn severity(&self) -> Option<miette::Severity> {
        Some(match self.severity {
            Severity::Warning => miette::Severity::Warning,
            Severity::Error => miette::Severity::Error,
        })
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.help
            .as_ref()
            .map(|help| Box::new(help) as Box<dyn fmt::Display>)
    }

    fn source_code(&self) -> Option<&dyn miette::SourceCode> {
        // Without a span there is nothing to underline; the message names the file instead.
        self.span.as_ref()?;
        self.source
            .as_ref()
            .map(|source| source as &dyn miette::SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = miette::LabeledSpan> + '_>> {
        let (span, source) = (self.span.clone()?, self.source.as_ref()?);
        let end = source.boundary(span.end.min(span.start.saturating_add(MOST_SHOWN)));
        Some(Box::new(std::iter::once(miette::LabeledSpan::at(
            span.start..end.max(span.start),
            "here",
        ))))
    }
}

impl miette::SourceCode for Source {
    fn read_span<'a>(
        &'a self,
        span: &miette::SourceSpan,
        context_lines_before: usize,
        context_lines_after: usize,
    ) -> Result<Box<dyn miette::SpanContents<'a> + 'a>, miette::MietteError> {
        let contents =
            self.text
                .as_ref()
                .read_span(span, context_lines_before, context_lines_after)?;
        let whole = contents.span().offset()..contents.span().offset() + contents.data().len();
        let (mut shown, mut line, mut column) = (whole.clone(), contents.line(), contents.column());
        if whole.len() > 3 * MOST_SHOWN {
            // A line of several megabytes takes minutes to draw: show only the surroundings of the
            // span.
            shown.start = self
                .boundary(span.offset().saturating_sub(MOST_SHOWN))
                .max(whole.start);
            shown.end = self
                .boundary(span.offset() + span.len() + MOST_SHOWN)
                .min(whole.end);
            let cut = &self.text[whole.start..shown.start];
            line += cut.matches('\n').count();
            column = cut
                .rfind('\n')
                .map_or(column + cut.len(), |idx| cut.len() - idx - 1);
        }
        Ok(Box::new(miette::MietteSpanContents::new_named(
            self.name.to_string(),
            &self.text.as_bytes()[shown.clone()],
            (shown.start, shown.len()).into(),
            line,
            column,
            contents.line_count(),
        )))
    }
}

/// The diagnostics of one or more inputs, in the order in which they were found.
#[derive(Debug, Clone, Default)]
pub struct Diagnostics {
    found: Vec<Diagnostic>,
}

impl Diagnostics {
    /// Creates an empty collection.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a diagnostic.
    pub fn push(&mut self, diagnostic: Diagnostic) {
        self.found.push(diagnostic);
    }

    /// Adds all diagnostics of another collection.
    pub fn extend(&mut self, other: Diagnostics) {
        self.found.extend(other.found);
    }

    /// Whether any diagnostic is an error.
    pub fn has_errors(&self) -> bool {
        self.found.iter().any(|d| d.severity == Severity::Error)
    }

    /// Whether the collection is empty.
    pub fn is_empty(&self) -> bool {
        self.found.is_empty()
    }

    /// Number of diagnostics.
    pub fn len(&self) -> usize {
        self.found.len()
    }

    /// Iterates over the diagnostics in order.
    pub fn iter(&self) -> std::slice::Iter<'_, Diagnostic> {
        self.found.iter()
    }

    /// Returns `Ok(value)` if there are no errors, otherwise `Err` with all diagnostics. `Ok` drops
    /// warnings.
    pub fn or<T>(self, value: T) -> Result<T, Diagnostics> {
        if self.has_errors() {
            Err(self)
        } else {
            Ok(value)
        }
    }
}

impl From<Diagnostic> for Diagnostics {
    fn from(diagnostic: Diagnostic) -> Self {
        Self {
            found: vec![diagnostic],
        }
    }
}

impl FromIterator<Diagnostic> for Diagnostics {
    fn from_iter<T: IntoIterator<Item = Diagnostic>>(faults: T) -> Self {
        Self {
            found: faults.into_iter().collect(),
        }
    }
}

impl IntoIterator for Diagnostics {
    type Item = Diagnostic;
    type IntoIter = std::vec::IntoIter<Diagnostic>;

    fn into_iter(self) -> Self::IntoIter {
        self.found.into_iter()
    }
}

impl fmt::Display for Diagnostics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for diagnostic in &self.found {
            match diagnostic.place() {
                Some(place) => writeln!(f, "{} {place}: {diagnostic}", diagnostic.code)?,
                None => writeln!(f, "{}: {diagnostic}", diagnostic.code)?,
            }
            if let Some(help) = &diagnostic.help {
                writeln!(f, "  help: {help}")?;
            }
        }
        Ok(())
    }
}

impl std::error::Error for Diagnostics {}
