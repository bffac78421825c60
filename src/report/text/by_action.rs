//! Tables for campaigns whose tests have several actions: one line per run with the score of each
//! action, as in the paper's Table IV, and the properties by action.

use comfy_table::{Attribute, Cell, Color};

use crate::text::{Page, fit, fitted, ruled};
use crate::{ActionSummary, CampaignSummary, PropertyLine, RunSummary};
use actcheck_base::Outcome;
use actcheck_verdict::{Counts, mean};

/// Whether any run has more than one action.
pub(super) fn has_several_actions(summary: &CampaignSummary) -> bool {
    summary.runs.iter().any(|run| run.actions.len() > 1)
}

/// Scores of the shown runs: the paper's A of each action, and S. The last line has the means over
/// all runs (T in column S).
pub(super) fn scores_table(summary: &CampaignSummary, shown: &[&RunSummary], page: Page) -> String {
    let names = steps(summary);
    let mut table = table_of_scores(summary, shown, &names);
    if fit(&mut table, page, &[]).is_some() {
        return format!("{table}\n");
    }
    // Names of actions are wider than their scores.
    let short: Vec<String> = (1..=names.len()).map(|step| format!("A{step}")).collect();
    let legend = format!(" ({})\n", names.join(", "));
    fitted(table_of_scores(summary, shown, &short), page, &["test"]) + &legend
}

fn table_of_scores(
    summary: &CampaignSummary,
    shown: &[&RunSummary],
    steps: &[String],
) -> comfy_table::Table {
    let mut table = ruled();
    let is_one_test = summary
        .runs
        .windows(2)
        .all(|pair| pair[0].test == pair[1].test);
    let mut header = vec!["run".to_owned()];
    if !is_one_test {
        header.push("test".to_owned());
    }
    header.extend(steps.iter().cloned());
    header.push("S".to_owned());
    table.set_header(header);
    for run in shown {
        let mut row = vec![Cell::new(&run.id)];
        if !is_one_test {
            row.push(Cell::new(&run.test));
        }
        row.extend(
            (0..steps.len()).map(|step| run.actions.get(step).map_or(Cell::new(""), score_cell)),
        );
        row.push(Cell::new(format!("{:.2}", run.score)));
        table.add_row(row);
    }
    let mut means = vec![Cell::new("mean")];
    if !is_one_test {
        means.push(Cell::new("of all runs"));
    }
    let of_step = |step: usize| {
        mean(
            summary
                .runs
                .iter()
                .filter_map(|run| run.actions.get(step))
                .map(|a| a.score),
        )
    };
    means.extend((0..steps.len()).map(|step| mean_cell(of_step(step))));
    means.push(mean_cell(summary.total_score()).add_attribute(Attribute::Bold));
    table.add_row(means);
    table
}

/// Column headers: `A1 MoveTo`, or just `A1` if the tests differ in that action.
fn steps(summary: &CampaignSummary) -> Vec<String> {
    let longest = summary
        .runs
        .iter()
        .map(|run| run.actions.len())
        .max()
        .unwrap_or(0);
    let title = |step: usize| {
        let mut names = summary
            .runs
            .iter()
            .filter_map(|run| run.actions.get(step))
            .map(|action| &action.name);
        let first = names.next();
        match first {
            Some(first) if names.all(|name| name == first) => format!("A{} {first}", step + 1),
            _ => format!("A{}", step + 1),
        }
    };
    (0..longest).map(title).collect()
}

/// Red if a property failed, yellow if one was not decided.
fn score_cell(action: &ActionSummary) -> Cell {
    let counts = Counts::of(action.judgements.iter().map(|judgement| judgement.outcome));
    let cell = Cell::new(format!("{:.2}", action.score));
    if counts.failed > 0 {
        cell.fg(Color::Red).add_attribute(Attribute::Bold)
    } else if counts.broken + counts.timeout + counts.untested > 0 {
        cell.fg(Color::Yellow)
    } else {
        cell.fg(Color::Green)
    }
}

fn mean_cell(value: Option<f64>) -> Cell {
    Cell::new(value.map_or_else(String::new, |value| format!("{value:.2}")))
}

/// All properties, grouped by action. Only the first row of each group has the action's name.
pub(super) fn properties_table(
    summary: &CampaignSummary,
    rate: impl Fn(&PropertyLine) -> String,
) -> comfy_table::Table {
    let mut table = ruled();
    let counted = Outcome::ALL.map(|outcome| outcome.word().to_owned());
    let header = ["action", "property", "pass rate [95 % interval]"].map(str::to_owned);
    table.set_header(header.into_iter().chain(counted));
    for (action, lines) in summary.lines_by_action() {
        for (idx, line) in lines.iter().enumerate() {
            let first = if idx == 0 {
                action.clone()
            } else {
                String::new()
            };
            let counts = Outcome::ALL.map(|outcome| line.counts.get(outcome).to_string());
            table.add_row(
                [first, line.label.clone(), rate(line)]
                    .into_iter()
                    .chain(counts),
            );
        }
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::summary::campaign_samples::{campaign, run};
    use actcheck_history::RunStatus;

    /// A run with two actions, each with both properties.
    fn two(index: u64, first: [Outcome; 2], second: [Outcome; 2]) -> RunSummary {
        let mut both = run(index, RunStatus::Completed, &first);
        let mut other = run(index, RunStatus::Completed, &second).actions.remove(0);
        other.name = "Place".to_owned();
        both.score = (both.actions[0].score + other.score) / 2.0;
        both.actions.push(other);
        both.test = "Pick Place".to_owned();
        both
    }

    #[test]
    fn the_table_has_a_score_per_action_and_run_and_a_line_of_means() {
        use Outcome::{Failed, Passed};
        let runs = vec![
            two(0, [Passed, Passed], [Passed, Failed]),
            two(1, [Passed, Failed], [Failed, Failed]),
        ];
        let summary = campaign(runs);
        assert!(has_several_actions(&summary));
        let shown: Vec<&RunSummary> = summary.runs.iter().collect();
        let text = scores_table(&summary, &shown, Page::default());
        let rows: Vec<Vec<&str>> = text
            .lines()
            .map(|line| line.split_whitespace().collect())
            .collect();
        assert_eq!(rows[0], ["run", "A1", "Pick", "A2", "Place", "S"], "{text}");
        assert_eq!(rows[2], ["k7f3-1", "1.00", "0.50", "0.75"]);
        assert_eq!(rows[3], ["k7f3-2", "0.50", "0.00", "0.25"]);
        assert_eq!(rows[4], ["mean", "0.75", "0.25", "0.50"]);
    }

    #[test]
    fn a_property_is_counted_for_each_action_that_has_it() {
        use Outcome::{Failed, Passed};
        let summary = campaign(vec![two(0, [Passed, Passed], [Passed, Failed])]);
        let lines = summary.lines_by_action();
        assert_eq!(
            lines
                .iter()
                .map(|(name, _)| name.as_str())
                .collect::<Vec<_>>(),
            ["Pick", "Place"]
        );
        let passed = |idx: usize| {
            lines[idx]
                .1
                .iter()
                .map(|line| line.counts.passed)
                .collect::<Vec<_>>()
        };
        assert_eq!((passed(0), passed(1)), (vec![1, 1], vec![1, 0]));
    }
}
