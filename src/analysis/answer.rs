//! The answer of a comparison of two campaigns: worse, better, no difference, or too few scenes to decide.

use crate::{ComparedLine, Comparison, PairedTable};

/// The answer to the question whether the second campaign is as good as the first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answer {
    /// The second is worse.
    Worse,
    /// The second is better.
    Better,
    /// The rates differ by less than the margin.
    NoDifference,
    /// Too few scenes to decide.
    Underpowered {
        /// About how many scenes would decide, if their outcomes are distributed like those so far. `None` if more than
        /// a million, or if no scene was decided on both sides.
        scenes: Option<u64>,
    },
}

impl Answer {
    /// Its name: `worse`, `better`, `no difference` or `underpowered`.
    pub fn word(self) -> &'static str {
        match self {
            Self::Worse => "worse",
            Self::Better => "better",
            Self::NoDifference => "no difference",
            Self::Underpowered { .. } => "underpowered",
        }
    }
}

/// Maximum number of scenes that is suggested.
const MOST_SCENES: u64 = 1_000_000;

impl ComparedLine {
    /// Returns the answer of a line. `level`: probability of a false alarm over all lines. `margin`: rates that differ by
    /// less count as equal, between 0 and 1.
    pub fn answer(&self, level: f64, margin: f64) -> Answer {
        let Some(found) = self.difference else { return Answer::Underpowered { scenes: None } };
        if self.second_worse_adjusted <= level {
            Answer::Worse
        } else if self.two_sided_adjusted <= level && found.value > 0.0 {
            Answer::Better
        } else if found.low > -margin && found.high < margin {
            Answer::NoDifference
        } else {
            Answer::Underpowered { scenes: scenes_to_decide(self.table, margin) }
        }
    }
}

impl Comparison {
    /// Returns the answer over all lines: worse if one is worse, else better if one is better, else underpowered if one
    /// is. See [`ComparedLine::answer`].
    pub fn answer(&self, level: f64, margin: f64) -> Answer {
        let answers: Vec<Answer> = self.lines.iter().map(|line| line.answer(level, margin)).collect();
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
            Some(scenes) => Answer::Underpowered { scenes: Some(scenes).filter(|scenes| *scenes <= MOST_SCENES) },
            None => Answer::NoDifference,
        }
    }
}

/// Returns the smallest number of scenes with the shares of a table at which its interval excludes 0, or lies within the
/// margin.
fn scenes_to_decide(table: PairedTable, margin: f64) -> Option<u64> {
    let scaled = |scenes: u64| {
        let part = |count: u64| (count as f64 * scenes as f64 / table.pairs() as f64).round() as u64;
        let [only_first, only_second, neither] = [table.only_first, table.only_second, table.neither].map(part);
        let both = scenes.saturating_sub(only_first + only_second + neither);
        PairedTable { both, only_first, only_second, neither }
    };
    let decides = |scenes: u64| {
        scaled(scenes)
            .difference()
            .is_some_and(|found| found.low > 0.0 || found.high < 0.0 || (found.low > -margin && found.high < margin))
    };
    let mut high = table.pairs() + 1;
    while !decides(high) {
        high *= 2;
        if high > MOST_SCENES {
            return None;
        }
    }
    let mut low = (high / 2).max(table.pairs());
    while low + 1 < high {
        let middle = low.midpoint(high);
        if decides(middle) { high = middle } else { low = middle }
    }
    Some(high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Compared;
    use actcheck_verdict::Counts;

    fn line(both: u64, only_first: u64, only_second: u64, neither: u64) -> ComparedLine {
        let table = PairedTable { both, only_first, only_second, neither };
        let test = table.test();
        ComparedLine {
            of: Compared::WholeRun,
            table,
            difference: table.difference(),
            test,
            two_sided_adjusted: test.two_sided,
            second_worse_adjusted: test.second_worse,
            worse: Vec::new(),
            better: Vec::new(),
            left_out: [Counts::default(); 2],
        }
    }

    #[test]
    fn there_are_four_answers() {
        let answer = |line: ComparedLine| line.answer(0.05, 0.05);
        assert_eq!(answer(line(20, 30, 2, 10)), Answer::Worse);
        assert_eq!(answer(line(20, 2, 30, 10)), Answer::Better);
        assert_eq!(answer(line(400, 1, 1, 100)), Answer::NoDifference);
        // Without discordant scenes, Tango's interval is ± z² / (n + z²): within 0.05 from 73 scenes on.
        assert_eq!(answer(line(12, 0, 0, 3)), Answer::Underpowered { scenes: Some(73) });
        assert_eq!(answer(line(58, 0, 0, 15)), Answer::NoDifference);
        assert_eq!(answer(line(0, 0, 0, 0)), Answer::Underpowered { scenes: None });
    }

    #[test]
    fn the_suggested_number_of_scenes_decides() {
        for (both, only_first, only_second, neither) in [(10, 3, 1, 6), (30, 2, 2, 8), (5, 1, 0, 9), (50, 6, 3, 20)] {
            let few = line(both, only_first, only_second, neither);
            let Answer::Underpowered { scenes: Some(scenes) } = few.answer(0.05, 0.05) else { panic!("{few:?}") };
            let times = scenes.div_ceil(few.table.pairs()) + 1;
            let many = line(both * times, only_first * times, only_second * times, neither * times);
            let answer = many.answer(0.1, 0.05);
            assert!(!matches!(answer, Answer::Underpowered { .. }), "{scenes} scenes are not enough for {few:?}");
        }
    }
}
