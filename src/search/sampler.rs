//! The ask-and-tell loop of a search, generation by generation.

use std::collections::VecDeque;

use super::archive::{Archive, ClosedRegion, PropertyResult, Tried};
use super::estimate::{Estimate, Weighted};
use super::fill;
use super::proposal::{Component, Proposal};
use super::space::Space;
use super::strategy::Strategy;
use super::{bandit, boundary, cross_entropy, unusual};

/// Maximum number of points in a generation. It is fixed, so that points don't depend on the number
/// of workers.
pub const GENERATION: usize = 20;

/// Share of unusual points among those not chosen by margins, if the space declares unusual values.
/// Weights are then at most 5, or 8 with chosen points.
const UNUSUAL: f64 = 0.8;

/// Number of points before the first one chosen by margins: about twice the number of coefficients
/// in a model of 8 axes.
const FIRST_PLAIN: usize = 40;

/// Maximum number of chosen points per other point. It limits the total to 1.25 times the number of
/// other points.
const CHOSEN_FOR_A_PLAIN: f64 = 0.25;

/// Maximum share of chosen points in a generation. With 12 plain points of 20, weights are at most
/// 20/12.
const MOST_CHOSEN: f64 = 0.4;

/// A failing region is closed after this many failures of chosen points of one property.
const FAILURES_OF_A_REGION: usize = 12;

/// A region is closed after this many chosen points without a lower margin.
const PATIENCE: usize = 24;

/// Radius of a closed region, as a root mean square distance over the axes. Two random points have
/// distance 0.4.
const REGION_RADIUS: f64 = 0.1;

/// A point to evaluate.
#[derive(Debug, Clone, PartialEq)]
pub struct Ask {
    /// Its coordinates in [0, 1).
    pub point: Vec<f64>,
    /// Importance weight: the nominal density divided by the density of the point's generation.
    pub weight: f64,
    /// The largest possible weight of a point in this generation.
    pub largest_weight: f64,
    /// The property for which the point was chosen, or `None` if margins did not choose it.
    pub focus: Option<usize>,
}

/// A search in progress: ask for points, evaluate them, tell the results.
#[derive(Debug, Clone)]
pub struct Search {
    space: Space,
    strategy: Strategy,
    seed: u64,
    generation: u64,
    plain: usize,
    unusual: usize,
    chosen: usize,
    waiting: VecDeque<Ask>,
    /// Weight, largest weight and failures of the generation's points so far. The weights are valid
    /// only for a whole generation.
    counted: Vec<(f64, f64, Vec<bool>)>,
    archive: Archive,
    /// For each property: the number of points evaluated when its current region was started.
    begun: Vec<usize>,
    rates: Vec<Weighted>,
}

impl Search {
    /// Creates a search of a cube. The same seed and results give the same points on every machine.
    pub fn new(space: Space, strategy: Strategy, seed: u64) -> Self {
        Self {
            space,
            strategy,
            seed,
            generation: 0,
            plain: 0,
            unusual: 0,
            chosen: 0,
            waiting: VecDeque::new(),
            counted: Vec::new(),
            archive: Archive::default(),
            begun: Vec::new(),
            rates: Vec::new(),
        }
    }

    /// Returns the points of the next generation: [`GENERATION`], or `wanted` if that is less.
    ///
    /// Drops pending points of the previous generation. An incomplete generation does not count for
    /// rates, because weights are valid only for whole generations.
    pub fn ask(&mut self, wanted: usize) -> Vec<Ask> {
        let size = wanted.min(GENERATION);
        let asked: Vec<Ask> = match self.strategy {
            Strategy::Random => self.plain_points(size).into_iter().map(plain).collect(),
            Strategy::Halton => {
                let first = self.generation * GENERATION as u64;
                // Start at index 1: point 0 is 0 on every axis.
                let indices = first + 1..=first + size as u64;
                indices
                    .map(|index| plain(fill::halton(self.seed, index, self.width())))
                    .collect()
            }
            Strategy::LatinHypercube => {
                let points = fill::latin_hypercube(self.seed, self.generation, size, self.width());
                points.into_iter().map(plain).collect()
            }
            Strategy::CrossEntropy | Strategy::Bandit | Strategy::Boundary => self.guided(size),
        };
        self.generation += 1;
        self.waiting = asked.iter().cloned().collect();
        self.counted.clear();
        asked
    }

    /// Records the results of each property for the next pending point, in the order of
    /// [`Search::ask`].
    ///
    /// The list may be empty for a point without results. Results without a pending point are
    /// ignored.
    pub fn tell(&mut self, results: Vec<PropertyResult>) {
        let Some(ask) = self.waiting.pop_front() else {
            return;
        };
        self.count(&ask, &results);
        self.learn(ask, results);
    }

    /// Records results for the next pending point if it is infeasible and was replaced by a random
    /// feasible point.
    ///
    /// The replacement takes over the weight. Infeasible points have, weighted, their nominal
    /// share, and replacements are distributed like all feasible points, so rates are unbiased for
    /// the distribution of feasible points. Strategies don't learn from the replacement.
    pub fn tell_replacement(&mut self, results: &[PropertyResult]) {
        let Some(ask) = self.waiting.pop_front() else {
            return;
        };
        self.count(&ask, results);
        self.learn(ask, Vec::new());
    }

    /// Stores a result, and adds a generation to the rates when it is complete.
    fn count(&mut self, ask: &Ask, results: &[PropertyResult]) {
        let failed = results.iter().map(|result| result.failed).collect();
        self.counted.push((ask.weight, ask.largest_weight, failed));
        if !self.waiting.is_empty() {
            return;
        }
        for (weight, largest, failed) in self.counted.drain(..) {
            self.rates
                .resize(self.rates.len().max(failed.len()), Weighted::default());
            for (rate, failed) in self.rates.iter_mut().zip(failed) {
                rate.add(weight, largest, failed);
            }
        }
    }

    fn learn(&mut self, ask: Ask, results: Vec<PropertyResult>) {
        self.begun.resize(self.begun.len().max(results.len()), 0);
        self.archive.tried.push(Tried {
            point: ask.point,
            results,
            focus: ask.focus,
        });
        if let Some(property) = ask.focus {
            self.close_if_exhausted(property);
        }
    }

    /// The strategy of the search.
    pub fn strategy(&self) -> Strategy {
        self.strategy
    }

    /// Number of points in the estimates: those of complete generations.
    pub fn counted(&self) -> u64 {
        self.rates.iter().map(Weighted::points).max().unwrap_or(0)
    }

    /// Estimates the failure probability of each property under the uniform distribution. An entry
    /// is `None` without points.
    pub fn estimates(&self) -> Vec<Option<Estimate>> {
        self.rates.iter().map(Weighted::estimate).collect()
    }

    fn width(&self) -> usize {
        self.space.dimensions().len()
    }

    fn plain_points(&mut self, count: usize) -> Vec<Vec<f64>> {
        let first = self.plain;
        self.plain += count;
        (first..self.plain)
            .map(|index| fill::random(self.seed, index as u64, self.width()))
            .collect()
    }

    /// Draws unusual points first, then plain ones, then those chosen by margins.
    fn guided(&mut self, size: usize) -> Vec<Ask> {
        let focus = if self.plain + self.unusual < FIRST_PLAIN {
            None
        } else {
            self.focus()
        };
        let proposal = focus
            .map(|property| self.propose(property))
            .unwrap_or_default();
        // An empty proposal is the uniform distribution: draw plain points instead.
        let chosen = if proposal == Proposal::default() {
            0
        } else {
            self.credit(size)
        };
        let kinds = unusual::kinds(&self.space);
        let unusual = if kinds.is_empty() {
            0
        } else {
            (UNUSUAL * (size - chosen) as f64) as usize
        };
        let plain_count = size - chosen - unusual;
        let mut generator = fill::stream(self.seed, 5, self.generation);
        let turns = (0..unusual).map(|number| unusual::kind_at(number, kinds.len()));
        let of_kinds: Vec<&Component> = turns.map(|kind| &kinds[kind]).collect();
        let mut points: Vec<(Vec<f64>, Option<usize>)> = of_kinds
            .iter()
            .map(|kind| (kind.draw(&mut generator), None))
            .collect();
        points.extend(
            self.plain_points(plain_count)
                .into_iter()
                .map(|point| (point, None)),
        );
        let mut generator = fill::stream(self.seed, 4, self.generation);
        points.extend((0..chosen).map(|_| (proposal.draw(&mut generator, self.width()), focus)));
        self.unusual += unusual;
        self.chosen += chosen;
        let largest_weight = size as f64 / plain_count as f64;
        let weighted = |(point, focus): (Vec<f64>, Option<usize>)| {
            // The balance heuristic of Veach and Guibas (1995), within a generation. A proposal
            // depends only on earlier generations, so that the estimate stays unbiased.
            let unusual: f64 = of_kinds.iter().map(|kind| kind.density(&point)).sum();
            let density = plain_count as f64 + unusual + chosen as f64 * proposal.density(&point);
            Ask {
                point,
                weight: size as f64 / density,
                largest_weight,
                focus,
            }
        };
        points.into_iter().map(weighted).collect()
    }

    /// Returns the maximum number of chosen points in the next generation.
    fn credit(&self, size: usize) -> usize {
        let others = |count: usize| self.plain + self.unusual + size - count;
        let affordable = |count: usize| {
            (self.chosen + count) as f64 <= CHOSEN_FOR_A_PLAIN * others(count) as f64
        };
        (0..=(MOST_CHOSEN * size as f64) as usize)
            .rev()
            .find(|count| affordable(*count))
            .unwrap_or(0)
    }

    /// Returns the property for which the next points are chosen: round robin over the properties
    /// that have not failed yet, or over all once each has failed. Returns `None` if no property
    /// has informative margins.
    fn focus(&self) -> Option<usize> {
        let telling: Vec<usize> = (0..self.archive.properties())
            .filter(|property| self.archive.has_informative_margins(*property))
            .collect();
        let unfailed = |property: &usize| {
            !self
                .archive
                .tried
                .iter()
                .any(|tried| tried.failed(*property))
        };
        let fresh: Vec<usize> = telling.iter().copied().filter(unfailed).collect();
        let turn = if fresh.is_empty() { telling } else { fresh };
        turn.get((self.generation as usize).checked_rem(turn.len())?)
            .copied()
    }

    fn propose(&self, property: usize) -> Proposal {
        match self.strategy {
            Strategy::CrossEntropy => cross_entropy::propose(&self.space, &self.archive, property),
            Strategy::Bandit => bandit::propose(&self.space, &self.archive, property),
            Strategy::Boundary => boundary::propose(&self.space, &self.archive, property),
            Strategy::Random | Strategy::Halton | Strategy::LatinHypercube => Proposal::default(),
        }
    }

    /// Closes the current region of a property after enough failures, or when the margin no longer
    /// decreases.
    fn close_if_exhausted(&mut self, property: usize) {
        let begun = self.begun[property];
        let own: Vec<&Tried> = self.archive.tried[begun..]
            .iter()
            .filter(|tried| tried.focus == Some(property))
            .collect();
        let failures = own.iter().filter(|tried| tried.failed(property)).count();
        let margin = |tried: &&&Tried| tried.margin(property).unwrap_or(f64::INFINITY);
        let Some((at, best)) = own
            .iter()
            .enumerate()
            .min_by(|(_, a), (_, b)| margin(a).total_cmp(&margin(b)))
        else {
            return;
        };
        let stuck = failures == 0 && own.len() - 1 - at >= PATIENCE;
        if failures >= FAILURES_OF_A_REGION || stuck {
            let centre = best.point.clone();
            self.archive.closed.push(ClosedRegion {
                property,
                centre,
                radius: REGION_RADIUS,
            });
            self.begun[property] = self.archive.tried.len();
        }
    }
}

fn plain(point: Vec<f64>) -> Ask {
    Ask {
        point,
        weight: 1.0,
        largest_weight: 1.0,
        focus: None,
    }
}

#[cfg(test)]
mod tests {
    use super::super::space::Dimension;
    use super::*;

    /// Volume of the failing region, where the first two axes are low and the third is category 2:
    /// 0.3 · 0.2 / 4.
    const VOLUME: f64 = 0.015;

    fn margin(point: &[f64]) -> f64 {
        let category = if (point[2] * 4.0) as usize == 2 {
            -1.0
        } else {
            0.2
        };
        (point[0] - 0.3).max(point[1] - 0.2).max(category)
    }

    fn space() -> Space {
        let continuous = Dimension::Continuous;
        Space::new([
            continuous,
            continuous,
            Dimension::Categorical(4),
            continuous,
        ])
    }

    fn result(margin: f64) -> PropertyResult {
        PropertyResult {
            failed: margin < 0.0,
            margin: Some(margin),
        }
    }

    /// Returns the search after this many generations, and all its points.
    fn searched(strategy: Strategy, seed: u64, generations: usize) -> (Search, Vec<Ask>) {
        let mut search = Search::new(space(), strategy, seed);
        let mut asked = Vec::new();
        for _ in 0..generations {
            let generation = search.ask(GENERATION);
            assert_eq!(generation.len(), GENERATION);
            for ask in &generation {
                assert!(
                    ask.point.iter().all(|value| (0.0..1.0).contains(value)),
                    "{ask:?}"
                );
                assert!(
                    ask.weight > 0.0 && ask.weight <= ask.largest_weight,
                    "{ask:?}"
                );
                search.tell(vec![result(margin(&ask.point))]);
            }
            asked.extend(generation);
        }
        (search, asked)
    }

    #[test]
    fn the_same_seed_and_results_give_the_same_points() {
        for strategy in Strategy::ALL {
            assert_eq!(
                searched(strategy, 5, 12).1,
                searched(strategy, 5, 12).1,
                "{strategy:?}"
            );
            assert_ne!(
                searched(strategy, 5, 12).1,
                searched(strategy, 6, 12).1,
                "{strategy:?}"
            );
        }
    }

    /// Over many seeds the mean rate is the volume, nearly all intervals contain it, and weights
    /// have mean 1.
    #[test]
    fn rates_are_unbiased_for_every_strategy() {
        const SEEDS: u64 = 200;
        for strategy in Strategy::ALL {
            let (mut rates, mut held, mut weights) = (0.0, 0, 0.0);
            for seed in 0..SEEDS {
                let (search, asked) = searched(strategy, seed, 25);
                let estimate = search.estimates()[0].expect("the points have results");
                rates += estimate.rate / SEEDS as f64;
                held += u64::from((estimate.low..=estimate.high).contains(&VOLUME));
                weights += asked.iter().map(|ask| ask.weight).sum::<f64>()
                    / asked.len() as f64
                    / SEEDS as f64;
            }
            // Four standard errors of plain random sampling.
            assert!((rates - VOLUME).abs() < 0.0016, "{strategy:?}: {rates}");
            assert!(
                held >= SEEDS * 95 / 100 - 4,
                "{strategy:?}: {held} of {SEEDS}"
            );
            assert!((weights - 1.0).abs() < 0.01, "{strategy:?}: {weights}");
        }
    }

    /// Chosen points fail far more often than plain ones, whose failure rate is the volume.
    #[test]
    fn guided_strategies_converge() {
        for strategy in Strategy::ALL
            .into_iter()
            .filter(|strategy| strategy.is_guided())
        {
            let failing = (0..20)
                .flat_map(|seed| searched(strategy, seed, 12).1)
                .filter(|ask| ask.focus.is_some());
            let (count, failed) = failing.fold((0, 0), |(count, failed), ask| {
                (count + 1, failed + usize::from(margin(&ask.point) < 0.0))
            });
            assert!(count > 200, "{strategy:?}: {count}");
            assert!(
                failed as f64 > 5.0 * VOLUME * count as f64,
                "{strategy:?}: {failed} of {count}"
            );
        }
    }

    /// A guided search has the plain points of a random search, at least four for each chosen
    /// point. So misleading margins cost little.
    #[test]
    fn a_guided_search_includes_the_random_points() {
        let random = searched(Strategy::Random, 3, 40).1;
        for strategy in Strategy::ALL
            .into_iter()
            .filter(|strategy| strategy.is_guided())
        {
            let (mut plain, mut chosen) = (0, 0);
            for ask in searched(strategy, 3, 40).1 {
                if ask.focus.is_some() {
                    chosen += 1;
                    assert!(chosen * 4 <= plain, "{strategy:?}: {chosen} for {plain}");
                } else {
                    assert_eq!(ask.point, random[plain].point);
                    plain += 1;
                }
            }
            assert!(chosen > 100, "{strategy:?}: {chosen}");
        }
    }

    #[test]
    fn without_margins_points_stay_random() {
        for strategy in Strategy::ALL {
            let mut search = Search::new(space(), strategy, 1);
            for _ in 0..10 {
                for ask in search.ask(GENERATION) {
                    assert_eq!((ask.weight, ask.focus), (1.0, None));
                    search.tell(vec![PropertyResult {
                        failed: margin(&ask.point) < 0.0,
                        margin: None,
                    }]);
                }
            }
        }
    }

    /// Two properties fail rarely, in opposite corners: both failures are found, and the properties
    /// share the chosen points.
    #[test]
    fn failures_of_several_properties_are_all_found() {
        for strategy in Strategy::ALL
            .into_iter()
            .filter(|strategy| strategy.is_guided())
        {
            let mut search = Search::new(Space::new([Dimension::Continuous; 6]), strategy, 2);
            let mut failed = [0, 0];
            for _ in 0..50 {
                for ask in search.ask(GENERATION) {
                    let mean = ask.point.iter().sum::<f64>() / 6.0;
                    let margins = [mean - 0.2, 0.8 - mean];
                    (0..2).for_each(|property| {
                        failed[property] += usize::from(margins[property] < 0.0)
                    });
                    search.tell(margins.map(result).to_vec());
                }
            }
            // A share of 1.2⁶ / 6! = 0.0041 of plain random points fails, four of 1000 (Irwin–Hall
            // distribution).
            assert!(
                failed.iter().all(|count| *count >= 12),
                "{strategy:?}: {failed:?}"
            );
        }
    }

    /// One property fails if noise is large and there are many objects, 0.0027 · 2/5 of the volume;
    /// another if both are usual.
    #[test]
    fn unusual_points_are_tried_early_and_rates_stay_unbiased() {
        let space = Space::new([
            Dimension::Normal,
            Dimension::Rising(5),
            Dimension::Continuous,
        ]);
        let fails = |point: &[f64]| {
            // Beyond three standard deviations on either side.
            [
                (point[0] - 0.5).abs() > 0.498_65 && point[1] > 0.6,
                point[1] < 0.4 && (point[0] - 0.5).abs() < 0.1,
            ]
        };
        let truth = [0.0027 * 0.4, 0.4 * 0.2];
        let (mut rates, mut held, mut found) = ([0.0; 2], [0; 2], 0);
        const SEEDS: u64 = 200;
        for seed in 0..SEEDS {
            let mut search = Search::new(space.clone(), Strategy::CrossEntropy, seed);
            let mut failed = [0; 2];
            for wanted in [GENERATION, GENERATION, 7, GENERATION] {
                for ask in search.ask(wanted) {
                    assert!(
                        ask.weight > 0.0 && ask.weight <= ask.largest_weight,
                        "{ask:?}"
                    );
                    let failures = fails(&ask.point);
                    (0..2).for_each(|property| failed[property] += usize::from(failures[property]));
                    search.tell(
                        failures
                            .map(|failed| PropertyResult {
                                failed,
                                margin: None,
                            })
                            .to_vec(),
                    );
                }
            }
            found += failed[0];
            for (property, estimate) in search.estimates().into_iter().enumerate() {
                let estimate = estimate.expect("the points have results");
                rates[property] += estimate.rate / SEEDS as f64;
                held[property] +=
                    u64::from((estimate.low..=estimate.high).contains(&truth[property]));
            }
        }
        // Random would find 67 · 0.00108 · 200 = 14.
        assert!(found > 500, "{found}");
        assert!(
            (rates[0] - truth[0]).abs() < 0.0003 && (rates[1] - truth[1]).abs() < 0.01,
            "{rates:?}"
        );
        assert!(held.iter().all(|held| held * 100 >= SEEDS * 93), "{held:?}");
    }

    /// A third of the cube is infeasible. A fifth of the rest fails.
    #[test]
    fn replacements_of_infeasible_points_keep_rates_unbiased() {
        let space = Space::new([Dimension::Normal, Dimension::Continuous]);
        let (mut rates, mut held) = (0.0, 0);
        const SEEDS: u64 = 300;
        for seed in 0..SEEDS {
            let mut search = Search::new(space.clone(), Strategy::Boundary, seed);
            let mut generator = fill::stream(seed, 99, 0);
            let possible = |point: &[f64]| (point[0] - 0.5).abs() < 1.0 / 3.0;
            let margin = |point: &[f64]| point[1] - 0.2;
            for _ in 0..6 {
                for ask in search.ask(GENERATION) {
                    if possible(&ask.point) {
                        search.tell(vec![result(margin(&ask.point))]);
                    } else {
                        let stand_in = std::iter::repeat_with(|| {
                            [fill::unit(&mut generator), fill::unit(&mut generator)]
                        })
                        .find(|point| possible(point))
                        .expect("the iterator is infinite");
                        search.tell_replacement(&[result(margin(&stand_in))]);
                    }
                }
            }
            let estimate = search.estimates()[0].expect("the points have results");
            rates += estimate.rate / SEEDS as f64;
            held += u64::from((estimate.low..=estimate.high).contains(&0.2));
        }
        assert!((rates - 0.2).abs() < 0.01, "{rates}");
        assert!(held * 100 >= SEEDS * 94, "{held}");
    }

    /// The results of an interrupted generation are incomplete, so that it does not count for
    /// rates.
    #[test]
    fn only_complete_generations_count() {
        let mut search = Search::new(space(), Strategy::Bandit, 1);
        let first = search.ask(5);
        first
            .iter()
            .for_each(|ask| search.tell(vec![result(margin(&ask.point))]));
        let whole = search.estimates();
        search.ask(GENERATION);
        search.tell(vec![result(-1.0)]);
        assert_eq!(search.estimates(), whole);
        search.ask(GENERATION);
        assert_eq!(search.estimates(), whole);
    }

    #[test]
    fn unrequested_results_are_ignored() {
        let mut search = Search::new(Space::new([]), Strategy::Boundary, 1);
        search.tell(vec![result(-1.0)]);
        assert!(search.estimates().is_empty());
        (0..5).for_each(|_| {
            search.ask(2);
            search.tell(Vec::new());
            search.tell(vec![result(f64::NAN)]);
            search.tell(vec![result(-1.0)]);
        });
        assert_eq!(search.estimates().len(), 1);
    }
}
