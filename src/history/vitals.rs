//! Values of a run that show the health of its campaign.

use crate::ids::run_id;
use crate::segment::SegmentColumn;
use crate::trace_codec::head_choices;
use crate::{History, RunRow, fault};
use actcheck_base::Diagnostics;
use actcheck_data::Choice;

/// The values of one run.
#[derive(Debug, Clone, PartialEq)]
pub struct RunVitals {
    /// Its id.
    pub run: String,
    /// Position in the campaign, from 0.
    pub index: u64,
    /// Every choice, in order.
    pub choices: Vec<Choice>,
    /// Reasons why scenes were discarded before its own.
    pub discards: Vec<String>,
    /// Whether a search chose its scene, so that the run has an importance weight.
    pub is_weighted: bool,
    /// Position among the runs of its scene, from 0.
    pub repetition: u64,
    /// Unit: seconds.
    pub wall_secs: f64,
    /// Deepest penetration of two bodies. Unit: metres. `None` if the run was not simulated.
    pub deepest_penetration_m: Option<f64>,
    /// Energy that the simulation created by error. Unit: joules. `None` if the run was not
    /// simulated.
    pub energy_gain_j: Option<f64>,
}

impl History {
    /// Calls `each` with the health data of every run of a campaign, by index.
    ///
    /// # Errors
    /// `H014` the history has no campaign with this id; otherwise as [`crate::Traces::whole`].
    pub fn each_vitals(
        &self,
        campaign: &str,
        mut each: impl FnMut(&RunVitals),
    ) -> Result<(), Diagnostics> {
        self.campaign(campaign)?;
        let runs = self.stored.runs_of(campaign)?;
        for run in runs.iter() {
            let id = run_id(campaign, run.row.index);
            let file = run.segment.file(SegmentColumn::States);
            let states = run.segment.states(run.row);
            let states = states.map_err(|why| fault::run(self.dir(), &id, &file, &why))?;
            let choices = head_choices(&states)
                .map_err(|why| fault::undecodable(self.dir(), &id, &file, &why.to_string()))?;
            let discards = match run.row.discards {
                0 => Vec::new(),
                _ => self.run(&id)?.discards,
            };
            each(&RunVitals {
                index: run.row.index,
                choices,
                discards,
                is_weighted: run.row.weight.is_some(),
                repetition: run.row.repetition.map_or(0, |repetition| repetition.number),
                wall_secs: run.row.wall_secs,
                deepest_penetration_m: run.row.quality.map(|own| own.deepest_penetration_m),
                energy_gain_j: run.row.quality.map(|own| own.energy_gain_j),
                run: id,
            });
        }
        Ok(())
    }

    /// Number of runs whose motion is not kept, and the wall time that they took together. Unit:
    /// seconds.
    ///
    /// # Errors
    /// A file is damaged or can't be read.
    pub fn cost_of_motion(&self, runs: &[RunRow]) -> Result<(usize, f64), Diagnostics> {
        let (mut count, mut secs) = (0, 0.0);
        for row in runs {
            let of_campaign = self.stored.runs_of(&row.campaign)?;
            let run = of_campaign
                .find(row.index)
                .filter(|run| !run.row.is_whole());
            if let Some(run) = run {
                count += 1;
                secs += run.row.wall_secs;
            }
        }
        Ok((count, secs))
    }
}
