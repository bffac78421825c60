//! Findings of the analysis for the terminal.

use std::fmt::Write as _;

use crate::summary::percent;
use crate::text::collisions::{collisions, shade};
use crate::text::{Page, command, fitted, ruled, scene_rule};
use crate::{Causes, FindingsSummary, PropertyReport, Proportion};
use actcheck_analysis::{Judged, Pattern, Sampling, TwoWay, TwoWayCell};
use actcheck_base::{Outcome, names};
use actcheck_verdict::Counts;

/// Maximum number of runs or scenes listed in one line; `--format json` has all.
const MAX_LISTED: usize = 8;
/// Maximum number of failure modes and of cascades listed.
const MAX_LINES: usize = 10;
/// Formats counts, failure modes, cascades and collisions, then each property with its patterns,
/// margins, trend, flaky scenes and heat maps.
///
/// Patterns are sentences; with `figures`, each has its statistics, too.
pub fn findings_text(summary: &FindingsSummary, figures: bool, page: Page) -> String {
    let mut out = String::new();
    let campaigns = list(summary.campaigns.iter().map(String::as_str));
    let plural = if summary.campaigns.len() == 1 {
        ""
    } else {
        "s"
    };
    let _ = writeln!(
        out,
        "{} runs of {} campaign{plural} ({campaigns})",
        summary.runs,
        summary.campaigns.len()
    );
    if summary.twins > 0 {
        let _ = writeln!(out, "{}", twins_line(summary.twins));
    }
    if summary.sampling == Sampling::Stopped {
        let _ = writeln!(
            out,
            "outcomes ended a campaign (--max-failures, or an interrupt): shares are biased, and intervals are valid for that"
        );
    }
    let _ = writeln!(
        out,
        "{} outcomes: {}",
        summary.counts.total(),
        counts(summary.counts)
    );
    if let Some(sampled) = summary.sampled_runs {
        let _ = writeln!(
            out,
            "counts, rates, margins and failure modes are of all runs; patterns and collisions of a sample of {sampled}"
        );
    }
    modes(&mut out, summary, page);
    cascades(&mut out, summary);
    collisions(&mut out, &summary.collisions, page);
    for report in &summary.properties {
        property(&mut out, report, summary, (figures, page));
    }
    page.set(&out)
}

fn twins_line(twins: u64) -> String {
    match twins {
        1 => "1 run is bit-for-bit a duplicate of a later one: both count once".to_owned(),
        _ => format!(
            "{twins} runs are bit-for-bit duplicates of a later one: each trace counts once"
        ),
    }
}

fn counts(counts: Counts) -> String {
    Outcome::ALL
        .map(|outcome| format!("{} {outcome}", counts.get(outcome)))
        .join(", ")
}

fn list<'a>(ids: impl ExactSizeIterator<Item = &'a str>) -> String {
    let more = ids.len().saturating_sub(MAX_LISTED);
    let shown: Vec<&str> = ids.take(MAX_LISTED).collect();
    let rest = if more > 0 {
        format!(", … ({more} more)")
    } else {
        String::new()
    };
    format!("{}{rest}", shown.join(", "))
}

fn modes(out: &mut String, summary: &FindingsSummary, page: Page) {
    if summary.modes.is_empty() {
        return;
    }
    out.push_str("\nfailure modes\n");
    let mut table = ruled();
    table.set_header(["share", "runs", "failed properties", "example"]);
    for mode in summary.modes.iter().take(MAX_LINES) {
        let failed: Vec<&str> = mode.failed.iter().map(|iri| names::local(iri)).collect();
        let failed = if failed.is_empty() {
            "none".to_owned()
        } else {
            failed.join(", ")
        };
        let share = format!(
            "{} [{:.0}–{:.0}]",
            percent(mode.share.rate),
            mode.share.low * 100.0,
            mode.share.high * 100.0
        );
        table.add_row([
            share,
            mode.runs.len().to_string(),
            failed,
            mode.runs.first().cloned().unwrap_or_default(),
        ]);
    }
    out.push_str(&fitted(table, page, &["example"]));
    rest(out, summary.modes.len());
}

fn rest(out: &mut String, all: usize) {
    if all > MAX_LINES {
        let _ = writeln!(out, "and {} more (--format json has all)", all - MAX_LINES);
    }
}

fn cascades(out: &mut String, summary: &FindingsSummary) {
    if summary.cascades.is_empty() {
        return;
    }
    out.push_str("\ncascades\n");
    let name = |of: &Judged| {
        format!(
            "{} ({} {})",
            names::local(&of.property),
            of.step,
            names::local(&of.action)
        )
    };
    for cascade in summary.cascades.iter().take(MAX_LINES) {
        let table = cascade.table;
        let share = |failed: u64, of: u64| {
            if of == 0 {
                "none".to_owned()
            } else {
                percent(failed as f64 / of as f64)
            }
        };
        let _ = writeln!(
            out,
            "if {} fails, {} fails in {} of {} runs; if it passes, in {} of {} (adjusted p {})",
            name(&cascade.first),
            name(&cascade.later),
            share(table.failed_in, table.failed_in + table.passed_in),
            table.failed_in + table.passed_in,
            share(table.failed_out, table.failed_out + table.passed_out),
            table.failed_out + table.passed_out,
            probability(cascade.q)
        );
    }
    rest(out, summary.cascades.len());
}

fn property(
    out: &mut String,
    report: &PropertyReport,
    summary: &FindingsSummary,
    (figures, page): (bool, Page),
) {
    let found = &report.findings;
    let _ = write!(
        out,
        "\n{} ({}): ",
        report.name(),
        names::local(&found.action)
    );
    match Proportion::sampled(
        found.counts.failed,
        found.counts.decided(),
        summary.sampling,
    ) {
        Some(share) => {
            let _ = writeln!(out, "fails in {share}");
        }
        None => out.push_str("was never decided\n"),
    }
    let undecided = found.counts.total() - found.counts.decided();
    if undecided > 0 {
        let _ = writeln!(out, "  {}", counts(found.counts));
    }
    if found.counts.failed > 0 {
        patterns(out, report, summary, figures);
    }
    margins(out, report);
    trend(out, report);
    if !report.flaky.is_empty() {
        let scenes: Vec<String> = report
            .flaky
            .iter()
            .map(|scene| {
                format!(
                    "{} scene {} ({} of {} passed)",
                    scene.campaign, scene.scene, scene.passed, scene.of
                )
            })
            .collect();
        let (flaky, all) = (scenes.len(), report.repeated_scenes);
        let _ = writeln!(
            out,
            "  flaky in {flaky} of {all} scenes: {}",
            list(scenes.iter().map(String::as_str))
        );
    }
    report.maps.iter().for_each(|shown| map(out, shown, page));
}

fn patterns(out: &mut String, report: &PropertyReport, summary: &FindingsSummary, figures: bool) {
    let found = &report.findings;
    let described = |out: &mut String, causes: &Causes<'_>, mark: String, pattern: &Pattern| {
        if figures {
            let _ = writeln!(out, "  {mark} {}", causes.sentence(pattern));
            evidence(out, causes, pattern);
        } else {
            let _ = writeln!(out, "  {mark} {}", causes.plain_sentence(pattern));
            confirmed(out, causes, pattern);
        }
    };
    out.push_str("  when (conditions: the scene and the errors drawn):\n");
    for (number, pattern) in found.patterns.confirmed().enumerate() {
        described(out, &report.when(), format!("{}.", number + 1), pattern);
        more_scenes(out, report, pattern, summary, number + 1);
    }
    strongest(out, &report.when(), "condition");
    if figures {
        searched(out, report.when(), summary);
    }
    out.push_str("  how (effects during the action):\n");
    for pattern in found.effects.patterns.confirmed() {
        described(out, &report.how(), " -".to_owned(), pattern);
    }
    strongest(out, &report.how(), "effect");
    if figures {
        searched(out, report.how(), summary);
    } else {
        out.push_str("  (`-v` prints intervals, p-values, and the extent of the search)\n");
    }
    if found.twins + found.repeated > 0 {
        let _ = writeln!(
            out,
            "  ({} runs are bit-for-bit duplicates of a later one, {} repeat the scene of an earlier one: each counts once)",
            found.twins, found.repeated
        );
    }
    if found.weighted_runs > 0 {
        let _ = writeln!(
            out,
            "  (a search chose the scenes of {} runs: rates describe these runs, not the configured ranges)",
            found.weighted_runs
        );
    }
}

/// Writes the strongest single conditions or effects if none is confirmed.
fn strongest(out: &mut String, causes: &Causes<'_>, noun: &str) {
    let patterns = causes.patterns;
    if patterns.confirmed().next().is_some() {
        return;
    }
    if patterns.parameters == 0 && patterns.tried == 0 && patterns.strongest.is_empty() {
        let _ = writeln!(
            out,
            "   no {noun} was searched: too few runs, or nothing that varies"
        );
        return;
    }
    if patterns.strongest.is_empty() {
        let _ = writeln!(out, "   no {noun} differs between its failures and passes");
        return;
    }
    let _ = writeln!(
        out,
        "   none is confirmed beyond chance; the strongest (perhaps by chance):"
    );
    for strongest in &patterns.strongest {
        let _ = writeln!(out, "   ? {}", causes.strongest_sentence(strongest));
        let needed = match strongest.runs_needed {
            Some(runs) => format!("; if it is real, about {runs} runs would show it"),
            None => String::new(),
        };
        let (p, corrected) = (probability(strongest.p), probability(strongest.p_corrected));
        let _ = writeln!(out, "     p {p}, corrected {corrected}{needed}");
    }
}

/// Writes the extent of a search.
fn searched(out: &mut String, causes: Causes<'_>, summary: &FindingsSummary) {
    let patterns = causes.patterns;
    let confirmed = patterns.confirmed().count();
    let unconfirmed = patterns.patterns.len() - confirmed;
    if unconfirmed > 0 {
        let _ = writeln!(
            out,
            "  {unconfirmed} more were not confirmed on the held-out runs (--format json lists them)"
        );
    }
    if patterns.tried == 0 {
        let _ = writeln!(
            out,
            "  (too few runs failed, or passed, to search for one; {} were held out)",
            patterns.held_out
        );
        return;
    }
    let _ = writeln!(
        out,
        "  (tried {} conditions, up to {} combined, on {} parameters of {} runs; {} were held out to confirm; level {})",
        patterns.tried,
        patterns.depth,
        patterns.parameters,
        patterns.runs - patterns.held_out,
        patterns.held_out,
        summary.level
    );
    if patterns.depth == 3 && patterns.combined < patterns.parameters {
        let _ = writeln!(
            out,
            "  (combinations of three only use the {} most promising parameters)",
            patterns.combined
        );
    }
}

/// Writes how often a pattern failed in the runs that were held out to confirm it.
fn confirmed(out: &mut String, causes: &Causes<'_>, pattern: &Pattern) {
    let held_out = pattern.held_out;
    let _ = writeln!(
        out,
        "     confirmed on runs that were held out: {} of {} fail; runs: {}",
        held_out.failed_in,
        held_out.failed_in + held_out.passed_in,
        list(causes.runs(pattern).into_iter())
    );
}

fn evidence(out: &mut String, causes: &Causes<'_>, pattern: &Pattern) {
    let held_out = pattern.held_out;
    let _ = writeln!(
        out,
        "     {:.1} times as often as all runs; WRAcc {:.3}; p {}, adjusted {}; held out: {} of {} fail, p {}",
        pattern.lift,
        pattern.wracc,
        probability(pattern.p),
        probability(pattern.q),
        held_out.failed_in,
        held_out.failed_in + held_out.passed_in,
        probability(pattern.p_held_out)
    );
    let _ = writeln!(out, "     runs: {}", list(causes.runs(pattern).into_iter()));
}

/// Writes the command that generates more scenes of a pattern.
fn more_scenes(
    out: &mut String,
    report: &PropertyReport,
    pattern: &Pattern,
    summary: &FindingsSummary,
    number: usize,
) {
    let parameters = &report.findings.input.parameters;
    if scene_rule(&pattern.conditions, parameters, "").is_ok() {
        let more = command(
            &summary
                .scene_rule(report.name(), number)
                .fixed("> more.rls"),
        );
        let _ = writeln!(
            out,
            "     more such scenes: {more}, and `require = \"more.rls\"` under `[scene]` of a configuration in the same \
             folder"
        );
    }
}

/// Formats a probability, such as `0.030` or `2e-7`.
fn probability(p: f64) -> String {
    match p {
        p if p <= 0.0 => "< 1e-300".to_owned(),
        p if p < 0.001 => format!("{p:.0e}"),
        p => format!("{p:.3}"),
    }
}

fn margins(out: &mut String, report: &PropertyReport) {
    if let Some(margins) = report.findings.margins {
        let unit = report.unit.as_deref().filter(|unit| *unit != "1");
        let unit = unit.map_or_else(String::new, |unit| format!(" {unit}"));
        let _ = writeln!(
            out,
            "  margin{unit}: min {:.4}, 5 % {:.4}, 25 % {:.4}, median {:.4}, 75 % {:.4}, 95 % {:.4}, max {:.4}",
            margins.least,
            margins.p05,
            margins.p25,
            margins.p50,
            margins.p75,
            margins.p95,
            margins.most
        );
    }
}

fn trend(out: &mut String, report: &PropertyReport) {
    let points = &report.trend.points;
    if points.len() < 2 {
        return;
    }
    let shown: Vec<String> = points
        .iter()
        .map(|point| {
            format!(
                "{} {}",
                point.campaign,
                percent(point.failed as f64 / point.runs.max(1) as f64)
            )
        })
        .collect();
    let _ = writeln!(
        out,
        "  over campaigns: {}",
        list(shown.iter().map(String::as_str))
    );
    for change in &report.trend.changes {
        let _ = writeln!(
            out,
            "  changed at {}: from {} to {} (adjusted p {})",
            points[change.at].campaign,
            percent(change.before.rate),
            percent(change.behind.rate),
            probability(change.p)
        );
    }
}

fn map(out: &mut String, map: &TwoWay, page: Page) {
    let (down, across) = (
        map.by.first().map_or("", String::as_str),
        map.by.get(1).map_or("", String::as_str),
    );
    let title = if across.is_empty() {
        down.to_owned()
    } else {
        format!("{down} (down) and {across} (across)")
    };
    let _ = writeln!(out, "\n  failures by {title}");
    let mut table = ruled();
    table.set_header(std::iter::once(String::new()).chain(map.across.iter().cloned()));
    for (label, cells) in map.down.iter().zip(&map.cells) {
        table.add_row(std::iter::once(label.clone()).chain(cells.iter().map(shaded)));
    }
    out.push_str(&fitted(table, page, &[]));
}

/// Formats a heat map cell, such as `▒ 45 % of 40`.
fn shaded(cell: &TwoWayCell) -> String {
    match cell.failing {
        None => String::new(),
        Some(failing) => format!(
            "{} {} of {}",
            shade(failing.rate),
            percent(failing.rate),
            cell.runs
        ),
    }
}
