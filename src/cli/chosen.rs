//! Which runs of a history a command is about.

use std::cmp::Reverse;
use std::collections::BTreeSet;
use std::path::PathBuf;

use clap::Args;

use crate::analysis::{Hierarchy, TableFilter};
use crate::base::{Diagnostic, Diagnostics, did_you_mean, names};
use crate::cli::args::HistoryArgs;
use crate::cli::{history_dir, since, why};
use crate::history::History;
use crate::ontology::{self, Ontology};

/// Runs of a history, and what explains them.
#[derive(Debug, Args)]
pub struct ChosenRuns {
    /// Only runs of this campaign (may be given several times) [default: all but the smaller forms of runs]
    #[arg(long, value_name = "ID")]
    pub campaign: Vec<String>,
    /// Only runs since then, such as 2026-11-21, 2026-11-21T18:00:00Z or 12h ago as 12h
    #[arg(long, value_name = "WHEN", value_parser = since::moment)]
    pub since: Option<String>,
    /// The ontology that explains outcomes and says which kinds belong to which [default: ontology/actions.ttl here, or the one
    /// that the program carries]
    #[arg(long, value_name = "FILE")]
    pub ontology: Option<PathBuf>,
    /// Where the history lies.
    #[command(flatten)]
    pub history: HistoryArgs,
}

impl ChosenRuns {
    /// The history that they are of.
    pub(super) fn open(&self) -> Result<History, Diagnostics> {
        history_dir::open(&self.history)
    }

    /// Their rows in tables.
    ///
    /// # Errors
    /// A campaign is not there.
    pub(super) fn filter(&self, history: &History) -> Result<TableFilter, Diagnostics> {
        for campaign in &self.campaign {
            history.campaign(campaign)?;
        }
        let campaigns = (!self.campaign.is_empty()).then(|| self.campaign.clone());
        Ok(TableFilter { campaigns, since: self.since.clone() })
    }

    /// The ontology.
    ///
    /// # Errors
    /// It can't be read.
    pub(super) fn ontology(&self) -> Result<Ontology, Diagnostics> {
        let (files, path) = why::ontology_file(self.ontology.as_deref());
        ontology::load(&files, &path)
    }

    /// The options that choose them, as they were typed.
    pub(super) fn typed(&self) -> String {
        let mut typed = String::new();
        let mut add = |name: &str, value: String| typed.push_str(&format!(" --{name} {value}"));
        self.campaign.iter().for_each(|id| add("campaign", id.clone()));
        self.since.iter().for_each(|since| add("since", since.clone()));
        self.ontology.iter().for_each(|file| add("ontology", file.display().to_string()));
        self.history.history.iter().for_each(|folder| add("history", folder.display().to_string()));
        typed
    }
}

/// The classes above each class of an ontology, the nearest first: the more classes are above one, the nearer it is.
pub(super) fn hierarchy(ontology: &Ontology) -> Hierarchy {
    let classes = &ontology.superclasses;
    let depth = |class: &String| classes.get(class).map_or(0, BTreeSet::len);
    let nearest_first = |above: &BTreeSet<String>| {
        let mut above: Vec<&String> = above.iter().collect();
        above.sort_by_key(|class| (Reverse(depth(class)), *class));
        above.into_iter().map(|class| names::local(class).to_owned()).collect()
    };
    classes.iter().map(|(class, above)| (class.clone(), nearest_first(above))).collect()
}

/// No run was chosen.
pub(super) fn none_of(history: &History) -> Diagnostic {
    Diagnostic::error("X044", format!("the history `{}` has no such runs", history.dir().display()))
        .help("`actcheck list` shows the runs that it has; `actcheck run CONFIG` makes some")
}

/// Whether a property, by its IRI, is meant by a name or IRI.
pub(super) fn is_meant(property: &str, name: &str) -> bool {
    name == property || name == names::local(property)
}

/// A property that was never judged was misspelt (X045).
pub(super) fn all_judged<'a>(
    names: &[String],
    judged: impl Iterator<Item = &'a str> + Clone,
) -> Result<(), Diagnostics> {
    let mut faults = Diagnostics::new();
    for name in names.iter().filter(|name| !judged.clone().any(|property| is_meant(property, name))) {
        let help = did_you_mean(name, judged.clone().map(names::local).collect::<BTreeSet<_>>());
        faults.push(Diagnostic::error("X045", format!("no property `{name}` was judged in these runs")).help(help));
    }
    faults.or(())
}
