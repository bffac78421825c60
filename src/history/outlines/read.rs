//! Reads outlines as runs.

use std::collections::{BTreeSet, HashMap, HashSet};
use std::sync::mpsc::{SyncSender, sync_channel};

use oxigraph::model::Quad;
use oxigraph::store::Store;

use crate::outlines::file::{Opened, Outline};
use crate::outlines::loaded::Loaded;
use crate::outlines::row::Outlined;
use crate::outlines::shelf::{IndexSet, Needed, Shelf, Unread, are_apart, unread};
use crate::quad_source::RunQuads;
use crate::threads::joined;
use crate::{History, RunDetail, RunFilter, RunRow, RunVitals, detail, trace_file};
use crate::{folder, graphs, merge, write_run};
use actcheck_base::Diagnostics;
use actcheck_data::{Choice, Trace};
use actcheck_facts::extract;

/// Number of files that a thread reads ahead of the one that uses them.
const FILES_AHEAD: usize = 2;

/// The campaign and the index of a run, from its id.
fn place_of(run: &str) -> Option<(&str, u64)> {
    let (campaign, number) = run.rsplit_once('-')?;
    Some((campaign, number.parse::<u64>().ok()?.checked_sub(1)?))
}

impl History {
    /// The folder of its outlines.
    pub(crate) fn shelf(&self) -> Shelf {
        Shelf::new(self.dir())
    }

    /// Calls `each` with the outlines that match a filter, by campaign, then by index.
    ///
    /// # Errors
    /// `H007` a file is damaged.
    pub(crate) fn each_outlined(
        &self,
        filter: &RunFilter,
        each: &mut dyn FnMut(Outlined<'_>),
    ) -> Result<(), Diagnostics> {
        if !self.shelf().exists() {
            return Ok(());
        }
        let campaigns = match &filter.campaign {
            Some(campaign) => BTreeSet::from([campaign.clone()]),
            None => self
                .shelf()
                .files(None)
                .into_iter()
                .map(|file| file.campaign)
                .collect(),
        };
        let mut each = |outlined: Outlined<'_>| {
            if outlined.matches(filter) {
                each(outlined);
            }
        };
        for campaign in &campaigns {
            let mut done = IndexSet::default();
            self.of_outlines(&mut |shelf| shelf.each_row(campaign, &mut done, &mut each))?;
        }
        Ok(())
    }

    /// Number of runs of a campaign that have only an outline.
    ///
    /// # Errors
    /// `H007` a file is damaged.
    pub(crate) fn count_outlined(&self, campaign: &str) -> Result<u64, Diagnostics> {
        if !self.shelf().exists() {
            return Ok(0);
        }
        self.of_outlines(&mut |shelf| {
            let mut count = 0;
            shelf.each_file(Some(campaign), Needed::Indices, &mut |_, opened, there| {
                count += opened.indices()?.len() as u64 - there.len() as u64;
                Ok(())
            })?;
            Ok(count)
        })
    }

    /// The ids of all runs that have only an outline, unsorted.
    ///
    /// # Errors
    /// `H007` a file is damaged.
    pub fn outline_ids(&self) -> Result<Vec<String>, Diagnostics> {
        self.outlined_ids(None)
    }

    /// The ids of the outlines of a campaign, or of all, unsorted.
    ///
    /// # Errors
    /// `H007` a file is damaged.
    pub(crate) fn outlined_ids(&self, campaign: Option<&str>) -> Result<Vec<String>, Diagnostics> {
        if !self.shelf().exists() {
            return Ok(Vec::new());
        }
        self.of_outlines(&mut |shelf| {
            let mut ids = Vec::new();
            shelf.each_file(campaign, Needed::Indices, &mut |file, opened, there| {
                let own = opened
                    .indices()?
                    .into_iter()
                    .filter(|index| !there.contains(index));
                ids.extend(own.map(|index| format!("{}-{}", file.campaign, index + 1)));
                Ok(())
            })?;
            Ok(ids)
        })
    }

    /// Sorts ids of runs of a campaign by their place in the files of outlines, so that reading
    /// them in this order reads each file once: files of shards have every n-th run. Runs that are
    /// kept whole come last.
    ///
    /// # Errors
    /// `H007` a file is damaged.
    pub fn sort_as_stored<S: AsRef<str>>(
        &self,
        campaign: &str,
        runs: &mut [S],
    ) -> Result<(), Diagnostics> {
        if !self.shelf().exists() {
            return Ok(());
        }
        let places = self.places(campaign)?;
        runs.sort_by_key(|run| {
            let index = place_of(run.as_ref()).map_or(u64::MAX, |(_, index)| index);
            (places.get(&index).copied().unwrap_or(usize::MAX), index)
        });
        Ok(())
    }

    /// Sorts the runs of each campaign whose files of outlines overlap as
    /// [`History::sort_as_stored`] does. The runs of other campaigns remain sorted by index. The
    /// argument must be sorted by campaign.
    ///
    /// # Errors
    /// `H007` a file is damaged.
    pub fn sort_interleaved(&self, runs: &mut [RunRow]) -> Result<(), Diagnostics> {
        for runs in runs.chunk_by_mut(|one, next| one.campaign == next.campaign) {
            let Some(campaign) = runs.first().map(|run| run.campaign.clone()) else {
                continue;
            };
            if !are_apart(&self.shelf().files(Some(&campaign))) {
                let places = self.places(&campaign)?;
                runs.sort_by_key(|run| {
                    (
                        places.get(&run.index).copied().unwrap_or(usize::MAX),
                        run.index,
                    )
                });
            }
        }
        Ok(())
    }

    /// The place of each outline of a campaign in its files, by index.
    fn places(&self, campaign: &str) -> Result<HashMap<u64, usize>, Diagnostics> {
        self.of_outlines(&mut |shelf| {
            let mut places: HashMap<u64, usize> = HashMap::new();
            shelf.each_file(Some(campaign), Needed::Indices, &mut |_, opened, _| {
                for index in opened.indices()? {
                    let next = places.len();
                    places.entry(index).or_insert(next);
                }
                Ok(())
            })?;
            Ok(places)
        })
    }

    /// Reads a part of the outline of a run by `read`, which gets the run's position in the file.
    /// Returns `None` if the run has no outline.
    fn of_outline<T>(
        &self,
        run: &str,
        read: impl Fn(&Loaded, usize) -> Result<T, String>,
    ) -> Result<Option<T>, Diagnostics> {
        let Some((campaign, index)) = place_of(run).filter(|_| self.shelf().exists()) else {
            return Ok(None);
        };
        self.of_outlines(&mut |shelf| {
            let known = self.loaded.with(campaign, index);
            for file in known
                .is_none()
                .then(|| shelf.files_with(campaign, index))
                .into_iter()
                .flatten()
            {
                let damaged = |why| Unread::Damaged(file.clone(), why);
                let bytes = folder::read(&file).map_err(|error| unread(&file, &error))?;
                self.loaded
                    .add(Loaded::new(campaign, file.clone(), bytes).map_err(damaged)?);
            }
            let Some(loaded) = known.or_else(|| self.loaded.with(campaign, index)) else {
                return Ok(None);
            };
            let damaged = |why| Unread::Damaged(loaded.path.clone(), why);
            loaded
                .position(index)
                .map(|at| read(&loaded, at).map_err(damaged))
                .transpose()
        })
    }

    /// Whether a run has only an outline, by its id.
    ///
    /// # Errors
    /// `H007` a file is damaged.
    pub fn is_outline(&self, run: &str) -> Result<bool, Diagnostics> {
        Ok(self.of_outline(run, |_, _| Ok(()))?.is_some())
    }

    /// The outline of a run. Returns `None` if it has none.
    pub(crate) fn outline(&self, run: &str) -> Result<Option<Outline>, Diagnostics> {
        self.of_outline(run, |loaded, at| {
            Ok(Outline {
                rows: loaded.rows()?.only(at),
                quads: loaded.statements(at)?.to_vec(),
                head: loaded.head(at)?.to_vec(),
            })
        })
    }

    /// The statements of a run that has an outline. Returns `None` if it has none.
    pub(crate) fn outlined_quads(&self, run: &str) -> Result<Option<RunQuads>, Diagnostics> {
        let quads = self.of_outline(run, |loaded, at| {
            loaded.statements(at).map(<[Quad]>::to_vec)
        })?;
        Ok(quads.map(RunQuads::new))
    }

    /// Calls `each` with all statements of every outline, also its facts (`with_facts`), run by
    /// run.
    ///
    /// # Errors
    /// `H007` a file is damaged; those of `each`.
    pub(crate) fn each_outlines_quads(
        &self,
        with_facts: bool,
        each: &mut dyn FnMut(Vec<Quad>) -> Result<(), Diagnostics>,
    ) -> Result<(), Diagnostics> {
        for run in self.outlined_ids(None)? {
            let read = self.of_outline(&run, |loaded, at| {
                let mut quads = loaded.statements(at)?.to_vec();
                if with_facts {
                    let (_, trace) = trace_file::decode_head(loaded.head(at)?)?;
                    graphs::write(&extract(&trace), &write_run::run_node(&run), &mut quads);
                }
                Ok(quads)
            });
            read?.map_or(Ok(()), &mut *each)?;
        }
        Ok(())
    }

    /// All details of a run that has an outline. Returns `None` if it has none.
    pub(crate) fn outlined_run(&self, run: &str) -> Result<Option<RunDetail>, Diagnostics> {
        let Some(store) = self.outlined_quads(run)? else {
            return Ok(None);
        };
        detail::read(&store, &write_run::run_node(run))
            .map(Some)
            .map_err(|error| self.fault("reading a run", &error))
    }

    /// Choices and states of a run that has an outline. Returns `None` if it has none.
    pub(crate) fn outlined_states(
        &self,
        run: &str,
    ) -> Result<Option<(Vec<Choice>, Trace)>, Diagnostics> {
        self.of_outline(run, |loaded, at| trace_file::decode_head(loaded.head(at)?))
    }

    /// Number of runs that have only an outline, and the wall time that they took together. Unit:
    /// seconds.
    ///
    /// # Errors
    /// `H007` a file is damaged.
    pub fn outlined_cost(&self, runs: &[RunRow]) -> Result<(usize, f64), Diagnostics> {
        let (mut count, mut secs) = (0, 0.0);
        let wanted: HashSet<(&str, u64)> = runs
            .iter()
            .map(|row| (row.campaign.as_str(), row.index))
            .collect();
        self.each_outlined(&RunFilter::default(), &mut |outlined| {
            if wanted.contains(&(outlined.campaign, outlined.row.index)) {
                count += 1;
                secs += outlined.row.wall_secs;
            }
        })?;
        Ok((count, secs))
    }

    /// Calls `each` with the health data of the outlines of a campaign, file by file.
    ///
    /// # Errors
    /// `H007` a file is damaged.
    pub(crate) fn each_outlined_vitals(
        &self,
        campaign: &str,
        each: &mut dyn FnMut(&RunVitals),
    ) -> Result<(), Diagnostics> {
        if !self.shelf().exists() {
            return Ok(());
        }
        // One thread reads while the caller's counts.
        std::thread::scope(|scope| {
            let (send, receive) = sync_channel(FILES_AHEAD);
            let reader = scope.spawn(move || self.send_vitals(campaign, &send));
            for runs in receive {
                runs.iter().for_each(&mut *each);
            }
            joined(reader)
        })
    }

    /// Sends the health data of the outlines of a campaign, file by file.
    fn send_vitals(
        &self,
        campaign: &str,
        send: &SyncSender<Vec<RunVitals>>,
    ) -> Result<(), Diagnostics> {
        // If a file was removed meanwhile, the others are read again.
        let mut done = IndexSet::default();
        self.of_outlines(&mut |shelf| {
            shelf.each_file(Some(campaign), Needed::All, &mut |_, opened, _| {
                let (rows, heads) = (opened.rows()?, opened.heads()?);
                let mut runs = Vec::new();
                for (outlined, head) in rows.of_campaign(campaign).zip(heads) {
                    if done.insert(outlined.row.index) {
                        runs.push(outlined.as_vitals(trace_file::head_choices(&head)?));
                    }
                }
                // The receiver stops only if it panics.
                let _ = send.send(runs);
                Ok(())
            })
        })
    }

    /// The judgements in the store that were made after a run that has an outline.
    pub(crate) fn later_about_outline(
        &self,
        run: &str,
        store: &Store,
    ) -> Result<Vec<Quad>, Diagnostics> {
        let Some(memory) = self.outlined_quads(run)? else {
            return Ok(Vec::new());
        };
        let fault = |error| self.fault("reading a run", &error);
        let node = write_run::run_node(run);
        let mut later = Vec::new();
        for execution in
            crate::read::subjects(&memory, "act:ofRun", node.as_ref()).map_err(fault)?
        {
            if let oxigraph::model::NamedOrBlankNode::NamedNode(execution) = execution {
                later.extend(merge::about(store, &execution).map_err(fault)?);
            }
        }
        Ok(later)
    }

    /// Compares the outlines with their checksums and hashes. Returns the number of runs, and each
    /// damaged file with the reason.
    pub(crate) fn examine_outlines(&self) -> (usize, Vec<(std::path::PathBuf, String)>) {
        let (mut seen, mut damaged) = (BTreeSet::new(), Vec::new());
        for file in self.shelf().files(None) {
            let mut examined = || -> Result<(), String> {
                let bytes = folder::read(&file.path).map_err(|error| error.to_string())?;
                for outline in Opened::new(&bytes)?.outlines()? {
                    let (_, trace) = trace_file::decode_head(&outline.head)?;
                    for outlined in outline.rows.of_campaign(&file.campaign) {
                        if outlined.trace_hash() != trace.hash {
                            let run = outlined.run();
                            return Err(format!("run {run} has the states of {}", trace.hash));
                        }
                        seen.insert(outlined.run());
                    }
                }
                Ok(())
            };
            if let Err(why) = examined() {
                damaged.push((file.path.clone(), why));
            }
        }
        (seen.len(), damaged)
    }
}
