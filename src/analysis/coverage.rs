//! Coverage of the scene space by a campaign, compared with the same number of random draws.
//!
//! Every choice falls into a bin; all bins of a parameter are equally probable. Parameters that
//! differ only in their object are pooled: `other.3.x` and `other.5.x` are `other.*.x`.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use statrs::distribution::{Binomial, DiscreteCDF};

use actcheck_data::{Choice, ChoiceKind, ChoiceName};

/// Number of bins of a numeric parameter. Fifths show gaps in the middle and at both ends, and a
/// hundred draws fill them.
const BINS: usize = 5;
/// A choice with more options than this is treated as a number, because no campaign tries them all.
const MOST_BINS: usize = 1000;
/// Probability that any bin of an unbiased campaign is called neglected.
const LEVEL: f64 = 1e-3;
/// A pair of parameters is called neglected if less than this share of the expected cells was hit,
const PAIR_SHARE: f64 = 0.75;
/// … and the shortfall exceeds this many standard deviations.
const PAIR_SIGMAS: f64 = 5.0;

/// Counts the choices of a campaign's runs.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Coverage {
    /// The names of choices: a campaign has millions of choices, but few names.
    names: BTreeMap<ChoiceName, Name>,
    /// Names of parameters and of objects.
    texts: Vec<Arc<str>>,
    parameters: HashMap<BinnedParameter, Vec<u64>>,
    pairs: HashMap<[BinnedParameter; 2], Vec<u64>>,
}

/// A parameter: the position of its name among the texts, and its number of bins.
type BinnedParameter = (usize, usize);

/// The name of a choice.
#[derive(Debug, Clone, PartialEq)]
struct Name {
    /// Its written form.
    text: Arc<str>,
    /// Position of the name of its parameter among the texts.
    pooled: usize,
    /// Position of its object among the texts, if it belongs to one of several.
    owner: Option<usize>,
    noise: bool,
}

/// Coverage of one parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterCoverage {
    /// Name, with `*` for the number or ID of an object.
    pub name: String,
    /// Number of choices.
    pub draws: u64,
    /// Choices in each bin. Shape: one entry for each option, or for each fifth of the
    /// distribution.
    pub counts: Vec<u64>,
    /// Expected number of bins hit by the same number of random draws.
    pub expected_hits: f64,
    /// The first bin hit significantly less than half as often as expected.
    pub neglected: Option<usize>,
}

/// Coverage of a pair of parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct PairCoverage {
    /// Names of the parameters.
    pub names: [String; 2],
    /// Number of choices of both.
    pub draws: u64,
    /// Number of pairs of bins.
    pub cells: usize,
    /// Number of pairs hit.
    pub hits: usize,
    /// Expected number of pairs hit by the same number of random draws.
    pub expected_hits: f64,
    /// Whether significantly fewer pairs were hit.
    pub neglected: bool,
}

impl ParameterCoverage {
    /// Number of bins hit.
    pub fn hits(&self) -> usize {
        self.counts.iter().filter(|count| **count > 0).count()
    }
}

/// A choice with its bin.
struct Binned<'n> {
    name: &'n Name,
    bins: usize,
    bin: usize,
}

impl Binned<'_> {
    fn parameter(&self) -> BinnedParameter {
        (self.name.pooled, self.bins)
    }
}

impl Coverage {
    /// Counts the choices of one run. Of repeated choices only the last one counts, because the
    /// scene uses it.
    pub fn add(&mut self, choices: &[Choice]) {
        for choice in choices {
            self.text_of(&choice.name);
        }
        let mut last: Vec<(&Name, &Choice)> = choices
            .iter()
            .filter_map(|choice| Some((self.names.get(&choice.name)?, choice)))
            .collect();
        // Stable, so that the last one of a name is the last one made.
        last.sort_by(|one, other| one.0.text.cmp(&other.0.text));
        let binned: Vec<Binned<'_>> = last
            .chunk_by(|one, next| one.0.text == next.0.text)
            .filter_map(|same| same.last())
            .filter_map(|(name, choice)| {
                let (bins, bin) = binned(choice)?;
                Some(Binned { name, bins, bin })
            })
            .collect();
        for one in &binned {
            let counts = self
                .parameters
                .entry(one.parameter())
                .or_insert_with(|| vec![0; one.bins]);
            counts[one.bin] += 1;
        }
        for (idx, first) in binned.iter().enumerate() {
            for second in &binned[idx + 1..] {
                // Noise choices are independent errors of the robot and its sensors, so that their
                // pairs are not counted.
                let is_noise = first.name.noise || second.name.noise;
                if !is_noise && first.name.owner == second.name.owner {
                    let key = [first.parameter(), second.parameter()];
                    let counts = self
                        .pairs
                        .entry(key)
                        .or_insert_with(|| vec![0; first.bins * second.bins]);
                    counts[first.bin * second.bins + second.bin] += 1;
                }
            }
        }
    }

    /// The written form of a name.
    pub(crate) fn text_of(&mut self, name: &ChoiceName) -> &str {
        if !self.names.contains_key(name) {
            let (owner, pooled) = name.pooled();
            let known = Name {
                text: name.to_string().into(),
                pooled: self.position(&pooled),
                owner: owner.map(|owner| self.position(&owner)),
                noise: name.is_noise(),
            };
            self.names.insert(name.clone(), known);
        }
        self.names.get(name).map_or("", |name| &*name.text)
    }

    /// Position of a text, which is added if it is new.
    fn position(&mut self, text: &str) -> usize {
        self.texts
            .iter()
            .position(|known| **known == *text)
            .unwrap_or_else(|| {
                self.texts.push(text.into());
                self.texts.len() - 1
            })
    }

    /// Returns the coverage of every parameter that can vary, sorted by name.
    pub fn parameters(&self) -> Vec<ParameterCoverage> {
        let bins: usize = self.parameters.values().map(Vec::len).sum();
        let named = |parameter: &BinnedParameter| (&*self.texts[parameter.0], parameter.1);
        let parameters: BTreeMap<_, _> = self
            .parameters
            .iter()
            .map(|(key, counts)| (named(key), counts))
            .collect();
        parameters
            .into_iter()
            .map(|((name, _), counts)| {
                let draws = counts.iter().sum();
                ParameterCoverage {
                    name: name.to_owned(),
                    draws,
                    counts: counts.clone(),
                    expected_hits: occupied(counts.len(), draws).0,
                    neglected: counts
                        .iter()
                        .position(|count| is_neglected(*count, draws, counts.len(), bins)),
                }
            })
            .collect()
    }

    /// Returns the coverage of every pair of parameters of the scene or of one object, sorted by
    /// name.
    pub fn pairs(&self) -> Vec<PairCoverage> {
        let named = |parameter: &BinnedParameter| (&*self.texts[parameter.0], parameter.1);
        let pairs: BTreeMap<_, _> = self
            .pairs
            .iter()
            .map(|(key, counts)| (key.each_ref().map(named), counts))
            .collect();
        pairs
            .into_iter()
            .map(|([(first, _), (second, _)], counts)| {
                let draws = counts.iter().sum();
                let hits = counts.iter().filter(|count| **count > 0).count();
                let (expected_hits, variance) = occupied(counts.len(), draws);
                let short = expected_hits - hits as f64;
                PairCoverage {
                    names: [first.to_owned(), second.to_owned()],
                    draws,
                    cells: counts.len(),
                    hits,
                    expected_hits,
                    neglected: short > PAIR_SIGMAS * variance.sqrt().max(1.0)
                        && (hits as f64) < PAIR_SHARE * expected_hits,
                }
            })
            .collect()
    }
}

/// Whether a bin's true probability is significantly less than half of a uniform one: at half of
/// it, any of the `bins` would have so few draws in less than one of a thousand campaigns.
fn is_neglected(count: u64, draws: u64, of: usize, bins: usize) -> bool {
    let half = 0.5 / of as f64;
    Binomial::new(half, draws).is_ok_and(|chance| chance.cdf(count) < LEVEL / bins.max(1) as f64)
}

/// Returns the mean number of `cells` equally probable cells that `draws` draws hit, and an upper
/// bound of its variance.
///
/// The hits are negatively correlated, so the variance of the sum is at most the sum of the
/// variances.
fn occupied(cells: usize, draws: u64) -> (f64, f64) {
    let cells = cells as f64;
    let empty = libm::pow(1.0 - 1.0 / cells, draws as f64);
    (cells * (1.0 - empty), cells * empty * (1.0 - empty))
}

/// Returns the number of bins of a choice and its bin, or `None` if it had only one option.
fn binned(choice: &Choice) -> Option<(usize, usize)> {
    let share = |share: f64| {
        (
            BINS,
            ((share * BINS as f64).max(0.0) as usize).min(BINS - 1),
        )
    };
    let option = |of: usize| (of, (choice.value.max(0.0) as usize).min(of - 1));
    Some(match &choice.kind {
        &ChoiceKind::Index { of } if of > MOST_BINS => share(choice.value / of as f64),
        &ChoiceKind::Index { of } if of > 1 => option(of),
        ChoiceKind::Candidate { names } if names.len() > 1 => option(names.len()),
        &ChoiceKind::Real { low, high, .. } if high > low => {
            share((choice.value - low) / (high - low))
        }
        &ChoiceKind::Normal { sigma } if sigma > 0.0 => {
            share(0.5 * libm::erfc(-choice.value / sigma / std::f64::consts::SQRT_2))
        }
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_data::{ChoiceName, Choices};

    /// Choices of a scene with two objects. `lean` is the number of times that the colour is
    /// redrawn if it is the last one.
    fn scene(index: u64, lean: u32) -> Vec<Choice> {
        let mut choices = Choices::random(5, index);
        for name in ["other.1", "other.2"] {
            choices.real(format!("{name}.x").into(), -1.0, 1.0, 0.0);
            choices.index(format!("{name}.model").into(), 4);
        }
        for _ in 0..=lean {
            if choices.index("colour".into(), 5) < 4 {
                break;
            }
        }
        choices.real("fixed".into(), 1.0, 1.0, 1.0);
        choices.normal("sense.mug_1.x".into(), 0.1);
        choices.into_made()
    }

    /// A choice among four billion noise patterns of an image must not allocate four billion
    /// counters (34 GB).
    #[test]
    fn a_choice_among_very_many_values_is_counted_as_a_number() {
        let mut choices = Choices::random(5, 0);
        choices.index(ChoiceName::CameraFrame, 1 << 32);
        let mut coverage = Coverage::default();
        coverage.add(&choices.into_made());
        assert_eq!(coverage.parameters()[0].counts.len(), BINS);
    }

    fn coverage(runs: u64, lean: u32) -> Coverage {
        let mut coverage = Coverage::default();
        (0..runs).for_each(|index| coverage.add(&scene(index, lean)));
        coverage
    }

    #[test]
    fn objects_are_pooled_and_constants_are_not_parameters() {
        let coverage = coverage(10, 0);
        let names: Vec<String> = coverage
            .parameters()
            .iter()
            .map(|p| format!("{} {}", p.name, p.draws))
            .collect();
        assert_eq!(
            names,
            [
                "colour 10",
                "other.*.model 20",
                "other.*.x 20",
                "sense.*.x 10"
            ]
        );
        let pairs: Vec<[String; 2]> = coverage
            .pairs()
            .into_iter()
            .map(|pair| pair.names)
            .collect();
        assert_eq!(
            pairs,
            [["other.*.model".to_owned(), "other.*.x".to_owned()]]
        );
    }

    #[test]
    fn random_draws_have_no_neglected_values() {
        for runs in [1, 5, 30, 300, 3_000] {
            let coverage = coverage(runs, 0);
            assert!(
                coverage
                    .parameters()
                    .iter()
                    .all(|parameter| parameter.neglected.is_none()),
                "{runs}"
            );
            assert!(
                coverage.pairs().iter().all(|pair| !pair.neglected),
                "{runs}"
            );
        }
    }

    #[test]
    fn the_number_of_hit_bins_matches_its_expectation() {
        let mean = (0..200u64).map(|seed| {
            let mut choices = Choices::random(seed, 1);
            let hit: std::collections::BTreeSet<usize> =
                (0..8).map(|_| choices.index("x".into(), 10)).collect();
            hit.len() as f64
        });
        let mean = mean.sum::<f64>() / 200.0;
        assert!((mean - occupied(10, 8).0).abs() < 0.25, "{mean}");
    }

    #[test]
    fn a_value_that_is_mostly_redrawn_is_neglected() {
        let parameters = coverage(300, 3).parameters();
        let neglected: Vec<(&str, Option<usize>)> = parameters
            .iter()
            .filter(|parameter| parameter.neglected.is_some())
            .map(|parameter| (parameter.name.as_str(), parameter.neglected))
            .collect();
        assert_eq!(neglected, [("colour", Some(4))]);
    }

    #[test]
    fn correlated_parameters_leave_pairs_uncovered() {
        let mut coverage = Coverage::default();
        for index in 0..200 {
            let mut choices = Choices::random(5, index);
            let value = choices.real("a".into(), 0.0, 1.0, 0.0);
            let mut made = choices.into_made();
            made.push(Choice {
                name: "b".into(),
                value,
                ..made[0].clone()
            });
            coverage.add(&made);
        }
        assert!(
            coverage
                .parameters()
                .iter()
                .all(|parameter| parameter.neglected.is_none())
        );
        let pair = &coverage.pairs()[0];
        assert_eq!((pair.hits, pair.cells, pair.neglected), (5, 25, true));
    }
}
