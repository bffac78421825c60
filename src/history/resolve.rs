//! Names of runs as people type them.

use crate::{History, Judgements, RunFilter, Wish};
use actcheck_base::{Diagnostic, Diagnostics, Outcome, names, nearest};

/// Name of the last run.
const LAST: &str = "@last";
/// Name of the last run in which a property failed.
const LAST_FAILED: &str = "@last-failed";

/// The id in one of our IRIs; other texts are returned unchanged.
fn short_id(iri: &str) -> &str {
    [names::RUN, names::CAMPAIGN, names::OBJ]
        .iter()
        .find_map(|namespace| iri.strip_prefix(namespace))
        .unwrap_or(iri)
}

impl History {
    /// Returns the id of a run, given its id, its IRI, `run:ID`, a unique prefix, or `@last` for
    /// the last run or `@last-failed` for the last one in which a property failed.
    ///
    /// # Errors
    /// `H008` no run matches, or several do.
    pub fn resolve(&self, name: &str) -> Result<String, Diagnostics> {
        if let LAST | LAST_FAILED = name {
            return self.last(name == LAST_FAILED);
        }
        let name = short_id(name.trim().trim_start_matches('<').trim_end_matches('>'));
        let name = name.strip_prefix("run:").unwrap_or(name);
        if names::is_id(name) && self.has_run(name)? {
            return Ok(name.to_owned());
        }
        let known = self.stored.run_ids()?;
        let beginning: Vec<&String> = known
            .iter()
            .filter(|id| !name.is_empty() && id.starts_with(name))
            .collect();
        let fault = match beginning.as_slice() {
            [only] => return Ok((*only).clone()),
            [] => Diagnostic::error(
                "H008",
                format!("the history `{}` has no run `{name}`", self.dir().display()),
            )
            .help(match nearest(name, known.iter().map(String::as_str)) {
                Some(found) => format!("did you mean `{found}`? `actcheck list` shows all runs"),
                None => "`actcheck list` shows all runs".to_owned(),
            }),
            several => {
                Diagnostic::error("H008", format!("`{name}` matches {} runs", several.len())).help(
                    format!(
                        "name one of them: {}{}",
                        several
                            .iter()
                            .take(5)
                            .map(|id| id.as_str())
                            .collect::<Vec<_>>()
                            .join(", "),
                        if several.len() > 5 { ", …" } else { "" }
                    ),
                )
            }
        };
        Err(fault.into())
    }

    /// The last run of the newest campaign that has one, or the last run in which a property
    /// failed.
    fn last(&self, failed: bool) -> Result<String, Diagnostics> {
        let judgements = if failed {
            Judgements::Newest
        } else {
            Judgements::None
        };
        let mut last = None;
        self.each_judged(
            &RunFilter::default(),
            Wish {
                judgements,
                ..Wish::default()
            },
            &mut |run| {
                if !failed
                    || run
                        .outcomes
                        .iter()
                        .any(|own| own.outcome == Outcome::Failed)
                {
                    last = Some(run.row.run);
                }
            },
        )?;
        let which = if failed {
            "run in which a property failed"
        } else {
            "run"
        };
        last.ok_or_else(|| {
            Diagnostic::error(
                "H008",
                format!("the history `{}` has no {which}", self.dir().display()),
            )
            .help("`actcheck list` shows all runs")
            .into()
        })
    }
}
