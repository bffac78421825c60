//! Stored runs, judged by the rules of each revision.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::BisectArgs;
use super::judge::{Judged, Unjudged, explain};
use super::repository::Repository;
use super::versions::Version;
use crate::work::all_cores;
use crate::{history_dir, restore};
use actcheck_analysis::Compared;
use actcheck_base::{Diagnostic, Diagnostics, Files};
use actcheck_campaign::{RuleSet, judge_stored};
use actcheck_history::{History, OutcomeRow, Recheck, RunFilter, RunRow, SceneDigest};
use actcheck_ontology as ontology;
use actcheck_rules::RuleBook;

/// Runs of a history. Nothing is stored there.
pub struct Stored<'a> {
    repository: &'a Repository,
    history: History,
    rows: Vec<RunRow>,
    scenes: BTreeMap<String, SceneDigest>,
    ontology: PathBuf,
    jobs: usize,
    stop: &'a Arc<AtomicBool>,
}

impl<'a> Stored<'a> {
    /// Reads the runs of a history, or those that the arguments name.
    pub fn open(
        args: &BisectArgs,
        repository: &'a Repository,
        stop: &'a Arc<AtomicBool>,
    ) -> Result<Self, Diagnostics> {
        let history = history_dir::open_to_read(&args.history)?;
        restore::allow(&history, args.trust);
        let named: Vec<String> = args
            .runs
            .iter()
            .map(|name| history.resolve(name))
            .collect::<Result<_, _>>()?;
        let mut rows = history.runs(&RunFilter::default())?;
        rows.retain(|row| named.is_empty() || named.contains(&row.run));
        if rows.is_empty() {
            let message = format!(
                "the history `{}` has no runs to judge",
                history.dir().display()
            );
            return Err(Diagnostic::error("X034", message)
                .help("`actcheck run CONFIG` creates some")
                .into());
        }
        // Runs of several campaigns may have the same number.
        (0u64..)
            .zip(&mut rows)
            .for_each(|(place, row)| (row.index, row.repetition) = (place, None));
        let Some(ontology) = repository.inside(&args.ontology) else {
            let message = format!(
                "{} does not belong to the repository",
                args.ontology.display()
            );
            return Err(Diagnostic::error("X062", message)
                .help("name the ontology's path in the revisions")
                .into());
        };
        let scenes = history.scenes(&rows)?;
        let jobs = args.jobs.map_or_else(all_cores, usize::from);
        Ok(Self {
            repository,
            history,
            rows,
            scenes,
            ontology,
            jobs,
            stop,
        })
    }

    /// Judges the runs by the rules of a revision.
    pub fn judge(&self, version: &Version) -> Result<Judged, Unjudged> {
        let path = self.ontology_of(version)?;
        let rules = RuleSet::prepare(&Files::Disk, &path).map_err(|faults| self.skip(faults))?;
        let (rechecks, faults) =
            judge_stored(&self.history, &self.rows, &rules, self.jobs, self.stop)?;
        if self.stop.load(Ordering::Relaxed) {
            return Err(Unjudged::Stopped(
                Diagnostic::error("X030", "interrupted").into(),
            ));
        }
        if rechecks.is_empty() && !faults.is_empty() {
            return Err(self.skip(faults));
        }
        let rows: BTreeMap<&str, &RunRow> = self
            .rows
            .iter()
            .map(|row| (row.run.as_str(), row))
            .collect();
        let outcomes = rechecks
            .into_iter()
            .filter_map(|judged| Some(outcome(rows.get(judged.run.as_str())?, judged)));
        Ok(Judged {
            outcomes: outcomes.collect(),
            rows: self.rows.clone(),
            scenes: self.scenes.clone(),
        })
    }

    /// Explains an outcome by the rules of a revision.
    pub fn explain(
        &self,
        version: &Version,
        run: &str,
        of: &Compared,
    ) -> Result<String, Diagnostics> {
        let path = self.ontology_of(version).map_err(Unjudged::into_faults)?;
        let rules = RuleBook::prepare(&ontology::load(&Files::Disk, &path)?)?;
        Ok(self
            .repository
            .without_folder(&explain(&rules, &self.history, run, of)?))
    }

    fn ontology_of(&self, version: &Version) -> Result<PathBuf, Unjudged> {
        let path = self.repository.extract(version)?.join(&self.ontology);
        if path.is_file() {
            Ok(path)
        } else {
            Err(Unjudged::Skipped(lacks(&self.ontology).into()))
        }
    }

    fn skip(&self, faults: Diagnostics) -> Unjudged {
        Unjudged::Skipped(self.repository.faults_without_folder(faults))
    }
}

/// The fault of a revision without a file.
pub(super) fn lacks(path: &Path) -> Diagnostic {
    Diagnostic::error("X065", format!("it has no {}", path.display()))
}

fn outcome(row: &RunRow, judged: Recheck) -> OutcomeRow {
    OutcomeRow {
        run: row.run.clone(),
        campaign: row.campaign.clone(),
        index: row.index,
        test: row.test.clone(),
        step: judged.step,
        action: judged.action,
        property: judged.now.property,
        outcome: judged.now.outcome,
        margin: judged.now.margin,
    }
}
