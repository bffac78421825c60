//! `list --where`: conditions on the columns of the table of outcomes.

use std::collections::BTreeSet;

use crate::chosen::is_meant;
use crate::option_fault::OptionFault;
use actcheck_analysis::{Column, ColumnKind, Mirror, OutcomeTable, TableFilter, columns};
use actcheck_base::{Diagnostics, Outcome, did_you_mean, names};
use actcheck_history::History;

/// The operators, longer ones first.
const OPERATORS: [&str; 6] = ["<=", ">=", "!=", "=", "<", ">"];

/// A condition on one column.
#[derive(Debug, Clone, PartialEq)]
pub struct Condition {
    column: &'static str,
    operator: &'static str,
    value: Value,
}

/// The value that a column is compared with.
#[derive(Debug, Clone, PartialEq)]
enum Value {
    Number(f64),
    Text(String),
}

impl Condition {
    /// Parses a condition such as `target_mass_kg > 0.3`, `target_category = Glass` or
    /// `reported = true`.
    ///
    /// # Errors
    /// It has no operator, no such column exists, or the value does not fit the column.
    pub fn parse(text: &str) -> Result<Self, OptionFault> {
        let found = text.char_indices().find_map(|(at, _)| {
            let operator = OPERATORS
                .into_iter()
                .find(|operator| text[at..].starts_with(operator))?;
            Some((
                text[..at].trim(),
                operator,
                text[at + operator.len()..].trim(),
            ))
        });
        let (name, operator, value) = found.ok_or_else(|| {
            format!(
                "`{text}` must be a column, one of {}, and a value",
                OPERATORS.join(" ")
            )
        })?;
        let column = columns()
            .iter()
            .find(|column| column.name == name)
            .ok_or_else(|| {
                let help = did_you_mean(name, columns().iter().map(|column| column.name));
                format!("the table of outcomes has no column `{name}`: {help}")
            })?;
        Ok(Self {
            column: column.name,
            operator,
            value: value_of(column, operator, value)?,
        })
    }

    fn holds(&self, table: &OutcomeTable, row: usize) -> bool {
        match &self.value {
            Value::Text(wanted) => {
                let found = table.text(self.column).get(row);
                found.is_some_and(|found| {
                    (found == wanted || names::local(found) == wanted) == (self.operator == "=")
                })
            }
            Value::Number(wanted) => {
                // A missing value is not a number and satisfies no condition.
                let found = table
                    .number(self.column)
                    .get(row)
                    .copied()
                    .filter(|found| !found.is_nan());
                found.is_some_and(|found| match self.operator {
                    "<=" => found <= *wanted,
                    ">=" => found >= *wanted,
                    "!=" => found != *wanted,
                    "=" => found == *wanted,
                    "<" => found < *wanted,
                    _ => found > *wanted,
                })
            }
        }
    }
}

fn value_of(column: &Column, operator: &str, text: &str) -> Result<Value, OptionFault> {
    let text = text.trim_matches(['"', '\'']);
    if text.is_empty() {
        return Err(format!(
            "`{} {operator}` needs a value, such as `{} {operator} 0.3`",
            column.name, column.name
        )
        .into());
    }
    match (column.kind, text.parse::<f64>()) {
        (ColumnKind::Text, _) if matches!(operator, "=" | "!=") => Ok(Value::Text(text.to_owned())),
        (ColumnKind::Text, _) => {
            Err(format!("`{}` is a text: compare it with = or !=", column.name).into())
        }
        (ColumnKind::Bool, _) if matches!(text, "true" | "false") => {
            Ok(Value::Number(f64::from(text == "true")))
        }
        (ColumnKind::Bool, _) => Err(format!("`{}` is true or false", column.name).into()),
        (_, Ok(number)) => Ok(Value::Number(number)),
        (_, Err(_)) => Err(format!("`{}` is a number, but `{text}` is not", column.name).into()),
    }
}

/// Returns the runs with a row of the named properties (or of any) and with the outcome (or any)
/// that satisfies all conditions.
///
/// # Errors
/// The tables beside the history can't be updated or read.
pub fn matching_runs(
    history: &History,
    campaign: Option<&String>,
    properties: &[String],
    outcome: Option<Outcome>,
    conditions: &[Condition],
) -> Result<BTreeSet<String>, Diagnostics> {
    let (mirror, _) = Mirror::update(history)?;
    let filter = TableFilter {
        campaigns: campaign.map(|id| vec![id.clone()]),
        since: None,
    };
    let wanted: Vec<&str> = ["run", "property", "outcome"]
        .into_iter()
        .chain(conditions.iter().map(|condition| condition.column))
        .collect();
    let table = OutcomeTable::read(&mirror, &filter, &wanted)?;
    let text =
        |column: &str, row: usize| table.text(column).get(row).unwrap_or_default().to_owned();
    let is_meant = |row: &usize| {
        (properties.is_empty()
            || properties
                .iter()
                .any(|name| is_meant(&text("property", *row), name)))
            && outcome.is_none_or(|outcome| text("outcome", *row) == outcome.word())
            && conditions
                .iter()
                .all(|condition| condition.holds(&table, *row))
    };
    Ok((0..table.len())
        .filter(is_meant)
        .map(|row| text("run", row))
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn conditions_are_parsed_or_refused_with_a_reason() {
        let number = Condition {
            column: "score",
            operator: "<=",
            value: Value::Number(0.5),
        };
        assert_eq!(Condition::parse("score<=0.5"), Ok(number));
        let text = Condition {
            column: "target_category",
            operator: "!=",
            value: Value::Text("Glass".to_owned()),
        };
        assert_eq!(Condition::parse("target_category != \"Glass\""), Ok(text));
        assert_eq!(
            Condition::parse("reported = true").map(|it| it.value),
            Ok(Value::Number(1.0))
        );
        for (wrong, reason) in [
            ("score", "must be a column"),
            ("scor < 1", "did you mean `score`"),
            ("score < many", "is a number"),
            ("score <", "needs a value"),
            ("target_category < Glass", "is a text"),
            ("reported = 2", "true or false"),
        ] {
            let told = Condition::parse(wrong).expect_err(wrong);
            assert!(told.to_string().contains(reason), "{wrong}: {told}");
        }
    }
}
