//! Consistency of repeated runs of a scene: how much of a property's variance comes from the scene
//! and how much from noise.

use std::collections::BTreeMap;

use crate::{Interval, Sampling};

/// A decided run of a scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Repeated {
    /// Number of the scene.
    pub scene: u64,
    /// Whether it passed.
    pub passed: bool,
    /// Distance of the outcome from flipping, if known.
    pub margin: Option<f64>,
}

/// Consistency of one property over repeated runs of several scenes.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Consistency {
    /// Number of scenes with at least two decided runs, all passed.
    pub always_passed: u64,
    /// Number of scenes with at least two decided runs, all failed.
    pub always_failed: u64,
    /// The other scenes with at least two decided runs, sorted by number.
    pub flaky: Vec<SceneCounts>,
    /// pass^k for k from 1 to the most decided runs of a scene.
    pub pass_powers: Vec<PassPower>,
    /// Variance of the outcome: 1 for passed, 0 for failed.
    pub outcome: Option<Variance>,
    /// Variance of the margin, if all decided runs have one. Unit: the margin's, squared.
    pub margin: Option<Variance>,
    /// Share of passed runs. The interval accounts for the correlation of runs of the same scene.
    pub rate: Option<Interval>,
}

/// A scene with its number of passed runs. In [`Consistency::flaky`], a scene with different
/// outcomes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SceneCounts {
    /// Number of the scene.
    pub scene: u64,
    /// Number of passed runs.
    pub passed: u64,
    /// Number of decided runs.
    pub of: u64,
}

/// The probability that `k` independent runs of a scene all pass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PassPower {
    /// Number of runs.
    pub k: u64,
    /// Number of scenes with at least `k` decided runs, over which the mean is taken.
    pub scenes: u64,
    /// The mean with an interval. The interval is conservative, because the variance of a number in
    /// [0, 1] is at most that of a binary one with the same mean.
    pub probability: Interval,
}

/// Variance components of a number. Unit: the number's, squared.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Variance {
    /// Variance of runs about the mean of their scene.
    pub noise: f64,
    /// Variance of the scenes' means. The estimate is unbiased, so it may be negative if the
    /// variance is small.
    pub scene: f64,
}

impl Variance {
    /// Returns the share of the noise in the total variance, in [0, 1], or `None` if the variance
    /// is 0.
    pub fn noise_share(&self) -> Option<f64> {
        let both = self.noise + self.scene.max(0.0);
        (both > 0.0).then(|| self.noise / both)
    }
}

/// Computes the consistency of a property from its decided runs. `sampling`: how the number of runs
/// was decided.
pub fn consistency(runs: &[Repeated], sampling: Sampling) -> Consistency {
    let mut scenes: BTreeMap<u64, Vec<&Repeated>> = BTreeMap::new();
    for run in runs {
        scenes.entry(run.scene).or_default().push(run);
    }
    let counts: Vec<SceneCounts> = scenes
        .iter()
        .map(|(scene, runs)| count(*scene, runs))
        .collect();
    let several = || counts.iter().filter(|scene| scene.of >= 2);
    let numbers = |number: &dyn Fn(&Repeated) -> f64| -> Vec<Vec<f64>> {
        scenes
            .values()
            .map(|runs| runs.iter().map(|run| number(run)).collect())
            .collect()
    };
    let shares: Vec<[u64; 2]> = counts
        .iter()
        .map(|scene| [scene.passed, scene.of])
        .collect();
    let all_measured = runs
        .iter()
        .all(|run| run.margin.is_some_and(f64::is_finite));
    Consistency {
        always_passed: several().filter(|scene| scene.passed == scene.of).count() as u64,
        always_failed: several().filter(|scene| scene.passed == 0).count() as u64,
        flaky: several()
            .filter(|scene| scene.passed > 0 && scene.passed < scene.of)
            .copied()
            .collect(),
        pass_powers: (1..=counts.iter().map(|scene| scene.of).max().unwrap_or(0))
            .filter_map(|k| pass_power(&counts, k, sampling))
            .collect(),
        outcome: outcome_variance(&shares),
        margin: all_measured
            .then(|| variance(&numbers(&|run| run.margin.unwrap_or_default())))
            .flatten(),
        rate: share_of_scenes(&shares, sampling),
    }
}

fn count(scene: u64, runs: &[&Repeated]) -> SceneCounts {
    SceneCounts {
        scene,
        passed: runs.iter().filter(|run| run.passed).count() as u64,
        of: runs.len() as u64,
    }
}

/// Returns the mean over scenes of C(passed, k) / C(runs, k), an unbiased estimate for any
/// distribution of the scenes' probabilities.
fn pass_power(counts: &[SceneCounts], k: u64, sampling: Sampling) -> Option<PassPower> {
    let enough: Vec<f64> = counts
        .iter()
        .filter(|scene| scene.of >= k)
        // Probability that k draws without replacement all pass.
        .map(|scene| {
            (0..k)
                .map(|drawn| scene.passed.saturating_sub(drawn) as f64 / (scene.of - drawn) as f64)
                .product()
        })
        .collect();
    let scenes = enough.len() as f64;
    let probability = sampling.share(enough.iter().sum::<f64>() / scenes, scenes)?;
    Some(PassPower {
        k,
        scenes: enough.len() as u64,
        probability,
    })
}

/// Computes the variance components between and within groups. Returns `None` with fewer than two
/// groups or if every group has one value.
///
/// Source: the one-way model with random effects, by the method of moments of the analysis of
/// variance (Searle, 1971, for groups of unequal size): both estimates are unbiased.
fn variance(groups: &[Vec<f64>]) -> Option<Variance> {
    let spread = |values: &Vec<f64>| {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        Spread {
            size: values.len() as f64,
            mean,
            squares: values
                .iter()
                .map(|value| (value - mean) * (value - mean))
                .sum(),
        }
    };
    components(&groups.iter().map(spread).collect::<Vec<Spread>>())
}

/// Computes the variance components of a binary value from its number of ones and the size of each
/// group.
fn outcome_variance(groups: &[[u64; 2]]) -> Option<Variance> {
    let spread = |[is, of]: &[u64; 2]| {
        let (size, mean) = (*of as f64, *is as f64 / *of as f64);
        Spread {
            size,
            mean,
            squares: size * mean * (1.0 - mean),
        }
    };
    components(&groups.iter().map(spread).collect::<Vec<Spread>>())
}

/// Size of a group, its mean, and the sum of squared deviations from the mean.
struct Spread {
    size: f64,
    mean: f64,
    squares: f64,
}

fn components(groups: &[Spread]) -> Option<Variance> {
    let (count, total) = (
        groups.len() as f64,
        groups.iter().map(|group| group.size).sum::<f64>(),
    );
    if groups.len() < 2 || total <= count {
        return None;
    }
    let grand = groups
        .iter()
        .map(|group| group.size * group.mean)
        .sum::<f64>()
        / total;
    let (mut within, mut between, mut squares) = (0.0, 0.0, 0.0);
    for Spread {
        size,
        mean,
        squares: own,
    } in groups
    {
        within += own;
        between += size * (mean - grand) * (mean - grand);
        squares += size * size;
    }
    let noise = within / (total - count);
    let size = (total - squares / total) / (count - 1.0);
    Some(Variance {
        noise,
        scene: (between / (count - 1.0) - noise) / size,
    })
}

/// Computes the share of positive runs from the positive runs and all runs of each scene, with the
/// interval for the effective sample size, since runs of one scene are correlated. If every scene
/// was run once, this is the interval of independent runs.
///
/// Source: the design effect of Kish (1965), 1 + (m - 1) ρ, with ρ from the components of the
/// variance.
fn share_of_scenes(scenes: &[[u64; 2]], sampling: Sampling) -> Option<Interval> {
    let sum = |number: fn(&[u64; 2]) -> u64| scenes.iter().map(number).sum::<u64>() as f64;
    let (is, runs, squares) = (
        sum(|[is, _]| *is),
        sum(|[_, of]| *of),
        sum(|[_, of]| of * of),
    );
    // If all outcomes are equal, noise and scenes can't be separated: count each scene once.
    let alike = outcome_variance(scenes)
        .and_then(|variance| variance.noise_share())
        .map_or(1.0, |noise| 1.0 - noise);
    let worth = runs / (1.0 + (squares / runs - 1.0) * alike);
    sampling.share(is / runs, worth)
}

/// Groups runs by scene.
#[derive(Debug, Clone, Default)]
pub struct SceneRuns {
    /// Index of the scene of each run.
    scene_of: Vec<usize>,
    /// Number of runs of each scene.
    sizes: Vec<u64>,
}

impl SceneRuns {
    /// Groups runs by the keys of their scenes.
    pub fn new<K: Ord>(scenes: impl IntoIterator<Item = K>) -> Self {
        let mut places = BTreeMap::new();
        let mut found = Self::default();
        for scene in scenes {
            let next = places.len();
            let place = *places.entry(scene).or_insert(next);
            if place == found.sizes.len() {
                found.sizes.push(0);
            }
            found.sizes[place] += 1;
            found.scene_of.push(place);
        }
        found
    }

    /// Returns the share of some of the runs, given by their indices, with an interval that
    /// accounts for runs of the same scene. Returns `None` if there are no runs.
    pub fn share(
        &self,
        runs: impl IntoIterator<Item = usize>,
        sampling: Sampling,
    ) -> Option<Interval> {
        let mut scenes: Vec<[u64; 2]> = self.sizes.iter().map(|size| [0, *size]).collect();
        runs.into_iter()
            .for_each(|run| scenes[self.scene_of[run]][0] += 1);
        share_of_scenes(&scenes, sampling)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wilson_share;

    fn runs(scenes: &[&[u8]]) -> Vec<Repeated> {
        let of = |(scene, runs): (usize, &&[u8])| {
            let repeated = |passed: &u8| Repeated {
                scene: scene as u64,
                passed: *passed == 1,
                margin: None,
            };
            runs.iter().map(repeated).collect::<Vec<_>>()
        };
        scenes.iter().enumerate().flat_map(of).collect()
    }

    #[test]
    fn scenes_are_classified_by_the_results_of_their_runs() {
        let found = consistency(
            &runs(&[&[1, 1, 1], &[0, 0, 0], &[1, 0, 1], &[1], &[0, 1]]),
            Sampling::Fixed,
        );
        assert_eq!((found.always_passed, found.always_failed), (1, 1));
        assert_eq!(
            found.flaky,
            [
                SceneCounts {
                    scene: 2,
                    passed: 2,
                    of: 3
                },
                SceneCounts {
                    scene: 4,
                    passed: 1,
                    of: 2
                }
            ],
            "a scene of one run is neither"
        );
        assert_eq!(consistency(&[], Sampling::Fixed), Consistency::default());
    }

    /// If two of three runs passed, one of the three pairs passed entirely. Computed by hand for
    /// all scenes.
    #[test]
    fn pass_powers_are_shares_of_all_subsets_of_runs() {
        let found = consistency(
            &runs(&[&[1, 1, 1], &[0, 0, 0], &[1, 0, 1], &[1, 1]]),
            Sampling::Fixed,
        );
        let found: Vec<(u64, u64, f64)> = found
            .pass_powers
            .iter()
            .map(|power| (power.k, power.scenes, power.probability.rate))
            .collect();
        let expected = [
            (1, 4, (1.0 + 0.0 + 2.0 / 3.0 + 1.0) / 4.0),
            (2, 4, (1.0 + 1.0 / 3.0 + 1.0) / 4.0),
            (3, 3, 1.0 / 3.0),
        ];
        for (found, expected) in found.iter().zip(expected) {
            assert_eq!((found.0, found.1), (expected.0, expected.1));
            assert!((found.2 - expected.2).abs() < 1e-12, "{found:?}");
        }
        assert_eq!(found.len(), 3);
    }

    /// Kutner, Nachtsheim, Neter and Li, "Applied Linear Statistical Models", table 25.1: ratings
    /// by five officers of four candidates each; the mean squares are 394.925 and 73.2833, and the
    /// officers' variance 80.41.
    #[test]
    fn variance_components_match_published_values() {
        let ratings = [
            vec![76.0, 65.0, 85.0, 74.0],
            vec![59.0, 75.0, 81.0, 67.0],
            vec![49.0, 63.0, 61.0, 46.0],
            vec![74.0, 71.0, 85.0, 89.0],
            vec![66.0, 84.0, 80.0, 79.0],
        ];
        let found = variance(&ratings).expect("five groups of four");
        assert!((found.noise - 73.283_3).abs() < 1e-3, "{found:?}");
        assert!((found.scene - 80.410_4).abs() < 1e-3, "{found:?}");
        assert_eq!(variance(&ratings[..1]), None);
        assert_eq!(variance(&[vec![1.0], vec![2.0]]), None);
    }

    /// Scenes pass with probability 0.2 or 0.8, equally often: the variance of scenes is 0.09, that
    /// of noise 0.16, and two runs both pass with probability 0.34. Estimates from unequal numbers
    /// of runs are unbiased.
    #[test]
    fn estimates_are_unbiased_for_a_known_mixture() {
        const CAMPAIGNS: usize = 4000;
        let mut state = 1_u64;
        let mut uniform = || {
            // Knuth's linear congruential generator; any generator would do.
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let (mut noise, mut scene, mut both, mut held) = (0.0, 0.0, 0.0, 0);
        for _ in 0..CAMPAIGNS {
            let mut drawn = Vec::new();
            for number in 0..12 {
                let probability = if uniform() < 0.5 { 0.2 } else { 0.8 };
                let repetitions = 2 + number % 4;
                drawn.extend((0..repetitions).map(|_| Repeated {
                    scene: number,
                    passed: uniform() < probability,
                    margin: None,
                }));
            }
            let found = consistency(&drawn, Sampling::Fixed);
            let outcome = found.outcome.expect("twelve scenes");
            noise += outcome.noise / CAMPAIGNS as f64;
            scene += outcome.scene / CAMPAIGNS as f64;
            both += found.pass_powers[1].probability.rate / CAMPAIGNS as f64;
            let rate = found.rate.expect("the table has runs");
            held += usize::from((rate.low..=rate.high).contains(&0.5));
        }
        assert!((noise - 0.16).abs() < 0.002, "{noise}");
        assert!((scene - 0.09).abs() < 0.003, "{scene}");
        assert!((both - 0.34).abs() < 0.005, "{both}");
        // The plain interval, which treats all runs as independent, has a coverage of 84 %.
        assert!(held * 100 >= CAMPAIGNS * 93, "{held}");
    }

    #[test]
    fn scenes_whose_runs_all_agree_count_once() {
        let found = consistency(&runs(&[&[1, 1, 1], &[1, 1, 1]]), Sampling::Fixed);
        assert_eq!(found.rate, wilson_share(1.0, 2.0));
        assert_eq!(
            found.outcome.and_then(|variance| variance.noise_share()),
            None
        );
    }

    #[test]
    fn margins_are_used_if_every_run_has_one() {
        let run = |scene, margin| Repeated {
            scene,
            passed: true,
            margin,
        };
        let mut runs = vec![
            run(0, Some(1.0)),
            run(0, Some(3.0)),
            run(1, Some(5.0)),
            run(1, Some(7.0)),
        ];
        // Within: 2 each. Between the means 2 and 6: 2 · (4 + 4) / 1 = 16; minus 2, divided by 2.
        assert_eq!(
            consistency(&runs, Sampling::Fixed).margin,
            Some(Variance {
                noise: 2.0,
                scene: 7.0
            })
        );
        runs.push(run(1, None));
        assert_eq!(consistency(&runs, Sampling::Fixed).margin, None);
    }
}
