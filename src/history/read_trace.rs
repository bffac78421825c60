//! Reads the traces of runs, and their facts.

use crate::campaign::RunAt;
use crate::restore::withheld;
use crate::segment::{ReadFault, SegmentColumn};
use crate::trace_codec::{
    CodecFault, decode_head, decode_motion, decode_samples_of, encode_motion,
};
use crate::{History, RunRow, fault};
use actcheck_base::{Diagnostics, RunFacts};
use actcheck_data::{Choice, Trace};
use actcheck_facts::extract;

/// Adds motion, or a part of it, to a trace.
type AddMotion = fn(Vec<u8>, &mut Trace) -> Result<(), CodecFault>;

/// The traces of a history's runs.
#[derive(Clone, Copy)]
pub struct Traces<'h> {
    history: &'h History,
}

impl History {
    /// The traces of its runs.
    pub fn traces(&self) -> Traces<'_> {
        Traces { history: self }
    }

    /// Returns the facts of a trace: the same as during the run.
    pub fn facts_of(trace: &Trace) -> RunFacts {
        extract(trace)
    }
}

impl Traces<'_> {
    /// Returns the trace of a run, named as in [`History::resolve`].
    ///
    /// # Errors
    /// `H008`: no run has this name. `H009`: a file of its segment is missing. `H007`: the run is
    /// damaged. `H031`: its motion is not kept, and can't be simulated again.
    pub fn whole(&self, name: &str) -> Result<Trace, Diagnostics> {
        self.whole_if_allowed(name)?.ok_or_else(|| withheld(name))
    }

    /// As [`Traces::whole`], but returns `None` if the motion of the run is not kept, and
    /// simulating it again would start a program without consent.
    ///
    /// # Errors
    /// As [`Traces::whole`].
    pub fn whole_if_allowed(&self, name: &str) -> Result<Option<Trace>, Diagnostics> {
        self.with_motion(&self.history.resolve(name)?, decode_motion)
    }

    /// Returns the trace of a run, named as in [`History::resolve`], with the samples of its
    /// actions but without the motion of bodies and joints: everything from which facts and
    /// quantities over time are extracted.
    ///
    /// # Errors
    /// As [`Traces::whole`].
    pub fn sampled(&self, name: &str) -> Result<Trace, Diagnostics> {
        let id = self.history.resolve(name)?;
        self.with_motion(&id, decode_samples_of)?
            .ok_or_else(|| withheld(&id))
    }

    /// Returns the trace of a run of a list without the motion of its bodies, and with the samples
    /// of its actions if `course`: as [`Traces::sampled`] or [`Traces::states`].
    ///
    /// # Errors
    /// As [`Traces::whole`].
    pub fn of(&self, run: &RunRow, course: bool) -> Result<Trace, Diagnostics> {
        if course {
            let sampled = self.with_motion(&run.run, decode_samples_of)?;
            return sampled.ok_or_else(|| withheld(&run.run));
        }
        Ok(self.recorded_of(&run.run)?.1)
    }

    /// Returns the trace of a run, named as in [`History::resolve`], without the motion of its
    /// bodies: everything from which facts are extracted, in a tenth of the time.
    ///
    /// # Errors
    /// As [`Traces::whole`].
    pub fn states(&self, name: &str) -> Result<Trace, Diagnostics> {
        Ok(self.recorded(name)?.1)
    }

    /// Returns every choice of a run, named as in [`History::resolve`].
    ///
    /// # Errors
    /// As [`Traces::whole`].
    pub fn choices(&self, name: &str) -> Result<Vec<Choice>, Diagnostics> {
        Ok(self.recorded(name)?.0)
    }

    /// Returns every choice of a run, named as in [`History::resolve`], and its trace as in
    /// [`Traces::states`].
    ///
    /// # Errors
    /// As [`Traces::whole`].
    pub fn recorded(&self, name: &str) -> Result<(Vec<Choice>, Trace), Diagnostics> {
        self.recorded_of(&self.history.resolve(name)?)
    }

    fn recorded_of(&self, id: &str) -> Result<(Vec<Choice>, Trace), Diagnostics> {
        let recorded = self
            .history
            .stored
            .with_run(id, |_, run| self.recorded_at(id, run))?;
        recorded.ok_or_else(|| fault::no_run(self.history.dir(), id))
    }

    fn recorded_at(&self, id: &str, run: RunAt<'_>) -> Result<(Vec<Choice>, Trace), Diagnostics> {
        let states = run.segment.states(run.row);
        let states = states.map_err(|why| self.unread(id, run, SegmentColumn::States, &why))?;
        let recorded = decode_head(&states)
            .map_err(|why| self.undecodable(id, run, SegmentColumn::States, &why))?;
        if recorded.1.hash != run.row.trace_hash() {
            let why = "these are the states of another run";
            return Err(fault::undecodable(
                self.history.dir(),
                id,
                &run.segment.file(SegmentColumn::States),
                why,
            ));
        }
        Ok(recorded)
    }

    /// A trace with its motion, or a part of it: as it is kept, or simulated again. Returns `None`
    /// if this would start a program without consent.
    fn with_motion(&self, id: &str, add: AddMotion) -> Result<Option<Trace>, Diagnostics> {
        let kept = self.history.stored.with_run(id, |_, run| {
            let motion = run.segment.motion(run.row);
            let motion = motion.map_err(|why| self.unread(id, run, SegmentColumn::Motion, &why))?;
            let Some(motion) = motion else {
                return Ok(None);
            };
            let (_, mut trace) = self.recorded_at(id, run)?;
            add(motion, &mut trace)
                .map_err(|why| self.undecodable(id, run, SegmentColumn::Motion, &why))?;
            Ok(Some(trace))
        })?;
        let kept = kept.ok_or_else(|| fault::no_run(self.history.dir(), id))?;
        if kept.is_some() {
            return Ok(kept);
        }
        let Some((_, simulated)) = self.history.restored(id)? else {
            return Ok(None);
        };
        // With the precision of stored motion.
        let (_, mut trace) = self.recorded_of(id)?;
        let again = encode_motion(&simulated).and_then(|motion| add(motion, &mut trace));
        let unencodable = |why: CodecFault| {
            fault::damaged(
                self.history.dir(),
                &format!("the motion of run {id}: {why}"),
            )
        };
        again.map_err(unencodable)?;
        Ok(Some(trace))
    }

    /// Returns the facts of a run, named as in [`History::resolve`]: extracted from its trace, the
    /// same as during the run. `course`: whether to read the quantities over time too, which takes
    /// ten times as long.
    ///
    /// # Errors
    /// As [`Traces::whole`].
    pub fn facts(&self, name: &str, course: bool) -> Result<RunFacts, Diagnostics> {
        Ok(History::facts_of(&if course {
            self.sampled(name)?
        } else {
            self.states(name)?
        }))
    }

    /// As [`Traces::facts`], but without the quantities over time if the motion of the run is not
    /// kept, and simulating it again would start a program without consent.
    ///
    /// # Errors
    /// As [`Traces::whole`].
    pub fn allowed_facts(&self, name: &str, course: bool) -> Result<RunFacts, Diagnostics> {
        let id = self.history.resolve(name)?;
        let sampled = if course {
            self.with_motion(&id, decode_samples_of)?
        } else {
            None
        };
        let trace = match sampled {
            Some(sampled) => sampled,
            None => self.recorded_of(&id)?.1,
        };
        Ok(History::facts_of(&trace))
    }

    fn unread(
        &self,
        id: &str,
        run: RunAt<'_>,
        column: SegmentColumn,
        why: &ReadFault,
    ) -> Diagnostics {
        fault::run(self.history.dir(), id, &run.segment.file(column), why)
    }

    fn undecodable(
        &self,
        id: &str,
        run: RunAt<'_>,
        column: SegmentColumn,
        why: &CodecFault,
    ) -> Diagnostics {
        fault::undecodable(
            self.history.dir(),
            id,
            &run.segment.file(column),
            &why.to_string(),
        )
    }
}
