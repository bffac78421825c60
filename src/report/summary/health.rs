//! A campaign's health, with the names needed to print it.

use actcheck_analysis::{Health, HealthProblem, ParameterCoverage};
use actcheck_base::{Diagnostic, Diagnostics, ShellLine, names};

/// A campaign's health, with the names that messages refer to.
#[derive(Debug, Clone, PartialEq)]
pub struct HealthSummary {
    /// The campaign's id.
    pub campaign: String,
    /// Path of the history, as the user named it.
    pub history: String,
    /// How the user invoked this program.
    pub program: String,
    /// The measured health.
    pub health: Health,
}

impl HealthSummary {
    /// 0: the campaign is healthy. 1: there are warnings.
    pub fn exit_code(&self) -> u8 {
        u8::from(!self.health.problems.is_empty())
    }

    /// The problems found, as warnings with help.
    pub fn warnings(&self) -> Diagnostics {
        let mut found = Diagnostics::new();
        for problem in &self.health.problems {
            found.push(self.warning(problem));
        }
        found
    }

    pub(crate) fn warning(&self, problem: &HealthProblem) -> Diagnostic {
        match problem {
            HealthProblem::Discards(discards, drawn, run, reason) => Diagnostic::warning(
                "S032",
                format!("{discards} of {drawn} scenes were discarded; the first, for run {run}: {reason}"),
            )
            .help(
                "use fewer or smaller objects, a larger surface, or ranges closer to `[scene] require`: fewer discards waste \
                 less time and bias the sample less",
            ),
            HealthProblem::Inapplicable(property, not, of) => Diagnostic::warning(
                "Q001",
                format!("{} was inapplicable in {not} of {of} judgements", names::local(property)),
            )
            .help("generate scenes to which it applies, or widen the `applicable` condition of its rule"),
            HealthProblem::Neglected(parameter) => neglected(parameter),
            HealthProblem::PairNeglected(pair) => Diagnostic::warning(
                "Q003",
                format!(
                    "of {} pairs of values of `{}` and `{}` {} were tried; {} random draws would try about {:.0}",
                    pair.cells, pair.names[0], pair.names[1], pair.hits, pair.draws, pair.expected_hits
                ),
            )
            .help("the two parameters vary together, so failures can't be attributed to one of them: check whether discards or a case tie them"),
            HealthProblem::Duplicates(times, run, of) => {
                Diagnostic::warning("Q004", format!("{times} runs have the same choices as another run: {run} repeats {of}"))
                    .help("widen the ranges of `[physics]`, `[sensing]` or the models, or ask for fewer runs")
            }
            HealthProblem::Slow(run, secs, median) => Diagnostic::warning(
                "Q005",
                format!("run {run} took {secs:.1} s, {:.0} times the median of {median:.1} s", secs / median.max(1e-9)),
            )
            .help(format!("`{}` shows the run; `[budget]` limits the time of a run", self.show(run))),
            HealthProblem::Penetration(run, depth) => Diagnostic::warning(
                "Q006",
                format!("in run {run}, bodies penetrated each other by {:.1} mm: contacts were simulated inaccurately", depth * 1e3),
            )
            .help("raise `[physics] steps_per_second` or `iterations`, or make heavy objects lighter"),
            HealthProblem::Energy(run, energy) => Diagnostic::warning(
                "Q007",
                format!("in run {run}, objects gained {energy:.2} J without a cause: the simulation was unstable"),
            )
            .help("raise `[physics] steps_per_second` or `iterations`, or lower `restitution`"),
        }
    }

    fn show(&self, run: &str) -> String {
        ShellLine::new(&self.program)
            .fixed("show")
            .word(run)
            .option("--history", &self.history)
            .to_string()
    }

    /// Pairs of bins over all pairs of parameters: number tried, number expected, total.
    pub(crate) fn pairs(&self) -> (usize, f64, usize) {
        let pairs = &self.health.pairs;
        (
            pairs.iter().map(|pair| pair.hits).sum(),
            pairs.iter().map(|pair| pair.expected_hits).sum(),
            pairs.iter().map(|pair| pair.cells).sum(),
        )
    }
}

fn neglected(parameter: &ParameterCoverage) -> Diagnostic {
    let bins = parameter.counts.len();
    let bin = parameter.neglected.unwrap_or_default();
    let (times, even) = (
        parameter.counts.get(bin).copied().unwrap_or_default(),
        parameter.draws as f64 / bins as f64,
    );
    let message = format!(
        "`{}` fell into the {} of its {bins} equally probable bins {times} times in {} draws, not about {even:.0}",
        parameter.name,
        ordinal(bin + 1),
        parameter.draws
    );
    Diagnostic::warning("Q002", message)
        .help("rarely drawn values are rarely tested: check whether discards exclude such scenes (`act:discards` of each run)")
}

fn ordinal(number: usize) -> String {
    let ending = match (number % 10, number % 100) {
        (1, rest) if rest != 11 => "st",
        (2, rest) if rest != 12 => "nd",
        (3, rest) if rest != 13 => "rd",
        _ => "th",
    };
    format!("{number}{ending}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ordinals_have_english_suffixes() {
        let ordinals: Vec<String> = [1, 2, 3, 4, 11, 12, 13, 21, 102]
            .into_iter()
            .map(ordinal)
            .collect();
        assert_eq!(
            ordinals,
            [
                "1st", "2nd", "3rd", "4th", "11th", "12th", "13th", "21st", "102nd"
            ]
        );
    }
}
