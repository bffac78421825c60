//! An open history: its folder, and the RDF store in it.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, OnceLock, RwLock};

use oxigraph::model::vocab::rdf;
use oxigraph::model::{GraphNameRef, NamedNode, QuadRef};
use oxigraph::sparql::QueryEvaluationError;
use oxigraph::store::StorageError;

use crate::folder::Folder;
use crate::journal::Journal;
use crate::open::Opened;
use crate::outlines::{LoadedFiles, Outline, Restore, Shelf, View};
use crate::read::{short_id, subjects, text_of};
use crate::snapshot::Snapshot;
use crate::statements::iri;
use crate::tail::Tail;
use crate::wanted::Wanted;
use crate::write_campaign::{self, campaign_node};
use crate::write_run::run_node;
use crate::{
    CampaignEnd, CampaignRecord, CampaignRow, Cancel, Judgements, OutcomeRow, QueryAnswer,
    RunDetail, RunFilter, RunRecord, RunRow, RunVitals, Wish, detail, fault, query, trace_file,
    vitals,
};
use crate::{lists, read_campaign};
use actcheck_base::{Diagnostic, Diagnostics, Digest, Source, names, nearest};

/// A history that only this process may write, or that it only reads (after
/// [`History::open_to_read`]).
///
/// A run that [`History::commit`] stored survives a kill of the process. Before a power cut, the
/// operating system may not have written the last seconds to the disk; runs stored before
/// [`History::flush`] survive that, too, and all runs after [`History::sync_each_run`]. Its trace
/// file is written first, so that every run in the store has one.
pub struct History {
    // Dropped before the folder, which releases the lock. `None` only if reopening failed.
    pub(super) opened: RwLock<Option<Opened>>,
    /// The state of a reader whose store is closed until it is needed.
    pub(super) resting: Mutex<Option<Arc<Snapshot>>>,
    pub(super) folder: Folder,
    /// The statements that are not in the store yet.
    pub(super) journal: Mutex<Journal>,
    /// The store of queries, if there are outlines.
    pub(super) view: Mutex<Option<View>>,
    /// The files of outlines that were read last.
    pub(super) loaded: LoadedFiles,
    /// Number of outlines that this process has written.
    pub(super) single_outlines: AtomicUsize,
    /// Greatest number of threads that make its tables, and that read lists of runs.
    pub(super) threads: AtomicUsize,
    pub(super) restore: OnceLock<Box<Restore>>,
    /// The end of the journal when the history was opened.
    pub(super) tail: Tail,
}

impl History {
    /// Limits the threads that write its tables at the end of a campaign, and that read lists of
    /// runs: otherwise, all cores do.
    pub fn use_threads(&self, threads: usize) {
        self.threads.store(threads.max(1), Ordering::Relaxed);
    }

    /// Greatest number of threads.
    pub(super) fn threads(&self) -> usize {
        self.threads.load(Ordering::Relaxed)
    }

    /// Whether this program writes files of this path into the folder of a history.
    pub fn writes(path: &Path) -> bool {
        Folder::writes(path)
    }

    /// The folder as the caller gave it.
    pub fn dir(&self) -> &Path {
        self.folder.dir()
    }

    /// Returns an id for a new campaign: short, unique in this history, and the same for the same
    /// history, configuration and seed.
    ///
    /// # Errors
    /// The store can't be read.
    pub fn next_campaign_id(&self, config_digest: &str, seed: u64) -> Result<String, Diagnostics> {
        let known: BTreeSet<String> = self.campaign_ids()?.into_iter().collect();
        let first = known.len() as u64;
        let free = (first..)
            .map(|counter| campaign_id(config_digest, seed, counter))
            .find(|id| !known.contains(id));
        // There are nearly a million short ids; when all are used, a long one follows.
        Ok(free.unwrap_or_else(|| config_digest.to_owned()))
    }

    /// Writes a campaign before its first run, and removes the leftovers of killed processes.
    ///
    /// # Errors
    /// Writing failed: `H005`, `H006`; `H026` its id is not an id.
    pub fn begin_campaign(&self, record: &CampaignRecord) -> Result<(), Diagnostics> {
        self.check_ids("campaign", [&record.id])?;
        self.remove_orphans()?;
        let number = self.campaign_ids()?.len() as u64;
        self.enter_quads(
            &write_campaign::beginning(record, number),
            "writing the campaign",
        )?;
        self.flush()
    }

    /// Removes the end of a campaign that is resumed, and the leftovers of killed processes.
    ///
    /// # Errors
    /// Writing failed: `H005`, `H006`.
    pub fn reopen_campaign(&self, id: &str) -> Result<(), Diagnostics> {
        let (campaign, store) = (campaign_node(id), self.store()?);
        let taken_back = || -> Result<(), StorageError> {
            let mut ends = Vec::new();
            for property in write_campaign::end_properties() {
                let (subject, graph) = (campaign.as_ref().into(), GraphNameRef::DefaultGraph);
                for quad in store.quads_for_pattern(
                    Some(subject),
                    Some(property.as_ref()),
                    None,
                    Some(graph),
                ) {
                    ends.push(quad?);
                }
            }
            let mut transaction = store.start_transaction()?;
            ends.iter().for_each(|quad| transaction.remove(quad));
            transaction.commit()
        };
        taken_back().map_err(|error| self.fault("reopening the campaign", &error))?;
        self.remove_orphans()?;
        self.flush()
    }

    /// Stores the outlines of several runs of a campaign in one file: all of them or, on an error,
    /// none.
    ///
    /// # Errors
    /// As [`History::commit`].
    pub fn commit_outlines(
        &self,
        campaign: &str,
        records: &[RunRecord],
    ) -> Result<(), Diagnostics> {
        self.check_ids("run", records.iter().map(|record| &record.id))?;
        let doing = "writing outlines";
        let outlines = records
            .iter()
            .map(Outline::of)
            .collect::<Result<Vec<_>, _>>();
        let outlines = outlines
            .map_err(|error| Diagnostic::error("H006", format!("{doing} failed: {error}")))?;
        self.folder.begin_outlines()?;
        self.shelf()
            .add_all(campaign, &outlines)
            .map_err(|error| fault::io(self.dir(), doing, &error))
    }

    /// Stores an outline.
    pub(super) fn enter_outline(
        &self,
        campaign: &str,
        index: u64,
        outline: &Outline,
    ) -> Result<(), Diagnostics> {
        let doing = format!("writing run {campaign}-{}", index + 1);
        self.folder.begin_outlines()?;
        let shelf = self.shelf();
        let synced = self.syncs_each_run();
        shelf
            .add(campaign, index, outline, synced)
            .and_then(|()| {
                match self.single_outlines.fetch_add(1, Ordering::Relaxed) % Shelf::RUNS_IN_A_FILE {
                    last if last + 1 == Shelf::RUNS_IN_A_FILE => shelf.pack(campaign),
                    _ => Ok(()),
                }
            })
            .map_err(|error| fault::io(self.dir(), &doing, &error))
    }

    /// Flushes all committed data to the disk.
    ///
    /// # Errors
    /// Writing failed: `H005`, `H006`.
    pub fn flush(&self) -> Result<(), Diagnostics> {
        self.sync_journal()?;
        self.bare_store()?
            .flush()
            .map_err(|error| self.fault("writing to the disk", &error))
    }

    /// Writes the end of a campaign, and flushes everything to the disk.
    ///
    /// # Errors
    /// Writing failed: `H005`, `H006`.
    pub fn finish_campaign(&self, id: &str, end: &CampaignEnd) -> Result<(), Diagnostics> {
        self.enter_quads(
            &write_campaign::end(id, end),
            "writing the end of the campaign",
        )?;
        self.shelf()
            .pack(id)
            .map_err(|error| fault::io(self.dir(), "writing outlines", &error))?;
        self.load_journal()?;
        self.flush()?;
        self.reopen()
    }

    /// Returns all campaigns, sorted by start, then by id.
    ///
    /// # Errors
    /// The store can't be read; `H026` an id is not an id.
    pub fn campaigns(&self) -> Result<Vec<CampaignRow>, Diagnostics> {
        let mut campaigns = lists::campaigns(&*self.store_with(lists::of_campaigns)?)
            .map_err(|error| self.query_fault(&error))?;
        for campaign in &mut campaigns {
            campaign.runs += self.count_outlined(&campaign.id)?;
        }
        self.check_ids("campaign", campaigns.iter().map(|campaign| &campaign.id))?;
        Ok(campaigns)
    }

    /// Returns the record of a campaign.
    ///
    /// # Errors
    /// `H014` there is no such campaign.
    pub fn campaign(&self, id: &str) -> Result<CampaignRecord, Diagnostics> {
        let record = read_campaign::beginning(&*self.store_with(Wanted::campaigns)?, id)
            .map_err(|error| self.fault("reading a campaign", &error))?;
        match record {
            Some(record) => Ok(record),
            None => {
                let known = self.campaign_ids()?;
                let help = match nearest(id, known.iter().map(String::as_str)) {
                    Some(found) => format!("did you mean `{found}`?"),
                    None => "`actcheck list` shows all runs with their campaigns".to_owned(),
                };
                let message = format!(
                    "the history `{}` has no campaign `{id}`",
                    self.dir().display()
                );
                Err(Diagnostic::error("H014", message).help(help).into())
            }
        }
    }

    /// Returns the runs that match a filter, sorted by the start of their campaign, then by index.
    /// An unknown campaign has no runs.
    ///
    /// # Errors
    /// The store can't be read; `H026` an id is not an id.
    pub fn runs(&self, filter: &RunFilter) -> Result<Vec<RunRow>, Diagnostics> {
        let mut runs = Vec::new();
        let wish = Wish {
            judgements: Judgements::None,
            ..Wish::default()
        };
        self.each_judged(filter, wish, &mut |run| runs.push(run.row))?;
        Ok(runs)
    }

    /// The runs that are kept whole.
    pub(super) fn whole_runs(&self) -> Result<Vec<RunRow>, Diagnostics> {
        lists::runs(
            &*self.store_with(lists::of_runs)?,
            &RunFilter::default(),
            self.threads(),
        )
        .map_err(|error| self.query_fault(&error))
    }

    /// Returns the ids of all campaigns except those of [`History::selected_campaigns`], sorted by
    /// start.
    ///
    /// # Errors
    /// The store can't be read; `H026` an id is not an id.
    pub fn unselected_campaigns(&self) -> Result<Vec<String>, Diagnostics> {
        let selected = self.selected_campaigns()?;
        let store = self.store_with(lists::of_campaigns)?;
        let mut campaigns =
            lists::campaign_ids(&store).map_err(|error| self.query_fault(&error))?;
        campaigns.retain(|id| !selected.contains(id));
        self.check_ids("campaign", &campaigns)?;
        Ok(campaigns)
    }

    /// Returns the campaigns of [`History::unselected_campaigns`], each with its run ids, sorted as
    /// strings.
    ///
    /// # Errors
    /// The store can't be read; `H026` an id is not an id.
    pub fn run_ids(&self) -> Result<Vec<(String, Vec<String>)>, Diagnostics> {
        let mut found = Vec::new();
        for id in self.unselected_campaigns()? {
            let store = self.store_with(|| Wanted::values(&["act:campaign"]))?;
            let runs = subjects(&*store, "act:campaign", &campaign_node(&id));
            let runs = runs.map_err(|error| self.fault("reading", &error))?;
            let mut runs: Vec<String> = runs
                .into_iter()
                .map(|run| short_id(&text_of(&run.into())).to_owned())
                .collect();
            self.check_ids("run", &runs)?;
            runs.extend(self.outlined_ids(Some(&id))?);
            runs.sort();
            found.push((id, runs));
        }
        Ok(found)
    }

    /// Returns the outcomes of the runs that match a filter, in the order of [`History::runs`],
    /// then by step and property.
    ///
    /// # Errors
    /// The store can't be read.
    pub fn outcomes(&self, filter: &RunFilter) -> Result<Vec<OutcomeRow>, Diagnostics> {
        let mut outcomes = Vec::new();
        self.each_judged(filter, Wish::default(), &mut |run| {
            outcomes.extend(run.outcome_rows())
        })?;
        Ok(outcomes)
    }

    /// Returns all details of a run, named as in [`History::resolve`].
    ///
    /// # Errors
    /// `H008` there is no such run.
    pub fn run(&self, name: &str) -> Result<RunDetail, Diagnostics> {
        let id = self.resolve(name)?;
        if let Some(run) = self.outlined_run(&id)? {
            return Ok(run);
        }
        let node = run_node(&id);
        let store = self.store_with(|| Wanted::run(node.as_str()))?;
        let read = match self.copied_parts(&id, &store) {
            Some(parts) => detail::read_with(&*store, &node, parts),
            None => detail::read(&*store, &node),
        };
        read.map_err(|error| self.fault("reading a run", &error))
    }

    /// Calls `each` with the health data of every run of a campaign: first those of outlines, file
    /// by file, then those of runs that are kept whole, by index.
    ///
    /// # Errors
    /// `H014` there is no such campaign; otherwise as [`History::trace`].
    pub fn each_vitals(
        &self,
        campaign: &str,
        mut each: impl FnMut(&RunVitals),
    ) -> Result<(), Diagnostics> {
        self.campaign(campaign)?;
        self.each_outlined_vitals(campaign, &mut each)?;
        let filter = RunFilter {
            campaign: Some(campaign.to_owned()),
            ..RunFilter::default()
        };
        let whole = lists::runs(&*self.store_with(lists::of_runs)?, &filter, self.threads())
            .map_err(|error| self.query_fault(&error))?;
        let store = self.store_with(vitals::wanted)?;
        let fault = |error| self.fault("reading a run", &error);
        let columns = vitals::Columns::read(&store).map_err(fault)?;
        for row in whole {
            let choices = self.decoded(&row.run, trace_file::decode_choices)?;
            each(&columns.of(&store, &row, choices).map_err(fault)?);
        }
        Ok(())
    }

    /// Answers a SPARQL query. The prefixes of [`actcheck_base::names::PREFIXES`] need no
    /// declaration.
    ///
    /// The default graph holds campaigns, runs, executions, scenes and outcomes; facts are in the
    /// graphs that `act:before`, `act:after` and `act:during` name.
    ///
    /// # Errors
    /// `H010` the text is not a query, `H011` it is an update, `H012` the evaluation failed.
    pub fn query(&self, sparql: &str) -> Result<QueryAnswer, Diagnostics> {
        self.query_from(&Source::new("query", sparql), &Cancel::new())
    }

    /// Like [`History::query`], for a source text with a name, and with a handle that stops the
    /// query.
    ///
    /// # Errors
    /// As [`History::query`]; `H013` the query was stopped.
    pub fn query_from(&self, text: &Source, cancel: &Cancel) -> Result<QueryAnswer, Diagnostics> {
        query::answer(self, text, cancel)
    }

    pub(super) fn has_run(&self, id: &str) -> Result<bool, Diagnostics> {
        Ok(self.is_outline(id)? || self.is_whole(id)?)
    }

    /// Whether a run is kept whole, by its id.
    ///
    /// # Errors
    /// The store can't be read.
    pub fn is_whole(&self, id: &str) -> Result<bool, Diagnostics> {
        let (run, class) = (run_node(id), iri("act:Run"));
        // A question about one run is often followed by questions about others.
        self.store_with(|| Wanted::individuals("act:Run"))?
            .contains(QuadRef::new(
                &run,
                rdf::TYPE,
                &class,
                GraphNameRef::DefaultGraph,
            ))
            .map_err(|error| self.fault("reading", &error))
    }

    /// Returns the ids of all individuals of a class, sorted as strings.
    pub(super) fn ids(&self, class: &str) -> Result<Vec<String>, Diagnostics> {
        let store = self.store_with(|| Wanted::individuals(class))?;
        let class = iri(class);
        let found = subjects(&*store, "rdf:type", class.as_ref())
            .map_err(|error| self.fault("reading", &error))?;
        let mut ids: Vec<String> = found
            .into_iter()
            .map(|node| short_id(&text_of(&node.into())).to_owned())
            .collect();
        if class.as_str().ends_with("Run") {
            ids.extend(self.outlined_ids(None)?);
        }
        ids.sort();
        self.check_ids(
            if class.as_str().ends_with("Run") {
                "run"
            } else {
                "campaign"
            },
            &ids,
        )?;
        Ok(ids)
    }

    /// Ids are parts of file names, so those of a foreign history must not lead out of its folder.
    pub(super) fn check_ids<'a>(
        &self,
        kind: &str,
        ids: impl IntoIterator<Item = &'a String>,
    ) -> Result<(), Diagnostics> {
        match ids.into_iter().find(|id| !names::is_id(id)) {
            Some(id) => Err(fault::foreign_id(self.dir(), kind, id)),
            None => Ok(()),
        }
    }

    /// A warning if campaigns of the history began later than now: the clock was ahead then, or is
    /// behind now.
    ///
    /// # Errors
    /// The store can't be read.
    pub fn clock_warning(&self, now: &str) -> Result<Option<Diagnostic>, Diagnostics> {
        let campaigns = self.campaigns()?;
        let Some(ahead) = campaigns
            .iter()
            .filter(|row| row.started.as_str() > now)
            .max_by_key(|row| &row.started)
        else {
            return Ok(None);
        };
        let message = format!(
            "campaign {} began at {}, but it is {now} now",
            ahead.id, ahead.started
        );
        let help = "the clock was ahead then, or is behind now: set it; campaigns keep the order in which they were added";
        Ok(Some(Diagnostic::warning("H032", message).help(help)))
    }

    pub(super) fn campaign_ids(&self) -> Result<Vec<String>, Diagnostics> {
        self.ids("act:Campaign")
    }

    /// Removes traces without a run. Only killed processes leave them, and their campaigns have no
    /// end.
    fn remove_orphans(&self) -> Result<(), Diagnostics> {
        self.shelf().clean();
        let mut ended = BTreeMap::new();
        let below = self.folder.below();
        below.remove_leftovers(&self.folder.traces());
        for file in below.files(&self.folder.traces()) {
            let name = file.file_name().unwrap_or_default().to_string_lossy();
            let orphan = match name.strip_suffix(".trace") {
                None => false,
                Some(run) => {
                    let campaign = run.rsplit_once('-').map_or(run, |(campaign, _)| campaign);
                    if !ended.contains_key(campaign) {
                        ended.insert(
                            campaign.to_owned(),
                            self.has_ended(&campaign_node(campaign))?,
                        );
                    }
                    !ended[campaign] && !self.has_run(run)?
                }
            };
            if orphan {
                // Harmless if it remains.
                let _ = below.remove(&file);
            }
        }
        Ok(())
    }

    fn has_ended(&self, campaign: &NamedNode) -> Result<bool, Diagnostics> {
        let property = iri("prov:endedAtTime");
        let store = self.store()?;
        let mut ends = store.quads_for_pattern(
            Some(campaign.into()),
            Some(property.as_ref()),
            None,
            Some(GraphNameRef::DefaultGraph),
        );
        ends.next()
            .transpose()
            .map(|end| end.is_some())
            .map_err(|error| self.fault("reading", &error))
    }

    pub(super) fn fault(&self, doing: &str, error: &StorageError) -> Diagnostics {
        fault::store(self.dir(), doing, error)
    }

    pub(super) fn query_fault(&self, error: &QueryEvaluationError) -> Diagnostics {
        match error {
            QueryEvaluationError::Dataset(error) => fault::damaged(self.dir(), &error.to_string()),
            other => Diagnostic::error(
                "H012",
                format!(
                    "reading the history `{}` failed: {other}",
                    self.dir().display()
                ),
            )
            .into(),
        }
    }
}

/// Computes a campaign's id: a letter and three letters or digits, without characters that look
/// alike.
pub(super) fn campaign_id(config_digest: &str, seed: u64, counter: u64) -> String {
    const LETTERS: &[u8] = b"abcdefghjkmnpqrstvwxyz";
    const ALL: &[u8] = b"abcdefghjkmnpqrstvwxyz23456789";
    let mut digest = Digest::new();
    digest.update(config_digest.as_bytes());
    digest.update(&seed.to_le_bytes());
    digest.update(&counter.to_le_bytes());
    let bytes = digest.finish().into_bytes();
    let number = |at: usize| {
        bytes[at..at + 4]
            .iter()
            .fold(0usize, |sum, byte| sum * 256 + usize::from(*byte))
    };
    [(LETTERS, 0), (ALL, 4), (ALL, 8), (ALL, 12)]
        .map(|(set, at)| char::from(set[number(at) % set.len()]))
        .iter()
        .collect()
}
