//! The runs that count in rates: each trace once, and no run whose scene was selected because it
//! failed.

use std::collections::BTreeSet;
use std::sync::LazyLock;

use regex::Regex;

use crate::{History, RELATED, RunFilter, RunRow};
use actcheck_base::Diagnostics;

/// Name prefix of campaigns that ran the failed runs of another campaign again.
pub const FAILED_AGAIN: &str = "failed runs of ";

/// The beginning of the table `case` in the text of a configuration, for each line.
const CASE: &str = r"^[ \t]*(\[[ \t]*case[ \t]*(\]|\.)|case[ \t]*(\.|=))";

static IS_CASE: LazyLock<Option<Regex>> = LazyLock::new(|| Regex::new(&format!("(?m){CASE}")).ok());

/// Returns the ids of the runs that count in rates over `runs`, which are sorted by time: of runs
/// with bit-identical traces only the newest counts, because the others add no evidence.
pub fn newest_of_alike(runs: &[RunRow]) -> BTreeSet<String> {
    let mut seen = BTreeSet::new();
    // A run without a hash (broken before its first state) is never a duplicate.
    let newest = runs
        .iter()
        .rev()
        .filter(|run| run.trace_hash.is_empty() || seen.insert(&run.trace_hash));
    newest.map(|run| run.run.clone()).collect()
}

/// The function of our own in queries.
const COUNTS: &str = "act:counts(";

/// A query for other stores: calls of the function `act:counts` are replaced by expressions of
/// SPARQL 1.1 with the same meaning. Lines keep their numbers. Calls whose argument is not a
/// variable are kept.
pub fn without_counts(query: &str) -> String {
    let (mut written, mut rest) = (String::new(), query);
    while let Some(at) = rest.find(COUNTS) {
        let (before, call) = rest.split_at(at);
        written.push_str(before);
        let argument = call[COUNTS.len()..].split_once(')');
        let variable = argument
            .map(|(text, after)| (text.trim(), after))
            .filter(|(text, _)| is_variable(text));
        match variable {
            Some((variable, after)) => {
                written.push_str(&counts(variable));
                rest = after;
            }
            None => {
                written.push_str(COUNTS);
                rest = &call[COUNTS.len()..];
            }
        }
    }
    written + rest
}

fn is_variable(text: &str) -> bool {
    text.strip_prefix(['?', '$']).is_some_and(|name| {
        !name.is_empty()
            && name
                .chars()
                .all(|letter| letter.is_alphanumeric() || letter == '_')
    })
}

/// The definition of [`History::counted_runs`] as an expression.
fn counts(run: &str) -> String {
    let campaigns_after = "?ac_n2 > ?ac_n1";
    let runs_after = format!("?ac_i2 > ?ac_i1 || (?ac_i2 = ?ac_i1 && STR(?ac_other) > STR({run}))");
    let newer = format!(
        "{run} act:traceHash ?ac_hash ; act:index ?ac_i1 ; act:campaign ?ac_c1 . ?ac_c1 act:number ?ac_n1 . \
         ?ac_other act:traceHash ?ac_hash ; act:index ?ac_i2 ; act:campaign ?ac_c2 . ?ac_c2 act:number ?ac_n2 . \
         FILTER(?ac_hash != '' && ({campaigns_after} || (?ac_c2 = ?ac_c1 && ({runs_after})))) \
         FILTER NOT EXISTS {{ {} }}",
        is_selected("?ac_c2")
    );
    let selected = format!("{run} act:campaign ?ac_c . {}", is_selected("?ac_c"));
    format!("(NOT EXISTS {{ {selected} }} && NOT EXISTS {{ {newer} }})")
}

/// A pattern on one line that matches if a campaign is one of [`History::selected_campaigns`].
/// `campaign` is a variable.
fn is_selected(campaign: &str) -> String {
    let case = CASE.replace('\\', r"\\");
    format!(
        "{{ ?ac_run act:shrunkFrom ?ac_original ; act:campaign {campaign} }} UNION \
         {{ {campaign} a act:Campaign ; rdfs:label ?ac_name FILTER(STRSTARTS(?ac_name, '{FAILED_AGAIN}') || STRSTARTS(?ac_name, '{RELATED}')) }} UNION \
         {{ {campaign} a act:Campaign ; act:configText ?ac_text FILTER(REGEX(?ac_text, '{case}', 'm')) }}"
    )
}

impl History {
    /// Returns the ids of the campaigns whose scenes are not drawn as the configuration says:
    /// those that hold a shrunk run, those that ran the failed runs of another campaign again or
    /// its scenes with a change, and cases, which have the table `case` in their configuration.
    /// Statistics leave them out.
    ///
    /// # Errors
    /// A file is damaged or can't be read.
    pub fn selected_campaigns(&self) -> Result<BTreeSet<String>, Diagnostics> {
        let mut selected = BTreeSet::new();
        for state in self.stored.states()? {
            let record = &state.record;
            let is_case = || {
                let pattern = IS_CASE.as_ref();
                pattern.is_some_and(|pattern| pattern.is_match(&record.config_text))
            };
            let is_selected = record.name.starts_with(FAILED_AGAIN)
                || record.name.starts_with(RELATED)
                || is_case()
                || self
                    .stored
                    .runs_of(&record.id)?
                    .iter()
                    .any(|run| run.row.is_shrunk);
            if is_selected {
                selected.insert(record.id.clone());
            }
        }
        Ok(selected)
    }

    /// Returns the ids of the runs that count in rates over all campaigns: not those of
    /// [`History::selected_campaigns`], and of runs with bit-identical traces only the newest.
    ///
    /// # Errors
    /// A file is damaged or can't be read.
    pub fn counted_runs(&self) -> Result<BTreeSet<String>, Diagnostics> {
        let selected = self.selected_campaigns()?;
        let mut runs = self.runs(&RunFilter::default())?;
        runs.retain(|run| !selected.contains(&run.campaign));
        Ok(newest_of_alike(&runs))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_calls_with_a_variable_are_replaced() {
        let query = "SELECT * {\n FILTER(?a || act:counts( ?run ) && act:counts(<http://x>))\n}";
        let standard = without_counts(query);
        assert!(
            !standard.contains("counts(") || standard.matches("act:counts(").count() == 1,
            "{standard}"
        );
        assert!(
            standard.contains("act:counts(<http://x>)") && standard.contains("?run act:traceHash"),
            "{standard}"
        );
        assert_eq!(standard.lines().count(), query.lines().count());
        let checked = crate::check_query(&actcheck_base::Source::new("query", standard.as_str()));
        assert!(checked.is_ok(), "{checked:?}");
        assert_eq!(
            without_counts("SELECT * { ?s ?p ?o }"),
            "SELECT * { ?s ?p ?o }"
        );
        assert_eq!(without_counts("act:counts("), "act:counts(");
    }
}
