//! The runs of a history that a command uses.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use clap::Args;

use crate::options::HistoryArgs;
use crate::{history_dir, output, when, why};
use actcheck_analysis::{Hierarchy, Sampling, TableFilter};
use actcheck_base::{Diagnostic, Diagnostics, ShellLine, did_you_mean, names};
use actcheck_history::History;
use actcheck_ontology as ontology;
use actcheck_ontology::Ontology;

/// Runs of a history, and the ontology that explains them.
#[derive(Debug, Args)]
pub struct ChosenRuns {
    /// Only runs of this campaign (may be given several times) [default: all but shrunk runs,
    /// repeated failed runs and cases]
    #[arg(long, value_name = "ID")]
    pub campaign: Vec<String>,
    /// Only runs since this time, such as 2026-11-21, 2026-11-21T18:00:00Z, or 12h for 12 hours ago
    #[arg(long, value_name = "WHEN", value_parser = when::parse)]
    pub since: Option<String>,
    /// The ontology with the rules and the hierarchy of object categories [default:
    /// ontology/actions.ttl here, or the shipped one]
    #[arg(long, value_name = "FILE")]
    pub ontology: Option<PathBuf>,
    /// The folder of the history.
    #[command(flatten)]
    pub history: HistoryArgs,
}

/// Returns how the number of runs of some campaigns was decided: outcomes, if they did so in one of
/// them.
pub(super) fn sampling(
    history: &History,
    is_meant: impl Fn(&str) -> bool,
) -> Result<Sampling, Diagnostics> {
    let rows = history
        .campaigns()?
        .into_iter()
        .filter(|row| is_meant(&row.id));
    let of = rows.map(|row| Sampling::of(row.ended_by.as_deref(), row.interrupted));
    Ok(of.fold(Sampling::Fixed, Sampling::and))
}

/// E019: checks that no campaign of a history has another physics engine than the others.
///
/// # Errors
/// E019: rates over runs of several engines are made only for named campaigns.
pub(super) fn one_engine(history: &History) -> Result<(), Diagnostics> {
    let mut of_engine: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for campaign in history.campaigns()? {
        let engine = engine_name(campaign.imported_from.as_deref()).to_owned();
        of_engine.entry(engine).or_default().push(campaign.id);
    }
    if of_engine.len() < 2 {
        return Ok(());
    }
    let listed: Vec<String> = of_engine
        .iter()
        .map(|(engine, campaigns)| format!("{} of {engine}", campaigns.join(", ")))
        .collect();
    let newest = of_engine.values().next().and_then(|ids| ids.last());
    let example = newest.map_or("ID", String::as_str);
    Err(Diagnostic::error(
        "E019",
        format!(
            "the history `{}` has runs of several engines: {}",
            history.dir().display(),
            listed.join("; ")
        ),
    )
    .help(format!(
        "name the campaigns that count: `--campaign {example}` (several may be named)"
    ))
    .into())
}

/// The engine of a campaign in words.
pub(super) fn engine_name(imported_from: Option<&str>) -> &str {
    imported_from.unwrap_or("this simulator")
}

impl ChosenRuns {
    /// Opens the history of the runs for reading.
    pub(super) fn open(&self) -> Result<History, Diagnostics> {
        history_dir::open_to_read(&self.history)
    }

    /// Returns the filter that selects their rows in tables.
    ///
    /// # Errors
    /// A campaign does not exist.
    pub(super) fn filter(&self, history: &History) -> Result<TableFilter, Diagnostics> {
        for campaign in &self.campaign {
            history.campaign(campaign)?;
        }
        if self.campaign.is_empty() {
            one_engine(history)?;
        }
        let campaigns = (!self.campaign.is_empty()).then(|| self.campaign.clone());
        Ok(TableFilter {
            campaigns,
            since: self.since.clone(),
        })
    }

    /// Loads the ontology.
    ///
    /// # Errors
    /// It can't be read.
    pub(super) fn ontology(&self) -> Result<Ontology, Diagnostics> {
        let (files, path) = why::ontology_file(self.ontology.as_deref());
        let ontology = ontology::load_to_report(&files, &path)?;
        // The outcomes are stored: a rule is only needed to explain them.
        let missing = ontology.warnings.iter();
        let missing: Diagnostics = missing
            .filter(|fault| fault.code == "O009")
            .cloned()
            .collect();
        if !missing.is_empty() {
            output::print_diagnostics(&missing);
        }
        Ok(ontology)
    }

    /// The options that choose the runs, as they were typed.
    pub(super) fn typed(&self) -> ShellLine {
        let Self {
            campaign,
            since,
            ontology,
            history: HistoryArgs { history },
        } = self;
        let typed = campaign.iter().fold(ShellLine::default(), |typed, id| {
            typed.option("--campaign", id)
        });
        let typed = since
            .iter()
            .fold(typed, |typed, since| typed.option("--since", since));
        let typed = ontology
            .iter()
            .fold(typed, |typed, file| typed.option("--ontology", file));
        history
            .iter()
            .fold(typed, |typed, folder| typed.option("--history", folder))
    }
}

/// The superclasses of each class of an ontology, nearest first: a class with more superclasses is
/// nearer.
pub(super) fn hierarchy(ontology: &Ontology) -> Hierarchy {
    let classes = &ontology.superclasses;
    let depth = |class: &String| classes.get(class).map_or(0, BTreeSet::len);
    let nearest_first = |above: &BTreeSet<String>| {
        let mut above: Vec<&String> = above.iter().collect();
        above.sort_by_key(|class| (Reverse(depth(class)), *class));
        above
            .into_iter()
            .map(|class| names::local(class).to_owned())
            .collect()
    };
    classes
        .iter()
        .map(|(class, above)| (class.clone(), nearest_first(above)))
        .collect()
}

/// X044: the chosen campaigns and times have no runs.
pub(super) fn none_of(history: &History) -> Diagnostic {
    let selected = history.selected_campaigns().unwrap_or_default();
    let help = match selected.last() {
        Some(id) => format!(
            "its runs of cases, shrunk runs and repeated failed runs are used only if their campaign is named: \
             `--campaign {id}`"
        ),
        None => "`actcheck list` shows its runs; `actcheck run CONFIG` creates some".to_owned(),
    };
    Diagnostic::error(
        "X044",
        format!(
            "the history `{}` has no matching runs",
            history.dir().display()
        ),
    )
    .help(help)
}

/// Whether a name or IRI denotes the property with an IRI.
pub(super) fn is_meant(property: &str, name: &str) -> bool {
    name == property || name == names::local(property)
}

/// Checks that every named property was judged (X045): a property that was never judged is probably
/// misspelt.
pub(super) fn all_judged<'a>(
    names: &[String],
    judged: impl Iterator<Item = &'a str> + Clone,
) -> Result<(), Diagnostics> {
    let mut faults = Diagnostics::new();
    for name in names
        .iter()
        .filter(|name| !judged.clone().any(|property| is_meant(property, name)))
    {
        let help = did_you_mean(
            name,
            judged.clone().map(names::local).collect::<BTreeSet<_>>(),
        );
        faults.push(
            Diagnostic::error(
                "X045",
                format!("no property `{name}` was judged in these runs"),
            )
            .help(help),
        );
    }
    faults.or(())
}
