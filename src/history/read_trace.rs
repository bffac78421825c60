//! Reads the traces of runs, and their facts.

use std::path::PathBuf;

use oxigraph::model::{GraphNameRef, Literal, QuadRef};
use oxigraph::store::Store;

use crate::detail::Parts;
use crate::outlines::withheld;
use crate::read::text_of;
use crate::statements::iri;
use crate::write_run::run_node;
use crate::{History, RunRow, fault, folder, lists, trace_file, trace_parts};
use actcheck_base::{Diagnostic, Diagnostics, RunFacts};
use actcheck_data::{Choice, Trace};
use actcheck_facts::extract;

impl History {
    /// Returns the trace of a run, named as in [`History::resolve`].
    ///
    /// # Errors
    /// `H008`: no run has this name. `H009`: the trace file of the run is missing. `H007`: the
    /// trace file is damaged.
    pub fn trace(&self, name: &str) -> Result<Trace, Diagnostics> {
        self.trace_if_allowed(name)?.ok_or_else(|| withheld(name))
    }

    /// As [`History::trace`], but returns `None` if the run has only an outline and simulating it
    /// again would start a program without consent.
    ///
    /// # Errors
    /// As [`History::trace`].
    pub fn trace_if_allowed(&self, name: &str) -> Result<Option<Trace>, Diagnostics> {
        let id = self.resolve(name)?;
        if self.is_outline(&id)? {
            let Some((choices, trace)) = self.restored(&id)? else {
                return Ok(None);
            };
            // With the precision of a stored trace.
            return Ok(Some(
                self.encoded_again(&id, &choices, &trace, trace_file::decode)?
                    .1,
            ));
        }
        Ok(Some(self.traced(&id, trace_file::decode)?.1))
    }

    /// Returns the trace of a run, named as in [`History::resolve`], with the samples of its
    /// actions but without the motion of bodies and joints: everything from which facts and
    /// quantities over time are extracted.
    ///
    /// # Errors
    /// As [`History::trace`].
    pub fn sampled(&self, name: &str) -> Result<Trace, Diagnostics> {
        let id = self.resolve(name)?;
        self.sampled_of(&id)?.ok_or_else(|| withheld(&id))
    }

    /// `None`: only an outline is kept, and simulating it again would start a program without
    /// consent.
    fn sampled_of(&self, id: &str) -> Result<Option<Trace>, Diagnostics> {
        if self.is_outline(id)? {
            let Some((choices, trace)) = self.restored(id)? else {
                return Ok(None);
            };
            return Ok(Some(
                self.encoded_again(id, &choices, &trace, trace_file::decode_sampled)?
                    .1,
            ));
        }
        Ok(Some(self.traced(id, trace_file::decode_sampled)?.1))
    }

    /// Returns the trace of a run of a list without the motion of its bodies, and with the samples
    /// of its actions if `course`: as [`History::sampled`] or [`History::states`], but the store
    /// isn't asked whether there is such a run.
    ///
    /// # Errors
    /// As [`History::trace`].
    pub fn trace_of(&self, run: &RunRow, course: bool) -> Result<Trace, Diagnostics> {
        if course {
            return self.sampled_of(&run.run)?.ok_or_else(|| withheld(&run.run));
        }
        self.states_of(&run.run)
    }

    /// Returns the trace of a run, named as in [`History::resolve`], without the motion of its
    /// bodies: everything from which facts are extracted, in a tenth of the time.
    ///
    /// # Errors
    /// As [`History::trace`].
    pub fn states(&self, name: &str) -> Result<Trace, Diagnostics> {
        self.states_of(&self.resolve(name)?)
    }

    fn states_of(&self, id: &str) -> Result<Trace, Diagnostics> {
        match self.outlined_states(id)? {
            Some((_, trace)) => Ok(trace),
            None => Ok(self.traced(id, trace_file::decode_states)?.1),
        }
    }

    /// Returns every choice of a run, named as in [`History::resolve`].
    ///
    /// # Errors
    /// As [`History::trace`].
    pub fn choices(&self, name: &str) -> Result<Vec<Choice>, Diagnostics> {
        Ok(self.recorded(name)?.0)
    }

    /// Returns every choice of a run, named as in [`History::resolve`], and its trace as in
    /// [`History::states`].
    ///
    /// # Errors
    /// As [`History::trace`].
    pub fn recorded(&self, name: &str) -> Result<(Vec<Choice>, Trace), Diagnostics> {
        let id = self.resolve(name)?;
        match self.outlined_states(&id)? {
            Some(recorded) => Ok(recorded),
            None => self.traced(&id, trace_file::decode_states),
        }
    }

    /// Returns the facts of a run, named as in [`History::resolve`]: extracted from its trace, the
    /// same as during the run.
    ///
    /// The store holds facts only for queries; reading them from there would take many times as
    /// long. `course`: whether to read the quantities over time too, which takes ten times as long.
    ///
    /// # Errors
    /// As [`History::trace`].
    pub fn facts(&self, name: &str, course: bool) -> Result<RunFacts, Diagnostics> {
        Ok(Self::facts_of(&if course {
            self.sampled(name)?
        } else {
            self.states(name)?
        }))
    }

    /// As [`History::facts`], but without the quantities over time if the run has only an outline
    /// and simulating it again would start a program without consent.
    ///
    /// # Errors
    /// As [`History::trace`].
    pub fn allowed_facts(&self, name: &str, course: bool) -> Result<RunFacts, Diagnostics> {
        let id = self.resolve(name)?;
        let sampled = if course { self.sampled_of(&id)? } else { None };
        Ok(Self::facts_of(
            &sampled.map_or_else(|| self.states_of(&id), Ok)?,
        ))
    }

    /// Returns the facts of a trace: the same as during the run.
    pub fn facts_of(trace: &Trace) -> RunFacts {
        extract(trace)
    }

    /// Path of a run's trace file, which need not exist.
    pub(super) fn trace_path(&self, run: &str) -> PathBuf {
        self.folder.trace(run)
    }

    /// The copy of a run's objects, actions and outcomes in its trace file. `None` if they must be
    /// read from the store: the copy is missing, or the file is of another run.
    pub(super) fn copied_parts(&self, id: &str, store: &Store) -> Option<Parts> {
        let (hash, parts) = trace_parts::read(&self.trace_path(id))?;
        let (run, property, hash) = (
            run_node(id),
            iri("act:traceHash"),
            Literal::new_simple_literal(hash),
        );
        let is_of_run = store.contains(QuadRef::new(
            &run,
            &property,
            &hash,
            GraphNameRef::DefaultGraph,
        ));
        is_of_run.unwrap_or(false).then_some(parts)
    }

    /// Decodes a run's trace file, and checks that it is the one that was written with the run.
    fn traced(
        &self,
        id: &str,
        decode: impl FnOnce(&[u8]) -> Result<(Vec<Choice>, Trace), String>,
    ) -> Result<(Vec<Choice>, Trace), Diagnostics> {
        let (choices, trace) = self.decoded(id, decode)?;
        let (run, property) = (run_node(id), iri("act:traceHash"));
        let store = self.store_with(lists::of_runs)?;
        let mut hashes = store.quads_for_pattern(
            Some((&run).into()),
            Some(property.as_ref()),
            None,
            Some(GraphNameRef::DefaultGraph),
        );
        match hashes
            .next()
            .transpose()
            .map_err(|error| self.fault("reading a run", &error))?
        {
            Some(quad) if text_of(&quad.object) != trace.hash => {
                let why = format!(
                    "`{}` is the trace of another run than {id}",
                    self.trace_path(id).display()
                );
                Err(fault::damaged(self.dir(), &why))
            }
            _ => Ok((choices, trace)),
        }
    }

    pub(super) fn decoded<T>(
        &self,
        id: &str,
        decode: impl FnOnce(&[u8]) -> Result<T, String>,
    ) -> Result<T, Diagnostics> {
        let file = self.folder.trace(id);
        let bytes = folder::read(&file).map_err(|error| {
            if let Some(fault) = fault::too_many_files(self.dir(), &error.to_string()) {
                return fault;
            }
            Diagnostic::error(
                "H009",
                format!(
                    "the trace of run {id} can't be read from `{}`: {error}",
                    file.display()
                ),
            )
            .help("restore the file from a backup; the store's data on the run is intact")
            .into()
        })?;
        decode(&bytes)
            .map_err(|why| fault::damaged(self.dir(), &format!("the trace of run {id}: {why}")))
    }

    /// Writes a trace as a trace file, and reads it.
    fn encoded_again<T>(
        &self,
        id: &str,
        choices: &[Choice],
        trace: &Trace,
        decode: impl FnOnce(&[u8]) -> Result<T, String>,
    ) -> Result<T, Diagnostics> {
        trace_file::encode(choices, trace)
            .and_then(|bytes| decode(&bytes))
            .map_err(|why| fault::damaged(self.dir(), &format!("the trace of run {id}: {why}")))
    }
}
