//! The values of an outline that lists of runs need.

use std::collections::HashMap;

use serde::{Deserialize, Serialize};

use crate::detail::{outcome, status};
use crate::{Repetition, RunFilter, RunRecord, RunRow, RunVitals, SceneDigest};
use actcheck_base::Outcome;
use actcheck_data::Choice;

/// The values of one run. Texts that are alike in many runs are given by their numbers in
/// [`Rows::texts`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Row {
    /// Position in the campaign, from 0.
    pub index: u64,
    /// Scene and number of the repetition.
    repetition: Option<(u64, u64)>,
    weight: Option<f64>,
    test: u32,
    status: u32,
    score: f64,
    trace_hash: String,
    started: String,
    pub wall_secs: f64,
    elapsed_secs: f64,
    deepest_penetration_m: Option<f64>,
    energy_gain_j: Option<f64>,
    pub discards: Vec<String>,
    pub scene: SceneDigest,
    outcomes: Vec<Judged>,
}

/// One outcome of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Judged {
    step: u32,
    action: u32,
    property: u32,
    outcome: u32,
    margin: Option<f64>,
}

/// The values of runs of one campaign.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Rows {
    texts: Vec<String>,
    pub rows: Vec<Row>,
}

/// One run of [`Rows`], with its campaign.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Outlined<'a> {
    pub campaign: &'a str,
    texts: &'a [String],
    pub row: &'a Row,
}

impl Rows {
    /// The values of a new run.
    pub(crate) fn of(record: &RunRecord, scene: SceneDigest) -> Self {
        let mut texts = Texts::default();
        let mut outcomes = Vec::new();
        for (step, (action, judgements)) in (1..).zip(record.actions.iter().zip(&record.judgements))
        {
            for judgement in judgements {
                outcomes.push(Judged {
                    step,
                    action: texts.number(action),
                    property: texts.number(&judgement.property),
                    outcome: texts.number(judgement.outcome.word()),
                    margin: judgement.margin,
                });
            }
        }
        let row = Row {
            index: record.index,
            repetition: record
                .repetition
                .map(|repetition| (repetition.scene, repetition.number)),
            weight: record.weight,
            test: texts.number(&record.test),
            status: texts.number(record.status.word()),
            score: record.score,
            trace_hash: record.trace.hash.clone(),
            started: record.started.clone(),
            wall_secs: record.wall_secs,
            elapsed_secs: record.elapsed_secs,
            deepest_penetration_m: record.quality.map(|quality| quality.deepest_penetration_m),
            energy_gain_j: record.quality.map(|quality| quality.energy_gain_j),
            discards: record.discards.clone(),
            scene,
            outcomes,
        };
        Self {
            texts: texts.all,
            rows: vec![row],
        }
    }

    /// Joins the values of several files.
    pub(crate) fn joined<'a>(parts: impl IntoIterator<Item = &'a Self>) -> Self {
        let (mut texts, mut rows) = (Texts::default(), Vec::new());
        for part in parts {
            let new: Vec<u32> = part.texts.iter().map(|text| texts.number(text)).collect();
            let of = |old: u32| new.get(old as usize).copied().unwrap_or(u32::MAX);
            rows.extend(part.rows.iter().map(|row| {
                let mut row = row.clone();
                (row.test, row.status) = (of(row.test), of(row.status));
                for judged in &mut row.outcomes {
                    (judged.action, judged.property) = (of(judged.action), of(judged.property));
                    judged.outcome = of(judged.outcome);
                }
                row
            }));
        }
        Self {
            texts: texts.all,
            rows,
        }
    }

    /// Only one of the runs.
    pub(crate) fn only(&self, at: usize) -> Self {
        Self {
            texts: self.texts.clone(),
            rows: self.rows.get(at).cloned().into_iter().collect(),
        }
    }

    /// One of the runs, with its campaign.
    pub(super) fn at<'a>(&'a self, campaign: &'a str, place: usize) -> Outlined<'a> {
        Outlined {
            campaign,
            texts: &self.texts,
            row: &self.rows[place],
        }
    }

    /// The runs with their campaign.
    pub(crate) fn of_campaign<'a>(
        &'a self,
        campaign: &'a str,
    ) -> impl Iterator<Item = Outlined<'a>> {
        self.rows.iter().map(move |row| Outlined {
            campaign,
            texts: &self.texts,
            row,
        })
    }
}

impl Outlined<'_> {
    fn text(&self, number: u32) -> &str {
        self.texts.get(number as usize).map_or("", String::as_str)
    }

    /// Its id.
    pub(crate) fn run(&self) -> String {
        format!("{}-{}", self.campaign, self.row.index + 1)
    }

    /// Whether a filter selects it.
    pub(crate) fn matches(&self, filter: &RunFilter) -> bool {
        filter
            .campaign
            .as_ref()
            .is_none_or(|campaign| campaign == self.campaign)
            && filter
                .test
                .as_ref()
                .is_none_or(|test| test == self.text(self.row.test))
            && filter
                .status
                .is_none_or(|status| status.word() == self.text(self.row.status))
    }

    /// The run as in a list.
    pub(crate) fn as_run(&self) -> RunRow {
        let row = self.row;
        RunRow {
            run: self.run(),
            campaign: self.campaign.to_owned(),
            index: row.index,
            repetition: row
                .repetition
                .map(|(scene, number)| Repetition { scene, number }),
            weight: row.weight,
            test: self.text(row.test).to_owned(),
            status: status(Some(self.text(row.status))),
            score: row.score,
            trace_hash: row.trace_hash.clone(),
            started: row.started.clone(),
        }
    }

    /// Its outcomes, unsorted: step, action and property, outcome, and margin.
    pub(crate) fn outcomes(&self) -> impl Iterator<Item = (u32, [&str; 2], Outcome, Option<f64>)> {
        self.row.outcomes.iter().map(|judged| {
            let names = [self.text(judged.action), self.text(judged.property)];
            (judged.step, names, self.outcome(judged), judged.margin)
        })
    }

    fn outcome(&self, judged: &Judged) -> Outcome {
        outcome(Some(self.text(judged.outcome)))
    }

    /// Its health data.
    pub(crate) fn as_vitals(&self, choices: Vec<Choice>) -> RunVitals {
        let row = self.row;
        RunVitals {
            run: self.run(),
            index: row.index,
            choices,
            discards: row.discards.clone(),
            is_weighted: row.weight.is_some(),
            repetition: row.repetition.map_or(0, |(_, number)| number),
            wall_secs: row.wall_secs,
            deepest_penetration_m: row.deepest_penetration_m,
            energy_gain_j: row.energy_gain_j,
        }
    }

    /// The digest over every state.
    pub(crate) fn trace_hash(&self) -> &str {
        &self.row.trace_hash
    }
}

/// Texts with their numbers.
#[derive(Default)]
struct Texts {
    all: Vec<String>,
    known: HashMap<String, u32>,
}

impl Texts {
    fn number(&mut self, text: &str) -> u32 {
        if let Some(number) = self.known.get(text) {
            return *number;
        }
        let number = u32::try_from(self.all.len()).unwrap_or(u32::MAX);
        self.known.insert(text.to_owned(), number);
        self.all.push(text.to_owned());
        number
    }
}
