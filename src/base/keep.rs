//! Which runs a history keeps whole.

use crate::Digest;

/// How much a history keeps of runs in which nothing failed, and of failed ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Keep {
    /// Everything of every run.
    #[default]
    All,
    /// Everything of runs in which a property failed or that did not complete, and the outcomes of
    /// the others.
    Failures,
    /// The outcomes of all runs.
    Outcomes,
}

impl Keep {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::All, Self::Failures, Self::Outcomes];

    /// The word for it in configurations.
    pub fn word(self) -> &'static str {
        match self {
            Self::All => "all",
            Self::Failures => "failures",
            Self::Outcomes => "outcomes",
        }
    }
}

/// Which runs of a campaign are kept whole; of the others, the history keeps everything except motion.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Keeping {
    /// The rule for all runs.
    pub keep: Keep,
    /// Share of all runs, drawn at random, that are kept whole whatever the rule says, from 0 to 1.
    pub whole_share: f64,
}

impl Keeping {
    /// Whether a run is kept whole. Depends on nothing but its arguments, so that shards and
    /// resumed campaigns decide alike. `seed` is that of the campaign, `index` the position of the
    /// run in it.
    pub fn keeps_whole(&self, seed: u64, index: u64, failed: bool) -> bool {
        match self.keep {
            Keep::All => true,
            Keep::Failures if failed => true,
            Keep::Failures | Keep::Outcomes => draw(seed, index) < self.whole_share,
        }
    }
}

/// A number from 0 (inclusive) to 1 (exclusive) that looks random.
fn draw(seed: u64, index: u64) -> f64 {
    let mut digest = Digest::new();
    digest.update(b"kept whole");
    digest.update(&seed.to_le_bytes());
    digest.update(&index.to_le_bytes());
    // 52 bits, which a number of 64 bits holds exactly.
    let digits = digest.finish();
    u64::from_str_radix(&digits[..13], 16).unwrap_or(0) as f64 / (1u64 << 52) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn about_the_given_share_of_runs_is_kept_whole() {
        let keeping = |keep, whole_share| Keeping { keep, whole_share };
        let kept = |of: Keeping, failed| {
            (0..10_000)
                .filter(|index| of.keeps_whole(7, *index, failed))
                .count()
        };
        for keep in [Keep::Failures, Keep::Outcomes] {
            assert_eq!(kept(keeping(keep, 0.0), false), 0);
            assert_eq!(kept(keeping(keep, 1.0), false), 10_000);
            // Four standard deviations of a binomial distribution.
            assert!((kept(keeping(keep, 0.1), false) as i64 - 1_000).abs() < 120);
        }
        assert_eq!(kept(keeping(Keep::Failures, 0.0), true), 10_000);
        assert_eq!(kept(keeping(Keep::Outcomes, 0.0), true), 0);
        assert_eq!(kept(keeping(Keep::All, 0.0), false), 10_000);
        let of = |seed| {
            (0..64)
                .map(|index| keeping(Keep::Outcomes, 0.5).keeps_whole(seed, index, false))
                .collect()
        };
        let (one, other): (Vec<bool>, Vec<bool>) = (of(1), of(2));
        assert_ne!(one, other);
    }
}
