//! A campaign that is compared with another one while it runs.

use crate::compare::{Histories, Side, side_changes};
use crate::options::HistoryArgs;
use crate::run_args::RunArgs;
use actcheck_analysis::{Answer, Sampling, compare};
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_campaign::Env;
use actcheck_history::History;
use actcheck_report::CompareSummary;

/// Rates that differ by less count as equal.
const MARGIN: f64 = 0.05;
/// Probability of a false alarm.
const LEVEL: f64 = 0.05;
/// Up to this number of runs the comparison is looked at after each run, then after every tenth:
/// each look reads all runs.
const EACH_RUN: u64 = 200;

/// The baseline of a campaign.
pub(super) struct Gate {
    base: Side,
    /// Name of the growing campaign, as `compare` reads it.
    name: String,
    history: HistoryArgs,
    ends_campaign: bool,
    runs: u64,
}

impl Gate {
    /// Opens the baseline of the arguments; `None` if they name none.
    ///
    /// # Errors
    /// The history does not have the baseline, or the baseline has another seed and so other scenes.
    pub(super) fn open(
        args: &RunArgs,
        env: &Env,
        history: &History,
        campaign: &str,
    ) -> Result<Option<Self>, Diagnostics> {
        let Some(base) = &args.against else {
            return Ok(None);
        };
        let own = HistoryArgs {
            history: Some(history.dir().to_path_buf()),
        };
        let base = Side::read(base, &own, &mut Histories::default())?;
        if base.record.seed != env.campaign.seed {
            let message = format!(
                "the baseline {} has seed {}, and this campaign {}: they have no scene in common",
                base.record.id, base.record.seed, env.campaign.seed
            );
            let help = format!("add `--seed {}`", base.record.seed);
            return Err(Diagnostic::error("X071", message).help(help).into());
        }
        Ok(Some(Self {
            base,
            name: format!("{}#{campaign}", history.dir().display()),
            history: own,
            ends_campaign: args.until_decided,
            runs: 0,
        }))
    }

    /// Notes a run that is in the history. Returns whether the campaign ends: the comparison is
    /// decided.
    ///
    /// # Errors
    /// The history can't be read.
    pub(super) fn decides(&mut self) -> Result<bool, Diagnostics> {
        self.runs += 1;
        if !self.ends_campaign || (self.runs > EACH_RUN && !self.runs.is_multiple_of(10)) {
            return Ok(false);
        }
        let summary = self.summary()?;
        let is_open = matches!(summary.answer(), Answer::Underpowered { .. });
        Ok(summary.comparison.pairs > 0 && !is_open)
    }

    /// The comparison now, valid however often it is looked at.
    ///
    /// # Errors
    /// The history can't be read.
    pub(super) fn summary(&self) -> Result<CompareSummary, Diagnostics> {
        let now = Side::read(&self.name, &self.history, &mut Histories::default())?;
        Ok(CompareSummary {
            sides: [self.base.summary(), now.summary()],
            comparison: compare(&self.base.runs, &now.runs, Sampling::Stopped),
            changes: side_changes(&self.base, &now),
            level: Some(LEVEL),
            margin: MARGIN,
            decide: false,
            sequential: true,
            without_contested: None,
            known: Vec::new(),
        })
    }
}
