//! The schedule of a campaign with a search.

use std::sync::Arc;

use crate::search_space::SearchSpace;
use crate::{Env, Planned, RunResult, Schedule, Steering, WeightedRate};
use actcheck_base::Outcome;
use actcheck_config::Step;
use actcheck_search::{Ask, PropertyResult, Search};

/// Asks the searches of the tests in turn for a generation of scenes, and returns the results to
/// them.
///
/// The scenes depend on the seed and on the results of earlier generations, not on the number of
/// workers.
pub(super) struct Searching {
    space: SearchSpace,
    tests: Vec<SearchedTest>,
    /// Scenes of each test.
    scenes: u64,
    /// Runs of each scene.
    repeat: u64,
    /// Position of the test whose generation is being made.
    turn: usize,
    /// Whether a generation is being made.
    asked: bool,
}

struct SearchedTest {
    /// Names of its actions, joined by a space.
    name: String,
    search: Search,
    /// IRIs of the properties that it learns from, in this order.
    properties: Vec<String>,
    /// Number of scenes so far.
    made: u64,
}

impl Searching {
    pub fn new(env: &Env) -> Self {
        let campaign = &env.campaign;
        let space = SearchSpace::new(env);
        let search = |number: usize| {
            // Not the campaign's seed itself, which drives the choices outside the search.
            let seed = campaign.seed.rotate_left(17) ^ (0x5eed_0000_0000_0001 + number as u64);
            Search::new(space.cube(), campaign.search, seed)
        };
        let tests = campaign.tests.iter().enumerate().map(|(number, test)| {
            let actions = test
                .iter()
                .filter_map(|step| env.ontology.actions.get(&step.action));
            let mut properties: Vec<String> = actions
                .flat_map(|action| action.success_properties.iter().cloned())
                .collect();
            properties.sort();
            properties.dedup();
            SearchedTest {
                name: Step::test_name(test),
                search: search(number),
                properties,
                made: 0,
            }
        });
        let (scenes, repeat) = (u64::from(campaign.test_count), u64::from(campaign.repeat));
        Self {
            tests: tests.collect(),
            space,
            scenes,
            repeat,
            turn: 0,
            asked: false,
        }
    }

    /// All runs of a generation's scenes.
    fn planned(&self, asked: &[Ask], first: u64) -> Vec<Planned> {
        let guided = self.tests[self.turn].search.strategy().is_guided();
        let of_scene = |(ask, scene): (&Ask, u64)| {
            let quantiles = self.space.quantiles(&ask.point);
            let steering = Arc::new(Steering {
                quantiles,
                weight: guided.then_some(ask.weight),
            });
            (0..self.repeat).map(move |repetition| Planned {
                index: scene * self.repeat + repetition,
                scene,
                repetition: (self.repeat > 1).then_some(repetition),
                steering: Some(Arc::clone(&steering)),
            })
        };
        asked.iter().zip(first..).flat_map(of_scene).collect()
    }
}

impl Schedule for Searching {
    fn next_batch(&mut self, results: &[RunResult]) -> Vec<Planned> {
        if self.asked {
            self.tests[self.turn].tell(results, self.repeat);
            self.turn = (self.turn + 1) % self.tests.len();
        }
        let (turn, scenes) = (self.turn, self.scenes);
        self.asked = true;
        let Some(test) = self.tests.get_mut(turn) else {
            return Vec::new();
        };
        // All tests have the same number of scenes, so they finish in the same turn.
        let asked = test
            .search
            .ask(usize::try_from(scenes - test.made).unwrap_or(usize::MAX));
        let first = turn as u64 * scenes + test.made;
        test.made += asked.len() as u64;
        self.planned(&asked, first)
    }

    fn rates(&self) -> Vec<WeightedRate> {
        let guided = |test: &&SearchedTest| test.search.strategy().is_guided();
        self.tests
            .iter()
            .filter(guided)
            .flat_map(SearchedTest::rates)
            .collect()
    }
}

impl SearchedTest {
    /// Passes the first run of each scene to the search: an estimate must count each scene once,
    /// not its repetitions.
    fn tell(&mut self, results: &[RunResult], repeat: u64) {
        for run in results.iter().filter(|run| run.index % repeat == 0) {
            let results: Vec<PropertyResult> = self
                .properties
                .iter()
                .map(|property| worst_result(run, property))
                .collect();
            if run.discards == 0 {
                self.search.tell(results);
            } else {
                // The requested scene could not be built: the run has a random scene instead.
                self.search.tell_replacement(&results);
            }
        }
    }

    fn rates(&self) -> Vec<WeightedRate> {
        let rates = self.properties.iter().zip(self.search.estimates());
        let found = rates.filter_map(|(property, estimate)| {
            Some(WeightedRate {
                test: self.name.clone(),
                property: property.clone(),
                failing: estimate?,
                scenes: self.search.counted(),
            })
        });
        found.collect()
    }
}

/// The worst result of a property over all actions of a run.
fn worst_result(run: &RunResult, property: &str) -> PropertyResult {
    let own = || {
        run.outcomes
            .iter()
            .filter(|outcome| outcome.property == property)
    };
    let decided =
        own().filter(|outcome| matches!(outcome.outcome, Outcome::Passed | Outcome::Failed));
    let margin = decided
        .filter_map(|outcome| outcome.margin)
        .reduce(f64::min);
    PropertyResult {
        failed: own().any(|outcome| outcome.outcome == Outcome::Failed),
        margin,
    }
}
