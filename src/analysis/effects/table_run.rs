//! A run with everything that its table rows need.

use crate::effects::action::target_of;
use crate::effects::{ActionEffects, RealisedNoise};
use actcheck_data::{Choice, Trace};
use actcheck_history::RunDetail;

/// A run's record, with the noise and effects of each action.
#[derive(Debug, Clone, PartialEq)]
pub struct TableRun {
    /// The record.
    pub detail: RunDetail,
    /// Realised noise, one for each action.
    pub noise: Vec<RealisedNoise>,
    /// Effects, one for each action.
    pub effects: Vec<ActionEffects>,
}

impl TableRun {
    /// Derives noise and effects from the choices and the trace of a run.
    pub fn new(detail: RunDetail, choices: &[Choice], trace: &Trace) -> Self {
        let noise = detail
            .actions
            .iter()
            .map(|action| {
                RealisedNoise::of(
                    choices,
                    target_of(&detail, action).map(|target| target.id.as_str()),
                )
            })
            .collect();
        let effects = (0..detail.actions.len())
            .map(|step| ActionEffects::of(&detail, trace, step).unwrap_or_default())
            .collect();
        Self {
            detail,
            noise,
            effects,
        }
    }
}

impl From<RunDetail> for TableRun {
    /// Creates a run without a trace: its noise and effects are unknown.
    fn from(detail: RunDetail) -> Self {
        let actions = detail.actions.len();
        Self {
            noise: vec![RealisedNoise::default(); actions],
            effects: vec![ActionEffects::default(); actions],
            detail,
        }
    }
}
