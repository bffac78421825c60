//! A comparison of two campaigns for the terminal.

use std::fmt::Write as _;

use crate::summary::compared_name;
use crate::text::{Page, fitted, ruled};
use crate::{CompareSummary, ComparedSide};
use actcheck_analysis::{Answer, Compared, ComparedLine, PairedTable, Sampling};
use actcheck_base::Outcome;
use actcheck_verdict::Counts;

/// Maximum number of runs, settings or names in a line or list; `--format json` has all.
const MAX_LISTED: usize = 10;

/// Formats both sides, their differences, rates and tests of each property, the scenes that
/// flipped, and the verdict.
pub fn compare_text(summary: &CompareSummary, page: Page) -> String {
    let mut out = String::new();
    let [first, second] = &summary.sides;
    let _ = writeln!(out, "A  {}\nB  {}", side(first), side(second));
    scenes(&mut out, summary);
    changes(&mut out, summary);
    out.push('\n');
    lines(&mut out, summary, page);
    known_issues(&mut out, summary);
    without_contested(&mut out, summary);
    flips(&mut out, summary);
    left_out(&mut out, summary);
    alone(&mut out, summary);
    answers(&mut out, summary);
    verdict(&mut out, summary);
    page.set(&out)
}

fn side(side: &ComparedSide) -> String {
    let lacking = if side.runs < side.planned {
        format!(" of {} planned", side.planned)
    } else {
        String::new()
    };
    format!(
        "{}: {}, {} runs{lacking}, started {}",
        side.name, side.config, side.runs, side.started
    )
}

fn scenes(out: &mut String, summary: &CompareSummary) {
    let found = &summary.comparison;
    let _ = writeln!(out, "\n{} scenes in both", found.pairs);
    for (name, runs) in ["A", "B"].into_iter().zip(&found.alone) {
        if !runs.is_empty() {
            let _ = writeln!(out, "{} only in {name}: {}", runs.len(), list(runs));
        }
    }
    if !found.other_scene.is_empty() {
        let runs: Vec<String> = found
            .other_scene
            .iter()
            .map(|(a, b)| format!("{a}/{b}"))
            .collect();
        let _ = writeln!(
            out,
            "{} with a different scene or test at the same index: {}",
            runs.len(),
            list(&runs)
        );
    }
    if found.other_physics > 0 {
        let _ = writeln!(
            out,
            "in {} of the {} the objects have different masses, frictions or restitutions",
            found.other_physics, found.pairs
        );
    }
}

fn changes(out: &mut String, summary: &CompareSummary) {
    if summary.changes.is_empty() {
        out.push_str("\nprogram, configuration, models, ontology and rules are the same in both\n");
        return;
    }
    out.push_str("\ndifferences\n");
    let short = |digest: &Option<String>| match digest {
        Some(digest) => shortened(digest),
        None => "absent".to_owned(),
    };
    for change in summary.changes.iter().take(MAX_LISTED) {
        let _ = writeln!(
            out,
            "  {} {}: {} → {}",
            change.kind,
            change.name,
            short(&change.first),
            short(&change.second)
        );
    }
    more(out, summary.changes.len());
    let [first, second] = summary.config_lines();
    for (sign, lines) in [("-", &first), ("+", &second)] {
        for line in lines.iter().take(MAX_LISTED) {
            let _ = writeln!(out, "    {sign} {line}");
        }
        more(out, lines.len());
    }
}

/// Shortens each digest in a text to its first eight characters.
fn shortened(text: &str) -> String {
    let pieces = text.split_inclusive(|letter: char| !letter.is_ascii_hexdigit());
    let short = |piece: &str| match piece
        .find(|letter: char| !letter.is_ascii_hexdigit())
        .unwrap_or(piece.len())
    {
        digits if digits >= 16 => format!("{}{}", &piece[..8], &piece[digits..]),
        _ => piece.to_owned(),
    };
    pieces.map(short).collect()
}

fn lines(out: &mut String, summary: &CompareSummary, page: Page) {
    let mut table = ruled();
    table.set_header([
        "passed in",
        "A",
        "B",
        "B − A, percent [95 %]",
        "only A",
        "only B",
        "p",
        "p corrected",
    ]);
    for line in &summary.comparison.lines {
        let [a, b] = line
            .table
            .passed()
            .map(|passed| format!("{passed}/{}", line.table.pairs()));
        let PairedTable {
            only_first,
            only_second,
            ..
        } = line.table;
        table.add_row([
            compared_name(&line.of),
            a,
            b,
            difference(line),
            only_first.to_string(),
            only_second.to_string(),
            probability(line.test.two_sided),
            probability(line.two_sided_adjusted),
        ]);
    }
    let lines = summary.comparison.lines.len();
    let table = fitted(table, page, &["p", "only A", "only B", "p corrected"]);
    let how = match summary.comparison.sampling {
        Sampling::Fixed => format!(
            "p: McNemar's exact test, two-sided; corrected: for {lines} lines, by Holm. [95 %]: Tango's score interval"
        ),
        Sampling::Stopped if summary.sequential => sequential(summary, lines),
        Sampling::Stopped => format!(
            "outcomes ended one of the campaigns, so p and [95 %] are valid whenever runs end; corrected: for {lines} lines, by Holm"
        ),
    };
    let _ = writeln!(out, "{table}\n{how}");
}

/// How p and intervals at any look are made, and how much weaker they are than those for a fixed
/// number of scenes.
fn sequential(summary: &CompareSummary, lines: usize) -> String {
    let how = format!(
        "p and [95 %] are valid however often you look: p is the inverse of an e-value of the scenes that only one side passes; \
         corrected: for {lines} lines, by Holm"
    );
    let strongest = summary
        .comparison
        .lines
        .iter()
        .min_by(|a, b| a.test.two_sided.total_cmp(&b.test.two_sided));
    let Some(line) = strongest else {
        return how;
    };
    format!(
        "{how}. That costs power: for {} scenes that were fixed before, p of `{}` would be {} instead of {}",
        line.table.pairs(),
        compared_name(&line.of),
        probability(line.table.test().two_sided),
        probability(line.test.two_sided)
    )
}

/// The known issues, which are not compared until their date.
fn known_issues(out: &mut String, summary: &CompareSummary) {
    for issue in &summary.known {
        let [a, b] = issue.runs.each_ref().map(Vec::len);
        let until = &issue.until;
        let counts = match issue.is_expired {
            true => format!("the date {until} is over, so their scenes count"),
            false => format!("until {until}, their scenes do not count"),
        };
        let _ = writeln!(
            out,
            "\nknown issue: {} fails in {a} runs of A and {b} of B ({}); {counts}",
            issue.fails.join(" + "),
            issue.reason
        );
    }
}

/// The rates without the runs that another engine contests.
fn without_contested(out: &mut String, summary: &CompareSummary) {
    let Some(found) = &summary.without_contested else {
        return;
    };
    let _ = writeln!(
        out,
        "\nwithout scenes whose verdict another engine contests ({} of {} are left)",
        found.pairs, summary.comparison.pairs
    );
    for line in &found.lines {
        let [a, b] = line.table.passed();
        let _ = writeln!(
            out,
            "  {}: A {a}, B {b} of {}; B − A {} percent",
            compared_name(&line.of),
            line.table.pairs(),
            difference(line)
        );
    }
}

fn difference(line: &ComparedLine) -> String {
    match &line.difference {
        Some(found) => format!(
            "{:+.1} [{:+.1}, {:+.1}]",
            100.0 * found.value,
            100.0 * found.low,
            100.0 * found.high
        ),
        None => "none decided".to_owned(),
    }
}

fn probability(p: f64) -> String {
    if p < 0.0001 {
        "<0.0001".to_owned()
    } else {
        format!("{p:.4}")
    }
}

fn flips(out: &mut String, summary: &CompareSummary) {
    for line in &summary.comparison.lines {
        for (what, runs) in [
            ("passed in A, failed in B", &line.worse),
            ("failed in A, passed in B", &line.better),
        ] {
            if !runs.is_empty() {
                let runs: Vec<String> = runs.iter().map(|(a, b)| format!("{a}/{b}")).collect();
                let _ = writeln!(
                    out,
                    "{}, {what} ({}): {}",
                    compared_name(&line.of),
                    runs.len(),
                    list(&runs)
                );
            }
        }
    }
}

/// Writes the scenes that were left out: a side that lost many more than the other biases the
/// rates.
fn left_out(out: &mut String, summary: &CompareSummary) {
    for line in &summary.comparison.lines {
        let lost = line.left_out[0].total();
        if lost > 0 {
            let [a, b] = line.left_out.map(undecided);
            let name = compared_name(&line.of);
            let _ = writeln!(
                out,
                "{name}: {lost} scenes left out because they were not decided in both (A: {a}; B: {b})"
            );
        }
    }
}

fn undecided(counts: Counts) -> String {
    let words: Vec<String> = Outcome::ALL
        .into_iter()
        .filter(|outcome| counts.get(*outcome) > 0)
        .map(|outcome| format!("{} {outcome}", counts.get(outcome)))
        .collect();
    words.join(", ")
}

fn alone(out: &mut String, summary: &CompareSummary) {
    for (name, of) in ["A", "B"].into_iter().zip(&summary.comparison.judged_alone) {
        if !of.is_empty() {
            let names: Vec<String> = of.iter().map(compared_name).collect();
            let _ = writeln!(
                out,
                "judged only in {name}, not compared: {}",
                names.join(", ")
            );
        }
    }
}

/// Names the lines by their answers, and how many scenes would decide.
fn answers(out: &mut String, summary: &CompareSummary) {
    let (level, margin) = (summary.answer_level(), summary.margin);
    if summary.comparison.is_same {
        let [a, b] = &summary.sides;
        let one = if a.campaign == b.campaign && a.started == b.started {
            "; they are one campaign"
        } else {
            ""
        };
        let _ = writeln!(
            out,
            "\nanswer: same: all {} runs have the same states and outcomes in A and B{one}",
            a.runs
        );
        return;
    }
    let _ = writeln!(
        out,
        "\nB is … than A (at the level {level}; rates within {} points count as equal)",
        100.0 * margin
    );
    for line in &summary.comparison.lines {
        let answer = summary.comparison.answer_of(line, level, margin);
        let needed = match answer {
            Answer::Underpowered {
                scenes: Some(scenes),
            } => format!(": about {scenes} scenes would decide"),
            Answer::Underpowered { scenes: None } => {
                ": over a million scenes would decide".to_owned()
            }
            _ => String::new(),
        };
        let _ = writeln!(
            out,
            "  {}: {}{needed}",
            compared_name(&line.of),
            answer.word()
        );
    }
    let _ = writeln!(out, "answer: {}", summary.answer().word());
}

fn verdict(out: &mut String, summary: &CompareSummary) {
    let Some(level) = summary.level else { return };
    let worse = summary.comparison.worse_at(level);
    let how = format!(
        "at the level {level} (exact, one-sided, corrected for {} lines)",
        summary.comparison.lines.len()
    );
    if worse.is_empty() {
        let _ = writeln!(out, "\nB is not shown to be worse {how}");
        return;
    }
    let _ = writeln!(out, "\nB is worse {how}:");
    for line in worse {
        let lost = |passed: u64| line.table.pairs() - passed;
        let why = match (&line.of, line.table.passed().map(lost)) {
            (Compared::Completion, [a, b]) => {
                format!(": {b} runs are broken or timed out, {a} in A")
            }
            _ => String::new(),
        };
        let p = probability(line.second_worse_adjusted);
        let _ = writeln!(out, "  {}: p = {p}{why}", compared_name(&line.of));
    }
}

fn list(names: &[String]) -> String {
    let mut text = names
        .iter()
        .take(MAX_LISTED)
        .cloned()
        .collect::<Vec<_>>()
        .join(", ");
    if names.len() > MAX_LISTED {
        let _ = write!(text, " and {} more", names.len() - MAX_LISTED);
    }
    text
}

fn more(out: &mut String, all: usize) {
    if all > MAX_LISTED {
        let _ = writeln!(
            out,
            "    and {} more: --format json has all",
            all - MAX_LISTED
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digests_are_abbreviated() {
        let digest = "4f6afc3d00112233445566778899aabb";
        assert_eq!(shortened(digest), "4f6afc3d");
        assert_eq!(shortened(&format!("0.1.0 ({digest})")), "0.1.0 (4f6afc3d)");
        assert_eq!(shortened("actcheck é 0.1.0"), "actcheck é 0.1.0");
    }
}
