//! The answer of a comparison of two campaigns: worse, better, no difference, or too few scenes to
//! decide.

use crate::{ComparedLine, Comparison, Difference, PairedTable, holm};

/// The answer to the question whether the second campaign is as good as the first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answer {
    /// The second is worse.
    Worse,
    /// The second is better.
    Better,
    /// All runs are the same on both sides, with the same states and outcomes.
    Same,
    /// The rates differ by less than the margin.
    NoDifference,
    /// Too few scenes to decide.
    Underpowered {
        /// About how many scenes would decide, if their outcomes are distributed like those so far.
        /// `None` if more than a million, or if no scene was decided on both sides.
        scenes: Option<u64>,
    },
}

impl Answer {
    /// Its name: `worse`, `better`, `same`, `no difference` or `underpowered`.
    pub fn word(self) -> &'static str {
        match self {
            Self::Worse => "worse",
            Self::Better => "better",
            Self::Same => "same",
            Self::NoDifference => "no difference",
            Self::Underpowered { .. } => "underpowered",
        }
    }
}

/// Maximum number of scenes that is suggested.
const MOST_SCENES: u64 = 1_000_000;

impl Comparison {
    /// Returns the answer of a line by its two-sided exact test, corrected for all lines. `level`:
    /// probability of a false alarm over all lines. `margin`: rates that differ by less count as
    /// equal, between 0 and 1.
    pub fn answer_of(&self, line: &ComparedLine, level: f64, margin: f64) -> Answer {
        if self.is_same {
            return Answer::Same;
        }
        decided(line.difference, line.two_sided_adjusted, level, margin).unwrap_or_else(|| {
            Answer::Underpowered {
                scenes: self.scenes_to_decide(line, level, margin),
            }
        })
    }

    /// Returns the answer over all lines: worse if one is worse, else better if one is better, else
    /// underpowered if one is. See [`Comparison::answer_of`].
    pub fn answer(&self, level: f64, margin: f64) -> Answer {
        if self.is_same {
            return Answer::Same;
        }
        let answers: Vec<Answer> = self
            .lines
            .iter()
            .map(|line| self.answer_of(line, level, margin))
            .collect();
        if answers.contains(&Answer::Worse) {
            return Answer::Worse;
        }
        if answers.contains(&Answer::Better) {
            return Answer::Better;
        }
        let lacking = answers.iter().filter_map(|answer| match answer {
            Answer::Underpowered { scenes } => Some(scenes.unwrap_or(u64::MAX)),
            _ => None,
        });
        match lacking.max() {
            Some(scenes) => Answer::Underpowered {
                scenes: Some(scenes).filter(|scenes| *scenes <= MOST_SCENES),
            },
            None => Answer::NoDifference,
        }
    }

    /// Returns the number of scenes at which a line is decided by the same test and correction, if
    /// more scenes have the shares of those so far in every line.
    fn scenes_to_decide(&self, line: &ComparedLine, level: f64, margin: f64) -> Option<u64> {
        let pairs = line.table.pairs();
        if pairs == 0 {
            return None;
        }
        let decides = |scenes: u64| {
            let times = scenes as f64 / pairs as f64;
            let own = scaled(line.table, times);
            let others = self
                .lines
                .iter()
                .filter(|other| other.of != line.of)
                .map(|other| scaled(other.table, times));
            let p: Vec<f64> = [own]
                .into_iter()
                .chain(others)
                .map(|table| table.test_by(self.sampling).two_sided)
                .collect();
            decided(own.difference_by(self.sampling), holm(&p)[0], level, margin).is_some()
        };
        let mut high = pairs + 1;
        while !decides(high) {
            high *= 2;
            if high > MOST_SCENES {
                return None;
            }
        }
        let mut low = (high / 2).max(pairs);
        while low + 1 < high {
            let middle = low.midpoint(high);
            if decides(middle) {
                high = middle
            } else {
                low = middle
            }
        }
        Some(high)
    }
}

/// The answer by a difference and its p-value; `None` if they decide nothing.
fn decided(difference: Option<Difference>, p: f64, level: f64, margin: f64) -> Option<Answer> {
    let found = difference?;
    if p <= level && found.value != 0.0 {
        return Some(if found.value < 0.0 {
            Answer::Worse
        } else {
            Answer::Better
        });
    }
    (found.low > -margin && found.high < margin).then_some(Answer::NoDifference)
}

/// A table with the same shares of other numbers of scenes.
fn scaled(table: PairedTable, times: f64) -> PairedTable {
    let part = |count: u64| (count as f64 * times).round() as u64;
    let [only_first, only_second, neither] =
        [table.only_first, table.only_second, table.neither].map(part);
    let both = part(table.pairs()).saturating_sub(only_first + only_second + neither);
    PairedTable {
        both,
        only_first,
        only_second,
        neither,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Compared;
    use actcheck_verdict::Counts;

    use crate::Sampling;

    /// A comparison with one line for each table.
    fn comparison(tables: &[[u64; 4]]) -> Comparison {
        let tables = tables
            .iter()
            .map(|[both, only_first, only_second, neither]| PairedTable {
                both: *both,
                only_first: *only_first,
                only_second: *only_second,
                neither: *neither,
            });
        let lines = tables.enumerate().map(|(number, table)| {
            let test = table.test();
            ComparedLine {
                of: Compared::Property {
                    action: String::new(),
                    property: number.to_string(),
                },
                table,
                difference: table.difference(),
                test,
                two_sided_adjusted: test.two_sided,
                second_worse_adjusted: test.second_worse,
                worse: Vec::new(),
                better: Vec::new(),
                left_out: [Counts::default(); 2],
            }
        });
        let mut made = Comparison {
            pairs: 0,
            other_physics: 0,
            alone: [Vec::new(), Vec::new()],
            other_scene: Vec::new(),
            judged_alone: [Vec::new(), Vec::new()],
            lines: lines.collect(),
            sampling: Sampling::Fixed,
            is_same: false,
        };
        let adjusted = holm(
            &made
                .lines
                .iter()
                .map(|line| line.test.two_sided)
                .collect::<Vec<f64>>(),
        );
        made.lines
            .iter_mut()
            .zip(adjusted)
            .for_each(|(line, p)| line.two_sided_adjusted = p);
        made
    }

    fn answer(tables: &[[u64; 4]]) -> Answer {
        let made = comparison(tables);
        made.answer_of(&made.lines[0], 0.05, 0.05)
    }

    #[test]
    fn there_are_four_answers() {
        assert_eq!(answer(&[[20, 30, 2, 10]]), Answer::Worse);
        assert_eq!(answer(&[[20, 2, 30, 10]]), Answer::Better);
        assert_eq!(answer(&[[400, 1, 1, 100]]), Answer::NoDifference);
        // Without discordant scenes, Tango's interval is ± z² / (n + z²): within 0.05 from 73
        // scenes on.
        assert_eq!(
            answer(&[[12, 0, 0, 3]]),
            Answer::Underpowered { scenes: Some(73) }
        );
        assert_eq!(answer(&[[58, 0, 0, 15]]), Answer::NoDifference);
        assert_eq!(
            answer(&[[0, 0, 0, 0]]),
            Answer::Underpowered { scenes: None }
        );
    }

    /// The answer was one-sided, beside a table with two-sided p-values: 5 of 5 scenes have 0.031
    /// and 0.062.
    #[test]
    fn the_answer_is_that_of_the_two_sided_test_of_the_table() {
        let made = comparison(&[[10, 5, 0, 5]]);
        let line = &made.lines[0];
        assert!(line.test.second_worse < 0.05 && line.test.two_sided > 0.05);
        assert!(matches!(
            made.answer_of(line, 0.05, 0.05),
            Answer::Underpowered { .. }
        ));
        assert_eq!(answer(&[[10, 6, 0, 5]]), Answer::Worse);
    }

    /// 4 of 40 scenes: the exact test needs 6 discordant scenes, and 8 if it is corrected for 6
    /// lines. 41 were suggested.
    #[test]
    fn the_suggested_number_of_scenes_counts_with_the_same_test_and_correction() {
        let (line, other) = ([30, 0, 4, 6], [40, 0, 0, 0]);
        let Answer::Underpowered {
            scenes: Some(alone),
        } = answer(&[line])
        else {
            panic!("it is decided")
        };
        assert!((55..=60).contains(&alone), "{alone}");
        let of_six = [line, other, other, other, other, other];
        let Answer::Underpowered {
            scenes: Some(corrected),
        } = answer(&of_six)
        else {
            panic!("it is decided")
        };
        assert!((75..=80).contains(&corrected), "{corrected}");
    }

    #[test]
    fn the_suggested_number_of_scenes_decides() {
        for table in [[10, 3, 1, 6], [30, 2, 2, 8], [5, 1, 0, 9], [50, 6, 3, 20]] {
            for lines in [1, 5] {
                let few = vec![table; lines];
                let Answer::Underpowered {
                    scenes: Some(scenes),
                } = answer(&few)
                else {
                    panic!("{few:?}")
                };
                let times = scenes.div_ceil(table.iter().sum::<u64>()) + 1;
                let many = vec![table.map(|count| count * times); lines];
                let answer = answer(&many);
                assert!(
                    !matches!(answer, Answer::Underpowered { .. }),
                    "{scenes} scenes are not enough for {few:?}"
                );
            }
        }
    }
}
