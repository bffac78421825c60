//! `actcheck list`

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;
use serde_json::Value;

use crate::chosen::{self, is_meant};
use crate::option_fault::OptionFault;
use crate::options::{Format, HistoryArgs};
use crate::where_rows::{Condition, matching_runs};
use crate::{history_dir, output, rules};
use actcheck_base::{Diagnostics, Outcome, did_you_mean, names};
use actcheck_history::{History, JudgedOutcome, Judgements, RunFilter, RunRow, Wish};
use actcheck_report::{Table, shortened};

/// Number of rows that are formatted and printed together.
const ROWS_AT_A_TIME: usize = 10_000;

/// `actcheck list`
#[derive(Debug, Args)]
pub struct ListArgs {
    /// The folder of the history.
    #[command(flatten)]
    pub history: HistoryArgs,
    /// Only the runs of this campaign
    #[arg(long, value_name = "ID")]
    pub campaign: Option<String>,
    /// Only runs in which a property failed
    #[arg(long)]
    pub failed: bool,
    /// Only runs in which this property was judged, by its name in the ontology, and a column with
    /// its outcomes; with `--failed` or `--outcome`, only those in which it has that outcome (may
    /// be given several times)
    #[arg(long, value_name = "P")]
    pub property: Vec<String>,
    /// Only runs in which a property has this outcome: passed, failed, inapplicable, broken,
    /// timeout or untested
    #[arg(long, value_name = "OUTCOME", value_parser = outcome, conflicts_with = "failed")]
    pub outcome: Option<Outcome>,
    /// Only runs with an outcome that satisfies this condition on a column of the table of
    /// outcomes, such as `target_mass_kg > 0.3` or `target_category = Glass` (may be given several
    /// times; `actcheck export tables` writes the table and describes its columns). With
    /// `--property`, `--failed` or `--outcome`, one of these outcomes must satisfy it. Shrunk runs,
    /// cases and failed runs that ran again are not in the table
    #[arg(long = "where", value_name = "COLUMN<VALUE", value_parser = Condition::parse)]
    pub conditions: Vec<Condition>,
    /// List all properties instead: label, language, rule file, actions, and how often each passed
    /// in the history
    #[arg(long, conflicts_with_all = ["campaign", "failed", "property", "outcome", "conditions"])]
    pub rules: bool,
    /// The ontology whose properties are listed [default: ontology/actions.ttl here, or the shipped
    /// one]
    #[arg(long, value_name = "FILE", requires = "rules")]
    pub ontology: Option<PathBuf>,
    /// How the table is printed
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    pub format: Format,
}

impl ListArgs {
    /// Whether the list is one of failures for people, with their reasons. Programs read the values
    /// of runs, which are the same in all lists.
    fn says_why(&self) -> bool {
        self.wanted() == Some(Outcome::Failed) && self.format == Format::Text
    }

    /// The outcome that a run must have.
    fn wanted(&self) -> Option<Outcome> {
        if self.failed {
            Some(Outcome::Failed)
        } else {
            self.outcome
        }
    }
}

/// Returns a run's value in a column.
type Cell = fn(&RunRow) -> Value;

/// Prints one line for each run, or for each property.
pub fn list(args: &ListArgs) -> Result<(), Diagnostics> {
    if args.rules {
        return rules::rules(args);
    }
    let history = history_dir::open_to_read(&args.history)?;
    if let Some(campaign) = &args.campaign {
        history.campaign(campaign)?;
    }
    let filter = RunFilter {
        campaign: args.campaign.clone(),
        ..RunFilter::default()
    };
    let ListedRuns {
        mut runs,
        words,
        failed,
    } = chosen_runs(args, &history, &filter)?;
    if !args.conditions.is_empty() {
        let campaign = args.campaign.as_ref();
        let found = matching_runs(
            &history,
            campaign,
            &args.property,
            args.wanted(),
            &args.conditions,
        )?;
        runs.retain(|row| found.contains(&row.run));
    }
    // A list of failures for people names the failed properties instead of all values.
    let all = !args.says_why();
    // Most campaigns have neither, so empty columns are hidden.
    let repeated = runs.iter().any(|row| row.repetition.is_some());
    let weighted = runs.iter().any(|row| row.weight.is_some());
    let columns: [(&str, bool, Cell); 9] = [
        ("run", true, |row| row.run.as_str().into()),
        ("index", all, |row| row.index.into()),
        ("scene", repeated, |row| {
            row.repetition.map(|repetition| repetition.scene).into()
        }),
        ("repetition", repeated, |row| {
            row.repetition.map(|repetition| repetition.number).into()
        }),
        ("test", true, |row| row.test.as_str().into()),
        ("status", all, |row| row.status.word().into()),
        ("score", all, |row| row.score.into()),
        ("weight", weighted, |row| row.weight.into()),
        ("trace_hash", all, |row| row.trace_hash.as_str().into()),
    ];
    let shown: Vec<_> = columns.into_iter().filter(|(_, shown, _)| *shown).collect();
    let mut table = Table::new(shown.iter().map(|(name, ..)| *name)).with_expendable([
        "trace_hash",
        "index",
        "weight",
        "status",
        "test",
        "score",
    ]);
    if args.says_why() {
        table.columns.extend(["failed", "why"].map(str::to_owned));
    }
    table.columns.extend(
        args.property
            .iter()
            .map(|name| names::local(name).to_owned()),
    );
    let contested = history.contested()?;
    let any_contested = runs.iter().any(|row| contested.contains_key(&row.run));
    if any_contested {
        table.columns.push("contested".to_owned());
    }
    let contested_in = |run: &String| -> Value {
        let names = contested.get(run).into_iter().flatten();
        let names: Vec<&str> = names.map(String::as_str).collect();
        names.join(", ").into()
    };
    let row = |row: &RunRow| -> Vec<Value> {
        let words = words
            .get(&row.run)
            .into_iter()
            .flatten()
            .map(|words| words.as_str().into());
        let contested = any_contested.then(|| contested_in(&row.run));
        let why = args.says_why().then(|| {
            let names = failed.get(&row.run).map_or("", String::as_str);
            [names.into(), reason(&history, &row.run).into()]
        });
        shown
            .iter()
            .map(|(.., cell)| cell(row))
            .chain(why.into_iter().flatten())
            .chain(words)
            .chain(contested)
            .collect()
    };
    // The rows of all runs together would take a gigabyte for each million.
    let chunks = runs.chunks(ROWS_AT_A_TIME);
    match args.format {
        _ if runs.len() <= ROWS_AT_A_TIME => {
            table.rows = runs.iter().map(row).collect();
            output::print(&table.render(args.format.into(), output::page()));
        }
        Format::Csv => {
            output::print(&table.render(args.format.into(), output::page()));
            for runs in chunks {
                table.rows = runs.iter().map(row).collect();
                output::print(&table.csv_rows());
            }
        }
        Format::Text => {
            for runs in chunks {
                table.rows = runs.iter().map(row).collect();
                output::print(&table.render(args.format.into(), output::page()));
            }
        }
        Format::Json => {
            for (place, runs) in chunks.enumerate() {
                table.rows = runs.iter().map(row).collect();
                // The array of each part without its brackets.
                let part = table.render(args.format.into(), output::page());
                let items = part
                    .trim_end()
                    .trim_start_matches('[')
                    .trim_end_matches(']')
                    .trim_end();
                output::print(&format!("{}{items}", if place == 0 { "[" } else { "," }));
            }
            output::print("\n]\n");
        }
    }
    if runs.is_empty() {
        output::print_none("no run matches; `actcheck list` without options lists all");
    }
    Ok(())
}

fn outcome(word: &str) -> Result<Outcome, OptionFault> {
    Outcome::from_word(word)
        .ok_or_else(|| did_you_mean(word, Outcome::ALL.map(Outcome::word)).into())
}

/// The first reason why a run failed. Empty if its details can't be read, which other commands
/// report.
fn reason(history: &History, run: &str) -> String {
    let detail = history.newest_run(run).ok();
    let judgements = detail.iter().flat_map(|run| &run.actions);
    let failed = judgements
        .flat_map(|action| &action.judgements)
        .find(|judgement| judgement.outcome == Outcome::Failed);
    failed.map_or_else(String::new, |judgement| shortened(&judgement.witness))
}

/// The runs that the options choose.
#[derive(Default)]
struct ListedRuns {
    runs: Vec<RunRow>,
    /// The outcomes of the named properties by run: one text for each property, with the outcomes of
    /// all actions that have it.
    words: BTreeMap<String, Vec<String>>,
    /// The names of the failed properties by run, if only failed runs are wanted.
    failed: BTreeMap<String, String>,
}

/// The runs that the options choose.
fn chosen_runs(
    args: &ListArgs,
    history: &History,
    filter: &RunFilter,
) -> Result<ListedRuns, Diagnostics> {
    let wanted = args.wanted();
    let by_outcome = wanted.is_some() || !args.property.is_empty();
    let judgements = if by_outcome {
        Judgements::Newest
    } else {
        Judgements::None
    };
    let mut chosen = ListedRuns::default();
    let mut judged: BTreeSet<Arc<str>> = BTreeSet::new();
    history.each_judged(
        filter,
        Wish {
            judgements,
            ..Wish::default()
        },
        &mut |run| {
            for own in &run.outcomes {
                if !judged.contains(&own.property) {
                    judged.insert(Arc::clone(&own.property));
                }
            }
            let is_named = |own: &&JudgedOutcome| {
                args.property
                    .iter()
                    .any(|name| is_meant(&own.property, name))
            };
            let mut named = run
                .outcomes
                .iter()
                .filter(|own| args.property.is_empty() || is_named(own));
            if by_outcome && !named.any(|own| wanted.is_none_or(|wanted| own.outcome == wanted)) {
                return;
            }
            let outcomes = |name: &String| -> String {
                let own = run
                    .outcomes
                    .iter()
                    .filter(|own| is_meant(&own.property, name));
                own.map(|own| own.outcome.word())
                    .collect::<Vec<_>>()
                    .join(", ")
            };
            if !args.property.is_empty() {
                chosen.words.insert(
                    run.row.run.clone(),
                    args.property.iter().map(outcomes).collect(),
                );
            }
            if args.says_why() {
                let of_run = run.outcomes.iter();
                let mut names: Vec<&str> = of_run
                    .filter(|own| own.outcome == Outcome::Failed)
                    .map(|own| names::local(&own.property))
                    .collect();
                names.dedup();
                chosen.failed.insert(run.row.run.clone(), names.join(", "));
            }
            chosen.runs.push(run.row);
        },
    )?;
    if by_outcome {
        chosen::all_judged(&args.property, judged.iter().map(|property| &**property))?;
    }
    Ok(chosen)
}
