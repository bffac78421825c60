//! Randomness as a recorded list of named choices: a run is a function of it.

use std::collections::{BTreeMap, VecDeque};

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde::{Deserialize, Serialize};

/// Noise beyond so many standard deviations (one value in 16,000) is brought back to them.
const FARTHEST: f64 = 4.0;

/// What was chosen from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum ChoiceKind {
    /// One of `of` things, counted from 0. The value is a whole number; nominal is 0.
    Index {
        /// How many there were.
        of: usize,
    },
    /// Uniform between two bounds, both included.
    Real {
        /// Smallest value.
        low: f64,
        /// Largest value.
        high: f64,
        /// The value that stands for "nothing special".
        nominal: f64,
    },
    /// Normally distributed about 0; nominal is 0.
    Normal {
        /// Standard deviation.
        sigma: f64,
    },
}

/// One recorded decision.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Choice {
    /// Path-like name, such as `target.yaw`. Names may repeat: then the order counts.
    pub name: String,
    /// What was chosen from.
    pub kind: ChoiceKind,
    /// What was chosen, in the unit of whoever asked.
    pub value: f64,
}

/// Where decisions come from, and the record of those made.
#[derive(Debug, Clone)]
pub struct Choices {
    origin: Origin,
    /// What noise is drawn from, once it begins; without one, everything is drawn from the same.
    noise: Option<Box<ChaCha8Rng>>,
    made: Vec<Choice>,
}

#[derive(Debug, Clone)]
enum Origin {
    Random(Box<ChaCha8Rng>),
    /// Values by name, in order; for a name that is not there (any more), what `rest` says.
    Recorded {
        values: BTreeMap<String, VecDeque<f64>>,
        rest: Rest,
    },
    /// Quantiles by name, each for the first decision of that name; everything else is drawn.
    Steered {
        quantiles: BTreeMap<String, f64>,
        generator: Box<ChaCha8Rng>,
    },
}

/// What becomes of a decision that a record lacks.
#[derive(Debug, Clone)]
enum Rest {
    Nominal,
    Random(Box<ChaCha8Rng>),
}

impl ChoiceKind {
    /// The value that stands for "nothing special".
    pub fn nominal(&self) -> f64 {
        match self {
            Self::Index { .. } | Self::Normal { .. } => 0.0,
            Self::Real { nominal, .. } => *nominal,
        }
    }
}

impl Choices {
    /// Fresh decisions: the same seed and index give the same ones, on every machine.
    pub fn random(seed: u64, index: u64) -> Self {
        Self::of(Origin::Random(generator(seed, index)))
    }

    /// The decisions of a record, by name. What the record lacks gets its nominal value.
    pub fn recorded(record: &[Choice]) -> Self {
        Self::of(Origin::Recorded { values: by_name(record), rest: Rest::Nominal })
    }

    /// Decisions by name, in order where a name repeats. What is not there gets its nominal value.
    pub fn named(values: &BTreeMap<String, Vec<f64>>) -> Self {
        let values = values.iter().map(|(name, values)| (name.clone(), values.iter().copied().collect())).collect();
        Self { origin: Origin::Recorded { values, rest: Rest::Nominal }, noise: None, made: Vec::new() }
    }

    /// The decisions of a record, by name; what it lacks is drawn, as [`Choices::random`] does.
    pub fn partly_recorded(record: &[Choice], seed: u64, index: u64) -> Self {
        let rest = Rest::Random(generator(seed, index));
        Self::of(Origin::Recorded { values: by_name(record), rest })
    }

    /// Fresh decisions, but for the names of `quantiles`: the first decision of such a name is the value below which
    /// this share of its distribution lies. Shape: each from 0 to 1; uniform ones give the nominal distribution.
    pub fn steered(quantiles: &BTreeMap<String, f64>, seed: u64, index: u64) -> Self {
        Self::of(Origin::Steered { quantiles: quantiles.clone(), generator: generator(seed, index) })
    }

    fn of(origin: Origin) -> Self {
        Self { origin, noise: None, made: Vec::new() }
    }

    /// Lets what is drawn after [`Choices::begin_noise`] come from a stream of its own, so that the same scene can be
    /// run with different noise.
    pub fn with_noise(self, seed: u64, index: u64) -> Self {
        Self { noise: Some(generator(seed, index)), ..self }
    }

    /// From here on decisions are noise: the scene is complete.
    pub fn begin_noise(&mut self) {
        let Some(noise) = self.noise.take() else { return };
        match &mut self.origin {
            Origin::Random(generator)
            | Origin::Steered { generator, .. }
            | Origin::Recorded { rest: Rest::Random(generator), .. } => *generator = noise,
            Origin::Recorded { rest: Rest::Nominal, .. } => {}
        }
    }

    /// One of `of` things, counted from 0. `of` must not be 0.
    pub fn index(&mut self, name: &str, of: usize) -> usize {
        debug_assert!(of > 0, "a choice needs something to choose from");
        let last = of.saturating_sub(1);
        // 53 random bits over a handful of things: the bias is under 1e-13.
        let at = |share: f64| ((share * of as f64) as usize).min(last) as f64;
        let value = self.decide(name, 0.0, at, |generator| at(unit(generator)));
        let value = (value.max(0.0) as usize).min(last);
        self.record(name, ChoiceKind::Index { of }, value as f64);
        value
    }

    /// A number between two bounds, both included; `nominal` is clamped to them.
    pub fn real(&mut self, name: &str, low: f64, high: f64, nominal: f64) -> f64 {
        let nominal = nominal.clamp(low, high);
        let at = |share: f64| low + (high - low) * share;
        let value = self.decide(name, nominal, at, |generator| at(unit(generator))).clamp(low, high);
        self.record(name, ChoiceKind::Real { low, high, nominal }, value);
        value
    }

    /// Normally distributed noise about 0 with the given standard deviation, at most 4 of them away.
    pub fn normal(&mut self, name: &str, sigma: f64) -> f64 {
        let at = |share: f64| normal_quantile(share) * sigma;
        let value = self.decide(name, 0.0, at, |generator| {
            // Box–Muller, from libm so that every machine gets the same bits.
            let radius = libm::sqrt(-2.0 * libm::log(1.0 - unit(generator)));
            let angle = std::f64::consts::TAU * unit(generator);
            (radius * libm::cos(angle)).clamp(-FARTHEST, FARTHEST) * sigma
        });
        self.record(name, ChoiceKind::Normal { sigma }, value);
        value
    }

    /// A decision that chance never makes: one of `of` things, 0 unless a record says otherwise, and recorded only then.
    ///
    /// It lets a record ask for less than its configuration does.
    pub fn exception(&mut self, name: &str, of: usize) -> usize {
        let asked = match &mut self.origin {
            Origin::Recorded { values, .. } => values.get_mut(name).and_then(VecDeque::pop_front).unwrap_or(0.0),
            Origin::Random(_) | Origin::Steered { .. } => 0.0,
        };
        let value = (asked.max(0.0) as usize).min(of.saturating_sub(1));
        if value > 0 {
            self.record(name, ChoiceKind::Index { of }, value as f64);
        }
        value
    }

    /// What has been decided so far, in order.
    pub fn made(&self) -> &[Choice] {
        &self.made
    }

    /// The record, for keeping.
    pub fn into_made(self) -> Vec<Choice> {
        self.made
    }

    /// A decision: recorded, at a given quantile (by `at`), or drawn.
    fn decide(
        &mut self,
        name: &str,
        nominal: f64,
        at: impl Fn(f64) -> f64,
        draw: impl FnOnce(&mut ChaCha8Rng) -> f64,
    ) -> f64 {
        match &mut self.origin {
            Origin::Random(generator) => draw(generator),
            Origin::Recorded { values, rest } => match (values.get_mut(name).and_then(VecDeque::pop_front), rest) {
                (Some(value), _) => value,
                (None, Rest::Nominal) => nominal,
                (None, Rest::Random(generator)) => draw(generator),
            },
            Origin::Steered { quantiles, generator } => match quantiles.remove(name) {
                Some(share) => at(share.clamp(0.0, 1.0)),
                None => draw(generator),
            },
        }
    }

    fn record(&mut self, name: &str, kind: ChoiceKind, value: f64) {
        self.made.push(Choice { name: name.to_owned(), kind, value });
    }
}

fn generator(seed: u64, index: u64) -> Box<ChaCha8Rng> {
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    generator.set_stream(index);
    Box::new(generator)
}

fn by_name(record: &[Choice]) -> BTreeMap<String, VecDeque<f64>> {
    let mut by_name: BTreeMap<String, VecDeque<f64>> = BTreeMap::new();
    for choice in record {
        by_name.entry(choice.name.clone()).or_default().push_back(choice.value);
    }
    by_name
}

/// The standard normal value below which a share of the distribution lies, at most [`FARTHEST`] away from 0.
fn normal_quantile(share: f64) -> f64 {
    let below = |value: f64| 0.5 * libm::erfc(-value / std::f64::consts::SQRT_2);
    let (mut low, mut high) = (-FARTHEST, FARTHEST);
    // Bisection: 60 halvings of 8 leave less than the last bit.
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if below(middle) < share { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// A number in [0, 1) from 53 random bits.
fn unit(generator: &mut ChaCha8Rng) -> f64 {
    (generator.next_u64() >> 11) as f64 / (1u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn draw(choices: &mut Choices) -> (usize, f64, f64) {
        (choices.index("model", 5), choices.real("yaw", -1.0, 1.0, 0.0), choices.normal("noise", 0.01))
    }

    #[test]
    fn a_record_gives_the_same_decisions_again() {
        let mut first = Choices::random(7, 3);
        let drawn = draw(&mut first);
        assert_eq!(draw(&mut Choices::random(7, 3)), drawn);
        assert_ne!(draw(&mut Choices::random(7, 4)), drawn);
        let mut again = Choices::recorded(first.made());
        assert_eq!(draw(&mut again), drawn);
        assert_eq!(again.made(), first.made());
    }

    #[test]
    fn what_a_record_lacks_is_nominal() {
        assert_eq!(draw(&mut Choices::recorded(&[])), (0, 0.0, 0.0));
    }

    #[test]
    fn only_a_record_makes_an_exception() {
        assert_eq!(Choices::random(7, 3).exception("left_out", 2), 0);
        assert_eq!(Choices::recorded(&[]).exception("left_out", 2), 0);
        let said = Choice { name: "left_out".into(), kind: ChoiceKind::Index { of: 2 }, value: 1.0 };
        let mut again = Choices::recorded(std::slice::from_ref(&said));
        assert_eq!(again.exception("left_out", 2), 1);
        assert_eq!(again.made(), [said]);
    }

    #[test]
    fn noise_has_its_spread() {
        let mut choices = Choices::random(1, 0);
        let values: Vec<f64> = (0..20_000).map(|_| choices.normal("n", 2.0)).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64;
        assert!(mean.abs() < 0.06, "{mean}");
        assert!((variance.sqrt() - 2.0).abs() < 0.05, "{variance}");
    }

    #[test]
    fn a_record_can_leave_the_rest_to_chance() {
        let mut first = Choices::random(7, 3);
        let drawn = draw(&mut first);
        let scene = &first.made()[..2];
        let again = draw(&mut Choices::partly_recorded(scene, 7, 9));
        assert_eq!((again.0, again.1), (drawn.0, drawn.1));
        assert_ne!(again.2, drawn.2);
        assert_eq!(draw(&mut Choices::partly_recorded(scene, 7, 9)), again);
    }

    #[test]
    fn noise_can_come_from_a_stream_of_its_own() {
        let drawn = |mut choices: Choices| {
            let scene = choices.real("yaw", -1.0, 1.0, 0.0);
            choices.begin_noise();
            (scene, choices.normal("noise", 0.01))
        };
        let first = drawn(Choices::random(7, 3).with_noise(7, 100));
        assert_eq!(drawn(Choices::random(7, 3).with_noise(7, 100)), first);
        let again = drawn(Choices::random(7, 3).with_noise(7, 101));
        assert_eq!(again.0, first.0);
        assert_ne!(again.1, first.1);
        // Noise depends on its own stream alone.
        assert_eq!(drawn(Choices::random(7, 4).with_noise(7, 100)).1, first.1);
        assert_eq!(drawn(Choices::random(7, 3)).0, first.0);
    }

    #[test]
    fn steered_decisions_lie_at_their_quantiles_once() {
        let quantiles =
            BTreeMap::from([("model".to_owned(), 0.5), ("yaw".to_owned(), 0.75), ("noise".to_owned(), 0.975)]);
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
