//! Asking for points and telling what came of them, generation by generation.

use std::collections::VecDeque;

use super::archive::{Archive, Closed, Told, Tried};
use super::estimate::{Estimate, Weighted};
use super::fill;
use super::proposal::{Component, Proposal};
use super::space::Space;
use super::strategy::Strategy;
use super::{bandit, boundary, cross_entropy, unusual};

/// Points of one generation at most. It is fixed, so that what is asked does not depend on who runs it.
pub const GENERATION: usize = 20;

/// Share of unusual points among those that no margin chose, where the space says what is unusual: a weight is at most
/// 5 then, or 8 with chosen points.
const UNUSUAL: f64 = 0.8;

/// Points that no margin chose before the first that one does: twice as many as there are coefficients in a model of 8 axes.
const FIRST_PLAIN: usize = 40;

/// Chosen points for each other one, so that at most 1.25 times as many points are needed as plain ones.
const CHOSEN_FOR_A_PLAIN: f64 = 0.25;

/// Share of chosen points in one generation at most: with 12 plain ones of 20 a weight is at most 20/12.
const MOST_CHOSEN: f64 = 0.4;

/// A failing place is left for others when so many chosen points of one property have failed in it.
const FAILURES_OF_A_PLACE: usize = 12;

/// A place is left when so many chosen points brought nothing lower.
const PATIENCE: usize = 24;

/// Radius of what is left, as a distance by root mean square over the axes: two random points are 0.4 apart.
const PLACE_RADIUS: f64 = 0.1;

/// A point that should be tried.
#[derive(Debug, Clone, PartialEq)]
pub struct Ask {
    /// Its coordinates in [0, 1).
    pub point: Vec<f64>,
    /// Importance weight: the nominal density by the one that its generation was drawn from.
    pub weight: f64,
    /// The largest weight that any point of its generation could have had.
    pub largest_weight: f64,
    /// The property that it was chosen for; nothing for a plain point.
    pub focus: Option<usize>,
}

/// A search that goes on: ask, try, tell.
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
    /// What the generation's points told so far. Only as a whole are they as their weights say.
    told: Vec<(f64, f64, Vec<bool>)>,
    archive: Archive,
    /// For each property: the tried points at which its present place was begun.
    begun: Vec<usize>,
    rates: Vec<Weighted>,
}

impl Search {
    /// A search of a cube. The same seed and the same answers give the same points, on every machine.
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
            told: Vec::new(),
            archive: Archive::default(),
            begun: Vec::new(),
            rates: Vec::new(),
        }
    }

    /// The points of the next generation: [`GENERATION`], or as many as are wanted still.
    ///
    /// What was asked before and not told is given up, and counts for no rate: weights are right for whole generations.
    pub fn ask(&mut self, wanted: usize) -> Vec<Ask> {
        let size = wanted.min(GENERATION);
        let asked: Vec<Ask> = match self.strategy {
            Strategy::Random => self.plain_points(size).into_iter().map(plain).collect(),
            Strategy::Halton => {
                let first = self.generation * GENERATION as u64;
                // The sequence begins at 1: its point 0 is the same corner in every axis.
                let indices = first + 1..=first + size as u64;
                indices.map(|index| plain(fill::halton(self.seed, index, self.width()))).collect()
            }
            Strategy::LatinHypercube => {
                let points = fill::latin_hypercube(self.seed, self.generation, size, self.width());
                points.into_iter().map(plain).collect()
            }
            Strategy::CrossEntropy | Strategy::Bandit | Strategy::Boundary => self.guided(size),
        };
        self.generation += 1;
        self.waiting = asked.iter().cloned().collect();
        self.told.clear();
        asked
    }

    /// What each property said of the next point that was asked for, in the order of asking.
    ///
    /// A list may be empty, for a point of which nothing could be learnt. What was not asked for is ignored.
    pub fn tell(&mut self, told: Vec<Told>) {
        let Some(ask) = self.waiting.pop_front() else { return };
        self.count(&ask, &told);
        self.learn(ask, told);
    }

    /// The same where the next point could not be tried, and one that was drawn at random from those that can be stood in.
    ///
    /// It takes over the weight: the points that can't be tried have, weighted, their nominal share, and what stands in for
    /// them is as all the others are; so rates are unbiased for the distribution of what can be tried. Nothing is learnt.
    pub fn tell_stand_in(&mut self, told: &[Told]) {
        let Some(ask) = self.waiting.pop_front() else { return };
        self.count(&ask, told);
        self.learn(ask, Vec::new());
    }

    /// Counts an answer when its generation is whole.
    fn count(&mut self, ask: &Ask, told: &[Told]) {
        let failed = told.iter().map(|told| told.failed).collect();
        self.told.push((ask.weight, ask.largest_weight, failed));
        if !self.waiting.is_empty() {
            return;
        }
        for (weight, largest, failed) in self.told.drain(..) {
            self.rates.resize(self.rates.len().max(failed.len()), Weighted::default());
            for (rate, failed) in self.rates.iter_mut().zip(failed) {
                rate.add(weight, largest, failed);
            }
        }
    }

    fn learn(&mut self, ask: Ask, told: Vec<Told>) {
        self.begun.resize(self.begun.len().max(told.len()), 0);
        self.archive.tried.push(Tried { point: ask.point, told, focus: ask.focus });
        if let Some(property) = ask.focus {
            self.leave_if_done(property);
        }
    }

    /// How points are chosen.
    pub fn strategy(&self) -> Strategy {
        self.strategy
    }

    /// Points that the estimates are made from: those of generations that were told as a whole.
    pub fn counted(&self) -> u64 {
        self.rates.iter().map(Weighted::points).max().unwrap_or(0)
    }

    /// The probability of each property failing under the uniform distribution; nothing for one never told of.
    pub fn estimates(&self) -> Vec<Option<Estimate>> {
        self.rates.iter().map(Weighted::estimate).collect()
    }

    fn width(&self) -> usize {
        self.space.dimensions().len()
    }

    fn plain_points(&mut self, count: usize) -> Vec<Vec<f64>> {
        let first = self.plain;
        self.plain += count;
        (first..self.plain).map(|index| fill::random(self.seed, index as u64, self.width())).collect()
    }

    /// Unusual points first, then plain ones, then those that are chosen with what is known.
    fn guided(&mut self, size: usize) -> Vec<Ask> {
        let focus = if self.plain + self.unusual < FIRST_PLAIN { None } else { self.focus() };
        let proposal = focus.map(|property| self.propose(property)).unwrap_or_default();
        // A proposal of nothing is the uniform distribution, of which plain points are as good.
        let chosen = if proposal == Proposal::default() { 0 } else { self.credit(size) };
        let kinds = unusual::kinds(&self.space);
        let unusual = if kinds.is_empty() { 0 } else { (UNUSUAL * (size - chosen) as f64) as usize };
        let plain_count = size - chosen - unusual;
        let mut generator = fill::stream(self.seed, 5, self.generation);
        let turns = (0..unusual).map(|number| unusual::kind_at(number, kinds.len()));
        let of_kinds: Vec<&Component> = turns.map(|kind| &kinds[kind]).collect();
        let mut points: Vec<(Vec<f64>, Option<usize>)> =
            of_kinds.iter().map(|kind| (kind.draw(&mut generator), None)).collect();
        points.extend(self.plain_points(plain_count).into_iter().map(|point| (point, None)));
        let mut generator = fill::stream(self.seed, 4, self.generation);
        points.extend((0..chosen).map(|_| (proposal.draw(&mut generator, self.width()), focus)));
        self.unusual += unusual;
        self.chosen += chosen;
        let largest_weight = size as f64 / plain_count as f64;
        let weighted = |(point, focus): (Vec<f64>, Option<usize>)| {
            // The balance heuristic of Veach and Guibas (1995), within a generation: what a proposal depends on is then
            // told before any of its points is drawn, and the estimate stays unbiased.
            let unusual: f64 = of_kinds.iter().map(|kind| kind.density(&point)).sum();
            let density = plain_count as f64 + unusual + chosen as f64 * proposal.density(&point);
            Ask { point, weight: size as f64 / density, largest_weight, focus }
        };
        points.into_iter().map(weighted).collect()
    }

    /// How many points may be chosen in the next generation.
    fn credit(&self, size: usize) -> usize {
        let others = |count: usize| self.plain + self.unusual + size - count;
        let affordable = |count: usize| (self.chosen + count) as f64 <= CHOSEN_FOR_A_PLAIN * others(count) as f64;
        (0..=(MOST_CHOSEN * size as f64) as usize).rev().find(|count| affordable(*count)).unwrap_or(0)
    }

    /// The property that the next points are chosen for: in turn, those that have not failed yet before all others.
    fn focus(&self) -> Option<usize> {
        let telling: Vec<usize> =
            (0..self.archive.properties()).filter(|property| self.archive.says_something(*property)).collect();
        let unfailed = |property: &usize| !self.archive.tried.iter().any(|tried| tried.failed(*property));
        let fresh: Vec<usize> = telling.iter().copied().filter(unfailed).collect();
        let turn = if fresh.is_empty() { telling } else { fresh };
        turn.get((self.generation as usize).checked_rem(turn.len())?).copied()
    }

    fn propose(&self, property: usize) -> Proposal {
        match self.strategy {
            Strategy::CrossEntropy => cross_entropy::propose(&self.space, &self.archive, property),
            Strategy::Bandit => bandit::propose(&self.space, &self.archive, property),
            Strategy::Boundary => boundary::propose(&self.space, &self.archive, property),
            Strategy::Random | Strategy::Halton | Strategy::LatinHypercube => Proposal::default(),
        }
    }

    /// Closes the place where a property was looked for, when enough failed there or nothing gets lower any more.
    fn leave_if_done(&mut self, property: usize) {
        let begun = self.begun[property];
        let own: Vec<&Tried> =
            self.archive.tried[begun..].iter().filter(|tried| tried.focus == Some(property)).collect();
        let failures = own.iter().filter(|tried| tried.failed(property)).count();
        let margin = |tried: &&&Tried| tried.margin(property).unwrap_or(f64::INFINITY);
        let Some((at, best)) = own.iter().enumerate().min_by(|(_, a), (_, b)| margin(a).total_cmp(&margin(b))) else {
            return;
        };
        let stuck = failures == 0 && own.len() - 1 - at >= PATIENCE;
        if failures >= FAILURES_OF_A_PLACE || stuck {
            let centre = best.point.clone();
            self.archive.closed.push(Closed { property, centre, radius: PLACE_RADIUS });
            self.begun[property] = self.archive.tried.len();
        }
    }
}

fn plain(point: Vec<f64>) -> Ask {
    Ask { point, weight: 1.0, largest_weight: 1.0, focus: None }
}

#[cfg(test)]
mod tests {
    use super::super::space::Dimension;
    use super::*;

    /// Fails where the first two of the axes are low and the third is category 2: 0.3 · 0.2 / 4 of the volume.
    const VOLUME: f64 = 0.015;

    fn margin(point: &[f64]) -> f64 {
        let category = if (point[2] * 4.0) as usize == 2 { -1.0 } else { 0.2 };
        (point[0] - 0.3).max(point[1] - 0.2).max(category)
    }

    fn space() -> Space {
        let continuous = Dimension::Continuous;
        Space::new([continuous, continuous, Dimension::Categorical(4), continuous])
    }

    fn told(margin: f64) -> Told {
        Told { failed: margin < 0.0, margin: Some(margin) }
    }

    /// The search after so many generations, and all that was asked.
    fn searched(strategy: Strategy, seed: u64, generations: usize) -> (Search, Vec<Ask>) {
        let mut search = Search::new(space(), strategy, seed);
        let mut asked = Vec::new();
        for _ in 0..generations {
            let generation = search.ask(GENERATION);
            assert_eq!(generation.len(), GENERATION);
            for ask in &generation {
                assert!(ask.point.iter().all(|value| (0.0..1.0).contains(value)), "{ask:?}");
                assert!(ask.weight > 0.0 && ask.weight <= ask.largest_weight, "{ask:?}");
                search.tell(vec![told(margin(&ask.point))]);
            }
            asked.extend(generation);
        }
        (search, asked)
    }

    #[test]
    fn the_same_seed_and_answers_give_the_same_points() {
        for strategy in Strategy::ALL {
            assert_eq!(searched(strategy, 5, 12).1, searched(strategy, 5, 12).1, "{strategy:?}");
            assert_ne!(searched(strategy, 5, 12).1, searched(strategy, 6, 12).1, "{strategy:?}");
        }
    }

    /// Over many seeds the mean of the rates is the volume, nearly all intervals hold it, and weights have mean 1.
    #[test]
    fn rates_are_unbiased_however_points_were_chosen() {
        const SEEDS: u64 = 200;
        for strategy in Strategy::ALL {
            let (mut rates, mut held, mut weights) = (0.0, 0, 0.0);
            for seed in 0..SEEDS {
                let (search, asked) = searched(strategy, seed, 25);
                let estimate = search.estimates()[0].expect("points were told");
                rates += estimate.rate / SEEDS as f64;
                held += u64::from((estimate.low..=estimate.high).contains(&VOLUME));
                weights += asked.iter().map(|ask| ask.weight).sum::<f64>() / asked.len() as f64 / SEEDS as f64;
            }
            // Four standard errors of plain random sampling.
            assert!((rates - VOLUME).abs() < 0.0016, "{strategy:?}: {rates}");
            assert!(held >= SEEDS * 95 / 100 - 4, "{strategy:?}: {held} of {SEEDS}");
            assert!((weights - 1.0).abs() < 0.01, "{strategy:?}: {weights}");
        }
    }

    /// Chosen points fail far more often than plain ones, which fail as often as the volume says.
    #[test]
    fn guided_strategies_converge() {
        for strategy in Strategy::ALL.into_iter().filter(|strategy| strategy.is_guided()) {
            let failing = (0..20).flat_map(|seed| searched(strategy, seed, 12).1).filter(|ask| ask.focus.is_some());
            let (count, failed) = failing
                .fold((0, 0), |(count, failed), ask| (count + 1, failed + usize::from(margin(&ask.point) < 0.0)));
            assert!(count > 200, "{strategy:?}: {count}");
            assert!(failed as f64 > 5.0 * VOLUME * count as f64, "{strategy:?}: {failed} of {count}");
        }
    }

    /// The plain points of a guided search are those of a random one, and at least four for each that is chosen: whatever
    /// margins say, a search is never far behind.
    #[test]
    fn a_guided_search_contains_the_random_one() {
        let random = searched(Strategy::Random, 3, 40).1;
        for strategy in Strategy::ALL.into_iter().filter(|strategy| strategy.is_guided()) {
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
    fn without_margins_points_stay_plain() {
        for strategy in Strategy::ALL {
            let mut search = Search::new(space(), strategy, 1);
            for _ in 0..10 {
                for ask in search.ask(GENERATION) {
                    assert_eq!((ask.weight, ask.focus), (1.0, None));
                    search.tell(vec![Told { failed: margin(&ask.point) < 0.0, margin: None }]);
                }
            }
        }
    }

    /// Two properties that fail in opposite corners, seldom: both are found, and the chosen points are shared.
    #[test]
    fn several_properties_are_all_looked_for() {
        for strategy in Strategy::ALL.into_iter().filter(|strategy| strategy.is_guided()) {
            let mut search = Search::new(Space::new([Dimension::Continuous; 6]), strategy, 2);
            let mut failed = [0, 0];
            for _ in 0..50 {
                for ask in search.ask(GENERATION) {
                    let mean = ask.point.iter().sum::<f64>() / 6.0;
                    let margins = [mean - 0.2, 0.8 - mean];
                    (0..2).for_each(|property| failed[property] += usize::from(margins[property] < 0.0));
                    search.tell(margins.map(told).to_vec());
                }
            }
            // Of plain random points 1.2⁶ / 6! = 0.0041 fail, that is four of 1000 (the distribution of Irwin and Hall).
            assert!(failed.iter().all(|count| *count >= 12), "{strategy:?}: {failed:?}");
        }
    }

    /// Fails where noise is large and there are many things: 0.0027 · 2/5 of the volume, or where neither is special.
    #[test]
    fn what_is_unusual_is_tried_early_and_rates_stay_unbiased() {
        let space = Space::new([Dimension::Normal, Dimension::Rising(5), Dimension::Continuous]);
        let fails = |point: &[f64]| {
            // Beyond three standard deviations on either side.
            [(point[0] - 0.5).abs() > 0.498_65 && point[1] > 0.6, point[1] < 0.4 && (point[0] - 0.5).abs() < 0.1]
        };
        let truth = [0.0027 * 0.4, 0.4 * 0.2];
        let (mut rates, mut held, mut found) = ([0.0; 2], [0; 2], 0);
        const SEEDS: u64 = 200;
        for seed in 0..SEEDS {
            let mut search = Search::new(space.clone(), Strategy::CrossEntropy, seed);
            let mut failed = [0; 2];
            for wanted in [GENERATION, GENERATION, 7, GENERATION] {
                for ask in search.ask(wanted) {
                    assert!(ask.weight > 0.0 && ask.weight <= ask.largest_weight, "{ask:?}");
                    let told = fails(&ask.point);
                    (0..2).for_each(|property| failed[property] += usize::from(told[property]));
                    search.tell(told.map(|failed| Told { failed, margin: None }).to_vec());
                }
            }
            found += failed[0];
            for (property, estimate) in search.estimates().into_iter().enumerate() {
                let estimate = estimate.expect("points were told");
                rates[property] += estimate.rate / SEEDS as f64;
                held[property] += u64::from((estimate.low..=estimate.high).contains(&truth[property]));
            }
        }
        // Random would find 67 · 0.00108 · 200 = 14.
        assert!(found > 500, "{found}");
        assert!((rates[0] - truth[0]).abs() < 0.0003 && (rates[1] - truth[1]).abs() < 0.01, "{rates:?}");
        assert!(held.iter().all(|held| held * 100 >= SEEDS * 93), "{held:?}");
    }

    /// A third of the cube can't be tried; what can fails in a fifth of it.
    #[test]
    fn stand_ins_keep_rates_unbiased() {
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
                        search.tell(vec![told(margin(&ask.point))]);
                    } else {
                        let stand_in =
                            std::iter::repeat_with(|| [fill::unit(&mut generator), fill::unit(&mut generator)])
                                .find(|point| possible(point))
                                .expect("there is no end");
                        search.tell_stand_in(&[told(margin(&stand_in))]);
                    }
                }
            }
            let estimate = search.estimates()[0].expect("points were told");
            rates += estimate.rate / SEEDS as f64;
            held += u64::from((estimate.low..=estimate.high).contains(&0.2));
        }
        assert!((rates - 0.2).abs() < 0.01, "{rates}");
        assert!(held * 100 >= SEEDS * 94, "{held}");
    }

    /// The rest of a generation that was stopped is not known, so its beginning counts for no rate.
    #[test]
    fn only_whole_generations_count() {
        let mut search = Search::new(space(), Strategy::Bandit, 1);
        let first = search.ask(5);
        first.iter().for_each(|ask| search.tell(vec![told(margin(&ask.point))]));
        let whole = search.estimates();
        search.ask(GENERATION);
        search.tell(vec![told(-1.0)]);
        assert_eq!(search.estimates(), whole);
        search.ask(GENERATION);
        assert_eq!(search.estimates(), whole);
    }

    #[test]
    fn what_was_not_asked_is_ignored() {
        let mut search = Search::new(Space::new([]), Strategy::Boundary, 1);
        search.tell(vec![told(-1.0)]);
        assert!(search.estimates().is_empty());
        (0..5).for_each(|_| {
            search.ask(2);
            search.tell(Vec::new());
            search.tell(vec![told(f64::NAN)]);
            search.tell(vec![told(-1.0)]);
        });
        assert_eq!(search.estimates().len(), 1);
    }
}
