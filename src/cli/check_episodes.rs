//! `actcheck check-episodes`

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use crate::convert;
use crate::import::{Mappings, first_of_episodes, found};
use crate::options::Format;
use crate::output;
use actcheck_base::{Diagnostics, Outcome};
use actcheck_campaign::{CheckedPremises, check_premises};
use actcheck_report::Table;

/// `actcheck check-episodes`
#[derive(Debug, Args)]
pub struct CheckEpisodesArgs {
    /// Episodes, as for `actcheck import`
    #[arg(value_name = "FILE", required = true)]
    pub files: Vec<PathBuf>,
    /// The mapping [default: the shipped one for the environment]
    #[arg(long, value_name = "FILE")]
    pub mapping: Option<PathBuf>,
    /// The Python that reads files other than MCAP
    #[arg(long, value_name = "PROGRAM", default_value = "python3")]
    pub python: PathBuf,
    /// The ontology with the premises [default: that of the mapping, or the default one]
    #[arg(long, value_name = "FILE")]
    pub ontology: Option<PathBuf>,
    /// How it is printed
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    pub format: Format,
}

/// Checks whether the first states of episodes are those that their tasks are about, and prints one
/// line for each task. Returns the exit code.
pub fn check_episodes(args: &CheckEpisodesArgs) -> Result<u8, Diagnostics> {
    let files = found(&args.files)?;
    let converted = convert::episodes(&files, &args.python, None)?;
    let mappings = Mappings::load(args.mapping.as_deref(), args.ontology.as_deref())?;
    let (files, mut faults) = mappings.choose(&converted);
    let mut tasks: BTreeMap<String, Vec<CheckedPremises>> = BTreeMap::new();
    for file in &files {
        match check_premises(file) {
            Ok(checked) => tasks.entry(checked.task.clone()).or_default().push(checked),
            Err(found) => faults.extend(found),
        }
    }
    let mut table = Table::new(["task", "states", "flagged", "premise", "such as"]);
    for (task, states) in &tasks {
        let flagged: Vec<&CheckedPremises> =
            states.iter().filter(|state| is_flagged(state)).collect();
        let first = flagged.first().and_then(|state| {
            let broken = state
                .premises
                .iter()
                .find(|(_, outcome, _)| fails(*outcome))?;
            Some((broken.0.clone(), format!("{}: {}", state.file, broken.2)))
        });
        let (premise, example) = first.unwrap_or_default();
        table.rows.push(vec![
            json!(task),
            json!(states.len()),
            json!(flagged.len()),
            json!(premise),
            json!(example),
        ]);
    }
    output::print(&table.render(args.format.into(), output::page()));
    let any = tasks.values().flatten().any(is_flagged);
    if faults.is_empty() {
        return Ok(u8::from(any));
    }
    output::print_diagnostics(&first_of_episodes(faults));
    Ok(2)
}

fn is_flagged(state: &CheckedPremises) -> bool {
    state.premises.iter().any(|(_, outcome, _)| fails(*outcome))
}

fn fails(outcome: Outcome) -> bool {
    !matches!(outcome, Outcome::Passed | Outcome::Inapplicable)
}
