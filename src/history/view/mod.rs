//! RDF as a view of the stored runs: the statements that queries demand, in memory.

mod dataset;
mod demand;
mod interner;
mod orders;

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;
use std::sync::mpsc::sync_channel;

use oxigraph::model::{GraphName, NamedNode, Quad};

use crate::campaign::{CampaignRuns, RunAt};
use crate::campaign_state::CampaignState;
use crate::campaigns::StoredCampaigns;
use crate::folder::FolderExtent;
use crate::ids::run_id;
use crate::segment::{LaterJudgement, SegmentColumn};
use crate::statements::{Statements, iri};
use crate::trace_codec::decode_head;
use crate::write_run::{RECHECKED, run_node};
use crate::{fault, graphs, write_campaign, write_run};
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_facts::{extract, extract_complete};

pub(crate) use dataset::Dataset;
pub(crate) use demand::Demand;

/// Largest number of statements in memory: they take about two gigabytes.
const MOST_STATEMENTS: u64 = 20_000_000;
/// Number of runs whose statements are counted before those of all runs are made.
const SAMPLED: usize = 12;
/// Number of runs that a thread makes statements of at a time.
const CHUNK: usize = 64;
/// Number of chunks that each thread is ahead.
const AHEAD: usize = 4;

/// The statements that queries have demanded so far.
#[derive(Debug, Default)]
pub(crate) struct View {
    /// The state of the history that it shows.
    extent: Arc<FolderExtent>,
    demand: Demand,
    taken: HashMap<String, Taken>,
    dataset: Arc<Dataset>,
}

/// The parts of a campaign that are in a view.
#[derive(Debug)]
struct Taken {
    state: Arc<CampaignState>,
    /// Number of rows of each segment, by its number.
    rows: BTreeMap<u32, usize>,
    later: usize,
}

/// The facts that are written into the graphs of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum WithFacts {
    /// None.
    No,
    /// Those that queries ask for.
    Lean,
    /// All.
    Complete,
}

/// The statements about a run, and the names of its graphs.
#[derive(Debug, Default)]
pub(crate) struct RunStatements {
    pub quads: Vec<Quad>,
    graphs: Vec<NamedNode>,
}

/// A campaign, and those of its runs whose statements are missing in a view.
struct Missing {
    state: Arc<CampaignState>,
    runs: Arc<CampaignRuns>,
    /// Indices of the runs.
    indices: Vec<u64>,
}

impl View {
    /// Returns the demanded statements, and maybe others. `threads`: the greatest number of threads
    /// that make them.
    ///
    /// # Errors
    /// `H030` these are too many; a file is damaged or can't be read.
    pub(crate) fn dataset(
        &mut self,
        stored: &StoredCampaigns,
        threads: usize,
        demand: Demand,
    ) -> Result<Arc<Dataset>, Diagnostics> {
        let source = RunSource { stored, threads };
        let extent = source.stored.extent()?;
        if self.extent != extent || source.stored.is_salvaged() {
            self.follow(source)?;
            self.extent = Arc::clone(&extent);
        }
        let missing = demand.clone().beyond(&self.demand);
        if !missing.is_empty() {
            let all = source.all()?;
            let count = source.estimate(&all, &missing)?;
            if count + self.dataset.len() as u64 <= MOST_STATEMENTS {
                self.widen(source, &all, missing)?;
            } else {
                // Earlier queries needed the others.
                let count = source.estimate(&all, &demand)?;
                if count > MOST_STATEMENTS {
                    return Err(too_many(source.stored, count));
                }
                *self = Self::default();
                self.follow(source)?;
                self.extent = extent;
                self.widen(source, &all, demand)?;
            }
        }
        Ok(Arc::clone(&self.dataset))
    }

    /// Adds the statements of a further demand about all runs.
    fn widen(
        &mut self,
        source: RunSource<'_>,
        all: &[Missing],
        demand: Demand,
    ) -> Result<(), Diagnostics> {
        let dataset = Arc::make_mut(&mut self.dataset);
        let added = source.add_campaigns(&demand, dataset);
        let added = added.and_then(|()| source.add_runs(all, &demand, dataset));
        dataset.merge_pending();
        added?;
        self.demand.add(demand);
        Ok(())
    }

    /// Adds the statements of runs and judgements that are new since the state that a view shows.
    fn follow(&mut self, source: RunSource<'_>) -> Result<(), Diagnostics> {
        let mut present = source.all()?;
        let known = present
            .iter()
            .filter_map(|own| Some((self.taken.get(&own.runs.id)?, own)));
        let grown = known.filter(|(taken, own)| taken.is_grown_to(own)).count();
        if grown < self.taken.len() {
            let demand = std::mem::take(&mut self.demand);
            *self = Self {
                demand,
                ..Self::default()
            };
        }
        let taken: HashMap<String, Taken> = present
            .iter()
            .map(|own| (own.runs.id.clone(), Taken::of(own)))
            .collect();
        if !self.demand.is_empty() {
            for own in &mut present {
                if let Some(taken) = self.taken.get(&own.runs.id) {
                    own.indices = taken.new_in(&own.runs);
                }
            }
            let demand = self.demand.clone();
            let dataset = Arc::make_mut(&mut self.dataset);
            let added = source.add_campaigns(&demand, dataset);
            let added = added.and_then(|()| source.add_runs(&present, &demand, dataset));
            dataset.merge_pending();
            if let Err(faults) = added {
                // It is made anew by the next query.
                *self = Self::default();
                return Err(faults);
            }
        }
        self.taken = taken;
        Ok(())
    }
}

impl Taken {
    fn of(own: &Missing) -> Self {
        let segments = own.runs.segments.iter();
        Self {
            state: Arc::clone(&own.state),
            rows: segments
                .map(|segment| (segment.number(), segment.rows().len()))
                .collect(),
            later: own.runs.later.len(),
        }
    }

    /// Whether a campaign has all that was taken: runs, judgements and an end are only added.
    fn is_grown_to(&self, own: &Missing) -> bool {
        let mut grown = (*self.state).clone();
        grown.end = grown.end.or_else(|| own.state.end.clone());
        grown.segments.clone_from(&own.state.segments);
        let present = Self::of(own);
        let has = |(number, rows): (&u32, &usize)| {
            present.rows.get(number).is_some_and(|own| own >= rows)
        };
        grown == *own.state && self.later <= present.later && self.rows.iter().all(has)
    }

    /// The indices of the runs that have not been taken, or were judged since.
    fn new_in(&self, runs: &CampaignRuns) -> Vec<u64> {
        let mut indices = Vec::new();
        for segment in &runs.segments {
            let known = self.rows.get(&segment.number()).copied();
            let new = segment.rows().iter().skip(known.unwrap_or_default());
            indices.extend(new.map(|row| row.index));
        }
        indices.extend(runs.later.iter().skip(self.later).map(|own| own.index));
        indices.sort_unstable();
        indices.dedup();
        indices
    }
}

/// The stored runs of which statements are made.
#[derive(Clone, Copy)]
struct RunSource<'s> {
    stored: &'s StoredCampaigns,
    /// Greatest number of threads that make them.
    threads: usize,
}

impl RunSource<'_> {
    fn add_campaigns(&self, demand: &Demand, dataset: &mut Dataset) -> Result<(), Diagnostics> {
        for state in self.stored.states()? {
            let mut statements = Statements::new(demand);
            write_campaign::write(&state, &mut statements);
            dataset.extend(statements.quads);
        }
        Ok(())
    }

    /// All campaigns with all their runs.
    fn all(&self) -> Result<Vec<Missing>, Diagnostics> {
        let mut all = Vec::new();
        for state in self.stored.states()? {
            let runs = self.stored.runs_of(&state.record.id)?;
            let indices = runs.iter().map(|run| run.row.index).collect();
            all.push(Missing {
                state,
                runs,
                indices,
            });
        }
        Ok(all)
    }

    /// The number of demanded statements about runs, from those about a few of them.
    fn estimate(&self, all: &[Missing], demand: &Demand) -> Result<u64, Diagnostics> {
        let total: usize = all.iter().map(|of| of.indices.len()).sum();
        if total == 0 {
            return Ok(0);
        }
        let step = total.div_ceil(SAMPLED);
        let runs = all
            .iter()
            .flat_map(|of| of.indices.iter().map(move |index| (of, *index)));
        let (mut sampled, mut count) = (0, 0);
        for (of, index) in runs.step_by(step) {
            if let Some(run) = of.runs.find(index) {
                let later = of.runs.later_of(index);
                let maker = StatementMaker::new(self.stored, &of.runs.id);
                let made = maker.statements(run, &later, demand, WithFacts::Lean)?;
                count += made.quads.len();
                sampled += 1;
            }
        }
        Ok((count * total / sampled.max(1)) as u64)
    }

    /// Adds the demanded statements about runs. Several threads make them; the order in which they
    /// are added does not depend on their number.
    fn add_runs(
        &self,
        missing: &[Missing],
        demand: &Demand,
        dataset: &mut Dataset,
    ) -> Result<(), Diagnostics> {
        let chunks: Vec<(&CampaignRuns, &[u64])> = missing
            .iter()
            .flat_map(|of| of.indices.chunks(CHUNK).map(|chunk| (&*of.runs, chunk)))
            .collect();
        let make = |(runs, indices): (&CampaignRuns, &[u64])| {
            let maker = StatementMaker::new(self.stored, &runs.id);
            let mut made = Vec::with_capacity(indices.len());
            for index in indices {
                let Some(run) = runs.find(*index) else {
                    continue;
                };
                let later = runs.later_of(*index);
                made.push(maker.statements(run, &later, demand, WithFacts::Lean)?);
            }
            Ok::<_, Diagnostics>(made)
        };
        let mut count = dataset.len() as u64;
        let mut take = |made: Vec<RunStatements>| {
            for RunStatements { quads, graphs } in made {
                count += quads.len() as u64;
                dataset.extend(quads);
                for graph in graphs {
                    dataset.add_graph(graph.as_ref().into());
                }
            }
            // The runs that were counted before may have far fewer than the others.
            if count > 2 * MOST_STATEMENTS {
                return Err(too_many(self.stored, count));
            }
            Ok(())
        };
        let threads = self.threads.min(chunks.len());
        if threads < 2 {
            for chunk in chunks {
                take(make(chunk)?)?;
            }
            return Ok(());
        }
        std::thread::scope(|scope| {
            let receivers: Vec<_> = (0..threads)
                .map(|thread| {
                    let (sender, receiver) = sync_channel(AHEAD);
                    let (chunks, make) = (&chunks, &make);
                    scope.spawn(move || {
                        for chunk in chunks.iter().skip(thread).step_by(threads) {
                            let made = make(*chunk);
                            let is_last = made.is_err();
                            // Without a receiver, no further chunk is needed.
                            if sender.send(made).is_err() || is_last {
                                return;
                            }
                        }
                    });
                    receiver
                })
                .collect();
            for number in 0..chunks.len() {
                // A thread that ended without its chunk has panicked, which the scope reports.
                if let Ok(made) = receivers[number % threads].recv() {
                    take(made?)?;
                }
            }
            Ok(())
        })
    }
}

/// Makes the statements about runs of a campaign.
#[derive(Clone, Copy)]
pub(crate) struct StatementMaker<'s> {
    stored: &'s StoredCampaigns,
    campaign: &'s str,
}

impl<'s> StatementMaker<'s> {
    pub(crate) fn new(stored: &'s StoredCampaigns, campaign: &'s str) -> Self {
        Self { stored, campaign }
    }

    /// The demanded statements about a run. `later`: its later judgements.
    ///
    /// # Errors
    /// `H007` the run is damaged.
    pub(crate) fn statements(
        &self,
        run: RunAt<'_>,
        later: &[&LaterJudgement],
        demand: &Demand,
        facts: WithFacts,
    ) -> Result<RunStatements, Diagnostics> {
        let id = run_id(self.campaign, run.row.index);
        let node = run_node(&id);
        let rechecked = iri(RECHECKED);
        let mut made = RunStatements::default();
        if demand.has_details_of(&node, rechecked.as_str()) {
            let dir = self.stored.folder.dir();
            let unread =
                |why| fault::run(dir, &id, &run.segment.file(SegmentColumn::Details), &why);
            let stored = run.segment.run(run.row).map_err(unread)?;
            let mut statements = Statements::new(demand);
            write_run::write(&stored, self.campaign, &mut statements);
            made.quads = statements.quads;
            if !later.is_empty() {
                let mut statements = Statements::in_graph(demand, Some(rechecked.clone()));
                write_run::write_later(&stored, self.campaign, later, &mut statements);
                made.quads.extend(statements.quads);
            }
        }
        if !later.is_empty() && demand.has_graph(rechecked.as_str()) {
            made.graphs.push(rechecked);
        }
        if facts != WithFacts::No && demand.has_facts_of(&node) {
            self.add_facts(&id, run, demand, facts, &mut made)?;
        }
        Ok(made)
    }

    fn add_facts(
        &self,
        id: &str,
        run: RunAt<'_>,
        demand: &Demand,
        facts: WithFacts,
        made: &mut RunStatements,
    ) -> Result<(), Diagnostics> {
        let dir = self.stored.folder.dir();
        let file = run.segment.file(SegmentColumn::States);
        let unread = |why| fault::run(dir, id, &file, &why);
        let states = run.segment.states(run.row);
        let (_, trace) = decode_head(&states.map_err(unread)?)
            .map_err(|why| fault::undecodable(dir, id, &file, &why.to_string()))?;
        let node = run_node(id);
        let quads = match facts {
            WithFacts::Complete => graphs::complete(&extract_complete(&trace), &node),
            WithFacts::Lean | WithFacts::No => {
                let mut quads = Vec::new();
                graphs::write(&extract(&trace), &node, &mut quads);
                quads
            }
        };
        let mut last = None;
        for quad in quads {
            let GraphName::NamedNode(graph) = &quad.graph_name else {
                continue;
            };
            if last.as_ref() != Some(graph) {
                if demand.has_graph(graph.as_str()) {
                    made.graphs.push(graph.clone());
                }
                last = Some(graph.clone());
            }
            let (subject, property) = (quad.subject.as_ref(), quad.predicate.as_str());
            if demand.has(
                subject,
                property,
                quad.object.as_ref(),
                Some(graph.as_str()),
            ) {
                made.quads.push(quad);
            }
        }
        Ok(())
    }
}

/// The error of a query that needs too many statements.
fn too_many(stored: &StoredCampaigns, count: u64) -> Diagnostics {
    let message = format!(
        "the query needs about {} million statements about the runs of `{}`, more than fit in memory",
        count.div_ceil(1_000_000),
        stored.folder.dir().display(),
    );
    Diagnostic::error("H030", message)
        .help(
            "ask for fewer properties, or for one campaign's runs in a history of its own (`actcheck merge`); or export tables \
             (`actcheck export tables DIR`), for which docs/history.md has the shipped questions",
        )
        .into()
}

#[cfg(test)]
mod w3c_tests;
