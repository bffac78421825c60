//! Randomness as a recorded list of named choices. A run is a function of this list.

use std::collections::{BTreeMap, VecDeque};

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde::{Deserialize, Serialize};

use crate::ChoiceName;

/// Noise is clamped to this many standard deviations (affects one value in 16,000).
const FARTHEST: f64 = 4.0;

/// The distribution of a choice.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum ChoiceKind {
    /// An index from 0 to `of` - 1. The nominal value is 0.
    Index {
        /// Number of options.
        of: usize,
    },
    /// Uniform between two inclusive bounds.
    Real {
        /// Smallest value.
        low: f64,
        /// Largest value.
        high: f64,
        /// Default value.
        nominal: f64,
    },
    /// Normal with mean 0. The nominal value is 0.
    Normal {
        /// Standard deviation.
        sigma: f64,
    },
    /// The index of a candidate. The nominal value is 0.
    Candidate {
        /// The candidates, in the order of the configuration.
        names: Vec<String>,
    },
}

/// A recorded choice.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Choice {
    /// Its name. Names may repeat; repeated choices are matched in order.
    pub name: ChoiceName,
    /// The distribution.
    pub kind: ChoiceKind,
    /// The chosen value, in the caller's unit.
    pub value: f64,
}

/// A recorded or written value, with which a choice is made again.
#[derive(Debug, Clone, PartialEq)]
pub enum ChoiceValue {
    /// A number, or the index of a candidate.
    Number(f64),
    /// The name of a candidate, which stays valid when candidates are added.
    Candidate(String),
}

/// The source of choices, and the record of those made.
#[derive(Debug, Clone)]
pub struct Choices {
    origin: Origin,
    /// Generator that takes over at [`Choices::begin_noise`]. If `None`, the scene's generator
    /// continues.
    noise: Option<Box<ChaCha8Rng>>,
    /// Generator of [`Choices::apart`], once it was used.
    aside: Option<Box<ChaCha8Rng>>,
    made: Vec<Choice>,
}

#[derive(Debug, Clone)]
enum Origin {
    Random(Box<ChaCha8Rng>),
    /// Values by name, in order. `rest` decides the choices that the record lacks.
    Recorded {
        values: BTreeMap<ChoiceName, VecDeque<ChoiceValue>>,
        rest: Rest,
    },
    /// Quantiles by name, each for the first choice of that name. All other choices are drawn.
    Steered {
        quantiles: BTreeMap<ChoiceName, f64>,
        generator: Box<ChaCha8Rng>,
    },
}

/// How to make a choice that the record lacks.
#[derive(Debug, Clone)]
enum Rest {
    Nominal,
    Random(Box<ChaCha8Rng>),
}

impl ChoiceKind {
    /// Returns the default value.
    pub fn nominal(&self) -> f64 {
        match self {
            Self::Index { .. } | Self::Candidate { .. } | Self::Normal { .. } => 0.0,
            Self::Real { nominal, .. } => *nominal,
        }
    }
}

impl Choice {
    /// Returns the name of the chosen candidate; `None` if the choice is not one of candidates.
    pub fn candidate(&self) -> Option<&str> {
        match &self.kind {
            ChoiceKind::Candidate { names } => names.get(self.value as usize).map(String::as_str),
            _ => None,
        }
    }

    /// Returns the value with which the choice is made again: a candidate by name, so that it is
    /// found among others.
    fn to_value(&self) -> ChoiceValue {
        self.candidate()
            .map_or(ChoiceValue::Number(self.value), |name| {
                ChoiceValue::Candidate(name.to_owned())
            })
    }
}

impl Choices {
    /// Draws every choice. The same seed and index give the same choices on every machine.
    pub fn random(seed: u64, index: u64) -> Self {
        Self::of(Origin::Random(generator(seed, index)))
    }

    /// Replays a record by name. Choices that the record lacks get their nominal value.
    pub fn recorded(record: &[Choice]) -> Self {
        Self::of(Origin::Recorded {
            values: by_name(record),
            rest: Rest::Nominal,
        })
    }

    /// Replays values by name, in order if a name repeats. Missing choices get their nominal value.
    pub fn named(values: &BTreeMap<ChoiceName, Vec<ChoiceValue>>) -> Self {
        let values = values
            .iter()
            .map(|(name, values)| (name.clone(), values.iter().cloned().collect()))
            .collect();
        Self::of(Origin::Recorded {
            values,
            rest: Rest::Nominal,
        })
    }

    /// Replays a record by name. Choices that it lacks are drawn as by [`Choices::random`].
    pub fn partly_recorded(record: &[Choice], seed: u64, index: u64) -> Self {
        let rest = Rest::Random(generator(seed, index));
        Self::of(Origin::Recorded {
            values: by_name(record),
            rest,
        })
    }

    /// Draws every choice, except that the first choice of each name in `quantiles` is that
    /// quantile of its distribution. Quantiles range from 0 to 1; uniform quantiles give the
    /// nominal distribution.
    pub fn steered(quantiles: &BTreeMap<ChoiceName, f64>, seed: u64, index: u64) -> Self {
        Self::of(Origin::Steered {
            quantiles: quantiles.clone(),
            generator: generator(seed, index),
        })
    }

    fn of(origin: Origin) -> Self {
        Self {
            origin,
            noise: None,
            aside: None,
            made: Vec::new(),
        }
    }

    /// Draws the choices after [`Choices::begin_noise`] from a separate stream, so that the same
    /// scene can be run with different noise.
    pub fn with_noise(self, seed: u64, index: u64) -> Self {
        Self {
            noise: Some(generator(seed, index)),
            ..self
        }
    }

    /// Marks the scene as complete. All further choices are noise.
    pub fn begin_noise(&mut self) {
        let Some(noise) = self.noise.take() else {
            return;
        };
        if let Some(generator) = self.generator() {
            *generator = noise;
        }
    }

    /// Makes choices from a separate stream, so that those before and after are the same without
    /// them.
    pub fn apart<T>(&mut self, make: impl FnOnce(&mut Self) -> T) -> T {
        let aside = self.aside.take();
        let Some(generator) = self.generator() else {
            return make(self);
        };
        let fresh = || {
            let mut aside = generator.clone();
            aside.set_stream(!generator.get_stream());
            aside
        };
        let aside = aside.unwrap_or_else(fresh);
        let own = std::mem::replace(generator, aside);
        let made = make(self);
        self.aside = self
            .generator()
            .map(|generator| std::mem::replace(generator, own));
        made
    }

    /// The generator of random choices, if there are any.
    fn generator(&mut self) -> Option<&mut Box<ChaCha8Rng>> {
        match &mut self.origin {
            Origin::Random(generator)
            | Origin::Steered { generator, .. }
            | Origin::Recorded {
                rest: Rest::Random(generator),
                ..
            } => Some(generator),
            Origin::Recorded {
                rest: Rest::Nominal,
                ..
            } => None,
        }
    }

    /// Chooses an index from 0 to `of` - 1. `of` must not be 0.
    pub fn index(&mut self, name: ChoiceName, of: usize) -> usize {
        debug_assert!(of > 0, "the number of options must not be 0");
        let recorded = self.recorded_number(&name);
        self.option(name, of, recorded, ChoiceKind::Index { of })
    }

    /// Chooses a candidate and returns its index. `names` must not be empty.
    ///
    /// A recorded candidate is found by name. If it is not among the candidates, the nominal one is
    /// chosen.
    pub fn candidate(&mut self, name: ChoiceName, names: Vec<String>) -> usize {
        let recorded = self.take_recorded(&name).map(|value| match value {
            ChoiceValue::Number(idx) => idx,
            ChoiceValue::Candidate(wanted) => {
                names.iter().position(|name| *name == wanted).unwrap_or(0) as f64
            }
        });
        self.option(name, names.len(), recorded, ChoiceKind::Candidate { names })
    }

    fn option(
        &mut self,
        name: ChoiceName,
        of: usize,
        recorded: Option<f64>,
        kind: ChoiceKind,
    ) -> usize {
        let last = of.saturating_sub(1);
        // 53 random bits over a handful of options: the bias is under 1e-13.
        let at = |share: f64| ((share * of as f64) as usize).min(last) as f64;
        let value = recorded
            .unwrap_or_else(|| self.decide(&name, 0.0, at, |generator| at(unit(generator))));
        let value = (value.max(0.0) as usize).min(last);
        self.record(name, kind, value as f64);
        value
    }

    /// Chooses a number between two inclusive bounds. `nominal` is clamped to them.
    pub fn real(&mut self, name: ChoiceName, low: f64, high: f64, nominal: f64) -> f64 {
        let nominal = nominal.clamp(low, high);
        let at = |share: f64| low + (high - low) * share;
        let recorded = self.recorded_number(&name);
        let value = recorded
            .unwrap_or_else(|| self.decide(&name, nominal, at, |generator| at(unit(generator))));
        let value = value.clamp(low, high);
        self.record(name, ChoiceKind::Real { low, high, nominal }, value);
        value
    }

    /// Chooses as [`Choices::real`]. The nominal value is the name's simplest one, or else the
    /// middle of the bounds.
    pub fn simple(&mut self, name: ChoiceName, low: f64, high: f64) -> f64 {
        let nominal = name.simplest().unwrap_or((low + high) / 2.0);
        self.real(name, low, high, nominal)
    }

    /// Chooses normally distributed noise with mean 0 and the given standard deviation, clamped to
    /// 4 standard deviations.
    pub fn normal(&mut self, name: ChoiceName, sigma: f64) -> f64 {
        let at = |share: f64| normal_quantile(share) * sigma;
        let recorded = self.recorded_number(&name);
        let value = recorded.unwrap_or_else(|| {
            self.decide(&name, 0.0, at, |generator| {
                // Box–Muller with libm, so that every machine gets the same bits.
                let radius = libm::sqrt(-2.0 * libm::log(1.0 - unit(generator)));
                let angle = std::f64::consts::TAU * unit(generator);
                (radius * libm::cos(angle)).clamp(-FARTHEST, FARTHEST) * sigma
            })
        });
        self.record(name, ChoiceKind::Normal { sigma }, value);
        value
    }

    /// Makes a choice that is never random: an index below `of`, taken from the record, or 0 if the
    /// record lacks it. Only a nonzero value is recorded.
    ///
    /// This lets a record ask for less than its configuration does.
    pub fn exception(&mut self, name: ChoiceName, of: usize) -> usize {
        let asked = self.recorded_number(&name).unwrap_or(0.0);
        let value = (asked.max(0.0) as usize).min(of.saturating_sub(1));
        if value > 0 {
            self.record(name, ChoiceKind::Index { of }, value as f64);
        }
        value
    }

    /// Whether the next choice of this name has a value in the record.
    pub fn is_recorded(&self, name: &ChoiceName) -> bool {
        match &self.origin {
            Origin::Recorded { values, .. } => {
                values.get(name).is_some_and(|values| !values.is_empty())
            }
            Origin::Random(_) | Origin::Steered { .. } => false,
        }
    }

    /// Forgets all choices made after the first `n_made`, so that the record replays without them.
    pub fn forget_after(&mut self, n_made: usize) {
        self.made.truncate(n_made);
    }

    /// The choices made so far, in order.
    pub fn made(&self) -> &[Choice] {
        &self.made
    }

    /// Consumes the source and returns the choices made.
    pub fn into_made(self) -> Vec<Choice> {
        self.made
    }

    /// Takes the next value of this name from the record, if there is one.
    fn take_recorded(&mut self, name: &ChoiceName) -> Option<ChoiceValue> {
        match &mut self.origin {
            Origin::Recorded { values, .. } => values.get_mut(name).and_then(VecDeque::pop_front),
            Origin::Random(_) | Origin::Steered { .. } => None,
        }
    }

    fn recorded_number(&mut self, name: &ChoiceName) -> Option<f64> {
        match self.take_recorded(name)? {
            ChoiceValue::Number(value) => Some(value),
            ChoiceValue::Candidate(_) => None,
        }
    }

    /// Makes a choice that the record lacks: at a given quantile (by `at`), drawn, or nominal.
    fn decide(
        &mut self,
        name: &ChoiceName,
        nominal: f64,
        at: impl Fn(f64) -> f64,
        draw: impl FnOnce(&mut ChaCha8Rng) -> f64,
    ) -> f64 {
        match &mut self.origin {
            Origin::Recorded {
                rest: Rest::Nominal,
                ..
            } => nominal,
            Origin::Random(generator)
            | Origin::Recorded {
                rest: Rest::Random(generator),
                ..
            } => draw(generator),
            Origin::Steered {
                quantiles,
                generator,
            } => match quantiles.remove(name) {
                Some(share) => at(share.clamp(0.0, 1.0)),
                None => draw(generator),
            },
        }
    }

    fn record(&mut self, name: ChoiceName, kind: ChoiceKind, value: f64) {
        self.made.push(Choice { name, kind, value });
    }
}

fn generator(seed: u64, index: u64) -> Box<ChaCha8Rng> {
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    generator.set_stream(index);
    Box::new(generator)
}

fn by_name(record: &[Choice]) -> BTreeMap<ChoiceName, VecDeque<ChoiceValue>> {
    let mut by_name: BTreeMap<ChoiceName, VecDeque<ChoiceValue>> = BTreeMap::new();
    for choice in record {
        by_name
            .entry(choice.name.clone())
            .or_default()
            .push_back(choice.to_value());
    }
    by_name
}

/// Quantile function of the standard normal distribution, clamped to ±[`FARTHEST`].
fn normal_quantile(share: f64) -> f64 {
    let below = |value: f64| 0.5 * libm::erfc(-value / std::f64::consts::SQRT_2);
    let (mut low, mut high) = (-FARTHEST, FARTHEST);
    // Bisection: 60 halvings of an interval of width 8 leave less than the last bit.
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if below(middle) < share {
            low = middle
        } else {
            high = middle
        }
    }
    0.5 * (low + high)
}

/// Draws a number in [0, 1) from 53 random bits.
fn unit(generator: &mut ChaCha8Rng) -> f64 {
    (generator.next_u64() >> 11) as f64 / (1u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn draw(choices: &mut Choices) -> (usize, f64, f64) {
        (
            choices.index("model".into(), 5),
            choices.real("yaw".into(), -1.0, 1.0, 0.0),
            choices.normal("noise".into(), 0.01),
        )
    }

    #[test]
    fn a_record_reproduces_its_choices() {
        let mut first = Choices::random(7, 3);
        let drawn = draw(&mut first);
        assert_eq!(draw(&mut Choices::random(7, 3)), drawn);
        assert_ne!(draw(&mut Choices::random(7, 4)), drawn);
        let mut again = Choices::recorded(first.made());
        assert_eq!(draw(&mut again), drawn);
        assert_eq!(again.made(), first.made());
    }

    #[test]
    fn choices_missing_in_a_record_are_nominal() {
        assert_eq!(draw(&mut Choices::recorded(&[])), (0, 0.0, 0.0));
    }

    #[test]
    fn only_a_record_can_choose_an_exception() {
        assert_eq!(Choices::random(7, 3).exception("left_out".into(), 2), 0);
        assert_eq!(Choices::recorded(&[]).exception("left_out".into(), 2), 0);
        let said = Choice {
            name: "left_out".into(),
            kind: ChoiceKind::Index { of: 2 },
            value: 1.0,
        };
        let mut again = Choices::recorded(std::slice::from_ref(&said));
        assert_eq!(again.exception("left_out".into(), 2), 1);
        assert_eq!(again.made(), [said]);
    }

    #[test]
    fn a_recorded_candidate_is_found_by_name() {
        let names = |names: &[&str]| {
            names
                .iter()
                .map(|name| (*name).to_owned())
                .collect::<Vec<_>>()
        };
        let made = |record: &[Choice], among: &[&str]| {
            let mut choices = Choices::recorded(record);
            choices.candidate(ChoiceName::SurfaceName, names(among));
            choices.into_made().remove(0)
        };
        let value = 1.0;
        let first = Choice {
            name: ChoiceName::SurfaceName,
            kind: ChoiceKind::Index { of: 2 },
            value,
        };
        assert_eq!(
            made(std::slice::from_ref(&first), &["a", "b"]).candidate(),
            Some("b")
        );
        let named = Choice {
            kind: ChoiceKind::Candidate {
                names: names(&["a", "b"]),
            },
            ..first
        };
        assert_eq!(
            made(std::slice::from_ref(&named), &["b", "a"]).candidate(),
            Some("b")
        );
        assert_eq!(
            made(&[named], &["c", "a"]).candidate(),
            Some("c"),
            "the nominal one"
        );
    }

    #[test]
    fn a_candidate_is_drawn_like_an_index() {
        for index in 0..20 {
            let names = (0..5).map(|number| number.to_string()).collect();
            let candidate = Choices::random(7, index).candidate("model".into(), names);
            assert_eq!(
                candidate,
                Choices::random(7, index).index("model".into(), 5)
            );
        }
    }

    #[test]
    fn noise_has_the_given_standard_deviation() {
        let mut choices = Choices::random(1, 0);
        let values: Vec<f64> = (0..20_000)
            .map(|_| choices.normal("n".into(), 2.0))
            .collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64;
        assert!(mean.abs() < 0.06, "{mean}");
        assert!((variance.sqrt() - 2.0).abs() < 0.05, "{variance}");
    }

    #[test]
    fn missing_choices_can_be_random() {
        let mut first = Choices::random(7, 3);
        let drawn = draw(&mut first);
        let scene = &first.made()[..2];
        let again = draw(&mut Choices::partly_recorded(scene, 7, 9));
        assert_eq!((again.0, again.1), (drawn.0, drawn.1));
        assert_ne!(again.2, drawn.2);
        assert_eq!(draw(&mut Choices::partly_recorded(scene, 7, 9)), again);
    }

    #[test]
    fn noise_can_come_from_a_separate_stream() {
        let drawn = |mut choices: Choices| {
            let scene = choices.real("yaw".into(), -1.0, 1.0, 0.0);
            choices.begin_noise();
            (scene, choices.normal("noise".into(), 0.01))
        };
        let first = drawn(Choices::random(7, 3).with_noise(7, 100));
        assert_eq!(drawn(Choices::random(7, 3).with_noise(7, 100)), first);
        let again = drawn(Choices::random(7, 3).with_noise(7, 101));
        assert_eq!(again.0, first.0);
        assert_ne!(again.1, first.1);
        // Noise depends only on its own stream.
        assert_eq!(drawn(Choices::random(7, 4).with_noise(7, 100)).1, first.1);
        assert_eq!(drawn(Choices::random(7, 3)).0, first.0);
    }

    #[test]
    fn steered_choices_take_their_quantiles_once() {
        let quantiles = BTreeMap::from([
            ("model".into(), 0.5),
            ("yaw".into(), 0.75),
            ("noise".into(), 0.975),
        ]);
        let mut choices = Choices::steered(&quantiles, 7, 3);
        let (model, yaw, noise) = draw(&mut choices);
        assert_eq!((model, yaw), (2, 0.5));
        assert!((noise - 0.019_599_639_845).abs() < 1e-12, "{noise}");
        assert_ne!(draw(&mut choices), (model, yaw, noise));
        for end in [0.0, 1.0] {
            assert!(normal_quantile(end).abs() <= FARTHEST);
        }
    }
}
