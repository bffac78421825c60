//! Health checks of a campaign: discarded scenes, duplicate runs, coverage gaps, slow runs and
//! simulation artefacts.

use std::collections::hash_map::Entry;
use std::collections::{BTreeMap, HashMap};

use crate::{Coverage, PairCoverage, ParameterCoverage};
use actcheck_base::{Digest, Outcome};
use actcheck_history::RunVitals;

/// Maximum share of discarded scenes. A crowded table causes up to a tenth; a larger share biases
/// the tested scenes.
const MOST_DISCARDS: f64 = 0.1;
/// A property counts as nearly always inapplicable from this share on.
const MOST_INAPPLICABLE: f64 = 0.9;
/// Minimum number of judgements for "nearly always".
const LEAST_JUDGED: u64 = 10;
/// A run is an outlier if it takes this many times the median. Scenes of one campaign differ by a
/// factor of 4,
const SLOW_FACTOR: f64 = 10.0;
/// … and this much longer than the median. Unit: seconds. A busy machine delays a run by less.
const SLOW_SECS: f64 = 10.0;
/// Minimum number of runs for the detection of slow runs.
const LEAST_TIMED: usize = 5;
/// Maximum penetration depth of colliding objects. Unit: metres. A grasp at 240 steps a second
/// penetrates by less than one millimetre; the walls of cups are 4 mm thick, and at 2 cm objects
/// have passed through each other.
const DEEPEST_M: f64 = 0.02;
/// Maximum unphysical energy gain. Unit: joules. This is enough to throw a full glass (0.3 kg) at
/// more than 1 m/s.
const MOST_ENERGY_J: f64 = 0.2;

/// Collects the vital data of a campaign's runs.
#[derive(Debug, Clone, Default)]
pub struct HealthMeter {
    coverage: Coverage,
    is_weighted: bool,
    runs: u64,
    discards: u64,
    first_discard: Option<(u64, String)>,
    /// Digest of all choices, with the first run that made them.
    seen: HashMap<u128, String>,
    duplicates: Vec<(String, String)>,
    wall: Vec<(f64, String)>,
    deepest: Option<(f64, String)>,
    energy: Option<(f64, String)>,
    /// By property: the number of inapplicable outcomes, and of those that are inapplicable, passed
    /// or failed.
    judged: BTreeMap<String, (u64, u64)>,
}

/// Health of a campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct Health {
    /// Number of runs kept.
    pub runs: u64,
    /// Number of discarded scenes.
    pub discards: u64,
    /// Coverage of each parameter.
    pub parameters: Vec<ParameterCoverage>,
    /// Coverage of pairs of parameters.
    pub pairs: Vec<PairCoverage>,
    /// Median of the runs' wall time. Unit: seconds.
    pub median_secs: Option<f64>,
    /// The slowest run and its wall time. Unit: seconds.
    pub slowest: Option<(f64, String)>,
    /// The deepest penetration and its run. Unit: metres.
    pub deepest: Option<(f64, String)>,
    /// The largest unphysical energy gain and its run. Unit: joules.
    pub energy: Option<(f64, String)>,
    /// The problems found.
    pub problems: Vec<HealthProblem>,
}

/// A problem that weakens the conclusions of a campaign.
#[derive(Debug, Clone, PartialEq)]
pub enum HealthProblem {
    /// Too many scenes were discarded: number of discarded scenes, number of drawn scenes, run of
    /// the first discard (from 1) and its reason.
    Discards(u64, u64, u64, String),
    /// The property (IRI) was nearly always inapplicable: number of inapplicable judgements, number
    /// of judgements.
    Inapplicable(String, u64, u64),
    /// A value or range of a parameter was rarely tried.
    Neglected(ParameterCoverage),
    /// Pairs of values of two parameters were rarely tried.
    PairNeglected(PairCoverage),
    /// Runs that repeat another run in every choice: their number, and an example with the run that
    /// it repeats.
    Duplicates(u64, String, String),
    /// A slow run: its ID, its wall time and the median wall time. Unit: seconds.
    Slow(String, f64, f64),
    /// Deep penetration in this run. Unit: metres.
    Penetration(String, f64),
    /// Unphysical energy gain in this run. Unit: joules.
    Energy(String, f64),
}

impl HealthMeter {
    /// Adds one run.
    pub fn add(&mut self, run: &RunVitals) {
        self.runs += 1;
        self.discards += run.discards.len() as u64;
        let is_first = self
            .first_discard
            .as_ref()
            .is_none_or(|(first, _)| run.index + 1 < *first);
        if let (true, Some(reason)) = (is_first, run.discards.first()) {
            self.first_discard = Some((run.index + 1, reason.clone()));
        }
        self.is_weighted |= run.is_weighted;
        // Repetitions of a scene count once.
        if run.repetition == 0 {
            self.coverage.add(&run.choices);
        }
        let digest = self.digest(run);
        match self.seen.entry(digest) {
            Entry::Occupied(first) => self.duplicates.push((run.run.clone(), first.get().clone())),
            Entry::Vacant(place) => {
                place.insert(run.run.clone());
            }
        }
        self.wall.push((run.wall_secs, run.run.clone()));
        larger(&mut self.deepest, run.deepest_penetration_m, &run.run);
        larger(&mut self.energy, run.energy_gain_j, &run.run);
    }

    /// Digest of all choices of a run.
    fn digest(&mut self, run: &RunVitals) -> u128 {
        let mut digest = Digest::new();
        for choice in &run.choices {
            digest.update(self.coverage.text_of(&choice.name).as_bytes());
            digest.update(&[0]);
            digest.update(&choice.value.to_bits().to_le_bytes());
        }
        // A digest is 32 hexadecimal digits.
        u128::from_str_radix(&digest.finish(), 16).unwrap_or_default()
    }

    /// Adds equal outcomes of a property (IRI).
    pub fn add_outcomes(&mut self, property: &str, outcome: Outcome, count: u64) {
        if !self.judged.contains_key(property) {
            self.judged.insert(property.to_owned(), (0, 0));
        }
        if let Some((not, all)) = self.judged.get_mut(property) {
            *not += count * u64::from(outcome == Outcome::Inapplicable);
            *all += count
                * u64::from(matches!(
                    outcome,
                    Outcome::Inapplicable | Outcome::Passed | Outcome::Failed
                ));
        }
    }

    /// Returns the health of the added runs.
    pub fn finish(mut self) -> Health {
        self.wall.sort_by(|a, b| a.0.total_cmp(&b.0));
        let median_secs = self.wall.get(self.wall.len() / 2).map(|(secs, _)| *secs);
        let mut health = Health {
            runs: self.runs,
            discards: self.discards,
            parameters: self.coverage.parameters(),
            pairs: self.coverage.pairs(),
            median_secs,
            slowest: self.wall.last().cloned(),
            deepest: self.deepest.clone(),
            energy: self.energy.clone(),
            problems: Vec::new(),
        };
        let problems = [
            self.discarded(),
            self.inapplicable(),
            self.neglected(&health),
            self.repeated(),
            slow(&health, self.wall.len()),
            badly_simulated(&health),
        ];
        health.problems = problems.into_iter().flatten().collect();
        health
    }

    fn discarded(&self) -> Vec<HealthProblem> {
        let drawn = self.runs + self.discards;
        match &self.first_discard {
            Some((run, reason)) if self.discards as f64 > MOST_DISCARDS * drawn as f64 => {
                vec![HealthProblem::Discards(
                    self.discards,
                    drawn,
                    *run,
                    reason.clone(),
                )]
            }
            _ => Vec::new(),
        }
    }

    /// Rarely tried parameters. A guided search is biased on purpose, so that it is exempt.
    fn neglected(&self, health: &Health) -> Vec<HealthProblem> {
        if self.is_weighted {
            return Vec::new();
        }
        let singles = health
            .parameters
            .iter()
            .filter(|parameter| parameter.neglected.is_some());
        let pairs = health.pairs.iter().filter(|pair| pair.neglected);
        singles
            .cloned()
            .map(HealthProblem::Neglected)
            .chain(pairs.cloned().map(HealthProblem::PairNeglected))
            .collect()
    }

    /// The properties that were nearly always inapplicable, sorted by IRI.
    fn inapplicable(&self) -> Vec<HealthProblem> {
        let nearly_never = |(not, all): (u64, u64)| {
            all >= LEAST_JUDGED && not as f64 >= MOST_INAPPLICABLE * all as f64
        };
        let found = self
            .judged
            .iter()
            .filter(|(_, counts)| nearly_never(**counts));
        found
            .map(|(property, (not, all))| HealthProblem::Inapplicable(property.clone(), *not, *all))
            .collect()
    }

    fn repeated(&self) -> Vec<HealthProblem> {
        let first = self.duplicates.first();
        let problem = first.map(|(run, of)| {
            HealthProblem::Duplicates(self.duplicates.len() as u64, run.clone(), of.clone())
        });
        problem.into_iter().collect()
    }
}

fn larger(largest: &mut Option<(f64, String)>, value: Option<f64>, run: &str) {
    if let Some(value) = value
        && largest.as_ref().is_none_or(|(known, _)| value > *known)
    {
        *largest = Some((value, run.to_owned()));
    }
}

fn slow(health: &Health, runs: usize) -> Vec<HealthProblem> {
    match (&health.slowest, health.median_secs) {
        (Some((secs, run)), Some(median))
            if runs >= LEAST_TIMED && *secs > SLOW_FACTOR * median && secs - median > SLOW_SECS =>
        {
            vec![HealthProblem::Slow(run.clone(), *secs, median)]
        }
        _ => Vec::new(),
    }
}

fn badly_simulated(health: &Health) -> Vec<HealthProblem> {
    let deep = health
        .deepest
        .iter()
        .filter(|(depth, _)| *depth > DEEPEST_M);
    let hot = health
        .energy
        .iter()
        .filter(|(energy, _)| *energy > MOST_ENERGY_J);
    deep.map(|(depth, run)| HealthProblem::Penetration(run.clone(), *depth))
        .chain(hot.map(|(energy, run)| HealthProblem::Energy(run.clone(), *energy)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_data::Choices;

    fn run(index: u64) -> RunVitals {
        let mut choices = Choices::random(7, index);
        choices.real("x".into(), 0.0, 1.0, 0.0);
        RunVitals {
            run: format!("k-{}", index + 1),
            index,
            choices: choices.into_made(),
            discards: Vec::new(),
            is_weighted: false,
            repetition: 0,
            wall_secs: 1.0 + index as f64 / 10.0,
            deepest_penetration_m: Some(1e-3),
            energy_gain_j: Some(1e-3),
        }
    }

    fn problems(change: impl Fn(&mut RunVitals)) -> Vec<HealthProblem> {
        let mut meter = HealthMeter::default();
        for index in 0..20 {
            let mut run = run(index);
            change(&mut run);
            meter.add(&run);
        }
        meter.finish().problems
    }

    #[test]
    fn a_healthy_campaign_has_no_warning() {
        assert_eq!(problems(|_| ()), []);
        // Runs whose world can't be built have no simulation data.
        assert_eq!(
            problems(|run| (run.deepest_penetration_m, run.energy_gain_j) = (None, None)),
            []
        );
    }

    #[test]
    fn each_warning_names_its_run() {
        let third = |run: &RunVitals| run.index == 2;
        let slow = problems(|run| run.wall_secs += if third(run) { 60.0 } else { 0.0 });
        assert_eq!(slow, [HealthProblem::Slow("k-3".into(), 61.2, 2.1)]);
        let same = problems(|run| run.choices = self::run(run.index.min(17)).choices);
        assert_eq!(
            same,
            [HealthProblem::Duplicates(2, "k-19".into(), "k-18".into())]
        );
        let deep =
            problems(|run| run.deepest_penetration_m = Some(if third(run) { 0.03 } else { 0.0 }));
        assert_eq!(deep, [HealthProblem::Penetration("k-3".into(), 0.03)]);
        let hot = problems(|run| run.energy_gain_j = Some(if third(run) { 2.0 } else { 0.0 }));
        assert_eq!(hot, [HealthProblem::Energy("k-3".into(), 2.0)]);
        let crowded = problems(|run| {
            run.discards = vec!["no place".to_owned(); usize::from(run.index % 4 == 1)]
        });
        assert_eq!(
            crowded,
            [HealthProblem::Discards(5, 25, 2, "no place".into())]
        );
    }

    #[test]
    fn a_property_that_rarely_applies_is_reported() {
        let inapplicable = |applies: u64, all: u64| {
            let mut meter = HealthMeter::default();
            let outcome = |at| {
                if at < applies {
                    Outcome::Passed
                } else {
                    Outcome::Inapplicable
                }
            };
            (0..all).for_each(|at| meter.add_outcomes("p", outcome(at), 1));
            meter.inapplicable()
        };
        assert_eq!(
            inapplicable(1, 10),
            [HealthProblem::Inapplicable("p".into(), 9, 10)]
        );
        assert_eq!(inapplicable(2, 10), []);
        assert_eq!(inapplicable(0, 9), []);
    }
}
