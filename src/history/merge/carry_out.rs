//! Carries out a plan: writes each campaign's statements, then its runs, each in one transaction,
//! then its end.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use oxigraph::model::{GraphName, GraphNameRef, Literal, NamedNode, Quad};
use oxigraph::store::{StorageError, Store};

use crate::merge::copy::about;
use crate::merge::plan::{MergePlan, PlannedEnd, PlannedMerge};
use crate::merge::renames::Renames;
use crate::outlines::Outline;
use crate::read::text_of;
use crate::statements::{Statements, count, iri, time};
use crate::write_campaign::{self, NUMBER, campaign_node};
use crate::write_run::run_node;
use crate::{History, fault, folder};
use actcheck_base::{Diagnostic, Diagnostics};

/// The result of a merge.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Merged {
    /// Number of added runs.
    pub runs: u64,
    /// Runs whose traces were already missing in their histories: only their data from the store
    /// was merged.
    pub without_trace: Vec<String>,
    /// Whether the merge was stopped before everything was written.
    pub interrupted: bool,
}

/// Writes a plan into a history, and calls `on_run` after each added run.
///
/// If it ends early, the destination is consistent: an incomplete campaign has no end yet, and
/// merging again completes it.
///
/// # Errors
/// A history can't be read, or the destination can't be written.
pub fn carry_out(
    plan: &MergePlan,
    sources: &[History],
    into: &History,
    stop: &AtomicBool,
    mut on_run: impl FnMut(),
) -> Result<Merged, Diagnostics> {
    let renames: Vec<Renames> = (0..sources.len())
        .map(|source| {
            let of_source = plan.ids.iter().filter(|((of, _), _)| *of == source);
            Renames::new(of_source.map(|((_, old), new)| (old.clone(), new.clone())))
        })
        .collect();
    let mut writer = Writer {
        sources,
        renames,
        into,
        merged: Merged::default(),
    };
    for campaign in &plan.campaigns {
        writer.begin(campaign)?;
        let copied = match writer.copy_files(campaign, stop, &mut on_run)? {
            Some(copied) => copied,
            None => {
                into.flush()?;
                return Ok(writer.merged);
            }
        };
        for (index, (source, run)) in campaign
            .work
            .runs
            .iter()
            .filter(|(index, _)| !copied.contains(index))
        {
            if stop.load(Ordering::Relaxed) {
                writer.merged.interrupted = true;
                into.flush()?;
                return Ok(writer.merged);
            }
            let new = format!("{}-{}", campaign.id, index + 1);
            writer.run(*source, run, &new)?;
            on_run();
        }
        for (source, run) in campaign.work.judgements.values() {
            writer.judgements(*source, run)?;
        }
        into.shelf()
            .pack(&campaign.id)
            .map_err(|error| fault::io(into.dir(), "writing outlines", &error))?;
        writer.end(campaign)?;
    }
    into.load_journal()?;
    into.flush()?;
    into.reopen()?;
    Ok(writer.merged)
}

struct Writer<'a> {
    sources: &'a [History],
    renames: Vec<Renames>,
    into: &'a History,
    merged: Merged,
}

impl Writer<'_> {
    /// Writes the statements about a campaign without its end, so that readers see it as
    /// unfinished.
    fn begin(&self, campaign: &PlannedMerge) -> Result<(), Diagnostics> {
        let work = &campaign.work;
        let node = campaign_node(&campaign.id);
        let mut statements = Statements::default();
        let mut about = statements.about(node.clone());
        for shard in &work.shards {
            about.text("act:shard", shard);
        }
        about.optional("prov:startedAtTime", work.started.as_deref().map(time));
        if work.started.is_some() {
            about.has(NUMBER, count(self.into.campaign_ids()?.len() as u64));
        }
        let mut quads = statements.quads;
        if let Some((source, id)) = &work.statements {
            quads.extend(self.statements(campaign, *source, id)?);
        }
        let ends = if matches!(work.end, PlannedEnd::Same) {
            Vec::new()
        } else {
            self.ends(&node)?
        };
        self.write(&quads, &ends)
    }

    /// A source's statements about a campaign that the destination lacks, without its start and
    /// end.
    fn statements(
        &self,
        campaign: &PlannedMerge,
        source: usize,
        id: &str,
    ) -> Result<Vec<Quad>, Diagnostics> {
        let [start, number, path, first] = [
            "prov:startedAtTime",
            NUMBER,
            "act:configPath",
            "act:firstId",
        ]
        .map(iri);
        let mut quads = self.about(source, &campaign_node(id))?;
        quads.retain(|quad| !is_end(quad) && quad.predicate != start && quad.predicate != number);
        for quad in quads.iter_mut().filter(|quad| quad.predicate == path) {
            let path = relative_path_from(
                &text_of(&quad.object),
                self.sources[source].dir(),
                self.into.dir(),
            );
            quad.object = Literal::new_simple_literal(path).into();
        }
        if id != campaign.id
            && !campaign.joined
            && !quads.iter().any(|quad| quad.predicate == first)
        {
            let mut statements = Statements::default();
            statements
                .about(campaign_node(&campaign.id))
                .text("act:firstId", id);
            quads.extend(statements.quads);
        }
        Ok(quads)
    }

    /// Copies the files of outlines whose runs are all wanted and keep their ids. Returns the
    /// indices of these runs, or `None` if the merge was stopped.
    fn copy_files(
        &mut self,
        campaign: &PlannedMerge,
        stop: &AtomicBool,
        on_run: &mut impl FnMut(),
    ) -> Result<Option<BTreeSet<u64>>, Diagnostics> {
        let (mut copied, mut files) = (BTreeSet::new(), Vec::new());
        let sources: BTreeSet<usize> = campaign
            .work
            .runs
            .values()
            .map(|(source, _)| *source)
            .collect();
        for source in sources {
            let history = &self.sources[source];
            let is_simple = history.shelf().exists() && !history.has_later_judgements()?;
            history.rest();
            if !is_simple {
                continue;
            }
            let is_wanted = |index: u64| {
                let run = format!("{}-{}", campaign.id, index + 1);
                campaign
                    .work
                    .runs
                    .get(&index)
                    .is_some_and(|(of, known)| *of == source && *known == run)
            };
            for (file, indices) in history.outline_files(&campaign.id)? {
                if stop.load(Ordering::Relaxed) {
                    self.merged.interrupted = true;
                    return Ok(None);
                }
                if indices
                    .iter()
                    .any(|index| !is_wanted(*index) || copied.contains(index))
                {
                    continue;
                }
                if let Some(new) = self.into.copy_outlines(&file)? {
                    files.push(new);
                    self.merged.runs += indices.len() as u64;
                    indices.iter().for_each(|_| on_run());
                    copied.extend(indices);
                }
            }
        }
        self.into.sync_outlines(&files)?;
        Ok(Some(copied))
    }

    fn run(&mut self, source: usize, run: &str, new: &str) -> Result<(), Diagnostics> {
        let doing = format!("writing run {new}");
        if let Some((outline, later)) = self.outlined(source, run)? {
            if let (Some((campaign, _)), Some(row)) =
                (new.rsplit_once('-'), outline.rows.rows.first())
            {
                self.into.enter_outline(campaign, row.index, &outline)?;
            }
            self.write(&later, &[])?;
            self.merged.runs += 1;
            return Ok(());
        }
        match folder::read(&self.sources[source].trace_path(run)) {
            Ok(bytes) => self
                .into
                .folder
                .below()
                .write_atomic(&self.into.trace_path(new), &bytes)
                .map_err(|error| fault::io(self.into.dir(), &doing, &error))?,
            Err(_) => self.merged.without_trace.push(new.to_owned()),
        }
        self.write(&self.about(source, &run_node(run))?, &[])?;
        self.merged.runs += 1;
        Ok(())
    }

    /// Copies only later judgements: the destination has the rest of the run.
    fn judgements(&self, source: usize, run: &str) -> Result<(), Diagnostics> {
        let later = GraphName::from(iri("act:rechecked"));
        let mut quads = match self.outlined(source, run)? {
            Some((_, later)) => later,
            None => self.about(source, &run_node(run))?,
        };
        quads.retain(|quad| quad.graph_name == later);
        self.write(&quads, &[])
    }

    fn end(&self, campaign: &PlannedMerge) -> Result<(), Diagnostics> {
        let quads = match &campaign.work.end {
            PlannedEnd::Same => return Ok(()),
            PlannedEnd::Of(source, id) => {
                let mut quads = self.about(*source, &campaign_node(id))?;
                quads.retain(is_end);
                quads
            }
            PlannedEnd::Computed(end) => write_campaign::end(&campaign.id, end),
        };
        self.write(&quads, &[])?;
        self.into.flush()
    }

    /// The outline of a run and the judgements made after it, with the ids of the destination.
    /// Returns `None` if the run is kept whole.
    fn outlined(
        &self,
        source: usize,
        run: &str,
    ) -> Result<Option<(Outline, Vec<Quad>)>, Diagnostics> {
        let history = &self.sources[source];
        let Some(outline) = history.outline(run)? else {
            return Ok(None);
        };
        // Together, because later judgements name those that they supersede.
        let mut quads = outline.quads;
        quads.extend(history.later_about_outline(run, &*history.store()?)?);
        let (own, later) = self.renames[source]
            .apply(quads)
            .into_iter()
            .partition(|quad| quad.graph_name == GraphName::DefaultGraph);
        Ok(Some((
            Outline {
                quads: own,
                ..outline
            },
            later,
        )))
    }

    /// All statements of a source about a campaign or run, with the ids of the destination.
    fn about(&self, source: usize, node: &NamedNode) -> Result<Vec<Quad>, Diagnostics> {
        let history = &self.sources[source];
        let quads =
            about(&*history.store()?, node).map_err(|error| history.fault("reading it", &error))?;
        Ok(self.renames[source].apply(quads))
    }

    /// The end of a campaign that an earlier process wrote, so that it is not in the journal of
    /// this one.
    fn ends(&self, node: &NamedNode) -> Result<Vec<Quad>, Diagnostics> {
        let store = self.into.bare_store()?;
        let quads = store.quads_for_pattern(
            Some(node.into()),
            None,
            None,
            Some(GraphNameRef::DefaultGraph),
        );
        let ends: Result<Vec<Quad>, StorageError> = quads
            .filter(|quad| quad.as_ref().map_or(true, is_end))
            .collect();
        ends.map_err(|error| self.into.fault("reading a campaign", &error))
    }

    /// Adds and removes quads in one transaction.
    fn write(&self, new: &[Quad], old: &[Quad]) -> Result<(), Diagnostics> {
        if new.is_empty() && old.is_empty() {
            return Ok(());
        }
        if old.is_empty() {
            self.into.enter_quads(new, "writing merged data")?;
            return self.into.load_long_journal();
        }
        replace(&*self.into.store()?, new, old)
            .map_err(|error| self.into.fault("writing merged data", &error))
    }
}

fn replace(store: &Store, new: &[Quad], old: &[Quad]) -> Result<(), StorageError> {
    let mut transaction = store.start_transaction()?;
    for quad in old {
        transaction.remove(quad);
    }
    for quad in new {
        transaction.insert(quad);
    }
    transaction.commit()
}

/// Whether a quad about a campaign describes its end.
fn is_end(quad: &Quad) -> bool {
    write_campaign::end_properties().contains(&quad.predicate)
}

/// Converts a path relative to one folder into a path relative to another. Returns it unchanged if
/// the file does not exist.
fn relative_path_from(path: &str, from: &Path, to: &Path) -> String {
    let absolute = std::fs::canonicalize(from.join(path)).ok();
    let seen = absolute
        .zip(std::fs::canonicalize(to).ok())
        .and_then(|(path, to)| pathdiff::diff_paths(path, to));
    seen.map_or_else(|| path.to_owned(), |path| path.display().to_string())
}

impl Merged {
    /// Returns a warning about runs whose traces were already missing, or `None` if no trace is
    /// missing.
    pub fn warning(&self) -> Option<Diagnostic> {
        let first = self.without_trace.first()?;
        let message = format!(
            "{} runs had no trace before the merge, the first is {first}",
            self.without_trace.len()
        );
        Some(
            Diagnostic::warning("H009", message)
                .help("their outcomes and facts were merged; replay and recheck need traces"),
        )
    }
}
