//! Shards: the equal parts into which a campaign can be split.

use std::fmt;
use std::str::FromStr;

/// A shard of a campaign: every `of`-th run, starting with the `number`-th.
///
/// Each run of a campaign belongs to exactly one of its shards, on every machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "String", into = "String"))]
pub struct Shard {
    of: u64,
    number: u64,
}

impl Shard {
    /// Creates shard `number` (from 1) of `of`. Returns `None` unless 1 ≤ `number` ≤ `of`.
    pub fn new(number: u64, of: u64) -> Option<Self> {
        (1 <= number && number <= of).then_some(Self { of, number })
    }

    /// Position among the shards, from 1.
    pub fn number(self) -> u64 {
        self.number
    }

    /// Number of shards.
    pub fn of(self) -> u64 {
        self.of
    }

    /// Whether the run with this index (from 0) belongs to this shard.
    pub fn has(self, index: u64) -> bool {
        index % self.of == self.number - 1
    }

    /// Number of the first `runs` runs that belong to this shard.
    pub fn share(self, runs: u64) -> u64 {
        runs / self.of + u64::from(runs % self.of >= self.number)
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.of)
    }
}

impl From<Shard> for String {
    fn from(shard: Shard) -> Self {
        shard.to_string()
    }
}

impl TryFrom<String> for Shard {
    type Error = ParseShardError;

    fn try_from(text: String) -> Result<Self, ParseShardError> {
        text.parse()
    }
}

/// The error of parsing an invalid shard.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("expected a shard such as 1/4: its number, from 1, and the number of shards")]
pub struct ParseShardError;

impl FromStr for Shard {
    type Err = ParseShardError;

    fn from_str(text: &str) -> Result<Self, ParseShardError> {
        // Accept only digits: `u64::from_str` also accepts a `+` sign.
        let number = |text: &str| match text.bytes().all(|byte| byte.is_ascii_digit()) {
            true => text.parse::<u64>().map_err(|_| ParseShardError),
            false => Err(ParseShardError),
        };
        let (part, of) = text.split_once('/').ok_or(ParseShardError)?;
        Self::new(number(part)?, number(of)?).ok_or(ParseShardError)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_run_is_in_exactly_one_shard() {
        for of in 1..9 {
            let shards: Vec<Shard> = (1..=of)
                .filter_map(|number| Shard::new(number, of))
                .collect();
            assert_eq!(shards.len() as u64, of);
            for runs in 0..30 {
                assert_eq!(
                    shards.iter().map(|shard| shard.share(runs)).sum::<u64>(),
                    runs
                );
                for shard in &shards {
                    assert_eq!(
                        shard.share(runs),
                        (0..runs).filter(|index| shard.has(*index)).count() as u64
                    );
                }
                assert_eq!(shards.iter().filter(|shard| shard.has(runs)).count(), 1);
            }
        }
    }

    #[test]
    fn invalid_shards_are_rejected() {
        assert_eq!("2/4".parse(), Ok(Shard { number: 2, of: 4 }));
        assert_eq!(
            "2/4".parse::<Shard>().map(|shard| shard.to_string()),
            Ok("2/4".to_owned())
        );
        for wrong in [
            "",
            "/",
            "0/4",
            "5/4",
            "1",
            "1/",
            "/4",
            "-1/4",
            "+1/4",
            "1/4/2",
            "1 / 4",
            "1/0",
            "a/b",
            "1/99999999999999999999",
        ] {
            assert_eq!(wrong.parse::<Shard>(), Err(ParseShardError), "{wrong}");
        }
    }
}
