//! The options of an import or export: each is known, given once, and of the right kind.

use std::collections::BTreeMap;

use crate::check::checking::Checking;
use crate::check::options::{OptionValue, options};
use crate::model::values::lexical;
use crate::standalone::table::ColumnKind;
use crate::syntax::{Syntax, Transfer};
use actcheck_base::{Diagnostic, Diagnostics, Source, Span, Term, Terms, did_you_mean};

/// The options of one import or export, with their places.
pub(super) struct Settings<'a> {
    source: &'a Source,
    transfer: &'a Transfer,
    values: BTreeMap<String, OptionValue>,
    pub(super) diagnostics: Diagnostics,
}

impl<'a> Settings<'a> {
    /// Computes the options, and reports those that are not `known` or given twice.
    pub(super) fn new(syntax: &'a Syntax, transfer: &'a Transfer, known: &[&str]) -> Self {
        let mut terms = Terms::new();
        let mut checking = Checking::new(&mut terms, None);
        let values = options(&mut checking, syntax, transfer);
        let diagnostics = checking.diagnostics;
        let mut settings = Self {
            source: &syntax.source,
            transfer,
            values,
            diagnostics,
        };
        for (idx, (name, value)) in transfer.options.iter().enumerate() {
            let format = &transfer.format;
            if !known.contains(&name.as_str()) {
                let message = match ALL.contains(&name.as_str()) {
                    true if transfer.import => {
                        format!("an import of `{format}` has no option `{name}`")
                    }
                    true => format!("an export to `{format}` has no option `{name}`"),
                    false => format!("unknown option `{name}`"),
                };
                settings.error(
                    &value.span,
                    message,
                    &did_you_mean(name, known.iter().copied()),
                );
            } else if transfer.options[..idx]
                .iter()
                .any(|(earlier, _)| earlier == name)
            {
                settings.error(
                    &value.span,
                    format!("the option `{name}` is given twice"),
                    "remove one of them",
                );
            }
        }
        settings
    }

    /// Adds an error at a place.
    pub(super) fn error(&mut self, span: &Span, message: String, help: &str) {
        self.diagnostics.push(
            Diagnostic::error("R071", message)
                .at(self.source, span.clone())
                .help(help),
        );
    }

    /// Returns an option's place, or that of the whole statement.
    pub(super) fn span(&self, name: &str) -> Span {
        let option = self
            .transfer
            .options
            .iter()
            .find(|(known, _)| known == name);
        option
            .map_or(&self.transfer.span, |(_, value)| &value.span)
            .clone()
    }

    /// Returns an option's single value. Reports a tuple.
    fn one(&mut self, name: &str, wanted: &str) -> Option<Term> {
        match self.values.get(name)? {
            OptionValue::One(term) => Some(term.clone()),
            OptionValue::Many(_) => {
                self.error(
                    &self.span(name),
                    format!("`{name}` must be {wanted}"),
                    "write a single value",
                );
                None
            }
        }
    }

    /// Returns the text of an option.
    pub(super) fn text(&mut self, name: &str) -> Option<String> {
        match self.one(name, "a text")? {
            Term::String(text) | Term::Iri(text) => Some(text.to_string()),
            other => self.refuse(name, &other, "a text", "write it in quotes"),
        }
    }

    /// Returns the value of an option that is `true` or `false`, and otherwise `false`.
    pub(super) fn flag(&mut self, name: &str) -> Option<bool> {
        let value = self.one(name, "`true` or `false`")?;
        match lexical(&value).as_str() {
            "true" => Some(true),
            "false" => Some(false),
            _ => self.refuse(
                name,
                &value,
                "`true` or `false`",
                "write one of them without quotes",
            ),
        }
    }

    /// Returns the value of an option that is a number of rows.
    pub(super) fn count(&mut self, name: &str) -> Option<usize> {
        let value = self.one(name, "a number of rows")?;
        match value {
            Term::Integer(count) if count >= 0 => {
                Some(usize::try_from(count).unwrap_or(usize::MAX))
            }
            _ => self.refuse(
                name,
                &value,
                "a number of rows",
                "write an integer that is not negative",
            ),
        }
    }

    /// Returns the delimiter between fields: that of the option, or of the format. Reports a
    /// missing one.
    pub(super) fn delimiter(&mut self) -> u8 {
        let usual = if self.transfer.format == "tsv" {
            b'\t'
        } else {
            b','
        };
        if !self
            .transfer
            .options
            .iter()
            .any(|(name, _)| name == "delimiter")
        {
            if self.transfer.format == "dsv" {
                let help = "add `delimiter = \";\"`, or use the format `csv` or `tsv`";
                self.error(
                    &self.transfer.span,
                    "the format `dsv` needs a `delimiter`".to_owned(),
                    help,
                );
            }
            return usual;
        }
        let Some(text) = self.text("delimiter") else {
            return usual;
        };
        match text.as_bytes() {
            [byte] if byte.is_ascii() && !b"\"\n\r".contains(byte) => *byte,
            _ => {
                let help = "it can be any ASCII character except a quote or the end of a line";
                let value = Term::string(text);
                self.refuse::<u8>("delimiter", &value, "one character", help)
                    .unwrap_or(usual)
            }
        }
    }

    /// Returns the stated columns, or `None` if the option `format` is missing or wrong.
    pub(super) fn columns(&mut self) -> Option<Vec<ColumnKind>> {
        let terms = match self.values.get("format")? {
            OptionValue::One(term) => vec![term.clone()],
            OptionValue::Many(terms) => terms.clone(),
        };
        let words: Vec<String> = terms.iter().map(lexical).collect();
        let span = self.span("format");
        if let Some(word) = words
            .iter()
            .find(|word| ColumnKind::from_word(word).is_none())
        {
            let help = did_you_mean(word, ColumnKind::NAMES);
            self.error(&span, format!("unknown column format `{word}`"), &help);
            return None;
        }
        let columns: Vec<ColumnKind> = words
            .iter()
            .filter_map(|word| ColumnKind::from_word(word))
            .collect();
        if columns.iter().all(|column| *column == ColumnKind::Skip) {
            self.error(
                &span,
                "all columns are skipped".to_owned(),
                "import at least one column",
            );
            return None;
        }
        Some(columns)
    }

    /// Reports a wrong value.
    pub(super) fn refuse<T>(
        &mut self,
        name: &str,
        value: &Term,
        wanted: &str,
        help: &str,
    ) -> Option<T> {
        self.error(
            &self.span(name),
            format!("`{name}` must be {wanted}, but is {value}"),
            help,
        );
        None
    }
}

/// All options of any format.
const ALL: [&str; 8] = [
    "resource",
    "format",
    "delimiter",
    "quoting",
    "compression",
    "ignore_headers",
    "limit",
    "base",
];
