//! Schedules: the runs of a campaign, their order, and their choices.
//!
//! A schedule depends only on its configuration and on the results of earlier batches, neither on
//! the number of workers nor on interruptions of the campaign.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::searching::Searching;
use crate::{Env, WeightedRate};
use actcheck_base::{Judgement, Outcome, Shard};
use actcheck_data::{ChoiceName, Choices};
use actcheck_history::{Repetition, RunDetail, RunRecord};
use actcheck_search::Strategy;

/// Runs in a batch of a campaign without a search. Workers wait for each other only between
/// batches, so a large number costs nothing; the limit bounds the memory of a campaign of millions
/// of runs.
const BATCH: usize = 10_000;

/// Separates random streams of noise from those of scenes.
const NOISE: u64 = 1 << 63;

/// A planned run.
#[derive(Debug, Clone, PartialEq)]
pub struct Planned {
    /// Position in the campaign, from 0: the run's number is the index + 1.
    pub index: u64,
    /// Number of its scene in the campaign, from 0.
    pub scene: u64,
    /// Number of the repetition of its scene, from 0; `None` if every scene is run once.
    pub repetition: Option<u64>,
    /// The choices of its scene that a search made; `None` if all are random.
    pub steering: Option<Arc<Steering>>,
}

/// The choices of a scene that a search made.
#[derive(Debug, Clone, PartialEq)]
pub struct Steering {
    /// Quantiles of choices by name.
    pub quantiles: BTreeMap<ChoiceName, f64>,
    /// Importance weight of the scene, if scenes are not drawn from the configuration's
    /// distribution.
    pub weight: Option<f64>,
}

impl Planned {
    /// Returns the choices of the run's `attempt`, from 0; the scenes of earlier attempts were
    /// discarded.
    ///
    /// Each attempt has its own random stream, so that a discard does not change the choices of
    /// other runs. The noise of each repetition has its own stream too, whatever the number of
    /// repetitions.
    pub fn choices(&self, seed: u64, attempt: u64) -> Choices {
        let stream = self.scene | (attempt << 48);
        // If the steered scene can't be built, a random one replaces it.
        let scene = match self.steering.as_ref().filter(|_| attempt == 0) {
            Some(steering) => Choices::steered(&steering.quantiles, seed, stream),
            None => Choices::random(seed, stream),
        };
        match self.repetition {
            None => scene,
            Some(number) => scene.with_noise(seed, NOISE | (number << 40) | self.scene),
        }
    }

    /// The repetition for the run's record. Returns `None` if every scene is run once.
    pub fn repetition(&self) -> Option<Repetition> {
        self.repetition.map(|number| Repetition {
            scene: self.scene,
            number,
        })
    }
}

/// Summary of a stored run for the schedule.
#[derive(Debug, Clone, PartialEq)]
pub struct RunResult {
    /// Position in the campaign, from 0.
    pub index: u64,
    /// Number of scenes discarded before the one of the run.
    pub discards: u64,
    /// Outcome of each property of each action.
    pub outcomes: Vec<PropertyOutcome>,
}

/// Outcome of a property in a run.
#[derive(Debug, Clone, PartialEq)]
pub struct PropertyOutcome {
    /// IRI of the property.
    pub property: String,
    /// The outcome.
    pub outcome: Outcome,
    /// Distance from the opposite outcome, in the property's unit; positive if it passed.
    pub margin: Option<f64>,
}

impl RunResult {
    /// Summarises a new run.
    pub fn of(record: &RunRecord) -> Self {
        let outcomes = record.judgements.iter().flatten().map(PropertyOutcome::of);
        Self {
            index: record.index,
            discards: record.discards.len() as u64,
            outcomes: outcomes.collect(),
        }
    }

    /// Summarises a run of the history.
    pub fn from_stored(run: &RunDetail) -> Self {
        let outcomes = run
            .actions
            .iter()
            .flat_map(|action| &action.judgements)
            .map(PropertyOutcome::of);
        Self {
            index: run.row.index,
            discards: run.discards.len() as u64,
            outcomes: outcomes.collect(),
        }
    }
}

impl PropertyOutcome {
    fn of(judgement: &Judgement) -> Self {
        Self {
            property: judgement.property.clone(),
            outcome: judgement.outcome,
            margin: judgement.margin,
        }
    }
}

/// Plans the runs of a campaign in batches.
pub trait Schedule {
    /// Returns the next runs, in the order in which they are stored; empty if the schedule is
    /// finished.
    ///
    /// It is called when all runs of the previous batch are in the history; `results` has these
    /// runs, in the same order.
    fn next_batch(&mut self, results: &[RunResult]) -> Vec<Planned>;

    /// Failure rates of properties, if the raw counts of runs are biased. They cover the complete
    /// batches so far.
    fn rates(&self) -> Vec<WeightedRate> {
        Vec::new()
    }
}

/// Returns the schedule of a campaign's configuration.
pub fn schedule_of(env: &Env) -> Box<dyn Schedule> {
    let all: Box<dyn Schedule> = if env.campaign.search == Strategy::Random {
        let tests = env.campaign.tests.len() as u64;
        let repeat = u64::from(env.campaign.repeat);
        Box::new(InTurns {
            tests,
            scenes: u64::from(env.campaign.test_count),
            repeat,
            made: 0,
        })
    } else {
        Box::new(Searching::new(env))
    };
    match env.campaign.shard {
        None => all,
        Some(shard) => Box::new(OneShard { all, shard }),
    }
}

/// All repetitions of all scenes of all tests. Tests alternate, so that a campaign that ends early
/// has about the same number of scenes of each.
struct InTurns {
    tests: u64,
    /// Scenes of each test.
    scenes: u64,
    /// Runs of each scene.
    repeat: u64,
    /// Runs planned so far.
    made: u64,
}

impl InTurns {
    /// The run at a position of the schedule, from 0.
    fn planned(&self, place: u64) -> Planned {
        let (turn, repetition) = (place / self.repeat, place % self.repeat);
        let scene = turn % self.tests * self.scenes + turn / self.tests;
        let repetition_of_several = (self.repeat > 1).then_some(repetition);
        Planned {
            index: scene * self.repeat + repetition,
            scene,
            repetition: repetition_of_several,
            steering: None,
        }
    }
}

impl Schedule for InTurns {
    fn next_batch(&mut self, _results: &[RunResult]) -> Vec<Planned> {
        let planned = self.tests * self.scenes * self.repeat;
        let batch: Vec<Planned> = (self.made..planned)
            .take(BATCH)
            .map(|place| self.planned(place))
            .collect();
        self.made += batch.len() as u64;
        batch
    }
}

/// The runs of another schedule that belong to one shard. That schedule must not depend on the
/// results of runs.
struct OneShard {
    all: Box<dyn Schedule>,
    shard: Shard,
}

impl Schedule for OneShard {
    fn next_batch(&mut self, _results: &[RunResult]) -> Vec<Planned> {
        loop {
            // The results of one shard would mislead a schedule that uses them.
            let mut batch = self.all.next_batch(&[]);
            let last = batch.is_empty();
            batch.retain(|planned| self.shard.has(planned.index));
            // A batch may have no run of this shard; that is not the end.
            if last || !batch.is_empty() {
                return batch;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tests_alternate_and_every_run_is_planned_once() {
        let mut schedule = InTurns {
            tests: 3,
            scenes: 5_000,
            repeat: 1,
            made: 0,
        };
        let mut indices = Vec::new();
        loop {
            let batch = schedule.next_batch(&[]);
            if batch.is_empty() {
                break;
            }
            indices.extend(batch.iter().map(|planned| planned.index));
        }
        assert_eq!(indices[..5], [0, 5_000, 10_000, 1, 5_001]);
        indices.sort_unstable();
        assert_eq!(indices, (0..15_000).collect::<Vec<u64>>());
    }

    #[test]
    fn the_runs_of_a_scene_are_consecutive() {
        let batch = InTurns {
            tests: 2,
            scenes: 2,
            repeat: 3,
            made: 0,
        }
        .next_batch(&[]);
        let indices: Vec<u64> = batch.iter().map(|planned| planned.index).collect();
        assert_eq!(indices, [0, 1, 2, 6, 7, 8, 3, 4, 5, 9, 10, 11]);
        assert_eq!(
            batch[5].repetition(),
            Some(Repetition {
                scene: 2,
                number: 2
            })
        );
    }

    /// Repetitions share the scene, and their noise does not depend on their number.
    #[test]
    fn repetitions_differ_only_in_noise() {
        let drawn = |scene, repetition| {
            let mut choices = Planned {
                index: 0,
                scene,
                repetition,
                steering: None,
            }
            .choices(7, 0);
            let yaw = choices.real("yaw".into(), 0.0, 1.0, 0.0).to_bits();
            choices.begin_noise();
            (yaw, choices.normal("sense.x".into(), 1.0).to_bits())
        };
        assert_eq!(drawn(1, Some(0)).0, drawn(1, Some(1)).0);
        assert_eq!(drawn(1, Some(0)).0, drawn(1, None).0);
        assert_ne!(drawn(1, Some(0)).1, drawn(1, Some(1)).1);
        assert_ne!(drawn(1, Some(0)).1, drawn(2, Some(0)).1);
    }

    #[test]
    fn every_run_is_in_one_shard() {
        let mut indices = Vec::new();
        for number in 1..=7 {
            let all = Box::new(InTurns {
                tests: 2,
                scenes: 3_334,
                repeat: 3,
                made: 0,
            });
            let mut schedule = OneShard {
                all,
                shard: Shard::new(number, 7).expect("a part"),
            };
            loop {
                let batch = schedule.next_batch(&[]);
                if batch.is_empty() {
                    break;
                }
                indices.extend(batch.iter().map(|planned| planned.index));
            }
        }
        indices.sort_unstable();
        assert_eq!(indices, (0..20_004).collect::<Vec<u64>>());
    }

    #[test]
    fn attempts_and_runs_have_independent_choices() {
        let first = |index, attempt| {
            Planned {
                index,
                scene: index,
                repetition: None,
                steering: None,
            }
            .choices(7, attempt)
            .real("x".into(), 0.0, 1.0, 0.0)
            .to_bits()
        };
        assert_eq!(first(1, 0), first(1, 0));
        assert_ne!(first(1, 0), first(2, 0));
        assert_ne!(first(1, 0), first(1, 1));
    }
}
